//! Pieces that several reports share.

use anyhow::Result;
use serde::Serialize;
use std::time::Instant;

/// A report as it is written to a file: for people to read, too.
pub fn to_json(report: &impl Serialize) -> Result<String> {
    Ok(format!("{}\n", serde_json::to_string_pretty(report)?))
}

/// How long each stage took, in the order in which they ran.
#[derive(Debug, Default, Serialize)]
#[serde(transparent)]
pub struct StageTimes(serde_json::Map<String, serde_json::Value>);

impl StageTimes {
    /// Runs a stage and notes its time in milliseconds.
    pub fn time<T>(&mut self, stage: &str, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        let ms = start.elapsed().as_secs_f64() * 1e3;
        self.0.insert(stage.to_owned(), serde_json::json!((ms * 1e3).round() / 1e3));
        result
    }

    /// Milliseconds of a stage; 0 where it did not run.
    pub fn of(&self, stage: &str) -> f64 {
        self.0.get(stage).and_then(serde_json::Value::as_f64).unwrap_or(0.0)
    }
}

//! Parts that several reports share.

use anyhow::Result;
use serde::Serialize;
use std::time::Instant;

/// A report as written to a file, in a readable form.
pub fn to_json(report: &impl Serialize) -> Result<String> {
    Ok(format!("{}\n", serde_json::to_string_pretty(report)?))
}

/// The time of each stage, in the order of the stages.
#[derive(Debug, Default, Serialize)]
#[serde(transparent)]
pub struct StageTimes(serde_json::Map<String, serde_json::Value>);

impl StageTimes {
    /// Runs a stage and records its time in milliseconds.
    pub fn time<T>(&mut self, stage: &str, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        let ms = start.elapsed().as_secs_f64() * 1e3;
        self.0.insert(stage.to_owned(), serde_json::json!((ms * 1e3).round() / 1e3));
        result
    }

    /// Milliseconds of a stage; 0 if the stage did not run.
    pub fn of(&self, stage: &str) -> f64 {
        self.0.get(stage).and_then(serde_json::Value::as_f64).unwrap_or(0.0)
    }
}

//! How long each stage of a piece of work takes.

use crate::clock::Instant;
use serde::Serialize;

/// The time of each stage, in the order of the stages.
#[derive(Debug, Default, Serialize)]
#[serde(transparent)]
pub struct StageTimes {
    times: serde_json::Map<String, serde_json::Value>,
    #[serde(skip)]
    watch: Option<fn(&str, f64)>,
}

impl StageTimes {
    /// Times that also go to a function: the stage, and its time in milliseconds.
    #[must_use]
    pub fn watched(watch: fn(&str, f64)) -> Self {
        Self { watch: Some(watch), ..Self::default() }
    }

    /// Runs a stage, or a further part of it, and adds its time in milliseconds.
    pub fn time<T>(&mut self, stage: &str, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let result = work();
        let ms = start.elapsed().as_secs_f64() * 1e3;
        if let Some(watch) = self.watch {
            watch(stage, ms);
        }
        let all = self.of(stage) + ms;
        self.times.insert(stage.to_owned(), serde_json::json!((all * 1e3).round() / 1e3));
        result
    }

    /// Milliseconds of a stage; 0 if the stage did not run.
    #[must_use]
    pub fn of(&self, stage: &str) -> f64 {
        self.times.get(stage).and_then(serde_json::Value::as_f64).unwrap_or(0.0)
    }
}

//! Parts that several reports share.

use super::print;
use anyhow::Result;
pub use nirspi::stage_times::StageTimes;
use serde::Serialize;
use std::process::ExitCode;

/// How a command prints its report.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct ReportArgs {
    /// Print the report as JSON
    #[arg(long)]
    pub json: bool,
}

impl ReportArgs {
    /// Prints the report of a command that has done its work, as JSON or in words.
    pub fn print<R: Serialize + ?Sized>(
        self,
        report: &R,
        say: impl FnOnce(&R) -> Result<()>,
    ) -> Result<ExitCode> {
        if self.json {
            print::json(report)?;
        } else {
            say(report)?;
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// A report as written to a file, in a readable form.
pub fn to_json(report: &impl Serialize) -> Result<String> {
    Ok(format!("{}\n", serde_json::to_string_pretty(report)?))
}

/// Times of stages, which a user who wants detail is told.
pub fn stages() -> StageTimes {
    StageTimes::watched(|stage, ms| print::detail(format_args!("{stage}: {ms:.1} ms")))
}

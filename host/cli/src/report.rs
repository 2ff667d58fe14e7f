//! Parts that several reports share.

use super::print;
use anyhow::Result;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use nirspi::picture::FigureStyle;
use nirspi::provenance::Provenance;
pub use nirspi::stage_times::StageTimes;
use serde::Serialize;
use std::process::ExitCode;
use std::str::FromStr;

/// How a command prints its report.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct ReportArgs {
    /// Print the report as JSON
    #[arg(long)]
    pub json: bool,
}

/// How figures are drawn.
#[derive(Debug, Clone, Copy, Default, clap::Args)]
pub struct FigureArgs {
    /// What figures are made for: each is a PNG, an SVG and a PDF, and a chart's points a CSV
    #[arg(long, value_name = "STYLE", default_value = FigureStyle::default().name(),
          value_parser = words(&FigureStyle::ALL, |style| (style.name(), style.about())))]
    pub figure: FigureStyle,
}

/// What happens to a file that has the name of a result.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct Overwrite {
    /// Replace a file that has the name of the result
    #[arg(long)]
    pub overwrite: bool,
}

impl ReportArgs {
    /// Prints the report of a command that has done its work, as JSON with its provenance or in words.
    pub fn print<R: Serialize + ?Sized>(
        self,
        report: &R,
        provenance: &Provenance,
        say: impl FnOnce(&R) -> Result<()>,
    ) -> Result<ExitCode> {
        if self.json {
            print::json(report, provenance)?;
        } else {
            say(report)?;
        }
        Ok(ExitCode::SUCCESS)
    }

    /// Prints an answer that is no report of readings, such as a list of devices, as JSON or in words.
    pub fn print_answer<R: Serialize + ?Sized>(
        self,
        answer: &R,
        say: impl FnOnce(&R) -> Result<()>,
    ) -> Result<ExitCode> {
        if self.json {
            print::json_answer(answer)?;
        } else {
            say(answer)?;
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Times of stages, which a user who wants detail is told.
pub fn stages() -> StageTimes {
    StageTimes::watched(|stage, ms| print::detail(format_args!("{stage}: {ms:.1} ms")))
}

/// Reads one of these words; the help lists each with a line about it.
pub fn words<T>(
    all: &[T],
    word: impl Fn(T) -> (&'static str, &'static str),
) -> impl TypedValueParser<Value = T>
where
    T: FromStr<Err: Into<Box<dyn std::error::Error + Send + Sync>>> + Copy + Send + Sync + 'static,
{
    let shown = |&value: &T| PossibleValue::new(word(value).0).help(word(value).1);
    PossibleValuesParser::new(all.iter().map(shown)).try_map(|word| word.parse::<T>())
}

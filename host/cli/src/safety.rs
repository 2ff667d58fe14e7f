//! `nirspi camera safety`: the safety case of a camera's light.

use super::print;
use super::report::ReportArgs;
use anyhow::{Context, Result};
use nirspi_eval::safety_case::SafetyCase;
use nirspi_virtual::read_camera_model;
use std::process::ExitCode;

/// Say what eye and skin receive from a camera's LEDs, and what each single fault leaves lit, for how long
///
/// The light is computed from a camera description, the times are the limits of firmware and gateware. Nothing was measured on a
/// camera, and this is no certificate.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi camera safety\n\
    \x20 nirspi camera safety lab.toml --json")]
pub struct Args {
    /// paper, fga015, one-metre or a TOML file
    #[arg(value_name = "NAME|FILE", default_value = "paper")]
    camera_model: String,
    #[command(flatten)]
    report: ReportArgs,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let case = SafetyCase::of(&read_camera_model(&args.camera_model)?)
        .with_context(|| args.camera_model.clone())?;
    args.report.print_answer(&case, |case| {
        print::line(format_args!("camera {} (computed, not measured)\n", case.camera))?;
        print::line(case.exposure_table())?;
        print::line(format_args!("{}\n", case.risk_groups()))?;
        print::line(case.fault_table().trim_end())
    })
}

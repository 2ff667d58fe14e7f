//! `nirspi camera devices`: lists the cameras that answer.

use super::print;
use super::report::ReportArgs;
use anyhow::{Result, bail};
use nirspi::devices::{Device, list};
use std::process::ExitCode;

/// List the cameras that can be used
///
/// The command looks at USB, at the TCP addresses given and at the default address of `nirspi dev virtual`. Serial ports are
/// listed but not opened, because another device may be connected there. The virtual camera is part of this program, so it
/// is always listed.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n\
    \x20 nirspi camera devices --tcp 192.168.0.7:1550")]
pub struct Args {
    /// Look at this address, too; may be given several times
    #[arg(long, value_name = "HOST:PORT")]
    tcp: Vec<String>,
    #[command(flatten)]
    report: ReportArgs,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let devices = list(&args.tcp);
    args.report.print_answer(&devices, |devices| {
        let line = |device: &Device| print::line(format_args!("{:<28} {device}", device.camera));
        devices.iter().try_for_each(line)
    })?;
    match devices.iter().find_map(|device| device.problem.as_ref().map(|why| (device, why))) {
        Some((device, why)) => bail!("{}: {why}", device.camera),
        None => Ok(ExitCode::SUCCESS),
    }
}

//! `nirspi eval table1`: the time of each stage on this machine.

use super::OutputArgs;
use crate::progress::Progress;
use crate::{print, refused};
use anyhow::Result;
use nirspi_eval::table1::{Report, Settings, chart, table1};
use nirspi_recon::Sampling;
use nirspi_recon::words::{count, count_of};
use std::process::ExitCode;

/// Time of every stage of one picture beside the paper's Table 1
///
/// The acquisition time is not measured: it is 20 ms, as in the paper. The other stages are timed on the CPU of this machine,
/// one picture at a time, from a frame of the virtual camera to 64 x 64 pixels. T_2D is given without the diffusion network
/// and with it. Build the program with --release.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n\
    \x20 nirspi eval table1 --repeats 200 --out table1/")]
pub struct Args {
    /// Pictures to time
    #[arg(long, value_name = "N", default_value_t = 100,
          value_parser = clap::value_parser!(u32).range(2..=100_000))]
    repeats: u32,
    /// Share of all patterns to show, the first in zig-zag order: 0.3 or 30%
    #[arg(long, value_name = "SHARE", default_value_t = Sampling::HALF)]
    sampling: Sampling,
    /// Seed of the picture
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    output: OutputArgs,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let settings =
        Settings { repeats: args.repeats, sampling: args.sampling.share(), seed: args.seed };
    let bar = Progress::of("table 1", args.repeats, "pictures");
    let report = table1(&settings, &|| bar.add(1)).map_err(refused)?;
    drop(bar);
    let picture = || Ok(chart(&report).into());
    args.output.hand_over("table1", &report, picture, say)
}

fn say(report: &Report) -> Result<()> {
    print::line(format_args!(
        "Table 1, {}, {}{}",
        count(report.repeats, "picture"),
        count_of(report.cores, "CPU core"),
        if report.optimised { "" } else { ", NOT OPTIMISED: build with --release" }
    ))?;
    print::line("         p50 ms    p99 ms    paper ms")?;
    for row in &report.rows {
        let (from, to) = row.paper_ms;
        let paper = if from == to { format!("{from}") } else { format!("{from} to {to}") };
        let (p50, p99) = (row.p50_ms, row.p99_ms);
        print::line(format_args!(
            "{:<6} {p50:8.2}  {p99:8.2}    {paper:<9} {}",
            row.symbol, row.stage
        ))?;
    }
    print::reading(&report.reading)
}

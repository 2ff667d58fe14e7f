//! `nirspi eval table1`: the time of each stage on this machine.

use super::OutputArgs;
use crate::{print, refused};
use anyhow::Result;
use indicatif::ProgressBar;
use nirspi::files::image::encode_rgb;
use nirspi_eval::table1::{Report, Settings, chart, table1};
use std::process::ExitCode;

/// Time of every stage of one picture beside the paper's Table 1
///
/// Acquisition is an input: so many sweeps of patterns and complements as fill 20 ms, as in the paper. The others are
/// timed on this machine's CPU, one picture at a time, from a frame of the virtual camera to 64 x 64 pixels. T_2D stands
/// there without diffusion and with it. Build with --release.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n\
    \x20 nirspi eval table1 --repeats 200 --out table1/")]
pub struct Args {
    /// Pictures to time
    #[arg(long, value_name = "N", default_value_t = 100,
          value_parser = clap::value_parser!(u32).range(2..=100_000))]
    repeats: u32,
    /// Share of the patterns, in zig-zag order
    #[arg(long, value_name = "0..1", default_value_t = 0.5, allow_negative_numbers = true)]
    sampling: f64,
    /// Seed of the picture
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    output: OutputArgs,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let settings = Settings { repeats: args.repeats, sampling: args.sampling, seed: args.seed };
    let bar = ProgressBar::new(u64::from(args.repeats));
    let report = table1(&settings, &|| bar.inc(1)).map_err(refused)?;
    bar.finish_and_clear();
    let picture = || Ok(encode_rgb(&chart(&report).render()));
    args.output.hand_over("table1", &report, picture, say)?;
    Ok(ExitCode::SUCCESS)
}

fn say(report: &Report) -> Result<()> {
    print::line(format_args!(
        "Table 1, {} pictures, {} CPU cores{}",
        report.repeats,
        report.cores,
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
    for line in &report.reading {
        print::line(format_args!("reading: {line}"))?;
    }
    Ok(())
}

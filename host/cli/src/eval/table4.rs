//! `nirspi eval table4`: spatial resolution in rain, NIR-SPI, VIS and networks, by slanted edge and
//! by bars.

use super::TakenArgs;
use crate::print;
use crate::progress::Progress;
use anyhow::Result;
use nirspi_eval::estimate::Estimate;
use nirspi_eval::table4::{Report, chart, pictures_of, table4};
use std::process::ExitCode;

/// Spatial resolution in rain beside the paper's Table 4: NIR-SPI, VIS and networks, in mm on the target
///
/// MTF50 and MTF10 are the line widths at which the transfer of a slanted edge falls to a half and to a tenth; bars are the
/// finest bars that keep a tenth of their contrast. The edge is taken --scenes times, with other rain and other noise in each
/// picture. The power of the noise is subtracted, so more scenes narrow the intervals and do not move the figures. `lens` is
/// computed from lens and emitter alone.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n\
    \x20 nirspi eval table4 --scenes 200 --out table4/")]
pub struct Args {
    /// Pictures of the edge at each distance
    #[arg(long, value_name = "N", default_value_t = 200,
          value_parser = clap::value_parser!(u32).range(20..=100_000))]
    scenes: u32,
    #[command(flatten)]
    taken: TakenArgs,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let settings = args.taken.settings(args.scenes)?;
    let bar = Progress::of("table 4", pictures_of(&settings), "pictures");
    let report = table4(&settings, &|| bar.add(1))?;
    drop(bar);
    let picture = || Ok(chart(&report).into());
    args.taken.output.hand_over("table4", &report, picture, say)
}

fn say(report: &Report) -> Result<()> {
    print::line(format_args!(
        "Table 4, rain {}, {} edges a distance, {} sweeps a picture; line width in mm (ours simulated; ± is 95 %)",
        report.rain, report.scenes, report.frames
    ))?;
    print::line(
        "image                distance  pixel  defocus  lens MTF50, MTF10  MTF50            MTF10            bars   paper",
    )?;
    for row in &report.rows {
        let text =
            |estimate: &Option<Estimate>| estimate.map_or_else(|| "none".to_owned(), |e| e.text(2));
        let bars = row.bars_mm.map_or_else(|| "none".to_owned(), |mm| format!("{mm:.1}"));
        print::line(format_args!(
            "{:<20} {:<8}  {:<5.2}  {:<7.1}  {:<17}  {:<15}  {:<15}  {:<5}  {}",
            row.image.name(),
            format!("{} m", row.distance_m),
            row.pixel_mm,
            row.defocus_mm,
            row.lens_mm.map_or_else(|| "-".to_owned(), |[a, b]| format!("{a:.2}, {b:.2}")),
            text(&row.mtf50_mm),
            text(&row.mtf10_mm),
            bars,
            row.paper_mm
        ))?;
    }
    print::reading(&report.reading)
}

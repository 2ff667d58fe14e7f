//! `nirspi eval table3`: image quality in rain and without: NIR-SPI, VIS, and NIR-SPI enhanced by
//! networks.

use super::TakenArgs;
use crate::print;
use crate::progress::Progress;
use anyhow::Result;
use nirspi_eval::table3::{Report, Row, Table};
use std::process::ExitCode;

/// Image quality in rain beside the paper's Table 3: NIR-SPI, VIS and the networks
///
/// Each target of 43 mm shows one of 62 characters in one of six typefaces that training has not seen. The virtual camera
/// takes each target in 15 klx of daylight at 0.3, 0.6 and 1 m, with rain and noise of its own. An ordinary camera (VIS)
/// takes the same targets, and networks enhance the images of NIR-SPI. Intervals are 95 %, over characters and typefaces.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n\
    \x20 nirspi eval table3 --scenes 186 --out table3/")]
pub struct Args {
    /// Scenes at each distance; 62 show every character once, 372 in every typeface
    #[arg(long, value_name = "N", default_value_t = 186,
          value_parser = clap::value_parser!(u32).range(2..=100_000))]
    scenes: u32,
    #[command(flatten)]
    taken: TakenArgs,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let settings = args.taken.settings(args.scenes)?;
    let bar = Progress::of("table 3", Table::pictures(&settings), "pictures");
    let table = Table::take(settings, &|| bar.add(1))?;
    drop(bar);
    let report = table.report()?;
    let picture = || Ok(table.picture()?);
    args.taken.output.hand_over("table3", &report, picture, say)
}

fn say(report: &Report) -> Result<()> {
    print::line(format_args!(
        "Table 3, rain {}, {} scenes a distance, {} sweeps a picture (ours simulated; 95 % in brackets)",
        report.rain, report.scenes, report.frames
    ))?;
    print::line(format_args!("typefaces: {}", report.typefaces.join(", ")))?;
    print::line(
        "image                distance  PSNR dB                   SSIM                      correlation               without rain     blank     Fréchet                 paper",
    )?;
    for row in &report.rows {
        print::line(format_args!(
            "{:<20} {:<8}  {:<24}  {:<24}  {:<24}  {:5.2} dB, {:.3}  {:5.2} dB  {:<22}  {} dB, {}{}{}",
            row.image.name(),
            at(row.distance_m),
            row.psnr_db.text(2),
            row.ssim.text(3),
            row.correlation.text(2),
            row.dry_psnr_db.value,
            row.dry_ssim.value,
            row.blank_psnr_db.value,
            row.frechet_character_distance.text(1),
            row.paper_psnr_db,
            row.paper_ssim,
            fid(row),
            if row.no_measurable_image { "; no measurable image" } else { "" }
        ))?;
    }
    print::line("differences on the same scenes: PSNR dB, SSIM")?;
    for d in &report.differences {
        print::line(format_args!(
            "{:<20} - {:<20} {:<8}  {:<28}  {}",
            d.image.name(),
            d.minus,
            at(d.distance_m),
            d.psnr_db.text(3),
            d.ssim.text(4)
        ))?;
    }
    print::reading(&report.reading)
}

fn at(distance_m: Option<f64>) -> String {
    distance_m.map_or_else(|| "all".to_owned(), |m| format!("{m} m"))
}

fn fid(row: &Row) -> String {
    row.paper_fid.map_or_else(String::new, |paper| format!(", FID {paper}"))
}

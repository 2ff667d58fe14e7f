//! `nirspi eval table3`: image quality in rain and without it: NIR-SPI, VIS, and NIR-SPI enhanced by networks.

use super::{ExposureArgs, OutputArgs, progress};
use crate::print;
use anyhow::Result;
use nirspi::files::image::encode_rgb;
use nirspi_eval::table3::{Report, Row, Settings, Table};
use std::path::PathBuf;
use std::process::ExitCode;

/// Image quality in rain beside the paper's Table 3: NIR-SPI, VIS and the networks
///
/// Characters of 43 mm in 15 klx of daylight at 0.3, 0.6 and 1 m, each with rain and noise of its own, through the
/// whole virtual camera; an ordinary camera sees the same, and two networks enhance what NIR-SPI saw.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n\
    \x20 nirspi eval table3 --scenes 200 --out table3/")]
pub struct Args {
    /// Scenes at each distance
    #[arg(long, value_name = "N", default_value_t = 200,
          value_parser = clap::value_parser!(u32).range(2..=100_000))]
    scenes: u32,
    #[command(flatten)]
    exposure: ExposureArgs,
    /// Inception-v3's weights in safetensors with torchvision's names, for FID; a second or so a picture
    #[arg(long, value_name = "FILE")]
    inception: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let camera = args.exposure.model.read()?;
    let settings = Settings {
        scenes: args.scenes,
        exposure: args.exposure.exposure(&camera),
        camera,
        inception: args.inception.clone(),
    };
    let bar = progress(settings.pictures(), "table 3");
    let table = Table::take(settings, &|| bar.inc(1))?;
    bar.finish_and_clear();
    let report = table.report()?;
    let picture = || Ok(encode_rgb(&table.picture()?.render()));
    args.output.hand_over("table3", &report, picture, say)?;
    Ok(ExitCode::SUCCESS)
}

fn say(report: &Report) -> Result<()> {
    print::line(format_args!(
        "Table 3, rain {}, {} scenes a distance, {} sweeps a picture (ours simulated; ± is 95 %)",
        report.rain, report.scenes, report.frames
    ))?;
    print::line(
        "image                distance  PSNR dB           SSIM               without rain     blank     Fréchet  paper",
    )?;
    for row in &report.rows {
        let distance = row.distance_m.map_or_else(|| "all".to_owned(), |m| format!("{m} m"));
        print::line(format_args!(
            "{:<20} {:<8}  {:<16}  {:<17}  {:5.2} dB, {:.3}  {:5.2} dB  {:7.1}  {} dB, {}{}",
            row.image.name(),
            distance,
            row.psnr_db.text(2),
            row.ssim.text(3),
            row.dry_psnr_db.mean,
            row.dry_ssim.mean,
            row.blank_psnr_db.mean,
            row.frechet_character_distance,
            row.paper_psnr_db,
            row.paper_ssim,
            fid(row)
        ))?;
    }
    for line in &report.reading {
        print::line(format_args!("reading: {line}"))?;
    }
    Ok(())
}

fn fid(row: &Row) -> String {
    match (row.fid, row.paper_fid) {
        (Some(ours), Some(paper)) => format!("; FID {ours:.1}, paper {paper}"),
        (Some(ours), None) => format!("; FID {ours:.1}"),
        (None, Some(paper)) => format!(", FID {paper}"),
        (None, None) => String::new(),
    }
}

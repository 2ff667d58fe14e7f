//! `nirspi eval table4`: spatial resolution in rain, NIR-SPI and VIS, by slanted edge and by bars.

use super::shot::{Conditions, Exposure, Shots, progress, shoot};
use super::{DISTANCES_M, Estimate};
use crate::cli::camera::Rain;
use crate::cli::print;
use anyhow::Result;
use nirspi::files::image::encode_rgb;
use nirspi::files::output::OutputDir;
use nirspi::picture::{Axis, Chart, Line};
use nirspi::resolution::{bar_scene, bar_transfer, edge_mtf, edge_scene, line_width_px};
use nirspi_optics::{Projector, Scene};
use nirspi_recon::Image;
use rayon::prelude::*;
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

/// Spatial resolution in rain beside the paper's Table 4: NIR-SPI and VIS, in mm on the target
///
/// Width of a line at which the transfer of a slanted edge falls to a half (MTF50) and to a tenth (MTF10), and the
/// finest bars that keep a tenth of their contrast. The edge is taken --scenes times in groups of a tenth, averaged
/// before they are evaluated, so that the figures are of the optics and not of the noise; rain and noise differ in
/// every picture.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n\
    \x20 nirspi eval table4 --scenes 200 --out table4/")]
pub struct Args {
    /// Pictures of the edge at each distance
    #[arg(long, value_name = "N", default_value_t = 200,
          value_parser = clap::value_parser!(u32).range(20..=100_000))]
    scenes: u32,
    #[command(flatten)]
    exposure: Exposure,
    /// Folder for table4.json and table4.png
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

/// Groups that the pictures of the edge are averaged in; their spread gives the interval.
const GROUPS: u32 = 10;

/// Pictures of each bar width, averaged.
const BAR_PICTURES: u32 = 10;

/// Bars tried, in pixels of the grid.
const BARS_PX: [f64; 10] = [1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0];

/// Contrast that bars must keep to count as resolved.
const RESOLVED: f64 = 0.1;

/// Edge of the drawn scenes, in pixels.
const SCENE_PX: usize = 512;

/// The paper's rows without networks, in mm.
const PAPER: [(&str, [f64; 3]); 2] = [("VIS", [45.0, 48.0, 60.0]), ("NIR-SPI", [5.0, 25.0, 45.0])];

/// What the figures rest on.
fn reading() -> Vec<String> {
    let projector = Projector::default();
    let of = |length: fn(&Projector, f64) -> f64| {
        DISTANCES_M.map(|m| format!("{:.1}", length(&projector, m * 1e3))).join(", ")
    };
    vec![
        format!(
            "NIR-SPI: a pixel is {} mm wide and the lens's defocus disc {} mm; the paper's 5, 25, 45 mm lie close to \
             the disc's width, ours to the width of a line that survives it",
            of(|p, mm| p.field_mm(mm) / 32.0),
            of(Projector::blur_mm)
        ),
        "VIS: a focused camera on the same grid; the paper's 45 to 60 mm are coarser than its 43 mm letters".to_owned(),
        "what rain does to these: compare with --rain none".to_owned(),
    ]
}

#[derive(Debug, Serialize)]
struct Report {
    simulated: bool,
    rain: Rain,
    scenes: u32,
    frames: u32,
    seed: u64,
    rows: Vec<Row>,
    reading: Vec<String>,
}

#[derive(Debug, Serialize)]
struct Row {
    image: &'static str,
    distance_m: f64,
    pixel_mm: f64,
    defocus_mm: f64,
    mtf50_mm: Option<Estimate>,
    mtf10_mm: Option<Estimate>,
    /// The finest bars, of all wider ones are resolved; `null`: none of those tried.
    bars_mm: Option<f64>,
    /// Bar width in mm and contrast kept.
    bar_contrast: Vec<(f64, f64)>,
    paper_mm: f64,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let bars = BARS_PX.len() as u32 * BAR_PICTURES;
    let bar = progress(DISTANCES_M.len() * (args.scenes + bars) as usize, "table 4");
    let mut rows = Vec::new();
    for (k, distance_m) in DISTANCES_M.into_iter().enumerate() {
        let edges: Vec<Shots> = (0..args.scenes)
            .into_par_iter()
            .map(|i| {
                let shots = take(args, edge_scene(SCENE_PX), distance_m, u64::from(i));
                bar.inc(1);
                shots
            })
            .collect::<Result<_>>()?;
        let contrasts: Vec<[f64; 2]> = BARS_PX
            .par_iter()
            .map(|&bar_px| {
                let contrast = bar_contrast(args, distance_m, bar_px)?;
                bar.inc(u64::from(BAR_PICTURES));
                Ok(contrast)
            })
            .collect::<Result<_>>()?;
        for (which, (image, paper_mm)) in PAPER.into_iter().enumerate() {
            let of: fn(&Shots) -> &Image = if which == 0 { |s| &s.vis } else { |s| &s.nir_spi };
            let contrasts: Vec<f64> = contrasts.iter().map(|both| both[which]).collect();
            rows.push(row(image, distance_m, paper_mm[k], &edges, of, &contrasts));
        }
    }
    bar.finish_and_clear();
    rows.sort_by_key(|row| row.image != "VIS");

    let report = Report {
        simulated: true,
        rain: args.exposure.rain,
        scenes: args.scenes,
        frames: args.exposure.frames,
        seed: args.exposure.seed,
        rows,
        reading: reading(),
    };
    if let Some(path) = &args.out {
        let mut out = OutputDir::create(path)?;
        out.write(
            "table4.json",
            format!("{}\n", serde_json::to_string_pretty(&report)?).as_bytes(),
        )?;
        out.write("table4.png", &encode_rgb(&chart(&report).render()))?;
        out.commit()?;
    }
    if args.json {
        print::json(&report)?;
    } else {
        say(&report)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// A scene that fills the field.
fn take(args: &Args, reflectance: Vec<f32>, distance_m: f64, i: u64) -> Result<Shots> {
    let field_mm = Projector::default().field_mm(distance_m * 1e3);
    // The mean of what lies around it, so that the field's own edge adds little.
    let scene = Scene::new(reflectance, SCENE_PX, field_mm)?.with_surround(0.5)?;
    let conditions =
        Conditions { distance_m, rain: args.exposure.rain, frames: args.exposure.frames };
    shoot(scene, conditions, args.exposure.seed.wrapping_add(i))
}

/// Contrast kept of bars, VIS and NIR-SPI, of the mean of some pictures.
fn bar_contrast(args: &Args, distance_m: f64, bar_px: f64) -> Result<[f64; 2]> {
    let scene = bar_scene(SCENE_PX, bar_px * SCENE_PX as f64 / 32.0);
    let mut sums = [vec![0.0_f32; 1024], vec![0.0_f32; 1024]];
    let mut truth = Vec::new();
    for i in 0..u64::from(BAR_PICTURES) {
        let shots = take(args, scene.clone(), distance_m, i)?;
        for (sum, image) in sums.iter_mut().zip([&shots.vis, &shots.nir_spi]) {
            sum.iter_mut().zip(image.pixels()).for_each(|(sum, pixel)| *sum += pixel);
        }
        truth = shots.truth;
    }
    Ok(sums.map(|sum| bar_transfer(&sum, &truth, 32, bar_px)))
}

fn row(
    image: &'static str,
    distance_m: f64,
    paper_mm: f64,
    edges: &[Shots],
    of: fn(&Shots) -> &Image,
    contrasts: &[f64],
) -> Row {
    let projector = Projector::default();
    let pixel_mm = projector.field_mm(distance_m * 1e3) / 32.0;
    let group = edges.len() / GROUPS as usize;
    let curves: Vec<_> = edges
        .chunks_exact(group)
        .map(|shots| {
            let mut sum = vec![0.0_f32; 1024];
            for shot in shots {
                sum.iter_mut().zip(of(shot).pixels()).for_each(|(sum, pixel)| *sum += pixel);
            }
            edge_mtf(&sum, 32)
        })
        .collect();
    let at = |level| {
        let widths: Vec<f64> = curves
            .iter()
            .filter_map(|mtf| line_width_px(mtf, level).map(|px| px * pixel_mm))
            .collect();
        Estimate::of(&widths)
    };
    let unresolved =
        contrasts.iter().rposition(|&contrast| contrast.is_nan() || contrast < RESOLVED);
    let finest = BARS_PX.get(unresolved.map_or(0, |at| at + 1));
    Row {
        image,
        distance_m,
        pixel_mm,
        defocus_mm: if image == "VIS" { 0.0 } else { projector.blur_mm(distance_m * 1e3) },
        mtf50_mm: at(0.5),
        mtf10_mm: at(0.1),
        bars_mm: finest.map(|px| px * pixel_mm),
        bar_contrast: BARS_PX
            .iter()
            .map(|px| px * pixel_mm)
            .zip(contrasts.iter().copied())
            .collect(),
        paper_mm,
    }
}

fn chart(report: &Report) -> Chart {
    let lines = report.rows.iter().enumerate().map(|(k, row)| Line {
        name: format!("{}, {} m", row.image, row.distance_m),
        colour: k,
        dashed: false,
        points: row.bar_contrast.iter().map(|&(mm, contrast)| (mm, contrast.max(0.0))).collect(),
    });
    Chart {
        header: "Contrast that bars keep".to_owned(),
        x: Axis {
            name: "width of a bar on the target, mm".to_owned(),
            from: 1.0,
            to: 100.0,
            logarithmic: true,
            ticks: vec![1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0],
        },
        y: Axis {
            name: "contrast kept".to_owned(),
            from: 0.0,
            // Room for the legend.
            to: 1.5,
            logarithmic: false,
            ticks: vec![0.0, 0.1, 0.5, 1.0],
        },
        lines: lines.collect(),
        footer: format!("simulated: rain {}, {BAR_PICTURES} pictures a point", report.rain.name()),
    }
}

fn say(report: &Report) -> Result<()> {
    print::line(format_args!(
        "Table 4, rain {}, {} edges a distance, {} sweeps a picture; line width in mm (ours simulated; ± is 95 %)",
        report.rain.name(),
        report.scenes,
        report.frames
    ))?;
    print::line(
        "image    distance  pixel  defocus  MTF50            MTF10            bars   paper",
    )?;
    for row in &report.rows {
        let text =
            |estimate: &Option<Estimate>| estimate.map_or_else(|| "none".to_owned(), |e| e.text(2));
        let bars = row.bars_mm.map_or_else(|| "none".to_owned(), |mm| format!("{mm:.1}"));
        print::line(format_args!(
            "{:<8} {:<8}  {:<5}  {:<7.1}  {:<15}  {:<15}  {:<5}  {}",
            row.image,
            format!("{} m", row.distance_m),
            row.pixel_mm,
            row.defocus_mm,
            text(&row.mtf50_mm),
            text(&row.mtf10_mm),
            bars,
            row.paper_mm
        ))?;
    }
    for line in &report.reading {
        print::line(format_args!("reading: {line}"))?;
    }
    Ok(())
}

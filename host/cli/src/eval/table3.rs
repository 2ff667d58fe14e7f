//! `nirspi eval table3`: image quality in rain and without it: NIR-SPI, VIS, and NIR-SPI enhanced by networks.

use super::enhanced::{Enhancers, Picture};
use super::quality::halved;
use super::shot::{Conditions, Exposure, Shots, progress, shoot, white_level};
use super::{DISTANCES_M, Estimate};
use crate::camera::Rain;
use crate::print;
use crate::report::to_json;
use anyhow::Result;
use nirspi::files::image::encode_rgb;
use nirspi::files::output::OutputDir;
use nirspi::imaging::{Quality, compare};
use nirspi::picture::{Panel, Range, SideBySide};
use nirspi::scene::SceneSource;
use nirspi_nets::images::Images;
use nirspi_nets::metrics::{CharacterJudge, Inception, frechet_distance, inception};
use nirspi_nets::{Weights, upscale_2x};
use nirspi_optics::{Projector, Scene};
use nirspi_recon::{Image, Side};
use rayon::prelude::*;
use serde::Serialize;
use std::path::{Path, PathBuf};
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
    exposure: Exposure,
    /// Inception-v3's weights in safetensors with torchvision's names, for FID; a second or so a picture
    #[arg(long, value_name = "FILE")]
    inception: Option<PathBuf>,
    /// Folder for table3.json and table3.png
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

/// A row of the paper: PSNR in dB, SSIM, FID.
struct Paper {
    image: Picture,
    psnr_db: f64,
    ssim: f64,
    fid: Option<f64>,
}

const PAPER: [Paper; 4] = [
    Paper { image: Picture::Vis, psnr_db: 10.0, ssim: 0.3, fid: None },
    Paper { image: Picture::NirSpi, psnr_db: 24.0, ssim: 0.7, fid: Some(14.0) },
    Paper { image: Picture::Gan, psnr_db: 23.0, ssim: 0.75, fid: Some(38.0) },
    Paper { image: Picture::Diffusion, psnr_db: 26.0, ssim: 0.84, fid: Some(11.0) },
];

const CHARACTERS: &str = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789";

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
    image: Picture,
    /// `null`: all distances.
    distance_m: Option<f64>,
    psnr_db: Estimate,
    ssim: Estimate,
    /// The same scenes and noise without rain.
    dry_psnr_db: Estimate,
    dry_ssim: Estimate,
    /// Of a picture with nothing on it: the least that a camera can get.
    blank_psnr_db: Estimate,
    /// At 64 x 64, on the features of our own classifier: not FID.
    frechet_character_distance: f64,
    /// With the user's Inception weights.
    fid: Option<f64>,
    paper_psnr_db: f64,
    paper_ssim: f64,
    paper_fid: Option<f64>,
}

/// One scene as it was taken with rain and without.
struct Taken {
    distance_m: f64,
    wet: Shots,
    dry: Shots,
    blank: Quality,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let sets = Sets::new(args.inception.as_deref())?;
    let enhancers = Enhancers::new()?;
    let bar = progress(DISTANCES_M.len() * args.scenes as usize, "table 3");
    let jobs: Vec<(f64, u32)> =
        DISTANCES_M.iter().flat_map(|&m| (0..args.scenes).map(move |i| (m, i))).collect();
    let taken: Vec<Taken> = jobs
        .par_iter()
        .map(|&(distance_m, i)| {
            let wet = take(args, args.exposure.rain, distance_m, i)?;
            let dry = take(args, Rain::None, distance_m, i)?;
            let blank = Image::new(wet.nir_spi.side(), vec![0.0; wet.truth.len()]);
            let blank = compare(&blank, &wet.truth)?.quality;
            bar.inc(1);
            Ok(Taken { distance_m, wet, dry, blank })
        })
        .collect::<Result<_>>()?;
    bar.finish_and_clear();

    let whites = [args.exposure.rain, Rain::None].map(|rain| whites(args, rain));
    let [wet_whites, dry_whites] = whites;
    let (wet_whites, dry_whites) = (wet_whites?, dry_whites?);
    let mut rows = Vec::new();
    for paper in &PAPER {
        let wet = judged(paper.image, &taken, |t| &t.wet, &wet_whites, &enhancers)?;
        let dry = judged(paper.image, &taken, |t| &t.dry, &dry_whites, &enhancers)?;
        for distance_m in DISTANCES_M.iter().map(|&m| Some(m)).chain([None]) {
            rows.extend(row(paper, distance_m, &taken, &wet, &dry, &sets)?);
        }
    }
    let report = Report {
        simulated: true,
        rain: args.exposure.rain,
        scenes: args.scenes,
        frames: args.exposure.frames,
        seed: args.exposure.seed,
        reading: reading(&rows, args.inception.is_some()),
        rows,
    };
    if let Some(path) = &args.out {
        let mut out = OutputDir::create(path)?;
        out.write("table3.json", to_json(&report)?.as_bytes())?;
        let picture = picture(args, &wet_whites, &enhancers)?;
        out.write("table3.png", &encode_rgb(&picture.render()))?;
        out.commit()?;
    }
    if args.json {
        print::json(&report)?;
    } else {
        say(&report)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// What a white sheet gives at each distance.
fn whites(args: &Args, rain: Rain) -> Result<[f32; 3]> {
    let mut levels = [0.0; 3];
    for (level, distance_m) in levels.iter_mut().zip(DISTANCES_M) {
        let conditions = Conditions { distance_m, rain, frames: args.exposure.frames };
        *level = white_level(conditions, args.exposure.seed)?;
    }
    Ok(levels)
}

fn white_at(whites: &[f32; 3], distance_m: f64) -> f32 {
    let at = DISTANCES_M.iter().position(|&d| d == distance_m);
    whites[at.unwrap_or(0)]
}

/// A picture with its figures.
struct Judged {
    /// On the 32 x 32 grid.
    quality: Quality,
    /// 64 x 64, on the truth's scale.
    fine: Vec<f32>,
}

/// Every scene as a row has it. Networks give 64 x 64: for PSNR and SSIM, means of 2 x 2 of it, so that all rows are
/// compared with the same; the others are interpolated for what looks at 64 x 64.
fn judged(
    image: Picture,
    taken: &[Taken],
    of: fn(&Taken) -> &Shots,
    whites: &[f32; 3],
    enhancers: &Enhancers,
) -> Result<Vec<Judged>> {
    let shots: Vec<&Shots> = taken.iter().map(of).collect();
    let levels: Vec<f32> = taken.iter().map(|t| white_at(whites, t.distance_m)).collect();
    let Some(pictures) = enhancers.pictures(image, &shots, &levels)? else {
        let camera = |shot: &&Shots| {
            let picture = if image == Picture::Vis { &shot.vis } else { &shot.nir_spi };
            let fitted = compare(picture, &shot.truth)?;
            let fine = upscale_2x(&fitted.values, 1, 32, 32)?;
            Ok(Judged { quality: fitted.quality, fine })
        };
        return shots.iter().map(camera).collect();
    };
    let side = Side::new(64)?;
    let network = |(picture, shot): (Vec<f32>, &&Shots)| {
        let coarse = Image::new(shot.nir_spi.side(), halved(&picture));
        let quality = compare(&coarse, &shot.truth)?.quality;
        let fine = compare(&Image::new(side, picture), &shot.truth_fine)?.values;
        Ok(Judged { quality, fine })
    };
    pictures.into_iter().zip(&shots).map(network).collect()
}

/// Features of 64 x 64 pictures.
struct Sets {
    characters: CharacterJudge,
    inception: Option<Inception>,
}

impl Sets {
    fn new(inception: Option<&Path>) -> Result<Self> {
        let inception =
            inception.map(|path| anyhow::Ok(Inception::new(&Weights::read(path)?)?)).transpose()?;
        Ok(Self { characters: CharacterJudge::new(&Weights::embedded("classifier")?)?, inception })
    }

    /// Fréchet character distance, and FID if there are weights.
    fn distances(&self, truth: &[&[f32]], found: &[&[f32]]) -> Result<(f64, Option<f64>)> {
        let judge = |images: &[&[f32]]| {
            let stack = images.concat();
            anyhow::Ok(self.characters.judge(Images::new(&stack)?))
        };
        let ours = self.characters.distance(&judge(truth)?, &judge(found)?)?;
        let Some(network) = &self.inception else { return Ok((ours, None)) };
        let features = |images: &[&[f32]]| -> Result<Vec<f32>> {
            let mut all = Vec::new();
            for image in images {
                all.extend(network.features(image, (64, 64))?);
            }
            Ok(all)
        };
        let (a, b) = (features(truth)?, features(found)?);
        Ok((ours, Some(frechet_distance(&a, &b, inception::FEATURES)?)))
    }
}

fn row(
    paper: &Paper,
    distance_m: Option<f64>,
    taken: &[Taken],
    wet: &[Judged],
    dry: &[Judged],
    sets: &Sets,
) -> Result<Option<Row>> {
    let places: Vec<usize> =
        (0..taken.len()).filter(|&k| distance_m.is_none_or(|m| m == taken[k].distance_m)).collect();
    let estimate = |of: &dyn Fn(usize) -> f64| {
        Estimate::of(&places.iter().map(|&k| of(k)).collect::<Vec<f64>>())
    };
    let truth: Vec<&[f32]> = places.iter().map(|&k| taken[k].wet.truth_fine.as_slice()).collect();
    let found: Vec<&[f32]> = places.iter().map(|&k| wet[k].fine.as_slice()).collect();
    let (frechet_character_distance, fid) = sets.distances(&truth, &found)?;
    let row = || {
        Some(Row {
            image: paper.image,
            distance_m,
            psnr_db: estimate(&|k| wet[k].quality.psnr_db)?,
            ssim: estimate(&|k| wet[k].quality.ssim)?,
            dry_psnr_db: estimate(&|k| dry[k].quality.psnr_db)?,
            dry_ssim: estimate(&|k| dry[k].quality.ssim)?,
            blank_psnr_db: estimate(&|k| taken[k].blank.psnr_db)?,
            frechet_character_distance,
            fid,
            paper_psnr_db: paper.psnr_db,
            paper_ssim: paper.ssim,
            paper_fid: paper.fid,
        })
    };
    Ok(row())
}

/// Scene number `i`: another character, another rain, other noise.
fn take(args: &Args, rain: Rain, distance_m: f64, i: u32) -> Result<Shots> {
    let character = CHARACTERS.as_bytes()[i as usize % CHARACTERS.len()];
    let map = SceneSource::Letter(char::from(character)).load(256)?;
    let side_mm = map.side_mm.unwrap_or_else(|| Projector::default().field_mm(distance_m * 1e3));
    let scene = Scene::new(map.reflectance, map.size_px, side_mm)?;
    let conditions = Conditions { distance_m, rain, frames: args.exposure.frames };
    shoot(scene, conditions, args.exposure.seed.wrapping_add(u64::from(i)))
}

/// What rain does here, and what it cannot do.
fn reading(rows: &[Row], inception: bool) -> Vec<String> {
    let projector = Projector::default();
    let blur =
        DISTANCES_M.map(|m| format!("{:.0} mm at {m} m", projector.blur_mm(m * 1e3))).join(", ");
    let mut lines: Vec<String> = rows
        .iter()
        .filter(|row| row.distance_m.is_none())
        .map(|row| {
            let (wet, dry) = (row.psnr_db.mean, row.dry_psnr_db.mean);
            let lost = dry - wet;
            format!(
                "{}: rain costs {lost:.2} dB, from {dry:.2} to {wet:.2}; the paper has {} dB",
                row.image.name(),
                row.paper_psnr_db
            )
        })
        .collect();
    lines.push(format!("NIR-SPI: the lens is focused at 0.3 m; its defocus disc ({blur}) and noise decide, not rain"));
    lines.extend([
        "VIS: daylight, distance and falling drops do not bring a focused camera to 10 dB; \
         water on the glass of the paper's rain box might, and is not simulated"
            .to_owned(),
        "against the scene on the 32 x 32 grid without defocus, after the gain and offset of least squares; \
         the paper does not say against what it compares"
            .to_owned(),
        "networks: 64 x 64, averaged to that grid for PSNR and SSIM; they get readings over those of a white sheet"
            .to_owned(),
    ]);
    if !inception {
        lines.push(
            "the Fréchet character distance is of our own classifier's features and no FID; --inception gives that one"
                .to_owned(),
        );
    }
    lines
}

/// Scene 17, an R, at the middle distance in each row.
fn picture(args: &Args, whites: &[f32; 3], enhancers: &Enhancers) -> Result<SideBySide> {
    let mut panels = Vec::new();
    for distance_m in [DISTANCES_M[0], DISTANCES_M[1]] {
        let wet = take(args, args.exposure.rain, distance_m, 17)?;
        let dry = take(args, Rain::None, distance_m, 17)?;
        let blank = compare(&wet.nir_spi, &wet.truth)?.quality;
        let taken = [Taken { distance_m, wet, dry, blank }];
        for paper in &PAPER {
            let judged = judged(paper.image, &taken, |t| &t.wet, whites, enhancers)?;
            panels.extend(judged.into_iter().map(|judged| Panel {
                title: format!("{}, {distance_m} m", paper.image.name()),
                width: 64,
                height: 64,
                values: judged.fine,
                range: Range::Unit,
                caption: vec![format!(
                    "PSNR {:.1} dB  SSIM {:.2}",
                    judged.quality.psnr_db, judged.quality.ssim
                )],
                warnings: Vec::new(),
            }));
        }
    }
    Ok(SideBySide {
        header: format!(
            "One of {} scenes a distance, rain {}, 15 klx",
            args.scenes,
            args.exposure.rain.name()
        ),
        panels,
        footer: "simulated: virtual camera; VIS is a model of a small industrial camera".to_owned(),
    })
}

fn say(report: &Report) -> Result<()> {
    print::line(format_args!(
        "Table 3, rain {}, {} scenes a distance, {} sweeps a picture (ours simulated; ± is 95 %)",
        report.rain.name(),
        report.scenes,
        report.frames
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

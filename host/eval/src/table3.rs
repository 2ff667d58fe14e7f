//! Image quality in rain and without it, beside the paper's Table 3: NIR-SPI, VIS, and NIR-SPI enhanced by networks.
//!
//! Characters of 43 mm in 15 klx of daylight at 0.3, 0.6 and 1 m, each with rain and noise of its own, through the whole virtual
//! camera; an ordinary camera sees the same, and two networks enhance what NIR-SPI saw.

use crate::DISTANCES_M;
use crate::error::Result;
use crate::estimate::Estimate;
use crate::fid::Fid;
use crate::pictures::{Enhancers, Picture};
use crate::quality::halved;
use crate::shot::{CalibratedCamera, Conditions, Exposure, Shots};
use nirspi::imaging::{Quality, compare};
use nirspi::picture::{Panel, Range, SideBySide};
use nirspi::scene::SceneSource;
use nirspi_nets::images::Images;
use nirspi_nets::metrics::{CharacterJudge, Judged as Features};
use nirspi_nets::{Weights, upscale_2x};
use nirspi_optics::rain::Rainfall;
use nirspi_optics::{CameraModel, Scene};
use nirspi_recon::{Image, Side};
use rayon::prelude::*;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// What to measure.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Scenes at each distance, at least two.
    pub scenes: u32,
    /// Which camera takes the pictures.
    pub camera: CameraModel,
    /// How they are taken.
    pub exposure: Exposure,
    /// Inception-v3's weights, for FID; a second or so a picture.
    pub inception: Option<PathBuf>,
}

impl Settings {
    /// Pictures that are taken.
    #[must_use]
    pub fn pictures(&self) -> usize {
        DISTANCES_M.len() * self.scenes as usize
    }
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

/// Image quality, row by row.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Always true.
    pub simulated: bool,
    /// The camera description's name.
    pub camera: String,
    /// `none`, `light` or `heavy`.
    pub rain: &'static str,
    /// Scenes at each distance.
    pub scenes: u32,
    /// Sweeps summed into a picture.
    pub frames: u32,
    /// Seed of the first picture.
    pub seed: u64,
    /// Each kind of image at each distance, and at all.
    pub rows: Vec<Row>,
    /// How to read the numbers.
    pub reading: Vec<String>,
}

/// The quality of one kind of image at one distance.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// The kind of image.
    pub image: Picture,
    /// `null`: all distances.
    pub distance_m: Option<f64>,
    /// After a fit of gain and offset.
    pub psnr_db: Estimate,
    /// After the same fit.
    pub ssim: Estimate,
    /// The same scenes and noise without rain.
    pub dry_psnr_db: Estimate,
    /// As `dry_psnr_db`.
    pub dry_ssim: Estimate,
    /// Of a picture with nothing on it: the least that a camera can get.
    pub blank_psnr_db: Estimate,
    /// At 64 x 64, on the features of our own classifier: not FID.
    pub frechet_character_distance: f64,
    /// With the user's Inception weights.
    pub fid: Option<f64>,
    /// The paper's.
    pub paper_psnr_db: f64,
    /// The paper's.
    pub paper_ssim: f64,
    /// The paper's.
    pub paper_fid: Option<f64>,
}

/// One scene as it was taken with rain and without.
struct Taken {
    distance_m: f64,
    wet: Shots,
    dry: Shots,
    blank: Quality,
}

/// All pictures and networks of the table, taken once.
pub struct Table {
    settings: Settings,
    camera: CalibratedCamera,
    enhancers: Enhancers,
    sets: Sets,
    taken: Vec<Taken>,
    wet_whites: [f32; 3],
    dry_whites: [f32; 3],
}

impl Table {
    /// Takes all pictures; `done` is called after each.
    ///
    /// # Errors
    /// Weights that cannot be read, a capture that fails.
    pub fn take(settings: Settings, done: &(dyn Fn() + Sync)) -> Result<Self> {
        let sets = Sets::new(settings.inception.as_deref())?;
        let enhancers = Enhancers::new()?;
        let exposure = settings.exposure;
        let camera = CalibratedCamera::new(&settings.camera, exposure.seed)?;
        let jobs: Vec<(f64, u32)> =
            DISTANCES_M.iter().flat_map(|&m| (0..settings.scenes).map(move |i| (m, i))).collect();
        let taken: Vec<Taken> = jobs
            .par_iter()
            .map(|&(distance_m, i)| {
                let wet = take(&camera, &exposure, exposure.rain, distance_m, i)?;
                let dry = take(&camera, &exposure, Rainfall::None, distance_m, i)?;
                let blank = Image::new(wet.nir_spi.side(), vec![0.0; wet.truth.len()]);
                let blank = compare(&blank, &wet.truth)?.quality;
                done();
                Ok(Taken { distance_m, wet, dry, blank })
            })
            .collect::<Result<_>>()?;
        let wet_whites = whites(&camera, &exposure, exposure.rain)?;
        let dry_whites = whites(&camera, &exposure, Rainfall::None)?;
        Ok(Self { settings, camera, enhancers, sets, taken, wet_whites, dry_whites })
    }

    /// The figures of the pictures.
    ///
    /// # Errors
    /// Distances of sets that cannot be computed.
    pub fn report(&self) -> Result<Report> {
        let Self { settings, enhancers, sets, taken, .. } = self;
        let mut rows = Vec::new();
        for paper in &PAPER {
            let wet = judged(paper.image, taken, |t| &t.wet, &self.wet_whites, enhancers)?;
            let dry = judged(paper.image, taken, |t| &t.dry, &self.dry_whites, enhancers)?;
            for distance_m in DISTANCES_M.iter().map(|&m| Some(m)).chain([None]) {
                rows.extend(row(paper, distance_m, taken, &wet, &dry, sets)?);
            }
        }
        Ok(Report {
            simulated: true,
            camera: settings.camera.name.clone(),
            rain: settings.exposure.rain.name(),
            scenes: settings.scenes,
            frames: settings.exposure.frames,
            seed: settings.exposure.seed,
            reading: reading(&settings.camera, &rows, settings.inception.is_some()),
            rows,
        })
    }

    /// Scene 17, an R, at the nearer two distances, in each row.
    ///
    /// # Errors
    /// A capture that fails.
    pub fn picture(&self) -> Result<SideBySide> {
        picture(&self.camera, &self.settings, &self.wet_whites, &self.enhancers)
    }
}

/// What a white sheet gives at each distance.
fn whites(camera: &CalibratedCamera, exposure: &Exposure, rain: Rainfall) -> Result<[f32; 3]> {
    let mut levels = [0.0; 3];
    for (level, distance_m) in levels.iter_mut().zip(DISTANCES_M) {
        let conditions = Conditions { distance_m, rain, frames: exposure.frames };
        *level = camera.white_level(conditions, exposure.seed)?;
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

/// The judges of sets of 64 x 64 pictures.
struct Sets {
    characters: CharacterJudge,
    fid: Option<Fid>,
}

impl Sets {
    fn new(inception: Option<&Path>) -> Result<Self> {
        let fid = inception.map(Fid::read).transpose()?;
        Ok(Self { characters: CharacterJudge::new(&Weights::embedded("classifier")?)?, fid })
    }

    /// Fréchet character distance, and FID if there are weights.
    fn distances(&self, truth: &[&[f32]], found: &[&[f32]]) -> Result<(f64, Option<f64>)> {
        let judge = |images: &[&[f32]]| -> Result<Features> {
            let stack = images.concat();
            Ok(self.characters.judge(Images::new(&stack)?))
        };
        let ours = self.characters.distance(&judge(truth)?, &judge(found)?)?;
        let fid = |fid: &Fid| {
            fid.distance(truth.iter().copied(), found.iter().copied(), (64, 64), &|| {})
        };
        Ok((ours, self.fid.as_ref().map(fid).transpose()?))
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
fn take(
    camera: &CalibratedCamera,
    exposure: &Exposure,
    rain: Rainfall,
    distance_m: f64,
    i: u32,
) -> Result<Shots> {
    let character = CHARACTERS.as_bytes()[i as usize % CHARACTERS.len()];
    let map = SceneSource::Letter(char::from(character)).load(256)?;
    let side_mm =
        map.side_mm.unwrap_or_else(|| camera.model().projector().field_mm(distance_m * 1e3));
    let scene = Scene::new(map.reflectance, map.size_px, side_mm)?;
    let conditions = Conditions { distance_m, rain, frames: exposure.frames };
    camera.shoot(scene, conditions, exposure.seed.wrapping_add(u64::from(i)))
}

/// What rain does here, and what it cannot do.
fn reading(camera: &CameraModel, rows: &[Row], inception: bool) -> Vec<String> {
    let projector = camera.projector();
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
    lines.push(format!(
        "NIR-SPI: the lens is focused at {} m; its defocus disc ({blur}) and noise decide, not rain",
        projector.focus_distance_mm / 1e3
    ));
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

fn picture(
    camera: &CalibratedCamera,
    settings: &Settings,
    whites: &[f32; 3],
    enhancers: &Enhancers,
) -> Result<SideBySide> {
    let exposure = &settings.exposure;
    let mut panels = Vec::new();
    for distance_m in [DISTANCES_M[0], DISTANCES_M[1]] {
        let wet = take(camera, exposure, exposure.rain, distance_m, 17)?;
        let dry = take(camera, exposure, Rainfall::None, distance_m, 17)?;
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
            settings.scenes,
            exposure.rain.name()
        ),
        panels,
        footer: "simulated: virtual camera; VIS is a model of a small industrial camera".to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rain_costs_quality_and_the_same_scenes_come_again() {
        let exposure = Exposure { rain: Rainfall::Heavy, frames: 4, seed: 1 };
        let camera = CameraModel::default();
        let settings = Settings { scenes: 2, camera, exposure, inception: None };
        let report = || {
            let table = Table::take(settings.clone(), &|| {}).unwrap();
            serde_json::to_value(table.report().unwrap()).unwrap()
        };
        let report = [report(), report()];
        assert_eq!(report[0], report[1]);
        let rows = report[0]["rows"].as_array().unwrap();
        // Four kinds of image, at three distances and at all.
        assert_eq!(rows.len(), 4 * 4);
        for row in rows {
            let at_all = row["distance_m"].is_null();
            assert_eq!(row["psnr_db"]["n"], if at_all { 6 } else { 2 }, "{row}");
            assert!(row["fid"].is_null(), "{row}");
        }
        assert_eq!(settings.pictures(), 6);
    }
}

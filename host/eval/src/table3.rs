//! Image quality with rain and without, compared with the paper's Table 3: NIR-SPI, VIS, and
//! NIR-SPI enhanced by networks.
//!
//! Each target of 43 mm has one character of one typeface outside the training data, in 15 klx of
//! daylight at 0.3, 0.6 and 1 m. Each picture has its own rain and noise and passes through the
//! whole virtual camera. An ordinary camera takes the same scene, and networks enhance the NIR-SPI
//! picture.

mod rows;

pub use rows::{Difference, Row};

use crate::DISTANCES_M;
use crate::bootstrap::{DRAWS, Redraws};
use crate::error::{EvalError, Result};
use crate::pictures::{Enhancers, Picture};
use crate::quality::halved;
use crate::shot::{CalibratedCamera, Conditions, Exposure, Settings, Shots};
use crate::typefaces::{self, CHARACTERS, of_scene};
use nirspi::imaging::{Fit, score, share_of_white};
use nirspi::picture::{Figure, Panel, Range, SideBySide, Typeface, Unit};
use nirspi::scene::SceneMap;
use nirspi_nets::images::Images;
use nirspi_nets::metrics::{CharacterJudge, Judged as Features};
use nirspi_nets::{Weights, upscale_2x};
use nirspi_optics::rain::Air;
use nirspi_optics::{CameraModel, Scene};
use nirspi_recon::Image;
use nirspi_recon::metrics::correlation;
use rayon::prelude::*;
use rows::{Measured, Statistics};
use serde::Serialize;

/// A row of the paper: PSNR in dB, SSIM, FID. The paper's diffusion model is the ancestral sampler,
/// with which nirspi's networks are compared.
struct Paper {
    image: Picture,
    psnr_db: f64,
    ssim: f64,
    fid: Option<f64>,
}

const PAPER: [Paper; 6] = [
    Paper { image: Picture::Vis, psnr_db: 10.0, ssim: 0.3, fid: None },
    Paper { image: Picture::NirSpi, psnr_db: 24.0, ssim: 0.7, fid: Some(14.0) },
    Paper { image: Picture::Gan, psnr_db: 23.0, ssim: 0.75, fid: Some(38.0) },
    Paper { image: Picture::Regression, psnr_db: 26.0, ssim: 0.84, fid: Some(11.0) },
    Paper { image: Picture::Diffusion, psnr_db: 26.0, ssim: 0.84, fid: Some(11.0) },
    Paper { image: Picture::Ancestral, psnr_db: 26.0, ssim: 0.84, fid: Some(11.0) },
];

/// Image quality, row by row.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Always true.
    pub simulated: bool,
    /// The camera description's name.
    pub camera: String,
    /// `none`, `light` or `heavy`.
    pub rain: String,
    /// Number of scenes at each distance.
    pub scenes: u32,
    /// Typefaces of the characters.
    pub typefaces: Vec<&'static str>,
    /// Steps of the ancestral sampler; 0 means that its rows are left out.
    pub ancestral_steps: u32,
    /// Number of sweeps summed into a picture.
    pub frames: u32,
    /// Seed of the first picture.
    pub seed: u64,
    /// Each kind of image at each distance, and at all distances.
    pub rows: Vec<Row>,
    /// Differences between kinds, and differences by rain, scene by scene.
    pub differences: Vec<Difference>,
    /// How to interpret the numbers.
    pub reading: Vec<String>,
}

/// One scene, taken with rain and without.
struct Taken {
    distance_m: f64,
    wet: Shots,
    dry: Shots,
    blank: Scores,
}

/// All pictures and networks of the table. Each picture is taken once.
pub struct Table {
    settings: Settings,
    camera: CalibratedCamera,
    enhancers: Enhancers,
    sets: Sets,
    typefaces: Vec<Typeface>,
    taken: Vec<Taken>,
    wet_whites: [f32; 3],
    dry_whites: [f32; 3],
}

impl Table {
    /// Number of pictures to take.
    #[must_use]
    pub fn pictures(settings: &Settings) -> usize {
        DISTANCES_M.len() * settings.scenes as usize
    }

    /// Takes all pictures; `done` is called after each.
    ///
    /// # Errors
    /// `EvalError` for weights that cannot be read, or a capture that fails.
    pub fn take(settings: Settings, done: &(dyn Fn() + Sync)) -> Result<Self> {
        let sets = Sets::new()?;
        let enhancers = Enhancers::new(settings.ancestral_steps)?;
        let typefaces = typefaces::all();
        let exposure = settings.exposure.clone();
        let dry_air = Air::dry();
        let camera = CalibratedCamera::new(&settings.camera, exposure.seed)?;
        let jobs: Vec<(f64, u32)> =
            DISTANCES_M.iter().flat_map(|&m| (0..settings.scenes).map(move |i| (m, i))).collect();
        let taken: Vec<Taken> = jobs
            .par_iter()
            .map(|&(distance_m, i)| {
                let wet = take(&camera, &exposure, &exposure.air, distance_m, (&typefaces, i))?;
                let dry = take(&camera, &exposure, &dry_air, distance_m, (&typefaces, i))?;
                let blank = Image::new(wet.nir_spi.side(), vec![0.0; wet.truth.len()]);
                let blank = scores(&blank, &wet.truth)?;
                done();
                Ok(Taken { distance_m, wet, dry, blank })
            })
            .collect::<Result<_>>()?;
        let wet_whites = whites(&camera, &exposure, &exposure.air)?;
        let dry_whites = whites(&camera, &exposure, &dry_air)?;
        Ok(Self { settings, camera, enhancers, sets, typefaces, taken, wet_whites, dry_whites })
    }

    /// The figures of the pictures.
    ///
    /// # Errors
    /// `EvalError` for distances of sets that cannot be computed.
    pub fn report(&self) -> Result<Report> {
        let Self { settings, enhancers, sets, taken, typefaces, .. } = self;
        let of = |image| -> Result<Measured> {
            Ok(Measured {
                image,
                wet: judged(image, taken, |t| &t.wet, &self.wet_whites, enhancers)?,
                dry: judged(image, taken, |t| &t.dry, &self.dry_whites, enhancers)?,
            })
        };
        let measured: Vec<Measured> =
            self.images().map(|paper| of(paper.image)).collect::<Result<_>>()?;
        let scenes = 0..settings.scenes as usize;
        let levels: Vec<(usize, usize)> = scenes.map(|i| of_scene(i, typefaces.len())).collect();
        let redraws = Redraws::crossed(&levels, DRAWS);
        let statistics = Statistics { taken, measured: &measured, sets, redraws: &redraws };
        let (rows, differences) = (statistics.rows()?, statistics.differences());
        Ok(Report {
            simulated: true,
            camera: settings.camera.name.clone(),
            rain: settings.exposure.air.name().to_owned(),
            scenes: settings.scenes,
            typefaces: typefaces.iter().map(Typeface::name).collect(),
            ancestral_steps: settings.ancestral_steps,
            frames: settings.exposure.frames,
            seed: settings.exposure.seed,
            reading: reading(&settings.camera, &rows, &differences),
            rows,
            differences,
        })
    }

    /// The paper's rows with pictures in this table.
    fn images(&self) -> impl Iterator<Item = &'static Paper> {
        let ancestral = self.settings.ancestral_steps > 0;
        PAPER.iter().filter(move |paper| ancestral || paper.image != Picture::Ancestral)
    }

    /// Scene 17, an R, at each distance (like the paper's Fig. 7), in each row.
    ///
    /// # Errors
    /// `EvalError` for a capture that fails.
    pub fn picture(&self) -> Result<Figure> {
        let of = |distance_m| self.panels(distance_m);
        let rows: Vec<SideBySide> = DISTANCES_M.into_iter().map(of).collect::<Result<_>>()?;
        Ok(Figure::column(rows))
    }

    fn panels(&self, distance_m: f64) -> Result<SideBySide> {
        let Self { camera, settings, typefaces, .. } = self;
        let exposure = &settings.exposure;
        let shot = |air: &Air| take(camera, exposure, air, distance_m, (typefaces, SHOWN));
        let (wet, dry) = (shot(&exposure.air)?, shot(&Air::dry())?);
        let blank = scores(&wet.nir_spi, &wet.truth)?;
        let taken = [Taken { distance_m, wet, dry, blank }];
        let mut panels = Vec::new();
        for paper in self.images() {
            let judged =
                judged(paper.image, &taken, |t| &t.wet, &self.wet_whites, &self.enhancers)?;
            let title = format!("{}, {distance_m} m", paper.image.name());
            panels.extend(judged.into_iter().map(|judged| Panel {
                caption: vec![format!(
                    "PSNR {:.1} dB  SSIM {:.2}",
                    judged.quality.psnr_db, judged.quality.ssim
                )],
                range: Range::Unit,
                ..Panel::square(&title, judged.shown.len().isqrt(), &judged.shown, Unit::OfWhite)
            }));
        }
        let face = of_scene(SHOWN as usize, typefaces.len()).1;
        Ok(SideBySide {
            header: format!(
                "{distance_m} m: one of {} scenes ({}), rain {}, 15 klx",
                settings.scenes,
                typefaces[face].name(),
                exposure.air.name()
            ),
            panels,
            footer: "simulated: virtual camera; VIS is a model of a small industrial camera; 0 is black, the white sheet is white"
                .to_owned(),
        })
    }
}

/// The scene in the picture: an R.
const SHOWN: u32 = 17;

/// The level of a white sheet at each distance.
fn whites(camera: &CalibratedCamera, exposure: &Exposure, air: &Air) -> Result<[f32; 3]> {
    let mut levels = [0.0; 3];
    for (level, distance_m) in levels.iter_mut().zip(DISTANCES_M) {
        let conditions = Conditions { distance_m, air, frames: exposure.frames };
        *level = camera.white_level(conditions, exposure.seed)?;
    }
    Ok(levels)
}

fn white_at(whites: &[f32; 3], distance_m: f64) -> f32 {
    let at = DISTANCES_M.iter().position(|&d| d == distance_m);
    whites[at.unwrap_or(0)]
}

/// PSNR in dB, SSIM and correlation.
#[derive(Debug, Clone, Copy)]
struct Scores {
    psnr_db: f64,
    ssim: f64,
    /// 0 for a blank image.
    correlation: f64,
}

/// The scores of an image after the gain and offset of least squares.
fn scores(image: &Image, truth: &[f32]) -> Result<Scores> {
    let quality = score(image, truth)?;
    match (quality.psnr_db, quality.ssim) {
        (Some(psnr_db), Some(ssim)) => {
            let side = image.side().pixels();
            let correlation = correlation(truth, image.pixels(), side, side).unwrap_or_default();
            Ok(Scores { psnr_db, ssim, correlation })
        }
        _ => Err(EvalError::Content(quality.no_psnr.unwrap_or_default().to_owned())),
    }
}

/// A picture with its figures.
struct Judged {
    /// The picture on the 32 x 32 grid.
    quality: Scores,
    /// The picture at 64 x 64 on the truth's scale, for the distances of sets alone.
    fine: Vec<f32>,
    /// The picture for people: a square of shares of white, not fitted.
    shown: Vec<f32>,
}

/// An image on the truth's scale, for scores alone.
fn fitted(image: &[f32], truth: &[f32]) -> Vec<f32> {
    let fit = Fit::of(image, truth);
    image.iter().map(|&pixel| fit.apply(pixel).clamp(0.0, 1.0)).collect()
}

/// Every scene in the form of a row. Networks give 64 x 64. PSNR and SSIM use means of 2 x 2 of
/// these pictures, so that all rows are compared with the same truth. The other rows are
/// interpolated for figures of 64 x 64.
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
        let camera = |(shot, &white): (&&Shots, &f32)| {
            // The ordinary camera reports reflectance; the single-pixel camera, ADC counts.
            let is_vis = image == Picture::Vis;
            let (picture, white) = if is_vis { (&shot.vis, 1.0) } else { (&shot.nir_spi, white) };
            Ok(Judged {
                quality: scores(picture, &shot.truth)?,
                fine: upscale_2x(&fitted(picture.pixels(), &shot.truth), 1, 32, 32)?,
                shown: share_of_white(picture, white).pixels().to_vec(),
            })
        };
        return shots.iter().zip(&levels).map(camera).collect();
    };
    let network = |(picture, shot): (Vec<f32>, &&Shots)| {
        let coarse = Image::new(shot.nir_spi.side(), halved(&picture));
        Ok(Judged {
            quality: scores(&coarse, &shot.truth)?,
            fine: fitted(&picture, &shot.truth_fine),
            shown: picture,
        })
    };
    pictures.into_iter().zip(&shots).map(network).collect()
}

/// The judges of sets of 64 x 64 pictures.
struct Sets {
    characters: CharacterJudge,
}

impl Sets {
    fn new() -> Result<Self> {
        Ok(Self { characters: CharacterJudge::new(&Weights::embedded("classifier")?)? })
    }

    /// The classifier's features of pictures.
    fn features(&self, images: &[&[f32]]) -> Result<Features> {
        let stack = images.concat();
        Ok(self.characters.judge(Images::new(&stack)?))
    }

    /// Fréchet character distance of the pictures at these indices; an index may occur more than
    /// once.
    fn character_distance(
        &self,
        truth: &Features,
        found: &Features,
        places: &[usize],
    ) -> Result<f64> {
        let width = self.characters.features();
        let some = |all: &Features| Features {
            features: places
                .iter()
                .flat_map(|&at| &all.features[at * width..][..width])
                .copied()
                .collect(),
            ..Features::default()
        };
        Ok(self.characters.distance(&some(truth), &some(found))?)
    }
}

/// Scene number `i`: another character, typeface, rain and noise.
fn take(
    camera: &CalibratedCamera,
    exposure: &Exposure,
    air: &Air,
    distance_m: f64,
    (typefaces, i): (&[Typeface], u32),
) -> Result<Shots> {
    let (character, face) = of_scene(i as usize, typefaces.len());
    let map = SceneMap::letter(&typefaces[face], char::from(CHARACTERS[character]), 256)?;
    let side_mm =
        map.side_mm.unwrap_or_else(|| camera.model().projector().field_mm(distance_m * 1e3));
    let scene = Scene::new(map.reflectance, map.size_px, side_mm)?;
    let conditions = Conditions { distance_m, air, frames: exposure.frames };
    camera.shoot(scene, conditions, exposure.seed.wrapping_add(u64::from(i)))
}

/// The effects of rain in this table, and their limits.
fn reading(camera: &CameraModel, rows: &[Row], differences: &[Difference]) -> Vec<String> {
    let projector = camera.projector();
    let blur =
        DISTANCES_M.map(|m| format!("{:.0} mm at {m} m", projector.blur_mm(m * 1e3))).join(", ");
    let mut lines: Vec<String> = rows
        .iter()
        .filter(|row| row.distance_m.is_none())
        .map(|row| {
            let (wet, dry) = (row.psnr_db.value, row.dry_psnr_db.value);
            let lost = dry - wet;
            format!(
                "{}: rain costs {lost:.2} dB, from {dry:.2} to {wet:.2}; the paper has {} dB",
                row.image.name(),
                row.paper_psnr_db
            )
        })
        .collect();
    let over_gan = |d: &&Difference| d.minus == Picture::Gan.name() && d.distance_m.is_none();
    lines.extend(differences.iter().filter(over_gan).map(|d| {
        let said = if d.psnr_db.is_not_zero() { "" } else { ", which may be none" };
        format!(
            "{} minus {} on the same scenes: {} dB, SSIM {}{said}",
            d.image.name(),
            d.minus,
            d.psnr_db.text(2),
            d.ssim.text(3)
        )
    }));
    lines.push(format!(
        "NIR-SPI: the lens is focused at {} m; its defocus disc ({blur}) and noise decide, not rain",
        projector.focus_distance_mm / 1e3
    ));
    lines.extend([
        "intervals: glyphs and typefaces drawn again (bootstrap of two crossed factors); all: mean of the three distances, \
         which are fixed and not drawn"
            .to_owned(),
        "VIS: daylight, distance and falling drops do not bring a focused camera to 10 dB, nor does water on a third of its \
         window (--weather heavy+window:0.3)"
            .to_owned(),
        "against the scene on the 32 x 32 grid without defocus, after the gain and offset of least squares; \
         the paper does not say against what it compares"
            .to_owned(),
        "networks: 64 x 64, averaged to that grid for PSNR and SSIM; they get readings over those of a white sheet"
            .to_owned(),
        "GAN, regression and ancestral (the paper's sampler) have the same UNet, began with weights drawn at random, and were \
         trained for the same time on the same images; regression minimises the error"
            .to_owned(),
        "diffusion is one step of a larger UNet that minimises the error, trained much longer: it shows what nirspi gives, and is \
         no comparison of methods"
            .to_owned(),
        "the Fréchet character distance is of our own classifier's features, and is not FID".to_owned(),
    ]);
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rain_costs_quality_and_the_same_scenes_come_again() {
        let exposure = Exposure { air: "heavy".parse().unwrap(), frames: 4, seed: 1 };
        let camera = CameraModel::default();
        let settings = Settings { scenes: 2, camera, exposure, ancestral_steps: 2 };
        let report = || {
            let table = Table::take(settings.clone(), &|| {}).unwrap();
            serde_json::to_value(table.report().unwrap()).unwrap()
        };
        let report = [report(), report()];
        assert_eq!(report[0], report[1]);
        let rows = report[0]["rows"].as_array().unwrap();
        // Six kinds of image, at three distances and at all distances.
        assert_eq!(rows.len(), 6 * 4);
        for row in rows {
            let psnr = &row["psnr_db"];
            assert!(psnr["low"].as_f64() <= psnr["high"].as_f64(), "{row}");
            // No image is below a blank one after the fit; 4 sweeps at 1 m show nothing, an ordinary camera everything.
            let over =
                psnr["value"].as_f64().unwrap() - row["blank_psnr_db"]["value"].as_f64().unwrap();
            assert!(over > -0.1, "{row}");
            let shows_nothing = row["no_measurable_image"].as_bool().unwrap();
            let correlation = row["correlation"]["value"].as_f64().unwrap();
            match (row["image"].as_str().unwrap(), row["distance_m"].as_f64()) {
                ("VIS", _) => assert!(!shows_nothing && correlation > 0.99, "{row}"),
                ("NIR-SPI", Some(1.0)) => assert!(shows_nothing && correlation < 0.4, "{row}"),
                _ => assert_eq!(shows_nothing, over < 0.5, "{row}"),
            }
        }
        // "all" is the mean of the three distances.
        for kind in rows.chunks_exact(4) {
            let value = |row: &serde_json::Value| row["psnr_db"]["value"].as_f64().unwrap();
            let mean = kind[..3].iter().map(value).sum::<f64>() / 3.0;
            assert!((value(&kind[3]) - mean).abs() < 1e-9, "{kind:?}");
        }
        // The difference by rain of each kind, and seven pairs of kinds.
        let differences = report[0]["differences"].as_array().unwrap();
        assert_eq!(differences.len(), (6 + 7) * 4);
        let first = &differences[0];
        let cost = rows[0]["psnr_db"]["value"].as_f64().unwrap()
            - rows[0]["dry_psnr_db"]["value"].as_f64().unwrap();
        assert!((first["psnr_db"]["value"].as_f64().unwrap() - cost).abs() < 1e-9, "{first}");
        assert_eq!(Table::pictures(&settings), 6);
    }
}

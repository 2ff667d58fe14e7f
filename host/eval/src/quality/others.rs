//! Scenes other than characters, in which a network trained on letters could draw strokes.
//!
//! If the scene is known, PSNR before and after enhancement shows whether false strokes were added;
//! the picture shows the strokes. Real measurements are used unchanged.

use super::condition::{Condition, SIDE, halved};
use super::contenders::Contender;
use super::{MIDDLE, UNTOUCHED};
use crate::error::{EvalError, On, Result};
use nirspi::files::image::read_reflectance;
use nirspi::picture::{Panel, Range, SideBySide, Unit};
use nirspi::source::{Index, Source, SourceOptions};
use nirspi_nets::consistency::Consistency;
use nirspi_nets::upscale_2x;
use nirspi_recon::{metrics, reconstruct};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Number of cases of one panel, from top to bottom.
const CASES_A_PANEL: usize = 3;

/// A scene to enhance.
pub struct Scene {
    name: String,
    /// 64 x 64 in [0, 1]; `None` if the true scene is unknown.
    truth: Option<Vec<f32>>,
    /// 32 x 32 in [0, 1].
    readings: Vec<f32>,
    condition: Condition,
}

/// The result for a scene.
#[derive(Debug, Serialize)]
pub struct Case {
    /// The scene.
    pub name: String,
    /// The degradation; absent for real measurements.
    #[serde(flatten)]
    pub condition: Option<Condition>,
    /// PSNR of Lanczos's interpolation.
    pub psnr_before_db: Option<f64>,
    /// PSNR of the enhanced image.
    pub psnr_after_db: Option<f64>,
    /// Root mean square of the change by enhancement.
    pub changed: f64,
    /// As in the rows of characters; `null` for real measurements, whose noise is unknown.
    pub inconsistency: Option<f64>,
}

/// The cases, and a picture of them.
pub struct Shown {
    pub cases: Vec<Case>,
    pub picture: SideBySide,
}

/// Generated scenes, parts of pictures, real measurements.
pub fn cases(pictures: Option<&Path>, spi: Option<&Path>, seed: u64) -> Result<Vec<Scene>> {
    let mut scenes: Vec<Scene> = generated(seed)
        .into_iter()
        .enumerate()
        .map(|(k, (name, truth, condition))| degraded(name, truth, condition, seed, k))
        .collect();
    for (k, file) in files(pictures, "png")?.iter().enumerate() {
        let picture = read_reflectance(file)?;
        for (part, (down, across)) in [("left", (0.5, 0.2)), ("right", (0.5, 0.8))] {
            let name = format!("{}, {part}", stem(file));
            let truth = part_of(&picture.values, picture.size_px, down, across);
            scenes.push(degraded(name, truth, MIDDLE, seed, 100 + k));
        }
    }
    for file in files(spi, "npz")? {
        scenes.push(measured(&file).on_file(&file)?);
    }
    Ok(scenes)
}

fn degraded(
    name: String,
    truth: Vec<f32>,
    condition: Condition,
    seed: u64,
    number: usize,
) -> Scene {
    let readings = condition.read(&truth, seed, number as u64);
    Scene { name, truth: Some(truth), readings, condition }
}

fn generated(seed: u64) -> Vec<(String, Vec<f32>, Condition)> {
    let flat = |level: f32| vec![level; SIDE * SIDE];
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut stars = flat(0.02);
    for _ in 0..25 {
        stars[rng.random_range(0..SIDE * SIDE)] = rng.random_range(0.3..1.0);
    }
    let grating = (0..SIDE * SIDE)
        .map(|at| 0.5 + 0.4 * (0.4 * ((at % SIDE) as f32 + 0.5 * (at / SIDE) as f32)).sin())
        .collect();
    vec![
        ("nothing".to_owned(), flat(0.0), MIDDLE),
        ("grey".to_owned(), flat(0.5), UNTOUCHED),
        ("noise alone".to_owned(), flat(0.5), Condition { noise: 0.08, ..MIDDLE }),
        ("stars".to_owned(), stars, MIDDLE),
        ("grating".to_owned(), grating, MIDDLE),
    ]
}

/// A part of a picture, 64 x 64, at half of the picture's resolution or less, around a position in
/// the picture.
fn part_of(picture: &[f32], size_px: usize, down: f64, across: f64) -> Vec<f32> {
    let pitch = (size_px / (2 * SIDE)).max(1);
    let first = |place: f64| {
        let middle = place * size_px as f64 - (SIDE * pitch / 2) as f64;
        middle.clamp(0.0, size_px.saturating_sub(SIDE * pitch) as f64) as usize
    };
    let (top, left) = (first(down), first(across));
    let mean = |r: usize, c: usize| {
        let at = |k: usize| {
            let row = (top + r * pitch + k / pitch).min(size_px - 1);
            let column = (left + c * pitch + k % pitch).min(size_px - 1);
            picture[row * size_px + column]
        };
        (0..pitch * pitch).map(at).sum::<f32>() / (pitch * pitch) as f32
    };
    (0..SIDE * SIDE).map(|at| mean(at / SIDE, at % SIDE)).collect()
}

/// A real measurement. A measurement of 64 x 64 is its own truth, sampled by means of 2 x 2.
fn measured(path: &Path) -> Result<Scene> {
    let first = SourceOptions { index: Some(Index::One(0)), ..SourceOptions::default() };
    let source = Source::read(path, &first)?;
    let image = reconstruct::hadamard(&source.measurements);
    let side = image.side().pixels();
    let (low, high) = image
        .pixels()
        .iter()
        .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)));
    let span = if high > low { high - low } else { 1.0 };
    let grey: Vec<f32> =
        image.pixels().iter().map(|p| ((p - low) / span).clamp(0.0, 1.0)).collect();
    let name = format!("{} (measured)", stem(path));
    match side {
        SIDE => {
            let readings = halved(&grey);
            Ok(Scene { name, truth: Some(grey), readings, condition: UNTOUCHED })
        }
        32 => Ok(Scene { name, truth: None, readings: grey, condition: UNTOUCHED }),
        _ => {
            let told = format!("an image of {side} x {side}, expected 32 x 32 or 64 x 64");
            Err(EvalError::Content(told))
        }
    }
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

/// Files of a folder by their ending, sorted; empty without a folder.
fn files(folder: Option<&Path>, ending: &str) -> Result<Vec<PathBuf>> {
    let Some(folder) = folder else { return Ok(Vec::new()) };
    let named = || format!("{}: cannot read it", folder.display());
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).on(named)? {
        let path = entry.on(named)?.path();
        if path.extension().is_some_and(|e| e == ending) {
            files.push(path);
        }
    }
    files.sort_unstable();
    Ok(files)
}

/// Enhances all scenes.
pub fn enhance(scenes: &[Scene], contender: &Contender) -> Result<Shown> {
    let mut cases = Vec::new();
    let mut panels: Vec<Panel> = Vec::new();
    for some in scenes.chunks(CASES_A_PANEL) {
        let mut panel = Panel {
            title: "input, enhanced, truth".to_owned(),
            width: 3 * SIDE,
            height: CASES_A_PANEL * SIDE,
            values: vec![0.0; 3 * SIDE * CASES_A_PANEL * SIDE],
            range: Range::Unit,
            unit: Unit::OfWhite,
            caption: Vec::new(),
            warnings: Vec::new(),
            field_mm: None,
        };
        for (place, scene) in some.iter().enumerate() {
            let before = upscale_2x(&scene.readings, 1, SIDE / 2, SIDE / 2)?;
            let after = contender.enhance(&scene.readings, scene.condition, &|_| {})?;
            let case = judged(scene, &before, &after)?;
            panel.caption.push(case.line());
            cases.push(case);
            let shown = [Some(&before), Some(&after), scene.truth.as_ref()];
            for (column, image) in shown.into_iter().enumerate() {
                let Some(image) = image else { continue };
                for (r, line) in image.chunks_exact(SIDE).enumerate() {
                    let from = (place * SIDE + r) * 3 * SIDE + column * SIDE;
                    panel.values[from..from + SIDE].copy_from_slice(line);
                }
            }
        }
        panels.push(panel);
    }
    let picture = SideBySide {
        header: format!("What is no letter stays none: {}", contender.method().name()),
        panels,
        footer: "from top to bottom as below each panel; input: readings of 32 x 32, interpolated. Simulated, but for \
                 those that say measured: their truth is their own image of 64 x 64, where there is one"
            .to_owned(),
    };
    Ok(Shown { cases, picture })
}

fn judged(scene: &Scene, before: &[f32], after: &[f32]) -> Result<Case> {
    let psnr = |image: &[f32]| -> Result<Option<f64>> {
        let truth = scene.truth.as_deref();
        let psnr = truth.map(|truth| metrics::psnr(truth, image, SIDE, SIDE, 1.0)).transpose()?;
        Ok(psnr.filter(|db| db.is_finite()))
    };
    let squares: f64 = before.iter().zip(after).map(|(a, b)| f64::from(a - b).powi(2)).sum();
    let Condition { sigma_px, noise } = scene.condition;
    let camera = Consistency::new(SIDE / 2, sigma_px, noise);
    let known = noise > 0.0;
    Ok(Case {
        name: scene.name.clone(),
        condition: known.then_some(scene.condition),
        psnr_before_db: psnr(before)?,
        psnr_after_db: psnr(after)?,
        changed: (squares / after.len() as f64).sqrt(),
        inconsistency: known.then(|| f64::from(camera.residual_ratio(&scene.readings, after))),
    })
}

impl Case {
    fn line(&self) -> String {
        match (self.psnr_before_db, self.psnr_after_db) {
            (Some(before), Some(after)) => format!("{}: {before:.1} to {after:.1} dB", self.name),
            _ => format!("{}: changed by {:.3}", self.name, self.changed),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::quality::Method;
    use nirspi_nets::{Device, Networks};

    #[test]
    fn a_part_of_a_picture_is_averaged_to_its_size() {
        // A picture twice as wide as two parts. Each pixel has its column's number.
        let size = 4 * SIDE;
        let picture: Vec<f32> = (0..size * size).map(|at| (at % size) as f32).collect();
        let part = part_of(&picture, size, 0.5, 0.5);
        assert_eq!((part.len(), part[0], part[1]), (SIDE * SIDE, 64.5, 66.5));
        // A part at the edge is moved inwards. A small picture is extended by its last pixels.
        assert_eq!(part_of(&picture, size, 0.5, 1.0)[SIDE - 1], 254.5);
        assert_eq!(part_of(&[0.5; 4], 2, 0.5, 0.5), vec![0.5; SIDE * SIDE]);
    }

    #[test]
    fn what_is_grey_stays_grey_and_what_changed_is_reported() {
        let scenes = cases(None, None, 1).unwrap();
        let names: Vec<&str> = scenes.iter().map(|scene| scene.name.as_str()).collect();
        assert_eq!(names, ["nothing", "grey", "noise alone", "stars", "grating"]);
        let mut networks = Networks::built_in(Device::cpu());
        let shown =
            enhance(&scenes, &Contender::new(Method::Lanczos, &mut networks).unwrap()).unwrap();
        assert_eq!((shown.cases.len(), shown.picture.panels.len()), (5, 2));
        // Enhancement is compared with Lanczos, so Lanczos itself changes nothing.
        assert!(shown.cases.iter().all(|case| case.changed == 0.0));
        assert_eq!(shown.cases[3].psnr_before_db, shown.cases[3].psnr_after_db);
        assert!(shown.cases[1].condition.is_none() && shown.cases[1].inconsistency.is_none());
    }

    #[test]
    fn a_folder_that_is_not_there_is_named() {
        let told = cases(Some(Path::new("none")), None, 1).err().unwrap().to_string();
        assert_eq!(told, "none: cannot read it");
    }
}

//! What the depth sensor adds to an enhanced image: scenes with two characters at two distances,
//! enhanced with no depth, with one distance for the whole field, with the zones of the simulated
//! sensor, and with the true distance of each pixel.
//!
//! The forward model is the camera's own: each character has the defocus disc and the light of its
//! own distance ([`Relief`]), and the readings have white noise.
//!
//! # Invariant
//! Every row sees the same readings; rows differ in the depth alone
//! (`tests::without_different_distances_depth_changes_nothing`).

use super::characters::{Character, Characters};
use super::condition::{SIDE, sampling_variance};
use super::contenders::interpolation_gain;
use crate::bootstrap::{DRAWS, Interval, Redraws};
use crate::error::Result;
use nirspi::picture::{Panel, Range, SideBySide, Unit};
use nirspi_nets::classical::{self, Method as Classical};
use nirspi_nets::zones::BlurZones;
use nirspi_nets::{
    BlurEstimator, DepthMaps, Enhancer, Images, Known, KnownEstimate, Networks, Options, upscale_2x,
};
use nirspi_optics::{CameraModel, Relief};
use nirspi_recon::metrics;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use serde::Serialize;
use std::fmt;

/// Side of the readings.
const READINGS: usize = SIDE / 2;
/// The most scenes of a case.
const MOST_SCENES: usize = 40;
/// Reflectance of the ground of a character.
const GROUND: f32 = 0.1;
/// Distance of the wall beside the field.
const WALL_MM: u16 = 3000;

/// Distances of the two characters in mm, and noise of the readings.
const CASES: [([f32; 2], f32); 4] = [
    ([450.0, 450.0], 0.03),
    ([300.0, 450.0], 0.03),
    ([300.0, 450.0], 0.01),
    ([400.0, 600.0], 0.03),
];

/// What is known about distances.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Depth {
    /// Nothing.
    None,
    /// The median of the sensor's zones that see the field, for the whole field.
    Flat,
    /// The zones of the sensor, put where they lie in the image.
    Registered,
    /// The true distance of each pixel.
    Perfect,
}

impl Depth {
    /// Every knowledge, from none to all.
    pub const ALL: [Self; 4] = [Self::None, Self::Flat, Self::Registered, Self::Perfect];

    fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Flat => "flat",
            Self::Registered => "registered",
            Self::Perfect => "perfect",
        }
    }
}

/// How depth is used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Use {
    /// FSRCNN alone, with depth as an input.
    #[serde(rename = "fusion")]
    Fusion,
    /// FSRCNN with depth as an input, then one step of the bridge with the estimated blur.
    #[serde(rename = "fusion, diffusion")]
    Input,
    /// One step of the bridge with the blur of each zone's distance, and depth as an input.
    #[serde(rename = "diffusion, blur of each zone")]
    Zones,
    /// Lanczos, then total variation with the blur of each zone's distance.
    #[serde(rename = "total variation, blur of each zone")]
    Classical,
}

impl Use {
    const ALL: [Self; 4] = [Self::Fusion, Self::Input, Self::Zones, Self::Classical];

    fn name(self) -> &'static str {
        match self {
            Self::Fusion => "fusion alone",
            Self::Input => "fusion, diffusion, estimated blur",
            Self::Zones => "diffusion, blur of each zone",
            Self::Classical => "total variation, blur of each zone",
        }
    }
}

/// One use of one knowledge of depth in one case.
#[derive(Debug, Clone, Serialize)]
pub struct DepthRow {
    /// Distances of the two characters.
    pub distances_mm: [f32; 2],
    /// Standard deviation of the noise; 1 is a white target at the nearer distance.
    pub noise: f32,
    /// How depth is used.
    pub used: Use,
    /// What is known.
    pub depth: Depth,
    /// Number of scenes.
    pub scenes: usize,
    /// PSNR against the scene without defocus, mean over the scenes.
    pub psnr_db: Interval,
    /// SSIM against the scene without defocus.
    pub ssim: Interval,
    /// Difference to the PSNR of the same row without depth, scene by scene.
    pub psnr_minus_none_db: Interval,
}

impl fmt::Display for DepthRow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { distances_mm: [left, right], noise, scenes, .. } = self;
        write!(
            f,
            "  {left} and {right} mm, noise {noise}: {:<34} depth {:<10} {:5.2} dB  {:.3}  minus none {} dB  ({scenes} scenes)",
            self.used.name(),
            self.depth.name(),
            self.psnr_db.value,
            self.ssim.value,
            self.psnr_minus_none_db.text(2),
        )
    }
}

/// The networks.
pub struct Tools {
    enhancer: Enhancer,
    estimator: BlurEstimator,
}

impl Tools {
    pub fn new(networks: &mut Networks) -> Result<Self> {
        let enhancer = networks.enhancer(nirspi_nets::Method::default())?;
        Ok(Self { enhancer, estimator: networks.estimator()? })
    }
}

/// One scene: two characters side by side.
struct Scene {
    truth: Vec<f32>,
    readings: Vec<f32>,
    /// Distance of each pixel of the readings in metres; NaN if it is not known. One map for each
    /// of [`Depth::ALL`].
    maps_m: Vec<Vec<f32>>,
    group: (usize, u32),
}

/// The rows, and a picture of one scene.
pub struct Ablation {
    pub rows: Vec<DepthRow>,
    pub picture: SideBySide,
}

/// Number of scenes of each case.
fn scenes_of(characters: &Characters) -> usize {
    (characters.len() / 2).min(MOST_SCENES)
}

/// Number of images that [`ablation`] makes.
pub fn images(characters: &Characters) -> usize {
    scenes_of(characters) * CASES.len() * Depth::ALL.len() * Use::ALL.len()
}

/// Measures every use of depth. `done` is called with the number of images just made.
pub fn ablation(
    characters: &Characters,
    tools: &Tools,
    seed: u64,
    done: &dyn Fn(usize),
) -> Result<Ablation> {
    let all: Vec<&Character> = characters.iter().collect();
    let count = scenes_of(characters);
    let mut rows = Vec::new();
    let mut panels = Vec::new();
    for (distances_mm, noise) in CASES {
        let scene = |k: usize| {
            // Neighbours are of one stack, and the scenes are spread over all stacks.
            let first = k * (all.len() - 1) / count.max(1);
            scene(all[first], all[first + 1], distances_mm, noise, seed ^ k as u64)
        };
        let scenes: Vec<Scene> = (0..count).map(scene).collect::<Result<_>>()?;
        let groups: Vec<(usize, u32)> = scenes.iter().map(|scene| scene.group).collect();
        let redraws = Redraws::clustered(&groups, DRAWS);
        for used in Use::ALL {
            let mut without = Vec::new();
            for (depth, at) in Depth::ALL.into_iter().zip(0..) {
                let mut figures = Vec::with_capacity(count);
                for (k, scene) in scenes.iter().enumerate() {
                    let image = enhance(tools, scene, used, at, seed)?;
                    figures.push((
                        metrics::psnr(&scene.truth, &image, SIDE, SIDE, 1.0)?,
                        metrics::ssim(&scene.truth, &image, SIDE, SIDE, 1.0)?,
                    ));
                    if k == 0 && used == Use::Zones && distances_mm == [300.0, 450.0] {
                        if depth == Depth::None {
                            let told = format!("readings, noise {noise}");
                            let seen = upscale_2x(&scene.readings, 1, READINGS, READINGS)?;
                            panels.push(panel(&told, seen, scene));
                        }
                        panels.push(panel(&format!("depth {}", depth.name()), image, scene));
                    }
                    done(1);
                }
                let psnr: Vec<f64> = figures.iter().map(|figure| figure.0).collect();
                if depth == Depth::None {
                    without.clone_from(&psnr);
                }
                let minus: Vec<f64> = psnr.iter().zip(&without).map(|(a, b)| a - b).collect();
                rows.push(DepthRow {
                    distances_mm,
                    noise,
                    used,
                    depth,
                    scenes: count,
                    psnr_db: redraws.of_mean(&psnr),
                    ssim: redraws
                        .of_mean(&figures.iter().map(|figure| figure.1).collect::<Vec<_>>()),
                    psnr_minus_none_db: redraws.of_mean(&minus),
                });
            }
        }
    }
    let picture = SideBySide {
        header: "Left character at 0.3 m in focus, right character at 0.45 m: one blur, or the blur of each zone"
            .to_owned(),
        panels,
        footer: "simulated; diffusion, one step; PSNR against the scene without defocus".to_owned(),
    };
    Ok(Ablation { rows, picture })
}

fn panel(title: &str, values: Vec<f32>, scene: &Scene) -> Panel {
    let psnr = metrics::psnr(&scene.truth, &values, SIDE, SIDE, 1.0).unwrap_or(f64::NAN);
    Panel {
        title: title.to_owned(),
        width: SIDE,
        height: SIDE,
        values,
        range: Range::Unit,
        unit: Unit::OfWhite,
        caption: vec![format!("{psnr:.2} dB")],
        warnings: Vec::new(),
        field_mm: None,
    }
}

/// Two characters at two distances, each on a ground of its own that fills its half of the field.
/// The border between the halves lies within 8 pixels of the middle.
fn scene(
    left: &Character,
    right: &Character,
    distances_mm: [f32; 2],
    noise: f32,
    seed: u64,
) -> Result<Scene> {
    let mut rng = Pcg64Mcg::seed_from_u64(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let border = rng.random_range(SIDE / 2 - 8..=SIDE / 2 + 8);
    let half = |at: usize| usize::from(at % SIDE >= border);
    let starts = [border as i64 / 2, (SIDE + border) as i64 / 2].map(|middle| middle - 16);
    let reflectance = |at: usize| {
        let character = [left, right][half(at)];
        let (row, column) = (at / SIDE, (at % SIDE) as i64 - starts[half(at)]);
        let inside = (16..48).contains(&row) && (0..32).contains(&column);
        let value = if inside {
            let (r, c) = (2 * (row - 16), 2 * column as usize);
            let pixel = |r: usize, c: usize| character.sharp[r * SIDE + c];
            (pixel(r, c) + pixel(r + 1, c) + pixel(r, c + 1) + pixel(r + 1, c + 1)) / 4.0
        } else {
            0.0
        };
        GROUND + (1.0 - GROUND) * value
    };
    let distance_mm = |at: usize| distances_mm[half(at)];
    let all = || 0..SIDE * SIDE;
    let relief =
        Relief::new(all().map(reflectance).collect(), all().map(distance_mm).collect(), SIDE)?;
    let camera = CameraModel::paper();
    let (projector, geometry) = (camera.projector(), camera.depth_geometry());
    let field = projector.field_over_distance();
    let readings = relief.footprint(&projector)?.into_iter().map(|light| {
        let drawn: f32 = rng.sample(StandardNormal);
        (light + noise * drawn).clamp(0.0, 1.0)
    });
    let readings: Vec<f32> = readings.collect();
    let zones_mm = relief.reading(&geometry, field, WALL_MM, camera.tof.noise_mm, seed)?;
    let view = geometry.view(&zones_mm, field);
    let metres = |mm: u16| if mm > 0 { f32::from(mm) * 1e-3 } else { f32::NAN };
    let whole = |value: f32| vec![value; READINGS * READINGS];
    let coarse = |at: usize| 2 * (at / READINGS) * SIDE + 2 * (at % READINGS);
    Ok(Scene {
        truth: relief.focused(),
        readings,
        maps_m: vec![
            whole(f32::NAN),
            whole(view.median_mm.map_or(f32::NAN, metres)),
            view.pixels_mm.iter().map(|&mm| metres(mm)).collect(),
            (0..READINGS * READINGS).map(|at| relief.distance_mm()[coarse(at)] * 1e-3).collect(),
        ],
        group: (left.stack, left.group),
    })
}

/// The image of a scene by one use of the depth map `at`.
fn enhance(tools: &Tools, scene: &Scene, used: Use, at: usize, seed: u64) -> Result<Vec<f32>> {
    let map_m = &scene.maps_m[at];
    let known = map_m.iter().any(|m| m.is_finite());
    let depth = DepthMaps::new(map_m.clone(), [1, READINGS, READINGS], 1)?;
    let depth = known.then_some(&depth);
    let readings = Images::new(&scene.readings)?;
    let options = Options { seed, ..Options::default() };
    let zones = zones(map_m);
    if used == Use::Classical {
        return classical_in_zones(tools, scene, zones.as_ref());
    }
    let made = match zones {
        Some(zones) if used == Use::Zones => {
            tools.enhancer.enhance_in_zones(readings, depth, &options, &zones)?
        }
        _ => tools.enhancer.enhance(readings, depth, &options, &mut |_| {})?,
    };
    Ok(match used {
        Use::Fusion => made.upscaled.unwrap_or_default(),
        _ => made.images,
    })
}

/// The blur zones of a map of distances: a fourth of the diameter of the paper's defocus disc.
fn zones(map_m: &[f32]) -> Option<BlurZones> {
    let projector = CameraModel::paper().projector();
    let blur_px = |&metres: &f32| {
        let mm = 1e3 * f64::from(metres);
        (projector.blur_mm(mm) / 4.0 / projector.field_mm(mm) * SIDE as f64) as f32
    };
    BlurZones::new(&map_m.iter().map(blur_px).collect::<Vec<f32>>())
}

/// Lanczos, then total variation: with the estimated blur, or with the blur of each zone.
fn classical_in_zones(tools: &Tools, scene: &Scene, zones: Option<&BlurZones>) -> Result<Vec<f32>> {
    let estimate = tools.estimator.estimate(Images::<READINGS>::new(&scene.readings)?)[0];
    let enlarged = upscale_2x(&scene.readings, 1, READINGS, READINGS)?;
    let noise = (estimate.noise * interpolation_gain()?).min(1.0);
    let with = |known: Known| -> Result<Vec<f32>> {
        let known = KnownEstimate { sigma_px: known, ..KnownEstimate::default() };
        let sigma_px = (known.over(estimate).sigma_px.powi(2) + sampling_variance()).sqrt();
        let size = (SIDE, SIDE);
        Ok(classical::deblur(Classical::TotalVariation, &enlarged, size, sigma_px, noise)?)
    };
    match zones {
        None => with(Known::Nothing),
        Some(zones) => {
            let each: Vec<Known> = zones.known().collect();
            let images: Vec<Vec<f32>> = each.into_par_iter().map(with).collect::<Result<_>>()?;
            Ok(zones.blend(&images))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_nets::Device;

    fn letter(stack: usize) -> Character {
        let sharp = |at: usize| f32::from(u8::from((20..28).contains(&(at % SIDE))));
        let sharp = (0..SIDE * SIDE).map(sharp).collect();
        Character { sharp, label: None, stack, group: stack as u32 }
    }

    fn made(distances_mm: [f32; 2], used: Use) -> Vec<Vec<f32>> {
        let mut networks = Networks::built_in(Device::cpu());
        let tools = Tools::new(&mut networks).unwrap();
        let scene = scene(&letter(0), &letter(1), distances_mm, 0.01, 3).unwrap();
        (0..4).map(|at| enhance(&tools, &scene, used, at, 1).unwrap()).collect()
    }

    #[test]
    fn without_different_distances_depth_changes_nothing() {
        // Registered and perfect depth of a flat scene are one distance, as flat depth is.
        let images = made([450.0, 450.0], Use::Zones);
        for image in &images[2..] {
            let most = image.iter().zip(&images[1]).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(most < 0.03, "{most}");
        }
    }

    #[test]
    fn the_distance_of_each_pixel_sharpens_each_character_by_its_own_blur() {
        let images = made([300.0, 450.0], Use::Zones);
        let scene = scene(&letter(0), &letter(1), [300.0, 450.0], 0.01, 3).unwrap();
        let psnr = |at: usize| metrics::psnr(&scene.truth, &images[at], SIDE, SIDE, 1.0).unwrap();
        assert!(psnr(3) > psnr(0) + 0.5, "{} against {}", psnr(3), psnr(0));
    }

    #[test]
    fn the_sensor_sees_the_field_in_the_middle_of_the_wall() {
        let scene = scene(&letter(0), &letter(1), [400.0, 600.0], 0.0, 3).unwrap();
        let distances: Vec<f32> =
            scene.maps_m[2].iter().copied().filter(|m| m.is_finite()).collect();
        assert!(distances.iter().any(|m| (m - 0.4).abs() < 0.03), "{distances:?}");
        assert!(scene.maps_m[1].iter().all(|m| (0.35..0.65).contains(m)));
        assert_eq!(scene.truth.len(), SIDE * SIDE);
    }
}

//! A scene, an order of the patterns, the readings of the one pixel, and images from part of them.
//!
//! Light is counted in white pixels: a pattern that lights one white pixel reads 1.
//!
//! # Invariant
//! The reading of a pattern and of its negative add up to the light of the whole scene
//! (`tests::a_pattern_and_its_negative_share_the_light_of_the_scene`), and all patterns together
//! give the scene back (`tests::all_patterns_give_the_scene_back`).

use crate::{Problem, in_one_line};
use nirspi::scene::SceneSource;
use nirspi_recon::reconstruct::{Method, MethodSettings, hadamard};
use nirspi_recon::{Basis, Image, Measurements, Order, Rows, Sampling, Side, fwht, metrics};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

/// The side of scene and images: the camera's own.
pub const SIDE: Side = Side::INSTRUMENT;

/// What the steps of one lesson share.
#[derive(Debug, Clone)]
pub struct Lesson {
    scene: Image,
    rows: Rows,
    noise: f64,
    seed: u64,
}

/// The readings of one pattern.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Reading {
    /// Light that the pattern gives.
    pub pattern: f64,
    /// Light that its negative gives.
    pub negative: f64,
}

impl Reading {
    /// What the pattern says of the scene.
    #[must_use]
    pub fn difference(self) -> f64 {
        self.pattern - self.negative
    }
}

/// An image, and how far it is from the scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Made {
    /// The image, with white as 1.
    pub image: Image,
    /// Root of the mean squared difference from the scene, in parts of white.
    pub error: f64,
}

/// A scene by name: `letter:R`, `word:NIR`, `white` or `black`.
///
/// # Errors
/// If there is no such scene.
pub fn named(name: &str) -> Result<Image, Problem> {
    let source = match name.parse::<SceneSource>().map_err(in_one_line)? {
        SceneSource::File(_) => {
            return Err(format!("found {name}, expected letter:R or word:NIR"));
        }
        source => source,
    };
    drawn(source.load(SIDE.pixels()).map_err(in_one_line)?.reflectance)
}

/// A scene of these reflectances, row by row.
///
/// # Errors
/// If there are not as many as pixels, or one is not from 0 to 1.
pub fn drawn(reflectance: Vec<f32>) -> Result<Image, Problem> {
    let scene = nirspi_optics::Scene::new(reflectance, SIDE.pixels(), 1.0).map_err(in_one_line)?;
    Ok(Image::new(SIDE, scene.reflectance().to_vec()))
}

impl Lesson {
    /// A lesson about this scene: coarse patterns first, no noise.
    ///
    /// # Errors
    /// Does not occur: the order is one of those that have a name.
    pub fn new(scene: Image) -> Result<Self, Problem> {
        let rows = Order::CakeCutting.rows(SIDE).map_err(in_one_line)?;
        Ok(Self { scene, rows, noise: 0.0, seed: 1 })
    }

    /// Looks at another scene.
    pub fn look_at(&mut self, scene: Image) {
        self.scene = scene;
    }

    /// The scene.
    #[must_use]
    pub fn scene(&self) -> &Image {
        &self.scene
    }

    /// Shows the patterns in the order of this name.
    ///
    /// # Errors
    /// If no order has this name.
    pub fn show_in(&mut self, order: &str) -> Result<(), Problem> {
        let order: Order = order.parse().map_err(in_one_line)?;
        self.rows = order.rows(SIDE).map_err(in_one_line)?;
        Ok(())
    }

    /// Hadamard rows in the order shown.
    #[must_use]
    pub fn rows(&self) -> &Rows {
        &self.rows
    }

    /// Adds noise to the readings: as much as moves each pixel of the image from all patterns by
    /// `share` of white (standard deviation). The same seed gives the same noise.
    ///
    /// # Errors
    /// If the share is not a number from 0 to 10.
    pub fn add_noise(&mut self, share: f64, seed: u64) -> Result<(), Problem> {
        if !(0.0..=10.0).contains(&share) {
            return Err(format!("noise of {share}, expected 0 to 10 times white"));
        }
        (self.noise, self.seed) = (share, seed);
        Ok(())
    }

    /// The pattern shown at this place of the order: 1 where it has light, else 0.
    ///
    /// # Errors
    /// If there are not as many patterns.
    pub fn pattern(&self, place: usize) -> Result<Vec<f32>, Problem> {
        let last = self.rows.len() - 1;
        let row = self.rows.get(place);
        let row = *row.ok_or_else(|| format!("pattern {place}, expected 0 to {last}"))?;
        let mut signs = vec![0.0; SIDE.area()];
        signs[row as usize] = 1.0;
        fwht(&mut signs).map_err(in_one_line)?;
        Ok(signs.into_iter().map(|sign: f32| if sign > 0.0 { 1.0 } else { 0.0 }).collect())
    }

    /// The light of a pattern on the scene.
    ///
    /// # Errors
    /// As [`Self::pattern`].
    pub fn light(&self, place: usize) -> Result<Vec<f32>, Problem> {
        let pattern = self.pattern(place)?;
        Ok(pattern.iter().zip(self.scene.pixels()).map(|(lit, scene)| lit * scene).collect())
    }

    /// The readings of all patterns, in the order shown. A pattern's noise does not depend on the
    /// order.
    ///
    /// # Errors
    /// Does not occur: an image has as many pixels as the transform needs.
    pub fn readings(&self) -> Result<Vec<Reading>, Problem> {
        let mut grid: Vec<f64> = self.scene.pixels().iter().map(|&v| f64::from(v)).collect();
        let all: f64 = grid.iter().sum();
        fwht(&mut grid).map_err(in_one_line)?;
        // A pixel of the inverse transform is a mean of differences, each the difference of two readings.
        let noise = self.noise * SIDE.pixels() as f64 / std::f64::consts::SQRT_2;
        let mut random = Pcg64Mcg::seed_from_u64(self.seed);
        let mut draw = || noise * random.sample::<f64, _>(StandardNormal);
        let read = |difference: &f64| Reading {
            pattern: (all + difference) / 2.0 + draw(),
            negative: (all - difference) / 2.0 + draw(),
        };
        let natural: Vec<Reading> = grid.iter().map(read).collect();
        Ok(self.rows.iter().map(|&row| natural[row as usize]).collect())
    }

    /// The measurements of the first `count` patterns. Their noise is known, as a camera knows it
    /// from repeated frames.
    ///
    /// # Errors
    /// Does not occur: there is one number for each row.
    pub fn measured(&self, count: usize) -> Result<Measurements, Problem> {
        let rows = self.rows.first(count);
        let readings = self.readings()?;
        let differences: Vec<f64> =
            readings[..rows.len()].iter().map(|reading| reading.difference()).collect();
        let measured = Measurements::from_differential(&rows, &differences).map_err(in_one_line)?;
        measured.with_noise(self.noise * SIDE.pixels() as f64).map_err(in_one_line)
    }

    /// The running sum: the image of the first `count` patterns, each times its number. Before the
    /// first pattern the image is black.
    ///
    /// # Errors
    /// Does not occur: see [`Self::measured`].
    pub fn sum(&self, count: usize) -> Result<Made, Problem> {
        if count == 0 {
            return self.compared(Image::new(SIDE, vec![0.0; SIDE.area()]));
        }
        self.compared(hadamard(&self.measured(count)?))
    }

    /// The image of this share of the patterns by the method of this name.
    ///
    /// # Errors
    /// If there is no such method, or the share is not more than 0 and at most 1.
    pub fn image(&self, method: &str, basis: Basis, share: f64) -> Result<Made, Problem> {
        let method: Method = method.parse().map_err(in_one_line)?;
        let settings = MethodSettings { basis, ..MethodSettings::default() };
        let settings = settings.taken_by(method);
        let prepared = method.prepare(&settings).map_err(in_one_line)?;
        let measured = self.measured(self.count(share)?)?;
        self.compared(prepared.reconstruct(&measured).map_err(in_one_line)?.image)
    }

    /// Number of patterns in a share.
    ///
    /// # Errors
    /// If the share is not more than 0 and at most 1.
    pub fn count(&self, share: f64) -> Result<usize, Problem> {
        let share = Sampling::new(share).map_err(in_one_line)?.share();
        Ok((share * SIDE.area() as f64).round().max(1.0) as usize)
    }

    /// An image, compared with the scene.
    pub(crate) fn compared(&self, image: Image) -> Result<Made, Problem> {
        let n = SIDE.pixels();
        let psnr_db =
            metrics::psnr(self.scene.pixels(), image.pixels(), n, n, 1.0).map_err(in_one_line)?;
        Ok(Made { image, error: 10_f64.powf(-psnr_db / 20.0) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lesson() -> Lesson {
        Lesson::new(named("letter:R").unwrap()).unwrap()
    }

    fn farthest(a: &[f32], b: &[f32]) -> f32 {
        a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    }

    #[test]
    fn a_pattern_and_its_negative_share_the_light_of_the_scene() {
        let mut lesson = lesson();
        lesson.show_in("random:7").unwrap();
        let all: f64 = lesson.scene().pixels().iter().map(|&v| f64::from(v)).sum();
        let readings = lesson.readings().unwrap();
        for place in [0, 1, 2, 500, 1023] {
            let light: f64 = lesson.light(place).unwrap().iter().map(|&v| f64::from(v)).sum();
            assert!((readings[place].pattern - light).abs() < 1e-9, "{place}");
            assert!((readings[place].pattern + readings[place].negative - all).abs() < 1e-9);
        }
        assert!(lesson.pattern(1024).unwrap_err().contains("expected 0 to 1023"));
    }

    #[test]
    fn all_patterns_give_the_scene_back() {
        let lesson = lesson();
        let made = lesson.sum(1024).unwrap();
        assert!(farthest(made.image.pixels(), lesson.scene().pixels()) < 1e-6);
        assert!(made.error < 1e-6);
        assert_eq!(lesson.sum(0).unwrap().image.pixels(), [0.0; 1024]);
        // The first pattern has light everywhere, so its sum is the mean.
        let mean = lesson.scene().pixels().iter().sum::<f32>() / 1024.0;
        assert!(lesson.sum(1).unwrap().image.pixels().iter().all(|v| (v - mean).abs() < 1e-6));
    }

    #[test]
    fn noise_moves_a_pixel_by_the_share_that_was_asked_for_and_tikhonov_takes_some_out() {
        let mut lesson = lesson();
        lesson.add_noise(0.2, 3).unwrap();
        let full = lesson.sum(1024).unwrap();
        assert!((full.error - 0.2).abs() < 0.01, "{}", full.error);
        let calm = lesson.image("tikhonov", Basis::Dct, 1.0).unwrap();
        assert!(calm.error < 0.8 * full.error, "{} {}", calm.error, full.error);
        assert_eq!(lesson.sum(1024).unwrap(), full, "the same seed");
        lesson.add_noise(0.2, 4).unwrap();
        assert_ne!(lesson.sum(1024).unwrap(), full, "another seed");
        assert!(lesson.add_noise(f64::NAN, 1).is_err());
    }

    #[test]
    fn coarse_patterns_first_need_fewer_than_patterns_in_any_order() {
        let mut lesson = lesson();
        let coarse = lesson.image("hadamard", Basis::Dct, 0.25).unwrap().error;
        lesson.show_in("random:1").unwrap();
        let random = lesson.image("hadamard", Basis::Dct, 0.25).unwrap().error;
        assert!(coarse < 0.6 * random, "{coarse} {random}");
    }

    #[test]
    fn what_does_not_exist_gets_a_line() {
        assert!(named("word:TOOLONGWORD").unwrap_err().contains("1 to 8"));
        assert!(named("a/file.png").unwrap_err().contains("expected letter:R"));
        assert!(drawn(vec![2.0; 1024]).unwrap_err().contains("expected 0 to 1"));
        let mut lesson = lesson();
        assert!(lesson.show_in("upside-down").unwrap_err().contains("unknown order"));
        assert!(lesson.image("magic", Basis::Dct, 0.5).is_err());
        assert!(lesson.image("tikhonov", Basis::Dct, 0.0).is_err());
    }
}

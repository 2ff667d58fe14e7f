//! Conditions, their readings, and the figures of a method under a condition.
//!
//! # Invariant
//! The noise of image k is the same in every condition except for its strength, and the same for
//! every method (`tests::readings_have_the_noise_that_was_asked_for_and_its_pattern_stays`).

use super::characters::{Character, Characters};
use super::contenders::Method;
use crate::bootstrap::{DRAWS, Interval, Redraws};
use crate::error::Result;
use nirspi_nets::Networks;
use nirspi_nets::classical::Blur;
use nirspi_nets::consistency::Consistency;
use nirspi_nets::images::Images;
use nirspi_nets::metrics::{CharacterJudge, Judged};
use nirspi_recon::metrics;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use std::fmt;

/// Side of an image.
pub const SIDE: usize = nirspi_nets::deblur::SIDE;
/// Side of its readings.
const READINGS: usize = SIDE / 2;
/// Number of draws for the interval of a distance: each draw takes the roots of a matrix.
const DISTANCE_DRAWS: usize = 100;

/// The degradation of an image.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Condition {
    /// Gaussian blur, standard deviation in pixels of 64 x 64.
    pub sigma_px: f32,
    /// White noise of the readings, standard deviation; white is 1.
    pub noise: f32,
}

/// Variance in px^2 that averaging pairs of pixels adds to the blur: each pixel is half a pixel
/// from the middle of its pair.
pub fn sampling_variance() -> f32 {
    0.25
}

impl Condition {
    /// Readings (N, 32, 32) in [0, 1] of all characters.
    #[must_use]
    pub fn readings(self, characters: &Characters, seed: u64) -> Vec<f32> {
        let images = characters.iter().enumerate();
        images.flat_map(|(k, character)| self.read(&character.sharp, seed, k as u64)).collect()
    }

    /// Readings of one image. The noise follows from `seed` and the image's `number`.
    #[must_use]
    pub fn read(self, sharp: &[f32], seed: u64, number: u64) -> Vec<f32> {
        let blurred = Blur::new(SIDE, SIDE, self.sigma_px).apply(sharp);
        let mut rng = Pcg64Mcg::seed_from_u64(seed ^ number.wrapping_mul(0x9e37_79b9_7f4a_7c15));
        halved(&blurred)
            .into_iter()
            .map(|mean| {
                let noise: f32 = StandardNormal.sample(&mut rng);
                (mean + self.noise * noise).clamp(0.0, 1.0)
            })
            .collect()
    }
}

/// Means of 2 x 2 pixels of a 64 x 64 image.
pub fn halved(image: &[f32]) -> Vec<f32> {
    let at = |r: usize, c: usize| image[r * SIDE + c];
    let mean = |r: usize, c: usize| {
        (at(2 * r, 2 * c) + at(2 * r, 2 * c + 1) + at(2 * r + 1, 2 * c) + at(2 * r + 1, 2 * c + 1))
            / 4.0
    };
    (0..READINGS * READINGS).map(|k| mean(k / READINGS, k % READINGS)).collect()
}

/// The figures of a method under a condition.
#[derive(Debug, Clone, Serialize)]
pub struct Figures {
    /// The method's name.
    pub row: String,
    /// The method.
    #[serde(skip)]
    pub method: Method,
    /// The degradation of the images.
    #[serde(flatten)]
    pub condition: Condition,
    /// The stack; `null` means images of all stacks.
    pub stack: Option<String>,
    /// Number of images of the figures.
    pub images: usize,
    /// PSNR, mean over the images; 60 dB for equal images. Intervals draw font families, writers
    /// and photographs again.
    pub psnr_db: Interval,
    /// SSIM, mean over the images.
    pub ssim: Interval,
    /// Difference to the GAN's PSNR, mean over the images; `null` for the GAN and for rows without
    /// a network that deblurs.
    pub psnr_minus_gan_db: Option<Interval>,
    /// Difference to the GAN's SSIM, mean over the images.
    pub ssim_minus_gan: Option<Interval>,
    /// Fréchet distance on the features of nirspi's own classifier, which is not FID.
    pub frechet_character_distance: Interval,
    /// Share of the labelled characters that nirspi's classifier recognises.
    pub character_accuracy: Option<f64>,
    /// Distance of the readings from the readings of the images, divided by the noise: near 1 they
    /// agree. `null` without noise.
    pub inconsistency: Option<Interval>,
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "sigma {} px, noise {}", self.sigma_px, self.noise)
    }
}

impl fmt::Display for Figures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Interval { value, low, high } = self.psnr_db;
        let (ssim, distance) = (self.ssim.value, self.frechet_character_distance.value);
        write!(
            f,
            "  {:<22} {value:5.2} [{low:5.2}, {high:5.2}]  {ssim:.3}  {distance:7.2}",
            self.row
        )?;
        if let Some(accuracy) = self.character_accuracy {
            write!(f, "  {accuracy:.2}")?;
        }
        if let Some(difference) = self.psnr_minus_gan_db {
            write!(f, "  minus GAN {} dB", difference.text(2))?;
        }
        write!(f, "  ({} images)", self.images)
    }
}

/// The judge of characters.
pub struct Judges {
    characters: CharacterJudge,
}

/// One image's figures.
pub struct One {
    psnr_db: f64,
    ssim: f64,
    inconsistency: f64,
}

impl Judges {
    pub fn new(networks: &mut Networks) -> Result<Self> {
        Ok(Self { characters: CharacterJudge::new(&networks.weights("classifier")?)? })
    }

    /// The classifier's result for images (N, 64, 64).
    pub fn judge(&self, images: &[f32]) -> Result<Judged> {
        Ok(self.characters.judge(Images::new(images)?))
    }

    /// The figures of each image that a method made from readings.
    pub fn each(
        condition: Condition,
        characters: &Characters,
        readings: &[f32],
        images: &[f32],
    ) -> Result<Vec<One>> {
        characters
            .iter()
            .zip(images.chunks_exact(SIDE * SIDE))
            .zip(readings.chunks_exact(READINGS * READINGS))
            .map(|((character, image), readings)| one(character, condition, readings, image))
            .collect()
    }

    /// The figures of a method under a condition, for all stacks together and for each stack.
    pub fn figures(
        &self,
        (method, condition): (Method, Condition),
        characters: &Characters,
        (sharp, judged): (&Judged, &Judged),
        each: &[One],
        gan: Option<&[One]>,
    ) -> Result<Vec<Figures>> {
        let compared = gan.filter(|_| method.steps().is_some() || method == Method::Regression);
        let of = |stack: Option<usize>| -> Result<Figures> {
            let taken = |c: &Character| stack.is_none_or(|stack| stack == c.stack);
            let (places, groups): (Vec<usize>, Vec<(usize, u32)>) = characters
                .iter()
                .enumerate()
                .filter(|(_, c)| taken(c))
                .map(|(at, c)| (at, (c.stack, c.group)))
                .unzip();
            let redraws = Redraws::clustered(&groups, DRAWS);
            let mean = |of: &dyn Fn(usize) -> f64| {
                redraws.of_mean(&places.iter().map(|&at| of(at)).collect::<Vec<f64>>())
            };
            let distance = |picked: &[usize]| {
                let picked: Vec<usize> = picked.iter().map(|&k| places[k]).collect();
                self.characters.distance(&self.some(sharp, &picked), &self.some(judged, &picked))
            };
            let whole: Vec<usize> = (0..places.len()).collect();
            let labels: Vec<(u8, u8)> = places
                .iter()
                .filter_map(|&at| characters.iter().nth(at)?.label.map(|l| (l, judged.classes[at])))
                .collect();
            let right = labels.iter().filter(|(label, seen)| label == seen).count();
            let drawn = redraws.first(DISTANCE_DRAWS);
            let drawn =
                drawn.iter().map(|picked| distance(picked)).collect::<Result<Vec<f64>, _>>()?;
            Ok(Figures {
                row: method.name(),
                method,
                condition,
                stack: stack.map(|stack| characters.origins()[stack].stack.clone()),
                images: places.len(),
                psnr_db: mean(&|at| each[at].psnr_db),
                ssim: mean(&|at| each[at].ssim),
                psnr_minus_gan_db: compared
                    .map(|gan| mean(&|at| each[at].psnr_db - gan[at].psnr_db)),
                ssim_minus_gan: compared.map(|gan| mean(&|at| each[at].ssim - gan[at].ssim)),
                frechet_character_distance: Redraws::around(distance(&whole)?, drawn),
                character_accuracy: (!labels.is_empty())
                    .then(|| right as f64 / labels.len() as f64),
                inconsistency: (condition.noise > 0.0).then(|| mean(&|at| each[at].inconsistency)),
            })
        };
        let stacks = (0..characters.origins().len()).map(Some);
        std::iter::once(None).chain(stacks).map(of).collect()
    }

    /// The features of some images.
    fn some(&self, judged: &Judged, places: &[usize]) -> Judged {
        let features = self.characters.features();
        let row = |&at: &usize| judged.features[at * features..][..features].iter().copied();
        Judged { features: places.iter().flat_map(row).collect(), ..Judged::default() }
    }
}

fn one(
    character: &Character,
    condition: Condition,
    readings: &[f32],
    image: &[f32],
) -> Result<One> {
    let sharp = &character.sharp;
    let camera = Consistency::new(READINGS, condition.sigma_px, condition.noise);
    Ok(One {
        // Two equal images have an infinite PSNR, which would make every mean infinite.
        psnr_db: metrics::psnr(sharp, image, SIDE, SIDE, 1.0)?.min(MOST_PSNR_DB),
        ssim: metrics::ssim(sharp, image, SIDE, SIDE, 1.0)?,
        inconsistency: f64::from(camera.residual_ratio(readings, image)),
    })
}

/// The PSNR of an error of a thousandth in every pixel.
const MOST_PSNR_DB: f64 = 60.0;

#[cfg(test)]
mod tests {
    use super::*;

    fn bar() -> Vec<f32> {
        (0..SIDE * SIDE).map(|at| if (24..40).contains(&(at % SIDE)) { 0.6 } else { 0.3 }).collect()
    }

    #[test]
    fn readings_have_the_noise_that_was_asked_for_and_its_pattern_stays() {
        let clean = Condition { sigma_px: 1.5, noise: 0.0 }.read(&bar(), 3, 0);
        let noise = |strength: f32, number| -> Vec<f32> {
            let noisy = Condition { sigma_px: 1.5, noise: strength }.read(&bar(), 3, number);
            noisy.iter().zip(&clean).map(|(a, b)| (a - b) / strength).collect()
        };
        let (weak, strong, other) = (noise(0.01, 0), noise(0.05, 0), noise(0.05, 1));
        let power = weak.iter().map(|v| v * v).sum::<f32>() / weak.len() as f32;
        assert!((power - 1.0).abs() < 0.1, "{power}");
        assert!(weak.iter().zip(&strong).all(|(a, b)| (a - b).abs() < 1e-3));
        assert!(weak.iter().zip(&other).any(|(a, b)| (a - b).abs() > 0.5));
    }

    #[test]
    fn sampling_adds_the_blur_that_is_reckoned() {
        // The second moment of the slope of an edge along one row.
        let edge: Vec<f32> =
            (0..SIDE * SIDE).map(|at| f32::from(u8::from(at % SIDE >= 32))).collect();
        let row = Blur::new(SIDE, SIDE, 2.0).apply(&edge);
        let moment = |line: &[f32], pitch: f32| {
            let slopes: Vec<f32> = line.windows(2).map(|w| w[1] - w[0]).collect();
            let total: f32 = slopes.iter().sum();
            let places = || slopes.iter().enumerate().map(|(k, s)| (pitch * k as f32, s / total));
            let mean: f32 = places().map(|(x, s)| x * s).sum();
            places().map(|(x, s)| (x - mean).powi(2) * s).sum::<f32>()
        };
        let fine = moment(&row[..SIDE], 1.0);
        let coarse = moment(&halved(&row)[..READINGS], 2.0);
        // Slopes are differences over one pixel and over two, whose own variance is 1/12 of the
        // pitch squared.
        let found = (coarse - 4.0 / 12.0) - (fine - 1.0 / 12.0);
        assert!((found - sampling_variance()).abs() < 0.02, "{found}");
    }
}

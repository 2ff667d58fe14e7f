//! The table of errors: how large the error of pixels that look alike was on calibration images.
//!
//! # Invariant
//! Of the calibration images' pixels, the share of each level lies within the half-width of this
//! level, in every bin of the table (`tests::the_share_of_each_level_lies_within_also_in_images_that_were_not_learnt`).

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::Seen;
use super::features::{BUSYNESS, FEATURES, NAMES, TERMS, features, terms};
use crate::deblur::AREA;

/// The levels of the table: shares of pixels whose error is not larger than the half-width.
pub const LEVELS: [f64; 7] = [0.5, 0.68, 0.8, 0.9, 0.95, 0.98, 0.99];

/// The level of a half-width without another choice.
pub const LEVEL: usize = 4;

/// Features are limited to so many standard deviations of the calibration images, because the
/// polynomial is not known further out.
const FARTHEST: f32 = 4.0;
/// Added to an error before its logarithm is taken.
const LEAST_ERROR: f32 = 0.01;
/// Only every second pixel of a row and of a column is taken for the polynomial: neighbours say
/// the same.
const EVERY: usize = 2;
/// Added to the diagonal of the normal equations, for features that are the same in all images.
const RIDGE: f64 = 1e-4;

/// Expected error, busyness and estimated blur give the bin, the bin gives the half-widths. A bin in
/// which calibration images have few pixels has the half-widths of all blurs together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Table {
    /// The features in order.
    features: Vec<String>,
    /// Mean of each feature.
    mean: [f32; FEATURES],
    /// Standard deviation of each feature.
    deviation: [f32; FEATURES],
    /// The polynomial that gives the logarithm of the expected error.
    polynomial: Vec<f32>,
    /// Bounds between the bins of the expected error's logarithm.
    scale_bounds: Vec<f32>,
    /// Bounds between the bins of the busyness of an image: how much its neighbouring pixels differ.
    busy_bounds: Vec<f32>,
    /// Bounds between the bins of the estimated blur of an image, in pixels.
    blur_bounds: Vec<f32>,
    /// The levels.
    levels: Vec<f64>,
    /// Half-width by kind of image (busyness, then blur), expected error and level.
    half_widths: Vec<Vec<Vec<f32>>>,
}

/// An enhanced image with its truth.
#[derive(Debug, Clone, Copy)]
pub struct Sample<'a> {
    /// What is known without the truth.
    pub seen: Seen<'a>,
    /// 64 x 64.
    pub truth: &'a [f32],
    /// The image's weight, so that a large stack counts no more than a small one.
    pub weight: f64,
}

/// Why there is no table.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum TableError {
    /// There are not enough images.
    #[error("{found} images for calibration, expected at least {least}")]
    Few {
        /// Number of images.
        found: usize,
        /// The least number.
        least: usize,
    },
    /// The features of the images say too little.
    #[error("the calibration images give no table: their features do not differ")]
    Alike,
    /// The file is of another program.
    #[error("the table has other features, levels or bins than this program")]
    Form,
}

/// The least number of pixels of a bin with half-widths of its own: half an image's. Fewer pixels are
/// of one or two images, whose errors say little about others.
const ENOUGH: usize = AREA / 2;

/// The least number of images of a calibration: with fewer, a bin has pixels of one image.
const LEAST: usize = 20;

impl Table {
    /// Learns the table from images. `scales`, `busyness` and `blurs` are the numbers of bins.
    ///
    /// # Errors
    /// [`TableError`] if the images are too few or too much alike.
    pub fn learn(
        samples: &[Sample<'_>],
        scales: usize,
        busyness: usize,
        blurs: usize,
    ) -> Result<Self, TableError> {
        if samples.len() < LEAST {
            return Err(TableError::Few { found: samples.len(), least: LEAST });
        }
        let mut table = Self::standard(samples);
        table.polynomial = table.fitted(samples).ok_or(TableError::Alike)?;
        let mut pixels = Vec::with_capacity(samples.len() * AREA);
        for sample in samples {
            let (image, scales) = table.places(&sample.seen);
            let errors = sample.seen.image.iter().zip(sample.truth).map(|(a, b)| (a - b).abs());
            let weight = sample.weight / AREA as f64;
            pixels.extend(scales.zip(errors).map(|(scale, error)| Pixel {
                image,
                scale,
                error,
                weight,
            }));
        }
        pixels.sort_unstable_by(|a, b| a.image.busy.total_cmp(&b.image.busy));
        table.busy_bounds = bounds(&pixels, |p| p.image.busy, &even(busyness));
        pixels.sort_unstable_by(|a, b| a.image.blur_px.total_cmp(&b.image.blur_px));
        table.blur_bounds = bounds(&pixels, |p| p.image.blur_px, &even(blurs));
        pixels.sort_unstable_by(|a, b| a.scale.total_cmp(&b.scale));
        // The bins are narrower where errors are large, because these pixels are few.
        let mut shares = even(scales);
        shares.extend([0.96, 0.98, 0.99]);
        shares.sort_by(f64::total_cmp);
        table.scale_bounds = bounds(&pixels, |p| p.scale, &shares);
        pixels.sort_unstable_by(|a, b| a.error.total_cmp(&b.error));
        let (scales, blurs) = (table.scale_bounds.len() + 1, table.blur_bounds.len() + 1);
        let mut bins: Vec<Vec<Pixel>> = vec![Vec::new(); table.kinds() * scales];
        let mut of_all_blurs: Vec<Vec<Pixel>> = vec![Vec::new(); table.kinds() / blurs * scales];
        for pixel in pixels {
            let (kind, scale) = table.bin(pixel.image, pixel.scale);
            bins[kind * scales + scale].push(pixel);
            of_all_blurs[kind / blurs * scales + scale].push(pixel);
        }
        // Where no image of any blur has a pixel, those of the next smaller expected error count.
        let mut before = vec![0.0; LEVELS.len()];
        let common: Vec<Vec<f32>> = of_all_blurs
            .iter()
            .map(|bin| {
                before = quantiles(bin).unwrap_or_else(|| before.clone());
                before.clone()
            })
            .collect();
        let widths = bins.chunks_exact(scales).enumerate().map(|(kind, bins)| {
            let common = common[kind / blurs * scales..].iter();
            let own = |bin: &[Pixel]| (bin.len() >= ENOUGH).then(|| quantiles(bin)).flatten();
            bins.iter()
                .zip(common)
                .map(|(bin, all)| own(bin).unwrap_or_else(|| all.clone()))
                .collect()
        });
        table.half_widths = widths.collect();
        Ok(table)
    }

    /// A table with the means and deviations of the features alone.
    fn standard(samples: &[Sample<'_>]) -> Self {
        let (mut total, mut sums, mut squares) = (0.0, [0.0; FEATURES], [0.0; FEATURES]);
        for sample in samples {
            let weight = sample.weight / AREA as f64;
            for pixel in features(&sample.seen) {
                total += weight;
                for (k, value) in pixel.into_iter().map(f64::from).enumerate() {
                    sums[k] += weight * value;
                    squares[k] += weight * value * value;
                }
            }
        }
        let mean = sums.map(|sum| sum / total);
        let deviation = std::array::from_fn(|k| {
            (squares[k] / total - mean[k].powi(2)).max(0.0).sqrt().max(1e-6) as f32
        });
        Self {
            features: NAMES.map(str::to_owned).to_vec(),
            mean: mean.map(|mean| mean as f32),
            deviation,
            polynomial: vec![0.0; TERMS],
            scale_bounds: Vec::new(),
            busy_bounds: Vec::new(),
            blur_bounds: Vec::new(),
            levels: LEVELS.to_vec(),
            half_widths: Vec::new(),
        }
    }

    /// The polynomial whose value is nearest to the logarithm of the errors (least squares).
    fn fitted(&self, samples: &[Sample<'_>]) -> Option<Vec<f32>> {
        let mut normal = DMatrix::<f64>::identity(TERMS, TERMS) * RIDGE;
        let mut right = DVector::<f64>::zeros(TERMS);
        let all: f64 = samples.iter().map(|sample| sample.weight).sum();
        let side = crate::deblur::SIDE;
        for sample in samples {
            let features = features(&sample.seen);
            let taken = (0..AREA).filter(|at| {
                (at / side).is_multiple_of(EVERY) && (at % side).is_multiple_of(EVERY)
            });
            let rows: Vec<usize> = taken.collect();
            let weight = (sample.weight / all / rows.len() as f64).sqrt();
            let terms: Vec<f64> = rows
                .iter()
                .flat_map(|&at| {
                    terms(&self.normalised(&features[at])).map(|t| f64::from(t) * weight)
                })
                .collect();
            let logs = rows.iter().map(|&at| {
                let error = (sample.seen.image[at] - sample.truth[at]).abs();
                f64::from((error + LEAST_ERROR).ln()) * weight
            });
            let terms = DMatrix::from_column_slice(TERMS, rows.len(), &terms);
            let logs = DVector::from_iterator(rows.len(), logs);
            normal += &terms * terms.transpose();
            right += terms * logs;
        }
        let solved = normal.cholesky()?.solve(&right);
        let solved: Vec<f32> = solved.iter().map(|&value| value as f32).collect();
        solved.iter().all(|value| value.is_finite()).then_some(solved)
    }

    fn normalised(&self, features: &[f32; FEATURES]) -> [f32; FEATURES] {
        std::array::from_fn(|k| {
            ((features[k] - self.mean[k]) / self.deviation[k]).clamp(-FARTHEST, FARTHEST)
        })
    }

    /// What the bin needs to know of the image, and the logarithm of the expected error of each
    /// pixel.
    fn places(&self, seen: &Seen<'_>) -> (OfImage, impl Iterator<Item = f32> + use<'_>) {
        let features = features(seen);
        let image = OfImage {
            busy: features.first().map_or(0.0, |first| first[BUSYNESS]),
            blur_px: seen.estimate.sigma_px,
        };
        let scales = features.into_iter().map(|pixel| {
            let terms = terms(&self.normalised(&pixel));
            terms.iter().zip(&self.polynomial).map(|(term, weight)| term * weight).sum()
        });
        (image, scales)
    }

    /// Number of kinds of images that the table tells apart.
    fn kinds(&self) -> usize {
        (self.busy_bounds.len() + 1) * (self.blur_bounds.len() + 1)
    }

    /// The kind of the image, and the bin of the expected error.
    fn bin(&self, image: OfImage, scale: f32) -> (usize, usize) {
        let place = |bounds: &[f32], value| bounds.partition_point(|&bound| bound < value);
        let (busy, blur) =
            (place(&self.busy_bounds, image.busy), place(&self.blur_bounds, image.blur_px));
        (busy * (self.blur_bounds.len() + 1) + blur, place(&self.scale_bounds, scale))
    }

    /// Half-width of each pixel's interval at a level of [`LEVELS`].
    pub fn half_widths(&self, seen: &Seen<'_>, level: usize) -> Vec<f32> {
        let (image, scales) = self.places(seen);
        let width = |scale| {
            let (kind, scale) = self.bin(image, scale);
            self.half_widths[kind][scale][level]
        };
        scales.map(width).collect()
    }

    /// Checks that lookups cannot fail.
    ///
    /// # Errors
    /// [`TableError::Form`] if a list has another length than the program expects.
    pub fn checked(self) -> Result<Self, TableError> {
        let scales = self.scale_bounds.len() + 1;
        let right = self.features == NAMES
            && self.levels == LEVELS
            && self.polynomial.len() == TERMS
            && self.half_widths.len() == self.kinds()
            && self.half_widths.iter().all(|bins| bins.len() == scales)
            && self.half_widths.iter().flatten().all(|widths| widths.len() == LEVELS.len());
        if right { Ok(self) } else { Err(TableError::Form) }
    }
}

/// What an image is as a whole, as far as the bin depends on it.
#[derive(Debug, Clone, Copy)]
struct OfImage {
    /// How much neighbouring pixels differ.
    busy: f32,
    /// The estimated blur.
    blur_px: f32,
}

/// One pixel of the calibration.
#[derive(Debug, Clone, Copy)]
struct Pixel {
    image: OfImage,
    scale: f32,
    error: f32,
    weight: f64,
}

/// The shares at which `count` bins of equal weight meet.
fn even(count: usize) -> Vec<f64> {
    (1..count).map(|k| k as f64 / count as f64).collect()
}

/// The values below which the shares of the weight lie. The pixels are sorted by value.
fn bounds(pixels: &[Pixel], value: impl Fn(&Pixel) -> f32, shares: &[f64]) -> Vec<f32> {
    let all: f64 = pixels.iter().map(|pixel| pixel.weight).sum();
    let (mut sum, mut left) = (0.0, shares.iter().peekable());
    let mut found = Vec::new();
    for pixel in pixels {
        sum += pixel.weight;
        while left.next_if(|&&share| sum >= share * all).is_some() {
            found.push(value(pixel));
        }
    }
    found.dedup();
    found
}

/// The error at each level; `None` without pixels. The pixels are sorted by error.
fn quantiles(pixels: &[Pixel]) -> Option<Vec<f32>> {
    let all: f64 = pixels.iter().map(|pixel| pixel.weight).sum();
    let last = pixels.last()?.error;
    let (mut sum, mut levels) = (0.0, LEVELS.iter().peekable());
    let mut found = Vec::with_capacity(LEVELS.len());
    for pixel in pixels {
        sum += pixel.weight;
        while levels.next_if(|&&level| sum >= level * all).is_some() {
            found.push(pixel.error);
        }
    }
    // The sum of the weights may be rounded down.
    found.resize(LEVELS.len(), last);
    Some(found)
}

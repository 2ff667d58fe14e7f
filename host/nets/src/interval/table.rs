//! The table of errors of one method of reconstruction: how large the error of pixels that look alike
//! was on calibration images.
//!
//! # Invariant
//! Of the calibration images' pixels, at least the share of [`LEVEL`] lies within the half-width, in
//! every cell of share, noise and contrast with enough images
//! (`tests::the_share_of_the_level_lies_within_also_in_images_that_were_not_learnt`). No half-width
//! is below [`FLOOR`] (`tests::no_half_width_is_below_what_a_bench_can_hold`).

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::features::{BUSYNESS, CONTRAST, FEATURES, NAMES, TERMS, features, terms};
use super::{Readings, Seen};
use crate::grid::{AREA, FINE as SIDE};
use crate::rounding::rounded;

/// The levels of the table: shares of pixels whose error is not larger than the half-width.
pub const LEVELS: [f64; 7] = [0.5, 0.68, 0.8, 0.9, 0.95, 0.98, 0.99];

/// The level of a half-width without another choice.
pub const LEVEL: usize = 4;

/// The smallest half-width; white is 1. A bench does not hold its zero and its white better: the dark
/// level and the white sheet are measured once, with about as much noise as a pixel has in half a
/// second of light, and both drift by some thousandths until the next calibration. The virtual
/// camera's own background is off by 0.003 after its calibration.
pub const FLOOR: f32 = 0.004;

/// Features are limited to so many standard deviations of the calibration images, because the
/// polynomial is not known further out.
const FARTHEST: f32 = 4.0;
/// Added to an error before its logarithm is taken.
const LEAST_ERROR: f32 = 0.01;
/// Only every second pixel of a row and of a column is taken for the polynomial: neighbours say
/// nearly the same.
const EVERY: usize = 2;
/// Added to the diagonal of the normal equations, whose samples have a total weight of 1.
const RIDGE: f64 = 1e-4;
/// The truth's pixels with the largest steps to their neighbours are its edges: this share.
const EDGES: f64 = 0.2;
/// The least share of the pixels at edges that lies within the half-width of [`LEVEL`].
const AT_EDGES: f64 = 0.94;
/// The least number of images of one kind for a factor of their own in a cell. With fewer, the cell
/// has the factor of all images of the kind.
const ENOUGH: usize = 12;
/// The least factor of a cell.
const LEAST_FACTOR: f32 = 0.5;
/// The least number of images of a calibration.
const LEAST: usize = 20;

/// Bounds between the cells: share of the patterns, noise of the readings, and the logarithm of the
/// image's contrast.
const SHARES: [f32; 1] = [0.18];
const NOISES: [f32; 1] = [0.05];
const CONTRASTS: [f32; 2] = [-2.6, -2.05];

/// Expected error times a factor gives the half-width. The factor comes from texture and expected
/// error, and from the cell of share, noise and contrast.
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
    /// Bounds between the bins of texture: how much neighbouring pixels differ, for the contrast of
    /// the image. It tells a letter on black from a photograph.
    texture_bounds: Vec<f32>,
    /// The levels.
    levels: Vec<f64>,
    /// Error over expected error by texture, expected error and level.
    factors: Vec<Vec<Vec<f32>>>,
    /// Factor of each cell, by share, noise and contrast.
    cells: Vec<f32>,
}

/// An enhanced image with its truth.
#[derive(Debug, Clone, Copy)]
pub struct Sample<'a> {
    /// What is known without the truth.
    pub seen: Seen<'a>,
    /// How its readings were taken.
    pub readings: Readings<'a>,
    /// 64 x 64.
    pub truth: &'a [f32],
    /// The image's weight, so that a large stack counts no more than a small one.
    pub weight: f64,
    /// The kind of scene. The half-widths of each cell hold for every kind, not for their mixture.
    pub kind: usize,
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

impl Table {
    /// Learns the table of one method from images. `scales` and `textures` are the numbers of bins.
    ///
    /// # Errors
    /// [`TableError`] if the images are too few or too much alike.
    pub fn learn(
        samples: &[Sample<'_>],
        scales: usize,
        textures: usize,
    ) -> Result<Self, TableError> {
        if samples.len() < LEAST {
            return Err(TableError::Few { found: samples.len(), least: LEAST });
        }
        let mut table = Self::standard(samples);
        table.polynomial = table.fitted(samples).ok_or(TableError::Alike)?;
        let mut pixels = Vec::with_capacity(samples.len() * AREA);
        for (image, sample) in samples.iter().enumerate() {
            let (of, scales) = table.places(&sample.seen, &sample.readings);
            let errors = sample.seen.image.iter().zip(sample.truth).map(|(a, b)| (a - b).abs());
            let weight = sample.weight / AREA as f64;
            let edges = edges(sample.truth);
            pixels.extend(scales.zip(errors).zip(edges).map(|((scale, error), edge)| Pixel {
                image,
                texture: of.texture,
                scale,
                ratio: error / scale.exp(),
                error,
                edge,
                weight,
            }));
        }
        pixels.sort_unstable_by(|a, b| a.texture.total_cmp(&b.texture));
        table.texture_bounds = bounds(&pixels, |p| p.texture, &even(textures));
        pixels.sort_unstable_by(|a, b| a.scale.total_cmp(&b.scale));
        // The bins are narrower where errors are large, because these pixels are few.
        let mut shares = even(scales);
        shares.extend([0.96, 0.98]);
        shares.sort_by(f64::total_cmp);
        table.scale_bounds = bounds(&pixels, |p| p.scale, &shares);
        pixels.sort_unstable_by(|a, b| a.ratio.total_cmp(&b.ratio));
        let scales = table.scale_bounds.len() + 1;
        let mut bins = vec![Vec::new(); (table.texture_bounds.len() + 1) * scales];
        for pixel in &pixels {
            let (texture, scale) = table.bin(pixel.texture, pixel.scale);
            bins[texture * scales + scale].push(*pixel);
        }
        let all = quantiles(&pixels).ok_or(TableError::Alike)?;
        table.factors = bins
            .chunks_exact(scales)
            .map(|bins| {
                let mut before = all.clone();
                let own = bins.iter().map(|bin| {
                    // A bin without pixels has the factors of the bin before.
                    before = quantiles(bin).unwrap_or_else(|| before.clone());
                    before.clone()
                });
                own.collect()
            })
            .collect();
        table.cells = table.cell_factors(samples, &pixels);
        table.round();
        Ok(table)
    }

    /// The factor of each cell: the least at which enough pixels lie within, over all and at edges.
    /// A cell with few images takes the factor of all images.
    fn cell_factors(&self, samples: &[Sample<'_>], pixels: &[Pixel]) -> Vec<f32> {
        let cell_of: Vec<usize> = samples
            .iter()
            .map(|sample| cell(&sample.readings, self.places(&sample.seen, &sample.readings).0))
            .collect();
        let kinds = samples.iter().map(|sample| sample.kind + 1).max().unwrap_or(1);
        let mut by_cell: Vec<Vec<(f32, f64, bool)>> = vec![Vec::new(); CELLS * kinds];
        let mut by_kind: Vec<Vec<(f32, f64, bool)>> = vec![Vec::new(); kinds];
        for pixel in pixels {
            let (texture, scale) = self.bin(pixel.texture, pixel.scale);
            let width = self.factors[texture][scale][LEVEL] * pixel.scale.exp();
            // What the floor holds needs no factor.
            let needed = if pixel.error <= FLOOR { 0.0 } else { pixel.error / width };
            let row = (needed, pixel.weight, pixel.edge);
            let kind = samples[pixel.image].kind;
            by_cell[cell_of[pixel.image] * kinds + kind].push(row);
            by_kind[kind].push(row);
        }
        let of_all: Vec<f32> = by_kind.into_iter().map(least_factor).collect();
        let factors: Vec<f32> = by_cell
            .into_iter()
            .enumerate()
            .map(|(place, rows)| match rows.len() < ENOUGH * AREA {
                true => of_all[place % kinds],
                false => least_factor(rows),
            })
            .collect();
        let most = |kinds: &[f32]| kinds.iter().copied().fold(0.0, f32::max);
        factors.chunks_exact(kinds).map(most).collect()
    }

    /// A table with the means and deviations of the features alone.
    fn standard(samples: &[Sample<'_>]) -> Self {
        let (mut total, mut sums, mut squares) = (0.0, [0.0; FEATURES], [0.0; FEATURES]);
        for sample in samples {
            let weight = sample.weight / AREA as f64;
            for pixel in features(&sample.seen, &sample.readings) {
                total += weight;
                for (k, value) in pixel.into_iter().map(f64::from).enumerate() {
                    sums[k] += weight * value;
                    squares[k] += weight * value * value;
                }
            }
        }
        let mean = sums.map(|sum| sum / total);
        let deviation = std::array::from_fn(|k| {
            (squares[k] / total - mean[k].powi(2)).max(0.0).sqrt().max(1e-3) as f32
        });
        Self {
            features: NAMES.map(str::to_owned).to_vec(),
            mean: mean.map(|mean| mean as f32),
            deviation,
            polynomial: vec![0.0; TERMS],
            scale_bounds: Vec::new(),
            texture_bounds: Vec::new(),
            levels: LEVELS.to_vec(),
            factors: Vec::new(),
            cells: Vec::new(),
        }
    }

    /// The polynomial whose value is nearest to the logarithm of the errors (least squares).
    fn fitted(&self, samples: &[Sample<'_>]) -> Option<Vec<f32>> {
        let mut normal = DMatrix::<f64>::identity(TERMS, TERMS) * RIDGE;
        let mut right = DVector::<f64>::zeros(TERMS);
        let all: f64 = samples.iter().map(|sample| sample.weight).sum();
        for sample in samples {
            let features = features(&sample.seen, &sample.readings);
            let taken = (0..AREA).filter(|at| {
                (at / SIDE).is_multiple_of(EVERY) && (at % SIDE).is_multiple_of(EVERY)
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

    /// What bin and cell need to know of the image, and the logarithm of the expected error of each
    /// pixel.
    fn places(
        &self,
        seen: &Seen<'_>,
        readings: &Readings<'_>,
    ) -> (OfImage, impl Iterator<Item = f32> + use<'_>) {
        let features = features(seen, readings);
        let of = features.first().map_or(OfImage::default(), |first| OfImage {
            texture: first[BUSYNESS] - first[CONTRAST],
            contrast: first[CONTRAST],
        });
        let scales = features.into_iter().map(|pixel| {
            let terms = terms(&self.normalised(&pixel));
            terms.iter().zip(&self.polynomial).map(|(term, weight)| term * weight).sum()
        });
        (of, scales)
    }

    /// The bins of texture and of the expected error.
    fn bin(&self, texture: f32, scale: f32) -> (usize, usize) {
        (place(&self.texture_bounds, texture), place(&self.scale_bounds, scale))
    }

    /// Half-width of each pixel's interval at a level of [`LEVELS`].
    pub fn half_widths(&self, seen: &Seen<'_>, readings: &Readings<'_>, level: usize) -> Vec<f32> {
        self.at_levels(seen, readings, [level]).into_iter().map(|[width]| width).collect()
    }

    /// Half-widths of each pixel's interval at some of [`LEVELS`].
    pub fn at_levels<const N: usize>(
        &self,
        seen: &Seen<'_>,
        readings: &Readings<'_>,
        levels: [usize; N],
    ) -> Vec<[f32; N]> {
        let (of, scales) = self.places(seen, readings);
        let of_cell = self.cells[cell(readings, of)];
        let widths = |scale: f32| {
            let (texture, bin) = self.bin(of.texture, scale);
            let factors = &self.factors[texture][bin];
            levels.map(|level| (of_cell * factors[level] * scale.exp()).clamp(FLOOR, 1.0))
        };
        scales.map(widths).collect()
    }

    /// Checks that lookups cannot fail.
    ///
    /// # Errors
    /// [`TableError::Form`] if a list has another length than the program expects.
    pub fn checked(&self) -> Result<(), TableError> {
        let scales = self.scale_bounds.len() + 1;
        let right = self.features == NAMES
            && self.levels == LEVELS
            && self.polynomial.len() == TERMS
            && self.cells.len() == CELLS
            && self.factors.len() == self.texture_bounds.len() + 1
            && self.factors.iter().all(|bins| bins.len() == scales)
            && self.factors.iter().flatten().all(|factors| factors.len() == LEVELS.len());
        if right { Ok(()) } else { Err(TableError::Form) }
    }

    /// Rounds the numbers to five digits, which is more than they are known to.
    fn round(&mut self) {
        let lists = [
            self.mean.as_mut_slice(),
            &mut self.deviation,
            &mut self.polynomial,
            &mut self.scale_bounds,
            &mut self.texture_bounds,
            &mut self.cells,
        ];
        let factors = self.factors.iter_mut().flatten().map(Vec::as_mut_slice);
        lists.into_iter().chain(factors).flatten().for_each(|value| *value = rounded(*value));
    }
}

/// Number of cells.
const CELLS: usize = (SHARES.len() + 1) * (NOISES.len() + 1) * (CONTRASTS.len() + 1);

/// The bin of a value between bounds.
fn place(bounds: &[f32], value: f32) -> usize {
    bounds.partition_point(|&bound| bound < value)
}

/// The cell of an image.
fn cell(readings: &Readings<'_>, of: OfImage) -> usize {
    let (share, noise) = (place(&SHARES, readings.share), place(&NOISES, readings.noise));
    let contrast = place(&CONTRASTS, of.contrast);
    (share * (NOISES.len() + 1) + noise) * (CONTRASTS.len() + 1) + contrast
}

/// What an image is as a whole, as far as bin and cell depend on it.
#[derive(Debug, Clone, Copy, Default)]
struct OfImage {
    /// How much neighbouring pixels differ, for the image's contrast.
    texture: f32,
    /// The logarithm of the image's contrast.
    contrast: f32,
}

/// One pixel of the calibration.
#[derive(Debug, Clone, Copy)]
struct Pixel {
    /// Number of its image.
    image: usize,
    texture: f32,
    /// Logarithm of the expected error.
    scale: f32,
    /// Error over expected error.
    ratio: f32,
    error: f32,
    /// Whether the truth has an edge here.
    edge: bool,
    weight: f64,
}

/// The pixels of an image with the largest steps to their neighbours on the right and below.
#[must_use]
pub fn edges(truth: &[f32]) -> Vec<bool> {
    let at = |row: usize, column: usize| truth[row.min(SIDE - 1) * SIDE + column.min(SIDE - 1)];
    let step = |place: usize| {
        let (row, column) = (place / SIDE, place % SIDE);
        let here = at(row, column);
        (at(row + 1, column) - here).hypot(at(row, column + 1) - here)
    };
    let steps: Vec<f32> = (0..AREA).map(step).collect();
    let mut sorted = steps.clone();
    sorted.sort_unstable_by(f32::total_cmp);
    let bound = sorted[((1.0 - EDGES) * AREA as f64) as usize];
    steps.into_iter().map(|step| step > 0.0 && step >= bound).collect()
}

/// The least factor at which [`LEVEL`] of the weight lies within, and [`AT_EDGES`] of that at edges.
/// A row is the factor that a pixel needs, its weight, and whether it is at an edge.
fn least_factor(mut rows: Vec<(f32, f64, bool)>) -> f32 {
    rows.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let reach = |level: f64, counts: &dyn Fn(bool) -> bool| {
        let all: f64 = rows.iter().filter(|row| counts(row.2)).map(|row| row.1).sum();
        let mut sum = 0.0;
        let reached = rows.iter().filter(|row| counts(row.2)).find(|row| {
            sum += row.1;
            sum >= level * all
        });
        reached.map_or(1.0, |row| row.0)
    };
    let over_all = reach(LEVELS[LEVEL], &|_| true);
    let at_edges = reach(AT_EDGES, &|edge| edge);
    // Where the floor holds all pixels, any factor does.
    over_all.max(at_edges).max(LEAST_FACTOR)
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

/// The ratio at each level; `None` without pixels. The pixels are sorted by ratio.
fn quantiles(pixels: &[Pixel]) -> Option<Vec<f32>> {
    let all: f64 = pixels.iter().map(|pixel| pixel.weight).sum();
    let last = pixels.last()?.ratio;
    let (mut sum, mut levels) = (0.0, LEVELS.iter().peekable());
    let mut found = Vec::with_capacity(LEVELS.len());
    for pixel in pixels {
        sum += pixel.weight;
        while levels.next_if(|&&level| sum >= level * all).is_some() {
            found.push(pixel.ratio);
        }
    }
    // The sum of the weights may be rounded down.
    found.resize(LEVELS.len(), last);
    Some(found)
}

//! Frames of the same patterns: their noise, their means, and what one motion makes of them.

use crate::canvas::Canvas;
use crate::fit::{Fit, Fitted, Group, Known, beyond_noise, most_by_noise};
use crate::search::Shapes;
use crate::{FollowError, FollowSettings, Followed, Timed};
use nirspi_recon::Measurements;

/// The fewest frames whose motion is looked for.
pub(crate) const FEWEST: usize = 4;
/// Frames of a slow target are added by twos, threes and so on first, as long as it moves by no more than this
/// meanwhile, in pixels.
const GROUP_PX: f64 = 0.5;
/// The fewest groups of a fit.
const GROUPS: usize = 8;
/// The noise is read from the row that is louder than one in this number of all rows: louder rows may show the motion.
const QUIET: usize = 5;
/// Normal deviate that one of [`QUIET`] is below.
const QUIET_DEVIATE: f64 = -0.841_6;
/// Second differences one after another have two thirds of their square in common, and a sixth with the ones after: their
/// mean spreads as if there were this many times fewer.
const ALIKE: f64 = 1.0 + 2.0 * (16.0 / 36.0 + 1.0 / 36.0);
/// A fit that leaves no more than this beyond noise needs no other guess of the motion, in variances of the noise.
const SMALL: f64 = 0.1;

/// Part of what a fit leaves of all frames beyond noise that counts as an error of the scene as it stands now. What it leaves of
/// the newest frames counts whole.
const OF_BEYOND: f64 = 0.3;
/// The most that a fit leaves beyond noise, in variances of a frame's noise.
const MOST_BEYOND: f64 = 0.3;
/// The fit may find a motion that is faster than the search reached, by this factor.
const BEYOND_REACH: f64 = 1.2;

/// Frames that were added, as values divided by the side.
pub(crate) struct Sum {
    values: Vec<f64>,
    frames: usize,
    pub velocity_px: [f64; 2],
    /// Variance of a value: by noise, and by what the fit leaves beyond noise; `None` where the noise is unknown.
    pub error: Option<f64>,
}

/// Frames of the same patterns.
pub(crate) struct Frames<'a>(&'a [Timed<'a>]);

impl<'a> Frames<'a> {
    /// Frames one after another.
    ///
    /// # Errors
    /// [`FollowError`] without frames, and for frames that do not belong together.
    pub fn of(frames: &'a [Timed<'a>]) -> Result<Self, FollowError> {
        let newest = frames.last().ok_or(FollowError::Empty)?;
        let mut before = f64::NEG_INFINITY;
        for (index, frame) in frames.iter().enumerate() {
            if frame.frame.rows() != newest.frame.rows() {
                return Err(FollowError::Rows { index });
            }
            if !frame.at.is_finite() || frame.at <= before {
                return Err(FollowError::Time { index, found: frame.at });
            }
            before = frame.at;
        }
        Ok(Self(frames))
    }

    /// Number of frames.
    pub fn count(&self) -> usize {
        self.0.len()
    }

    pub fn newest(&self, count: usize) -> Self {
        Self(&self.0[self.0.len() - count..])
    }

    fn side(&self) -> f64 {
        self.0.last().map_or(1.0, |frame| frame.frame.side().pixels() as f64)
    }

    /// Values of a frame, divided by the side: the lengths of image and readings are alike then.
    fn values(&self, index: usize) -> impl Iterator<Item = f64> + '_ {
        let side = self.side();
        self.0[index].frame.values().iter().map(move |value| value / side)
    }

    /// Variance of one of the [values](Self::values): by what three frames one after another leave of a straight line, of
    /// the quiet rows, and by what the camera knows, whichever is less. Of fewer than [`FEWEST`] frames only what the
    /// camera knows.
    pub fn noise(&self) -> Option<f64> {
        let known = self.0.iter().filter_map(|frame| frame.frame.noise());
        let known = known.map(|noise| (noise / self.side()).powi(2)).reduce(f64::min);
        if self.0.len() < FEWEST {
            return known;
        }
        let triples = self.0.len() - 2;
        let mut rows = vec![0.0; self.0.last().map_or(0, |frame| frame.frame.values().len())];
        for at in 1..=triples {
            let around = self.values(at - 1).zip(self.values(at)).zip(self.values(at + 1));
            for (row, ((a, b), c)) in rows.iter_mut().zip(around) {
                *row += (a - 2.0 * b + c).powi(2) / 6.0 / triples as f64;
            }
        }
        let quiet = rows.len() / QUIET;
        let (_, found, _) = rows.select_nth_unstable_by(quiet, f64::total_cmp);
        let seen = *found / of_quiet_rows(triples);
        Some(known.map_or(seen, |known| known.min(seen)))
    }

    /// Whether older and newer half have the same mean, as far as noise lets see.
    pub fn rests(&self, noise: f64) -> bool {
        let half = self.0.len() / 2;
        let (older, newer) = (self.mean_of(0..half), self.mean_of(half..self.0.len()));
        let expected = noise * (1.0 / half as f64 + 1.0 / (self.0.len() - half) as f64);
        let squares = older.iter().zip(&newer).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
        let readings = older.len() as f64;
        squares / readings <= most_by_noise(expected, readings)
    }

    fn mean_of(&self, of: std::ops::Range<usize>) -> Vec<f64> {
        let scale = 1.0 / of.len().max(1) as f64;
        let mut mean = vec![0.0; self.0.last().map_or(0, |frame| frame.frame.values().len())];
        for index in of {
            mean.iter_mut()
                .zip(self.values(index))
                .for_each(|(mean, value)| *mean += value * scale);
        }
        mean
    }

    /// The mean of the newest frames. Their noise is unknown, or known.
    pub fn at_rest(&self, count: usize, noise: Option<f64>) -> Sum {
        let values = self.mean_of(self.0.len() - count..self.0.len());
        let error = noise.map(|noise| {
            let newest = (self.0.len() - count / 2..self.0.len()).rev();
            let left = newest.map(|index| self.values(index).zip(&values).map(|(a, b)| a - b));
            noise / count as f64 + beyond_noise(left, noise)
        });
        Sum { values, frames: count, velocity_px: [0.0; 2], error }
    }

    /// The sum as a measurement.
    ///
    /// # Errors
    /// [`FollowError`] if a value is no number.
    pub fn followed(&self, sum: Sum) -> Result<Followed, FollowError> {
        let Sum { values, frames, velocity_px, error } = sum;
        let newest = self.0.last().ok_or(FollowError::Empty)?.frame;
        let values: Vec<f64> = values.into_iter().map(|value| value * self.side()).collect();
        let mut measurements = Measurements::from_differential(newest.rows(), &values)?;
        if let Some(error) = error {
            measurements = measurements.with_noise(error.sqrt() * self.side())?;
        }
        Ok(Followed { measurements, frames, velocity_px })
    }

    /// The scene of the newest frame by all of these frames, for the motion that explains them best. `None` where the scene
    /// moves by more than a side meanwhile, or where there are fewer than [`FEWEST`] frames.
    pub fn moved(&self, noise: f64, settings: &FollowSettings) -> Option<Sum> {
        let newest = self.0.last()?;
        if self.0.len() < FEWEST {
            return None;
        }
        let canvas = Canvas::new(newest.frame.rows());
        let mut best: Option<(Fitted, f64)> = None;
        for guess in settings.before.map(Some).into_iter().chain([None]) {
            let guess = guess.unwrap_or_else(|| self.guess(&canvas, settings.reach_px));
            if !self.reaches(guess, settings.reach_px) {
                continue;
            }
            let together = together(guess, self.0.len());
            let of_group = noise / together as f64;
            let known = Known {
                noise: of_group,
                variance: self.variance(&canvas, noise),
                frames: together as f64,
            };
            let groups = self.groups(together);
            let fitted = Fit::new(&canvas, &groups, known).from(guess);
            if !self.reaches(fitted.velocity_px, settings.reach_px) {
                continue;
            }
            let beyond = (fitted.left - of_group).max(0.0).max(fitted.beyond_newest);
            let enough = beyond < SMALL * of_group;
            if best.as_ref().is_none_or(|best| beyond < best.1) {
                best = Some((fitted, beyond));
            }
            if enough {
                break;
            }
        }
        let (fitted, beyond) = best.filter(|(_, beyond)| *beyond <= MOST_BEYOND * noise)?;
        let way = canvas.way(fitted.velocity_px, newest.at - self.middle());
        let seen = canvas.frame(&fitted.spectrum, &way);
        let beyond = (OF_BEYOND * beyond).max(fitted.beyond_newest);
        let error = noise * self.share_of_noise(fitted.velocity_px) + beyond;
        Some(Sum {
            values: seen.into_iter().map(f64::from).collect(),
            frames: self.0.len(),
            velocity_px: fitted.velocity_px,
            error: Some(error),
        })
    }

    /// Whether a motion is one that was asked for, and is no further in all than the canvas reaches.
    fn reaches(&self, velocity_px: [f64; 2], reach_px: f64) -> bool {
        let most = (reach_px * BEYOND_REACH).min(self.side() / self.span());
        velocity_px.iter().all(|speed| speed.abs() <= most)
    }

    /// The time in the middle. A scene that stands there does not move when its speed is changed.
    fn middle(&self) -> f64 {
        let ends = [self.0.first(), self.0.last()];
        ends.into_iter().flatten().map(|frame| frame.at / 2.0).sum()
    }

    /// From the first to the last frame, in frames.
    fn span(&self) -> f64 {
        self.0.last().map_or(0.0, |frame| frame.at) - self.0.first().map_or(0.0, |frame| frame.at)
    }

    /// Means of `together` frames one after another, the newest ones.
    fn groups(&self, together: usize) -> Vec<Group> {
        let middle = self.middle();
        let first = self.0.len() % together;
        let starts = (first..self.0.len()).step_by(together);
        starts
            .map(|start| {
                let of = start..start + together;
                let time =
                    of.clone().map(|at| self.0[at].at - middle).sum::<f64>() / together as f64;
                Group {
                    time,
                    readings: self.mean_of(of).into_iter().map(|value| value as f32).collect(),
                }
            })
            .collect()
    }

    /// A first guess of the motion.
    fn guess(&self, canvas: &Canvas, reach_px: f64) -> [f64; 2] {
        let images: Vec<(f64, Vec<f32>)> = self
            .groups(1)
            .into_iter()
            .map(|group| (group.time, canvas.least(&group.readings)))
            .collect();
        Shapes::of(&images, self.side() as usize).motion(reach_px)
    }

    /// Variance of the image's pixels, without that of noise.
    fn variance(&self, canvas: &Canvas, noise: f64) -> f64 {
        let newest = (self.0.len() / 4).max(1);
        let readings: Vec<f32> = self
            .mean_of(self.0.len() - newest..self.0.len())
            .into_iter()
            .map(|value| value as f32)
            .collect();
        let image = canvas.least(&readings);
        let mean = image.iter().sum::<f32>() / image.len() as f32;
        let power = image.iter().map(|value| f64::from(value - mean).powi(2)).sum::<f64>()
            / image.len() as f64;
        let of_noise = noise / newest as f64 * canvas.readings() as f64 / image.len() as f64;
        (power - of_noise).max(0.01 * power)
    }

    /// Noise of the result, as a share of that of a frame: parts of the scene that came into the field late were seen by
    /// fewer frames.
    pub fn share_of_noise(&self, velocity_px: [f64; 2]) -> f64 {
        let side = self.side();
        let newest = self.0.last().map_or(0.0, |frame| frame.at);
        let mut share = 0.0;
        for pixel in 0..(side * side) as usize {
            let at = [(pixel / side as usize) as f64, (pixel % side as usize) as f64];
            let inside = |frame: &&Timed<'_>| {
                let moved = |axis: usize| at[axis] + velocity_px[axis] * (frame.at - newest);
                (0..2).all(|axis| (-0.5..side - 0.5).contains(&moved(axis)))
            };
            share += 1.0 / self.0.iter().filter(inside).count().max(1) as f64;
        }
        share / (side * side)
    }
}

/// Below this lies one of [`QUIET`] means of the squares of `triples` second differences of variance 1 (E. B. Wilson and M. M.
/// Hilferty, *The distribution of chi-square*, 1931).
fn of_quiet_rows(triples: usize) -> f64 {
    let ninth = 2.0 * ALIKE / (9.0 * triples as f64);
    (1.0 - ninth + QUIET_DEVIATE * ninth.sqrt()).powi(3)
}

/// Number of frames that are added first, for this motion.
fn together(velocity_px: [f64; 2], count: usize) -> usize {
    let speed = velocity_px[0].hypot(velocity_px[1]);
    let by_speed = if speed > 0.0 { (GROUP_PX / speed) as usize } else { count };
    by_speed.min(count / GROUPS).max(1)
}

//! A recursive estimate of a moving scene: each frame starts from what the frames before have
//! shown.
//!
//! The state is one value and one variance for each Hadamard row (a Kalman filter with a diagonal
//! covariance; R. E. Kalman, *A new approach to linear filtering and prediction problems*, 1960).
//! The frames may measure different rows: a row that this frame leaves out keeps its value, and
//! loses weight as the scene moves on. A frame is added in seven steps:
//!
//! 1. **Noise**: of several upper bounds, by this frame alone and by what the past misses of the
//!    frame, the smallest counts (`noise.rs`). Too much noise would make the past count too much.
//! 2. **Motion**: the estimate is moved as a whole to where it agrees best with the readings, if
//!    the gain in likelihood pays for two more parameters.
//! 3. **Ageing**: the scene is taken as a Gaussian process whose cosine of frequency `f` (half
//!    periods per side `n`) keeps the share `exp(-(pi f v / n)^2 / 2)` from frame to frame. That is
//!    the mean over normal displacements of `v` pixels. The speed `v` is the likeliest of a list.
//! 4. **Cut**: if a scene without any past is likelier than each speed, the frame starts anew.
//! 5. **Surprise**: rows of a band of frequencies lose as much weight as the past misses of their
//!    readings beyond noise and ageing.
//! 6. **Fusion**: each measured row becomes the mean of old value and reading, weighted by their
//!    variances.
//! 7. **Completion**: the image is the most likely one given all rows with their own variances and
//!    amplitudes that fall as one over frequency (Tikhonov's method with weights). Rows that were
//!    read at earlier positions of the scene, six at most, count where they were read.
//!
//! # Invariant
//! A frame without a past is the image of [`regularised`] with Tikhonov's penalty, bit for bit
//! (`tests::a_cut_starts_anew_and_costs_nothing`). While nothing moves and all rows are measured,
//! the image is the mean of the frames (`tests::a_still_scene_is_the_mean_of_its_frames`).

mod belief;
mod joint;
mod motion;
mod noise;
mod past;
mod rows;
mod view;

use super::regularised::tikhonov;
use super::{
    NoiseLevel, Penalty, Problem, ReconstructError, RegularisedSettings, Strength, regularised,
};
use crate::basis::Basis;
use crate::{Image, Measurements, Side, fwht};
use belief::Belief;
use joint::Joint;
use motion::{SHIFTS, Shift, best_shift};
use past::{Known, Past, Pose, median};
use rows::Spectrum;
use std::collections::VecDeque;
use view::{Guess, View};

/// Smallest noise, in units of the largest measurement: rounding.
const LEAST_NOISE: f32 = 1e-6;

/// Settings of [`Recursive`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RecursiveSettings {
    /// Noise of a measurement.
    pub noise: NoiseLevel,
    /// Strength of the penalty. A cross-validated strength is chosen for frames without a past;
    /// later frames take 1, what noise and prior call for.
    pub strength: Strength,
    /// Speed in pixels a frame; `None`: the likeliest for each frame.
    pub speed_px: Option<f64>,
    /// Whether the estimate is moved with the scene.
    pub follow: bool,
}

impl Default for RecursiveSettings {
    fn default() -> Self {
        Self {
            noise: NoiseLevel::Estimated,
            strength: Strength::default(),
            speed_px: None,
            follow: true,
        }
    }
}

/// A frame of a recursive estimate.
#[derive(Debug, Clone, PartialEq)]
pub struct RecursiveFrame {
    /// The image, in the measurements' units.
    pub image: Image,
    /// Whether the frame is the first one of the estimate.
    pub first: bool,
    /// Whether the frames before had a part in the image.
    pub warm: bool,
    /// Motion of the whole scene since the frame before: down and to the right, in pixels.
    pub shift_px: [f64; 2],
    /// Motion that the common motion leaves out, in pixels a frame.
    pub speed_px: f64,
    /// The rows that are known nearly as well as by one reading, and their values: measurements
    /// of a still scene, for any other method. Without a past these are the frame's.
    pub fused: Measurements,
    /// Of the [fused](Self::fused) rows, those that have been read at the scene's last position, and
    /// those of which readings at earlier positions say far more than can be expected of any scene.
    pub certain: Measurements,
    /// Norm of the difference between this frame's measurements and the image, relative to the
    /// measurements' norm.
    pub residual: f64,
    /// Mean weight of the readings in the rows that are known at least as well as by one reading. A
    /// frame with a past keeps their fused values.
    pub reading_weight: f64,
    /// Noise of a measurement, in the measurements' units.
    pub noise: f64,
    /// Strength of the penalty.
    pub strength: f64,
}

impl RecursiveFrame {
    /// What a reader should know about the frame, in a few words; nothing for a first frame.
    #[must_use]
    pub fn note(&self) -> Option<String> {
        let [down, right] = self.shift_px;
        let (known, speed) = (self.fused.rows().len(), self.speed_px as f32);
        match (self.warm, self.first) {
            (true, _) => Some(format!(
                "{known} patterns known, scene moved by {down} px down and {right} px right, other motion {speed} px"
            )),
            (false, false) => {
                Some("another scene than in the frame before, so the frame started anew".to_owned())
            }
            (false, true) => None,
        }
    }
}

/// What the frames so far have shown.
#[derive(Debug, Clone)]
pub struct Recursive {
    settings: RecursiveSettings,
    past: Option<Past>,
    /// Whether a frame has been added since the beginning.
    begun: bool,
    /// How far the fused rows are believed ([`believed_frame`](super::believed_frame)).
    belief: Belief,
}

impl Recursive {
    /// An estimate without a past.
    ///
    /// # Errors
    /// [`ReconstructError`] if a setting is out of range.
    pub fn new(settings: RecursiveSettings) -> Result<Self, ReconstructError> {
        if let Some(found) = settings.speed_px
            && !(0.0..=1e3).contains(&found)
        {
            let (setting, expected) = ("speed", "0 to 1000 pixels a frame");
            return Err(ReconstructError::Setting { setting, found, expected });
        }
        settings.strength.check()?;
        super::check_prior(Some(FALLOFF), settings.noise)?;
        Ok(Self { settings, past: None, begun: false, belief: Belief::default() })
    }

    /// Forgets the past.
    pub fn restart(&mut self) {
        (self.past, self.begun, self.belief) = (None, false, Belief::default());
    }

    /// The share of the fused rows' image in the image of a frame that has been added. A frame
    /// without a past begins the judgement anew.
    pub(super) fn share(&mut self, frame: &Measurements, warm: bool) -> f64 {
        match &self.past {
            Some(past) if warm => self.belief.judge(past, frame),
            _ => self.belief = Belief::default(),
        }
        self.belief.share()
    }

    /// Keeps the images of a frame, by the frame alone and by the fused rows, for the next frame's
    /// share.
    pub(super) fn remember(&mut self, alone: &Image, fused: &Image) {
        self.belief.remember(alone, fused);
    }

    /// Adds a frame. A frame of another side starts anew.
    ///
    /// # Errors
    /// The errors of [`regularised`] for a frame without a past.
    pub fn add(&mut self, frame: &Measurements) -> Result<RecursiveFrame, ReconstructError> {
        let past = self.past.take().filter(|past| past.side == frame.side());
        let made = match past.and_then(|past| self.next(past, frame)) {
            Some(made) => made,
            None => self.start(frame)?,
        };
        self.begun = true;
        Ok(made)
    }

    /// The first frame of a scene.
    fn start(&mut self, frame: &Measurements) -> Result<RecursiveFrame, ReconstructError> {
        let RecursiveSettings { noise, strength, .. } = self.settings;
        let base = RegularisedSettings::new(Penalty::Tikhonov);
        let found = regularised(frame, &RegularisedSettings { noise, strength, ..base })?;
        let noise = of_camera(noise, frame);
        let problem = Problem::of(frame, Basis::Dct, Some(FALLOFF), noise);
        let scale = (1.0 / problem.unit) as f32;
        let mut mean: Vec<f32> = found.image.pixels().iter().map(|v| v * scale).collect();
        walsh(problem.side, &mut mean);
        let noise = match noise {
            NoiseLevel::Known(_) => problem.prior.noise,
            NoiseLevel::Estimated => noise::of_frame(&problem),
        };
        let mut known = Known::nothing(problem.side);
        known.add(&problem, noise.max(LEAST_NOISE));
        self.past = Some(Past {
            side: problem.side,
            unit: problem.unit,
            spectrum: Spectrum::new(problem.side),
            mean,
            poses: VecDeque::from([Pose { since: Shift::default(), known }]),
            shift: Shift::default(),
            noises: VecDeque::from([noise]),
            noise_is_known: false,
        });
        Ok(RecursiveFrame {
            image: found.image,
            first: !self.begun,
            warm: false,
            shift_px: [0.0; 2],
            speed_px: 0.0,
            fused: frame.clone(),
            certain: frame.clone(),
            residual: found.residual,
            reading_weight: found.reading_weight,
            noise: found.noise,
            strength: found.strength,
        })
    }

    /// A frame of the scene of the frames before; `None` if there is a cut.
    fn next(&mut self, mut past: Past, frame: &Measurements) -> Option<RecursiveFrame> {
        let given = of_camera(self.settings.noise, frame);
        let mut problem = past.problem_of(frame, given);
        let stay = |past: &Past, noise: f32| Guess {
            shift: Shift::default(),
            mean: past.mean.clone(),
            information: past.information(noise),
        };
        let before = median(&past.noises);
        let mut moved = None;
        if self.settings.follow {
            let view = View::new(&past, &problem, before, self.settings.speed_px);
            let readings = view.weighted(&stay(&past, before));
            let shift = best_shift(&past.spectrum, &past.mean, &readings, past.shift);
            if shift != Shift::default() {
                moved = Some((shift, past.spectrum.shift(shift).apply(&past.mean)));
            }
        }
        // The noise comes first: what the past misses beyond it is change of the scene.
        let expected: Vec<&[f32]> = moved.iter().map(|(_, mean)| mean.as_slice()).collect();
        let noise = past.noise(&problem, &expected, given);
        problem.prior.noise = noise;
        let view = View::new(&past, &problem, noise, self.settings.speed_px);
        let mut guess = stay(&past, noise);
        let mut best = view.likeliest(&guess);
        // Two more parameters must gain what the Bayesian information criterion asks for, and the
        // best of many shifts more than that. A cut, which cannot be undone, must gain as much.
        let cost = (problem.rows.len() as f32 * SHIFTS).ln();
        if let Some((shift, _)) = moved {
            let moved = guess.moved(&past.spectrum, shift);
            let with = view.likeliest(&moved);
            if with.gain > best.gain + cost {
                (best, guess) = (with, moved);
            }
        }
        if self.settings.speed_px.is_none() && view.without_a_past() > best.gain + cost {
            return None;
        }
        let kept = view.kept(best.speed_px);
        let surprise = view.surprise(&past, &guess, &kept);
        let prior = view.prior;
        for Pose { known, .. } in &mut past.poses {
            known.age(&kept, &prior);
            if self.settings.speed_px.is_none() {
                known.doubt(&surprise, noise);
            }
        }
        past.move_by(guess.shift);
        past.poses[0].known.add(&problem, noise);
        let strength = match self.settings.strength {
            Strength::Fixed(strength) => strength,
            Strength::CrossValidated { .. } => 1.0,
        };
        Some(self.finish(past, &problem, &prior, strength, best.speed_px))
    }

    /// The image of the fused rows, and the new past.
    fn finish(
        &mut self,
        mut past: Past,
        problem: &Problem<'_>,
        prior: &[f32],
        strength: f64,
        speed_px: f32,
    ) -> RecursiveFrame {
        let noise = problem.prior.noise;
        let joint = Joint::new(&past, noise);
        let weigh = |rows: &mut Vec<f32>| *rows = joint.weigh(rows);
        let mut made =
            tikhonov::solve(problem, joint.right(), weigh, &[strength as f32], ITERATIONS)
                .remove(0);
        // What the next frame is compared with has no less detail than the readings show.
        let share = past.share_of_last(noise, Some(prior));
        past.mean = past.with_readings(made.clone(), &share);
        let [fused, certain] = past.fused(noise, prior);
        // Readings at several positions are weighted by the prior alone.
        let reading_weight = match past.poses.len() {
            1 => past.weigh(prior, noise, &mut made),
            _ => {
                made.clone_from(&past.mean);
                1.0
            }
        };
        let residual = problem.residual_of(&made);
        walsh(past.side, &mut made);
        let unit = past.unit;
        let pixels = made.iter().map(|v| (f64::from(*v) * unit) as f32).collect();
        let (side, shift_px) = (past.side, past.shift.pixels());
        self.past = Some(past);
        RecursiveFrame {
            image: Image::new(side, pixels),
            first: false,
            warm: true,
            shift_px,
            speed_px: speed_px.into(),
            fused,
            certain,
            residual,
            reading_weight,
            noise: f64::from(noise) * unit * side.pixels() as f64,
            strength,
        }
    }
}

/// The noise that was asked for, or else what the camera says of the frame's.
fn of_camera(asked: NoiseLevel, frame: &Measurements) -> NoiseLevel {
    match (asked, frame.noise()) {
        (NoiseLevel::Estimated, Some(noise)) => NoiseLevel::Known(noise),
        _ => asked,
    }
}

/// Power of the frequency with which amplitudes fall.
const FALLOFF: f64 = 1.0;

/// The most iterations of a frame.
const ITERATIONS: usize = 200;

/// Orthonormal Walsh-Hadamard transform: its own inverse.
fn walsh(side: Side, grid: &mut [f32]) {
    fwht::transform(grid);
    let n = side.pixels() as f32;
    grid.iter_mut().for_each(|v| *v /= n);
}

#[cfg(test)]
mod tests;

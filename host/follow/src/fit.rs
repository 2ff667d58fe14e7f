//! The scene and its motion that explain the readings of all frames best.
//!
//! For a given motion the scene solves linear equations (least squares, with amplitudes that fall as one over frequency), by
//! conjugate gradients. What it leaves unexplained says how the motion has to change (Gauss and Newton), and so on in turns.

use crate::canvas::{Canvas, Way};
use num_complex::Complex32;
use std::f64::consts::TAU;

/// Turns of scene and motion, at most.
const TURNS: usize = 5;
/// Steps of the conjugate gradients in each turn, and in the last.
const STEPS: usize = 6;
const LAST_STEPS: usize = 12;
/// Part of the equations' right side that is left at the end.
const LEFT: f64 = 1e-6;
/// A change of the motion that ends the turns, in pixels over all frames.
const SETTLED_PX: f64 = 0.02;
/// The most that a turn changes the motion, in pixels a frame.
const MOST_PX: f64 = 0.3;
/// A mean of squares is more than noise if it exceeds what noise gives by this many standard deviations, ...
const SURE: f64 = 3.5;
/// ... and by this share, because the noise itself is an estimate.
const NOISE_KNOWN_TO: f64 = 0.03;
/// Power of a scene's frequency `f`, in cycles a pixel, for a scene of variance 1: this over `(CANVAS f)^2`. The
/// sum over all frequencies of a canvas of 64 x 64 pixels is its variance.
const POWER: f64 = 170.0;
/// Side of that canvas.
const CANVAS: f64 = 64.0;

/// Readings of some frames that were added.
pub(crate) struct Group {
    /// Middle of its light, in frames after the middle of all.
    pub time: f64,
    /// As many as the canvas [reads](Canvas::readings), divided by the side.
    pub readings: Vec<f32>,
}

/// What is known before.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Known {
    /// Variance of a group's reading, of light and amplifier alone.
    pub noise: f64,
    /// Variance of the image's pixels.
    pub variance: f64,
    /// Frames in a group.
    pub frames: f64,
}

/// A scene, where it stands in the middle of the frames, and its motion.
pub(crate) struct Fitted {
    pub spectrum: Vec<Complex32>,
    pub velocity_px: [f64; 2],
    /// Mean square of what it leaves of a reading.
    pub left: f64,
    /// What it leaves of the newest groups' readings, [beyond noise](beyond_noise).
    pub beyond_newest: f64,
}

/// The scene for a motion, its smear, and the groups' ways.
struct Scene {
    velocity_px: [f64; 2],
    smear: Vec<f32>,
    ways: Vec<Way>,
}

/// The equations of the scene.
pub(crate) struct Fit<'a> {
    canvas: &'a Canvas,
    groups: &'a [Group],
    known: Known,
    /// What the prior adds for each frequency.
    prior: Vec<f32>,
}

impl<'a> Fit<'a> {
    pub fn new(canvas: &'a Canvas, groups: &'a [Group], known: Known) -> Self {
        let strength = known.noise / (POWER * known.variance.max(f64::MIN_POSITIVE));
        let prior = canvas.each_frequency().map(|[down, right]| {
            let squared = (CANVAS * CANVAS) * (down * down + right * right);
            (strength * squared.max(0.25)) as f32
        });
        let prior = prior.collect();
        Self { canvas, groups, known, prior }
    }

    /// Scene and motion, from a first guess of the motion.
    pub fn from(&self, velocity_px: [f64; 2]) -> Fitted {
        let span = self.groups.iter().map(|group| group.time.abs()).fold(1.0, f64::max);
        let mut scene = self.scene(velocity_px);
        let mut spectrum = vec![Complex32::ZERO; self.canvas.len()];
        for _ in 0..TURNS {
            self.solve(&scene, STEPS, &mut spectrum);
            let Some(change) = self.change(&scene, &spectrum) else { break };
            let changed = change.map(|by| by.clamp(-MOST_PX, MOST_PX));
            let velocity = [scene.velocity_px[0] + changed[0], scene.velocity_px[1] + changed[1]];
            scene = self.scene(velocity);
            if change.iter().all(|by| by.abs() * span < SETTLED_PX) {
                break;
            }
        }
        self.solve(&scene, LAST_STEPS, &mut spectrum);
        let readings = (self.groups.len() * self.canvas.readings()) as f64;
        let of_groups = self.left(&scene, &spectrum);
        let left = of_groups.iter().flatten().map(|v| f64::from(*v).powi(2)).sum::<f64>();
        let newest = of_groups.iter().rev().map(|left| left.iter().copied().map(f64::from));
        let beyond_newest = beyond_noise(newest.take(of_groups.len() / 2), self.known.noise);
        Fitted { spectrum, velocity_px: scene.velocity_px, left: left / readings, beyond_newest }
    }

    fn scene(&self, velocity_px: [f64; 2]) -> Scene {
        let ways =
            self.groups.iter().map(|group| self.canvas.way(velocity_px, group.time)).collect();
        Scene { velocity_px, smear: self.canvas.smear(velocity_px, self.known.frames), ways }
    }

    /// Conjugate gradients from `spectrum` on.
    fn solve(&self, scene: &Scene, steps: usize, spectrum: &mut [Complex32]) {
        let readings = self.groups.iter().map(|group| group.readings.as_slice());
        let right = self.back(scene, readings);
        let mut left = self.equations(scene, spectrum);
        left.iter_mut().zip(&right).for_each(|(left, right)| *left = right - *left);
        let enough = LEFT * power(&right);
        let mut direction = left.clone();
        let mut size = power(&left);
        for _ in 0..steps {
            if size <= enough {
                break;
            }
            let turned = self.equations(scene, &direction);
            let along: f64 = direction
                .iter()
                .zip(&turned)
                .map(|(a, b)| f64::from(a.re * b.re + a.im * b.im))
                .sum();
            let step = (size / along) as f32;
            spectrum.iter_mut().zip(&direction).for_each(|(value, by)| *value += by * step);
            left.iter_mut().zip(&turned).for_each(|(value, by)| *value -= by * step);
            let next = power(&left);
            let keep = (next / size) as f32;
            direction.iter_mut().zip(&left).for_each(|(value, left)| *value = left + *value * keep);
            size = next;
        }
    }

    /// The equations' left side: what all frames say of what they read of a scene, and the prior.
    fn equations(&self, scene: &Scene, spectrum: &[Complex32]) -> Vec<Complex32> {
        let smeared = scene.smeared(spectrum);
        let readings: Vec<Vec<f32>> =
            scene.ways.iter().map(|way| self.canvas.frame(&smeared, way)).collect();
        let mut sum = self.back(scene, readings.iter().map(Vec::as_slice));
        let priors = self.prior.iter().zip(spectrum);
        sum.iter_mut().zip(priors).for_each(|(sum, (prior, value))| *sum += value * *prior);
        sum
    }

    fn back<'b>(&self, scene: &Scene, readings: impl Iterator<Item = &'b [f32]>) -> Vec<Complex32> {
        let mut sum = vec![Complex32::ZERO; self.canvas.len()];
        for (way, readings) in scene.ways.iter().zip(readings) {
            self.canvas.add_back(readings, way, &mut sum);
        }
        scene.smeared(&sum)
    }

    /// What the scene leaves of each group's readings.
    fn left(&self, scene: &Scene, spectrum: &[Complex32]) -> Vec<Vec<f32>> {
        let smeared = scene.smeared(spectrum);
        let of_group = |(group, way): (&Group, &Way)| {
            let found = self.canvas.frame(&smeared, way);
            group.readings.iter().zip(found).map(|(read, found)| read - found).collect()
        };
        self.groups.iter().zip(&scene.ways).map(of_group).collect()
    }

    /// The change of the motion that explains most of what is left; `None` for a scene that shows no motion.
    fn change(&self, scene: &Scene, spectrum: &[Complex32]) -> Option<[f64; 2]> {
        let smeared = scene.smeared(spectrum);
        let slope = |axis: usize| -> Vec<Complex32> {
            let by = |(value, frequency): (&Complex32, [f64; 2])| {
                value * Complex32::new(0.0, (-TAU * frequency[axis]) as f32)
            };
            smeared.iter().zip(self.canvas.each_frequency()).map(by).collect()
        };
        let slopes = [slope(0), slope(1)];
        let (mut normal, mut side) = ([[0.0_f64; 2]; 2], [0.0_f64; 2]);
        for ((group, way), left) in
            self.groups.iter().zip(&scene.ways).zip(self.left(scene, spectrum))
        {
            let by = slopes.each_ref().map(|slope| self.canvas.frame(slope, way));
            let product =
                |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| f64::from(a * b)).sum::<f64>();
            for axis in 0..2 {
                side[axis] += group.time * product(&by[axis], &left);
                for other in 0..2 {
                    normal[axis][other] += group.time.powi(2) * product(&by[axis], &by[other]);
                }
            }
        }
        let [[a, b], [c, d]] = normal;
        let determinant = a * d - b * c;
        if determinant <= 1e-9 * (a * d).abs() {
            return None;
        }
        Some([(d * side[0] - b * side[1]) / determinant, (a * side[1] - c * side[0]) / determinant])
    }
}

/// What the newest frames show beside the fit and noise, as the mean square of a reading. `left` is what the fit leaves of each
/// frame, the newest first. The mean of the newest frame, of the newest two, four and so on is looked at, and the largest
/// excess over noise counts; an excess that noise can make counts as 0.
///
/// A mean over all frames does not show that a target has just changed its way, because most frames are from before that.
pub(crate) fn beyond_noise<I>(left: impl Iterator<Item = I>, noise: f64) -> f64
where
    I: Iterator<Item = f64>,
{
    let mut sum: Vec<f64> = Vec::new();
    let mut most = 0.0_f64;
    for (count, left) in (1_u32..).zip(left) {
        if count == 1 {
            sum = left.collect();
        } else {
            sum.iter_mut().zip(left).for_each(|(sum, left)| *sum += left);
        }
        if !count.is_power_of_two() || sum.is_empty() {
            continue;
        }
        let readings = sum.len() as f64;
        let (count, expected) = (f64::from(count), noise / f64::from(count));
        let square = sum.iter().map(|sum| (sum / count).powi(2)).sum::<f64>() / readings;
        if square > most_by_noise(expected, readings) {
            most = most.max(square - expected);
        }
    }
    most
}

/// The largest mean of `readings` squares that noise alone makes, if it makes `expected` of them on average.
pub(crate) fn most_by_noise(expected: f64, readings: f64) -> f64 {
    expected * (1.0 + SURE * (2.0 / readings).sqrt() + NOISE_KNOWN_TO)
}

impl Scene {
    fn smeared(&self, spectrum: &[Complex32]) -> Vec<Complex32> {
        spectrum.iter().zip(&self.smear).map(|(value, factor)| value * *factor).collect()
    }
}

fn power(spectrum: &[Complex32]) -> f64 {
    spectrum.iter().map(|value| f64::from(value.norm_sqr())).sum()
}

//! The first guess of a motion: where the frames' coarse shapes agree best.
//!
//! For a scene that moves by `v` pixels a frame, the frames' Fourier transforms, each turned back by its time, add up in
//! phase. The sum of squares of these sums is largest at the likeliest motion, if the frames have noise of
//! their own. The frames fade out towards their edges, over which the target comes and goes.

use num_complex::Complex64;
use std::f64::consts::{PI, TAU};

/// Highest frequencies, in periods a side: for the first steps, and for the last.
const COARSE: i32 = 3;
const FINE: i32 = 6;

/// Motion that a step changes over all frames, in pixels.
const STEP_PX: f64 = 2.0;

/// The coarse shapes of some frames.
pub(crate) struct Shapes {
    /// Of each frame its time, and its Fourier coefficients.
    frames: Vec<(f64, Vec<Complex64>)>,
    /// Frequencies down and to the right, in cycles a pixel, with the higher of the two in periods a side.
    frequencies: Vec<([f64; 2], i32)>,
}

impl Shapes {
    /// The shapes of square images at these times.
    pub fn of(images: &[(f64, Vec<f32>)], side: usize) -> Self {
        let number = |k: i32| f64::from(k) / side as f64;
        // Of each pair of opposite frequencies one is enough.
        let frequencies: Vec<([f64; 2], i32)> = (-FINE..=FINE)
            .flat_map(|down| (0..=FINE).map(move |right| (down, right)))
            .filter(|&(down, right)| right > 0 || down > 0)
            .map(|(down, right)| ([number(down), number(right)], down.abs().max(right)))
            .collect();
        let fade: Vec<f64> =
            (0..side).map(|at| (PI * (at as f64 + 0.5) / side as f64).sin()).collect();
        let wave = |f: f64, at: usize| Complex64::cis(-TAU * f * at as f64);
        let of_one = |image: &[f32]| {
            // First to the right, then down.
            let to_the_right: Vec<Vec<Complex64>> = (0..=FINE)
                .map(|k| {
                    let waves: Vec<Complex64> =
                        (0..side).map(|at| wave(number(k), at) * fade[at]).collect();
                    let line = |line: &[f32]| {
                        line.iter().zip(&waves).map(|(v, w)| w * f64::from(*v)).sum()
                    };
                    image.chunks_exact(side).map(line).collect()
                })
                .collect();
            let both = |&([down, right], _): &([f64; 2], i32)| {
                let lines = &to_the_right[(right * side as f64).round() as usize];
                lines.iter().enumerate().map(|(at, v)| v * wave(down, at) * fade[at]).sum()
            };
            frequencies.iter().map(both).collect()
        };
        let frames = images.iter().map(|(time, image)| (*time, of_one(image))).collect();
        Self { frames, frequencies }
    }

    /// How well a motion explains the frames.
    fn score(&self, velocity_px: [f64; 2], highest: i32) -> f64 {
        let used = self.frequencies.iter().enumerate().filter(|(_, (_, k))| *k <= highest);
        used.map(|(at, ([down, right], _))| {
            let cycles = down * velocity_px[0] + right * velocity_px[1];
            let turned = |(time, frame): &(f64, Vec<Complex64>)| {
                frame[at] * Complex64::cis(TAU * cycles * time)
            };
            self.frames.iter().map(turned).sum::<Complex64>().norm_sqr()
        })
        .sum()
    }

    /// The likeliest motion of at most `reach_px` pixels a frame, in each direction.
    pub fn motion(&self, reach_px: f64) -> [f64; 2] {
        let times = self.frames.iter().map(|frame| frame.0);
        let span = times.clone().fold(0.0, f64::max) - times.fold(0.0, f64::min);
        let mut step = STEP_PX / span.max(1.0);
        let count = (reach_px / step).ceil() as i32;
        let grid = || (-count..=count).map(|k| f64::from(k) * step);
        let all = grid().flat_map(|down| grid().map(move |right| [down, right]));
        let mut best = self.best(all, COARSE);
        while step * span > 0.1 {
            step /= 2.0;
            let near = [-step, 0.0, step];
            let around = near.iter().flat_map(|down| near.iter().map(move |right| [*down, *right]));
            best = self.best(around.map(|by| [best[0] + by[0], best[1] + by[1]]), FINE);
        }
        best
    }

    fn best(&self, motions: impl Iterator<Item = [f64; 2]>, highest: i32) -> [f64; 2] {
        let scored = motions.map(|motion| (self.score(motion, highest), motion));
        scored.max_by(|a, b| a.0.total_cmp(&b.0)).map_or([0.0; 2], |best| best.1)
    }
}

//! Coverage: the share of the pixels whose truth lies within its interval.

use super::AREA;
use crate::bootstrap::{DRAWS, Interval, Redraws};
use crate::error::{EvalError, Result};
use crate::quality::{Characters, Condition};
use nirspi_nets::Enhanced;
use nirspi_nets::interval::{Intervals, LEVEL, LEVELS, Seen, share_of_prior};
use serde::Serialize;

/// The coverage of one stack under one condition.
#[derive(Debug, Clone, Serialize)]
pub struct Covered {
    /// The degradation.
    #[serde(flatten)]
    pub condition: Condition,
    /// The stack.
    pub stack: String,
    /// Number of images.
    pub images: usize,
    /// The nominal levels.
    pub levels: [f64; LEVELS.len()],
    /// Share of the pixels within the interval of each level.
    pub seen: [f64; LEVELS.len()],
    /// The share at 95 %. Its interval draws font families, writers and photographs again.
    pub at_95: Interval,
    /// Share of the images of which fewer than 85 % of the pixels are within the interval of 95 %.
    pub images_below_85: f64,
    /// Mean half-width at 95 %; white is 1.
    pub half_width: f64,
    /// Share of the pixels that are the prior's and not the data's.
    pub prior_share: f64,
    /// Root mean square of the error.
    pub rms_error: f64,
}

/// One image's numbers.
struct One {
    seen: [f64; LEVELS.len()],
    half_width: f64,
    prior_share: f64,
    mean_square: f64,
}

/// The coverage of each stack.
pub(super) fn covered(
    intervals: &Intervals,
    images: &Characters,
    made: &Enhanced,
    condition: Condition,
) -> Result<Vec<Covered>> {
    let seen = made.seen().ok_or_else(|| {
        EvalError::Content("images that were not enhanced from 32 x 32 pixels".to_owned())
    })?;
    let each: Vec<One> =
        images.iter().zip(seen).map(|(i, s)| one(intervals, &s, &i.sharp)).collect();
    let of_stack = |(at, origin): (usize, &crate::quality::Origin)| {
        let taken = images.iter().zip(&each).filter(|(image, _)| image.stack == at);
        let (groups, ones): (Vec<(usize, u32)>, Vec<&One>) =
            taken.map(|(image, one)| ((at, image.group), one)).unzip();
        let mean = |of: &dyn Fn(&One) -> f64| {
            ones.iter().map(|one| of(one)).sum::<f64>() / ones.len().max(1) as f64
        };
        let at_95: Vec<f64> = ones.iter().map(|one| one.seen[LEVEL]).collect();
        Covered {
            condition,
            stack: origin.stack.clone(),
            images: ones.len(),
            levels: LEVELS,
            seen: std::array::from_fn(|level| mean(&|one| one.seen[level])),
            at_95: Redraws::clustered(&groups, DRAWS).of_mean(&at_95),
            images_below_85: mean(&|one| f64::from(u8::from(one.seen[LEVEL] < 0.85))),
            half_width: mean(&|one| one.half_width),
            prior_share: mean(&|one| one.prior_share),
            rms_error: mean(&|one| one.mean_square).sqrt(),
        }
    };
    Ok(images.origins().iter().enumerate().map(of_stack).collect())
}

fn one(intervals: &Intervals, seen: &Seen<'_>, truth: &[f32]) -> One {
    let errors: Vec<f32> = seen.image.iter().zip(truth).map(|(a, b)| (a - b).abs()).collect();
    let mean = |sum: f64| sum / AREA as f64;
    let within = |widths: &[f32]| {
        mean(errors.iter().zip(widths).filter(|(error, width)| error <= width).count() as f64)
    };
    let widths = intervals.half_widths(seen);
    One {
        seen: std::array::from_fn(|level| {
            within(&intervals.calibration().pixels.half_widths(seen, level))
        }),
        half_width: mean(widths.iter().map(|&width| f64::from(width)).sum()),
        prior_share: share_of_prior(&widths).into(),
        mean_square: mean(errors.iter().map(|&error| f64::from(error).powi(2)).sum()),
    }
}

//! Coverage: the share of the pixels whose truth lies within its interval.

use super::AREA;
use super::shots::{At, LOW_CONTRAST, Shot, Studio};
use crate::bootstrap::{DRAWS, Interval, Redraws};
use crate::error::Result;
use crate::quality::Characters;
use nirspi_nets::interval::{Intervals, LEVEL, LEVELS, edges, share_of_prior};
use serde::Serialize;

/// The coverage of some shots.
#[derive(Debug, Clone, Serialize)]
pub struct Covered {
    /// The method of reconstruction.
    pub method: String,
    /// The images: `natural` or `characters`.
    pub images_of: &'static str,
    /// What the shots have in common: `contrast 35 %`, `patterns 25 %`, or `all`.
    pub condition: String,
    /// Number of images.
    pub images: usize,
    /// The nominal levels.
    pub levels: [f64; LEVELS.len()],
    /// Share of the pixels within the interval of each level.
    pub seen: [f64; LEVELS.len()],
    /// The share at 95 %. Its interval draws scenes, font families, writers and photographs again.
    pub at_95: Interval,
    /// The same for the fifth of the pixels with the largest steps in the truth.
    pub edges_at_95: f64,
    /// Share of the images of which fewer than 85 % of the pixels are within the interval of 95 %.
    pub images_below_85: f64,
    /// Mean half-width at 95 %; white is 1.
    pub half_width: f64,
    /// Least half-width at 95 %.
    pub least_half_width: f64,
    /// Share of the pixels that are the prior's and not the data's.
    pub prior_share: f64,
    /// Root mean square of the error.
    pub rms_error: f64,
}

/// One image's numbers.
pub(super) struct One {
    group: (usize, u32),
    natural: bool,
    method: usize,
    conditions: Vec<String>,
    seen: [f64; LEVELS.len()],
    at_edges: f64,
    half_width: f64,
    least: f64,
    prior_share: f64,
    mean_square: f64,
}

/// The numbers of each shot.
pub(super) fn each(
    intervals: &Intervals,
    studio: &Studio,
    images: &Characters,
    shots: &[(At, Shot)],
) -> Result<Vec<One>> {
    let characters: Vec<_> = images.iter().collect();
    let mut all = Vec::with_capacity(shots.len());
    for ((stack, number), shot) in shots {
        let Some(seen) = shot.seen() else { continue };
        let readings = shot.readings(studio);
        let table = intervals.table(&readings)?;
        let widths: Vec<[f32; LEVELS.len()]> =
            table.at_levels(&seen, &readings, std::array::from_fn(|level| level));
        let errors: Vec<f32> =
            seen.image.iter().zip(&shot.truth).map(|(a, b)| (a - b).abs()).collect();
        let within = |level: usize| {
            let each = errors.iter().zip(&widths);
            each.filter(|(error, widths)| **error <= widths[level]).count() as f64 / AREA as f64
        };
        let seen_levels: [f64; LEVELS.len()] = std::array::from_fn(within);
        let widths: Vec<f32> = widths.iter().map(|widths| widths[LEVEL]).collect();
        let edge = edges(&shot.truth);
        let held = errors.iter().zip(&widths).zip(&edge).filter(|((e, w), edge)| **edge && e <= w);
        let (held, of) = (held.count() as f64, edge.iter().filter(|edge| **edge).count());
        let condition = shot.condition;
        let contrast = match condition.contrast {
            1.0 => Some("contrast 100 %".to_owned()),
            LOW_CONTRAST => Some(format!("contrast {:.0} %", 100.0 * LOW_CONTRAST)),
            _ => None,
        };
        let patterns = match condition.share {
            share if share < 0.18 => "patterns 10 to 18 %",
            share if share < 0.37 => "patterns 18 to 37 %",
            share if share < 0.75 => "patterns 37 to 75 %",
            _ => "patterns 75 to 100 %",
        };
        let noise = match condition.noise {
            noise if noise <= 0.015 => "noise to 1.5 %",
            noise if noise <= 0.05 => "noise 1.5 to 5 %",
            _ => "noise 5 to 20 %",
        };
        let mut conditions = vec!["all".to_owned(), patterns.to_owned(), noise.to_owned()];
        conditions.extend(contrast);
        if condition.distance_mm == 300.0 && (0.4..0.6).contains(&condition.share) {
            conditions.push("0.3 m, half of the patterns".to_owned());
        }
        all.push(One {
            group: (*stack, characters[*number].group),
            natural: images.origins()[*stack].stack == super::NATURAL,
            method: shot.method,
            conditions,
            seen: seen_levels,
            at_edges: if of > 0 { held / of as f64 } else { 1.0 },
            half_width: widths.iter().map(|&w| f64::from(w)).sum::<f64>() / AREA as f64,
            least: widths.iter().copied().fold(f32::INFINITY, f32::min).into(),
            prior_share: share_of_prior(&widths).into(),
            mean_square: errors.iter().map(|&e| f64::from(e).powi(2)).sum::<f64>() / AREA as f64,
        });
    }
    Ok(all)
}

/// The coverage by method, kind of image and condition.
pub(super) fn covered(studio: &Studio, ones: &[One]) -> Vec<Covered> {
    let mut conditions: Vec<&str> =
        ones.iter().flat_map(|one| one.conditions.iter().map(String::as_str)).collect();
    conditions.sort_unstable();
    conditions.dedup();
    let mut all = Vec::new();
    for (number, method) in studio.methods.iter().enumerate() {
        for (natural, images_of) in [(true, super::NATURAL), (false, "characters")] {
            for condition in &conditions {
                let taken: Vec<&One> = ones
                    .iter()
                    .filter(|one| one.method == number && one.natural == natural)
                    .filter(|one| one.conditions.iter().any(|of| of == condition))
                    .collect();
                if !taken.is_empty() {
                    all.push(together(method.argument(), images_of, condition, &taken));
                }
            }
        }
    }
    all
}

fn together(method: &str, images_of: &'static str, condition: &str, ones: &[&One]) -> Covered {
    let mean = |of: &dyn Fn(&One) -> f64| {
        ones.iter().map(|one| of(one)).sum::<f64>() / ones.len().max(1) as f64
    };
    let groups: Vec<(usize, u32)> = ones.iter().map(|one| one.group).collect();
    let at_95: Vec<f64> = ones.iter().map(|one| one.seen[LEVEL]).collect();
    Covered {
        method: method.to_owned(),
        images_of,
        condition: condition.to_owned(),
        images: ones.len(),
        levels: LEVELS,
        seen: std::array::from_fn(|level| mean(&|one| one.seen[level])),
        at_95: Redraws::clustered(&groups, DRAWS).of_mean(&at_95),
        edges_at_95: mean(&|one| one.at_edges),
        images_below_85: mean(&|one| f64::from(u8::from(one.seen[LEVEL] < 0.85))),
        half_width: mean(&|one| one.half_width),
        least_half_width: ones.iter().map(|one| one.least).fold(f64::INFINITY, f64::min),
        prior_share: mean(&|one| one.prior_share),
        rms_error: mean(&|one| one.mean_square).sqrt(),
    }
}

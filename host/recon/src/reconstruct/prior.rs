//! Reconstruction with a learned prior: a [`Network`] completes the coefficients that were not
//! measured, and held-back measurements decide how far the network is believed.
//!
//! 1. [`Seen`] brings the measurements into units without gain and offset, and adds a start:
//!    Tikhonov's image at strength 1.
//! 2. The network gives every coefficient. This crate has no network of its own: `nirspi-nets` has
//!    the shipped one, and [`Network`] is the interface for others.
//! 3. A measured coefficient is the weighted mean of its reading and of what the network says without
//!    it, within [`WITHIN`](super::WITHIN) times the reading's noise. Without noise it is the reading.
//! 4. The network completes the measurements a second time without every other row of their finest
//!    quarter. The share of the way from the start to the network's image that predicts these rows
//!    best, plus one standard error, is the trust: 0 is the start, 1 the network's image.
//!
//! # Invariant
//! Whatever the network gives, a measured coefficient of the image differs from its measurement by
//! at most [`WITHIN`](super::WITHIN) times the noise (`tests::measured_values_stay_within_their_noise`), gain and
//! offset of the measurements are those of the image (`tests::gain_and_offset_go_through`), and
//! measurements with too few patterns or without contrast give Tikhonov's image and a line that says
//! so (`tests::what_the_network_cannot_complete_is_tikhonov_and_says_so`). A side that the network
//! does not complete is an error (`tests::a_side_that_the_network_does_not_take_is_an_error`).

mod kind;
mod seen;

pub(super) use kind::network_kind;
pub use seen::Seen;

use super::selection::Line;
use super::{
    Penalty, ReconstructError, Reconstruction, RegularisedSettings, Report, noise, regularised,
    selection,
};
use crate::{Image, Measurements, Side, fwht, order, words};
use std::fmt;
use std::sync::Arc;

/// The fewest patterns that a network completes: the estimates of noise and trust need some.
pub const LEAST_PATTERNS: usize = 40;

/// The least share of the patterns that a network completes. Training has 5 % and more.
pub const LEAST_SHARE: f64 = 0.03;

/// Number of parts of the measurements, each of which is held back once.
const FOLDS: usize = 4;

/// Trust below this is none: the image would differ from the start by less than the start's error.
const LEAST_TRUST: f32 = 0.05;

/// Completes measurements: the learned part of the method.
pub trait Network: Send + Sync {
    /// The network's name in reports.
    fn name(&self) -> &str;

    /// Whether the network completes images of this side.
    fn takes(&self, side: Side) -> bool;

    /// Every coefficient, by natural Hadamard row, in the units of [`Seen::values`].
    ///
    /// # Errors
    /// A sentence that says why there is no image.
    fn complete(&self, seen: &Seen) -> Result<Vec<f32>, String>;
}

/// A network that several methods share.
#[derive(Clone)]
pub struct SharedNetwork(Arc<dyn Network>);

impl SharedNetwork {
    /// Shares a network.
    pub fn new(network: impl Network + 'static) -> Self {
        Self(Arc::new(network))
    }

    /// The network.
    #[must_use]
    pub fn get(&self) -> &dyn Network {
        &*self.0
    }
}

impl fmt::Debug for SharedNetwork {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "SharedNetwork({})", self.0.name())
    }
}

impl PartialEq for SharedNetwork {
    /// Whether both are one network in memory.
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

/// Reconstructs an image with a network, as far as held-back measurements support the network.
/// Where the patterns are too few, show no contrast or do not support the network, the image is
/// Tikhonov's, and [`Report::note`] says why.
///
/// # Errors
/// [`ReconstructError::NetworkSide`] if the network does not complete images of this side, and
/// [`ReconstructError::Failed`] if the network gives no image.
pub fn with_network(
    measurements: &Measurements,
    network: &dyn Network,
    name: &str,
) -> Result<Reconstruction, ReconstructError> {
    let side = measurements.side();
    if !network.takes(side) {
        let network = network.name().to_owned();
        return Err(ReconstructError::NetworkSide { network, side: side.pixels() });
    }
    let seen = match completable(measurements) {
        Ok(seen) => seen,
        Err(why) => return classical(measurements, name, &why),
    };
    let complete = |seen: &Seen| network.complete(seen).map_err(ReconstructError::Failed);
    let trust = support(measurements, complete)?;
    if trust < LEAST_TRUST {
        let why = "held-back measurements do not support the network";
        return classical(measurements, name, why);
    }
    let mut grid = complete(&seen)?;
    believe(&seen, trust, &mut grid);
    let held_back = without_each(measurements, &seen, trust, &complete)?;
    for (&row, &predicted) in measurements.rows().iter().zip(&held_back) {
        grid[row as usize] = predicted;
    }
    let noise = noise::estimated_noise(measurements);
    let mut report = Report::new(name);
    report.held_back = seen.judge(measurements.rows(), &held_back);
    report.reading_weight = Some(seen.weigh(measurements.rows(), noise, &mut grid));
    report.trust = Some(f64::from(trust));
    report.noise = Some(noise);
    report.residual = Some(seen.residual(&grid));
    Ok(Reconstruction { image: image(&seen, grid), report })
}

/// The trust in the network's completion that held-back measurements support.
fn support(
    measurements: &Measurements,
    complete: impl Fn(&Seen) -> Result<Vec<f32>, ReconstructError>,
) -> Result<f32, ReconstructError> {
    Ok(match held_back(measurements) {
        None => 1.0,
        Some((kept, held)) => match Seen::new(&measurements.subset(kept)) {
            None => 0.0,
            Some(part) => trust(&part, &complete(&part)?, measurements, &held),
        },
    })
}

/// Goes from the start to the completion as far as the completion is believed.
fn believe(seen: &Seen, trust: f32, completed: &mut [f32]) {
    for (value, start) in completed.iter_mut().zip(seen.start()) {
        *value = start + trust * (*value - start);
    }
}

/// What the network predicts for each measurement without it, in the units of `seen`.
fn without_each(
    measurements: &Measurements,
    seen: &Seen,
    trust: f32,
    complete: &impl Fn(&Seen) -> Result<Vec<f32>, ReconstructError>,
) -> Result<Vec<f32>, ReconstructError> {
    let rows = measurements.rows();
    let mut predicted: Vec<f32> = rows.iter().map(|&row| seen.values()[row as usize]).collect();
    for (kept, held) in selection::parts(rows, FOLDS) {
        let Some(part) = Seen::new(&measurements.subset(kept)) else { continue };
        let mut completed = complete(&part)?;
        believe(&part, trust, &mut completed);
        let factor = (part.unit() / seen.unit()) as f32;
        for k in held {
            predicted[k] = completed[rows[k] as usize] * factor;
        }
    }
    Ok(predicted)
}

/// What a network is given; or why there is no use for a network.
fn completable(measurements: &Measurements) -> Result<Seen, String> {
    let (area, count) = (measurements.side().area(), measurements.rows().len());
    let least = LEAST_PATTERNS.max((LEAST_SHARE * area as f64).ceil() as usize);
    if count < least {
        return Err(format!(
            "{} measured, expected at least {least} for the network",
            words::count_of(count, "pattern")
        ));
    }
    Seen::new(measurements).ok_or_else(|| "the measurements show no contrast".to_owned())
}

/// Tikhonov's image, with the reason for it.
fn classical(
    measurements: &Measurements,
    name: &str,
    why: &str,
) -> Result<Reconstruction, ReconstructError> {
    let found = regularised(measurements, &RegularisedSettings::new(Penalty::Tikhonov))?;
    let mut report = Report::new(name);
    report.reading_weight = Some(found.reading_weight);
    report.held_back = found.held_back;
    report.residual = Some(found.residual);
    report.noise = Some(found.noise);
    report.note = Some(format!("Tikhonov instead: {why}"));
    Ok(Reconstruction { image: found.image, report })
}

/// Positions that are kept, and positions that are held back: every other row of the finest quarter
/// of the measured rows. These rows are the nearest to the rows that were not measured, so a
/// network that invents detail is found out there. `None` if there are too few.
fn held_back(measurements: &Measurements) -> Option<(Vec<usize>, Vec<usize>)> {
    let positions = order::positions_by_sequency(measurements.rows());
    let fine = &positions[positions.len() - positions.len() / 4..];
    let held: Vec<usize> = fine.iter().skip(1).step_by(2).copied().collect();
    if held.len() < 2 {
        return None;
    }
    let mut is_held = vec![false; measurements.rows().len()];
    held.iter().for_each(|&k| is_held[k] = true);
    let kept = (0..is_held.len()).filter(|&k| !is_held[k]).collect();
    Some((kept, held))
}

/// The trust that the held-back measurements support, from `completed`, which was made without
/// them.
fn trust(part: &Seen, completed: &[f32], measurements: &Measurements, held: &[usize]) -> f32 {
    let mut line = Line::default();
    for &k in held {
        let row = measurements.rows()[k] as usize;
        let start = part.start()[row];
        let value = part.in_units(measurements.values()[k]);
        line.add(f64::from(completed[row] - start), f64::from(value - start));
    }
    line.most_trust(1.0) as f32
}

/// The image of normalised coefficients, in the measurements' units.
fn image(seen: &Seen, mut grid: Vec<f32>) -> Image {
    let side = seen.side();
    grid[0] = 0.0;
    fwht::transform(&mut grid);
    let unit = seen.unit() / side.pixels() as f64;
    let pixels = grid.iter().map(|&v| (f64::from(v) * unit + seen.mean()) as f32).collect();
    Image::new(side, pixels)
}

#[cfg(test)]
mod same_images;
#[cfg(test)]
mod tests;

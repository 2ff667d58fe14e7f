//! Measurements: one number for each Hadamard row, corrected for the instrument.
//!
//! # Invariant
//! A [`Measurements`] has one finite value for each of its [`Rows`], whatever it was built from
//! (`tests::each_fault_is_named`).

mod binned;
mod shorter_sweep;

pub use shorter_sweep::ShorterSweep;

use crate::{Order, Rows, RowsError, Side, order};
use thiserror::Error;

/// Signed measurements `value[k] = sum over pixels of H[row[k], p] * x[p]`, in the order of
/// measurement. Values are finite. Rows that were not measured, or were left out, are absent. The
/// noise of a value is known if the camera measured it.
#[derive(Debug, Clone, PartialEq)]
pub struct Measurements {
    rows: Rows,
    values: Vec<f64>,
    noise: Option<f64>,
    /// What the noise of a value is at most, if sums of patterns and complements say it.
    most_noise: Option<f64>,
    kind: Option<Kind>,
}

/// What many measurements of one kind say of each: an estimate, where the camera measured no noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Kind {
    /// Standard deviation of the noise of a value, in the values' units.
    pub noise: f64,
    /// Power of the frequency with which the scenes' amplitudes fall.
    pub falloff: f64,
}

/// What is wrong with a set of measurements. The caller adds the name of the file.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum MeasurementError {
    /// Two lists that belong together differ in length.
    #[error("{field} holds {found} values, expected {expected}")]
    Length {
        /// Name of the list.
        field: &'static str,
        /// Its length.
        found: usize,
        /// The length of the other lists.
        expected: usize,
    },
    /// Drop-outs and outliers left no measurement.
    #[error(
        "no measurement is left, expected at least one that no drop-out touches and that light can have given"
    )]
    Empty,
    /// A value is NaN or infinite.
    #[error("{field}[{index}] is {found}, expected a finite number")]
    NotFinite {
        /// Name of the list.
        field: &'static str,
        /// Index of the value.
        index: usize,
        /// The value.
        found: f64,
    },
    /// A share of the patterns is out of range.
    #[error("a sampling of {found}, expected more than 0 and at most 1")]
    Fraction {
        /// The share that was requested.
        found: f64,
    },
    /// The noise of a value is negative.
    #[error("a noise of {found}, expected a standard deviation of 0 or more")]
    Noise {
        /// The noise that was given.
        found: f64,
    },
    /// The rows, or the rows of an order, are wrong.
    #[error(transparent)]
    Rows(#[from] RowsError),
}

impl Measurements {
    /// Measurements from differences: `d[k]` is the reading of pattern `rows[k]` less the reading
    /// of its complement, or any signed measurement of that row. Fewer than `side^2` rows are a
    /// partial sampling.
    ///
    /// # Errors
    /// [`MeasurementError`] if there is not one value for each row, or a value is not finite.
    pub fn from_differential(rows: &Rows, d: &[f64]) -> Result<Self, MeasurementError> {
        expect_length("d", d.len(), rows.len())?;
        expect_finite("d", d)?;
        Ok(Self::trusted(rows.clone(), d.to_vec()))
    }

    /// Measurements from readings of the positive patterns alone (light where `H` is +1):
    /// `d[k] = 2 y[k] - S`, where `S` is the reading of the all-ones pattern, row 0.
    ///
    /// Without row 0 in `rows`, `S` is estimated as twice the mean reading, because the other rows
    /// of a scene average to nearly zero (exactly zero over all rows only if pixel 0 is dark). Row
    /// 0 itself then stays absent, so the image's mean is unknown. A dark level does not cancel
    /// against row 0: subtract it before, or [remove](Self::remove_dark_level) it afterwards.
    ///
    /// # Errors
    /// [`MeasurementError`] if there is not one reading for each row, or a reading is not finite.
    pub fn from_single(rows: &Rows, y: &[f64]) -> Result<Self, MeasurementError> {
        expect_length("y", y.len(), rows.len())?;
        expect_finite("y", y)?;
        let all_ones = match rows.iter().position(|&row| row == 0) {
            Some(k) => y[k],
            None => 2.0 * y.iter().sum::<f64>() / y.len() as f64,
        };
        let values: Vec<f64> = y.iter().map(|y| 2.0 * y - all_ones).collect();
        expect_finite("d", &values)?;
        Ok(Self::trusted(rows.clone(), values))
    }

    /// Removes the effect of a dark level in every reading (ambient light, an ADC's offset) from
    /// measurements [of patterns alone](Self::from_single), and returns the level. That effect is
    /// the same constant in each measurement, and would appear as one bright spot in the image's
    /// first pixel.
    ///
    /// The level is estimated as the mean of the middle half of the values over the half of the
    /// rows with the highest sequency, where a scene's own measurements scatter around zero. An
    /// estimate within four standard errors of zero is not removed and gives `None`.
    pub fn remove_dark_level(&mut self) -> Option<f64> {
        let fine = order::positions_by_sequency(&self.rows);
        let mut values: Vec<f64> =
            fine[fine.len() / 2..].iter().map(|&position| self.values[position]).collect();
        values.sort_unstable_by(f64::total_cmp);
        // A few large measurements of the scene must not count as a level, nor two groups of equal
        // measurements.
        let middle = &values[values.len() / 4..values.len() - values.len() / 4];
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
        let level = mean(middle);
        let spread: Vec<f64> = values.iter().map(|value| (value - level).powi(2)).collect();
        let error = (mean(&spread) / values.len().max(1) as f64).sqrt();
        if level.abs() <= 4.0 * error {
            return None;
        }
        self.values.iter_mut().for_each(|value| *value -= level);
        Some(level)
    }

    /// The part of these measurements that a shorter sweep would have taken: [`ShorterSweep::new`] says
    /// which.
    ///
    /// # Errors
    /// As [`ShorterSweep::new`].
    pub fn take(&self, order: Option<&Order>, fraction: f64) -> Result<Self, MeasurementError> {
        Ok(ShorterSweep::new(&self.rows, order, fraction)?.of(self))
    }

    /// Measurements that are known to be one finite value for each row.
    pub(crate) fn trusted(rows: Rows, values: Vec<f64>) -> Self {
        Self { rows, values, noise: None, most_noise: None, kind: None }
    }

    /// Replaces the value at a position by a finite one.
    pub(crate) fn replace(&mut self, position: usize, value: f64) {
        self.values[position] = value;
    }

    /// The measurements at these positions, in that order.
    pub(crate) fn subset(&self, positions: impl IntoIterator<Item = usize>) -> Self {
        let (rows, values) = positions.into_iter().map(|k| (self.rows[k], self.values[k])).unzip();
        Self { rows: Rows::trusted(self.side(), rows), values, ..*self }
    }

    /// These measurements with the standard deviation of the noise of one value, in the values'
    /// units: what the camera knows from repeated sweeps. The noise is the same for all values. Every
    /// method weights each reading by it; without it the methods estimate the noise
    /// ([`estimated_noise`](crate::reconstruct::estimated_noise)).
    ///
    /// # Errors
    /// [`MeasurementError::NotFinite`] for NaN or infinity; [`MeasurementError::Noise`] below 0.
    pub fn with_noise(mut self, noise: f64) -> Result<Self, MeasurementError> {
        expect_finite("noise", &[noise])?;
        if noise < 0.0 {
            return Err(MeasurementError::Noise { found: noise });
        }
        self.noise = Some(noise);
        Ok(self)
    }

    /// The same measurements with this noise, which is known to be finite and not negative.
    pub(crate) fn of_noise(self, noise: f64) -> Self {
        Self { noise: Some(noise), ..self }
    }

    /// The same measurements, whose noise is at most this standard deviation by what else was seen of
    /// their readings. It bounds the noise that is estimated where none was
    /// [measured](Self::with_noise).
    #[must_use]
    pub fn with_most_noise(self, most_noise: Option<f64>) -> Self {
        Self { most_noise, ..self }
    }

    /// What the noise of a value is at most, by the sums of patterns and complements.
    #[must_use]
    pub fn most_noise(&self) -> Option<f64> {
        self.most_noise
    }

    /// The same measurements, of a kind of which this is known.
    #[must_use]
    pub(crate) fn of_kind(self, kind: Kind) -> Self {
        Self { kind: Some(kind), ..self }
    }

    pub(crate) fn kind(&self) -> Option<Kind> {
        self.kind
    }

    /// Standard deviation of the noise of one value, in the values' units, if it was
    /// [measured](Self::with_noise).
    #[must_use]
    pub fn noise(&self) -> Option<f64> {
        self.noise
    }

    /// Side of the image that was measured.
    #[must_use]
    pub fn side(&self) -> Side {
        self.rows.side()
    }

    /// The values alone, one for each row.
    #[must_use]
    pub fn into_values(self) -> Vec<f64> {
        self.values
    }

    /// Hadamard rows in the order of measurement.
    #[must_use]
    pub fn rows(&self) -> &Rows {
        &self.rows
    }

    /// Signed measurements, one for each of [`rows`](Self::rows).
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values
    }
}

pub(crate) fn expect_length(
    field: &'static str,
    found: usize,
    expected: usize,
) -> Result<(), MeasurementError> {
    if found == expected {
        Ok(())
    } else {
        Err(MeasurementError::Length { field, found, expected })
    }
}

pub(crate) fn expect_finite(field: &'static str, values: &[f64]) -> Result<(), MeasurementError> {
    // Without an early end, so that the compiler uses vectors.
    if values.iter().fold(true, |finite, value| finite & value.is_finite()) {
        return Ok(());
    }
    match values.iter().position(|v| !v.is_finite()) {
        Some(index) => Err(MeasurementError::NotFinite { field, index, found: values[index] }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests;

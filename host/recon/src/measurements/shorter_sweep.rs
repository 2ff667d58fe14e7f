//! The patterns that a shorter sweep would have shown.

use super::{MeasurementError, Measurements};
use crate::{Order, Rows};

/// Which of the measured patterns a shorter sweep would have shown. Measurements of the same rows
/// share one, so that an order is worked out once for all of them.
///
/// ```
/// use nirspi_recon::{Measurements, Order, Rows, ShorterSweep, Side};
///
/// let rows = Rows::natural(Side::INSTRUMENT);
/// let half = ShorterSweep::new(&rows, Some(&Order::ZigZag), 0.5)?;
/// assert_eq!(*half.rows(), Order::ZigZag.rows(Side::INSTRUMENT)?.first(512));
/// // Frames in which the reading of each row is the row's number, times a factor.
/// for factor in [1.0, 2.0] {
///     let values: Vec<f64> = rows.iter().map(|&row| factor * f64::from(row)).collect();
///     let taken = half.of(&Measurements::from_differential(&rows, &values)?);
///     assert!(taken.values().iter().zip(half.rows().iter()).all(|(&v, &row)| v == factor * f64::from(row)));
/// }
/// # Ok::<(), nirspi_recon::MeasurementError>(())
/// ```
#[derive(Debug, Clone)]
pub struct ShorterSweep {
    measured: Rows,
    shown: Rows,
    /// Positions of `shown` in `measured`; `None` if they are all, in the same order.
    positions: Option<Vec<usize>>,
}

impl ShorterSweep {
    /// The first `M = round(fraction * side^2)` (halves up, at least 1) patterns in the measured
    /// order or, with `order`, the first `M` of that order among the measured rows. They are fewer
    /// than `M` only if fewer were measured.
    ///
    /// # Errors
    /// [`MeasurementError::Fraction`] unless `0 < fraction <= 1`; [`MeasurementError::Rows`] if the
    /// order is a table that is not a permutation.
    pub fn new(
        measured: &Rows,
        order: Option<&Order>,
        fraction: f64,
    ) -> Result<Self, MeasurementError> {
        if !(fraction > 0.0 && fraction <= 1.0) {
            return Err(MeasurementError::Fraction { found: fraction });
        }
        let side = measured.side();
        let asked = ((fraction * side.area() as f64).round() as usize).max(1);
        let positions: Vec<usize> = match order {
            None => (0..measured.len().min(asked)).collect(),
            Some(order) => {
                let mut position = vec![None; side.area()];
                for (k, &row) in measured.iter().enumerate() {
                    position[row as usize] = Some(k);
                }
                let shown = order.rows(side)?;
                shown.iter().filter_map(|&row| position[row as usize]).take(asked).collect()
            }
        };
        if positions.iter().copied().eq(0..measured.len()) {
            return Ok(Self {
                measured: measured.clone(),
                shown: measured.clone(),
                positions: None,
            });
        }
        let shown = positions.iter().map(|&k| measured[k]).collect();
        Ok(Self {
            measured: measured.clone(),
            shown: Rows::trusted(side, shown),
            positions: Some(positions),
        })
    }

    /// The rows that the shorter sweep shows.
    #[must_use]
    pub fn rows(&self) -> &Rows {
        &self.shown
    }

    /// The part of these measurements that the shorter sweep would have taken.
    ///
    /// # Panics
    /// If the measurements have other rows.
    #[must_use]
    pub fn of(&self, measurements: &Measurements) -> Measurements {
        assert!(*measurements.rows() == self.measured, "measurements of other rows");
        let Some(positions) = &self.positions else {
            return measurements.clone();
        };
        let values = measurements.values();
        let values = positions.iter().map(|&k| values[k]).collect();
        Measurements {
            noise: measurements.noise(),
            most_noise: measurements.most_noise(),
            ..Measurements::trusted(self.shown.clone(), values)
        }
    }

    /// As [`of`](Self::of), without a copy if the shorter sweep shows all patterns.
    ///
    /// # Panics
    /// If the measurements have other rows.
    #[must_use]
    pub fn shorten(&self, measurements: Measurements) -> Measurements {
        match self.positions {
            None if *measurements.rows() == self.measured => measurements,
            _ => self.of(&measurements),
        }
    }
}

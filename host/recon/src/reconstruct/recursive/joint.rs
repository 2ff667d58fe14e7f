//! The readings of all positions of a scene together.

use super::motion::{Operator, Shift};
use super::past::{Past, Pose};

/// The readings of all positions, as seen from the last one.
pub(super) struct Joint {
    poses: Vec<Rows>,
}

/// The rows of one position.
struct Rows {
    /// The motion back to the position and the transposed motion, unless it is the last position.
    back: Option<[Operator; 2]>,
    values: Vec<f32>,
    weights: Vec<f32>,
}

impl Joint {
    pub fn new(past: &Past, noise: f32) -> Self {
        let of = |Pose { since, known }: &Pose| {
            let back = (*since != Shift::default()).then(|| {
                let back = past.spectrum.shift(since.reversed());
                let transposed = back.transposed();
                [back, transposed]
            });
            let weights = known.precision(noise).iter().map(|p| p * noise * noise).collect();
            Rows { back, values: known.value.clone(), weights }
        };
        Self { poses: past.poses.iter().map(of).collect() }
    }

    /// Sum over the positions of what `weighted` makes of their values and weights, moved to the
    /// last position.
    pub fn sum(
        &self,
        weighted: impl Fn(Option<&Operator>, &[f32], &[f32]) -> Vec<f32>,
    ) -> Vec<f32> {
        let mut sum: Vec<f32> = Vec::new();
        for Rows { back, values, weights } in &self.poses {
            let there = weighted(back.as_ref().map(|[back, _]| back), values, weights);
            let here = match back {
                Some([_, transposed]) => transposed.apply(&there),
                None => there,
            };
            sum.resize(here.len(), 0.0);
            sum.iter_mut().zip(here).for_each(|(sum, here)| *sum += here);
        }
        sum
    }

    /// The weighted values.
    pub fn right(&self) -> Vec<f32> {
        self.sum(|_, values, weights| values.iter().zip(weights).map(|(v, w)| v * w).collect())
    }

    /// Rows, as weighted by the readings of all positions.
    pub fn weigh(&self, rows: &[f32]) -> Vec<f32> {
        self.sum(|back, _, weights| {
            let there = back.map_or_else(|| rows.to_vec(), |back| back.apply(rows));
            there.iter().zip(weights).map(|(v, w)| v * w).collect()
        })
    }
}

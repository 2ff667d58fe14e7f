//! The caller's knowledge of blur and noise, and how it is combined with the estimates.

use super::Estimate;

/// What the caller knows about a number that the estimator also estimates.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub enum Known {
    /// Nothing: the estimate is used.
    #[default]
    Nothing,
    /// A lower bound, such as the lens's defocus at the measured distance. The larger of bound and
    /// estimate is used, because noise can hide blur from the estimator, whose estimate is then too
    /// small.
    AtLeast(f32),
    /// The exact number: the estimate is not used.
    Exactly(f32),
}

impl Known {
    fn over(self, estimated: f32) -> f32 {
        match self {
            Self::Nothing => estimated,
            // A bound that is NaN has no effect.
            Self::AtLeast(bound) => estimated.max(bound),
            Self::Exactly(value) => value,
        }
    }
}

/// `Some` is the exact number.
impl From<Option<f32>> for Known {
    fn from(value: Option<f32>) -> Self {
        value.map_or(Self::Nothing, Self::Exactly)
    }
}

/// The caller's knowledge of blur and noise.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct KnownEstimate {
    /// Blur in pixels of the 64 x 64 grid.
    pub sigma_px: Known,
    /// Noise of a reading.
    pub noise: Known,
}

impl KnownEstimate {
    /// The estimate, corrected by what is known.
    pub fn over(self, estimated: Estimate) -> Estimate {
        Estimate {
            sigma_px: self.sigma_px.over(estimated.sigma_px),
            noise: self.noise.over(estimated.noise),
        }
    }

    /// The smallest and the largest estimate. An estimate clamped to them is the corrected estimate.
    #[cfg(feature = "gpu")]
    pub(crate) fn bounds(self) -> [Estimate; 2] {
        [0.0, f32::MAX].map(|bound| self.over(Estimate { sigma_px: bound, noise: bound }))
    }

    /// The path's two numbers, then the minimum and maximum of blur and of noise on the scale of
    /// the networks. An estimate clamped to these bounds is the corrected estimate.
    #[cfg(feature = "gpu")]
    pub(crate) fn condition_bounds(self, path: [f32; 2]) -> [f32; 6] {
        let [least, most] = self.bounds().map(|bound| bound.conditions(path));
        [path[0], path[1], least[2], most[2], least[4], most[4]]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lower_bound_binds_only_below_itself_and_a_known_number_always() {
        let estimated = Estimate { sigma_px: 2.0, noise: 0.02 };
        for (known, expected) in [
            (Known::Nothing, 2.0),
            (Known::AtLeast(1.0), 2.0),
            (Known::AtLeast(3.0), 3.0),
            (Known::AtLeast(f32::NAN), 2.0),
            (Known::Exactly(1.0), 1.0),
            (Some(1.5).into(), 1.5),
            (None.into(), 2.0),
        ] {
            let of_blur = KnownEstimate { sigma_px: known, ..KnownEstimate::default() };
            assert_eq!(of_blur.over(estimated), Estimate { sigma_px: expected, ..estimated });
            let of_noise = KnownEstimate { noise: known, ..KnownEstimate::default() };
            assert_eq!(of_noise.over(estimated).sigma_px, 2.0);
        }
        let of_noise = KnownEstimate { noise: Known::AtLeast(0.03), ..KnownEstimate::default() };
        assert_eq!(of_noise.over(estimated).noise, 0.03);
    }
}

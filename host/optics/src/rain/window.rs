//! Drops of water on the window in front of projector and collector.
//!
//! A drop on a flat window is a lens, a spherical cap of contact angle `a`. Its rim deflects light
//! by `(n - 1) sin a`, and the deflection is proportional to the distance from its middle. On a
//! target at L, the light through a drop therefore covers a disc of radius `L (n - 1) sin a`
//! evenly, whatever the drop's size (thin lens; the focus is millimetres behind the drop). The
//! window is close to the lens: light for every pixel crosses all of it, and each pixel loses the
//! same share. On the path back, light that crosses a drop misses the detector.

use super::{RainError, ensure};
use crate::mie::Index;

/// Drops on the window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// Share of the window that the drops cover.
    pub covered: f64,
    /// Contact angle of water on the window: 10 degrees on clean glass, 90 on wax.
    pub contact_angle_deg: f64,
}

impl Window {
    /// Default contact angle: glass that is not freshly cleaned.
    pub const CONTACT_ANGLE_DEG: f64 = 30.0;

    /// # Errors
    /// [`RainError::Setting`] for a share outside 0 to 0.9 or an angle outside 1 to 90 degrees.
    pub fn new(covered: f64, contact_angle_deg: f64) -> Result<Self, RainError> {
        ensure((0.0..=0.9).contains(&covered), "covered share of the window", covered, "0 to 0.9")?;
        let holds = (1.0..=90.0).contains(&contact_angle_deg);
        ensure(holds, "contact angle", contact_angle_deg, "1 to 90 degrees")?;
        Ok(Self { covered, contact_angle_deg })
    }

    /// Radius of the disc over which drops spread their light, on a target at `distance_mm`;
    /// `water` is water's index.
    #[must_use]
    pub fn disc_mm(&self, distance_mm: f64, water: Index) -> f64 {
        distance_mm * (water.real - 1.0) * self.contact_angle_deg.to_radians().sin()
    }

    /// Share of the light that crosses the window outside its drops.
    #[must_use]
    pub fn clear(&self) -> f64 {
        1.0 - self.covered
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flat_drop_spreads_light_over_less_than_a_round_one() {
        // By hand: 300 mm * 0.318 * sin 30 degrees.
        let water = Index { real: 1.318, imaginary: 0.0 };
        let disc = |deg| Window::new(0.2, deg).unwrap().disc_mm(300.0, water);
        assert!((disc(30.0) - 47.7).abs() < 0.1, "{}", disc(30.0));
        assert!(disc(10.0) < disc(30.0) && disc(30.0) < disc(90.0));
    }

    #[test]
    fn a_window_that_cannot_be_is_refused_with_its_range() {
        for (covered, deg) in
            [(-0.1, 30.0), (0.95, 30.0), (0.2, 0.0), (0.2, 91.0), (f64::NAN, 30.0)]
        {
            assert!(Window::new(covered, deg).unwrap_err().to_string().contains("expected"));
        }
    }
}

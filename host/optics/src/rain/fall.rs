//! The fall speed of drops, and its consequence for an exposure.

/// Terminal speed in still air at sea level: `9.65 - 10.3 exp(-0.6 D)` m/s, D in mm (Atlas,
/// Srivastava and Sekhon, Rev. Geophys. 11, 1, 1973, a fit to Gunn and Kinzer's measurements from
/// 0.6 to 5.8 mm). Below 0.109 mm, where the fit is negative, the speed is 0: small droplets stay
/// in the air.
#[must_use]
pub fn fall_speed_m_per_s(diameter_mm: f64) -> f64 {
    (9.65 - 10.3 * (-0.6 * diameter_mm).exp()).max(0.0)
}

/// Acceleration of free fall, in m/s^2.
const GRAVITY_M_PER_S2: f64 = 9.81;

/// Speed of a drop that has fallen `height_m` from rest: `v sqrt(1 - exp(-2 g h / v^2))`, v its
/// terminal speed (drag as the square of the speed). A drop of 2 mm has a third of its terminal
/// speed after a quarter of a metre.
#[must_use]
pub fn fall_speed_from_rest_m_per_s(diameter_mm: f64, height_m: f64) -> f64 {
    let terminal = fall_speed_m_per_s(diameter_mm);
    if terminal == 0.0 {
        return 0.0;
    }
    terminal * (-(-2.0 * GRAVITY_M_PER_S2 * height_m / terminal.powi(2)).exp_m1()).sqrt()
}

/// Time in which a drop falls by twice its diameter, `2 D / v`, in seconds: the paper's tau_rain
/// (Algorithm 2).
#[must_use]
pub fn fall_time_constant_s(diameter_mm: f64) -> f64 {
    2.0 * diameter_mm * 1e-3 / fall_speed_m_per_s(diameter_mm)
}

/// The upper bound `sqrt(D) / (50 T)` of Algorithm 2's beta, before clamping. With D in metres, the
/// bound is the longest time that a drop stays in front of one pixel, `sqrt(a) / 50` for a radius a
/// (Garg and Nayar, Int. J. Comput. Vis. 75, 3, 2007), divided by the exposure. The paper uses the
/// diameter instead of the radius.
#[must_use]
pub fn beta_bound_as_printed(diameter_mm: f64, exposure_s: f64) -> f64 {
    (diameter_mm * 1e-3).sqrt() / (50.0 * exposure_s)
}

/// Share of an exposure that a drop spends in front of one pixel: the bound of
/// [`beta_bound_as_printed`], clamped to 0 to 1. For exposures of microseconds the share is 1,
/// because the drop stands still.
#[must_use]
pub fn beta(diameter_mm: f64, exposure_s: f64) -> f64 {
    beta_bound_as_printed(diameter_mm, exposure_s).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn drops_fall_as_gunn_and_kinzer_measured() {
        // Gunn and Kinzer (J. Meteorol. 6, 243, 1949): 4.03, 6.49, 8.06 and 8.83 m/s for 1, 2, 3
        // and 4 mm.
        for (mm, measured) in [(1.0, 4.03), (2.0, 6.49), (3.0, 8.06), (4.0, 8.83)] {
            let speed = fall_speed_m_per_s(mm);
            assert!((speed / measured - 1.0).abs() < 0.02, "{mm} mm: {speed}");
        }
        assert_eq!(fall_speed_m_per_s(0.05), 0.0);
    }

    #[test]
    fn a_drop_from_rest_falls_freely_at_first_and_at_its_terminal_speed_at_last() {
        let free = (2.0 * GRAVITY_M_PER_S2 * 0.001_f64).sqrt();
        assert!((fall_speed_from_rest_m_per_s(4.0, 0.001) / free - 1.0).abs() < 1e-3);
        assert!(
            (fall_speed_from_rest_m_per_s(2.0, 50.0) / fall_speed_m_per_s(2.0) - 1.0).abs() < 1e-6
        );
        // v = 6.548 m/s: 6.548 sqrt(1 - exp(-4.905 / 42.87)) = 2.153 m/s; after 0.5 m 2.96 m/s.
        assert!((fall_speed_from_rest_m_per_s(2.0, 0.25) - 2.153).abs() < 2e-3);
        assert!((fall_speed_from_rest_m_per_s(2.0, 0.5) - 2.96).abs() < 1e-2);
        assert_eq!(fall_speed_from_rest_m_per_s(0.05, 1.0), 0.0);
    }

    #[test]
    fn beta_never_leaves_its_physical_range() {
        // sqrt(0.002) / (50 * 25e-6) = 35.8, which cannot be a share.
        assert!((beta_bound_as_printed(2.0, 25e-6) - 35.777).abs() < 1e-3);
        assert_eq!(beta(2.0, 25e-6), 1.0);
        // Garg and Nayar's camera: 30 ms, a drop of 7 mm: 0.056.
        assert!((beta(7.0, 30e-3) - 0.0558).abs() < 1e-4);
    }

    #[test]
    fn a_2_mm_drop_takes_0_6_ms_for_twice_its_diameter() {
        assert!((fall_time_constant_s(2.0) - 4e-3 / 6.5477).abs() < 1e-7);
    }
}

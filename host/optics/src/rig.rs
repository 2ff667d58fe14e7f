//! The rain simulator: how evenly its nozzles wet the ground (paper, section 4 and 4.A).
//!
//! The paper's rig is 1.2 x 0.6 x 0.5 m with six nozzles and can be tilted by 15 degrees. The paper
//! does not give the positions of the nozzles ("strategically placed in a random arrangement"); the
//! default is two rows of three.

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use thiserror::Error;

/// Why the uniformity cannot be computed.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum RigError {
    /// There are fewer than two containers.
    #[error("rain simulator: {0} collected volumes, expected at least 2")]
    TooFew(usize),
    /// The volume of a container is not possible.
    #[error("rain simulator: volume {value} at place {place}, expected 0 to 1e100")]
    Volume {
        /// Number of the container, from 1.
        place: usize,
        /// The value found.
        value: f64,
    },
    /// The containers are empty.
    #[error("rain simulator: all collected volumes are 0, expected some rain")]
    Dry,
    /// A setting is outside its range.
    #[error("rain simulator: {name} is {value}, expected {expected}")]
    Setting {
        /// The name of the setting.
        name: &'static str,
        /// The value found.
        value: f64,
        /// The allowed values.
        expected: &'static str,
    },
}

/// Christiansen's uniformity coefficient in percent, `100 (1 - sum |v - mean| / (n mean))`
/// (Christiansen, *Irrigation by Sprinkling*, University of California bulletin 670, 1942). 100 is
/// even; irrigation needs more than 80.
///
/// # Errors
/// [`RigError`] for fewer than two volumes, volumes that are negative or beyond 1e100, or only zeros.
pub fn uniformity_percent(volumes: &[f64]) -> Result<f64, RigError> {
    if volumes.len() < 2 {
        return Err(RigError::TooFew(volumes.len()));
    }
    if let Some(at) = volumes.iter().position(|v| !(0.0..=1e100).contains(v)) {
        return Err(RigError::Volume { place: at + 1, value: volumes[at] });
    }
    let mean = volumes.iter().sum::<f64>() / volumes.len() as f64;
    if mean == 0.0 {
        return Err(RigError::Dry);
    }
    let deviation: f64 = volumes.iter().map(|v| (v - mean).abs()).sum();
    Ok(100.0 * (1.0 - deviation / (volumes.len() as f64 * mean)))
}

/// A rain simulator's geometry.
#[derive(Debug, Clone, PartialEq)]
pub struct Rig {
    /// Length, width and height, in mm.
    pub size_mm: [f64; 3],
    /// Nozzles seen from above, in mm from a corner, along length and width.
    pub nozzles_mm: Vec<[f64; 2]>,
    /// Half of a nozzle's spray angle, in degrees: drops leave in a Gaussian cone of this
    /// half-width at half height. Assumed, because the paper does not give the angle.
    pub spray_half_angle_deg: f64,
    /// Tilt of the floor along its length, in degrees.
    pub tilt_deg: f64,
}

impl Default for Rig {
    fn default() -> Self {
        let nozzles_mm = (0..6)
            .map(|i| [200.0 + 400.0 * f64::from(i % 3), 150.0 + 300.0 * f64::from(i / 3)])
            .collect();
        Self {
            size_mm: [1200.0, 600.0, 500.0],
            nozzles_mm,
            spray_half_angle_deg: 20.0,
            tilt_deg: 0.0,
        }
    }
}

/// Steepest tilt (paper, section 4).
pub const STEEPEST_TILT_DEG: f64 = 15.0;

impl Rig {
    /// Drops collected in `columns` x `rows` equal containers that cover the floor, row by row.
    /// `drops` fall from each nozzle. Drops that miss the floor run down the glass and are not
    /// collected. Seeded.
    ///
    /// # Errors
    /// [`RigError::Setting`] naming the setting that is not physical.
    pub fn collect(
        &self,
        columns: usize,
        rows: usize,
        drops: u32,
        seed: u64,
    ) -> Result<Vec<f64>, RigError> {
        let setting = |holds, name, value, expected| match holds {
            true => Ok(()),
            false => Err(RigError::Setting { name, value, expected }),
        };
        let counted = (1..=1000).contains(&columns) && (1..=1000).contains(&rows);
        setting(counted, "containers", (columns.saturating_mul(rows)) as f64, "1 to 1000 a side")?;
        for (name, value) in ["length", "width", "height"].into_iter().zip(self.size_mm) {
            setting(value.is_finite() && value > 0.0, name, value, "a positive number of mm")?;
        }
        let (angle, tilt) = (self.spray_half_angle_deg, self.tilt_deg);
        setting((0.1..80.0).contains(&angle), "spray half angle", angle, "0.1 to 80 degrees")?;
        setting((0.0..=STEEPEST_TILT_DEG).contains(&tilt), "tilt", tilt, "0 to 15 degrees")?;
        setting(!self.nozzles_mm.is_empty(), "nozzles", 0.0, "at least 1")?;

        let [length, width, height] = self.size_mm;
        // Half width at half height of a Gaussian is 1.1774 sigma.
        let sigma = angle.to_radians().tan() / (2.0 * 2.0_f64.ln()).sqrt();
        let slope = tilt.to_radians().tan();
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let mut volumes = vec![0.0; columns * rows];
        for nozzle in &self.nozzles_mm {
            for _ in 0..drops {
                let [along, across]: [f64; 2] =
                    std::array::from_fn(|_| sigma * rng.sample::<f64, _>(StandardNormal));
                // A drop meets the tilted floor at height - slope x = fall, with x = nozzle + along
                // * fall.
                let fall = (height + slope * (length / 2.0 - nozzle[0])) / (1.0 + slope * along);
                let (x, y) = (nozzle[0] + along * fall, nozzle[1] + across * fall);
                let column = (x / length * columns as f64).floor();
                let row = (y / width * rows as f64).floor();
                if column >= 0.0 && row >= 0.0 && column < columns as f64 && row < rows as f64 {
                    volumes[row as usize * columns + column as usize] += 1.0;
                }
            }
        }
        Ok(volumes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn uniformity_is_what_christiansen_defined() {
        // Mean 10, deviations 2, 2, 1, 1: 100 (1 - 6 / 40).
        assert!((uniformity_percent(&[8.0, 12.0, 9.0, 11.0]).unwrap() - 85.0).abs() < 1e-12);
        assert_eq!(uniformity_percent(&[3.0; 7]).unwrap(), 100.0);
    }

    #[test]
    fn volumes_that_cannot_be_are_named() {
        assert_eq!(uniformity_percent(&[1.0]), Err(RigError::TooFew(1)));
        assert_eq!(uniformity_percent(&[0.0, 0.0]), Err(RigError::Dry));
        let bad = uniformity_percent(&[1.0, -2.0]);
        assert_eq!(bad, Err(RigError::Volume { place: 2, value: -2.0 }));
        let message = Rig { tilt_deg: 20.0, ..Rig::default() }.collect(6, 3, 10, 1).unwrap_err();
        assert!(message.to_string().contains("expected 0 to 15 degrees"), "{message}");
    }

    #[test]
    fn tilting_or_narrowing_the_spray_makes_rain_less_even() {
        let of = |rig: Rig| uniformity_percent(&rig.collect(12, 6, 100_000, 1).unwrap()).unwrap();
        let flat = of(Rig::default());
        let tilted = of(Rig { tilt_deg: 15.0, ..Rig::default() });
        let narrow = of(Rig { spray_half_angle_deg: 5.0, ..Rig::default() });
        assert!(flat > tilted + 1.0, "{flat} {tilted}");
        assert!(flat > narrow + 20.0, "{flat} {narrow}");
    }

    proptest! {
        #[test]
        fn uniformity_does_not_depend_on_how_much_rain_fell(
            volumes in prop::collection::vec(0.01..10.0, 2..40),
            factor in 0.1..10.0,
        ) {
            let scaled: Vec<f64> = volumes.iter().map(|v| v * factor).collect();
            let (a, b) = (uniformity_percent(&volumes).unwrap(), uniformity_percent(&scaled).unwrap());
            prop_assert!((a - b).abs() < 1e-9 && a <= 100.0 && a > -100.0);
        }
    }
}

//! The uniformity of a rain simulator: of volumes collected, or of a simulated one.

use crate::error::{EvalError, Result};
use nirspi_optics::rig::{Rig, uniformity_percent};
use serde::Serialize;

/// Containers on the simulated floor, 10 cm a side, and drops from each nozzle.
const CONTAINERS: (usize, usize) = (12, 6);
const DROPS: u32 = 200_000;

/// The uniformity of the volumes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Christiansen's coefficient.
    pub uniformity_percent: f64,
    /// Number of volumes.
    pub containers: usize,
    /// Mean volume.
    pub mean: f64,
    /// The smallest volume.
    pub least: f64,
    /// The largest volume.
    pub most: f64,
    /// Whether the volumes are simulated.
    pub simulated: bool,
    /// Tilt of the simulated floor; `null` for measured volumes.
    pub tilt_deg: Option<f64>,
}

/// The uniformity of collected volumes.
///
/// # Errors
/// [`EvalError`] for no volumes, or volumes that are not positive.
pub fn measured(volumes: &[f64]) -> Result<Report> {
    report(volumes, None)
}

/// The uniformity of six nozzles over a tilted floor of 1.2 x 0.6 m.
///
/// # Errors
/// [`EvalError::Refused`] for a tilt out of range.
pub fn simulated(tilt_deg: f64, seed: u64) -> Result<Report> {
    let rig = Rig { tilt_deg, ..Rig::default() };
    let volumes = rig
        .collect(CONTAINERS.0, CONTAINERS.1, DROPS, seed)
        .map_err(|error| EvalError::refused("tilt_deg", &error))?;
    report(&volumes, Some(tilt_deg))
}

fn report(volumes: &[f64], tilt_deg: Option<f64>) -> Result<Report> {
    Ok(Report {
        uniformity_percent: uniformity_percent(volumes)?,
        containers: volumes.len(),
        mean: volumes.iter().sum::<f64>() / volumes.len() as f64,
        least: volumes.iter().copied().fold(f64::INFINITY, f64::min),
        most: volumes.iter().copied().fold(0.0, f64::max),
        simulated: tilt_deg.is_some(),
        tilt_deg,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn volumes_that_differ_are_less_uniform() {
        let report = measured(&[8.0, 12.0, 9.0, 11.0]).unwrap();
        assert!((report.uniformity_percent - 85.0).abs() < 1e-9, "{report:?}");
        assert_eq!((report.least, report.mean, report.most), (8.0, 10.0, 12.0));
        assert!(measured(&[]).is_err());
    }

    #[test]
    fn a_tilted_floor_is_filled_less_evenly_than_a_level_one() {
        let [level, tilted] = [0.0, 15.0].map(|tilt| simulated(tilt, 1).unwrap());
        assert!(tilted.uniformity_percent < level.uniformity_percent, "{level:?} {tilted:?}");
        assert_eq!((level.containers, level.simulated, level.tilt_deg), (72, true, Some(0.0)));
        let steep = simulated(30.0, 1).unwrap_err();
        assert!(steep.is_setting() && steep.to_string().starts_with("tilt_deg: "), "{steep}");
    }
}

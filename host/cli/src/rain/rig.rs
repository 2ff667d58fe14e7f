//! `nirspi rain --uniformity` and `--rig`.

use super::Table;
use crate::{Usage, print};
use anyhow::{Context, Result};
use nirspi_optics::rig::{Rig, uniformity_percent};
use serde::Serialize;
use std::path::Path;
use std::process::ExitCode;

/// Containers on the simulated floor, of 10 cm a side, and drops from each nozzle.
const CONTAINERS: (usize, usize) = (12, 6);
const DROPS: u32 = 200_000;

#[derive(Debug, Serialize)]
struct Report {
    uniformity_percent: f64,
    containers: usize,
    mean: f64,
    least: f64,
    most: f64,
    simulated: bool,
    tilt_deg: Option<f64>,
}

/// Collected volumes of a CSV file.
pub fn measured(path: &Path, json: bool) -> Result<ExitCode> {
    let volumes = Table::read(path)?.last_column()?;
    report(&volumes, None, json).with_context(|| path.display().to_string())
}

/// Six nozzles over a tilted floor.
pub fn simulated(tilt_deg: f64, seed: u64, json: bool) -> Result<ExitCode> {
    let rig = Rig { tilt_deg, ..Rig::default() };
    let volumes = rig
        .collect(CONTAINERS.0, CONTAINERS.1, DROPS, seed)
        .map_err(|error| Usage(format!("--tilt-deg: {error}")))?;
    report(&volumes, Some(tilt_deg), json)
}

fn report(volumes: &[f64], tilt_deg: Option<f64>, json: bool) -> Result<ExitCode> {
    let report = Report {
        uniformity_percent: uniformity_percent(volumes)?,
        containers: volumes.len(),
        mean: volumes.iter().sum::<f64>() / volumes.len() as f64,
        least: volumes.iter().copied().fold(f64::INFINITY, f64::min),
        most: volumes.iter().copied().fold(0.0, f64::max),
        simulated: tilt_deg.is_some(),
        tilt_deg,
    };
    if json {
        print::json(&report)?;
    } else {
        let from = match tilt_deg {
            Some(tilt) => {
                format!("simulated: six nozzles in two rows, floor tilted by {tilt} degrees")
            }
            None => "measured".to_owned(),
        };
        print::line(format_args!(
            "uniformity (Christiansen) {:.2} % of {} volumes, mean {:.4}, {:.4} to {:.4} ({from})",
            report.uniformity_percent, report.containers, report.mean, report.least, report.most
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}

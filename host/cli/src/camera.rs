//! Arguments that say what a virtual camera looks at, and how to measure.

use super::Usage;
use anyhow::{Context, Result};
use clap::{Args, ValueEnum};
use nirspi::files::order_table::read_order_table;
use nirspi::scene::{SceneMap, SceneSource};
use nirspi::setup::MeasurementSetup;
use nirspi::virtual_camera::VirtualOptics;
use nirspi_optics::Projector;
use nirspi_optics::rain::Rainfall;
use nirspi_recon::Order;
use std::path::Path;
use std::str::FromStr;

/// Edge of the reflectance map that a scene is drawn on.
const SCENE_PX: usize = 256;

/// What stands before a virtual camera.
#[derive(Debug, Clone, Args)]
pub struct SceneArgs {
    /// What the virtual camera looks at: letter:R (43 mm, bright on dark), word:STOP, white (a sheet), or a PNG or JPEG
    /// file (fills the field)
    #[arg(long, value_name = "SCENE", default_value = "letter:R")]
    pub scene: String,
    /// Distance from the virtual camera to the target, in metres
    #[arg(long, value_name = "M", default_value_t = 0.3, allow_negative_numbers = true)]
    pub distance_m: f64,
    /// What falls between the virtual camera and the target, as in the paper's Table 2: light is 1.93 mm/h of 0.5 mm
    /// drops, heavy 5.6 mm/h of 2 mm drops
    #[arg(long, value_enum, default_value_t = Rain::None)]
    pub rain: Rain,
    /// Seed of the simulated noise: the same seed gives the same bytes
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
}

/// The paper's rain (Table 2).
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Rain {
    /// Dry air.
    None,
    /// 1.93 mm/h, 0.5 mm.
    Light,
    /// 5.6 mm/h, 2 mm.
    Heavy,
}

impl Rain {
    /// The same for the optics.
    pub fn rainfall(self) -> Rainfall {
        match self {
            Self::None => Rainfall::None,
            Self::Light => Rainfall::Light,
            Self::Heavy => Rainfall::Heavy,
        }
    }
}

impl SceneArgs {
    /// A white sheet where the lens is focused, for a calibration.
    pub fn white_sheet(seed: u64) -> Self {
        let distance_m = Projector::default().focus_distance_mm / 1e3;
        Self { scene: "white".to_owned(), distance_m, rain: Rain::None, seed }
    }

    /// The scene and the optics before it.
    pub fn optics(&self) -> Result<(SceneMap, VirtualOptics)> {
        let distance_mm = self.distance_m * 1e3;
        if !(distance_mm.is_finite() && distance_mm > 0.0) {
            let found = self.distance_m;
            return Err(Usage(format!(
                "--distance-m is {found}, expected a positive number of metres"
            ))
            .into());
        }
        let source = SceneSource::from_str(&self.scene).map_err(|e| Usage(e.to_string()))?;
        let map = source.load(SCENE_PX)?;
        let optics = VirtualOptics::before(&map, distance_mm)
            .map_err(|error| Usage(format!("--distance-m {}: {error}", self.distance_m)))?;
        let optics = match self.rain.rainfall().drops()? {
            Some(drops) => optics.in_rain(drops).map_err(|error| {
                Usage(format!("--rain at --distance-m {}: {error}", self.distance_m))
            })?,
            None => optics,
        };
        Ok((map, optics))
    }
}

/// How to measure.
#[derive(Debug, Clone, Args)]
pub struct SetupArgs {
    #[arg(long, value_name = "ORDER", default_value = "cake-cutting", help = order_help())]
    pub order: String,
    /// Share of the 1024 patterns to show, the first of the order [default: demo and serve 0.5, capture 1]
    #[arg(long, value_name = "0..1", allow_negative_numbers = true)]
    pub sampling: Option<f64>,
    /// Sweeps summed into one frame
    #[arg(long, value_name = "N", default_value_t = 1,
          value_parser = clap::value_parser!(u32).range(1..))]
    pub sweeps: u32,
    /// ADC clocks (8 ns) that each pattern is shown: 5 is 25 MHz
    #[arg(long, value_name = "N", default_value_t = 5,
          value_parser = clap::value_parser!(u16).range(1..))]
    pub clocks_per_pattern: u16,
    /// ADC samples left out at the start of each pattern
    #[arg(long, value_name = "N", default_value_t = 2)]
    pub blanked: u16,
    /// Show patterns alone, without their complements
    #[arg(long)]
    pub non_differential: bool,
}

impl SetupArgs {
    /// The setup asked for.
    pub fn setup(&self, default_sampling: f64) -> Result<MeasurementSetup> {
        let order = parse_order("--order", &self.order)?;
        if self.blanked >= self.clocks_per_pattern {
            let (blanked, clocks) = (self.blanked, self.clocks_per_pattern);
            return Err(Usage(format!(
                "--blanked is {blanked}, expected less than the {clocks} of --clocks-per-pattern"
            ))
            .into());
        }
        let sampling = self.sampling.unwrap_or(default_sampling);
        check_sampling(sampling)?;
        let mut setup = MeasurementSetup::new(&order, sampling)
            .with_context(|| format!("--order {}", self.order))?;
        setup.sweeps = self.sweeps;
        setup.clocks_per_pattern = self.clocks_per_pattern;
        setup.blanked = self.blanked;
        setup.differential = !self.non_differential;
        Ok(setup)
    }
}

fn order_help() -> String {
    format!(
        "Order of the patterns: {}, or table:FILE (numbers, entry k the natural-order Hadamard row shown k-th)",
        Order::expected()
    )
}

/// An order by name, or a user's own from a file, as an option says it.
pub fn parse_order(option: &str, name: &str) -> Result<Order> {
    if let Some(path) = name.strip_prefix("table:") {
        return Ok(Order::Table(read_order_table(Path::new(path))?));
    }
    Order::from_str(name).map_err(|error| Usage(format!("{option}: {error} or table:FILE")).into())
}

/// A share of patterns is more than 0 and at most 1.
pub fn check_sampling(sampling: f64) -> Result<()> {
    if sampling > 0.0 && sampling <= 1.0 {
        return Ok(());
    }
    Err(Usage(format!("--sampling is {sampling}, expected more than 0 and at most 1")).into())
}

//! What the imaging thread gets of the newest frames.

use nirspi::account::LossCounters;
use nirspi::calibration::FlatField;
use nirspi::clock::Instant;
use nirspi::integrate::Integrated;
use nirspi::response::Settling;
use nirspi::setup::MeasurementSetup;
use nirspi_nets::DepthMaps;
use std::sync::Arc;

/// One run's setup and the camera's response: everything needed to interpret its frames.
#[derive(Debug)]
pub struct RunSetup {
    /// The measurement's setup.
    pub setup: MeasurementSetup,
    /// The camera's response, if known.
    pub settling: Option<Settling>,
    /// The flat field of its LEDs, if known.
    pub flat_field: Option<FlatField>,
}

/// A depth map in the camera's image.
#[derive(Debug)]
pub struct DepthImage {
    /// The map for the networks.
    pub map: DepthMaps,
    /// (32, 32) distances in metres.
    pub pixels_m: Vec<f32>,
}

/// The newest frames, and the newest depth map.
#[derive(Debug, Clone)]
pub struct Look {
    /// The sum of the frames.
    pub sum: Integrated,
    /// How the frames were measured.
    pub run: Arc<RunSetup>,
    /// The newest depth map.
    pub depth: Option<Arc<DepthImage>>,
    /// When the newest frame came out of the link.
    pub arrived: Instant,
    /// The loss counters of its run, with the newest frame.
    pub counters: LossCounters,
    /// Number of the newest frame among those received, from 1 on.
    pub newest: u64,
}

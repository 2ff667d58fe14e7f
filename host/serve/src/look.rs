//! What the imaging thread gets of the newest frames.

use nirspi::account::LossCounters;
use nirspi::calibration::FlatField;
use nirspi::clock::Instant;
#[cfg(not(target_family = "wasm"))]
use nirspi::feed::{Header, OwnPatterns, mean};
#[cfg(not(target_family = "wasm"))]
use nirspi::files::FileError;
#[cfg(not(target_family = "wasm"))]
use nirspi::files::measurement::{Plain, PlainSweeps, Sweeps};
use nirspi::integrate::{IntegrateError, Newest};
use nirspi::moving::followed;
use nirspi::response::Settling;
use nirspi::setup::MeasurementSetup;
#[cfg(not(target_family = "wasm"))]
use nirspi::source::{Source, SourceError};
use nirspi_nets::DepthMaps;
use nirspi_recon::Measurements;
#[cfg(not(target_family = "wasm"))]
use std::fmt;
#[cfg(not(target_family = "wasm"))]
use std::path::{Path, PathBuf};
use std::sync::Arc;
use thiserror::Error;

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

/// The newest frames.
#[derive(Debug, Clone)]
pub struct Look {
    /// The frames.
    pub seen: Seen,
    /// When the newest frame came out of the link.
    pub arrived: Instant,
    /// The loss counters of its run, with the newest frame.
    pub counters: LossCounters,
    /// Number of the newest frame among those received, from 1 on.
    pub newest: u64,
}

/// Frames of a camera or of a feed.
#[derive(Debug, Clone)]
pub enum Seen {
    /// The frames, how they were measured, and the newest depth map.
    Camera { frames: Box<Newest>, run: Arc<RunSetup>, depth: Option<Arc<DepthImage>> },
    /// Frames of a feed, and what they are.
    #[cfg(not(target_family = "wasm"))]
    Feed { frames: Vec<Arc<[f64]>>, bench: Arc<Bench> },
}

/// A feed: everything needed to interpret its frames.
#[cfg(not(target_family = "wasm"))]
pub struct Bench {
    /// The header.
    pub header: Header,
    /// The address, for messages.
    pub origin: PathBuf,
    /// Makes measurements of readings.
    sweeps: Shown,
}

/// What makes measurements of readings.
#[cfg(not(target_family = "wasm"))]
enum Shown {
    /// Of Hadamard patterns.
    Hadamard(Box<Sweeps>),
    /// Of patterns of the bench's own.
    Own(PlainSweeps),
}

/// Why the frames of a feed cannot be interpreted.
#[cfg(not(target_family = "wasm"))]
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum BenchError {
    /// The feed shows patterns of its own, which are not known.
    #[error(transparent)]
    OwnPatterns(#[from] OwnPatterns),
    /// The feed shows Hadamard patterns, and others were given.
    #[error("the feed shows Hadamard patterns: expected no others beside them (--matrix)")]
    Hadamard,
    /// The patterns cannot be read, or do not fit the header.
    #[error(transparent)]
    File(#[from] FileError),
}

#[cfg(not(target_family = "wasm"))]
impl Bench {
    /// The feed of this name with this header, and the file of its own patterns, if it shows such.
    pub fn new(name: &str, header: &Header, matrix: Option<&Path>) -> Result<Self, BenchError> {
        let (origin, form, simulated) = (PathBuf::from(name), header.form, header.simulated);
        let sweeps = match (header.hadamard(), matrix) {
            (Ok(_), Some(_)) => return Err(BenchError::Hadamard),
            (Ok((side, rows)), None) => {
                let sweeps = Sweeps::new(&origin, side, rows, form, simulated)?;
                Shown::Hadamard(Box::new(sweeps))
            }
            (Err(unknown), None) => return Err(unknown.into()),
            (Err(OwnPatterns { size, count }), Some(matrix)) => {
                Shown::Own(PlainSweeps::new(matrix, (count, size), &origin, form, simulated)?)
            }
        };
        Ok(Self { header: header.clone(), origin, sweeps })
    }
}

#[cfg(not(target_family = "wasm"))]
impl fmt::Debug for Bench {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Bench").field("origin", &self.origin).finish_non_exhaustive()
    }
}

/// The run of frames, by which looks of another run are known.
#[derive(Debug, Clone)]
pub enum Run {
    /// A run of a camera.
    Camera(Arc<RunSetup>),
    /// A feed from its header to its end.
    #[cfg(not(target_family = "wasm"))]
    Feed(Arc<Bench>),
}

/// What frames have measured.
#[derive(Debug)]
pub enum Measured {
    /// By Hadamard patterns.
    Hadamard {
        /// The measurements.
        measurements: Measurements,
        /// What contradicts them, one line each.
        warnings: Vec<String>,
    },
    /// By patterns of a bench's own.
    #[cfg(not(target_family = "wasm"))]
    Own(Plain),
}

/// Why frames give no measurements.
#[derive(Debug, Error)]
pub enum MeasuredError {
    /// The frames of a camera.
    #[error(transparent)]
    Camera(#[from] IntegrateError),
    /// The frames of a feed.
    #[cfg(not(target_family = "wasm"))]
    #[error(transparent)]
    Feed(#[from] SourceError),
    /// The frames of a feed of its own patterns.
    #[cfg(not(target_family = "wasm"))]
    #[error(transparent)]
    Own(#[from] FileError),
}

impl Run {
    /// Whether this is the run of the look.
    pub fn is_of(&self, look: &Look) -> bool {
        match (self, &look.seen) {
            (Self::Camera(own), Seen::Camera { run, .. }) => Arc::ptr_eq(own, run),
            #[cfg(not(target_family = "wasm"))]
            (Self::Feed(own), Seen::Feed { bench, .. }) => Arc::ptr_eq(own, bench),
            #[cfg(not(target_family = "wasm"))]
            _ => false,
        }
    }
}

impl Look {
    /// The run of the frames.
    pub fn run(&self) -> Run {
        match &self.seen {
            Seen::Camera { run, .. } => Run::Camera(Arc::clone(run)),
            #[cfg(not(target_family = "wasm"))]
            Seen::Feed { bench, .. } => Run::Feed(Arc::clone(bench)),
        }
    }

    /// Number of frames.
    pub fn frames(&self) -> u64 {
        match &self.seen {
            Seen::Camera { frames, .. } => frames.frames(),
            #[cfg(not(target_family = "wasm"))]
            Seen::Feed { frames, .. } => frames.len() as u64,
        }
    }

    /// What the frames have measured: their sum, or where the scene changed meanwhile, the newest of them, added along its
    /// way. A method that `remembers` the images before gets the sum, because it finds the motion by itself.
    ///
    /// # Errors
    /// [`MeasuredError`] if they give no measurements.
    pub fn measured(&self, remembers: bool) -> Result<Measured, MeasuredError> {
        match &self.seen {
            Seen::Camera { frames, run, .. } => {
                let (sum, settling) = (frames.sum(), run.settling.as_ref());
                let (measurements, warnings) = match remembers {
                    true => (sum.measurements(&run.setup, settling, false)?, sum.warnings()),
                    false => followed(&sum, &run.setup, settling, false)?,
                };
                Ok(Measured::Hadamard { measurements, warnings })
            }
            #[cfg(not(target_family = "wasm"))]
            Seen::Feed { frames, bench } => {
                let sweeps = match &bench.sweeps {
                    Shown::Hadamard(sweeps) => sweeps,
                    Shown::Own(sweeps) => return Ok(Measured::Own(sweeps.read(mean(frames))?)),
                };
                let sweep = sweeps.read(mean(frames)).map_err(SourceError::from)?;
                let source = Source::of_sweep(&bench.origin, sweep)?;
                let warnings = source.all_warnings();
                Ok(Measured::Hadamard { measurements: source.measurements, warnings })
            }
        }
    }

    /// The flat field of the camera.
    pub fn flat_field(&self) -> Option<&FlatField> {
        match &self.seen {
            Seen::Camera { run, .. } => run.flat_field.as_ref(),
            #[cfg(not(target_family = "wasm"))]
            Seen::Feed { .. } => None,
        }
    }

    /// The newest depth map.
    pub fn depth(&self) -> Option<&Arc<DepthImage>> {
        match &self.seen {
            Seen::Camera { depth, .. } => depth.as_ref(),
            #[cfg(not(target_family = "wasm"))]
            Seen::Feed { .. } => None,
        }
    }

    /// The order of the patterns, their number, and the sweeps of a frame.
    pub fn patterns(&self) -> (String, usize, u32) {
        match &self.seen {
            Seen::Camera { run, .. } => {
                let setup = &run.setup;
                (setup.order.clone(), setup.rows.len(), setup.sweeps)
            }
            #[cfg(not(target_family = "wasm"))]
            Seen::Feed { bench, .. } => (bench.header.order(), bench.header.patterns(), 1),
        }
    }

    /// The unit of readings and pixels.
    pub fn unit(&self) -> String {
        match &self.seen {
            Seen::Camera { .. } => "ADC counts".to_owned(),
            #[cfg(not(target_family = "wasm"))]
            Seen::Feed { bench, .. } => bench.header.unit.clone().unwrap_or_default(),
        }
    }
}

//! `nirspi camera calibrate`: measures ADC latency, settling and flat field against a white sheet and
//! keeps them for the camera.

use super::camera::{CameraArgs, ModelArgs, SceneArgs, exposure};
use super::progress::Progress;
use super::report::ReportArgs;
use super::{Usage, address};
use super::{print, provenance};
use anyhow::{Context, Result, anyhow};
use nirspi::calibration::{KeptCalibration, KeptFlatField, Sweeps, calibrate, path_of};
use nirspi::capture::{measure_dark, measure_flat_field};
use nirspi::exposure::{Length, Light};
use nirspi::response::Settling;
use nirspi::session::{IgnorePackets, Session};
use nirspi::setup::MeasurementSetup;
use nirspi_recon::Order;
use nirspi_recon::words::{count, count_of};
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::SystemTime;

/// Measure a camera's ADC latency, settling and flat field, and keep them for the captures after it
///
/// Hold a white sheet before the camera, at the shortest distance at which the image is in focus. Latency and settling belong to the camera and
/// its gateware, so one calibration is enough until the gateware or the amplifier changes. `nirspi camera selftest` measures the
/// same and checks the rest of the camera, too. A virtual camera is shown a white sheet automatically.
///
/// With --white, the sheet must fill the field and be evenly lit. The command then also measures the light of each LED and
/// finds dead LEDs, and `capture --picture`, `serve` and `reconstruct` correct their images for both. With --dark, cover the
/// lens: the command measures what each pixel reads without light and adds that to the flat field.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi camera calibrate --camera usb\n\
    \x20 nirspi camera calibrate --camera usb --white\n\
    \x20 nirspi camera calibrate --camera tcp:127.0.0.1:1550 --calibration bench-2.json")]
pub struct Args {
    #[command(flatten)]
    camera: CameraArgs,
    /// Keep the calibration in this file [default: a file for the camera's serial number in the user's data directory]
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    /// Measure the flat field as well: light of each LED, and dead LEDs
    #[arg(long, conflicts_with = "calibration")]
    white: bool,
    /// Measure the dark frame, with the lens covered, and add it to the flat field that is kept
    #[arg(long, conflicts_with_all = ["calibration", "white"])]
    dark: bool,
    /// Sweeps of all patterns to sum for the flat field or the dark frame; 8000 sweeps are 0.7 s of light at 40 ns a pattern
    #[arg(long, value_name = "N", default_value_t = 8000,
          value_parser = clap::value_parser!(u32).range(8..=10_000_000))]
    sweeps: u32,
    #[arg(
        long,
        value_name = "TIME",
        conflicts_with = "sweeps",
        allow_hyphen_values = true,
        help = "Light of the flat field or the dark frame, as a time with its unit, in place of --sweeps: 0.7s"
    )]
    light: Option<Light>,
    #[command(flatten)]
    model: ModelArgs,
    /// Seed of the virtual camera's simulated noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    report: ReportArgs,
}

#[derive(Debug, Serialize)]
struct Report {
    #[serde(flatten)]
    kept: KeptCalibration,
    file: PathBuf,
    /// `null` without --white.
    flat_field: Option<FlatFieldReport>,
}

#[derive(Debug, Serialize)]
struct FlatFieldReport {
    file: PathBuf,
    sweeps: Sweeps,
    /// Pattern of images of the white sheet as they come, as a share of white.
    pattern_before: f64,
    /// The same corrected.
    pattern_after: f64,
    /// Row and column.
    dead_leds: Vec<[u8; 2]>,
    /// Pixels with a reading in the dark; `null` where that was not measured.
    dark_pixels: Option<usize>,
}

impl FlatFieldReport {
    fn new(kept: &KeptFlatField, file: PathBuf) -> Self {
        let KeptFlatField { sweeps, pattern_before, pattern_after, ref flat, .. } = *kept;
        let (dead_leds, dark_pixels) = (flat.dead_leds().to_vec(), flat.dark_pixels());
        Self { file, sweeps, pattern_before, pattern_after, dead_leds, dark_pixels }
    }
}

pub fn run(args: &Args) -> Result<ExitCode> {
    // A mistake is said before any light.
    let (setup, sweeps) = (setup(args)?, sweeps(args)?);
    if args.dark {
        return run_dark(args, setup, sweeps);
    }
    let address = args.camera.address(args.report.json)?;
    let mut session = address::open(&address, &SceneArgs::white_sheet(&args.model, args.seed))?;
    let settling = calibrate(&mut session, &mut IgnorePackets)
        .with_context(|| format!("{address}: not calibrated"))?;
    let camera = session.identity().clone();
    let kept = KeptCalibration::new(camera, settling, Vec::new(), SystemTime::now());
    let flat_field = match args.white {
        true => {
            let measured = white(setup, sweeps, &mut session, &kept.settling);
            Some(measured.with_context(|| format!("{address}: no flat field"))?)
        }
        false => None,
    };
    let file = kept.keep(args.calibration.as_deref())?;
    let summary = flat_field.as_ref().map(|(flat, _)| flat.summary());
    let flat_field = flat_field.map(|(flat, file)| FlatFieldReport::new(&flat, file));
    let report = Report { kept, file, flat_field };
    let provenance = provenance::of_camera(&report.kept.camera);
    args.report.print(&report, &provenance, |report| say(report, summary))
}

fn say(report: &Report, flat_field: Option<impl std::fmt::Display>) -> Result<()> {
    let KeptCalibration { camera, settling, .. } = &report.kept;
    print::line(format_args!(
        "{} {}: ADC latency {}, settled after {}, a step of {:.0} ADC counts",
        camera.board,
        camera.serial,
        count(settling.adc_latency, "clock"),
        count_of(settling.response.len(), "clock"),
        settling.step_counts
    ))?;
    if settling.tile_sag > 0.0 {
        print::line(format_args!(
            "a tile of LEDs loses {:.2} % of its light while all of them are lit; images are corrected for it",
            100.0 * settling.tile_sag
        ))?;
    }
    print::line(format_args!("kept in {}", report.file.display()))?;
    if let (Some(summary), Some(flat)) = (flat_field, &report.flat_field) {
        print::line(summary)?;
        print::line(format_args!("kept in {}", flat.file.display()))?;
    }
    Ok(())
}

/// All patterns and their complements, with the timing of the camera.
fn setup(args: &Args) -> Result<MeasurementSetup> {
    let readout = args.model.read()?.readout;
    let setup = MeasurementSetup::new(&Order::Natural, 1.0)?;
    Ok(setup.timed(readout.clocks_per_pattern, readout.blanked))
}

/// The number of sweeps to sum: --sweeps, or those that --light takes.
fn sweeps(args: &Args) -> Result<u32> {
    let Some(light) = args.light else { return Ok(args.sweeps) };
    let sweeps = exposure(Length::Light(light, Some(1)), &setup(args)?)?.frames;
    if (8..=10_000_000).contains(&sweeps) {
        return Ok(sweeps);
    }
    Err(Usage(format!("--light {light} is {sweeps} sweeps, expected 8 to 10000000")).into())
}

/// Measures the flat field and writes its file.
fn white(
    setup: MeasurementSetup,
    sweeps: u32,
    session: &mut Session,
    settling: &Settling,
) -> Result<(KeptFlatField, PathBuf)> {
    let setup = MeasurementSetup { adc_latency: settling.adc_latency, ..setup };
    let sweeps = Sweeps::of_map(sweeps);
    let bar = Progress::of("flat field", sweeps.map + 2 * sweeps.check, "sweeps");
    let measured = measure_flat_field(session, &setup, settling, sweeps, &mut bar.watch());
    drop(bar);
    let camera = session.identity().clone();
    let kept = KeptFlatField::new(camera, measured?, sweeps, SystemTime::now());
    let file = kept.keep(None)?;
    Ok((kept, file))
}

/// Adds a dark frame to the flat field that is kept.
fn run_dark(args: &Args, setup: MeasurementSetup, sweeps: u32) -> Result<ExitCode> {
    let address = args.camera.address(args.report.json)?;
    let mut session = address::open(&address, &SceneArgs::covered(&args.model, args.seed))?;
    let camera = session.identity().clone();
    let kept = KeptFlatField::of(&camera)?.ok_or_else(|| {
        let serial = &camera.serial;
        anyhow!(
            "no flat field is kept for camera {serial}: run nirspi camera calibrate --white first"
        )
    })?;
    let settling = KeptCalibration::read(&path_of(&camera.serial)?, &camera)?.settling;
    let setup = MeasurementSetup { adc_latency: settling.adc_latency, ..setup };
    let flat = kept.flat.clone();
    let bar = Progress::of("dark frame", 2 * u64::from(sweeps), "sweeps");
    let flat = measure_dark(&mut session, &setup, &settling, flat, sweeps, &mut bar.watch());
    drop(bar);
    let kept = kept.renewed(flat.with_context(|| format!("{address}: no dark frame"))?);
    let file = kept.keep(None)?;
    let provenance = provenance::of_camera(&camera);
    args.report.print(&FlatFieldReport::new(&kept, file), &provenance, |dark| {
        print::line(format_args!(
            "dark frame: {} of 1024 pixels read something without light, beyond noise; kept in {}",
            dark.dark_pixels.unwrap_or(0),
            dark.file.display()
        ))
    })
}

//! `nirspi demo`: the whole camera on a simulated scene, from light to picture.

use super::camera::{SceneArgs, SetupArgs};
use super::method::{MethodArgs, Solved, solve};
use super::print;
use super::progress::Progress;
use super::provenance;
use super::report::{ReportArgs, StageTimes, stages};
use anyhow::Result;
use nirspi::account::LossCounters;
use nirspi::files::image::encode_grey;
use nirspi::files::measurement::encode as encode_measurement;
use nirspi::files::npy;
use nirspi::files::output::OutputDir;
use nirspi::imaging::{Fitted, KnownReadings, MethodReport, Quality, compare};
use nirspi::picture::Pictures;
use nirspi::scene::SceneMap;
use nirspi::session::CameraIdentity;
use nirspi::virtual_camera::{
    Panels, Stages, StagesReport, calibrate_against_white, enhance_stages,
    flat_field_against_white, shoot,
};
use nirspi_recon::words::{count, count_of};
use nirspi_recon::{Measurements, Sampling, reconstruct};
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

/// Show what the camera does, without a camera: capture a simulated scene and reconstruct it
///
/// The light is simulated; the gateware is its bit-exact model; firmware logic and wire protocol are those of a real camera.
/// The program calibrates the virtual camera against a white sheet, captures the scene, reconstructs the image, fuses the
/// image with depth and deblurs it. The command writes the scene and the image of every stage as PNG and NPY,
/// side_by_side.png, report.json, and measurement.npz and frames.npy to try other commands on.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n\
    \x20 nirspi demo --scene letter:R --out demo/")]
pub struct Args {
    #[command(flatten)]
    scene: SceneArgs,
    /// Frames to measure; the image is made from their sum [default: what the camera description says; 244 for the paper's
    /// camera]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    frames: Option<u32>,
    #[command(flatten)]
    setup: SetupArgs,
    #[command(flatten)]
    method: MethodArgs,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "demo")]
    out: PathBuf,
    #[command(flatten)]
    report: ReportArgs,
}

#[derive(Debug, Serialize)]
struct Report<'a> {
    scene: String,
    simulated: bool,
    /// The camera description's name.
    camera_model: String,
    distance_m: f64,
    /// The weather between camera and scene.
    rain: String,
    /// Extinction between camera and scene, times the distance; 0 in dry air.
    optical_depth: f64,
    seed: u64,
    field_mm: f64,
    defocus_mm: f64,
    electrons_per_led_and_sample: f64,
    electrons_per_adc_count: f64,
    camera: CameraIdentity,
    patterns: usize,
    order: String,
    differential: bool,
    acquisition_ms: f64,
    frames: LossCounters,
    adc_latency_clocks: u8,
    leak_taps: Vec<f64>,
    /// Row and column of dead LEDs found by the flat field; `null` if all LEDs are alike and no
    /// flat field was measured.
    dead_leds: Option<Vec<[u8; 2]>>,
    /// Plain inverse transform, with the leak uncorrected.
    raw: Quality,
    /// The result, compared with the image of a perfect 32 x 32 camera.
    reconstruction: Quality,
    quality_note: &'static str,
    enhancement: &'a StagesReport,
    #[serde(flatten)]
    method: MethodReport,
    notes: Vec<String>,
    /// What is black and white in the pictures.
    pictures: Pictures,
    stage_ms: StageTimes,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    args.method.check()?;
    let setup = args.setup.setup(Sampling::HALF, &args.scene.model)?;
    let mut times = stages();
    let (map, optics) = times.time("scene", || args.scene.optics())?;
    // Latency belongs to the camera and not to the scene.
    let seed = args.scene.seed;
    let model = optics.camera_model();
    let frames = args.frames.unwrap_or(model.readout.sweeps_per_picture);
    let settling = times.time("calibrate", || calibrate_against_white(&optics, seed))?;
    let flat_field =
        times.time("flat_field", || flat_field_against_white(&optics, &settling, seed))?;

    let bar = Progress::of("capture", frames, "frames");
    let shot = times
        .time("capture", || shoot(&optics, setup, &settling, frames, seed, &mut bar.watch()))?;
    drop(bar);
    let camera = shot.session.identity().clone();
    let captured = &shot.capture;
    let mut notes: Vec<String> =
        captured.integrated.warnings().into_iter().map(str::to_owned).collect();
    let setup = &captured.setup;
    let settling = captured.settling.as_ref();
    let leak = settling.map(|s| s.leak(setup.clocks_per_pattern, setup.blanked)).transpose()?;
    let raw = captured.integrated.measurements(setup, settling, true)?;
    let raw = times.time("inverse_transform", || reconstruct::hadamard(&raw));
    let measurements = shot.measurements()?;
    let Solved { image, report: method } =
        times.time("reconstruct", || solve(&args.method, &measurements))?;
    let image = match &flat_field {
        Some(flat) => flat.correct(&image),
        None => image,
    };

    let truth = optics.focused_footprint()?.weights().to_vec();
    let raw = compare(&raw, &truth)?;
    let fitted = compare(&image, &truth)?;
    // The photon budget gives the noise of a difference.
    let settings = args.method.settings_for(measurements.side().pixels())?;
    let noise = Some(optics.difference_noise_counts(frames));
    let readings = KnownReadings::new(args.method.method, &settings, &measurements, noise);
    let rows = measurements.rows();
    let stages = enhance_stages(&image, rows, readings, &optics, seed, &mut times)?;
    if fitted.quality.inverted {
        notes.push(
            "the image is darker where the scene is brighter: it is scored as blank".to_owned(),
        );
    }
    let acquisition_ms = setup.frame_ns() * f64::from(frames) * 1e-6;
    let rain = args.scene.air(model)?.name().to_owned();
    let panels = Panels {
        map: &map,
        optics: &optics,
        capture: captured,
        acquisition_ms,
        rain: &rain,
        seed,
        truth: &truth,
        raw: &raw,
        result: &fitted,
        method: &method,
        stages: &stages,
    };
    let provenance = provenance::of_camera(&camera);
    let pictures = panels.pictures(&provenance);
    let report = Report {
        scene: map.name.clone(),
        simulated: true,
        camera_model: model.name.clone(),
        distance_m: optics.distance_mm() / 1e3,
        rain,
        optical_depth: optics.optical_depth(),
        seed,
        field_mm: optics.field_mm(),
        defocus_mm: optics.blur_mm(),
        electrons_per_led_and_sample: optics.budget().electrons_per_led,
        electrons_per_adc_count: optics.chain().electrons_per_count,
        camera,
        patterns: setup.rows.len(),
        order: setup.order.clone(),
        differential: setup.differential,
        acquisition_ms,
        frames: captured.counters,
        adc_latency_clocks: setup.adc_latency,
        leak_taps: leak.map(|leak| leak.taps().to_vec()).unwrap_or_default(),
        dead_leds: flat_field.map(|flat| flat.dead_leds().to_vec()),
        raw: raw.quality,
        reconstruction: fitted.quality,
        quality_note: "against the scene on the 32 x 32 LED grid without defocus, after the gain and offset of \
                       least squares",
        enhancement: &stages.report,
        method,
        notes,
        pictures,
        stage_ms: times,
    };
    let images = Images { map: &map, truth, raw, fitted, measurements, stages: &stages };
    write(args, &images, &report)?;
    args.report.print(&report, &provenance, |report| say(args, report))
}

/// The images of the report's stages.
struct Images<'a> {
    map: &'a SceneMap,
    truth: Vec<f32>,
    raw: Fitted,
    fitted: Fitted,
    measurements: Measurements,
    stages: &'a Stages,
}

fn write(args: &Args, images: &Images, report: &Report) -> Result<()> {
    let (map, stages) = (images.map, images.stages);
    let side = images.measurements.rows().side().pixels();
    let grid = [side, side];
    let provenance = report.pictures.provenance();
    let mut out = OutputDir::create(&args.out)?;
    let scene = &map.reflectance;
    out.write("scene.png", &encode_grey(map.size_px, map.size_px, scene, provenance))?;
    out.write("scene.npy", &npy::encode(&[map.size_px, map.size_px], scene))?;
    out.write("truth.npy", &npy::encode(&grid, &images.truth))?;
    out.write("raw.npy", &npy::encode(&grid, &images.raw.values))?;
    out.write("reconstruction.npy", &npy::encode(&grid, &images.fitted.values))?;
    // The input of `enhance` and `reconstruct`.
    out.write("frames.npy", &npy::encode(&[1, side, side], &images.fitted.values))?;
    let measurement = args.out.join("measurement.npz");
    let measured = encode_measurement(&measurement, &images.measurements, provenance)?;
    out.write("measurement.npz", &measured)?;
    out.write("truth_64.npy", &npy::encode(&[2 * side, 2 * side], &stages.truth))?;
    for (name, image) in
        [("upscaled", &stages.upscaled), ("fused", &stages.fused), ("deblurred", &stages.deblurred)]
    {
        out.write(&format!("{name}.npy"), &npy::encode(&[2 * side, 2 * side], image))?;
    }
    if let Some(half_width) = &stages.half_width {
        out.write("interval.npy", &npy::encode(&[2 * side, 2 * side], half_width))?;
    }
    report.pictures.write(&mut out)?;
    out.write("report.json", provenance.sign(report)?.as_bytes())?;
    out.commit()?;
    Ok(())
}

fn say(args: &Args, report: &Report) -> Result<()> {
    print::line(format_args!(
        "{} at {} m, {} of {} in {:.1} ms of (simulated) light",
        report.scene,
        report.distance_m,
        count(report.frames.received, "frame"),
        count_of(report.patterns, "pattern"),
        report.acquisition_ms
    ))?;
    print::line(format_args!("frames: {}", report.frames))?;
    print::line(format_args!("raw:    {}", quality_line(&report.raw)))?;
    print::line(format_args!("result: {}", quality_line(&report.reconstruction)))?;
    print::line(format_args!("{}", report.method))?;
    let enhancement = &report.enhancement;
    print::line(format_args!("at 64 x 64, Lanczos: {}", quality_line(&enhancement.upscaled)))?;
    print::line(format_args!("enlarged by network: {}", quality_line(&enhancement.fused)))?;
    print::line(format_args!(
        "deblurred:           {} (blur {}, noise {:.4} estimated, inconsistency {:.2})",
        quality_line(&enhancement.deblurred),
        enhancement.blur_line(),
        enhancement.noise,
        enhancement.inconsistency
    ))?;
    print::line(enhancement.trust_line())?;
    for warning in &enhancement.warnings {
        print::line(format_args!("warning: {warning}"))?;
    }
    print::notes(&report.notes)?;
    print::line(format_args!("look at {}", args.out.join("side_by_side.png").display()))
}

fn quality_line(quality: &Quality) -> String {
    format!("PSNR {:.2} dB, SSIM {:.3}", quality.psnr_db, quality.ssim)
}

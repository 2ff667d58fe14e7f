//! `nirspi demo`: the whole camera on a simulated scene, from light to picture.

use super::camera::{LIGHT_HELP, Rain, SceneArgs, SetupArgs, exposure};
use super::method::MethodArgs;
use super::print;
use super::progress::Progress;
use super::provenance;
use super::report::{FigureArgs, ReportArgs, StageTimes, stages, words};
use anyhow::{Context, Result};
use nirspi::account::LossCounters;
use nirspi::exposure::{Length, Light};
use nirspi::files::image::encode_grey;
use nirspi::files::measurement::encode as encode_measurement;
use nirspi::files::npy;
use nirspi::files::output::OutputDir;
use nirspi::identity::CameraIdentity;
use nirspi::imaging::{MethodReport, Quality, score};
use nirspi::picture::Pictures;
use nirspi::setup::MeasurementSetup;
use nirspi_recon::words::{count, count_of};
use nirspi_recon::{Image, Measurements, Sampling};
use nirspi_virtual::{
    Bench, CameraModel, Panels, SCENE_PX, Seen, SeenImage, Shown, Stages, StagesReport,
};
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

/// Show the paper's chain on a simulated scene; no camera is needed
///
/// The chain of the paper: heavy rain between camera and scene, half of the patterns, OMP, fusion with depth, deblurring by a
/// diffusion network; the plain inverse transform stands beside the result. The light is simulated; the gateware is its
/// bit-exact model; firmware logic and wire protocol are those of a real camera. The program calibrates the virtual camera
/// against a white sheet, and measures a white sheet in place of the scene: every image is in shares of that white, as it is,
/// with its noise. Scores compare an image with the scene after a fit of gain and offset, which stands beside them; no image
/// is fitted. The command writes the scene and the image of every stage as PNG and NPY, side_by_side.png (and .svg, .pdf), report.json, and
/// measurement.npz.
///
/// A capture that loses frames ends with exit code 1, and nothing is written.
#[derive(Debug, clap::Args)]
#[command(mut_arg("method", |method| method.default_value("omp")))]
#[command(mut_arg("rain", |rain| rain.help(RAIN_HELP).long_help(RAIN_HELP)))]
#[command(after_help = "Examples:\n\
    \x20 nirspi demo --scene letter:R --out demo/\n\
    \x20 nirspi demo --scene word:STOP --rain none --method tv --sampling 25% --light 50ms --out stop/")]
pub struct Args {
    #[command(flatten)]
    scene: SceneArgs,
    /// Frames to measure, in place of --light; the image is made from their sum
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    frames: Option<u32>,
    #[arg(long, value_name = "TIME", conflicts_with = "frames", allow_hyphen_values = true,
          help = format!("{LIGHT_HELP} [default: what the camera description says; 20ms for the paper's camera]"))]
    light: Option<Light>,
    #[command(flatten)]
    setup: SetupArgs,
    #[command(flatten)]
    method: MethodArgs,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "demo")]
    out: PathBuf,
    /// Images of side_by_side.png, in this order [default: all]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = words(&Shown::ALL, Shown::named))]
    panels: Vec<Shown>,
    #[command(flatten)]
    figure: FigureArgs,
    #[command(flatten)]
    report: ReportArgs,
}

const RAIN_HELP: &str = "Rain between the virtual camera and the target, as in the paper's Table 2: light is 1.93 mm/h of \
                         0.5 mm drops, heavy 5.6 mm/h of 2 mm drops [default: what the camera description says; heavy if it \
                         says dry air]";

impl Args {
    /// The scene in the paper's weather, unless the user or the camera description says another.
    fn scene(&self, model: &CameraModel) -> SceneArgs {
        let said = self.scene.rain.is_some() || self.scene.weather.weather.is_some();
        let rain = match said || !model.weather.air.is_clear() {
            true => self.scene.rain,
            false => Some(Rain::Heavy),
        };
        SceneArgs { rain, ..self.scene.clone() }
    }

    /// How long to measure.
    fn length(&self, model: &CameraModel) -> Result<Length> {
        let readout = model.readout;
        Ok(match (self.light, self.frames) {
            (_, Some(frames)) => Length::Frames(frames, self.setup.sweeps),
            (Some(light), None) => Length::Light(light, self.setup.sweeps),
            (None, None) => {
                let (sweeps, clocks) = (readout.sweeps_per_picture, readout.clocks_per_pattern);
                Length::Light(Light::of_full_sweeps(sweeps, clocks)?, self.setup.sweeps)
            }
        })
    }
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
    /// Sweeps summed into each frame.
    sweeps: u32,
    /// The time of light.
    acquisition_ms: f64,
    /// ADC counts of a pixel that sees the white sheet: 1 in every image.
    white_counts: f32,
    frames: LossCounters,
    adc_latency_clocks: u8,
    leak_taps: Vec<f64>,
    /// Row and column of dead LEDs found by the flat field; `null` if all LEDs are alike and no
    /// flat field was measured.
    dead_leds: Option<Vec<[u8; 2]>>,
    /// Plain inverse transform of the same measurements.
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
    args.method.check(false)?;
    OutputDir::create(&args.out)?.check(["scene.png", "truth.npy", "report.json"])?;
    let described = args.scene.model.read()?;
    let scene = args.scene(&described);
    let setup = args.setup.setup(Sampling::HALF, &scene.model)?;
    let exposure = exposure(args.length(&described)?, &setup)?;
    let setup = MeasurementSetup { sweeps: exposure.sweeps, ..setup };
    let mut times = stages();
    let (map, optics) = times.time("scene", || scene.optics())?;
    let seed = scene.seed;
    let bench = Bench { optics, setup, frames: exposure.frames, seed };
    let calibrated = bench.calibrated(&mut times)?;
    let bar = Progress::of("capture", exposure.frames, "frames");
    let seen = calibrated.capture(&mut times, &mut bar.watch())?;
    drop(bar);
    let Seen { bench: Bench { optics, .. }, shot, measurements, notes, flat_field, white } = &seen;
    let model = optics.camera_model();
    let camera = shot.session.identity().clone();
    let captured = &shot.capture;
    let mut notes = notes.clone();
    let setup = &captured.setup;
    let leak = captured.settling.as_ref().map(|s| s.leak(setup.clocks_per_pattern, setup.blanked));
    let leak = leak.transpose()?;
    let raw = times.time("inverse_transform", || seen.plain_transform());
    let settings = args.method.settings_for(measurements.side().into())?;
    let image = times.time("reconstruct", || seen.reconstruct(args.method.method, &settings));
    let image = match &args.method.dictionary {
        Some(path) => image.with_context(|| path.display().to_string())?,
        None => image?,
    };
    let truth = optics.focused_footprint()?.weights().to_vec();
    let (raw_quality, quality) = (score(&raw, &truth)?, score(&image.image, &truth)?);
    let stages = seen.enhance(&image, &mut times)?;
    let SeenImage { image, report: method, .. } = image;
    if quality.inverted {
        notes.push(
            "the image is darker where the scene is brighter: it is scored as blank".to_owned(),
        );
    }
    notes.extend(quality.no_psnr.map(|why| format!("no PSNR: {why}")));
    let acquisition_ms = exposure.light_ms(setup);
    let rain = scene.air(model)?.name().to_owned();
    let in_field = optics.focused(SCENE_PX);
    let panels = Panels {
        map: &map,
        in_field: &in_field,
        optics,
        capture: captured,
        acquisition_ms,
        rain: &rain,
        seed,
        truth: &truth,
        raw: (&raw, &raw_quality),
        result: (&image, &quality),
        method: &method,
        stages: &stages,
    };
    let provenance = provenance::of_camera(&camera);
    let pictures = panels.pictures(&args.panels, args.figure.figure, &provenance);
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
        sweeps: setup.sweeps,
        acquisition_ms,
        white_counts: *white,
        frames: captured.counters,
        adc_latency_clocks: setup.adc_latency,
        leak_taps: leak.map(|leak| leak.taps().to_vec()).unwrap_or_default(),
        dead_leds: flat_field.as_ref().map(|flat| flat.dead_leds().to_vec()),
        raw: raw_quality,
        reconstruction: quality,
        quality_note: "against the scene on the 32 x 32 LED grid without defocus; PSNR and SSIM after the gain and \
                       offset of least squares, which stand under fit; the images are not fitted",
        enhancement: &stages.report,
        method,
        notes,
        pictures,
        stage_ms: times,
    };
    let images = Images { in_field, truth, raw, image, measurements, stages: &stages };
    write(args, &images, &report)?;
    args.report.print(&report, &provenance, |report| say(args, report))
}

/// The images of the report's stages. Images of the camera are in shares of the white sheet.
struct Images<'a> {
    in_field: Vec<f32>,
    truth: Vec<f32>,
    raw: Image,
    image: Image,
    measurements: &'a Measurements,
    stages: &'a Stages,
}

fn write(args: &Args, images: &Images, report: &Report) -> Result<()> {
    let stages = images.stages;
    let side = images.measurements.rows().side().pixels();
    let grid = [side, side];
    let provenance = report.pictures.provenance();
    let mut out = OutputDir::create(&args.out)?;
    let scene = &images.in_field;
    out.write("scene.png", &encode_grey(SCENE_PX, SCENE_PX, scene, provenance))?;
    out.write("scene.npy", &npy::encode(&[SCENE_PX, SCENE_PX], scene))?;
    out.write("truth.npy", &npy::encode(&grid, &images.truth))?;
    out.write("raw.npy", &npy::encode(&grid, images.raw.pixels()))?;
    out.write("reconstruction.npy", &npy::encode(&grid, images.image.pixels()))?;
    // The input of `enhance` and `reconstruct`.
    let measurement = args.out.join("measurement.npz");
    let measured = encode_measurement(&measurement, images.measurements, provenance)?;
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
        "{} at {} m, weather {}: {} of {} of {}, {:.1} ms of (simulated) light",
        report.scene,
        report.distance_m,
        report.rain,
        count(report.frames.received, "frame"),
        count(report.sweeps, "sweep"),
        count_of(report.patterns, "pattern"),
        report.acquisition_ms
    ))?;
    print::line(format_args!("frames: {}", report.frames))?;
    print::line(grid_line(32, &report.reconstruction))?;
    print::line(format_args!("  plain transform:     {}", report.raw))?;
    print::line(format_args!("  result:              {}", report.reconstruction))?;
    print::line(format_args!("  {}", report.method))?;
    let enhancement = &report.enhancement;
    print::line(grid_line(64, &enhancement.deblurred))?;
    print::line(format_args!("  Lanczos:             {}", enhancement.upscaled))?;
    print::line(format_args!("  enlarged by network: {}", enhancement.fused))?;
    print::line(format_args!("  deblurred:           {}", enhancement.deblurred))?;
    print::line(format_args!(
        "  blur {}, noise {:.4} estimated, inconsistency {:.2}",
        enhancement.blur_line(),
        enhancement.noise,
        enhancement.inconsistency
    ))?;
    print::line(enhancement.uncertainty_line())?;
    for warning in &enhancement.warnings {
        print::warning(warning);
    }
    print::notes(&report.notes)?;
    print::line(format_args!("look at {}", args.out.join("side_by_side.png").display()))
}

/// What the scores below this line compare with.
fn grid_line(side: usize, quality: &Quality) -> String {
    let blank = quality
        .blank_db()
        .map(|blank_db| format!(", where a blank picture has {blank_db:.2} dB"))
        .unwrap_or_default();
    format!("against the scene on the {side} x {side} grid{blank}:")
}

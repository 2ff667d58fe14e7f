//! `nirspi camera model`: evaluates or prints a camera description.

use super::print;
use super::report::ReportArgs;
use anyhow::Result;
use nirspi_eval::camera_model::{Report, camera_model};
use nirspi_virtual::read_camera_model;
use std::process::ExitCode;

/// Say what follows from a camera description: field, light, noise, eye safety; or print the description
///
/// A description is a TOML file. It needs only the keys that differ from the paper's camera, or from the camera that it names
/// as `basis`. Every command that simulates takes one: --camera-model NAME or FILE.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi camera model one-metre\n\
    \x20 nirspi camera model paper --print > lab.toml\n\
    \x20 nirspi demo --camera-model lab.toml --out demo/")]
pub struct Args {
    /// paper, fga015, one-metre or a TOML file
    #[arg(value_name = "NAME|FILE", default_value = "paper")]
    camera_model: String,
    /// Print the whole description as TOML
    #[arg(long, conflicts_with = "json")]
    print: bool,
    #[command(flatten)]
    report: ReportArgs,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let camera = read_camera_model(&args.camera_model)?;
    if args.print {
        let remarked = camera_with_remarks(&args.camera_model);
        print::line(remarked.map_or_else(|| camera.to_toml(), str::to_owned).trim_end())?;
        return Ok(ExitCode::SUCCESS);
    }
    let report = camera_model(&camera)?;
    args.report.print_answer(&report, say)
}

/// The shipped file of this name, if the file is complete. Other shipped files have only the
/// differences.
fn camera_with_remarks(name: &str) -> Option<&'static str> {
    nirspi_virtual::CameraModel::shipped_text(name).filter(|text| !text.contains("\nbasis"))
}

fn say(report: &Report) -> Result<()> {
    print::line(format_args!("camera {} (simulated)", report.camera))?;
    print::line(format_args!(
        "one picture: {} sweeps of {:.2} µs, {:.1} ms of light",
        report.sweeps, report.sweep_us, report.picture_ms
    ))?;
    print::line(format_args!(
        "detector: {:.3} electrons a photon; amplifier: {:.2} pA/sqrt(Hz), needs a gain-bandwidth product of {:.2} GHz",
        report.quantum_efficiency, report.amplifier_noise_pa_per_sqrt_hz, report.gain_bandwidth_ghz
    ))?;
    print::line(
        "distance  field mm  pixel mm  defocus mm  line at 10 % mm  light of one LED e/sample  SNR of a white pixel",
    )?;
    for at in &report.distances {
        print::line(format_args!(
            "{:6.2} m  {:8.1}  {:8.2}  {:10.1}  {:>15}  {:25.2}  {:20.1}",
            at.distance_m,
            at.field_mm,
            at.pixel_mm,
            at.defocus_mm,
            at.line_mm.map_or_else(|| "none".to_owned(), |mm| format!("{mm:.2}")),
            at.electrons_per_led,
            at.picture_snr
        ))?;
    }
    if report.first_pixel_off.abs() >= 0.005 {
        print::line(format_args!(
            "LEDs: rise and fall differ. Pixel (0, 0) of a white sheet would read {:.2} of white if the pattern came first in \
             every pair; sweeps that alternate cancel this",
            1.0 + report.first_pixel_off
        ))?;
    }
    let eyes = report.eye_safety.map(|light| format!("{light} (more: nirspi camera safety)"));
    let refused = || report.eye_safety_refused.as_ref().map(|why| format!("refused: {why}"));
    eyes.or_else(refused).iter().try_for_each(|eyes| print::line(format_args!("eyes: {eyes}")))
}

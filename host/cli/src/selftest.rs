//! `nirspi camera selftest`: checks a camera end to end, and keeps its calibration.

use super::camera::{CameraArgs, SceneArgs};
use super::progress::Progress;
use super::report::ReportArgs;
use super::{address, print, provenance};
use anyhow::{Result, bail};
use nirspi::calibration::KeptCalibration;
use nirspi::check::{Check, Verdict};
use nirspi::identity::CameraIdentity;
use nirspi::selftest::{LinkDemands, STAGES, SelfTest, run as test};
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::{Duration, SystemTime};

/// Duration of each of the two measurements of the link.
const LINK_DURATION: Duration = Duration::from_secs(1);

/// Check a camera from its LEDs to this program, and keep its calibration
///
/// Point the camera at something bright and evenly lit, such as white paper. `nirspi capture` then uses the calibration.
/// The exit code is 1 if a check has failed.
#[derive(Debug, clap::Args)]
#[command(mut_arg("scene", |scene| scene.default_value("white")))]
#[command(after_help = "Examples:\n\
    \x20 nirspi camera selftest --camera usb\n\
    \x20 nirspi camera selftest --camera virtual --json")]
pub struct Args {
    #[command(flatten)]
    camera: CameraArgs,
    /// Keep the calibration in this file [default: a file for the camera's serial number in the user's data directory]
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
    #[command(flatten)]
    scene: SceneArgs,
    #[command(flatten)]
    report: ReportArgs,
}

#[derive(Debug, Serialize)]
struct Report<'r> {
    camera: &'r CameraIdentity,
    passed: bool,
    checks: &'r [Check],
    /// The file of the calibration; `null` if there was no calibration to keep.
    calibration: Option<PathBuf>,
    measured: Option<String>,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let address = args.camera.address(args.report.json)?;
    let mut session = address::open(&address, &args.scene)?;
    let camera = session.identity().clone();
    let bar = Progress::of("self-test", STAGES.len(), "stages");
    let demands =
        LinkDemands { min_frames_per_s: address.min_frames_per_s(), duration: LINK_DURATION };
    let found = test(&mut session, demands, &mut |stage| {
        bar.set(stage + 1);
        bar.say(STAGES.get(stage).copied().unwrap_or_default());
    });
    drop(bar);
    let found = found?;
    let kept = keep(args, &camera, &found)?;
    let report = Report {
        camera: &camera,
        passed: found.passed(),
        checks: &found.checks,
        measured: kept.as_ref().map(|(kept, _)| kept.measured()),
        calibration: kept.map(|(_, path)| path),
    };
    args.report.print(&report, &provenance::of_camera(&camera), say)?;
    let failed = report.checks.iter().filter(|check| check.verdict() == Verdict::Failed);
    let failed: Vec<_> = failed.map(Check::name).collect();
    match failed.is_empty() {
        true => Ok(ExitCode::SUCCESS),
        false => bail!("the self-test failed: {}", failed.join(", ")),
    }
}

/// Keeps the calibration of a camera that has passed. A camera with a fault cannot measure itself
/// reliably.
fn keep(
    args: &Args,
    camera: &CameraIdentity,
    found: &SelfTest,
) -> Result<Option<(KeptCalibration, PathBuf)>> {
    let Some(settling) = found.settling.clone().filter(|_| found.passed()) else { return Ok(None) };
    let now = SystemTime::now();
    let kept = KeptCalibration::new(camera.clone(), settling, found.checks.clone(), now);
    let path = kept.keep(args.calibration.as_deref())?;
    Ok(Some((kept, path)))
}

fn say(report: &Report<'_>) -> Result<()> {
    print::line(format_args!("{} {}", report.camera.board, report.camera.serial))?;
    let widest = |column: &dyn Fn(&Check) -> usize| report.checks.iter().map(column).max();
    let name = widest(&|check| check.name().chars().count()).unwrap_or(0);
    let value = widest(&|check| check.value_in_words().chars().count()).unwrap_or(0);
    let limit = widest(&|check| check.limit_in_words().chars().count()).unwrap_or(0);
    for check in report.checks {
        let verdict = match check.verdict() {
            Verdict::Passed => "ok",
            Verdict::Failed => "FAIL",
            Verdict::Skipped => "-",
        };
        let line = format!(
            "{verdict:<4}  {:<name$}  {:<value$}  {:<limit$}  {}",
            check.name(),
            check.value_in_words(),
            check.limit_in_words(),
            check.note(),
        );
        print::line(line.trim_end())?;
    }
    match (&report.calibration, &report.measured) {
        (Some(path), Some(measured)) => {
            print::line(format_args!("calibration of {measured} kept in {}", path.display()))
        }
        _ if report.passed => {
            print::line("no calibration kept: the burst did not show the latency")
        }
        _ => print::line("no calibration kept: the self-test failed"),
    }
}

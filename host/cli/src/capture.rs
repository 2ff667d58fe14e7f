//! `nirspi capture`: records a camera, with an account of every frame.

use super::address::{self, CameraAddress};
use super::calibration::CalibrationArgs;
use super::camera::{SceneArgs, SetupArgs};
use super::{Usage, print, serve_virtual::stop_on_signal};
use anyhow::Result;
use indicatif::{ProgressBar, ProgressStyle};
use nirspi::account::LossCounters;
use nirspi::calibration::{Choice, Origin};
use nirspi::capture::{Capture, CaptureOptions, Ended, Progress, capture};
use nirspi::causes;
use nirspi::recording::Target;
use nirspi::session::CameraIdentity;
use serde::Serialize;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;

/// Record frames of a camera into an MCAP file
///
/// ADC latency and settling are those that `nirspi calibrate` or `nirspi selftest` has kept for this camera. If none are
/// kept, they are measured first, on the scene; a scene too dim for that ends the command. Ctrl-C ends the recording and
/// keeps it. The exit code is 0 only if nothing is missing: all N frames, or all that were made until Ctrl-C, came whole,
/// and no fault stands. Otherwise one line says what is missing, the recording is kept, and the exit code is 1.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi capture --camera usb --frames 1000 --out rec.mcap --picture seen/\n\
    \x20 nirspi capture --camera tcp:127.0.0.1:1550 --frames 1000 --out rec.mcap")]
pub struct Args {
    /// Which camera: virtual, usb, usb:SERIAL, tcp:HOST:PORT or serial:PATH[:BAUD]
    #[arg(long, value_name = "CAMERA", default_value = "virtual")]
    camera: CameraAddress,
    /// Frames to record; without it, until Ctrl-C
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    frames: Option<u32>,
    /// File to record into; default: the first free one of capture-1.mcap, capture-2.mcap ...
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Replace the file if it is there, when the new recording is whole; until then the new one is beside it, as
    /// NAME.new.mcap
    #[arg(long)]
    overwrite: bool,
    #[command(flatten)]
    calibration: CalibrationArgs,
    /// When it has ended, reconstruct the frames as one image, enlarge and deblur it, into this folder; the same as
    /// `reconstruct --enhance`
    #[arg(long, value_name = "DIR")]
    picture: Option<PathBuf>,
    #[command(flatten)]
    setup: SetupArgs,
    #[command(flatten)]
    scene: SceneArgs,
    /// Print a JSON report
    #[arg(long)]
    json: bool,
}

#[derive(Debug, Serialize)]
struct Report<'r> {
    camera: &'r CameraIdentity,
    recording: &'r Path,
    bytes: u64,
    frames: LossCounters,
    /// As counted by the camera; `null` if the camera disconnected before it reported.
    made: Option<u64>,
    damaged_packets: u64,
    unknown_packets: u64,
    repeated: u64,
    /// Frames requested; `null` for a run until Ctrl-C.
    asked: Option<u32>,
    ended: &'static str,
    complete: bool,
    /// What the capture lacks; `null` if nothing is missing.
    missing: Option<String>,
    seconds: f64,
    frames_per_s: f64,
    adc_latency_clocks: u8,
    calibrated: bool,
    /// Time and file of the kept calibration; `null` if none was used.
    calibration: Option<Origin>,
    /// Why a kept calibration was not used.
    #[serde(skip_serializing_if = "Option::is_none")]
    calibration_note: Option<&'r str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    calibration_problem: Option<String>,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let mut setup = args.setup.setup(1.0, &args.scene.model)?;
    setup.adc_latency = args.calibration.adc_latency();
    let target = target(args)?;
    let stop = stop_on_signal()?;
    let mut session = address::open(&args.camera, &args.scene)?;
    let choice = args.calibration.choose(&setup, session.identity())?;
    let options = CaptureOptions {
        setup,
        frames: args.frames,
        calibration: choice.calibration.clone(),
        record: Some(target),
    };
    let bar = progress_bar(args.frames);
    let captured = capture(&mut session, &options, &mut |progress: &Progress| {
        bar.set_position(progress.counters.total());
        bar.set_message(progress.counters.to_string());
        if stop.load(Ordering::Relaxed) {
            ControlFlow::Break(())
        } else {
            ControlFlow::Continue(())
        }
    });
    bar.finish_and_clear();
    let captured = captured?;
    let path = captured.recording.as_deref().unwrap_or(Path::new(""));
    let code = report(args, session.identity(), path, &choice, &captured)?;
    if let Some(out) = args.picture.as_ref().filter(|_| captured.counters.received > 0) {
        let warnings =
            super::reconstruct::picture(&captured, choice.flat_field.clone(), path, out)?;
        for warning in warnings {
            print::complain(format_args!("warning: {warning}"));
        }
        if !args.json {
            print::line(format_args!("picture: {}", out.join("enhanced.png").display()))?;
        }
    }
    Ok(code)
}

/// Where to record. A name that is taken is refused before the camera is asked for anything.
fn target(args: &Args) -> Result<Target> {
    Ok(match &args.out {
        Some(path) if args.overwrite => Target::Replace(path.clone()),
        Some(path) if path.exists() => {
            let path = path.display();
            let advice = "choose another name or add --overwrite";
            return Err(Usage(format!("--out {path} is there already: {advice}")).into());
        }
        Some(path) => Target::New(path.clone()),
        None => Target::FirstFree(PathBuf::new()),
    })
}

fn progress_bar(frames: Option<u32>) -> ProgressBar {
    let template = match frames {
        Some(_) => "{bar:30} {pos}/{len} frames  {per_sec}  {msg}",
        None => "{spinner} {pos} frames  {per_sec}  {msg}",
    };
    let style =
        ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(frames.map_or(0, u64::from)).with_style(style)
}

fn report(
    args: &Args,
    camera: &CameraIdentity,
    path: &Path,
    choice: &Choice,
    captured: &Capture,
) -> Result<ExitCode> {
    let counters = captured.counters;
    let seconds = captured.elapsed.as_secs_f64();
    let missing = captured.missing();
    let ended = match captured.ended {
        Ended::Complete => "all frames made",
        Ended::Stopped => "stopped by the user",
        Ended::Fault(_) => "the camera switched its LEDs off",
        Ended::WrongNumber { .. } => "the camera made another number of frames",
        Ended::Unconfirmed(_) => "the camera did not say whether a fault stands",
        Ended::Junk { .. } => "too much of what came was damaged or of other runs",
        Ended::LinkLost(_) => "the link to the camera was lost",
    };
    let report = Report {
        camera,
        recording: path,
        bytes: std::fs::metadata(path)?.len(),
        frames: counters,
        made: captured.made,
        damaged_packets: captured.damaged_packets,
        unknown_packets: captured.unknown_packets,
        repeated: captured.repeated,
        asked: captured.asked,
        ended,
        complete: missing.is_none(),
        missing,
        seconds,
        frames_per_s: counters.received as f64 / seconds,
        adc_latency_clocks: captured.setup.adc_latency,
        calibrated: captured.settling.is_some(),
        calibration: choice.used(captured).cloned(),
        calibration_note: choice.note.as_deref(),
        calibration_problem: captured.calibration_problem.as_ref().map(|p| causes::in_one_line(p)),
    };
    if args.json {
        print::json(&report)?;
    } else {
        if let Some(note) = &choice.note {
            print::line(note)?;
        }
        if captured.unknown_packets > 0 {
            let count = captured.unknown_packets;
            print::line(format_args!(
                "the camera sent {count} messages that this program does not know: update the program"
            ))?;
        }
        if let Some(Origin { measured, file }) = &report.calibration {
            print::line(format_args!("calibration of {measured}, {}", file.display()))?;
        }
        if let Some(problem) = &report.calibration_problem {
            print::line(format_args!("the kept calibration is used: {problem}"))?;
        }
        match report.made {
            Some(made) => print::line(format_args!("{counters}: {made} frames made"))?,
            None => print::line(counters)?,
        }
        print::line(format_args!(
            "{:.0} frames/s over {seconds:.2} s, {:.1} MB in {}",
            report.frames_per_s,
            report.bytes as f64 / 1e6,
            path.display()
        ))?;
    }
    if let Some(missing) = &report.missing {
        let (received, path) = (counters.received, path.display());
        print::complain(format_args!("{missing}; {received} received frames are kept in {path}"));
        return Ok(ExitCode::FAILURE);
    }
    Ok(ExitCode::SUCCESS)
}

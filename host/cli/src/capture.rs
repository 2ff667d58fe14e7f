//! `nirspi capture`: records a camera, with an account of every frame.

use super::calibration::CalibrationArgs;
use super::camera::{self, CameraArgs, LIGHT_HELP, SceneArgs, SetupArgs};
use super::report::{FigureArgs, ReportArgs};
use super::{Usage, address, print, progress, provenance};
use anyhow::Result;
use nirspi::capture::{
    CaptureOptions, CaptureReport, Origin, Preview, Progress, Record, Seconds, StopCause, observe,
};
use nirspi::exposure::Light;
use nirspi::files::interrupt;
use nirspi::files::output::refuse_dash;
use nirspi::picture::half_blocks;
use nirspi::recording::{Split, Target};
use nirspi::source::Source;
use nirspi_recon::words::count;
use nirspi_recon::{Image, Sampling};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::Ordering;

/// Record frames of a camera, each accounted for
///
/// The command uses the ADC latency and the settling that `nirspi camera calibrate` or `nirspi camera selftest` saved for this camera. If
/// none are saved, the command measures them on the scene first. If the scene is too dark for this, the command ends with an
/// error.
///
/// Ctrl-C ends the recording and keeps its frames. If the terminal closes or the system ends the program, the frames are kept
/// too, the recording says what ended it, and the exit code is 1. `nohup nirspi capture` continues after its terminal closes.
///
/// On a terminal with colours, the command shows a small image of the newest frames. --quiet and NO_COLOR switch this image
/// off.
///
/// With --camera feed:ADDR, the command records the live readings of any other bench into a measurement file (.npz), which
/// `nirspi reconstruct FILE --index all` opens: docs/feeds.md.
///
/// The exit code is 0 only if every frame arrived intact and the camera reports no fault. Otherwise one line says what is
/// missing, the frames are kept, and the exit code is 1.
#[derive(Debug, clap::Args)]
#[command(mut_arg("sampling", |sampling| sampling.help(SAMPLING_HELP).long_help(SAMPLING_HELP)))]
#[command(after_help = "Examples:\n\
    \x20 nirspi capture --camera usb --frames 1000 --out rec.mcap --picture seen/\n\
    \x20 nirspi capture --camera tcp:127.0.0.1:1550 --frames 1000 --out rec.mcap\n\
    \x20 nirspi capture --camera feed:127.0.0.1:5025 --frames 1000 --out rec.npz")]
pub struct Args {
    #[command(flatten)]
    pub(super) camera: CameraArgs,
    #[command(flatten)]
    calibration: CalibrationArgs,
    /// Frames to measure [default: until Ctrl-C]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) frames: Option<u32>,
    #[arg(long, value_name = "TIME", conflicts_with = "frames", allow_hyphen_values = true, help = LIGHT_HELP)]
    light: Option<Light>,
    /// Seconds to measure, not counting the calibration. A recording that ends after this time is complete
    #[arg(long, value_name = "S", conflicts_with_all = ["frames", "light"], allow_hyphen_values = true)]
    pub(super) seconds: Option<Seconds>,
    #[command(flatten)]
    setup: SetupArgs,
    #[command(flatten)]
    scene: SceneArgs,
    /// File to record into [default: the first of capture-1.mcap, capture-2.mcap, ... that does not exist; of a feed, .npz]
    #[arg(long, value_name = "FILE")]
    pub(super) out: Option<PathBuf>,
    /// Replace an existing file. The existing file stays until the new recording is complete. Until then the new recording is
    /// NAME.new.mcap in the same folder
    #[arg(long)]
    pub(super) overwrite: bool,
    /// Record into several files, NAME-0001.mcap, NAME-0002.mcap and so on. The next file begins before a file is larger than a
    /// size (500MB, 2GB) or after a time (90s, 10min, 1h). Each file is a complete recording. None of the names may exist
    #[arg(
        long,
        value_name = "SIZE|TIME",
        conflicts_with = "overwrite",
        allow_hyphen_values = true
    )]
    split: Option<Split>,
    /// After the recording, make an image of its frames, enlarge and deblur the image, and write both into this folder, as
    /// `nirspi reconstruct --enhance` does. Of a feed, images of 32 x 32 and 64 x 64 are enlarged and deblurred
    #[arg(long, value_name = "DIR")]
    pub(super) picture: Option<PathBuf>,
    #[command(flatten)]
    pub(super) figure: FigureArgs,
    #[command(flatten)]
    pub(super) report: ReportArgs,
}

const SAMPLING_HELP: &str = "Share of all patterns to show, the first of the order: 0.3 or 30% [default: 1, because a \
                             recording can be reconstructed from fewer patterns later]";

/// Records the frames of a camera.
pub fn run(args: &Args) -> Result<ExitCode> {
    let mut setup = args.setup.setup(Sampling::ALL, &args.scene.model)?;
    setup.adc_latency = args.calibration.adc_latency();
    let mut frames = args.frames;
    if let Some(light) = args.light {
        if args.camera.is_replay() {
            let why = "a recording has its own frames, use --frames";
            return Err(Usage(format!("--light with --camera replay: {why}")).into());
        }
        let exposure = args.setup.exposure(light, &setup)?;
        (frames, setup.sweeps) = (Some(exposure.frames), exposure.sweeps);
    }
    let target = target(args)?;
    let seconds = args.seconds;
    let stop = interrupt::stop_flag();
    let (address, note) = args.camera.address_and_note()?;
    let mut session = address::open(&address, &args.scene)?;
    let choice = args.calibration.choose(&setup, session.identity())?;
    camera::say(note, args.report.json)?;
    let options = CaptureOptions {
        setup,
        frames,
        calibration: choice.calibration.clone(),
        record: Some(Record { target, made: provenance::made().clone() }),
    };
    let bar = progress::Progress::new("capture", frames.map(u64::from), "frames");
    let mut seen = String::new();
    let watch = |progress: &Progress, image: Option<Image>| {
        if let (Some(image), Some(tones)) = (image, bar.tones()) {
            seen = format!("\n{}", half_blocks(&image, tones).join("\n"));
        }
        bar.set(progress.counters.total());
        bar.say(format!("{}{seen}", progress.counters));
        if stop.load(Ordering::Relaxed) {
            return ControlFlow::Break(StopCause::of_program());
        }
        seconds.map_or(ControlFlow::Continue(()), |seconds| seconds.watch(progress))
    };
    let mut preview = Preview::new(watch);
    let captured = observe(&mut session, &options, &mut preview);
    drop(bar);
    if let Err(error) = &captured
        && args.report.json
        && let Some(report) = CaptureReport::of_cut(session.identity(), &choice, error)?
    {
        print::json(&report, &provenance::of_camera(report.camera))?;
    }
    let captured = captured?;
    let path = captured.recording.as_deref().unwrap_or(Path::new(""));
    let report = CaptureReport::new(session.identity(), &choice, &captured)?;
    let code = say(args, &report)?;
    if let Some(out) = args.picture.as_ref().filter(|_| captured.counters.received > 0) {
        let mut source = Source::of_capture(&captured)?;
        if let Some(kept) = choice.flat_field.clone() {
            source = source.with_flat_field(kept);
        }
        super::reconstruct::picture(source, path, out, args.figure, args.report.json)?;
    }
    Ok(code)
}

/// Where to record. A name that is taken is refused before the camera is asked for anything.
fn target(args: &Args) -> Result<Target> {
    args.out.as_deref().map_or(Ok(()), refuse_dash)?;
    let target = match (&args.out, args.split) {
        (Some(path), Some(split)) => Target::Parts(path.clone(), split),
        (None, Some(split)) => Target::FirstFreeParts(PathBuf::new(), split),
        (Some(path), None) if args.overwrite => Target::Replace(path.clone()),
        (Some(path), None) => Target::New(path.clone()),
        (None, None) => Target::FirstFree(PathBuf::new()),
    };
    match target.taken() {
        None => Ok(target),
        Some(taken) => {
            let or = if args.split.is_some() { "" } else { " or add --overwrite" };
            let taken = taken.display();
            let problem = format!("--out {taken} is there already: choose another name{or}");
            Err(Usage(problem).into())
        }
    }
}

/// The files of a recording, as `rec.mcap` or `rec-0001.mcap to rec-0003.mcap`.
fn names(files: &[PathBuf]) -> String {
    match files {
        [] => String::new(),
        [file] => file.display().to_string(),
        [first, .., last] => {
            let name = Path::new(last.file_name().unwrap_or_default()).display();
            format!("{} to {name} ({} files)", first.display(), files.len())
        }
    }
}

fn say(args: &Args, report: &CaptureReport<'_>) -> Result<ExitCode> {
    let (frames, path) = (report.frames, names(report.files));
    args.report.print(report, &provenance::of_camera(report.camera), |report| {
        if let Some(note) = report.calibration_note {
            print::note(note)?;
        }
        if report.unknown_packets > 0 {
            let messages = count(report.unknown_packets, "message");
            print::line(format_args!(
                "the camera sent {messages} that this program does not know: update the program"
            ))?;
        }
        if let Some(Origin { measured, file }) = &report.calibration {
            print::line(format_args!("calibration of {measured}, {}", file.display()))?;
        }
        if let Some(problem) = &report.calibration_problem {
            print::line(format_args!("the kept calibration is used: {problem}"))?;
        }
        match report.made {
            Some(made) => print::line(format_args!("{frames}: {} made", count(made, "frame")))?,
            None => print::line(frames)?,
        }
        print::line(format_args!(
            "{:.0} frames/s over {:.2} s, {:.1} MB in {path}",
            report.frames_per_s,
            report.seconds,
            report.bytes as f64 / 1e6,
        ))?;
        report.signal.iter().try_for_each(print::line)?;
        report.notes.iter().try_for_each(print::note)
    })?;
    if let Some(missing) = &report.missing {
        let received = count(frames.received, "received frame");
        print::complain(format_args!("{missing}; kept in {path}: {received}"));
        return Ok(ExitCode::FAILURE);
    }
    Ok(ExitCode::SUCCESS)
}

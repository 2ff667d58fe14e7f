//! Pictures of a letter that crosses the field: one of all light between two pictures, one of a short frame, and one of
//! short frames that are added along the letter's way.
//!
//! `cargo run --release -p nirspi-virtual --example moving [SPEED_M_PER_S [SWEEPS [SHARE]]]`. A picture counts while the letter
//! is whole in the field. PSNR is against what the LEDs see in the middle of the frame, in shares of a white sheet.

use nirspi::capture::{Calibration, CaptureOptions, Record, capture};
use nirspi::integrate::Integrated;
use nirspi::provenance::Made;
use nirspi::recording::{Recording, RecordingError, Target, hear_recording, tally_recording};
use nirspi::scene::SceneSource;
use nirspi::session::Session;
use nirspi::setup::MeasurementSetup;
use nirspi_follow::{FollowSettings, Timed, follow};
use nirspi_optics::Motion;
use nirspi_recon::reconstruct::{Method, Reconstruction};
use nirspi_recon::{Measurements, Order};
use nirspi_virtual::{CameraModel, MemoryLink, VirtualOptics, calibrate_against_white};
use std::error::Error;
use std::ops::ControlFlow;
use std::time::Instant;

const PICTURES_PER_S: f64 = 24.0;
const PICTURES: usize = 40;
const DISTANCE_MM: f64 = 300.0;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1).map(|text| text.parse::<f64>());
    let speed_m_per_s = arguments.next().transpose()?.unwrap_or(0.5);
    let sweeps = arguments.next().transpose()?.unwrap_or(36.0) as u32;
    let sampling = arguments.next().transpose()?.unwrap_or(1.0);
    let letter = SceneSource::Letter('R').load(256)?;
    let motion = Motion { speed_m_per_s, ..Motion::default() };
    let optics =
        VirtualOptics::before(CameraModel::paper(), &letter, DISTANCE_MM)?.moving(motion)?;
    let settling = calibrate_against_white(&optics, 1)?;
    let setup = optics.setup(&Order::ZigZag, sampling)?;
    let setup = MeasurementSetup { sweeps, ..setup };
    let frame_s = setup.frame_ns() * 1e-9;
    let frames_a_picture = (1.0 / PICTURES_PER_S / frame_s).round().max(1.0) as usize;
    let frames = frames_a_picture * PICTURES;
    println!(
        "{speed_m_per_s} m/s at 0.3 m: frames of {sweeps} sweeps of {} patterns, {:.2} ms and {:.2} pixels each; \
         {frames_a_picture} frames a picture",
        setup.rows.len(),
        frame_s * 1e3,
        speed_m_per_s * frame_s * 1e3 * 32.0 / optics.field_mm()
    );
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("moving.mcap");
    let options = CaptureOptions {
        setup: setup.clone(),
        frames: Some(frames as u32),
        calibration: Calibration::Kept(settling.clone()),
        record: Some(Record {
            target: Target::New(path.clone()),
            made: Made::by("moving", None, ["moving"], 0),
        }),
    };
    let mut session = Session::open(Box::new(MemoryLink::new(optics.camera(1)?)))?;
    capture(&mut session, &options, &mut |_| ControlFlow::Continue(()))?;
    let (mut sums, mut times) = (Vec::new(), Vec::new());
    hear_recording(&mut Recording::open(&path)?, |heard, _| {
        if let Some(frame) = heard.frame() {
            let mut alone = Integrated::new(&setup);
            alone.add(frame);
            sums.push(alone);
            times.push(frame.device_time_us as f64 * 1e-6);
        }
        Ok::<(), RecordingError>(())
    })?;
    let known = tally_recording(&mut Recording::open(&path)?)?.known();
    let measured: Vec<Measurements> = sums
        .iter()
        .map(|sum| sum.clone().of_run(&known).measurements(&setup, Some(&settling), false))
        .collect::<Result<_, _>>()?;
    let unit = optics.chain().electrons_per_count / optics.budget().electrons_per_led;
    let target = optics.moving_target()?;
    // A point of the letter leaves the field beyond this.
    let whole_mm = (optics.field_mm() - letter.side_mm.unwrap_or(0.0)) / 2.0;
    let psnr = |made: &Reconstruction, at: usize, shift_s: f64| {
        let seconds = times[at] + shift_s;
        let truth = target
            .as_ref()
            .map_or_else(|| optics.footprint().weights().to_vec(), |t| t.seen(seconds));
        let error = made
            .image
            .pixels()
            .iter()
            .zip(&truth)
            .map(|(a, b)| (f64::from(*a) * unit - f64::from(*b)).powi(2));
        -10.0 * (error.sum::<f64>() / 1024.0).log10()
    };
    let counts =
        |at: &usize| target.as_ref().is_none_or(|t| t.pose(times[*at]).x_mm.abs() < whole_mm + 6.0);
    let shown: Vec<usize> =
        (0..PICTURES).map(|n| n * frames_a_picture + frames_a_picture - 1).filter(counts).collect();
    let report = |name: &str, values: &[f64]| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let least = values.iter().copied().fold(f64::INFINITY, f64::min);
        println!("{name}: mean {mean:.1} dB, least {least:.1} dB, {} pictures", values.len());
    };
    let settings = nirspi_nets::prior::settings();
    // The time of a frame's packet is that of its first light; the middle is later.
    let middle = frame_s / 2.0;
    for method in [Method::TIKHONOV, Method::PRIOR] {
        let ready = method.prepare(&settings)?;
        let (mut alone, mut together) = (Vec::new(), Vec::new());
        let (mut added, mut seconds) = (0, 0.0);
        let mut before = None;
        for &at in &shown {
            alone.push(psnr(&ready.reconstruct(&measured[at])?, at, middle));
            let begun = Instant::now();
            let frames: Vec<Timed<'_>> = (at + 1 - frames_a_picture..=at)
                .map(|at| Timed { frame: &measured[at], at: times[at] / frame_s })
                .collect();
            let found = follow(&frames, &FollowSettings { before, ..FollowSettings::default() })?;
            let made = ready.reconstruct(&found.measurements)?;
            seconds += begun.elapsed().as_secs_f64();
            together.push(psnr(&made, at, middle));
            added += found.frames;
            before = Some(found.velocity_px);
        }
        let name = method.name();
        report(&format!("{name}, one frame"), &alone);
        report(&format!("{name}, frames added along the way"), &together);
        let pictures = shown.len() as f64;
        println!(
            "    {:.1} frames and {:.1} ms a picture",
            added as f64 / pictures,
            1e3 * seconds / pictures
        );
    }
    let ready = Method::PRIOR.prepare(&settings)?;
    let mut all = Vec::new();
    for &at in &shown {
        let mut sum = Integrated::new(&setup);
        let mut recording = Recording::open(&path)?;
        let mut index = 0;
        hear_recording(&mut recording, |heard, _| {
            if let Some(frame) = heard.frame() {
                if index <= at && index + frames_a_picture > at {
                    sum.add(frame);
                }
                index += 1;
            }
            Ok::<(), RecordingError>(())
        })?;
        let made = ready.reconstruct(&sum.measurements(&setup, Some(&settling), false)?)?;
        all.push(psnr(&made, at, middle - frame_s * (frames_a_picture - 1) as f64 / 2.0));
    }
    report("prior, all light between two pictures", &all);
    Ok(())
}

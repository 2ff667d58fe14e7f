//! Tests from light to image, through gateware model, firmware logic, wire protocol and host, with
//! and without faults on the way.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use nirspi::capture::{Calibration, Capture, CaptureOptions, Ended, Record, StopCause, capture};
use nirspi::integrate::Integrated;
use nirspi::link::Link;
use nirspi::provenance::Made;
use nirspi::recording::{Recording, RecordingError, Target, hear_recording, tally_recording};
use nirspi::session::{Session, SessionError};
use nirspi::setup::MeasurementSetup;
use nirspi::signal::Signal;
use nirspi::tally::FrameCount;
use nirspi_optics::{CameraModel, Scene};
use nirspi_recon::{Order, Rows, Side, fwht, metrics, reconstruct};
use nirspi_tests::tamper::{Fate, Tampered, only_frames};
use nirspi_virtual::{MemoryLink, VirtualCamera, VirtualOptics, calibrate_against_white};
use nirspi_wire::packet::MAX_DEVICE_PACKET;
use nirspi_wire::samples::Width;
use nirspi_wire::{DeviceMessage, Fault, Frame, FrameFlags, Samples, encode, open, walsh};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Duration;

const FRAMES: u32 = 6;
const PX: usize = 64;

/// A disc on a rough ground: each of the 1024 patterns has a measurement different from zero.
fn scene() -> Scene {
    let mut state = 1u32;
    let rough: Vec<f32> = (0..1024)
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 16) as f32 / 65_536.0
        })
        .collect();
    let reflectance = (0..PX * PX)
        .map(|p| {
            let (r, c) = (p / PX, p % PX);
            let disc = (r as f32 - 40.0).hypot(c as f32 - 20.0) < 10.0;
            0.5 * rough[r / 2 * 32 + c / 2] + if disc { 0.4 } else { 0.1 }
        })
        .collect();
    Scene::new(reflectance, PX, 48.0).unwrap()
}

fn optics() -> VirtualOptics {
    VirtualOptics::new(scene(), 300.0).unwrap()
}

fn recorded_to(path: &Path) -> Record {
    Record { target: Target::New(path.to_owned()), made: Made::by("a test", None, ["a test"], 0) }
}

fn options(order: &Order, calibrate: bool) -> CaptureOptions {
    let setup = MeasurementSetup::new(order, 1.0).unwrap();
    let calibration = if calibrate { Calibration::Measure } else { Calibration::None };
    CaptureOptions { setup, frames: Some(FRAMES), calibration, record: None }
}

fn run(link: Box<dyn Link>, options: &CaptureOptions) -> Capture {
    let mut session = Session::open(link).unwrap();
    capture(&mut session, options, &mut |_| ControlFlow::Continue(())).unwrap()
}

fn ideal_link() -> Box<dyn Link> {
    Box::new(MemoryLink::new(optics().ideal().camera(1).unwrap()))
}

/// Checks a capture of the ideal camera: all frames arrived, and every measurement is right to
/// within the rounding of its two readings to whole ADC counts.
fn check(captured: &Capture) -> Result<(), String> {
    let counters = captured.counters;
    if !counters.is_complete() || counters.total() != u64::from(FRAMES) {
        return Err(format!("counters: {counters}"));
    }
    let optics = optics().ideal();
    let counts = optics.budget().electrons_per_led / optics.chain().electrons_per_count;
    let mut expected: Vec<f64> =
        optics.footprint().weights().iter().map(|&w| f64::from(w) * counts).collect();
    fwht(&mut expected).unwrap();
    let measurements = captured.integrated.measurements(&captured.setup, None, true).unwrap();
    for (&row, value) in measurements.rows().iter().zip(measurements.values()) {
        let off = (value - expected[row as usize]).abs();
        if off > 1.01 {
            return Err(format!("row {row} is {off:.1} ADC counts off"));
        }
    }
    let image = reconstruct::hadamard(&measurements);
    let side = Side::INSTRUMENT.pixels();
    let correlation =
        metrics::correlation(optics.footprint().weights(), image.pixels(), side, side).unwrap();
    if correlation < 0.9999 { Err(format!("correlation {correlation}")) } else { Ok(()) }
}

#[test]
fn the_scene_comes_through_exactly_in_any_order() {
    for order in [Order::Natural, Order::Sequency, Order::CakeCutting, Order::Random(7)] {
        let captured = run(ideal_link(), &options(&order, false));
        assert!(matches!(captured.ended, Ended::Complete));
        check(&captured).unwrap_or_else(|reason| panic!("{order}: {reason}"));
    }
}

/// The widths of the samples in a recording, frame by frame.
fn widths(path: &Path) -> Vec<Width> {
    let width = |mut packet: Vec<u8>| {
        packet.pop();
        match open(&mut packet) {
            Ok(DeviceMessage::Frame(frame)) => Some(frame.samples.width()),
            _ => None,
        }
    };
    let packets = Recording::open(path).unwrap();
    packets.filter_map(|packet| width(packet.unwrap().bytes)).collect()
}

/// Sums of 171 sweeps of three samples can leave 24 bits.
#[test]
fn a_capture_whose_samples_can_leave_24_bits_has_samples_of_32() {
    let folder = tempfile::tempdir().unwrap();
    for (sweeps, expected) in [(170, Width::Bits24), (171, Width::Bits32)] {
        let path = folder.path().join(format!("{sweeps}.mcap"));
        let mut options = options(&Order::CakeCutting, false);
        options.setup = MeasurementSetup::new(&Order::CakeCutting, 0.02).unwrap();
        options.setup.sweeps = sweeps;
        options.record = Some(recorded_to(&path));
        assert!(run(ideal_link(), &options).counters.is_complete());
        assert_eq!(widths(&path), [expected; FRAMES as usize]);
    }
}

/// Runs a capture whose frame `at` meets `fate`, the others pass.
fn tampered(at: usize, fate: Fate) -> Capture {
    let judge = only_frames(move |frame| if frame == at { fate } else { Fate::Pass });
    run(Box::new(Tampered::new(ideal_link(), judge)), &options(&Order::Natural, false))
}

#[test]
fn a_frame_that_is_lost_late_or_damaged_is_counted_once_and_fails_the_check() {
    let flipped = [0, 1, 60, 128, 255].map(|share| (3, Fate::Flip(share), [0, 1, 0]));
    let others =
        [(2, Fate::Drop, [1, 0, 0]), (5, Fate::Drop, [1, 0, 0]), (1, Fate::Delay, [0, 0, 1])];
    for (at, fate, expected) in flipped.into_iter().chain(others) {
        let captured = tampered(at, fate);
        let counters = captured.counters;
        assert_eq!(counters.received, 5, "{at} {fate:?}");
        assert_eq!([counters.lost, counters.corrupt, counters.late], expected, "{at} {fate:?}");
        assert!(check(&captured).is_err(), "{at} {fate:?}");
    }
}

#[test]
fn an_unplugged_link_keeps_what_came_and_says_so() {
    let captured = tampered(3, Fate::Unplug);
    assert_eq!(captured.integrated.frames(), 3);
    let Ended::LinkLost(SessionError::Closed { mid_packet: true }) = captured.ended else {
        panic!("{:?}", captured.ended);
    };
}

#[test]
fn one_inverted_sign_of_1024_fails_the_check() {
    let optics = optics().ideal();
    // Pattern 700 has the wrong sign: its complement is shown first, then the pattern.
    let shown = [walsh::pattern(700, false), walsh::pattern(700, true)];
    let fpga = optics.fpga(1).unwrap().wired(move |array, lines| {
        let wrong = shown.contains(&(lines.rows, lines.columns));
        let rows = if wrong { !lines.rows } else { lines.rows };
        array.light(rows, lines.columns, lines.enable)
    });
    let camera = VirtualCamera::new(fpga, optics.depth(1).unwrap(), "wrong");
    let captured = run(Box::new(MemoryLink::new(camera)), &options(&Order::CakeCutting, false));
    assert!(captured.counters.is_complete());
    let reason = check(&captured).unwrap_err();
    assert!(reason.contains("ADC counts off"), "{reason}");
}

#[test]
fn two_patterns_taken_for_each_other_fail_the_check() {
    let mut captured = run(ideal_link(), &options(&Order::CakeCutting, false));
    check(&captured).unwrap();
    let mut rows = captured.setup.rows.to_vec();
    rows.swap(100, 101);
    captured.setup.rows = Rows::new(Side::INSTRUMENT, rows).unwrap();
    assert!(check(&captured).is_err());
}

#[test]
fn calibration_finds_latency_and_leak_and_undoing_them_helps() {
    let noiseless = || optics().noiseless();
    let link = Box::new(MemoryLink::new(noiseless().camera(3).unwrap()));
    let captured = run(link, &options(&Order::CakeCutting, true));
    assert!(captured.calibration_problem.is_none(), "{:?}", captured.calibration_problem);
    assert_eq!(captured.setup.adc_latency, noiseless().chain().adc_latency_clocks);

    let settling = captured.settling.as_ref();
    let leak = settling.unwrap().leak(5, 2).unwrap();
    assert!(leak.taps()[1] > 0.01, "the default chain leaks: {:?}", leak.taps());
    let footprint = noiseless().footprint().weights().to_vec();
    let side = Side::INSTRUMENT.pixels();
    let distance = |keep_leak| {
        let setup = &captured.setup;
        let measurements = captured.integrated.measurements(setup, settling, keep_leak).unwrap();
        let image = reconstruct::hadamard(&measurements);
        1.0 - metrics::correlation(&footprint, image.pixels(), side, side).unwrap()
    };
    let (with, without) = (distance(true), distance(false));
    // The remaining error is the rounding to whole ADC counts.
    assert!(
        without < with / 8.0,
        "1 - correlation: {with:.2e} with the leak, {without:.2e} without"
    );
}

#[test]
fn a_recording_gives_the_same_tally_as_the_capture_that_made_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let options =
        CaptureOptions { record: Some(recorded_to(&path)), ..options(&Order::CakeCutting, false) };
    let judge = only_frames(|frame| match frame {
        1 => Fate::Drop,
        2 => Fate::Delay,
        4 => Fate::Flip(99),
        _ => Fate::Pass,
    });
    let captured = run(Box::new(Tampered::new(ideal_link(), judge)), &options);
    let counters = captured.counters;
    let (received, lost) = (counters.received, counters.lost);
    assert_eq!((received, lost, counters.corrupt, counters.late), (3, 1, 1, 1));
    let mut recording = Recording::open(&path).unwrap();
    let tally = tally_recording(&mut recording).unwrap();
    assert_eq!(tally.account().counters(), counters);
    let means = tally.integrated().means(&captured.setup);
    assert_eq!(means, captured.integrated.means(&captured.setup));
    // Three of six frames came in order: the recording says so itself.
    let account = recording.end().account.clone().unwrap();
    assert_eq!((account.asked, account.made), (Some(FRAMES), Some(u64::from(FRAMES))));
    assert_eq!(account.missing, captured.missing());
    assert!(account.missing.unwrap().contains("1 lost, 1 corrupt, 1 late"));
}

/// Each frame of one sweep holds what four sweeps cancel; the run's other frames tell what that is.
#[test]
fn a_frame_of_one_sweep_is_corrected_by_what_its_run_tells() {
    let circuit =
        "[leds]\npower_mw = 40\nrise_ns = 12.76\nfall_ns = 16.36\nline_crosstalk_ff = 1.6";
    let optics =
        VirtualOptics::of(&CameraModel::parse(circuit).unwrap(), Scene::white(), 300.0).unwrap();
    let settling = calibrate_against_white(&optics, 1).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mcap");
    let options = CaptureOptions {
        setup: optics.setup(&Order::ZigZag, 1.0).unwrap(),
        frames: Some(32),
        calibration: Calibration::Kept(settling),
        record: Some(recorded_to(&path)),
    };
    run(Box::new(MemoryLink::new(optics.camera(1).unwrap())), &options);
    let mut recording = Recording::open(&path).unwrap();
    let (setup, settling) = (recording.setup.clone(), recording.settling.clone());
    let mut frames = Vec::new();
    hear_recording(&mut recording, |heard, _| {
        frames.extend(heard.frame().map(|frame| Integrated::of_frame(&setup, frame)));
        Ok::<(), RecordingError>(())
    })
    .unwrap();
    let tally = tally_recording(&mut Recording::open(&path).unwrap()).unwrap();
    let first_pixel = |frame: &Integrated| {
        let measured = frame.measurements(&setup, settling.as_ref(), false).unwrap();
        let image = reconstruct::hadamard(&measured);
        image.pixels()[0] / image.pixels()[1..].iter().sum::<f32>() * 1023.0
    };
    let whole = first_pixel(tally.integrated());
    assert!((whole - 1.0).abs() < 0.1, "{whole}");
    for (at, frame) in frames.iter().enumerate() {
        let corrected = first_pixel(&frame.clone().of_run(&tally.known()));
        assert!((corrected - 1.0).abs() < 0.4, "{at}: {corrected}");
        let alone = first_pixel(frame);
        assert!((alone - 1.0).abs() > 1.0, "{at}: {alone}");
    }
}

#[test]
fn an_intact_frame_of_another_setup_is_corrupt() {
    let captured = run(ideal_link(), &options(&Order::CakeCutting, false));
    let mut count = FrameCount::new(&captured.setup, None);
    let frame = |sequence, words: usize, buffer: &mut [u8]| {
        let samples = Samples::pack(vec![1i64; words].into_iter(), Width::Bits32, buffer).unwrap();
        let (run, flags) = (0, FrameFlags::DIFFERENTIAL);
        let frame = Frame { run, sequence, device_time_us: 0, sweeps: 1, flags, samples };
        let mut packet = vec![0; MAX_DEVICE_PACKET + 1];
        let length = encode(&DeviceMessage::Frame(frame), &mut packet).unwrap().len();
        packet.truncate(length - 1);
        packet
    };
    let mut buffer = [0; 4096];
    for (sequence, words) in [(0, 1024), (1, 1000), (2, 1024)] {
        count.packet(&open(&mut frame(sequence, words, &mut buffer)));
    }
    let counters = count.account().counters();
    assert_eq!((counters.received, counters.corrupt, counters.lost), (2, 1, 0));
}

#[test]
fn patterns_without_complements_show_the_scene_too() {
    let mut options = options(&Order::CakeCutting, true);
    options.setup.differential = false;
    options.setup.sweeps = 16;
    let captured = run(Box::new(MemoryLink::new(optics().camera(2).unwrap())), &options);
    let footprint = optics().footprint().weights().to_vec();
    // Once with the calibrated dark level, once with the estimated one.
    for settling in [captured.settling.as_ref(), None] {
        let measurements =
            captured.integrated.measurements(&captured.setup, settling, false).unwrap();
        let image = reconstruct::hadamard(&measurements);
        let correlation = metrics::correlation(&footprint, image.pixels(), 32, 32).unwrap();
        assert!(correlation > 0.8, "{correlation}");
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let record = |name: &str, seed| {
        let path = folder.path().join(name);
        let options = CaptureOptions {
            record: Some(recorded_to(&path)),
            ..options(&Order::CakeCutting, true)
        };
        run(Box::new(MemoryLink::new(optics().camera(seed).unwrap())), &options);
        let recording = Recording::open(&path).unwrap();
        recording.map(|packet| packet.unwrap().bytes).collect::<Vec<_>>()
    };
    let first = record("a.mcap", 5);
    assert!(first.len() > FRAMES as usize);
    assert_eq!(first, record("b.mcap", 5));
    assert_ne!(first, record("c.mcap", 6));
}

#[test]
fn an_interlock_that_opens_ends_the_capture_with_the_reason() {
    let mut camera = optics().camera(1).unwrap();
    camera.set_interlock(false);
    let mut session = Session::open(Box::new(MemoryLink::new(camera))).unwrap();
    let error =
        capture(&mut session, &options(&Order::Natural, false), &mut |_| ControlFlow::Continue(()));
    // The interlock was opened before the start, so the camera refuses the start; the message names
    // the interlock.
    let message = match error {
        Ok(captured) => match captured.ended {
            Ended::Fault(fault @ Fault::Interlock) => format!("{fault:?}"),
            other => panic!("{other:?}"),
        },
        Err(error) => error.to_string(),
    };
    assert!(message.contains("interlock is open"), "{message}");
}

#[test]
fn stopping_keeps_what_has_come() {
    let mut session = Session::open(ideal_link()).unwrap();
    let options = CaptureOptions { frames: None, ..options(&Order::Natural, false) };
    let captured = capture(&mut session, &options, &mut |progress| {
        if progress.counters.received >= 3 {
            ControlFlow::Break(StopCause::User)
        } else {
            ControlFlow::Continue(())
        }
    })
    .unwrap();
    assert!(matches!(captured.ended, Ended::Stopped(StopCause::User)));
    assert!(captured.counters.received >= 3 && captured.counters.is_complete());
}

/// The virtual camera's time stands still meanwhile. A real one switches its LEDs off and says so,
/// which a host that wakes reads first.
#[test]
fn a_host_that_was_suspended_does_not_blame_its_camera() {
    let mut session = Session::open(ideal_link()).unwrap();
    let options = CaptureOptions { frames: None, ..options(&Order::Natural, false) };
    let mut before = None;
    let captured = capture(&mut session, &options, &mut |progress| match before {
        None => {
            std::thread::sleep(Duration::from_secs(6));
            before = Some(progress.counters.received);
            ControlFlow::Continue(())
        }
        Some(before) if progress.counters.received > before => ControlFlow::Break(StopCause::User),
        Some(_) => ControlFlow::Continue(()),
    })
    .unwrap();
    assert!(matches!(captured.ended, Ended::Stopped(StopCause::User)), "{:?}", captured.ended);
    assert!(captured.counters.is_complete());
}

/// Noise and signal computed on the host, from all that the host gets: the frames.
#[test]
fn the_camera_s_own_meter_says_what_its_frames_show() {
    let setup = MeasurementSetup::new(&Order::Natural, 1.0).unwrap();
    let link = Box::new(MemoryLink::new(optics().camera(3).unwrap()));
    let (captured, shots) = nirspi_tests::tapped::run(link, &setup, 2);
    let seen = Signal::of(captured.status.as_ref().unwrap()).unwrap();

    let samples = f64::from(setup.window()) * f64::from(setup.sweeps);
    let [first, second] = &shots[..] else { panic!("{} frames", shots.len()) };
    let pairs = || first.samples.iter().zip(&second.samples).map(|(&a, &b)| (a as f64, b as f64));
    let count = pairs().count() as f64;
    let noise =
        (pairs().map(|(a, b)| (b - a).powi(2)).sum::<f64>() / (2.0 * count)).sqrt() / samples;
    let mean = pairs().map(|(_, b)| b).sum::<f64>() / count;
    let variance = pairs().map(|(_, b)| (b - mean).powi(2)).sum::<f64>() / count / samples.powi(2);
    let signal = (variance - noise.powi(2)).sqrt();
    assert!(noise > 0.1, "the virtual camera has noise: {noise}");
    assert!((seen.noise_counts / noise - 1.0).abs() < 0.01, "{seen}: {noise}");
    assert!((seen.signal_counts / signal - 1.0).abs() < 0.01, "{seen}: {signal}");
    let decibels = 20.0 * (signal / noise).log10();
    assert!((seen.snr_db - decibels).abs() < 0.1, "{seen}: {decibels}");
    assert_eq!(seen.over_range_share, 0.0);
}

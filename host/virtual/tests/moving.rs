//! The picture of a target that moves is sharp: captured in short frames, and read from the recording as a user would.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use nirspi::capture::{Calibration, CaptureOptions, Record, capture};
use nirspi::provenance::Made;
use nirspi::recording::{Recording, RecordingError, Target, hear_recording};
use nirspi::scene::SceneSource;
use nirspi::session::Session;
use nirspi::setup::MeasurementSetup;
use nirspi::source::{Source, SourceOptions};
use nirspi_optics::Motion;
use nirspi_recon::reconstruct::Method;
use nirspi_recon::{Measurements, Order};
use nirspi_virtual::{CameraModel, MemoryLink, VirtualOptics, calibrate_against_white};
use std::ops::ControlFlow;

const FRAMES: u32 = 14;

/// A letter of which frames of 3 ms are taken for as long as one of 24 pictures a second lasts.
struct Taken {
    from_recording: Source,
    from_capture: Source,
    /// Of the picture that `prior` makes of some measurements, against what the LEDs see in the middle of the newest frame.
    psnr: Box<dyn Fn(&Measurements) -> f64>,
}

fn taken(speed_m_per_s: f64) -> Taken {
    let letter = SceneSource::Letter('R').load(256).unwrap();
    let motion = Motion { speed_m_per_s, ..Motion::default() };
    let optics = VirtualOptics::before(CameraModel::paper(), &letter, 300.0).unwrap();
    let settling = calibrate_against_white(&optics, 1).unwrap();
    let optics = optics.moving(motion).unwrap();
    let setup = optics.setup(&Order::ZigZag, 1.0).unwrap();
    let setup = MeasurementSetup { sweeps: 36, ..setup };
    let middle_s = setup.frame_ns() * 0.5e-9;
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("moving.mcap");
    let options = CaptureOptions {
        setup,
        frames: Some(FRAMES),
        calibration: Calibration::Kept(settling),
        record: Some(Record {
            target: Target::New(path.clone()),
            made: Made::by("a test", None, ["a test"], 0),
        }),
    };
    let mut session = Session::open(Box::new(MemoryLink::new(optics.camera(1).unwrap()))).unwrap();
    let captured = capture(&mut session, &options, &mut |_| ControlFlow::Continue(())).unwrap();
    let mut newest_s = 0.0;
    hear_recording(&mut Recording::open(&path).unwrap(), |heard, _| {
        if let Some(frame) = heard.frame() {
            newest_s = frame.device_time_us as f64 * 1e-6;
        }
        Ok::<(), RecordingError>(())
    })
    .unwrap();
    let unit = optics.chain().electrons_per_count / optics.budget().electrons_per_led;
    let truth = match optics.moving_target().unwrap() {
        Some(target) => target.seen(newest_s + middle_s),
        None => optics.footprint().weights().to_vec(),
    };
    let prior = Method::PRIOR.prepare(&nirspi_nets::prior::settings()).unwrap();
    let psnr = move |measurements: &Measurements| {
        let image = prior.reconstruct(measurements).unwrap().image;
        let pixels = image.pixels().iter().zip(&truth);
        let squares = pixels.map(|(a, b)| (f64::from(*a) * unit - f64::from(*b)).powi(2));
        -10.0 * (squares.sum::<f64>() / truth.len() as f64).log10()
    };
    Taken {
        from_recording: Source::read(&path, &SourceOptions::default()).unwrap(),
        from_capture: Source::of_capture(&captured).unwrap(),
        psnr: Box::new(psnr),
    }
}

#[test]
fn a_letter_that_moves_is_followed() {
    let Taken { from_recording, from_capture, psnr } = taken(0.5);
    let found = psnr(&from_recording.measurements);
    assert!(found > 26.0, "{found:.1} dB");
    assert_eq!(from_recording.measurements, from_capture.measurements);
    let note = from_recording.notes.iter().find(|note| note.contains("moves")).unwrap();
    assert!(note.contains("newest 14 of 14 frames, added along its way"), "{note}");
}

#[test]
fn a_letter_at_rest_is_the_sum_of_its_frames() {
    let Taken { from_recording, psnr, .. } = taken(0.0);
    let found = psnr(&from_recording.measurements);
    assert!(found > 33.0, "{found:.1} dB");
    assert!(
        from_recording.notes.iter().all(|note| !note.contains("moves")),
        "{:?}",
        from_recording.notes
    );
}

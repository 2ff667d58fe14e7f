use super::*;
use crate::capture::{Calibration, Capture, CaptureOptions, Ended, capture};
use crate::session::Session;
use nirspi_recon::Order;
use nirspi_wire::samples::Samples;
use nirspi_wire::{Channel, Event, EventKind, FrameFlags, open};
use std::sync::{Arc, Mutex};

const PATTERNS: usize = 10;

fn identity() -> CameraIdentity {
    CameraIdentity {
        protocol: 2,
        firmware: "0.3.1".into(),
        gateware: "1.2.0".into(),
        board: "virtual".into(),
        serial: "A-17".into(),
        adc_hz: 125_000_000,
        adc_bits: 14,
        wavelength_nm: 1550,
        capabilities: Vec::new(),
        detectors: 1,
    }
}

fn setup() -> MeasurementSetup {
    MeasurementSetup::new(&Order::Natural, PATTERNS as f64 / 1024.0).unwrap()
}

fn announcement() -> Announcement {
    Announcement { identity: identity(), setup: setup(), settling: None }
}

/// Calls `take` with a frame of this run and number.
fn with_frame<T>(run: u16, sequence: u32, take: impl FnOnce(Frame<'_>) -> T) -> T {
    let mut room = [0; 4 * PATTERNS];
    let samples = (0..PATTERNS as i32).map(|k| i64::from(sequence) * 100 - i64::from(k));
    take(Frame {
        run,
        sequence,
        device_time_us: u64::from(sequence) * 100,
        sweeps: 1,
        flags: FrameFlags::DIFFERENTIAL,
        samples: Samples::pack(samples, &mut room).unwrap(),
    })
}

fn packet(message: &DeviceMessage<'_>) -> Vec<u8> {
    let mut room = vec![0; MAX_DEVICE_PACKET + 1];
    encode(message, &mut room).unwrap().to_vec()
}

/// What a program at the camera publishes: packet by packet, as long as the function has some.
struct Script<F>(F, u32);

impl<F: FnMut(u32) -> Option<Vec<u8>> + Send> Subscribe for Script<F> {
    fn packet(&mut self, timeout: Duration) -> io::Result<Option<Vec<u8>>> {
        let at = self.1;
        self.1 += 1;
        match (self.0)(at) {
            Some(packet) => Ok(Some(packet)),
            None => {
                std::thread::sleep(timeout.min(Duration::from_millis(5)));
                Ok(None)
            }
        }
    }
}

fn captured(
    script: impl FnMut(u32) -> Option<Vec<u8>> + Send + 'static,
    frames: Option<u32>,
) -> Capture {
    captured_of(identity(), script, frames)
}

fn captured_of(
    identity: CameraIdentity,
    script: impl FnMut(u32) -> Option<Vec<u8>> + Send + 'static,
    frames: Option<u32>,
) -> Capture {
    let announced = Announcement { identity: identity.clone(), ..announcement() };
    let link = RelayLink::new(announced, Box::new(Script(script, 0)));
    let recorded = link.recorded().clone();
    let mut session = Session::open(Box::new(link)).unwrap().with_recorded(recorded);
    assert_eq!(session.identity(), &identity);
    let options = CaptureOptions {
        // The setup of the camera counts, not this one.
        setup: MeasurementSetup::new(&Order::CakeCutting, 1.0).unwrap(),
        frames,
        calibration: Calibration::Measure,
        record: None,
    };
    capture(&mut session, &options, &mut |_| ControlFlow::Continue(())).unwrap()
}

#[test]
fn a_late_host_counts_from_its_start_and_every_gap_is_a_loss() {
    // The camera has run for long; of ten frames, one is lost on the way.
    let script = |n: u32| {
        Some(match n % 10 {
            3 => Vec::new(),
            _ => with_frame(7, 5_000_000 + n, |frame| packet(&DeviceMessage::Frame(frame))),
        })
    };
    let capture = captured(script, Some(200));
    assert_eq!(capture.made, Some(200));
    let counters = capture.counters;
    assert_eq!((counters.received, counters.lost, counters.total()), (180, 20, 200));
    assert_eq!(capture.setup, setup());
}

#[test]
fn a_host_gets_every_detector_of_the_camera() {
    let three = CameraIdentity { protocol: Channel::SINCE, detectors: 3, ..identity() };
    // The host joins somewhere. Of every fifth frame, detector 1 is lost.
    let script = |n: u32| {
        let number = n + 2;
        let (sequence, detector) = (999 + number / 3, (number % 3) as u8);
        let message = |frame: Frame<'_>| match detector {
            0 => packet(&DeviceMessage::Frame(frame)),
            1 if sequence % 5 == 0 => Vec::new(),
            _ => packet(&DeviceMessage::Channel(Channel { detector, frame })),
        };
        Some(with_frame(7, sequence, message))
    };
    let capture = captured_of(three, script, Some(10));
    let received = |received| LossCounters { received, ..LossCounters::default() };
    assert_eq!((capture.made, capture.counters), (Some(10), received(10)));
    let expected = [LossCounters { lost: 2, ..received(8) }, received(10)];
    assert_eq!(capture.further_counters(), expected);
}

#[test]
fn frames_across_the_wrap_of_their_number_are_in_order() {
    let script = |n: u32| {
        let sequence = (u32::MAX - 2000).wrapping_add(n);
        Some(with_frame(1, sequence, |frame| packet(&DeviceMessage::Frame(frame))))
    };
    let capture = captured(script, Some(4000));
    assert_eq!((capture.counters.received, capture.counters.total()), (4000, 4000));
    assert!(matches!(capture.ended, Ended::Complete), "{:?}", capture.ended);
}

#[test]
fn the_end_of_the_cameras_run_ends_that_of_the_host() {
    for another_run in [false, true] {
        let script = move |n: u32| match n {
            0..5000 => Some(with_frame(4, n, |frame| packet(&DeviceMessage::Frame(frame)))),
            5000 if another_run => {
                Some(with_frame(5, 0, |frame| packet(&DeviceMessage::Frame(frame))))
            }
            5000 => Some(packet(&DeviceMessage::Event(Event {
                device_time_us: 1,
                kind: EventKind::RunEnded {
                    run: 4,
                    // The last three frames are lost on the way.
                    frames_made: 5003,
                    frames_dropped: 0,
                    fpga_frames_lost: 0,
                    fpga_frames_corrupt: 0,
                },
            }))),
            _ => None,
        };
        let capture = captured(script, None);
        assert!(matches!(capture.ended, Ended::Complete), "{:?}", capture.ended);
        assert_eq!(capture.counters.lost, if another_run { 0 } else { 3 });
        assert!(capture.counters.received > 0);
    }
}

/// Announcements, and packets.
type Published = (Vec<String>, Vec<Vec<u8>>);

/// Keeps what is published.
#[derive(Clone, Default)]
struct Kept(Arc<Mutex<Published>>);

impl Publish for Kept {
    fn announce(&mut self, json: &str) {
        self.0.lock().unwrap().0.push(json.to_owned());
    }

    fn packet(&mut self, raw: &[u8]) {
        self.0.lock().unwrap().1.push(raw.to_vec());
    }
}

/// Counts what it observes.
#[derive(Default)]
struct Counting {
    frames: u32,
    messages: u32,
}

impl Observer for Counting {
    fn frame(&mut self, _: &Frame<'_>, _: &LossCounters) {
        self.frames += 1;
    }

    fn message(&mut self, _: &DeviceMessage<'_>) {
        self.messages += 1;
    }

    fn watch(&mut self, _: &Progress) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

#[test]
fn what_is_published_is_what_a_recording_holds_and_the_other_observer_hears_all() {
    let (kept, mut beside) = (Kept::default(), Counting::default());
    let mut publishing = Publishing::new(&identity(), kept.clone(), &mut beside);
    publishing.begins(&setup(), None, None);
    let reply = |outcome| DeviceMessage::Reply(Reply { id: 1, outcome });
    let status = crate::replay::answers::status(3);
    publishing.message(&reply(Ok(Answer::Done)));
    publishing.message(&reply(Ok(Answer::Status(status))));
    with_frame(3, 9, |frame| publishing.frame(&frame, &LossCounters::default()));
    assert_eq!((beside.frames, beside.messages), (1, 2));
    let (announced, packets) = &*kept.0.lock().unwrap();
    assert_eq!(serde_json::from_str::<Announcement>(&announced[0]).unwrap(), announcement());
    let expected = [
        packet(&reply(Ok(Answer::Status(status)))),
        with_frame(3, 9, |frame| packet(&DeviceMessage::Frame(frame))),
    ];
    assert_eq!(packets[..], expected);
    let mut raw = packets[1][..packets[1].len() - 1].to_vec();
    assert!(matches!(open(&mut raw), Ok(DeviceMessage::Frame(frame)) if frame.sequence == 9));
}

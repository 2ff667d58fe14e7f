//! Cameras that make other frames than was asked for, whose packets come damaged, or that never stop: none of it is a success,
//! and none of it fills the disk.

use crate::bench::{Bench, Outcome};
use nirspi_wire::packet::{MAX_DEVICE_PACKET, MAX_HOST_PACKET};
use nirspi_wire::samples::Width;
use nirspi_wire::{
    Answer, Capabilities, Command, Deframed, Deframer, DeviceMessage, Event, EventKind, Fault,
    Frame, FrameFlags, Identity, Refusal, Reply, Request, Samples, State, Status, Version, encode,
    open, version,
};
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::time::Instant;

/// What a camera does between `Start` and the end of its run.
#[derive(Debug, Clone, Copy)]
struct Run {
    /// Frames that it sends.
    frames: u32,
    /// Frames that it says it has made; `None` if it never says so.
    says: Option<u32>,
    /// The fault that ends the run.
    fault: Option<Fault>,
    /// The event of the fault comes damaged.
    fault_is_damaged: bool,
    /// What it sends after that, until the host goes.
    flood: Option<Flood>,
    /// It always says that it is running, and never sends a burst.
    stuck: bool,
}

#[derive(Debug, Clone, Copy)]
enum Flood {
    Damaged,
    OfAnotherRun,
}

const HONEST: Run = Run {
    frames: 50,
    says: Some(50),
    fault: None,
    fault_is_damaged: false,
    flood: None,
    stuck: false,
};

/// A camera of one host that does this in each run. `configured` is called with each `Configure`.
fn camera(run: Run, configured: impl Fn() + Send + 'static) -> String {
    serve(move |host| {
        Camera { host, run, started: false, refuses: None, powered_up: Instant::now() }
            .serve(&configured);
    })
}

/// A camera that refuses to start.
fn refusing(refusal: Refusal) -> String {
    serve(move |host| {
        let (refuses, powered_up) = (Some(refusal), Instant::now());
        Camera { host, run: HONEST, started: false, refuses, powered_up }.serve(&|| {});
    })
}

fn serve(serve: impl FnOnce(TcpStream) + Send + 'static) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = listener.local_addr().unwrap();
    std::thread::spawn(move || serve(listener.accept().unwrap().0));
    format!("tcp:{address}")
}

struct Camera {
    host: TcpStream,
    run: Run,
    started: bool,
    refuses: Option<Refusal>,
    powered_up: Instant,
}

/// The number of the run before this one.
const EARLIER_RUN: u16 = 6;

impl Camera {
    fn serve(mut self, configured: &dyn Fn()) {
        let mut deframer = Deframer::<MAX_HOST_PACKET>::new();
        let mut buffer = [0; 4096];
        while let Ok(length @ 1..) = self.host.read(&mut buffer) {
            let mut bytes = &buffer[..length];
            while let Some(found) = deframer.next(&mut bytes) {
                let Deframed::Packet(packet) = found else { continue };
                let Ok(Request { id, command }) = open::<Request<'_>>(packet) else { continue };
                let mut starts = false;
                let outcome = match command {
                    Command::Hello { .. } => Ok(Answer::Hello(IDENTITY)),
                    Command::Status => Ok(Answer::Status(self.status())),
                    Command::Configure(_) => {
                        configured();
                        Ok(Answer::Done)
                    }
                    Command::Start(_) => match self.refuses {
                        Some(refusal) => Err(refusal),
                        None => {
                            starts = true;
                            Ok(Answer::Done)
                        }
                    },
                    // Takes the first piece again and again.
                    Command::LoadGateware(piece) if piece.offset == 0 => {
                        Ok(Answer::Gateware { next_offset: piece.data.len() as u32 })
                    }
                    Command::LoadGateware(_) => Err(Refusal::GatewareOffset { expected: 0 }),
                    _ => Ok(Answer::Done),
                };
                let gone = self.send(DeviceMessage::Reply(Reply { id, outcome }), false).is_err();
                if gone || starts && self.measure().is_err() {
                    return;
                }
            }
        }
    }

    fn status(&self) -> Status {
        let fault = self.run.fault.filter(|_| self.started);
        Status {
            state: match fault {
                Some(_) => State::Fault,
                None if self.run.stuck => State::Running,
                None => State::Configured,
            },
            fault,
            uptime_us: self.powered_up.elapsed().as_micros() as u64,
            run: EARLIER_RUN + u16::from(self.started),
            frames_made: self.run.says.unwrap_or(self.run.frames),
            frames_sent: self.run.frames,
            frames_dropped: 0,
            fpga_frames_lost: 0,
            fpga_frames_corrupt: 0,
            commands_damaged: 0,
            temperature_centi_celsius: 2500,
            duty_permille: 0,
            leds_on: false,
            interlock_closed: fault.is_none(),
            signal: None,
        }
    }

    fn measure(&mut self) -> std::io::Result<()> {
        self.started = true;
        let Run { frames, says, fault, fault_is_damaged, flood, .. } = self.run;
        for sequence in 0..frames {
            self.frame(EARLIER_RUN + 1, sequence, false)?;
        }
        let event = |kind| DeviceMessage::Event(Event { device_time_us: 2, kind });
        if let Some(fault) = fault {
            self.send(event(EventKind::Fault(fault)), fault_is_damaged)?;
        }
        if let Some(flood) = flood {
            for sequence in 0.. {
                match flood {
                    Flood::Damaged => self.frame(EARLIER_RUN + 1, sequence, true)?,
                    Flood::OfAnotherRun => self.frame(EARLIER_RUN, sequence, false)?,
                }
            }
        }
        if let Some(frames_made) = says {
            self.send(
                event(EventKind::RunEnded {
                    run: EARLIER_RUN + 1,
                    frames_made,
                    frames_dropped: 0,
                    fpga_frames_lost: 0,
                    fpga_frames_corrupt: 0,
                }),
                false,
            )?;
        }
        Ok(())
    }

    fn frame(&mut self, run: u16, sequence: u32, damaged: bool) -> std::io::Result<()> {
        let mut buffer = [0; 8192];
        let samples =
            Samples::pack((0..1024_i32).map(|k| i64::from(5000 - k)), Width::Bits32, &mut buffer)
                .unwrap();
        let flags = FrameFlags::DIFFERENTIAL;
        let frame = Frame { run, sequence, device_time_us: 1, sweeps: 1, flags, samples };
        self.send(DeviceMessage::Frame(frame), damaged)
    }

    fn send(&mut self, message: DeviceMessage<'_>, damaged: bool) -> std::io::Result<()> {
        let mut buffer = vec![0; MAX_DEVICE_PACKET + 1];
        let length = encode(&message, &mut buffer).unwrap().len();
        let packet = &mut buffer[..length];
        if damaged {
            // Not into the zero that ends a packet, nor the one before it, which counts bytes.
            let at = length / 2;
            packet[at] = if packet[at] == 1 { 2 } else { packet[at] ^ 1 };
        }
        self.host.write_all(packet)
    }
}

const IDENTITY: Identity<'static> = Identity {
    protocol: version::CURRENT,
    firmware: Version(0, 1, 0),
    gateware: Version(0, 1, 0),
    board: "dishonest",
    serial: "1",
    side: 32,
    adc_hz: 125_000_000,
    adc_bits: 14,
    wavelength_nm: 1550,
    capabilities: Capabilities(0),
};

/// Captures 50 frames of it into `rec.mcap`.
fn capture(bench: &Bench, camera: &str, more: &[&str]) -> Outcome {
    let asked = ["capture", "--camera", camera, "--frames", "50", "--out", "rec.mcap", "--json"];
    let latency = ["--no-calibration", "--adc-latency", "6"];
    bench.run(&[&asked[..], &latency, more].concat())
}

/// It fails with these words, is not complete, says so in its report and in the recording, which has `received` frames.
#[track_caller]
fn incomplete(run: Run, received: u64, words: &[&str]) -> serde_json::Value {
    let bench = Bench::new();
    let outcome = capture(&bench, &camera(run, || {}), &[]);
    let report = outcome.failed(1, &[words, &["kept in rec.mcap"]].concat()).json();
    assert_eq!((&report["complete"], &report["asked"]), (&false.into(), &50.into()), "{report}");
    assert!(report["missing"].as_str().unwrap().contains(words[0]), "{report}");
    assert_eq!(report["frames"]["received"], received, "{report}");
    assert!(std::fs::metadata(bench.path("rec.mcap")).unwrap().len() < 70 << 20);
    if received > 0 {
        let again = ["reconstruct", "rec.mcap", "--method", "hadamard", "--json"];
        let again = bench.run(&again).succeeded().json();
        assert_eq!(again["frames"]["received"], received, "{again}");
        let warnings = again["warnings"].as_array().unwrap();
        let told = |note: &serde_json::Value| {
            let note = note.as_str().unwrap();
            note.contains("not whole") && note.contains(words[0])
        };
        assert!(warnings.iter().any(told), "{again}");
    }
    report
}

#[test]
fn a_camera_that_makes_what_was_asked_for_succeeds() {
    let bench = Bench::new();
    let report = capture(&bench, &camera(HONEST, || {}), &[]).succeeded().json();
    assert_eq!((&report["complete"], &report["made"]), (&true.into(), &50.into()), "{report}");
    assert!(report["missing"].is_null(), "{report}");
}

#[test]
fn a_camera_that_sends_3_of_50_frames_is_no_success() {
    let run = Run { frames: 3, says: Some(3), ..HONEST };
    let report = incomplete(run, 3, &["the camera made 3 frames, 50 were asked for"]);
    assert_eq!(report["made"], 3);
    // Nor one that says that it has made all 50.
    let run = Run { frames: 3, ..HONEST };
    incomplete(run, 3, &["of 50 frames made: 3 received, 47 lost"]);
    // Nor one that says nothing at its end: its status does.
    let run = Run { frames: 3, says: None, ..HONEST };
    incomplete(run, 3, &["the camera made 3 frames, 50 were asked for"]);
}

#[test]
fn a_fault_whose_event_came_damaged_is_found_in_the_status() {
    let fault = Some(Fault::Interlock);
    let run = Run { frames: 3, says: Some(3), fault, fault_is_damaged: true, ..HONEST };
    let words = ["switched its LEDs off after 3 of 50 frames", "interlock", "1 damaged packet"];
    incomplete(run, 3, &words);
    // With the last frame made, too.
    let run = Run { fault, fault_is_damaged: true, ..HONEST };
    incomplete(run, 50, &["switched its LEDs off after 50 of 50 frames", "interlock"]);
}

#[test]
fn nothing_but_damaged_packets_neither_succeeds_nor_fills_the_disk() {
    let run = Run { frames: 0, says: None, flood: Some(Flood::Damaged), ..HONEST };
    let report = incomplete(run, 0, &["66 MB of damaged packets and packets of other runs"]);
    let failed = report["failed_checks"].as_object().unwrap().values();
    let damaged: u64 = failed.map(|packets| packets.as_u64().unwrap()).sum();
    assert!(report["made"].is_null() && damaged > 1000, "{report}");
}

#[test]
fn nothing_but_frames_of_another_run_neither_succeeds_nor_fills_the_disk() {
    let run = Run { frames: 2, says: None, flood: Some(Flood::OfAnotherRun), ..HONEST };
    incomplete(run, 2, &["66 MB of damaged packets and packets of other runs came with 2 frames"]);
}

#[test]
fn a_camera_that_says_that_it_measures_and_sends_nothing_ends_the_capture() {
    let run = Run { frames: 3, says: None, stuck: true, ..HONEST };
    let report = incomplete(run, 3, &["measuring and sent nothing after 3 frames for 5 s"]);
    assert_eq!(report["made"], serde_json::Value::Null, "{report}");
}

#[test]
fn a_recording_that_appears_meanwhile_is_left_alone() {
    let bench = Bench::new();
    let path = bench.path("rec.mcap");
    let camera = camera(HONEST, move || std::fs::write(&path, b"precious").unwrap());
    capture(&bench, &camera, &[]).failed(1, &["rec.mcap", "cannot record", "is there already"]);
    assert_eq!(std::fs::read(bench.path("rec.mcap")).unwrap(), b"precious");
    assert_eq!(bench.names(), ["rec.mcap"]);
}

#[test]
fn overwrite_keeps_the_old_recording_until_the_new_one_is_whole() {
    let bench = Bench::new();
    bench.write("rec.mcap", b"precious");
    let old = || std::fs::read(bench.path("rec.mcap")).unwrap();
    // Nothing is recorded.
    let closed = refusing(Refusal::Fault(Fault::Interlock));
    capture(&bench, &closed, &["--overwrite"]).failed(1, &["refused Start", "interlock"]);
    assert_eq!((old(), bench.names()), (b"precious".to_vec(), vec!["rec.mcap".to_owned()]));
    // Not enough is recorded.
    let short = camera(Run { frames: 3, says: Some(3), ..HONEST }, || {});
    let failed = capture(&bench, &short, &["--overwrite"]);
    failed.failed(1, &["3 frames, 50 were asked for", "rec.new.mcap"]);
    assert_eq!(
        (old(), bench.names()),
        (b"precious".to_vec(), vec!["rec.mcap".to_owned(), "rec.new.mcap".to_owned()])
    );
    // All is recorded.
    let report = capture(&bench, &camera(HONEST, || {}), &["--overwrite"]).succeeded().json();
    assert_eq!(report["recording"], "rec.mcap");
    assert_ne!(old(), b"precious");
    assert_eq!(bench.names(), ["rec.mcap", "rec.new.mcap"]);
    let again = ["reconstruct", "rec.mcap", "--method", "hadamard", "--json"];
    assert_eq!(bench.run(&again).succeeded().json()["frames"]["received"], 50);
}

#[cfg(unix)]
#[test]
fn a_camera_whose_burst_never_comes_can_be_left() {
    let bench = Bench::new();
    let seen = bench.path("seen");
    let camera =
        camera(Run { stuck: true, ..HONEST }, move || std::fs::write(&seen, b"x").unwrap());
    let capture = ["capture", "--camera", &camera, "--frames", "50", "--out", "rec.mcap"];
    let mut process = bench.start(&capture);
    process.has_written(&bench.path("seen"), 1);
    process.signal("INT");
    process.wait().failed(1, &["stopped before the first frame"]);
    assert_eq!(bench.names(), ["seen"]);
}

#[test]
fn a_camera_that_never_gets_on_with_a_bitstream_is_given_up() {
    let bench = Bench::new();
    let bitstream: Vec<u8> = [0xFF, 0x00].into_iter().chain([0x5A; 20_000]).collect();
    bench.write("top.bin", &bitstream);
    let gateware = ["camera", "gateware", "top.bin", "--camera", &camera(HONEST, || {})];
    bench.run(&gateware).failed(1, &["lost its place at byte 0"]);
}

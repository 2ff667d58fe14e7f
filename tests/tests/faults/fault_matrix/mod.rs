//! The faults, the cameras, and one cell of both.

mod places;

use nirspi::capture::{Calibration, Capture, CaptureError, CaptureOptions, Ended, Record, capture};
use nirspi::link::Link;
use nirspi::provenance::Made;
use nirspi::recording::Target;
use nirspi::session::{IgnorePackets, Session, SessionError, request};
use nirspi::setup::MeasurementSetup;
use nirspi_recon::Order;
use nirspi_tests::firmware;
use nirspi_tests::tamper::{Fate, Tampered};
use nirspi_wire::RunLength;
use places::{Lab, Script};
use std::ops::ControlFlow;
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// Frames of the capture with the fault. A slow reader needs more than the link holds.
const FRAMES: u32 = 40;
const FRAMES_OF_A_SLOW_READER: u32 = 400;
/// Frames of the capture after it.
const AFTER: u32 = 10;
/// The frame that a single event hits.
const HIT: u32 = 17;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fault {
    ByteLost,
    BitFlipped,
    PacketLost,
    Duplicate,
    Delay,
    Reorder,
    Cut,
    Disconnect,
    Replug,
    SlowReader,
    ClockJump,
    FpgaReset,
    McuReset,
    BrownOut,
    HostCrash,
    HostHangs,
    TwoHosts,
    DiskFull,
}

pub const FAULTS: [Fault; 18] = [
    Fault::ByteLost,
    Fault::BitFlipped,
    Fault::PacketLost,
    Fault::Duplicate,
    Fault::Delay,
    Fault::Reorder,
    Fault::Cut,
    Fault::Disconnect,
    Fault::Replug,
    Fault::SlowReader,
    Fault::ClockJump,
    Fault::FpgaReset,
    Fault::McuReset,
    Fault::BrownOut,
    Fault::HostCrash,
    Fault::HostHangs,
    Fault::TwoHosts,
    Fault::DiskFull,
];

impl Fault {
    pub fn title(self) -> &'static str {
        match self {
            Self::ByteLost => "a byte is lost in one frame of eight",
            Self::BitFlipped => "a bit flips in one frame of eight",
            Self::PacketLost => "one frame of eight is lost",
            Self::Duplicate => "one frame of eight comes twice",
            Self::Delay => "one frame of eight comes later, in order",
            Self::Reorder => "one frame of eight comes after its successor",
            Self::Cut => "the link ends inside a frame",
            Self::Disconnect => "the link ends between two frames",
            Self::Replug => "the link ends three times in a row",
            Self::SlowReader => {
                "the host reads nothing until the run is over, and the camera does not wait"
            }
            Self::ClockJump => "the camera's clock jumps an hour ahead in a run",
            Self::FpgaReset => "the FPGA loses everything inside a frame",
            Self::McuReset => "the firmware crashes inside a frame",
            Self::BrownOut => "the supply fails inside a frame: FPGA and firmware start anew",
            Self::HostCrash => "the host's program ends in a run",
            Self::HostHangs => "the host stays connected and says nothing more",
            Self::TwoHosts => "a second host connects in a run",
            Self::DiskFull => "the disk is full",
        }
    }

    /// What happens inside the camera.
    fn script(self) -> Script {
        match self {
            Self::FpgaReset => Script::Reset { frame: HIT },
            Self::ClockJump => Script::Jump { frame: HIT },
            Self::McuReset => Script::Crash { frame: HIT },
            Self::BrownOut => Script::BrownOut { frame: HIT },
            Self::SlowReader => Script::Unread,
            _ => Script::None,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// The virtual camera in this process, one thread, its own clock.
    Virtual,
    /// The virtual camera's server, over a socket of this machine.
    Tcp,
    /// A recording of the virtual camera, played back.
    Replay,
    /// The firmware's machine code in QEMU, over a serial line.
    Emulated,
    /// The firmware and its USB driver on a simulated OTG core, whose cells the tests of `boards/usb` write.
    Usb,
}

pub const PLACES: [Place; 5] =
    [Place::Virtual, Place::Tcp, Place::Replay, Place::Emulated, Place::Usb];

impl Place {
    pub fn title(self) -> &'static str {
        match self {
            Self::Virtual => "virtual camera",
            Self::Tcp => "over TCP",
            Self::Replay => "replay",
            Self::Emulated => "emulated board",
            Self::Usb => "USB, simulated",
        }
    }

    /// Whether this test can try faults there on this machine. If not, the page keeps its cells.
    pub fn is_here(self) -> bool {
        match self {
            Self::Virtual | Self::Tcp | Self::Replay => true,
            Self::Emulated => firmware::qemu().is_some() && firmware::elf().is_some(),
            Self::Usb => false,
        }
    }
}

/// What one cell has found.
pub enum Cell {
    Survived(String),
    /// The fault cannot happen here, for this reason.
    None(&'static str),
    Broken(String),
}

/// What the injector has done to frames.
#[derive(Debug, Default, Clone, Copy)]
struct Log {
    /// The camera has answered the greeting. Frames before that are of a run before, on a line that stayed open.
    greeted: bool,
    passed: u64,
    damaged: u64,
    lost: u64,
    repeated: u64,
    late: u64,
}

/// A quarter of all patterns: 51 us a frame.
fn setup() -> MeasurementSetup {
    MeasurementSetup::new(&Order::Natural, 0.25).unwrap()
}

fn measure(
    session: &mut Session,
    frames: u32,
    record: Option<Target>,
) -> Result<Capture, CaptureError> {
    let options = CaptureOptions {
        setup: setup(),
        frames: Some(frames),
        calibration: Calibration::None,
        record: record
            .map(|target| Record { target, made: Made::by("a test", None, ["a test"], 0) }),
    };
    capture(session, &options, &mut |_| ControlFlow::Continue(()))
}

/// Puts the injector before the link. Frames are the only packets of their length.
fn injected(fault: Fault, link: Box<dyn Link>, log: &Arc<Mutex<Log>>) -> Box<dyn Link> {
    let log = Arc::clone(log);
    let mut frame = 0;
    // Any fixed sequence: a multiplicative generator whose upper bits choose.
    let mut state = 0x2545_F491_u32;
    Box::new(Tampered::new(link, move |_, length| {
        let mut log = log.lock().unwrap();
        if length < 700 || !log.greeted {
            return Fate::Pass;
        }
        frame += 1;
        state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        // A frame that is delayed needs a successor.
        let hit = state >> 29 == 0 && frame < FRAMES - 1;
        let share = (state >> 16) as u8;
        let fate = match fault {
            Fault::ByteLost if hit => Fate::Lose(share),
            Fault::BitFlipped if hit => Fate::Flip(share),
            Fault::PacketLost if hit => Fate::Drop,
            Fault::Duplicate if hit => Fate::Repeat,
            Fault::Delay if hit => Fate::Hold(3),
            Fault::Reorder if hit => Fate::Delay,
            Fault::Cut if frame == HIT => Fate::Unplug,
            Fault::Disconnect | Fault::Replug if frame == HIT => Fate::Close,
            _ => Fate::Pass,
        };
        match fate {
            Fate::Lose(_) | Fate::Flip(_) => log.damaged += 1,
            Fate::Drop => log.lost += 1,
            Fate::Repeat => (log.repeated, log.passed) = (log.repeated + 1, log.passed + 1),
            Fate::Delay => log.late += 1,
            Fate::Unplug | Fate::Close => {}
            Fate::Pass | Fate::Hold(_) => log.passed += 1,
        }
        fate
    }))
}

/// Tries one cell.
pub fn tried(fault: Fault, place: Place) -> Cell {
    if let Some(why) = impossible(fault, place) {
        return Cell::None(why);
    }
    let lab = Lab::new(place, fault.script());
    let found = match fault {
        Fault::HostCrash => host_crash(&lab),
        Fault::HostHangs => host_hangs(&lab),
        Fault::TwoHosts => two_hosts(&lab),
        Fault::DiskFull => disk_full(&lab),
        Fault::Replug => (0..2)
            .try_for_each(|_| one_capture(fault, &lab).map(drop))
            .and_then(|()| one_capture(fault, &lab)),
        _ => one_capture(fault, &lab),
    };
    let found = found.and_then(|words| lab.dark().map(|()| words));
    let found = found.and_then(|words| after(fault, &lab).map(|()| words));
    match found.and_then(|words| lab.end().map(|()| words)) {
        Ok(words) => Cell::Survived(words),
        Err(why) => Cell::Broken(why),
    }
}

fn impossible(fault: Fault, place: Place) -> Option<&'static str> {
    match (fault, place) {
        (
            Fault::ClockJump | Fault::FpgaReset | Fault::McuReset | Fault::BrownOut,
            Place::Replay,
        ) => Some("a recording has no camera"),
        (Fault::HostHangs, Place::Tcp) => {
            Some("the server's time stands still while the host reads nothing")
        }
        (Fault::HostHangs, Place::Replay) => Some("a recording has no light"),
        (Fault::SlowReader, Place::Replay) => Some("a replay waits for its reader"),
        (Fault::McuReset | Fault::BrownOut, Place::Tcp) => {
            Some("the server has no firmware of its own to restart")
        }
        (Fault::SlowReader, Place::Tcp) => {
            Some("how many frames a socket holds is the system's choice")
        }
        (Fault::TwoHosts, Place::Virtual) => Some("one link, one host"),
        (Fault::TwoHosts, Place::Replay) => Some("each reader has its own replay"),
        (Fault::TwoHosts, Place::Emulated) => Some("a serial line has one host"),
        (Fault::SlowReader, Place::Emulated) => Some("QEMU's line waits for its reader"),
        (Fault::ClockJump, Place::Emulated) => Some("QEMU keeps the processor's clock"),
        _ => None,
    }
}

/// The capture with the fault, its counters held against the log.
fn one_capture(fault: Fault, lab: &Lab) -> Result<String, String> {
    let log = Arc::<Mutex<Log>>::default();
    let link = injected(fault, lab.connect(), &log);
    let mut session = Session::open(link).map_err(|error| format!("no session: {error}"))?;
    log.lock().unwrap().greeted = true;
    let frames = if fault == Fault::SlowReader { FRAMES_OF_A_SLOW_READER } else { FRAMES };
    let captured =
        measure(&mut session, frames, None).map_err(|error| format!("no capture: {error}"))?;
    drop(session);
    let log = *log.lock().unwrap();
    let counters = captured.counters;
    let status = captured.status.as_ref();
    let mut lost = log.lost;
    if fault == Fault::SlowReader {
        lost = status.map_or(0, |status| status.frames_dropped.into());
        if lost == 0 {
            return Err("the link took every frame".to_owned());
        }
    }
    let expected = (log.passed, lost, log.damaged, log.late);
    let found = (counters.received, counters.lost, counters.corrupt, counters.late);
    if found != expected || captured.repeated != log.repeated {
        let repeated = captured.repeated;
        return Err(format!(
            "received, lost, corrupt, late {found:?} and {repeated} twice; the injector: {log:?}"
        ));
    }
    // What is not an end by the link is told by the camera, whose count is the truth.
    let broken_off = matches!(captured.ended, Ended::LinkLost(_));
    let made = captured.made.unwrap_or_default();
    if !broken_off && counters.total() != made {
        return Err(format!("{counters} of {made} made"));
    }
    let whole = captured.missing().is_none();
    if whole != matches!(fault, Fault::Duplicate | Fault::Delay) {
        return Err(format!("missing: {:?}", captured.missing()));
    }
    let told = match &captured.ended {
        Ended::Complete if whole => "whole".to_owned(),
        Ended::Complete => "all frames made, not all whole".to_owned(),
        Ended::Fault(fault) => format!("LEDs off: {fault}"),
        ended => ended.in_words().to_owned(),
    };
    // After a fault, the number of frames that still come depends on how busy the machine is.
    let counted = match captured.ended {
        Ended::Complete => format!("{counters}; "),
        _ => String::new(),
    };
    Ok(format!("{counted}{told}"))
}

/// The capture after the fault.
fn after(fault: Fault, lab: &Lab) -> Result<(), String> {
    let mut session = lab.session().map_err(|error| format!("no session after it: {error}"))?;
    if matches!(fault, Fault::McuReset | Fault::BrownOut) {
        let reports = session.await_reports().map_err(|error| error.to_string())?;
        if reports.crash.is_some() != (fault == Fault::McuReset) {
            return Err(format!("told of the crash: {reports:?}"));
        }
    }
    let captured = measure(&mut session, lab.frames_after(), None)
        .map_err(|error| format!("no capture after it: {error}"))?;
    drop(session);
    match captured.missing() {
        None => lab.dark(),
        Some(missing) => Err(format!("after it: {missing}")),
    }
}

/// A session in which frames stream.
fn streaming(lab: &Lab) -> Result<Session, String> {
    let say = |error: SessionError| error.to_string();
    let mut session = Session::open(lab.connect()).map_err(say)?;
    let quiet = &mut IgnorePackets;
    lab.setup()
        .with_configuration(|c| session.command(request::Configure(c), quiet))
        .map_err(say)?;
    session.command(request::Start(RunLength::Continuous), quiet).map_err(say)?;
    for _ in 0..5 {
        session.listen(Duration::from_millis(20), quiet).map_err(say)?;
    }
    Ok(session)
}

fn host_crash(lab: &Lab) -> Result<String, String> {
    let session = streaming(lab)?;
    drop(session);
    Ok(match lab.place() {
        Place::Replay => "the replay ends",
        Place::Virtual | Place::Tcp => "LEDs off, the session is over",
        Place::Emulated => "a serial line does not say so: LEDs off after 5 s of silence",
        Place::Usb => unreachable!("tried in boards/usb"),
    }
    .to_owned())
}

fn host_hangs(lab: &Lab) -> Result<String, String> {
    let mut session = streaming(lab)?;
    lab.let_silence_pass(&mut session)?;
    let told = format!("LEDs off: {}", nirspi_wire::Fault::HostSilent);
    drop(session);
    Ok(told)
}

fn two_hosts(lab: &Lab) -> Result<String, String> {
    let mut first = Session::open(lab.connect()).map_err(|error| error.to_string())?;
    let second = std::thread::scope(|scope| {
        let second = scope.spawn(|| Session::open(lab.connect()).map(drop));
        // The first host goes on until the second is turned away.
        let mut captures = Vec::new();
        while !second.is_finished() {
            captures.push(measure(&mut first, FRAMES, None));
        }
        (second.join().unwrap(), captures)
    });
    let (second, captures) = second;
    for captured in captures {
        let missing = captured.map_err(|error| error.to_string())?.missing();
        if let Some(missing) = missing {
            return Err(format!("the first host: {missing}"));
        }
    }
    match second {
        Err(SessionError::TurnedAway) => Ok("the first host's captures are whole; the second is told that another program may be using the camera".to_owned()),
        other => Err(format!("the second host: {other:?}")),
    }
}

fn disk_full(lab: &Lab) -> Result<String, String> {
    if !cfg!(target_os = "linux") {
        return Ok("\"cannot record\" with the reason".to_owned());
    }
    let mut session = Session::open(lab.connect()).map_err(|error| error.to_string())?;
    match measure(&mut session, FRAMES, Some(Target::New("/dev/full".into()))) {
        Err(error @ (CaptureError::Recording { .. } | CaptureError::RecordingCut { .. }))
            if error.to_string().contains("cannot record") =>
        {
            Ok("\"cannot record\" with the reason".to_owned())
        }
        other => Err(format!("{other:?}")),
    }
}

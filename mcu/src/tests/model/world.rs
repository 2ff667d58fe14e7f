//! One state of the walk: firmware, FPGA, link and sensors, with what must hold of them.

use crate::machine::{Activity, Session};
use crate::notices::Notice;
use crate::tests::support::{Bench, GOOD_INPUTS, SMALL, packet};
use crate::training::Port;
use crate::{Camera, Crash, Limits, Micros};
use nirspi_wire::packet::{encode, open};
use nirspi_wire::register::{FaultCode, Register};
use nirspi_wire::{
    Answer, Command, Configuration, DeviceMessage, EventKind, GatewareChunk, RebootInto, Reply,
    RunLength, State, crc32, version,
};
use std::format;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::string::String;

/// One step of time: longer than every patience of 100 ms in the firmware.
const TICK: u64 = 101_000;

/// Ages above this many ticks are one age: the longest patience of the firmware is 500 ms, for a
/// piece of a burst.
const OLD: u64 = 5;

/// The most frames that the FPGA makes in a run of the walk.
const FRAMES: u32 = 2;

/// A bitstream of two bytes, sent as two pieces.
const BITSTREAM: [u8; 2] = [0x5A, 0xC3];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Action {
    /// 101 ms pass, then the firmware is polled.
    Tick,
    /// The firmware is polled at once.
    Poll,
    Hello,
    /// A host that speaks a version that this firmware does not.
    Stranger,
    Configure,
    StartEndless,
    StartTwo,
    Stop,
    Status,
    SelfTest,
    Burst,
    FirstPiece,
    LastPiece,
    Reboot,
    /// A packet that is no command.
    Damaged,
    /// A command of a later version.
    Unknown,
    /// The link closes: a cable is pulled or a host leaves.
    Close,
    /// The FPGA completes a frame; it counts as lost in the FPGA while the frame before waits.
    Frame,
    /// A bit of the waiting frame is wrong.
    Spoil,
    /// The FPGA loses everything.
    Reset,
    /// The FPGA latches a fault.
    Latch,
    /// The firmware crashes and restarts. The FPGA goes on.
    Crash,
    Begin(Trouble),
    End(Trouble),
}

/// What lasts until it is repaired.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trouble {
    /// The board's interlock input is open.
    Interlock,
    /// The FPGA's interlock input is open.
    FpgaInterlock,
    Hot,
    /// Between release point and trip point.
    Warm,
    NoSensor,
    /// Every access of the bus fails.
    BusDead,
    /// The bus loses every write.
    BusDeaf,
    /// The ADC's clock stands still.
    NoClock,
    /// The link takes no packet.
    LinkFull,
}

/// What the walk keeps of a state after its last action has been tried.
#[derive(Debug, Clone, Copy)]
pub struct Note {
    pub dark_and_idle: bool,
    pub shines: bool,
    /// A run, a burst or a self-test occupies the FPGA.
    pub busy: bool,
}

/// What a host and a bystander have seen.
#[derive(Debug, Clone, Copy, Default, Hash)]
struct Seen {
    /// Bits of the actions whose replies are outstanding, and how many replies are.
    owed: usize,
    /// Frames of the run that the host was told of.
    frames: Option<u32>,
    /// `Hello` was answered and no run has been started since.
    fresh: bool,
    /// The last greeting came from a host of an unknown version, which gets no events.
    strange: bool,
}

#[derive(Clone)]
pub struct World {
    bench: Bench,
    troubles: u32,
    seen: Seen,
    last_command: Micros,
    /// Ticks without any access that has reached the FPGA, for its watchdog.
    starved: u64,
}

/// Ages in ticks.
fn age(now: Micros) -> impl Fn(Micros) -> u64 + Copy {
    move |then| (now.since(then).0 / TICK).min(OLD)
}

impl World {
    /// Power-up, and the first poll.
    ///
    /// If the first light waits for the test of the LED enables, that takes three ticks, in which the host is silent.
    pub fn new(tries_enables: bool) -> Self {
        let silence = if tries_enables { 4 } else { 2 };
        let limits = Limits {
            host_silence: Micros(silence * TICK),
            stall_min: Micros(TICK + TICK / 2),
            tries_enables,
            ..Limits::REFERENCE
        };
        let mut bench = Bench::new();
        bench.camera = Camera::new(bench.camera.machine().info.clone(), limits);
        let mut world =
            Self { bench, troubles: 0, seen: Seen::default(), last_command: Micros(0), starved: 0 };
        for _ in 0..2 {
            world.poll().expect("a camera after power-up");
        }
        world
    }

    fn stands(&self, trouble: Trouble) -> bool {
        self.troubles & 1 << trouble as u32 != 0
    }

    /// Whether the action can be taken, with at most that many troubles at a time and that many
    /// commands whose replies are outstanding.
    pub fn can(&self, action: Action, troubles: u32, window: usize) -> bool {
        let fpga = &self.bench.fpga;
        match action {
            Action::Tick | Action::Poll | Action::Crash | Action::Reset => true,
            Action::Close => !matches!(self.bench.camera.machine().session, Session::Closed),
            Action::Frame => fpga.running && fpga.made < FRAMES,
            Action::Spoil => fpga.frame.is_some(),
            Action::Latch => fpga.fault == FaultCode::None,
            Action::Begin(trouble) => {
                !self.stands(trouble) && self.troubles.count_ones() < troubles
            }
            Action::End(trouble) => self.stands(trouble),
            Action::Damaged if self.stands(Trouble::LinkFull) => false,
            // What is left is a command.
            _ => self.seen.owed < window && self.bench.camera.machine().takes_commands(),
        }
    }

    /// Takes the action; the error says which law is broken.
    pub fn take(&mut self, action: Action) -> Result<(), String> {
        use Action::*;
        match action {
            Tick => self.tick(),
            Poll => self.poll(),
            Close => self.close(),
            Crash => {
                let crash = crate::Crash::new(self.bench.now, format_args!("x"));
                self.restart(Some(crash));
                Ok(())
            }
            Frame => {
                self.bench.fpga.make_frame();
                Ok(())
            }
            Spoil => {
                if let Some(frame) = &mut self.bench.fpga.frame {
                    frame[33] ^= 0x10;
                }
                Ok(())
            }
            Reset => {
                self.bench.fpga.reset();
                self.apply();
                Ok(())
            }
            Latch => {
                self.bench.fpga.trip(FaultCode::Duty);
                Ok(())
            }
            Begin(trouble) => {
                self.troubles |= 1 << trouble as u32;
                self.apply();
                Ok(())
            }
            End(trouble) => {
                self.troubles &= !(1 << trouble as u32);
                self.apply();
                Ok(())
            }
            command => self.command(command),
        }
    }

    /// Makes the troubles true.
    fn apply(&mut self) {
        let stands = |trouble: Trouble| self.troubles & 1 << trouble as u32 != 0;
        let Bench { fpga, inputs, link, .. } = &mut self.bench;
        *inputs = GOOD_INPUTS;
        inputs.interlock_closed = !stands(Trouble::Interlock);
        if stands(Trouble::Warm) {
            inputs.temperature_centi_celsius = Some(5_500);
        }
        if stands(Trouble::Hot) {
            inputs.temperature_centi_celsius = Some(6_100);
        }
        if stands(Trouble::NoSensor) {
            inputs.temperature_centi_celsius = None;
        }
        link.room = if stands(Trouble::LinkFull) { 0 } else { usize::MAX };
        fpga.dead = stands(Trouble::BusDead);
        fpga.deaf = stands(Trouble::BusDeaf);
        if fpga.clockless && !stands(Trouble::NoClock) {
            // The gateware resets everything when the clock comes back.
            let (dead, deaf) = (fpga.dead, fpga.deaf);
            fpga.reset();
            (fpga.dead, fpga.deaf) = (dead, deaf);
        }
        fpga.clockless = stands(Trouble::NoClock);
        fpga.interlock_closed = !stands(Trouble::FpgaInterlock);
        if !fpga.interlock_closed && fpga.running {
            fpga.trip(FaultCode::Interlock);
        }
    }

    fn tick(&mut self) -> Result<(), String> {
        self.bench.now.0 += TICK;
        let before = self.bench.fpga.accesses;
        self.poll()?;
        let fpga = &mut self.bench.fpga;
        let reached = fpga.accesses > before && !fpga.dead;
        self.starved = if reached || !fpga.running { 0 } else { self.starved + 1 };
        // The watchdog of 200 ms.
        if self.starved == 2 {
            fpga.trip(FaultCode::Watchdog);
            self.starved = 0;
        }
        Ok(())
    }

    fn poll(&mut self) -> Result<(), String> {
        let progress = self.bench.poll();
        self.hear()?;
        if progress.reboot.is_some() {
            // A board restarts at once.
            if self.seen.owed > 0 {
                return Err("a restart before its reply".into());
            }
            self.restart(None);
            return Ok(());
        }
        self.check_light()
    }

    fn close(&mut self) -> Result<(), String> {
        self.bench.close_link();
        self.bench.link.packets.clear();
        self.seen = Seen::default();
        if self.fpga_obeys() && self.bench.fpga.leds_on() {
            return Err("light after the link has closed".into());
        }
        Ok(())
    }

    /// The board restarts: its pin goes low, the host sees the link close, the FPGA notices
    /// nothing.
    fn restart(&mut self, crash: Option<Crash>) {
        let machine = self.bench.camera.machine();
        self.bench.camera = Camera::new(machine.info.clone(), machine.limits);
        if let Some(crash) = crash {
            self.bench.camera.restarted_after(crash);
        }
        self.bench.link.packets.clear();
        self.seen = Seen::default();
    }

    fn command(&mut self, action: Action) -> Result<(), String> {
        let piece = |offset: u32, data| {
            let (total, crc) = (BITSTREAM.len() as u32, crc32(&BITSTREAM));
            Command::LoadGateware(GatewareChunk { offset, total, crc, data })
        };
        let command = match action {
            Action::Hello => Command::Hello { protocol: version::CURRENT },
            Action::Stranger => Command::Hello { protocol: version::CURRENT + 1 },
            Action::Configure => Command::Configure(SMALL),
            Action::StartEndless => Command::Start(RunLength::Continuous),
            Action::StartTwo => Command::Start(RunLength::Frames(FRAMES)),
            Action::Stop => Command::Stop,
            Action::Status => Command::Status,
            Action::SelfTest => Command::SelfTest,
            Action::Burst => Command::RawBurst { samples: 4 },
            Action::FirstPiece => piece(0, &BITSTREAM[..1]),
            Action::LastPiece => piece(1, &BITSTREAM[1..]),
            Action::Reboot => Command::Reboot(RebootInto::Application),
            _ => Command::Configure(Configuration { sweeps: 0, ..SMALL }),
        };
        let mut room = [0; 64];
        let id = id_of(action);
        let bytes = match action {
            Action::Damaged => [7, 7, 7, 0].to_vec(),
            // A number that no command has, after the id.
            Action::Unknown => encode(&(id, 200u8), &mut room).unwrap().to_vec(),
            _ => packet(id, command),
        };
        let finished = self.bench.loader.finished;
        let taken = self.bench.receive(&bytes);
        if taken == 0 {
            // The sensors were looked at first, and a run has to end before the next command.
            self.hear()?;
            return self.check_inputs();
        }
        assert_eq!(taken, bytes.len(), "half of {action:?} was taken");
        if self.bench.loader.finished > finished {
            // New gateware begins as after power-up.
            self.bench.fpga.reset();
            self.apply();
        }
        if action != Action::Damaged {
            self.seen.owed += 1;
            self.last_command = self.bench.now;
        }
        self.seen.strange |= action == Action::Stranger;
        self.hear()?;
        self.check_inputs()
    }

    fn fpga_obeys(&self) -> bool {
        !self.bench.fpga.dead && !self.bench.fpga.deaf
    }

    /// Every call checks the board's own sensors first.
    fn check_inputs(&self) -> Result<(), String> {
        let forbidden = [Trouble::Interlock, Trouble::Hot, Trouble::NoSensor];
        let forbidden = forbidden.into_iter().find(|&trouble| self.stands(trouble));
        match forbidden.filter(|_| self.shines()) {
            Some(trouble) => Err(format!("light with {trouble:?}")),
            None => Ok(()),
        }
    }

    /// The FPGA's enable and the board's pin both allow light.
    fn shines(&self) -> bool {
        self.bench.fpga.leds_on() && self.bench.camera.may_light()
    }

    fn check_light(&self) -> Result<(), String> {
        self.check_inputs()?;
        let camera = &self.bench.camera;
        let machine = camera.machine();
        let running = camera.state() == State::Running;
        if self.bench.fpga.leds_on() && !running && self.fpga_obeys() && machine.loading.is_none() {
            return Err(format!("the FPGA's enable is on in {:?}", camera.state()));
        }
        if !self.shines() {
            return Ok(());
        }
        let silence = self.bench.now.since(self.last_command);
        if !running {
            Err(format!("light in {:?}", camera.state()))
        } else if machine.fault.is_some() {
            Err(format!("light with {:?}", machine.fault))
        } else if !matches!(machine.session, Session::Open) {
            Err("light without a session".into())
        } else if silence > machine.limits.host_silence {
            Err(format!("light after {} us without a command", silence.0))
        } else if machine.limits.tries_enables
            && !machine.enables_sound
            && !matches!(machine.activity, Activity::TestFrame(_) | Activity::Enables(_))
        {
            Err("light before each enable has kept the array dark".into())
        } else {
            Ok(())
        }
    }

    /// Reads what the firmware has sent.
    fn hear(&mut self) -> Result<(), String> {
        for mut packet in core::mem::take(&mut self.bench.link.packets) {
            let length = packet.len() - 1;
            match (open(&mut packet[..length]), &mut self.seen.frames) {
                (Ok(message), _) => self.hear_one(&message)?,
                // The wires have damaged a packet of the FPGA, and the host counts the frame as corrupt.
                (Err(_), Some(frames)) if self.bench.fpga.sends_packets() => *frames += 1,
                (Err(error), _) => return Err(format!("{error:?}")),
            }
        }
        Ok(())
    }

    fn hear_one(&mut self, message: &DeviceMessage<'_>) -> Result<(), String> {
        let seen = &mut self.seen;
        match message {
            DeviceMessage::Reply(Reply { id, outcome }) => {
                seen.owed = seen.owed.checked_sub(1).ok_or("a reply to no command")?;
                if let Ok(Answer::Hello(_)) = outcome {
                    seen.strange = *id == id_of(Action::Stranger);
                    seen.fresh = true;
                    if seen.strange {
                        seen.frames = None;
                    }
                }
                if *id == id_of(Action::StartTwo) && outcome.is_ok() {
                    if seen.frames.is_some() {
                        return Err("two runs at a time".into());
                    }
                    seen.frames = Some(0);
                    seen.fresh = false;
                }
            }
            DeviceMessage::Frame(_) => match &mut seen.frames {
                Some(_) if seen.fresh => return Err("a frame of the host before".into()),
                Some(frames) => *frames += 1,
                None => return Err("a frame of no run".into()),
            },
            DeviceMessage::Event(event) => {
                let EventKind::RunEnded {
                    frames_made,
                    frames_dropped,
                    fpga_frames_lost,
                    fpga_frames_corrupt,
                    ..
                } = event.kind
                else {
                    return Ok(());
                };
                match seen.frames.take() {
                    Some(frames) => {
                        let accounted =
                            frames + frames_dropped + fpga_frames_lost + fpga_frames_corrupt;
                        if accounted != frames_made {
                            return Err(format!(
                                "{accounted} of {frames_made} frames accounted for"
                            ));
                        }
                    }
                    None if seen.strange => {}
                    None => return Err("the end of no run".into()),
                }
            }
            DeviceMessage::Raw(_) | DeviceMessage::Depth(_) | DeviceMessage::Crash(_) => {}
        }
        Ok(())
    }

    pub fn note(&self) -> Note {
        let machine = self.bench.camera.machine();
        let busy = !matches!(machine.activity, Activity::Resting);
        Note {
            dark_and_idle: !self.bench.fpga.leds_on()
                && self.bench.camera.state() == State::Idle
                && self.troubles == 0,
            shines: self.shines(),
            busy,
        }
    }

    /// What decides everything that can follow. Left out: absolute times, numbers of runs, the signal
    /// meter, the count of damaged commands, and counters and buffers of a run that is over.
    pub fn key(&self) -> u64 {
        let hash = &mut DefaultHasher::new();
        let Bench { camera, fpga, now, .. } = &self.bench;
        let machine = camera.machine();
        let age = age(*now);
        (self.troubles, self.seen, self.starved).hash(hash);
        (machine.session as u8).hash(hash);
        for notice in machine.notices.iter() {
            match *notice {
                Notice::Reply { id, outcome } => {
                    let done = matches!(outcome, crate::notices::Outcome::Other(Ok(_)));
                    (0, id, done && id == id_of(Action::StartTwo)).hash(hash);
                }
                Notice::Event(event) => match event.kind {
                    EventKind::RunEnded {
                        run: _,
                        frames_made,
                        frames_dropped,
                        fpga_frames_lost,
                        fpga_frames_corrupt,
                    } => {
                        (1, frames_made, frames_dropped).hash(hash);
                        (fpga_frames_lost, fpga_frames_corrupt).hash(hash);
                    }
                    kind => format!("{kind:?}").hash(hash),
                },
                Notice::Crash => 2.hash(hash),
            }
        }
        let mut in_run = false;
        match &machine.activity {
            Activity::Resting => {}
            Activity::Run(run) => {
                in_run = true;
                let counters = &machine.counters;
                (1, run.key(age), counters.made, counters.sent, counters.dropped).hash(hash);
                (counters.lost, counters.corrupt).hash(hash);
            }
            Activity::Burst(burst) => (2, burst.key(age), fpga.raw.is_some()).hash(hash),
            Activity::TestFrame(test) => (3, test.key(age)).hash(hash),
            Activity::Enables(enables) => (4, enables.key(age)).hash(hash),
            Activity::Training(training) => (5, training.key(age)).hash(hash),
        }
        let busy = !matches!(machine.activity, Activity::Resting);
        let due = machine.last_check.is_none_or(|last| last != *now);
        (machine.setup.is_some(), machine.reboot.is_some(), machine.crash.is_some(), due)
            .hash(hash);
        (machine.off_pending, machine.release_pending, machine.enables_sound).hash(hash);
        match machine.port {
            Port::Unknown(due) => (1, due > *now).hash(hash),
            Port::Sound => 2.hash(hash),
        }
        // The run without light of a self-test may come from an earlier poll.
        if let Activity::Enables(_) = machine.activity {
            fpga.pin.hash(hash);
        }
        (busy.then(|| age(machine.last_command)), busy.then(|| age(self.last_command))).hash(hash);
        machine.loading.as_ref().map(crate::gateware::Loading::key).hash(hash);
        if let Some(fault) = machine.fault {
            format!("{fault:?}").hash(hash);
        }
        (fpga.fault as u32, fpga.running, fpga.flags()).hash(hash);
        if fpga.running || in_run {
            (fpga.made, fpga.lost, fpga.get(Register::Frames)).hash(hash);
        }
        // Of a packet the sequence: number of the run and time are absolute.
        let seen = if fpga.sends_packets() { 5..9 } else { 0..40 };
        let waiting = [fpga.frame.as_ref(), fpga.behind.as_ref().map(|(frame, _)| frame)];
        for head in waiting.map(|frame| frame.map(|frame| &frame[seen.clone()])) {
            if busy {
                head.hash(hash);
            } else {
                head.is_some().hash(hash);
            }
        }
        // Whether the FPGA holds the settings of the only configuration decides whether it starts.
        if machine.setup.is_some() {
            let configured = crate::configure::check(&SMALL, &machine.limits).ok();
            let held = [Register::Patterns, Register::Dwell, Register::Mode, Register::Watchdog]
                .map(|register| fpga.get(register));
            (held, machine.setup == configured).hash(hash);
        }
        if fpga.running {
            (fpga.get(Register::Patterns), fpga.get(Register::Mode)).hash(hash);
        }
        hash.finish()
    }
}

/// A number for each kind of reply that the monitors tell apart.
fn id_of(action: Action) -> u16 {
    match action {
        Action::Hello => 1,
        Action::Stranger => 2,
        Action::StartEndless | Action::StartTwo => 3,
        _ => 4,
    }
}

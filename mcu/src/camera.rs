//! The camera: its state, what happens at each poll, and how LEDs go off.
//!
//! The one law: whatever the link, the host or the FPGA do, safety rules are looked at first on every call,
//! and a rule that speaks has the LEDs off before the call returns. A bus that fails then is asked again on
//! every poll; the FPGA's own watchdog has ended the run by then.

use crate::burst::Burst;
use crate::configure::Setup;
use crate::gateware::Loading;
use crate::outbox::{Notice, Outbox, Outcome, STREAM_HEADER_BYTES, send};
use crate::run::{Counters, Run, SAMPLE_BYTES};
use crate::selftest::TestFrame;
use crate::session::Session;
use crate::{
    BoardInfo, Crash, FpgaBus, GatewareLoader, Inputs, Limits, Micros, PacketSink, Ports, Progress,
    fpga, safety,
};
use nirspi_wire::packet::{MAX_HOST_PACKET, PacketError, open};
use nirspi_wire::register::{Register, control, status};
use nirspi_wire::samples::Words;
use nirspi_wire::{
    Deframed, Deframer, Depth, DeviceMessage, Event, EventKind, Fault, RebootInto, Refusal,
    Request, State,
};

/// The camera's firmware: one value for each camera, under 8 KB, and no other memory.
#[derive(Debug)]
pub struct Camera {
    deframer: Deframer<MAX_HOST_PACKET>,
    machine: Machine,
}

impl Camera {
    /// A camera after power-up: [`State::Idle`].
    #[must_use]
    pub fn new(info: BoardInfo, limits: Limits) -> Self {
        Self { deframer: Deframer::new(), machine: Machine::new(info, limits) }
    }

    /// The firmware has restarted after this crash: the first host is told, after the answer to its `Hello`.
    pub fn restarted_after(&mut self, crash: Crash) {
        self.machine.crash = Some(crash);
    }

    /// Takes bytes from the host, in any pieces; returns how many were taken. The rest is to be offered
    /// again after the next poll: a command is taken only when its reply has a place to wait and the one
    /// before is answered, so a host that does not read is slowed down instead of losing replies.
    #[must_use = "bytes that were not taken must be offered again"]
    pub fn receive<B: FpgaBus, S: PacketSink, G: GatewareLoader>(
        &mut self,
        now: Micros,
        bytes: &[u8],
        inputs: &Inputs,
        ports: &mut Ports<'_, B, S, G>,
    ) -> usize {
        let machine = &mut self.machine;
        machine.guard_sensors(now, inputs, ports.bus);
        let mut rest = bytes;
        while machine.takes_commands() {
            let opened = match self.deframer.next(&mut rest) {
                None => break,
                Some(Deframed::TooLong) => Err(PacketError::TooLong),
                Some(Deframed::Packet(packet)) => open::<Request<'_>>(packet),
            };
            match opened {
                Ok(request) => machine.carry_out(now, &request, inputs, ports),
                Err(_) => machine.count_damage(now),
            }
            machine.flush(ports.sink);
        }
        bytes.len().saturating_sub(rest.len())
    }

    /// Safety rules, then pending replies and events, then at most one frame or piece of a raw burst.
    ///
    /// Call it at least once a millisecond while running, and after [`receive`](Self::receive) where bytes
    /// wait, since the host's silence is judged here.
    pub fn poll<B: FpgaBus, S: PacketSink, G: GatewareLoader>(
        &mut self,
        now: Micros,
        inputs: &Inputs,
        ports: &mut Ports<'_, B, S, G>,
    ) -> Progress {
        self.machine.poll(now, inputs, ports)
    }

    /// Forwards a time-of-flight map of `side` x `side` distances in mm, measured now; dropped if the link
    /// has no room, no host is there, or the map is not of that size.
    pub fn depth<B: FpgaBus, S: PacketSink, G: GatewareLoader>(
        &mut self,
        now: Micros,
        side: u8,
        distances_mm: &[u16],
        ports: &mut Ports<'_, B, S, G>,
    ) {
        let zones = usize::from(side).saturating_mul(side.into());
        let machine = &mut self.machine;
        if zones != distances_mm.len() || !machine.may_stream() {
            return;
        }
        let values = distances_mm.iter().copied();
        let Ok(distances_mm) = Words::pack(values, &mut machine.scratch) else { return };
        let depth = Depth { device_time_us: now.0, side, distances_mm };
        let payload = zones.saturating_mul(2).saturating_add(STREAM_HEADER_BYTES);
        send(&DeviceMessage::Depth(depth), payload, ports.sink);
    }

    /// The host is gone: LEDs off, a half-received command and unsent replies forgotten, back to
    /// [`State::Idle`]. A fault still stands: it is a matter of the device, not of the session.
    pub fn link_closed<B: FpgaBus, S: PacketSink, G: GatewareLoader>(
        &mut self,
        _now: Micros,
        ports: &mut Ports<'_, B, S, G>,
    ) {
        self.deframer = Deframer::new();
        self.machine.close(ports.bus);
    }

    /// What it is doing.
    #[must_use]
    pub fn state(&self) -> State {
        self.machine.state()
    }
}

/// What the FPGA is busy with.
#[derive(Debug)]
pub(crate) enum Activity {
    Resting,
    Run(Run),
    Burst(Burst),
    TestFrame(TestFrame),
}

/// All of the camera but the bytes of a half-received command.
#[derive(Debug)]
pub(crate) struct Machine {
    pub info: BoardInfo,
    pub limits: Limits,
    pub session: Session,
    pub outbox: Outbox,
    pub activity: Activity,
    /// The configuration that the FPGA holds.
    pub setup: Option<Setup>,
    pub fault: Option<Fault>,
    pub counters: Counters,
    pub loading: Option<Loading>,
    pub reboot: Option<RebootInto>,
    /// Of the last start, not reported yet.
    pub crash: Option<Crash>,
    pub commands_damaged: u32,
    pub last_command: Micros,
    last_check: Option<Micros>,
    /// The FPGA has not confirmed that the LEDs are off.
    pub off_pending: bool,
    /// The bus failed when a frame was to be released.
    pub release_pending: bool,
    /// Samples of a frame or distances of a map, on their way into a packet.
    pub scratch: [u8; SAMPLE_BYTES],
}

impl Machine {
    fn new(info: BoardInfo, limits: Limits) -> Self {
        Self {
            info,
            limits,
            session: Session::Closed,
            outbox: Outbox::default(),
            activity: Activity::Resting,
            setup: None,
            fault: None,
            counters: Counters::default(),
            loading: None,
            reboot: None,
            crash: None,
            commands_damaged: 0,
            last_command: Micros(0),
            last_check: None,
            off_pending: false,
            release_pending: false,
            scratch: [0; SAMPLE_BYTES],
        }
    }

    pub fn state(&self) -> State {
        match (&self.fault, &self.activity, &self.setup) {
            (Some(_), ..) => State::Fault,
            (None, Activity::Resting, Some(_)) => State::Configured,
            (None, Activity::Resting, None) => State::Idle,
            (None, ..) => State::Running,
        }
    }

    /// The configuration to start with, if nothing stands against a start.
    pub fn ready_setup(&self) -> Result<Setup, Refusal> {
        match (self.fault, self.state(), self.setup) {
            (Some(fault), ..) => Err(Refusal::Fault(fault)),
            (None, State::Configured, Some(setup)) => Ok(setup),
            (None, state, _) => Err(Refusal::State(state)),
        }
    }

    fn poll<B: FpgaBus, S: PacketSink, G: GatewareLoader>(
        &mut self,
        now: Micros,
        inputs: &Inputs,
        ports: &mut Ports<'_, B, S, G>,
    ) -> Progress {
        let Ports { bus, sink, .. } = ports;
        // While a bitstream is on its way there is no FPGA to talk to, and none that lights anything.
        if self.off_pending && self.loading.is_none() {
            self.leds_off(*bus);
        }
        self.guard_sensors(now, inputs, *bus);
        self.guard_host(now, *bus);
        self.guard_fpga(now, *bus);
        if self.release_pending {
            self.release_pending = fpga::control(*bus, control::RELEASE).is_err();
        }

        let mut worked = self.flush(*sink);
        worked |= match self.activity {
            Activity::Resting => false,
            Activity::Run(_) => self.step_run(now, *bus, *sink),
            Activity::Burst(_) => self.step_burst(now, *bus, *sink),
            Activity::TestFrame(_) => self.step_test(now, *bus),
        };
        worked |= self.flush(*sink);

        let done = matches!(self.activity, Activity::Resting) && self.outbox.is_empty();
        Progress { worked, reboot: self.reboot.filter(|_| done) }
    }

    fn flush(&mut self, sink: &mut impl PacketSink) -> bool {
        self.outbox.flush(&self.info, &mut self.crash, sink)
    }

    pub fn guard_sensors(&mut self, now: Micros, inputs: &Inputs, bus: &mut impl FpgaBus) {
        if self.fault.is_none()
            && let Some(fault) = safety::objection(inputs, &self.limits, None)
        {
            self.trip(now, fault, bus);
        }
    }

    fn guard_host(&mut self, now: Micros, bus: &mut impl FpgaBus) {
        let lit = matches!(&self.activity, Activity::Run(run) if run.is_lit());
        if lit && now.since(self.last_command) > self.limits.host_silence {
            self.trip(now, Fault::HostSilent, bus);
        }
    }

    /// Looks at the FPGA where it is time to.
    fn guard_fpga(&mut self, now: Micros, bus: &mut impl FpgaBus) {
        let resting = matches!(self.activity, Activity::Resting);
        let period = if resting { self.limits.resting_check } else { self.limits.running_check };
        let early = self.last_check.is_some_and(|last| now.since(last) < period);
        if early || self.loading.is_some() {
            return;
        }
        self.last_check = Some(now);
        let status = match fpga::health(bus) {
            Ok(status) => status,
            Err(fault) => return self.trip(now, fault, bus),
        };
        match &self.activity {
            Activity::Run(run) if run.is_lit() => {
                if status & status::RUNNING == 0 {
                    self.run_is_over(now, bus);
                }
            }
            // Left over from before a restart of the firmware alone, say.
            Activity::Resting | Activity::Run(_) => {
                if status & (status::RUNNING | status::LEDS_ON) != 0 {
                    self.leds_off(bus);
                }
            }
            Activity::Burst(_) | Activity::TestFrame(_) => {}
        }
    }

    /// The FPGA is not running any more, and has no fault.
    fn run_is_over(&mut self, now: Micros, bus: &mut impl FpgaBus) {
        let Activity::Run(run) = &self.activity else { return };
        let made = fpga::read(bus, Register::FramesMade).unwrap_or(0);
        if run.is_complete(made) {
            self.end_run(now, None, bus);
        } else {
            // It has been reset.
            self.trip(now, Fault::FpgaStalled, bus);
        }
    }

    /// LEDs off for this reason, until a configuration acknowledges it. The first reason stands.
    pub fn trip(&mut self, now: Micros, fault: Fault, bus: &mut impl FpgaBus) {
        self.leds_off(bus);
        if self.fault.is_none() {
            self.fault = Some(fault);
            self.notify(now, EventKind::Fault(fault));
        }
        match &mut self.activity {
            Activity::Resting => {}
            Activity::Run(run) => run.end(now, None),
            Activity::Burst(_) => self.activity = Activity::Resting,
            Activity::TestFrame(_) => self.finish_test(false, bus),
        }
    }

    /// Believed only when the FPGA says so; until then every poll repeats it.
    pub fn leds_off(&mut self, bus: &mut impl FpgaBus) {
        self.off_pending = fpga::go_dark(bus).is_err();
    }

    pub fn fpga_is_absent(&self) -> bool {
        matches!(self.fault, Some(Fault::FpgaAbsent { .. }))
    }

    /// Nothing is taken while a reply is owed that needs more than the command itself: the end of a run, a
    /// test frame, a restart.
    fn takes_commands(&self) -> bool {
        let busy = match &self.activity {
            Activity::Resting | Activity::Burst(_) => false,
            Activity::Run(run) => !run.is_lit(),
            Activity::TestFrame(_) => true,
        };
        !busy && self.reboot.is_none() && self.outbox.has_room_for_a_command()
    }

    fn count_damage(&mut self, now: Micros) {
        self.commands_damaged = self.commands_damaged.saturating_add(1);
        self.notify(now, EventKind::CommandDamaged);
    }

    /// Whether frames may go out: a host listens, and nothing that comes before them waits.
    pub fn may_stream(&self) -> bool {
        self.session == Session::Open && self.outbox.is_empty()
    }

    pub fn reply(&mut self, id: u16, outcome: Outcome) {
        self.outbox.push(Notice::Reply { id, outcome });
    }

    /// Events are for a host that speaks this protocol; without one, `Status` tells the next.
    pub fn notify(&mut self, now: Micros, kind: EventKind) {
        if self.session == Session::Open {
            self.outbox.push(Notice::Event(Event { device_time_us: now.0, kind }));
        }
    }

    fn close(&mut self, bus: &mut impl FpgaBus) {
        self.leds_off(bus);
        if let Activity::Run(_) = self.activity {
            let _ = self.counters.read(bus);
            let waiting = self.counters.missing();
            self.counters.dropped = self.counters.dropped.wrapping_add(waiting);
        }
        self.activity = Activity::Resting;
        self.session = Session::Closed;
        self.outbox.clear();
        self.setup = None;
        self.loading = None;
    }
}

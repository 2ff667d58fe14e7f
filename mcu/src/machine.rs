//! The state of the camera, and every change of it that switches LEDs, answers a command or reports an event.
//!
//! A busy part (a run, a raw burst, a test frame, a test of the enables, a training) returns the outcome of its step, and the machine
//! acts on the outcome. The parts do not use the machine, so each part can be read and tested
//! alone.
//!
//! # Invariant
//! A fault switches the LEDs off before the call that found the fault returns
//! (`tests::safety::a_rule_also_speaks_where_only_bytes_come_in`), and the first fault stands until a configuration
//! acknowledges it (`tests::safety::the_first_reason_stands_and_is_told_once`).

use crate::burst::{self, Burst};
use crate::configure::Setup;
use crate::enables::{self, Asked, Enables, Purpose};
use crate::gateware::Loading;
use crate::meter::Meter;
use crate::notices::{Notice, Notices, Outcome};
use crate::run::{self, Counters, Fpga, Run, SAMPLE_BYTES};
use crate::selftest::{self, TestFrame};
use crate::training::{self, Port, Training};
use crate::{
    BoardInfo, Crash, FpgaBus, Inputs, Limits, Micros, PacketSink, fpga, safety, test_frame,
};
use nirspi_wire::register::{Design, Register, status};
use nirspi_wire::{Answer, Event, EventKind, Fault, RebootInto, Refusal, RunLength, State};

/// State of the session with the host.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Session {
    /// No `Hello` since power-up or since the link was closed.
    Closed,
    /// Host and camera speak the same protocol version.
    Open,
    /// The host speaks a version that this firmware does not. The camera answers with its own
    /// version and nothing else.
    Foreign,
}

/// What occupies the FPGA.
#[derive(Debug)]
#[cfg_attr(test, derive(Clone))]
pub(crate) enum Activity {
    Resting,
    Run(Run),
    Burst(Burst),
    TestFrame(TestFrame),
    Enables(Enables),
    Training(Training),
}

/// The whole camera except the bytes of a half-received command.
#[derive(Debug)]
#[cfg_attr(test, derive(Clone))]
pub(crate) struct Machine {
    pub info: BoardInfo,
    pub limits: Limits,
    pub session: Session,
    pub notices: Notices,
    pub activity: Activity,
    /// The configuration that the FPGA holds.
    pub setup: Option<Setup>,
    pub fault: Option<Fault>,
    pub counters: Counters,
    pub meter: Meter,
    pub loading: Option<Loading>,
    /// Whether packets are known to come whole over the packet port.
    pub port: Port,
    /// Each LED enable has kept the array dark alone.
    pub enables_sound: bool,
    pub reboot: Option<RebootInto>,
    /// The crash that ended the last start, until a host has got the crash report.
    pub crash: Option<Crash>,
    /// The last configuration has seen the right frequency of the ADC's clock, so that another one while LEDs are lit is a
    /// fault.
    pub clock_counts: bool,
    /// Restarts of the chip since power-up that no host asked for.
    pub restarts: u8,
    pub commands_damaged: u32,
    pub last_command: Micros,
    /// When the FPGA's status was last read.
    pub last_check: Option<Micros>,
    /// The FPGA has not confirmed yet that the LEDs are off.
    pub off_pending: bool,
    /// The bus failed during the release of a frame.
    pub release_pending: bool,
    /// The damaged accesses that a host was last told of, and when.
    pub damage_told: (u32, Micros),
    /// Samples of a frame that the signal meter compares with the next, or distances of a map.
    pub scratch: [u8; SAMPLE_BYTES],
}

impl Machine {
    pub fn new(info: BoardInfo, limits: Limits) -> Self {
        Self {
            info,
            limits,
            session: Session::Closed,
            notices: Notices::default(),
            activity: Activity::Resting,
            setup: None,
            fault: None,
            counters: Counters::default(),
            meter: Meter::new(),
            loading: None,
            port: Port::Unknown(Micros(0)),
            enables_sound: false,
            reboot: None,
            crash: None,
            clock_counts: false,
            restarts: 0,
            commands_damaged: 0,
            last_command: Micros(0),
            last_check: None,
            off_pending: false,
            release_pending: false,
            damage_told: (0, Micros(0)),
            scratch: [0; SAMPLE_BYTES],
        }
    }

    pub fn state(&self) -> State {
        // Nothing of a training shows: the FPGA has no light meanwhile.
        match (&self.fault, &self.activity, &self.setup) {
            (Some(_), ..) => State::Fault,
            (None, Activity::Resting | Activity::Training(_), Some(_)) => State::Configured,
            (None, Activity::Resting | Activity::Training(_), None) => State::Idle,
            (None, ..) => State::Running,
        }
    }

    /// Whether the board's LED-enable pin may be high.
    pub fn may_light(&self) -> bool {
        if self.off_pending || self.fault.is_some() {
            return false;
        }
        match &self.activity {
            Activity::Resting | Activity::Training(_) | Activity::TestFrame(_) => {
                self.setup.is_some() && (self.enables_sound || !self.limits.tries_enables)
            }
            Activity::Run(_) | Activity::Burst(_) => true,
            Activity::Enables(enables) => enables.pin(),
        }
    }

    /// The configuration for a start, if nothing forbids a start.
    fn ready_setup(&self) -> Result<Setup, Refusal> {
        match (self.fault, self.state(), self.setup) {
            (Some(fault), ..) => Err(Refusal::Fault(fault)),
            (None, State::Configured, Some(setup)) => Ok(setup),
            (None, state, _) => Err(Refusal::State(state)),
        }
    }

    pub fn fpga_is_absent(&self) -> bool {
        matches!(self.fault, Some(Fault::FpgaAbsent { .. }))
    }

    /// Whether a host with this protocol listens.
    pub fn is_heard(&self) -> bool {
        self.session == Session::Open
    }

    /// Whether frames may go out: a host listens, and no reply or event waits.
    pub fn may_stream(&self) -> bool {
        self.is_heard() && self.notices.is_empty()
    }

    pub fn reply(&mut self, id: u16, outcome: Outcome) {
        self.notices.push(Notice::Reply { id, outcome });
    }

    /// Reports an event to a host that speaks this protocol. Without such a host the event is not kept: the next host
    /// learns the state from `Status`.
    pub fn notify(&mut self, now: Micros, kind: EventKind) {
        if self.is_heard() {
            self.notices.push(Notice::Event(Event { device_time_us: now.0, kind }));
        }
    }

    pub fn flush(&mut self, sink: &mut impl PacketSink) -> bool {
        self.notices.flush(&self.info, &mut self.crash, sink)
    }

    /// Switches the LEDs off. Every poll repeats this until the FPGA says that the LEDs are off.
    pub fn leds_off(&mut self, bus: &mut impl FpgaBus) {
        self.off_pending = fpga::go_dark(bus).is_err();
    }

    /// Switches the LEDs off for this reason, until a configuration acknowledges the fault. The first fault stands.
    pub fn trip(&mut self, now: Micros, fault: Fault, bus: &mut impl FpgaBus) {
        self.leds_off(bus);
        if self.fault.is_none() {
            self.fault = Some(fault);
            self.notify(now, EventKind::Fault(fault));
        }
        if matches!(fault, Fault::FpgaAbsent { .. }) {
            self.forget_fpga(now);
        }
        match &mut self.activity {
            Activity::Resting => {}
            Activity::Run(run) => run.end(now, None),
            Activity::Burst(_) => self.activity = Activity::Resting,
            Activity::TestFrame(_) => self.finish_test(false, bus),
            Activity::Enables(_) => self.finish_enables(now, enables::Verdict::NoFrame, bus),
            Activity::Training(_) => self.rest(bus),
        }
    }

    /// What was known of an FPGA that is gone, or gets other gateware.
    pub fn forget_fpga(&mut self, now: Micros) {
        self.port = Port::Unknown(now);
        self.enables_sound = false;
    }

    /// A start failed: an FPGA that did not take the start is a fault, any other refusal changes nothing.
    fn refused_start(&mut self, now: Micros, refusal: Refusal, bus: &mut impl FpgaBus) -> Refusal {
        if let Refusal::Fault(fault) = refusal {
            self.trip(now, fault, bus);
        }
        refusal
    }

    /// `Start` or `RawBurst`. The reply to the first one comes after the test of the LED enables.
    pub fn light_up(&mut self, id: u16, now: Micros, asked: Asked, bus: &mut impl FpgaBus) {
        let is_due = self.limits.tries_enables
            && !self.enables_sound
            && self.ready_setup().is_ok()
            && asked.check().is_ok()
            // The bring-up design has no LEDs, and sees the levels of its own pins.
            && fpga::design(bus) == Ok(Design::Camera);
        if is_due {
            self.activity = Activity::Enables(Enables::new(id, Purpose::First(asked)));
            self.release_pending = false;
        } else {
            let outcome = self.show(now, asked, bus);
            self.reply(id, Outcome::Other(outcome));
        }
    }

    fn show(
        &mut self,
        now: Micros,
        asked: Asked,
        bus: &mut impl FpgaBus,
    ) -> Result<Answer<'static>, Refusal> {
        match asked {
            Asked::Run(length) => self.start_run(now, length, bus),
            Asked::Burst(samples) => self.start_burst(now, samples, bus),
        }
        .map(|()| Answer::Done)
    }

    /// A run of frames.
    fn start_run(
        &mut self,
        now: Micros,
        length: RunLength,
        bus: &mut impl FpgaBus,
    ) -> Result<(), Refusal> {
        let setup = self.ready_setup()?;
        let counters = self.counters.of_next_run();
        let run = match Run::start(now, (counters.run, length), &setup, &self.limits, bus) {
            Ok(run) => run,
            Err(refusal) => return Err(self.refused_start(now, refusal, bus)),
        };
        self.counters = counters;
        self.meter.start(now, &setup);
        self.release_pending = false;
        self.activity = Activity::Run(run);
        Ok(())
    }

    /// Sends at most one frame, then ends the run if it is over.
    ///
    /// Never inlined, because one of the boards has little flash, and both the poll and the end of a transfer call this.
    #[inline(never)]
    pub fn step_run(
        &mut self,
        now: Micros,
        bus: &mut impl FpgaBus,
        sink: &mut impl PacketSink,
    ) -> bool {
        let may_send = self.may_stream();
        let absent = self.fpga_is_absent();
        let Activity::Run(run) = &mut self.activity else { return false };
        let (counters, meter) = (&mut self.counters, &mut self.meter);
        let path = run::Path { counters, meter, scratch: &mut self.scratch, may_send };
        let may_come = !absent && !self.release_pending;
        let release_pending = &mut self.release_pending;
        let worked = run.take(now, path, (may_come, release_pending), bus, sink);
        match run.progress(now, &self.counters) {
            run::Progress::Complete => self.end_run(now, None, bus),
            run::Progress::Stalled => {
                self.trip(now, Fault::FpgaStalled, bus);
                self.wind_up(now, bus);
            }
            run::Progress::UnderWay => self.wind_up(now, bus),
        }
        worked
    }

    /// Switches the LEDs off. `reply` and `RunEnded` follow the last frame.
    pub fn end_run(&mut self, now: Micros, reply: Option<(u16, Outcome)>, bus: &mut impl FpgaBus) {
        self.leds_off(bus);
        if let Activity::Run(run) = &mut self.activity {
            run.end(now, reply);
        }
        self.wind_up(now, bus);
    }

    /// Ends a run whose LEDs are off, once its last frame has been sent or counted.
    fn wind_up(&mut self, now: Micros, bus: &mut impl FpgaBus) {
        let fpga = match (self.fpga_is_absent(), self.off_pending) {
            (true, _) => Fpga::Absent,
            (false, true) => Fpga::MayBeLit,
            (false, false) => Fpga::Dark,
        };
        let Activity::Run(run) = &mut self.activity else { return };
        let Some(run::Ended { reply, event }) = run.wind_up(now, &mut self.counters, fpga, bus)
        else {
            return;
        };
        self.activity = Activity::Resting;
        if let Some((id, outcome)) = reply {
            self.reply(id, outcome);
        }
        self.notify(now, event);
    }

    fn start_burst(
        &mut self,
        now: Micros,
        samples: u16,
        bus: &mut impl FpgaBus,
    ) -> Result<(), Refusal> {
        let setup = self.ready_setup()?;
        match Burst::start(now, samples, &setup, &self.limits, bus) {
            Ok(burst) => self.activity = Activity::Burst(burst),
            Err(refusal) => return Err(self.refused_start(now, refusal, bus)),
        }
        Ok(())
    }

    /// Sends at most one piece.
    pub fn step_burst(
        &mut self,
        now: Micros,
        bus: &mut impl FpgaBus,
        sink: &mut impl PacketSink,
    ) -> bool {
        let may_send = self.may_stream();
        let Activity::Burst(burst) = &mut self.activity else { return false };
        match burst.step(now, may_send, bus, sink) {
            burst::Step::Waiting => return false,
            burst::Step::Stalled => {
                self.trip(now, Fault::FpgaStalled, bus);
                return false;
            }
            burst::Step::Sent => return true,
            burst::Step::Done => {}
            burst::Step::Dropped => self.notify(now, EventKind::RawDropped),
        }
        self.activity = Activity::Resting;
        true
    }

    /// `SelfTest`. The reply comes after the test frame.
    pub fn self_test(&mut self, id: u16, now: Micros, inputs: &Inputs, bus: &mut impl FpgaBus) {
        let report = selftest::examine(bus, inputs, &self.limits);
        let may_light = report.failed == 0
            && self.fault.is_none()
            && !self.is_loading()
            && safety::objection(inputs, &self.limits, None).is_none();
        if !may_light {
            return self.reply(id, Outcome::Other(Ok(Answer::SelfTest(report))));
        }
        let test = TestFrame::new(id, report, now);
        let begun = test_frame::begin(bus, &test_frame::GENERATOR, &self.limits);
        self.activity = Activity::TestFrame(test);
        self.release_pending = false;
        if !begun {
            self.finish_test(false, bus);
        }
    }

    /// Checks the test frame if it has come.
    pub fn step_test(&mut self, now: Micros, bus: &mut impl FpgaBus) -> bool {
        let Activity::TestFrame(test) = &self.activity else { return false };
        let Some(passed) = test.step(now, bus) else { return false };
        // The bring-up design has no LEDs, and sees the levels of its own pins.
        if passed && fpga::design(bus) == Ok(Design::Camera) {
            let (id, report) = test.verdict(passed);
            self.activity = Activity::Enables(Enables::new(id, Purpose::Report(report)));
        } else {
            self.finish_test(passed, bus);
        }
        true
    }

    fn finish_test(&mut self, passed: bool, bus: &mut impl FpgaBus) {
        let Activity::TestFrame(test) = &self.activity else { return };
        let (id, report) = test.verdict(passed);
        self.rest(bus);
        self.reply(id, Outcome::Other(Ok(Answer::SelfTest(report))));
    }

    /// Goes on with the test of the LED enables.
    #[cold]
    #[inline(never)]
    pub fn step_enables(&mut self, now: Micros, bus: &mut impl FpgaBus) -> bool {
        let Activity::Enables(enables) = &mut self.activity else { return false };
        let Some(verdict) = enables.step(now, bus, &self.limits) else { return false };
        self.finish_enables(now, verdict, bus);
        true
    }

    fn finish_enables(&mut self, now: Micros, verdict: enables::Verdict, bus: &mut impl FpgaBus) {
        let Activity::Enables(enables) = &self.activity else { return };
        let (id, purpose) = (enables.id, enables.purpose);
        self.rest(bus);
        match verdict {
            enables::Verdict::Stuck(fault) => self.trip(now, fault, bus),
            enables::Verdict::Sound => self.enables_sound = true,
            enables::Verdict::NoLight | enables::Verdict::NoFrame => {}
        }
        let outcome = match (purpose, self.fault) {
            (Purpose::Report(before), _) => Ok(Answer::SelfTest(enables::report(verdict, before))),
            (Purpose::First(_), Some(fault)) => Err(Refusal::Fault(fault)),
            (Purpose::First(_), None) if verdict == enables::Verdict::NoFrame => Err(Refusal::Bus),
            (Purpose::First(asked), None) => self.show(now, asked, bus),
        };
        self.reply(id, Outcome::Other(outcome));
    }

    /// Begins a training if one is due and nothing forbids a start; true if it has begun.
    ///
    /// Never inlined, like the other steps that no run takes, so that those of a run are short.
    #[cold]
    #[inline(never)]
    pub fn start_training(&mut self, now: Micros, bus: &mut impl FpgaBus) -> bool {
        let Port::Unknown(due) = self.port else { return false };
        let may_start = matches!(self.activity, Activity::Resting)
            && now >= due
            && self.fault.is_none()
            && !self.off_pending
            && !self.is_loading()
            && self.reboot.is_none();
        if !may_start {
            return false;
        }
        self.port = Port::Unknown(Micros(now.0.saturating_add(self.limits.resting_check.0)));
        let ready = fpga::design(bus).is_ok()
            && fpga::health(bus).is_ok_and(|status| status & status::INTERLOCK_CLOSED != 0);
        if !ready {
            return false;
        }
        self.release_pending = false;
        self.activity = Activity::Training(Training::new(now));
        if !training::start(bus, now, &self.limits) {
            self.rest(bus);
            return false;
        }
        true
    }

    /// Compares the packet of the training if it has come.
    #[cold]
    #[inline(never)]
    pub fn step_training(
        &mut self,
        now: Micros,
        bus: &mut impl FpgaBus,
        sink: &mut impl PacketSink,
    ) -> bool {
        let Activity::Training(training) = &mut self.activity else { return false };
        let Some(verdict) = training.step(now, bus, sink) else { return false };
        let is_ready = bus.frame_ready();
        // A line that is low although the FPGA has the packet is a broken wire.
        let is_told =
            fpga::read(bus, Register::Status).is_ok_and(|status| status & status::FRAME_READY != 0);
        self.rest(bus);
        match verdict {
            training::Verdict::Sound => self.port = Port::Sound,
            training::Verdict::Damaged => self.trip(now, fpga::UNREADABLE, bus),
            training::Verdict::Late if is_told && !is_ready => {
                self.trip(now, Fault::FpgaStalled, bus);
            }
            training::Verdict::Late => {}
        }
        if let Port::Unknown(due) = &mut self.port {
            *due = Micros(now.0.saturating_add(self.limits.resting_check.0));
        }
        true
    }

    /// Ends a run of the firmware's own: stops it, gives back its frame, and restores the configuration.
    fn rest(&mut self, bus: &mut impl FpgaBus) {
        self.activity = Activity::Resting;
        self.leds_off(bus);
        self.release_pending = fpga::release(bus).is_err();
        if let Some(setup) = self.setup
            && fpga::set(bus, &setup, &self.limits).is_err()
        {
            self.setup = None;
        }
    }

    /// Whether a host is loading a bitstream, so that the FPGA may have no host port.
    pub fn is_loading(&self) -> bool {
        self.loading.is_some() && !matches!(self.session, Session::Closed)
    }

    /// Ends the session: LEDs off, and everything begun for that host is forgotten but the pieces of
    /// a bitstream, which a host that comes back goes on with.
    pub fn close(&mut self, bus: &mut impl FpgaBus) {
        self.leds_off(bus);
        if let Activity::Run(_) = self.activity {
            let _ = self.counters.read(bus);
            self.counters.drop_missing();
        }
        self.activity = Activity::Resting;
        self.session = Session::Closed;
        self.notices.clear();
        self.setup = None;
    }
}

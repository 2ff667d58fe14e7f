//! Commands of the host: taken one at a time, each answered once.
//!
//! # Invariant
//! - No command takes effect before the host's `Hello` has shown that the host speaks this protocol
//!   (`tests::commands::nothing_is_done_before_hello`).
//! - A refused command changes nothing, with one exception: a `Configure` that failed half way on
//!   the bus ([`Refusal::Bus`]) leaves the FPGA without a configuration
//!   (`tests::commands::settings_that_do_not_arrive_leave_nothing_configured`).

use crate::enables::Asked;
use crate::machine::{Activity, Machine, Session};
use crate::notices::{Notice, Outcome};
use crate::training::Port;
use crate::{
    FpgaBus, GatewareLoader, Inputs, Micros, PacketSink, Ports, configure, fpga, gateware, safety,
};
use nirspi_wire::register::{Design, NO_CLOCK, ORDER_TABLE, Register, status};
use nirspi_wire::{
    Answer, Capabilities, Command, Configuration, Fault, GatewareChunk, PATTERNS, PatternOrder,
    Refusal, Request, State, Status, version,
};

impl Machine {
    pub(crate) fn carry_out<B: FpgaBus, S: PacketSink, G: GatewareLoader>(
        &mut self,
        now: Micros,
        request: &Request<'_>,
        inputs: &Inputs,
        ports: &mut Ports<'_, B, S, G>,
    ) {
        let &Request { id, command } = request;
        let Ports { bus, loader, .. } = ports;
        self.last_command = now;
        let done = match command {
            Command::Hello { protocol } => return self.hello(id, now, protocol, *bus),
            _ if !self.is_heard() => Err(Refusal::Protocol { device: version::CURRENT }),
            Command::Configure(configuration) => {
                self.configure(now, &configuration, inputs, *bus).map(|()| Answer::Done)
            }
            Command::Start(length) => return self.light_up(id, now, Asked::Run(length), *bus),
            Command::Stop => return self.stop(id, now, *bus, Outcome::DONE),
            Command::Status => Ok(Answer::Status(self.status(now, inputs, *bus))),
            Command::SelfTest => match self.state() {
                State::Running => Err(Refusal::State(State::Running)),
                _ => return self.self_test(id, now, inputs, *bus),
            },
            Command::ReadRegister { address } => read_register(address, *bus).map(Answer::Register),
            Command::LoadGateware(chunk) => self
                .load_gateware(&chunk, *bus, *loader)
                .map(|next_offset| Answer::Gateware { next_offset }),
            Command::RawBurst { samples } => {
                return self.light_up(id, now, Asked::Burst(samples), *bus);
            }
            Command::Reboot(into) => {
                self.reboot = Some(into);
                return self.stop(id, now, *bus, Outcome::DONE);
            }
        };
        self.reply(id, Outcome::Other(done));
    }

    /// Refuses a command that this firmware does not know.
    pub(crate) fn refuse_unknown(&mut self, now: Micros, id: u16) {
        let refusal = if self.is_heard() {
            self.last_command = now;
            Refusal::Unknown
        } else {
            Refusal::Protocol { device: version::CURRENT }
        };
        self.reply(id, Outcome::Other(Err(refusal)));
    }

    /// Opens a new session, and ends what the host before has left running.
    fn hello(&mut self, id: u16, now: Micros, protocol: u16, bus: &mut impl FpgaBus) {
        let gateware = fpga::version(bus);
        let added = match fpga::design(bus) {
            Ok(Design::BringUp) => Capabilities::BRING_UP,
            Ok(Design::Camera) | Err(_) => Capabilities::default(),
        };
        let spoken = version::speaks(protocol);
        let answered = if spoken { protocol } else { version::CURRENT };
        self.stop(id, now, bus, Outcome::Hello { protocol: answered, gateware, added });
        self.session = if spoken { Session::Open } else { Session::Foreign };
        if spoken && self.crash.is_some() {
            self.notices.push(Notice::Crash);
        }
    }

    /// Switches the LEDs off. The reply comes when no frame of the run is left, and `RunEnded`
    /// follows the reply.
    fn stop(&mut self, id: u16, now: Micros, bus: &mut impl FpgaBus, outcome: Outcome) {
        if let Activity::Run(_) = self.activity {
            return self.end_run(now, Some((id, outcome)), bus);
        }
        self.leds_off(bus);
        self.activity = Activity::Resting;
        self.reply(id, outcome);
    }

    /// `Configure`: checks, acknowledges, writes and reads back the settings.
    fn configure(
        &mut self,
        now: Micros,
        configuration: &Configuration<'_>,
        inputs: &Inputs,
        bus: &mut impl FpgaBus,
    ) -> Result<(), Refusal> {
        if self.state() == State::Running {
            return Err(Refusal::State(State::Running));
        }
        let mut setup =
            configure::check(configuration, &self.limits).map_err(Refusal::Configuration)?;
        if let Some(fault) = safety::objection(inputs, &self.limits, self.fault) {
            return Err(Refusal::Fault(fault));
        }
        // No configuration shows that the cause of these is gone.
        if let Some(fault @ (Fault::BoardEnableStuck | Fault::FpgaEnableStuck)) = self.fault {
            return Err(Refusal::Fault(fault));
        }
        let mut acknowledged = fpga::acknowledge(bus);
        if acknowledged.is_ok() && self.fault == Some(fpga::WRONG_CLOCK) {
            acknowledged = fpga::check_clock(bus);
        }
        if let Err(fault) = acknowledged {
            self.trip(now, fault, bus);
            return Err(Refusal::Fault(fault));
        }
        // Simulated gateware may have had no time to count.
        self.clock_counts = fpga::check_clock(bus).is_ok();
        self.loading = None;
        self.setup = None;
        if bus.ring().is_some() {
            setup.mode |= setup.port();
        }
        let table = match &configuration.order {
            PatternOrder::Table(table) => fpga::set_table(bus, table),
            PatternOrder::Natural | PatternOrder::Sequency => Ok(()),
        };
        table.and_then(|()| fpga::set(bus, &setup, &self.limits)).map_err(|_| Refusal::Bus)?;
        self.setup = Some(setup);
        self.fault = None;
        // The packet port is tried before the host's next command.
        if let Port::Unknown(due) = &mut self.port {
            *due = now;
        }
        Ok(())
    }

    fn status(&mut self, now: Micros, inputs: &Inputs, bus: &mut impl FpgaBus) -> Status {
        let resting = matches!(self.activity, Activity::Resting);
        if let Activity::Run(_) = self.activity {
            // If the FPGA does not answer, the last counts stay; `guard_fpga` notices its absence.
            let _ = self.counters.read(bus);
        }
        // If the FPGA does not answer, the reply assumes that the LEDs are on.
        let leds_on = fpga::read(bus, Register::Status)
            .map_or(!resting, |status| status != NO_CLOCK && status & status::LEDS_ON != 0);
        Status {
            state: self.state(),
            fault: self.fault,
            uptime_us: now.0,
            run: self.counters.run,
            frames_made: self.counters.made,
            frames_sent: self.counters.sent,
            frames_dropped: self.counters.dropped,
            fpga_frames_lost: self.counters.lost,
            fpga_frames_corrupt: self.counters.corrupt,
            commands_damaged: self.commands_damaged,
            temperature_centi_celsius: inputs.temperature_centi_celsius.unwrap_or(i16::MIN),
            duty_permille: self.setup.map_or(0, |setup| setup.duty_permille),
            leds_on,
            interlock_closed: inputs.interlock_closed,
            signal: self.meter.signal(),
        }
    }

    fn load_gateware(
        &mut self,
        chunk: &GatewareChunk<'_>,
        bus: &mut impl FpgaBus,
        loader: &mut impl GatewareLoader,
    ) -> Result<u32, Refusal> {
        if self.state() == State::Running {
            return Err(Refusal::State(State::Running));
        }
        if chunk.offset == 0 && fpga::identify(bus).is_err() {
            loader.forget();
        }
        let next_offset = gateware::take(&mut self.loading, chunk, loader)?;
        // The first piece makes the FPGA forget its settings.
        self.setup = None;
        self.forget_fpga(Micros(0));
        Ok(next_offset)
    }
}

fn read_register(address: u16, bus: &mut impl FpgaBus) -> Result<u32, Refusal> {
    let table = ORDER_TABLE..ORDER_TABLE.saturating_add(PATTERNS);
    if Register::at(address).is_none() && !table.contains(&address) {
        return Err(Refusal::NoSuchRegister { address });
    }
    bus.read(address).map_err(|_| Refusal::Bus)
}

//! The camera's public interface: the calls that a board makes.
//!
//! # Invariant
//! Every call checks the safety rules first. If a rule is broken, the LEDs are off before the call
//! returns (`tests::safety::a_rule_also_speaks_where_only_bytes_come_in`).

use crate::machine::Machine;
use crate::packets::{STREAM_HEADER_BYTES, send};
use crate::{
    BoardInfo, Crash, FpgaBus, GatewareLoader, Inputs, Lamps, Limits, Micros, PacketSink, Ports,
    Progress,
};
use nirspi_wire::packet::{MAX_HOST_PACKET, parse, request_id, unseal};
use nirspi_wire::samples::Words;
use nirspi_wire::{Deframed, Deframer, Depth, DeviceMessage, Request, State};

/// The camera's firmware. One value is one camera; a value takes 8.4 KB at most and uses no other
/// memory.
#[derive(Debug)]
#[cfg_attr(test, derive(Clone))]
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

    /// Records that the firmware has restarted after this crash. The first host gets a crash report
    /// after the answer to its `Hello`.
    pub fn restarted_after(&mut self, crash: Crash) {
        self.machine.crash = Some(crash);
    }

    /// Says how often the chip has restarted since power-up without a host that asked for it. The fault lamp shows the
    /// number.
    pub fn restarted(&mut self, times: u32) {
        self.machine.restarts = u8::try_from(times).unwrap_or(u8::MAX);
    }

    /// Takes bytes from the host, in pieces of any length, and returns how many bytes were taken.
    /// The board offers the rest again after the next poll. A command is taken only when its reply
    /// has a place to wait and the command before is answered, so a host that does not read is
    /// slowed down instead of losing replies.
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
            let payload = match self.deframer.next(&mut rest) {
                None => break,
                Some(Deframed::TooLong) => None,
                Some(Deframed::Packet(packet)) => unseal(packet).ok(),
            };
            let request =
                payload.map(|payload| (parse::<Request<'_>>(payload), request_id(payload)));
            match request {
                Some((Ok(request), _)) => machine.carry_out(now, &request, inputs, ports),
                Some((Err(_), Some(id))) => machine.refuse_unknown(now, id),
                _ => machine.count_damage(now),
            }
            machine.flush(ports.sink);
        }
        bytes.len().saturating_sub(rest.len())
    }

    /// Checks the safety rules, then sends pending replies and events, then at most one frame or
    /// one piece of a raw burst.
    ///
    /// While the camera is running, call `poll` at least once a millisecond. Where bytes wait, call
    /// `poll` after [`receive`](Self::receive), because `poll` judges the host's silence.
    pub fn poll<B: FpgaBus, S: PacketSink, G: GatewareLoader>(
        &mut self,
        now: Micros,
        inputs: &Inputs,
        ports: &mut Ports<'_, B, S, G>,
    ) -> Progress {
        self.machine.poll(now, inputs, ports)
    }

    /// Sends or counts the packet that the board has transferred into the link's room
    /// ([`Target::Link`](crate::Target::Link)). Call this straight after the transfer: the next claim takes the room back.
    /// After any other transfer the call does nothing.
    pub fn forward<B: FpgaBus, S: PacketSink, G: GatewareLoader>(
        &mut self,
        now: Micros,
        ports: &mut Ports<'_, B, S, G>,
    ) {
        if !self.machine.step_run(now, ports.bus, ports.sink) {
            self.machine.step_training(now, ports.bus, ports.sink);
        }
    }

    /// Forwards a time-of-flight map of `side` x `side` distances in mm, measured now. The map is
    /// dropped if the link has no room, if no host is there, or if the map is not of that size.
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
        machine.meter.forget();
        let Ok(distances_mm) = Words::pack(values, &mut machine.scratch) else { return };
        let depth = Depth { device_time_us: now.0, side, distances_mm };
        let payload = zones.saturating_mul(2).saturating_add(STREAM_HEADER_BYTES);
        send(&DeviceMessage::Depth(depth), payload, ports.sink);
    }

    /// Ends the session: LEDs off, half-received command and unsent replies forgotten, back to
    /// [`State::Idle`]. A latched fault stays, because a fault belongs to the device and not to the
    /// session.
    pub fn link_closed<B: FpgaBus, S: PacketSink, G: GatewareLoader>(
        &mut self,
        _now: Micros,
        ports: &mut Ports<'_, B, S, G>,
    ) {
        self.deframer = Deframer::new();
        self.machine.close(ports.bus);
    }

    /// What the camera is doing.
    #[must_use]
    pub fn state(&self) -> State {
        self.machine.state()
    }

    /// Whether the board's own LED-enable pin may be high: from a configuration until a fault, the end of the session, or a
    /// stop that the FPGA has not confirmed; and in a part of the test of the LED enables, before which a configuration
    /// leaves the pin low. The board sets the pin after every [`poll`](Self::poll)
    /// (`tests::model::every_reachable_state_keeps_the_laws_of_light`).
    #[must_use]
    pub fn may_light(&self) -> bool {
        self.machine.may_light()
    }

    /// What the board's lamps show now. The board sets them in every turn of its loop.
    #[must_use]
    pub fn lamps(&self, now: Micros) -> Lamps {
        let machine = &self.machine;
        let light = machine.off_pending || machine.state() == State::Running;
        Lamps::at(now, machine.is_heard(), light, machine.fault, machine.restarts)
    }

    /// What the calls act on, for the exhaustive walk of `tests::model`.
    #[cfg(test)]
    pub(crate) const fn machine(&self) -> &Machine {
        &self.machine
    }
}

//! The work of one poll: safety rules first, then waiting replies, then one step of the FPGA's
//! activity.
//!
//! # Invariant
//! LEDs are on only while the camera is running, whatever the link, the host or the FPGA do
//! (`tests::laws::nothing_panics_and_light_means_running`). After a bus failure every poll repeats
//! the command to stop, and the FPGA's own watchdog ends the run meanwhile
//! (`tests::safety::a_dead_bus_is_an_absent_fpga_and_is_told_again_to_stop_on_every_poll`).

use crate::limits::CLOCK_CHECK;
use crate::machine::{Activity, Machine};
use crate::{FpgaBus, GatewareLoader, Inputs, Micros, PacketSink, Ports, Progress, fpga, safety};
use nirspi_wire::register::{Register, status};
use nirspi_wire::{EventKind, Fault};

/// Shortest time between two events about damaged accesses.
const DAMAGE_PERIOD: Micros = Micros(1_000_000);

impl Machine {
    pub fn poll<B: FpgaBus, S: PacketSink, G: GatewareLoader>(
        &mut self,
        now: Micros,
        inputs: &Inputs,
        ports: &mut Ports<'_, B, S, G>,
    ) -> Progress {
        let Ports { bus, sink, .. } = ports;
        // While a bitstream is loaded, the FPGA has no host port and lights no LED.
        if self.off_pending && !self.is_loading() {
            self.leds_off(*bus);
        }
        self.guard_sensors(now, inputs, *bus);
        self.guard_host(now, *bus);
        self.guard_fpga(now, *bus);
        if self.release_pending {
            self.release_pending = fpga::release(*bus).is_err();
        }

        self.tell_damage(now, *bus);
        let mut worked = self.flush(*sink);
        worked |= match self.activity {
            Activity::Resting => self.start_training(now, *bus),
            Activity::Run(_) => self.step_run(now, *bus, *sink),
            Activity::Burst(_) => self.step_burst(now, *bus, *sink),
            Activity::TestFrame(_) => self.step_test(now, *bus),
            Activity::Enables(_) => self.step_enables(now, *bus),
            Activity::Training(_) => self.step_training(now, *bus, *sink),
        };
        worked |= self.flush(*sink);

        let done = matches!(self.activity, Activity::Resting) && self.notices.is_empty();
        Progress { worked, reboot: self.reboot.filter(|_| done) }
    }

    pub fn guard_sensors(&mut self, now: Micros, inputs: &Inputs, bus: &mut impl FpgaBus) {
        if self.fault.is_none()
            && let Some(fault) = safety::objection(inputs, &self.limits, None)
        {
            self.trip(now, fault, bus);
        }
    }

    fn guard_host(&mut self, now: Micros, bus: &mut impl FpgaBus) {
        let lit = match &self.activity {
            Activity::Run(run) => run.is_lit(),
            Activity::Enables(_) => true,
            _ => false,
        };
        if lit && now.since(self.last_command) > self.limits.host_silence {
            self.trip(now, Fault::HostSilent, bus);
        }
    }

    /// Checks the FPGA when a check is due.
    fn guard_fpga(&mut self, now: Micros, bus: &mut impl FpgaBus) {
        let resting = matches!(self.activity, Activity::Resting);
        let period = if resting { self.limits.resting_check } else { self.limits.running_check };
        let early = self.last_check.is_some_and(|last| now.since(last) < period);
        if early || self.is_loading() {
            return;
        }
        let was = self.last_check.replace(now);
        let status = match fpga::health(bus) {
            Ok(status) => status,
            Err(fault) => return self.trip(now, fault, bus),
        };
        match &self.activity {
            Activity::Run(run) if run.is_lit() => {
                let part = |time: Micros| time.0 / CLOCK_CHECK.0;
                if self.clock_counts
                    && was.is_some_and(|was| part(was) != part(now))
                    && let Err(fault) = fpga::check_clock(bus)
                {
                    return self.trip(now, fault, bus);
                }
                if self.meter.has_no_whole_packet() {
                    return self.trip(now, fpga::UNREADABLE, bus);
                }
                // A second look: one wrong bit must not end a run.
                let over = |status: u32| status & status::RUNNING == 0;
                if over(status) && fpga::health(bus).is_ok_and(over) {
                    self.run_is_over(now, bus);
                }
            }
            // LEDs at rest may be on after a restart of the firmware alone.
            Activity::Resting | Activity::Run(_) => {
                if status & (status::RUNNING | status::LEDS_ON) != 0 {
                    self.leds_off(bus);
                }
            }
            Activity::Burst(_)
            | Activity::TestFrame(_)
            | Activity::Enables(_)
            | Activity::Training(_) => {}
        }
    }

    /// Acts on an FPGA that is not running any more and has no fault.
    fn run_is_over(&mut self, now: Micros, bus: &mut impl FpgaBus) {
        let Activity::Run(run) = &self.activity else { return };
        let made = fpga::read(bus, Register::FramesMade).unwrap_or(0);
        if run.is_complete(made) {
            self.end_run(now, None, bus);
        } else {
            // The FPGA has been reset.
            self.trip(now, Fault::FpgaStalled, bus);
        }
    }

    /// Whether a command can be taken. No command is taken while a reply waits for the end of a
    /// run, a self-test or a restart, nor during the training.
    pub fn takes_commands(&self) -> bool {
        let busy = match &self.activity {
            Activity::Resting | Activity::Burst(_) => false,
            Activity::Run(run) => !run.is_lit(),
            Activity::TestFrame(_) | Activity::Enables(_) | Activity::Training(_) => true,
        };
        !busy && self.reboot.is_none() && self.notices.has_room_for_a_command()
    }

    /// Tells the host of damaged accesses between firmware and FPGA. The event waits until the link has
    /// taken every other notice.
    fn tell_damage(&mut self, now: Micros, bus: &impl FpgaBus) {
        let (told, at) = self.damage_told;
        let total = bus.damaged();
        let is_new = total != told && (told == 0 || now.since(at) >= DAMAGE_PERIOD);
        if is_new && self.may_stream() {
            self.damage_told = (total, now);
            self.notify(now, EventKind::FpgaAccessesDamaged { total });
        }
    }

    pub fn count_damage(&mut self, now: Micros) {
        self.commands_damaged = self.commands_damaged.saturating_add(1);
        self.notify(now, EventKind::CommandDamaged);
    }
}

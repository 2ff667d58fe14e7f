//! Every variant of every enum of the protocol, by name.
//!
//! The matches below are exhaustive, so a new variant does not compile until it is listed here; what is listed here must
//! have frozen bytes (`every_variant_is_frozen`).

use nirspi_wire::{
    Answer, Command, ConfigField, ConfigProblem, DeviceMessage, EventKind, Fault, PatternOrder,
    RebootInto, Refusal, Request, RunLength, SampleSource, State,
};
use std::collections::BTreeSet;

type Seen = BTreeSet<&'static str>;

macro_rules! variants {
    ($($function:ident: $enum:ident { $($variant:ident),* $(,)? })*) => {
        $(fn $function(value: &$enum, seen: &mut Seen) {
            seen.insert(match value {
                $($enum::$variant { .. } => concat!(stringify!($enum), "::", stringify!($variant)),)*
            });
        })*

        /// All of them.
        pub const ALL: &[&str] =
            &[$($(concat!(stringify!($enum), "::", stringify!($variant)),)*)*];
    };
}

variants! {
    command: Command {
        Hello, Configure, Start, Stop, Status, SelfTest, ReadRegister, LoadGateware, RawBurst, Reboot,
    }
    pattern_order: PatternOrder { Natural, Sequency, Table }
    sample_source: SampleSource { Detector, TestPattern }
    run_length: RunLength { Continuous, Frames }
    reboot_into: RebootInto { Application, Bootloader }
    device_message: DeviceMessage { Reply, Frame, Raw, Depth, Event, Crash }
    answer: Answer { Hello, Done, Status, SelfTest, Register, Gateware }
    refusal: Refusal {
        Protocol, State, Configuration, Fault, NoSuchRegister, RawLength, GatewareOffset, GatewareCrc,
        Unsupported, Bus, Unknown,
    }
    config_problem: ConfigProblem { OutOfRange, OrderEntry }
    config_field: ConfigField {
        Patterns, ClocksPerPattern, Blanked, AdcLatency, Sweeps, OrderLength, DutyPermille, Frames,
    }
    state: State { Idle, Configured, Running, Fault }
    fault: Fault {
        Interlock, OverTemperature, TemperatureSensor, Duty, OverRange, FpgaWatchdog, FpgaAbsent,
        FpgaConfiguration, FpgaStalled, HostSilent, BoardEnableStuck, FpgaEnableStuck,
    }
    event_kind: EventKind { Fault, RunEnded, RawDropped, CommandDamaged, FpgaAccessesDamaged }
}

/// Notes every variant in a request.
pub fn of_request(request: &Request, seen: &mut Seen) {
    command(&request.command, seen);
    match &request.command {
        Command::Configure(configuration) => {
            pattern_order(&configuration.order, seen);
            sample_source(&configuration.source, seen);
        }
        Command::Start(length) => run_length(length, seen),
        Command::Reboot(into) => reboot_into(into, seen),
        Command::Hello { .. }
        | Command::Stop
        | Command::Status
        | Command::SelfTest
        | Command::ReadRegister { .. }
        | Command::LoadGateware(_)
        | Command::RawBurst { .. } => {}
    }
}

/// Notes every variant in a message of the device.
pub fn of_device_message(message: &DeviceMessage, seen: &mut Seen) {
    device_message(message, seen);
    match message {
        DeviceMessage::Reply(reply) => match &reply.outcome {
            Ok(given) => {
                answer(given, seen);
                if let Answer::Status(status) = given {
                    state(&status.state, seen);
                }
            }
            Err(given) => of_refusal(given, seen),
        },
        DeviceMessage::Event(event) => event_kind(&event.kind, seen),
        DeviceMessage::Frame(_)
        | DeviceMessage::Raw(_)
        | DeviceMessage::Depth(_)
        | DeviceMessage::Crash(_) => {}
    }
}

fn of_refusal(given: &Refusal, seen: &mut Seen) {
    refusal(given, seen);
    match given {
        Refusal::State(at) => state(at, seen),
        Refusal::Fault(cause) => fault(cause, seen),
        Refusal::Configuration(problem) => {
            config_problem(problem, seen);
            if let ConfigProblem::OutOfRange { field, .. } = problem {
                config_field(field, seen);
            }
        }
        Refusal::Protocol { .. }
        | Refusal::NoSuchRegister { .. }
        | Refusal::RawLength { .. }
        | Refusal::GatewareOffset { .. }
        | Refusal::GatewareCrc
        | Refusal::Unsupported
        | Refusal::Bus
        | Refusal::Unknown => {}
    }
}

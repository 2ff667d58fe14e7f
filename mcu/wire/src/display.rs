//! Faults, states and settings in words.
//!
//! The firmware sends values and no text, so the firmware does not link this module.

use crate::message::HOST_SILENCE_US;
use crate::register::{DAMAGED, Design, IDENTITY, NO_CLOCK};
use crate::{ConfigField, Fault, State};
use core::fmt::{Display, Formatter, Result};

/// What the device is doing, to be read after "the camera is".
impl Display for State {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        f.write_str(match self {
            Self::Idle => "not configured",
            Self::Configured => "configured and not running",
            Self::Running => "running",
            Self::Fault => "stopped by a fault",
        })
    }
}

/// What gateware is built for.
impl Display for Design {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        f.write_str(match self {
            Self::Camera => "camera",
            Self::BringUp => {
                "bring-up without ADC: samples are made of the levels of the LED lines"
            }
        })
    }
}

/// Why the LEDs were switched off, as a clause of its own.
impl Display for Fault {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        match *self {
            Self::Interlock => f.write_str("the enclosure's interlock is open"),
            Self::OverTemperature { centi_celsius } => {
                let sign = if centi_celsius < 0 { "-" } else { "" };
                let tenths = centi_celsius.unsigned_abs().saturating_add(5) / 10;
                let (whole, tenth) = (tenths / 10, tenths % 10);
                write!(
                    f,
                    "the LED array's temperature of {sign}{whole}.{tenth} °C is over the limit"
                )
            }
            Self::TemperatureSensor => {
                f.write_str("the temperature sensor does not answer, or reads what cannot be")
            }
            Self::Duty => f.write_str("more LEDs were lit over time than the array withstands"),
            Self::OverRange => f.write_str("too many samples were outside the ADC's range"),
            Self::FpgaWatchdog => f.write_str("the firmware left the FPGA alone for too long"),
            Self::FpgaAbsent { identity: 0 | u32::MAX } => f.write_str("the FPGA does not answer"),
            Self::FpgaAbsent { identity: IDENTITY } => {
                f.write_str("the FPGA's gateware is of another version than the firmware")
            }
            Self::FpgaAbsent { identity: NO_CLOCK } => {
                f.write_str("the FPGA answers, but the ADC's clock does not reach it")
            }
            Self::FpgaAbsent { identity: DAMAGED } => f.write_str(
                "what passes between the FPGA and the firmware comes damaged: check the wires of the host port",
            ),
            Self::FpgaAbsent { identity } => {
                write!(f, "the FPGA's identity is {identity:#010x}, expected {IDENTITY:#010x}")
            }
            Self::FpgaConfiguration => {
                f.write_str("the FPGA refused a configuration that the firmware had accepted")
            }
            Self::FpgaStalled => f.write_str("the FPGA made no frame in time"),
            Self::HostSilent => {
                let seconds = HOST_SILENCE_US / 1_000_000;
                write!(f, "the host sent no command for {seconds} s while LEDs were on")
            }
            Self::BoardEnableStuck => f.write_str(
                "LEDs shine while the board's LED enable is low: its pin, its wire or the array's AND gate is stuck; \
                 switch the camera off and repair it",
            ),
            Self::FpgaEnableStuck => f.write_str(
                "LEDs shine while the FPGA's LED enable is low: its pin, its wire or the array's AND gate is stuck; \
                 switch the camera off and repair it",
            ),
        }
    }
}

/// A part of a configuration, as a noun.
impl Display for ConfigField {
    fn fmt(&self, f: &mut Formatter<'_>) -> Result {
        f.write_str(match self {
            Self::Patterns => "the number of patterns",
            Self::ClocksPerPattern => "the number of clocks per pattern",
            Self::Blanked => "the number of blanked samples",
            Self::AdcLatency => "the ADC latency",
            Self::Sweeps => "the number of sweeps",
            Self::OrderLength => "the length of the order table",
            Self::DutyPermille => "the share of LEDs lit, in thousandths,",
            Self::Frames => "the number of frames",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Version;
    use crate::packet::PacketError;
    use std::string::ToString;

    #[test]
    fn a_temperature_is_told_in_degrees_rounded_to_tenths() {
        let told = |centi_celsius| Fault::OverTemperature { centi_celsius }.to_string();
        assert_eq!(told(6012), "the LED array's temperature of 60.1 °C is over the limit");
        assert!(told(5995).contains(" 60.0 °C"), "{}", told(5995));
        assert!(told(0).contains(" 0.0 °C"), "{}", told(0));
        assert!(told(-1).contains(" -0.0 °C") && told(-1234).contains(" -12.3 °C"));
        assert!(told(i16::MIN).contains(" -327.7 °C"));
    }

    #[test]
    fn an_absent_fpga_and_a_foreign_one_are_told_apart() {
        let told = |identity| Fault::FpgaAbsent { identity }.to_string();
        assert_eq!(told(0), "the FPGA does not answer");
        assert_eq!(told(u32::MAX), told(0));
        assert!(told(0x1234).contains("0x00001234"), "{}", told(0x1234));
        let all = [told(IDENTITY), told(0), told(NO_CLOCK), told(DAMAGED), told(7)];
        assert!(all.iter().enumerate().all(|(at, words)| !all[..at].contains(words)), "{all:?}");
    }

    #[test]
    fn a_version_has_three_numbers_and_every_damage_its_own_words() {
        assert_eq!(Version(0, 4, 7).to_string(), "0.4.7");
        let all = [
            PacketError::BufferTooSmall,
            PacketError::TooLong,
            PacketError::Cobs,
            PacketError::Crc,
            PacketError::Message,
        ];
        let all = all.map(|error| error.to_string());
        assert!(all.iter().enumerate().all(|(at, words)| !all[..at].contains(words)), "{all:?}");
        assert!(all.iter().all(|words| words.contains(' ')), "{all:?}");
    }

    #[test]
    fn no_state_or_fault_is_shown_by_the_name_of_its_variant() {
        let states = [State::Idle, State::Configured, State::Running, State::Fault];
        for state in states {
            let told = state.to_string();
            assert!(told.len() > 3 && !told.contains(&std::format!("{state:?}")), "{told}");
        }
        let fields = [ConfigField::Patterns, ConfigField::OrderLength, ConfigField::Frames];
        assert!(fields.iter().all(|field| field.to_string().starts_with("the ")));
        let faults = [
            Fault::Interlock,
            Fault::TemperatureSensor,
            Fault::Duty,
            Fault::OverRange,
            Fault::FpgaWatchdog,
            Fault::FpgaConfiguration,
            Fault::FpgaStalled,
            Fault::HostSilent,
            Fault::BoardEnableStuck,
            Fault::FpgaEnableStuck,
        ];
        for fault in faults {
            let told = fault.to_string();
            assert!(told.contains(' ') && !told.contains(&std::format!("{fault:?}")), "{told}");
        }
        assert!(Fault::HostSilent.to_string().contains(" 5 s "));
    }
}

//! Which bytes of a host show that the host is there, so that light may stay on.

use super::support::*;
use crate::Limits;
use nirspi_wire::packet::encode;
use nirspi_wire::{EventKind, Fault, RunLength};
use std::vec::Vec;

/// Twice the time after which a silent host ends a run, with a frame each 10 ms and these bytes each second.
fn two_silences_with(bench: &mut Bench, bytes: &[u8]) {
    let limit_us = Limits::SIMULATED.host_silence.0;
    for step in 0..2 * limit_us / 10_000 {
        if step % 100 == 0 {
            bench.receive(bytes);
        }
        bench.fpga.make_frame();
        bench.after(10_000);
    }
}

/// A request of a command that exists in no version.
fn unknown_command() -> Vec<u8> {
    encode(&[9u8, 0x7F], &mut [0; 16]).unwrap().to_vec()
}

#[test]
fn a_host_of_a_later_version_is_heard_by_the_commands_that_this_firmware_refuses() {
    let mut bench = Bench::running(RunLength::Continuous);
    two_silences_with(&mut bench, &unknown_command());
    assert!(bench.fpga.leds_on());
}

#[test]
fn bytes_that_are_no_command_of_the_session_are_not_taken_for_a_host() {
    let damaged = {
        let mut packet = unknown_command();
        packet[1] ^= 1;
        packet
    };
    let mut bench = Bench::running(RunLength::Continuous);
    two_silences_with(&mut bench, &damaged);
    assert!(!bench.fpga.leds_on());
    assert!(bench.heard_events().contains(&EventKind::Fault(Fault::HostSilent)));
}

//! Tests of wires that damage what they carry between firmware and FPGA.

use super::host_port::{Device, bus};
use super::support::*;
use crate::{BusError, FpgaBus};
use nirspi_wire::register::{DAMAGED, IDENTITY, ORDER_TABLE, Register, control};
use nirspi_wire::{Command, DeviceMessage, EventKind, Fault, Refusal, Reply, RunLength, State};
use proptest::prelude::*;
use std::vec;
use std::vec::Vec;

/// Up to three wrong bits of an access: 16 of the address, 32 of the value, 16 of the check.
fn wrong() -> impl Strategy<Value = u64> {
    prop::collection::vec(0..64u32, 0..4)
        .prop_map(|bits| bits.into_iter().fold(0, |wrong, bit| wrong | 1 << bit))
}

proptest! {
    #[test]
    fn no_damaged_answer_is_believed_and_no_damaged_write_is_taken_for_done(
        wires in prop::collection::vec(prop_oneof![Just(0), wrong()], 0..40),
        words: [u32; 8],
    ) {
        let mut bus = bus();
        bus.port().wrong = wires.into();
        for word in words {
            let before = bus.port().fpga.clone();
            let written = bus.write(Register::Scratch.address(), word);
            let taken = bus.port().fpga.writes - before.writes;
            let held = bus.port().fpga.get(Register::Scratch);
            prop_assert!(taken <= 1, "a write acts once");
            prop_assert_eq!(held, if taken == 1 { word } else { before.get(Register::Scratch) });
            match written {
                Ok(()) => prop_assert_eq!(taken, 1),
                Err(error) => prop_assert_eq!(error, BusError::Damaged),
            }
            // No other register has been written.
            let mut others = bus.port().fpga.registers.clone();
            others.insert(Register::Scratch.address(), before.get(Register::Scratch));
            prop_assert_eq!(&others, &before.registers);
            match bus.read(Register::Scratch.address()) {
                Ok(value) => prop_assert_eq!(value, held),
                Err(error) => prop_assert_eq!(error, BusError::Damaged),
            }
        }
    }
}

#[test]
fn a_damaged_answer_is_asked_for_again_and_counted_and_an_error_after_three() {
    for damaged in 0..5u32 {
        let mut bus = bus();
        let scratch = Register::Scratch.address();
        bus.port().fpga.registers.insert(scratch, 7);
        bus.port().wrong = (0..damaged).map(|bit| 1 << (20 + bit)).collect();
        let answer = if damaged < 3 { Ok(7) } else { Err(BusError::Damaged) };
        assert_eq!(bus.read(scratch), answer, "{damaged}");
        assert_eq!(bus.damaged(), damaged.min(3));
        assert_eq!(bus.port().wrong.len() as u32, damaged.saturating_sub(3));
    }
}

#[test]
fn a_damaged_start_is_repeated_and_starts_once() {
    // A word for each access: the count before, the start, the count after.
    for wires in [vec![0, 1 << 40], vec![0, 0, 1 << 20], vec![1 << 50, 1 << 3, 0, 1 << 20, 1 << 63]]
    {
        let mut bus = bus();
        bus.port().wrong = wires.iter().copied().collect();
        bus.write(Register::Control.address(), control::START).unwrap();
        assert_eq!((bus.port().fpga.writes, bus.port().fpga.running), (1, true), "{wires:?}");
    }
}

#[test]
fn a_stop_is_sent_even_if_no_answer_comes_through() {
    let mut bus = bus();
    bus.write(Register::Control.address(), control::START).unwrap();
    // The count before is not known any more: three reads, the stop, three reads.
    bus.write(ORDER_TABLE, 1).unwrap();
    bus.port().wrong = [1 << 20, 1 << 20, 1 << 20, 0, 1 << 20, 1 << 20, 1 << 20].into();
    assert_eq!(bus.write(Register::Control.address(), control::STOP), Err(BusError::Damaged));
    assert!(!bus.port().fpga.running);
}

/// A reset FPGA counts its writes from 0 again.
#[test]
fn a_write_after_a_reset_of_the_fpga_is_taken() {
    let mut bus = bus();
    for word in 0..5 {
        bus.write(Register::Scratch.address(), word).unwrap();
    }
    bus.port().fpga.reset();
    bus.write(Register::Scratch.address(), 9).unwrap();
    assert_eq!(bus.port().fpga.get(Register::Scratch), 9);
    assert_eq!(bus.damaged(), 0);
}

#[test]
fn noise_in_every_answer_ends_in_a_fault_of_its_own() {
    let mut device = Device::new(bus());
    device.ask(Command::Configure(SMALL));
    device.ask(Command::Start(RunLength::Continuous));
    device.bus.port().always_wrong = 1 << 30;
    device.bus.port().is_noisy = true;
    device.now.0 += 1_000;
    for _ in 0..3 {
        device.turn(&[]);
    }
    let fault = Fault::FpgaAbsent { identity: DAMAGED };
    assert!(events(&device.heard()).contains(&EventKind::Fault(fault)));
    assert_eq!(device.camera.state(), State::Fault);
    assert!(!device.camera.may_light());

    device.bus.port().always_wrong = 0;
    device.ask(Command::Configure(SMALL));
    assert_eq!(device.camera.state(), State::Configured);
}

#[test]
fn damage_ends_no_run_and_the_host_is_told_at_most_once_a_second() {
    let mut device = Device::new(bus());
    device.ask(Command::Configure(SMALL));
    device.ask(Command::Start(RunLength::Continuous));
    device.heard();
    let mut told = Vec::new();
    let begun = device.now.0;
    while device.now.0 < begun + 3_500_000 {
        device.bus.port().fpga.make_frame();
        device.bus.port().wrong = [1 << 33, 0, 1 << 5].into_iter().collect();
        device.now.0 += 900;
        device.turn(&[]);
        if device.now.0 % 1_000_000 < 1_000 {
            device.ask(Command::Status);
        }
        told.extend(events(&device.heard()));
    }
    assert_eq!(device.camera.state(), State::Running);
    assert!((3..=5).contains(&told.len()), "{told:?}");
    let total = device.bus.damaged();
    assert!(total > 3_000, "{total}");
    let counts = told.iter().map(|event| match *event {
        EventKind::FpgaAccessesDamaged { total } => total,
        ref other => panic!("{other:?}"),
    });
    assert!(counts.is_sorted_by(|a, b| a < b));
}

/// Wires that are crossed or stand still: the same wrong answer every time.
#[test]
fn a_steady_wrong_identity_is_told_as_it_reads_and_no_other_register_is() {
    for wrong in [0, 0x00FF_0000_0000, 0xF000_0000_1234] {
        let mut bus = bus();
        let right = bus.read(Register::Identity.address()).unwrap();
        assert_eq!((right, bus.damaged()), (IDENTITY, 0));
        bus.port().always_wrong = wrong;
        let seen = Ok(IDENTITY ^ (wrong >> 16) as u32);
        assert_eq!(bus.read(Register::Identity.address()), seen);
        for register in [Register::Version, Register::Status] {
            let answer = bus.read(register.address());
            assert_eq!(answer.is_err(), wrong != 0, "{register:?}");
        }
    }
    let mut noisy = bus();
    noisy.port().wrong = [1 << 20, 1 << 21, 1 << 22].into_iter().collect();
    assert_eq!(noisy.read(Register::Identity.address()), Err(BusError::Damaged));
}

#[test]
fn lines_that_stand_still_are_an_absent_fpga() {
    for (byte, level) in [(0, 0), (0xFF, u32::MAX)] {
        let mut bus = bus();
        bus.port().stands_at = Some(byte);
        let mut device = Device::new(bus);
        let refused = Err(Refusal::Fault(Fault::FpgaAbsent { identity: level }));
        let heard = device.ask(Command::Configure(SMALL));
        assert!(
            heard.iter().any(|message| {
                matches!(message, DeviceMessage::Reply(Reply { outcome, .. }) if *outcome == refused)
            }),
            "{heard:?}"
        );
    }
}

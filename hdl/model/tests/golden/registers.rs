//! Tests of the host port at rest: which addresses exist, and what reads and writes do.

use crate::bench::Bench;
use nirspi_hdl_model::Gateware;
use nirspi_wire::register::{Access, ORDER_TABLE, Register, status};
use proptest::prelude::*;

#[test]
fn power_up_is_the_reset_column_of_the_map_with_leds_off() {
    let mut gateware = Gateware::new();
    assert!(!gateware.lines().enable && !gateware.running());
    assert!(!gateware.frame_ready() && gateware.frame().is_none());
    assert!(!gateware.raw_ready() && gateware.raw().is_none());
    // `Clocks` says what runs now.
    for &register in Register::ALL.iter().filter(|register| **register != Register::Clocks) {
        assert_eq!(gateware.read(register.address()), Some(register.reset()), "{register:?}");
    }
}

proptest! {
    #[test]
    fn a_register_holds_what_its_access_says(value: u32) {
        let mut bench = Bench::new();
        // `Control` is left out because its bits act.
        for &register in Register::ALL.iter().filter(|r| r.access() != Access::Command) {
            let before = bench.get(register);
            bench.set(register, value);
            let after = match register {
                // This write counts too.
                Register::Writes => before + 1,
                _ if register.access() == Access::ReadWrite => value,
                _ => before,
            };
            prop_assert_eq!(bench.get(register), after, "{:?}", register);
        }
    }

    #[test]
    fn the_order_table_keeps_ten_bits_of_every_entry(values in prop::collection::vec(any::<u32>(), 1024)) {
        let mut gateware = Gateware::new();
        for (address, &value) in (ORDER_TABLE..).zip(&values) {
            prop_assert_eq!(gateware.read(address), Some(0));
            prop_assert!(gateware.write(address, value));
        }
        for (address, value) in (ORDER_TABLE..).zip(&values) {
            prop_assert_eq!(gateware.read(address), Some(value & 0x3FF));
        }
    }
}

#[test]
fn nothing_answers_between_the_registers_and_beyond_the_table() {
    let mut gateware = Gateware::new();
    let mut answers = 0;
    for address in 0..=u16::MAX {
        let table = (0x400..0x800).contains(&address);
        let expected = Register::at(address).is_some() || table;
        assert_eq!(gateware.read(address).is_some(), expected, "{address:#x}");
        assert_eq!(gateware.write(address, 0), expected, "{address:#x}");
        answers += usize::from(expected);
    }
    assert_eq!(answers, Register::ALL.len() + 1024);
}

#[test]
fn every_write_that_is_taken_counts() {
    let mut gateware = Gateware::new();
    for address in [Register::Control.address(), Register::Identity.address(), ORDER_TABLE, 0x8000]
    {
        gateware.write(address, 0);
    }
    let writes = Register::Writes.address();
    assert_eq!(gateware.read(writes), Some(4));
    gateware.set_adc_clock(None);
    gateware.write(Register::Scratch.address(), 1);
    gateware.set_adc_clock(Some(nirspi_wire::ADC_HZ));
    assert_eq!(gateware.read(writes), Some(0));
}

#[test]
fn the_clock_counts_in_and_out_of_runs() {
    let mut bench = Bench::new();
    bench.ticks(7);
    bench.start();
    bench.ticks(5);
    assert_eq!(bench.get(Register::ClockLow), 12);
    assert_eq!(bench.get(Register::ClockHigh), 0);
}

#[test]
fn the_interlock_can_be_read() {
    let mut bench = Bench::new();
    assert!(bench.status(status::INTERLOCK_CLOSED));
    bench.0.set_interlock(false);
    assert!(!bench.status(status::INTERLOCK_CLOSED));
}

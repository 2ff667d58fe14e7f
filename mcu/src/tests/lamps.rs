//! What the lamps of the board show in each state.

use super::support::*;
use crate::{Lamps, Micros, RESTARTS_SHOWN, flashes};
use nirspi_wire::{Command, Fault, RunLength};
use std::vec::Vec;

const FAULTS: [Fault; 12] = [
    Fault::Interlock,
    Fault::OverTemperature { centi_celsius: 7_000 },
    Fault::TemperatureSensor,
    Fault::Duty,
    Fault::OverRange,
    Fault::FpgaAbsent { identity: 0 },
    Fault::FpgaConfiguration,
    Fault::FpgaStalled,
    Fault::FpgaWatchdog,
    Fault::HostSilent,
    Fault::BoardEnableStuck,
    Fault::FpgaEnableStuck,
];

/// Flashes, the longest dark time of the fault lamp and its longest flash in milliseconds, over one minute.
fn seen(fault: Option<Fault>, restarts: u8) -> (Vec<u32>, u64, u64) {
    let (mut groups, mut group, mut dark, mut longest) = (Vec::new(), 0, 0u64, 0);
    let (mut bright, mut longest_flash) = (0, 0);
    let mut was_lit = true;
    for ms in 0..60_000 {
        let lit = Lamps::at(Micros(ms * 1_000), true, false, fault, restarts).fault;
        if lit && !was_lit {
            // A pause is much longer than the dark time between two flashes.
            if dark > 1_000 {
                groups.push(core::mem::take(&mut group));
            }
            group += 1;
        }
        dark = if lit { 0 } else { dark + 1 };
        longest = longest.max(dark);
        bright = if lit { bright + 1 } else { 0 };
        longest_flash = longest_flash.max(bright);
        was_lit = lit;
    }
    (groups, longest, longest_flash)
}

#[test]
fn a_person_can_count_the_flashes_of_each_fault_and_no_two_faults_flash_alike() {
    for (fault, number) in FAULTS.into_iter().zip(1..) {
        assert_eq!(u32::from(flashes(fault)), number, "{fault:?}");
        // A restart of the firmware does not hide a fault.
        let (groups, longest, _) = seen(Some(fault), 3);
        assert!(groups.len() > 6, "{fault:?}: {groups:?}");
        // The first group began before the minute.
        assert!(groups[1..].iter().all(|&count| count == number), "{fault:?}: {groups:?}");
        assert!((1_000..=2_000).contains(&longest), "{fault:?}: dark for {longest} ms");
    }
}

#[test]
fn short_flashes_count_the_restarts_that_no_host_asked_for() {
    let (groups, dark, _) = seen(None, 0);
    assert_eq!((groups.len(), dark), (0, 60_000));
    for restarts in [1, 2, 10, 200] {
        let (groups, longest, flash) = seen(None, restarts);
        assert!(groups.len() > 6, "{groups:?}");
        let shown = u32::from(restarts.min(RESTARTS_SHOWN));
        assert!(groups[1..].iter().all(|&count| count == shown), "{restarts}: {groups:?}");
        assert!((1_000..=2_000).contains(&longest) && flash == 50, "{longest} {flash}");
    }
}

#[test]
fn the_ready_lamp_blinks_until_a_host_has_come() {
    let bench = Bench::new();
    let states = |bench: &Bench| -> Vec<bool> {
        (0..8).map(|beat| bench.camera.lamps(Micros(beat * 250_000)).ready).collect()
    };
    assert_eq!(states(&bench), [true, false, true, false, true, false, true, false]);
    assert_eq!(states(&Bench::open()), [true; 8]);
}

/// The board drives the pin, and the FPGA cannot light LEDs while the pin is low.
#[test]
fn the_light_lamp_is_on_in_light_and_the_led_pin_may_be_high_from_the_configuration_until_a_fault()
{
    let mut bench = Bench::open();
    let seen = |bench: &Bench| {
        (bench.fpga.leds_on(), bench.camera.lamps(bench.now).light, bench.camera.may_light())
    };
    assert_eq!(seen(&bench), (false, false, false));
    bench.ask(Command::Configure(SMALL)).unwrap();
    assert_eq!(seen(&bench), (false, false, true), "configured, and dark");
    bench.ask(Command::Start(RunLength::Continuous)).unwrap();
    assert_eq!(seen(&bench), (true, true, true));
    bench.inputs.interlock_closed = false;
    bench.poll();
    assert_eq!(seen(&bench), (false, false, false), "and the run's last frames still come");
}

//! Crash, restart, boot loader, supply, gateware.

use super::*;
use crate::chip::Cause;
use crate::machine::{Machine, Stop};
use nirspi_tests::tapped::{Tapped, measure};
use nirspi_wire::{Fault, RebootInto, State};

/// No memory is there.
const NOWHERE: u32 = 0x6000_0000;

/// A crash is dark after a few instructions, before the record is written.
pub const AT_ONCE_US: f64 = 10.0;

/// Crashes a camera that is lit; returns the time until it is dark.
pub fn dark_after_a_crash_us(camera: &Camera) -> f64 {
    dark_after_us(camera, |machine| machine.derail(NOWHERE))
}

/// The time until a camera that is lit is dark.
fn dark_after_us(camera: &Camera, what: fn(&mut Machine)) -> f64 {
    camera.with(move |machine| {
        let before = machine.now_us();
        what(machine);
        machine.run_while(1_000.0, |chip| !chip.is_lit());
        let (fell, lit) = machine.chip(|chip| chip.light_log.last().copied()).unwrap();
        assert!(!lit);
        fell as f64 / 1e6 - before
    })
}

#[test]
fn a_crash_while_lit_is_dark_at_once_and_the_next_host_is_told_of_it_once() {
    let Some(camera) = connected_as(even()) else { return };
    let mut session = Session::open(camera.link()).unwrap();
    start(&mut session, &natural());
    pass(&camera, 2.0);
    assert!(is_lit(&camera));
    let dark_us = dark_after_a_crash_us(&camera);
    assert!(dark_us < AT_ONCE_US, "{dark_us} us");
    drop(session);
    pass(&camera, 5.0);
    camera.connect();
    let hear = || {
        let mut tapped = Tapped::new(camera.link());
        let mut session = Session::open(tapped.link()).unwrap();
        session.status(&mut IgnorePackets).unwrap();
        assert!(measure(&mut session, &natural(), 1).counters.is_complete(), "it measures again");
        tapped.crashes()
    };
    let told = hear();
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(told[0].contains("fault at 0x60000000"), "{told:?}");
    assert!(hear().is_empty());
    assert_eq!(camera.with(|machine| machine.resets.len()), 1);
    camera.assert_no_violation();
}

#[test]
fn the_boot_loader_is_entered_as_after_a_reset() {
    let Some(camera) = connected_as(even()) else { return };
    let mut session = Session::open(camera.link()).unwrap();
    start(&mut session, &natural());
    session.command(request::Reboot(RebootInto::Bootloader), &mut IgnorePackets).unwrap();
    let stop = camera.with(|machine| {
        loop {
            match machine.run_us(1e6) {
                Stop::Reset(_) => {}
                stop => return stop,
            }
        }
    });
    // The boot loader's stack is where its vector table says, below the firmware's limit.
    assert_eq!(stop, Stop::BootLoader { stack: 0x2000_5000, vectors: 0x0BF9_0000 });
    assert!(!is_lit(&camera));
    camera.assert_no_violation();
}

#[test]
fn a_restart_that_the_host_asks_for_is_back_on_the_bus() {
    let Some(camera) = connected_as(even()) else { return };
    let mut session = Session::open(camera.link()).unwrap();
    session.command(request::Reboot(RebootInto::Application), &mut IgnorePackets).unwrap();
    drop(session);
    assert!(camera.with(|machine| machine.run_while(1e6, |chip| !chip.usb.is_configured())));
    camera.connect();
    let mut session = Session::open(camera.link()).unwrap();
    assert!(measure(&mut session, &natural(), 2).counters.is_complete());
    camera.assert_no_violation();
}

#[test]
fn a_supply_that_sags_while_lit_is_dark_at_once_and_stays_dark() {
    let Some(camera) = connected_as(even()) else { return };
    // The option byte as delivered: only the voltage detector sees the sag.
    camera.with(|machine| machine.chip(|chip| chip.brown_out_level = 0));
    let mut session = Session::open(camera.link()).unwrap();
    start(&mut session, &natural());
    pass(&camera, 2.0);
    assert!(is_lit(&camera));
    camera.with(|machine| machine.chip(|chip| chip.supply_millivolts = 2_700));
    pass(&camera, 2.0);
    assert!(!is_lit(&camera));
    // It waits for the supply, and the watchdog restarts it again and again.
    pass(&camera, 3_000.0);
    let (resets, lit) =
        camera.with(|machine| (machine.resets.len(), machine.chip(|chip| chip.is_lit())));
    assert!(resets >= 3 && !lit, "{resets} starts");
    camera.with(|machine| machine.chip(|chip| chip.supply_millivolts = 3_300));
    camera.with(|machine| machine.run_while(1e6, |chip| !chip.usb.is_configured()));
    camera.connect();
    let mut session = Session::open(camera.link()).unwrap();
    assert!(measure(&mut session, &natural(), 2).counters.is_complete());
    camera.assert_no_violation();
}

/// What the next host is told of the restart before.
fn told_after(camera: &Camera) -> Vec<String> {
    let mut tapped = Tapped::new(camera.link());
    let mut session = Session::open(tapped.link()).unwrap();
    session.status(&mut IgnorePackets).unwrap();
    tapped.crashes()
}

/// The option byte as the board's page asks for it. The chip is in reset before the firmware sees anything.
#[test]
fn a_brown_out_while_lit_is_dark_at_once_and_the_next_host_is_told_of_it_once() {
    let Some(camera) = connected_as(even()) else { return };
    let mut session = Session::open(camera.link()).unwrap();
    start(&mut session, &natural());
    pass(&camera, 20.0);
    assert!(is_lit(&camera));
    let supply = |millivolts| {
        camera.with(move |machine| machine.chip(|chip| chip.supply_millivolts = millivolts));
    };
    supply(2_000);
    pass(&camera, 0.001);
    assert!(!is_lit(&camera));
    pass(&camera, 700.0);
    drop(session);
    supply(3_300);
    camera.connect();
    let told = told_after(&camera);
    assert!(!is_lit(&camera));
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(told[0].contains("the supply fell below the brown-out level"), "{told:?}");
    assert!(told_after(&camera).is_empty());
    let mut session = Session::open(camera.link()).unwrap();
    assert!(measure(&mut session, &natural(), 2).counters.is_complete());
    // The configuration has acknowledged the FPGA's fault, whose watchdog ended the run.
    assert_eq!(restart_flashes(&camera), 1);
    let causes =
        camera.with(|machine| machine.resets.iter().map(|reset| reset.1).collect::<Vec<_>>());
    assert_eq!(causes, [Cause::BrownOut]);
    camera.assert_no_violation();
}

/// Flashes of LD3 in one group.
fn restart_flashes(camera: &Camera) -> usize {
    let lamp = || {
        camera.with(|machine| {
            machine.run_while(10_000.0, |_| false);
            machine.chip(|chip| {
                let (port, bit) = chip.place("lamp_fault");
                chip.level(port, bit)
            })
        })
    };
    // A pause of more than a second, then the group up to the next pause.
    let (mut dark, mut flashes, mut was) = (0, None, false);
    for _ in 0..2_000 {
        let lit = lamp();
        dark = if lit { 0 } else { dark + 1 };
        if lit
            && !was
            && let Some(count) = &mut flashes
        {
            *count += 1;
        }
        if dark == 100 {
            match flashes {
                Some(count) if count > 0 => return count,
                _ => flashes = Some(0),
            }
        }
        was = lit;
    }
    0
}

#[test]
fn ld3_counts_the_restarts_that_no_host_asked_for() {
    let Some(camera) = connected_as(even()) else { return };
    assert_eq!(restart_flashes(&camera), 0);
    for crashes in 1..=3 {
        camera.with(|machine| machine.derail(NOWHERE));
        pass(&camera, 50.0);
        assert_eq!(restart_flashes(&camera), crashes);
    }
    camera.connect();
    let mut session = Session::open(camera.link()).unwrap();
    session.command(request::Reboot(RebootInto::Application), &mut IgnorePackets).unwrap();
    drop(session);
    pass(&camera, 300.0);
    assert_eq!(restart_flashes(&camera), 3);
    camera.assert_no_violation();
}

#[test]
fn a_firmware_that_stands_still_is_restarted_and_the_next_host_is_told_by_what() {
    let Some(camera) = connected_as(even()) else { return };
    pass(&camera, 100.0);
    camera.with(Machine::stand_still);
    pass(&camera, 700.0);
    camera.connect();
    let told = told_after(&camera);
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(told[0].contains("the watchdog restarted the chip"), "{told:?}");
    camera.assert_no_violation();
}

#[test]
fn a_crystal_that_stops_while_lit_is_dark_at_once_and_the_next_host_is_told_of_it() {
    let Some(camera) = connected_as(even()) else { return };
    let mut session = Session::open(camera.link()).unwrap();
    start(&mut session, &natural());
    pass(&camera, 2.0);
    assert!(is_lit(&camera));
    let dark_us = dark_after_us(&camera, Machine::stop_crystal);
    // The chip's own oscillator is 40 times slower.
    assert!(dark_us < 10.0 * AT_ONCE_US, "{dark_us} us");
    drop(session);
    pass(&camera, 5.0);
    camera.connect();
    let told = told_after(&camera);
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(told[0].contains("the crystal stopped"), "{told:?}");
    println!("dark {dark_us:.1} us after the crystal stopped");
    camera.assert_no_violation();
}

#[test]
fn an_interlock_that_opens_ends_the_light_within_two_milliseconds() {
    let Some(camera) = connected_as(even()) else { return };
    let mut session = Session::open(camera.link()).unwrap();
    start(&mut session, &natural());
    pass(&camera, 2.0);
    assert!(is_lit(&camera));
    camera.with(|machine| machine.chip(|chip| chip.drive_named("interlock", false)));
    pass(&camera, 2.0);
    assert!(!is_lit(&camera));
    assert_eq!(session.status(&mut IgnorePackets).unwrap().fault, Some(Fault::Interlock));
    camera.assert_no_violation();
}

#[test]
fn gateware_from_the_host_reaches_the_fpga_over_spi1_byte_for_byte() {
    let Some(camera) = connected_as(even()) else { return };
    // Begins as ecppack's files do; of no design.
    let mut bitstream = vec![0xFF, 0x00, b'n', 0x00, 0xFF, 0xFF, 0xFF, 0xBD, 0xB3];
    bitstream.extend((0..40_000_u32).map(|n| (n.wrapping_mul(2_654_435_761) >> 24) as u8));
    let mut session = Session::open(camera.link()).unwrap();
    nirspi_update::gateware::load(&mut session, &bitstream, &mut |_| {}).unwrap_or_else(|error| {
        panic!(
            "{error}; {:x?}",
            camera.with(|machine| (machine.resets.clone(), machine.violations()))
        )
    });
    let (came, bytes) = camera
        .with(|machine| machine.chip(|chip| (chip.fpga_configuration.bitstream(), chip.spi.bytes)));
    println!("{bytes} bytes over SPI1");
    assert!(came == bitstream, "{} of {} bytes", came.len(), bitstream.len());
    assert_eq!(session.status(&mut IgnorePackets).unwrap().state, State::Idle);
    assert!(measure(&mut session, &natural(), 2).counters.is_complete());
    camera.assert_no_violation();
}

//! The rules see faults. Each fault changes writes of the firmware on their way to a register, as wrong code of the board
//! would have written them. Faults in the sources themselves are `tests/silicon/faults.py`'s.

use super::*;
use crate::chip::map::{self, GPIO, OCTOSPI1, OTG, RCC};
use nirspi::capture::{Calibration, CaptureOptions, capture};
use std::ops::ControlFlow;

/// Boots, measures and crashes with this fault; returns what was seen of it: broken rules, restarts, frames that are missing,
/// no host.
fn seen(mutation: fn(u32, u32) -> Option<u32>) -> Option<String> {
    let camera = Camera::start(Plan { mutation, ..even() })?;
    let there = camera.with(|machine| machine.run_while(2e6, |chip| chip.usb.is_configured()));
    let mut found = Vec::new();
    if !there {
        found.push("no host gets the device".to_owned());
    } else if let Ok(mut session) = Session::open(camera.link()) {
        let options = CaptureOptions {
            setup: natural(),
            frames: Some(2),
            calibration: Calibration::None,
            record: None,
        };
        match capture(&mut session, &options, &mut |_| ControlFlow::Continue(())) {
            Ok(captured) if captured.counters.is_complete() => {}
            Ok(_) => found.push("frames are missing".to_owned()),
            Err(error) => found.push(error.to_string()),
        }
    } else {
        found.push("no session".to_owned());
    }
    // Longer than the watchdog's time.
    pass(&camera, 600.0);
    let (violations, resets) =
        camera.with(|machine| (machine.violations(), machine.resets.clone()));
    found.extend(violations);
    if resets.is_empty() {
        found.extend(camera.with(|machine| machine.chip(|chip| chip.wrong_pins())));
    }
    found.extend(resets.iter().map(|(us, cause, _)| format!("restart by {cause:?} at {us} us")));
    Some(found.join("; "))
}

/// The register of a channel of GPDMA1.
const fn channel(number: u32, offset: u32) -> u32 {
    map::GPDMA1 + 0x50 + 0x80 * number + offset
}

#[test]
fn every_planted_fault_is_seen() {
    type Fault = (&'static str, fn(u32, u32) -> Option<u32>, &'static str);
    let faults: [Fault; 10] = [
        (
            "wrong request",
            |at, v| Some(if at == channel(12, 0x44) && v & 0x7F == 40 { v + 1 } else { v }),
            "request 41",
        ),
        (
            "alternate function",
            |at, v| Some(if at == GPIO + 0x1024 { v & !(15 << 16) } else { v }),
            "alternate function",
        ),
        (
            "prescaler",
            |at, v| Some(if at == OCTOSPI1 + 0xC && v & 0xFF == 2 { v - 1 } else { v }),
            "a packet at 80.00 MHz",
        ),
        (
            "endpoint size",
            |at, v| Some(if at == OTG + 0x920 && v & 0x7FF == 512 { v & !0x7FF | 64 } else { v }),
            "endpoint 1",
        ),
        (
            "missing enable",
            |at, v| Some(if at == RCC + map::AHB2ENR2 { v & !(1 << 4) } else { v }),
            "the clock of OCTOSPI1 is off",
        ),
        (
            "priority",
            |at, v| Some(if at == 0xE000_E400 + 84 { 0x20 } else { v }),
            "interrupt 84 gets priority",
        ),
        (
            "descriptor",
            |at, v| Some(if at == OTG + 0x914 && v != 0 { v + 4 } else { v }),
            "descriptor",
        ),
        (
            "phase",
            |at, v| Some(if at == OCTOSPI1 + 0x100 { v & !0x700 | 1 << 8 } else { v }),
            "address phase",
        ),
        (
            "feed",
            |at, v| Some(v).filter(|v| (at, *v) != (0x4000_3000, 0xAAAA)),
            "restart by Watchdog",
        ),
        ("pin", |at, v| Some(if at == GPIO + 0x1400 { v & !(3 << 28) } else { v }), "P"),
    ];
    for (name, mutation, expected) in faults {
        let Some(found) = seen(mutation) else { return };
        println!("{name}: {found}");
        assert!(found.contains(expected), "{name}: {found:?}, expected {expected:?}");
    }
    // Without a fault nothing is seen.
    assert_eq!(seen(|_, value| Some(value)).unwrap(), "");
}

#[test]
fn a_list_of_the_dma_that_leads_astray_is_seen() {
    let Some(camera) = parallel::with_lines(|at, v| {
        // The first link leads to the third item.
        Some(if at == channel(3, 0x7C) && v != 0 { v + 12 } else { v })
    }) else {
        return;
    };
    let mut session = Session::open(camera.link()).unwrap();
    let options = CaptureOptions {
        setup: parallel::setup(),
        frames: Some(50),
        calibration: Calibration::None,
        record: None,
    };
    let captured = capture(&mut session, &options, &mut |_| ControlFlow::Continue(()));
    let counters = captured.map(|captured| captured.counters);
    println!("{counters:?}");
    assert!(!counters.is_ok_and(|counters| counters.is_complete()));
}

#[test]
fn a_crash_that_lowers_another_pin_is_seen() {
    let mutation = |at, v| Some(if at == GPIO + 0x1418 && v == 1 << 30 { 1 << 29 } else { v });
    let Some(camera) = connected_as(Plan { mutation, ..even() }) else { return };
    let mut session = Session::open(camera.link()).unwrap();
    start(&mut session, &natural());
    pass(&camera, 2.0);
    assert!(ends::dark_after_a_crash_us(&camera) > ends::AT_ONCE_US);
}

#[test]
fn a_stack_that_is_too_deep_ends_in_a_fault_and_a_restart_in_the_dark() {
    // Less than the 6048 bytes that the firmware takes.
    let Some(camera) = Camera::start(Plan { stack_room: Some(4_000), ..even() }) else { return };
    let (resets, lit) = camera.with(|machine| {
        machine.run_while(300_000.0, |_| false);
        (machine.resets.clone(), machine.chip(|chip| chip.light_log.clone()))
    });
    println!("{} restarts", resets.len());
    assert!(
        resets.iter().any(|(_, cause, _)| *cause == crate::chip::Cause::Software),
        "{resets:?}"
    );
    assert!(lit.is_empty());
}

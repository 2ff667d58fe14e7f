//! From power-up to a host that has the camera.

use super::*;
use crate::camera::{BOARD, elf};
use crate::chip::OnTheBus;
use crate::chip::{Ready, map};
use crate::fpga::Fpga;
use crate::machine::Stop;
use nirspi_wire::host_port::{QUAD, READ_PACKET};
use nirspi_wire::register::DAMAGED;
use nirspi_wire::{Fault, RebootInto, SelfTestReport, State};

#[test]
fn it_boots_and_a_host_enumerates_it_at_high_speed() {
    let Some(camera) = connected_as(even()) else { return };
    let (us, pins) =
        camera.with(|machine| (machine.now_us(), machine.chip(|chip| chip.wrong_pins())));
    println!("configured by the host after {us:.0} us; {}", elf().display());
    assert_eq!(pins, Vec::<String>::new(), "pins are as in the board's table");
    let kinds = camera.with(|machine| {
        machine.chip(|chip| {
            let descriptors = chip.usb.cable.descriptors.borrow();
            descriptors.iter().map(|(kind, bytes)| (*kind, bytes.len())).collect::<Vec<_>>()
        })
    });
    assert_eq!(kinds.iter().map(|(kind, _)| *kind).collect::<Vec<_>>(), [1, 2, 15, 3, 3, 3]);
    let session = Session::open(camera.link()).unwrap();
    let identity = session.identity();
    assert_eq!((identity.board.as_str(), identity.adc_hz), (BOARD, nirspi_wire::ADC_HZ));
    assert!(!is_lit(&camera));
    camera.assert_no_violation();
}

#[test]
fn the_watchdog_is_fed_in_time_and_the_stack_has_room_from_power_up_on() {
    let Some(camera) = connected_as(even()) else { return };
    let mut session = Session::open(camera.link()).unwrap();
    assert!(nirspi_tests::tapped::measure(&mut session, &natural(), 3).counters.is_complete());
    let (longest_ms, (deepest, limit)) = camera.with(|machine| {
        (machine.chip(|chip| chip.watchdog.longest_ps as f64 / 1e9), machine.deepest_stack())
    });
    println!(
        "longest time between two feeds {longest_ms:.1} ms of 500; deepest stack {deepest} of {limit} bytes"
    );
    // Half of the watchdog's time, and three quarters of the least room that `board.toml` asks for.
    assert!(longest_ms < 250.0, "{longest_ms} ms");
    assert!(deepest > 0 && deepest < 65_536 * 3 / 4, "{deepest} bytes");
    camera.assert_no_violation();
}

/// From a reset to the answer to a host's greeting, at most. Before `main` the chip clears memory at 4 MHz, so a byte more
/// of it takes 0.4 us: the staging memory of a bitstream alone would take 0.4 s.
const START_BUDGET_US: f64 = 60_000.0;

#[test]
fn a_host_is_greeted_within_60_ms_of_a_reset() {
    let Some(camera) = connected_as(even()) else { return };
    drop(Session::open(camera.link()).unwrap());
    let first = camera.with(|machine| machine.now_us());
    let mut session = Session::open(camera.link()).unwrap();
    session.command(request::Reboot(RebootInto::Application), &mut IgnorePackets).unwrap();
    drop(session);
    assert!(camera.with(|machine| machine.run_while(1e6, |chip| !chip.usb.is_configured())));
    camera.connect();
    drop(Session::open(camera.link()).unwrap());
    let again = camera.with(|machine| machine.now_us() - machine.resets.last().unwrap().0 as f64);
    println!("greeted {:.1} ms after power-up, {:.1} ms after a restart", first / 1e3, again / 1e3);
    assert!(first < START_BUDGET_US && again < START_BUDGET_US, "{first} us, {again} us");
    camera.assert_no_violation();
}

/// Each wait of the start, with what it waits for.
const WAITS: &[Ready] = &[
    Ready("PWR.SVMSR", 26),
    Ready("PWR.SVMSR", 24),
    Ready("PWR.VOSR", 15),
    Ready("PWR.VOSR", 14),
    Ready("PWR.VOSR", 13),
    Ready("RCC.CR", 17),
    Ready("RCC.CR", 25),
    Ready("RCC.CFGR1", 2),
    Ready("RCC.BDCR", 27),
    Ready("ADC1.ISR", 31),
    Ready("ADC1.ISR", 0),
];

/// Waits for a peripheral that is ready at once on a chip that is well: register, and the bits that never fall and never
/// rise.
const FROZEN: &[(&str, (u32, u32, u32))] = &[
    ("a calibration of the ADC, ADC1.CR.ADCAL", (map::ADC1 + 0x08, 1 << 31, 0)),
    ("OCTOSPI1.SR.BUSY", (map::OCTOSPI1 + 0x20, 1 << 5, 0)),
    ("OTG_HS.GRSTCTL.AHBIDL", (map::OTG + 0x10, 0, 1 << 31)),
    ("OTG_HS.GINTSTS.CMOD", (map::OTG + 0x14, 1, 0)),
];

#[test]
fn a_wait_of_the_start_that_never_ends_is_ended_by_the_watchdog_in_the_dark() {
    let stuck = WAITS.iter().map(|&wait| (format!("{wait:?}"), Some(wait), None));
    let frozen = FROZEN.iter().map(|&(name, bits)| (name.to_owned(), None, Some(bits)));
    // All of them are told, so that a fault shows what it reaches.
    let mut wrong = Vec::new();
    for (wait, stuck, frozen) in stuck.chain(frozen) {
        let Some(camera) = Camera::start(Plan { stuck, frozen, ..even() }) else { return };
        let (stop, lit, violations) = camera.with(|machine| {
            (machine.run_us(3e6), machine.chip(|chip| chip.light_log.clone()), machine.violations())
        });
        if !matches!(stop, Stop::Reset(_)) {
            wrong.push(format!("{wait} is not ended: {stop:?}"));
        }
        if !lit.is_empty() {
            wrong.push(format!("{wait} is not dark: {lit:?}"));
        }
        if let Some(violation) = violations.first() {
            wrong.push(format!("{wait}: {violation}"));
        }
    }
    assert!(wrong.is_empty(), "expected each to end in the dark: {}", wrong.join("; "));
}

/// An FPGA whose packet port is sampled a period of `sck` too early: each byte begins with a half of the one before.
struct Early(Golden<Even>);

impl Fpga for Early {
    fn advance(&mut self, now_ps: u64) {
        self.0.advance(now_ps);
    }

    fn read(&mut self, opcode: u8, address: u16, bytes: usize) -> Vec<u8> {
        let mut read = self.0.read(opcode, address, bytes);
        if opcode & !QUAD == READ_PACKET {
            let mut last = 0;
            for byte in &mut read {
                *byte = std::mem::replace(&mut last, *byte) << 4 | *byte >> 4;
            }
        }
        read
    }

    fn write(&mut self, opcode: u8, address: u16, bytes: &[u8]) -> bool {
        self.0.write(opcode, address, bytes)
    }

    fn ready(&mut self) -> (bool, bool) {
        self.0.ready()
    }

    fn runs(&self) -> bool {
        self.0.runs()
    }

    fn set_board_enable(&mut self, high: bool) {
        self.0.set_board_enable(high);
    }

    fn parallel(&mut self, most: usize) -> Vec<u8> {
        self.0.parallel(most)
    }
}

/// Every register answers, so nothing else shows it.
#[test]
fn a_packet_port_at_the_wrong_phase_is_named_before_the_first_run() {
    let plan = Plan::new(|| Box::new(Early(Golden::new(Even::new()))));
    let Some(camera) = connected_as(plan) else { return };
    let mut session = Session::open(camera.link()).unwrap();
    let status = session.status(&mut IgnorePackets).unwrap();
    let damaged = Fault::FpgaAbsent { identity: DAMAGED };
    assert_eq!((status.state, status.fault, status.run), (State::Fault, Some(damaged), 0));
    assert!(camera.with(|machine| machine.chip(|chip| chip.light_log.is_empty())));
    camera.assert_no_violation();
}

/// With the board's own pin, which the self-test lowers and raises.
#[test]
fn a_stuck_led_enable_is_found_by_the_self_test() {
    for (stuck, failed) in [
        (None, 0),
        (Some(StuckEnable::Board), SelfTestReport::BOARD_ENABLE),
        (Some(StuckEnable::Fpga), SelfTestReport::FPGA_ENABLE),
    ] {
        let Some(camera) = connected_with(stuck) else { return };
        let mut session = Session::open(camera.link()).unwrap();
        let report = session.self_test(&mut IgnorePackets).unwrap();
        assert_eq!(report.failed, failed, "{stuck:?}");
        assert!(!is_lit(&camera));
        camera.assert_no_violation();
    }
}

/// Before the first run, and with the board's own pin low until then.
#[test]
fn a_stuck_led_enable_refuses_the_first_run() {
    for (stuck, fault) in
        [(StuckEnable::Board, Fault::BoardEnableStuck), (StuckEnable::Fpga, Fault::FpgaEnableStuck)]
    {
        let Some(camera) = connected_with(Some(stuck)) else { return };
        let mut session = Session::open(camera.link()).unwrap();
        natural()
            .with_configuration(|c| session.command(request::Configure(c), &mut IgnorePackets))
            .unwrap();
        assert!(!is_lit(&camera), "a configuration alone lights nothing");
        let start = request::Start(RunLength::Continuous);
        let refused = session.command(start, &mut IgnorePackets).unwrap_err();
        assert!(refused.to_string().contains(&fault.to_string()), "{refused}");
        let status = session.status(&mut IgnorePackets).unwrap();
        assert_eq!((status.state, status.fault, status.run), (State::Fault, Some(fault), 0));
        assert!(!is_lit(&camera));
        camera.assert_no_violation();
    }
}

/// A start that gets nowhere is seen at the bench: every second restart lights LD3 from its beginning on.
#[test]
fn ld3_blinks_while_no_start_gets_further_than_its_waits() {
    let stuck = Some(Ready("RCC.CR", 17));
    let Some(camera) = Camera::start(Plan { stuck, ..even() }) else { return };
    for expected in [false, true, false, true] {
        let lamp = camera.with(|machine| {
            machine.run_while(250_000.0, |_| false);
            let lamp = machine.chip(|chip| {
                let (port, bit) = chip.place("lamp_fault");
                chip.level(port, bit)
            });
            assert!(matches!(machine.run_us(1e6), Stop::Reset(_)));
            lamp
        });
        assert_eq!(lamp, expected);
    }
    camera.assert_no_violation();
}

#[test]
fn a_depth_sensor_that_holds_its_bus_holds_up_nothing_else() {
    let Some(camera) = Camera::start(Plan { on_the_bus: OnTheBus::Stuck, ..even() }) else {
        return;
    };
    camera.connect();
    let mut session = Session::open(camera.link()).unwrap();
    assert!(nirspi_tests::tapped::measure(&mut session, &natural(), 3).counters.is_complete());
    pass(&camera, 3_000.0);
    assert_eq!(session.status(&mut IgnorePackets).unwrap().state, State::Configured);
    let (resets, longest_ms) = camera.with(|machine| {
        (machine.resets.clone(), machine.chip(|chip| chip.watchdog.longest_ps as f64 / 1e9))
    });
    assert_eq!(resets, []);
    assert!(longest_ms < 250.0, "{longest_ms} ms");
    camera.assert_no_violation();
}

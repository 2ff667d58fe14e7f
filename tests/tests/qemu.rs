//! Tests of the whole firmware as ARM machine code, on an emulated Cortex-M33: host, wire protocol,
//! executor, drivers, firmware logic, and the gateware's golden model behind the board's second
//! UART. `tests/rtl` uses the RTL in place of the model.
//!
//! A virtual camera in this process gets the same scene and the same commands, and must give the
//! same frames, bit for bit. Device times differ, because the two have different clocks.
#![allow(clippy::unwrap_used, reason = "a failed unwrap in a helper fails its test")]

use nirspi::capture::{Capture, Ended};
use nirspi::link::Link;
use nirspi::session::{IgnorePackets, Session, SessionError, request};
use nirspi::setup::MeasurementSetup;
use nirspi::signal::Signal;
use nirspi_optics::Scene;
use nirspi_recon::{Order, Side, metrics, reconstruct};
use nirspi_tests::debugger::{NOWHERE, Waiting};
use nirspi_tests::elf::Firmware;
use nirspi_tests::emulated::Emulated;
use nirspi_tests::firmware;
use nirspi_tests::pages::{page, table};
use nirspi_tests::tamper::{Fate, Tampered, only_frames};
use nirspi_tests::tapped::{Tapped, measure, run};
use nirspi_virtual::{MemoryLink, VirtualOptics};
use nirspi_wire::{Fault, GatewareChunk, Refusal, RunLength, State};

const PX: usize = 64;
const SEED: u64 = 7;

/// A bar on a rough ground.
fn scene() -> Scene {
    let reflectance = (0..PX * PX).map(|p| {
        let (r, c) = (p / PX, p % PX);
        let rough = (r / 2 * 29 + c / 2 * 71 + r * c * 5) % 89;
        0.003 * rough as f32 + if (r + 2 * c) % 64 < 16 { 0.6 } else { 0.1 }
    });
    Scene::new(reflectance.collect(), PX, 48.0).unwrap()
}

/// The default optics, with all noise, settling and latency.
fn optics() -> VirtualOptics {
    VirtualOptics::new(scene(), 300.0).unwrap()
}

fn in_process() -> Box<dyn Link> {
    Box::new(MemoryLink::new(optics().camera(SEED).unwrap()))
}

/// The natural order, with the latency of the simulated receiver.
fn natural() -> MeasurementSetup {
    let adc_latency = optics().chain().adc_latency_clocks;
    MeasurementSetup { adc_latency, ..MeasurementSetup::new(&Order::Natural, 1.0).unwrap() }
}

#[test]
fn frames_from_the_emulated_board_are_those_of_the_virtual_camera_bit_for_bit() {
    let frames = 6;
    let Some(board) = Emulated::start(optics().fpga(SEED).unwrap()) else { return };
    let (captured, shots) = run(board.link(), &natural(), frames);
    assert!(matches!(captured.ended, Ended::Complete), "{:?}", captured.ended);
    assert!(captured.counters.is_complete(), "{}", captured.counters);
    assert_eq!(shots.len(), frames as usize);

    let (reference, expected) = run(in_process(), &natural(), frames);
    assert!(shots == expected, "the frames differ");

    // Floating point on the emulated processor. The camera may compare other frames than the virtual
    // one, whose time runs otherwise.
    let signal = |captured: &Capture| Signal::of(captured.status.as_ref().unwrap()).unwrap();
    let (found, reference_signal) = (signal(&captured), signal(&reference));
    assert!((found.snr_db - reference_signal.snr_db).abs() < 1.0, "{found}; {reference_signal}");
    assert!((found.level_counts / reference_signal.level_counts - 1.0).abs() < 0.01, "{found}");

    let image = |captured: &Capture| {
        let measurements = captured.integrated.measurements(&captured.setup, None, true).unwrap();
        reconstruct::hadamard(&measurements)
    };
    assert_eq!(image(&captured).pixels(), image(&reference).pixels());
    let side = Side::INSTRUMENT.pixels();
    let optics = optics();
    let weights = optics.footprint().weights();
    let correlation = metrics::correlation(weights, image(&captured).pixels(), side, side).unwrap();
    println!("{frames} frames in {:.2?}, correlation {correlation:.4}", captured.elapsed);
    assert!(correlation > 0.6, "correlation {correlation}");
}

#[test]
fn an_order_table_several_sweeps_and_a_second_run_come_through_too() {
    let mut setup = MeasurementSetup::new(&Order::Random(7), 0.1).unwrap();
    setup.sweeps = 3;
    let Some(board) = Emulated::start(optics().fpga(SEED).unwrap()) else { return };
    let mut virtual_camera = Tapped::new(in_process());
    let mut emulated = Tapped::new(board.link());
    for tapped in [&mut virtual_camera, &mut emulated] {
        let mut session = Session::open(tapped.link()).unwrap();
        for frames in [9, 4] {
            let captured = measure(&mut session, &setup, frames);
            assert!(captured.counters.is_complete(), "{}", captured.counters);
        }
    }
    let shots = emulated.shots();
    assert_eq!(shots.len(), 13);
    assert_eq!((shots[0].run, shots[12].run), (1, 2));
    assert!(shots == virtual_camera.shots());
}

#[test]
fn on_a_bad_line_every_frame_is_accounted_for_and_none_that_arrives_differs() {
    let frames = 9;
    let Some(board) = Emulated::start(optics().fpga(SEED).unwrap()) else { return };
    let judge = only_frames(|frame| match frame {
        1 => Fate::Drop,
        2 => Fate::Flip(99),
        4 => Fate::Delay,
        6 => Fate::Lose(200),
        _ => Fate::Pass,
    });
    let (captured, shots) = run(Box::new(Tampered::new(board.link(), judge)), &natural(), frames);
    let counters = captured.counters;
    assert_eq!(
        (counters.received, counters.lost, counters.corrupt, counters.late),
        (5, 1, 2, 1),
        "{counters}"
    );
    let status = captured.status.unwrap();
    assert_eq!((status.frames_made, status.frames_sent), (frames, frames), "the device sent all");
    let (_, expected) = run(in_process(), &natural(), frames);
    let arrived: Vec<u32> = shots.iter().map(|shot| shot.sequence).collect();
    assert_eq!(arrived, [0, 3, 5, 4, 7, 8]);
    for shot in shots {
        assert_eq!(shot, expected[shot.sequence as usize]);
    }
}

#[test]
fn an_open_interlock_keeps_the_emulated_board_dark() {
    let Some(board) = Emulated::start(optics().fpga(SEED).unwrap()) else { return };
    let mut session = Session::open(board.link()).unwrap();
    board.set_interlock(false);
    let refused = natural()
        .with_configuration(|c| session.command(request::Configure(c), &mut IgnorePackets))
        .unwrap_err();
    let SessionError::Refused { refusal: Refusal::Fault(Fault::Interlock), .. } = refused else {
        panic!("{refused}");
    };
    board.set_interlock(true);
    while !session.status(&mut IgnorePackets).unwrap().interlock_closed {}
    assert!(measure(&mut session, &natural(), 1).counters.is_complete(), "closed, it measures");
}

#[test]
fn an_fpga_that_falls_silent_is_a_fault_that_the_host_is_told() {
    let Some(board) = Emulated::start(optics().fpga(SEED).unwrap()) else { return };
    let mut session = Session::open(board.link()).unwrap();
    assert_eq!(session.identity().board, firmware::board().name);
    assert_eq!(session.status(&mut IgnorePackets).unwrap().fault, None);
    board.unplug_fpga();
    let mut fault = None;
    for _ in 0..100 {
        fault = session.status(&mut IgnorePackets).unwrap().fault;
        if fault.is_some() {
            break;
        }
    }
    assert_eq!(fault, Some(Fault::FpgaAbsent { identity: 0 }));
}

#[test]
fn firmware_that_crashes_starts_again_and_tells_the_next_host_once() {
    let debugger = Waiting::listen();
    let arguments = debugger.arguments();
    let fpga = optics().fpga(SEED).unwrap();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let Some(board) = Emulated::start_with(fpga, &arguments) else { return };
    let mut debugger = debugger.attach();
    debugger.go();
    drop(Session::open(board.link()).unwrap());

    debugger.derail(NOWHERE);
    let hear = || {
        // A greeting sent during the restart is lost, so the host tries again.
        let (tapped, mut session) = (0..3)
            .find_map(|_| {
                let mut tapped = Tapped::new(board.link());
                let session = Session::open(tapped.link()).ok()?;
                Some((tapped, session))
            })
            .unwrap();
        session.status(&mut IgnorePackets).unwrap();
        let captured = measure(&mut session, &natural(), 1);
        assert!(captured.counters.is_complete(), "it measures again");
        tapped.crashes()
    };
    let told = hear();
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(told[0].contains("hard fault at 0x2ff00000"), "{told:?}");
    assert!(hear().is_empty());
}

/// The byte with which cortex-m-rt fills the stack before it calls `main`.
const PAINT: u8 = 0xCC;

#[test]
fn the_stack_is_never_deeper_than_three_quarters_of_its_limit() {
    let Some(elf) = firmware::elf() else { return };
    let elf = Firmware::read(elf).unwrap();
    let (end, start) = (elf.symbol("_stack_end").unwrap(), elf.symbol("_stack_start").unwrap());

    let debugger = Waiting::listen();
    let arguments = debugger.arguments();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let Some(board) = Emulated::start_with(optics().fpga(SEED).unwrap(), &arguments) else {
        return;
    };
    let mut debugger = debugger.attach();
    debugger.go();
    // Every command of a host, including commands that are refused.
    let mut session = Session::open(board.link()).unwrap();
    let _ = session.command(request::Start(RunLength::Continuous), &mut IgnorePackets);
    let _ = session.command(request::RawBurst(0), &mut IgnorePackets);
    let piece = GatewareChunk { offset: 0, total: 4, crc: 0, data: &[1, 2] };
    let _ = session.command(request::LoadGateware(piece), &mut IgnorePackets);
    let _ = session.command(request::SelfTest, &mut IgnorePackets);
    // A quarter of the table: each row is an access through the tunnel, and the stack does not depend on their number.
    let table = MeasurementSetup::new(&Order::Random(1), 0.25).unwrap();
    for setup in [natural(), table] {
        assert!(measure(&mut session, &setup, 2).counters.is_complete());
    }
    session.command(request::RawBurst(4096), &mut IgnorePackets).unwrap();
    while session.status(&mut IgnorePackets).unwrap().state == State::Running {}

    let stack = debugger.read(end, start);
    let untouched = stack.iter().take_while(|&&byte| byte == PAINT).count();
    let (deepest, limit) = (stack.len() - untouched, stack.len());
    println!("deepest stack: {deepest} of {limit} bytes");
    assert!(untouched > 0, "painted");
    assert!(4 * deepest < 3 * limit, "{deepest} of {limit} bytes");
}

/// One instruction is one nanosecond of the emulated clock, so the count does not depend on the
/// machine.
#[test]
fn a_frame_costs_no_more_instructions_than_budgeted() {
    let (Some(qemu), Some(elf)) = (firmware::qemu(), firmware::elf()) else { return };
    let output = std::process::Command::new(qemu)
        .args(["-M", "mps2-an505", "-display", "none", "-monitor", "none", "-serial", "none"])
        .args(["-icount", "shift=0", "-semihosting-config", "enable=on,target=native"])
        .arg("-kernel")
        .arg(elf.with_file_name("instructions"))
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{text}");
    print!("{text}");
    let counted = |name: &str| -> u32 {
        let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
        line.and_then(|number| number.parse().ok()).unwrap_or_else(|| panic!("no {name}: {text}"))
    };
    let rows = table(&page("docs/log/firmware.md"), "### Instructions");
    assert!(rows.len() >= 5);
    for row in rows {
        let budget: u32 = row[2].replace(' ', "").parse().unwrap();
        assert!(counted(&row[0]) <= budget, "{}: {} of {budget}", row[0], counted(&row[0]));
    }
}

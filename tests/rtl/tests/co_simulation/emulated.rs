//! Tests of the firmware's machine code on the emulated board, in front of the simulated RTL:
//! everything except the chips.

use crate::ideal;
use nirspi::capture::Ended;
use nirspi::setup::MeasurementSetup;
use nirspi_recon::Order;
use nirspi_tests::emulated::Emulated;
use nirspi_tests::tapped::run;
use nirspi_tests_rtl::RtlFpga;
use nirspi_virtual::MemoryLink;

#[test]
fn frames_of_the_rtl_come_through_the_emulated_board_as_the_golden_models_do() {
    let optics = ideal();
    let setup = MeasurementSetup::new(&Order::Natural, 1.0).unwrap();
    let Some(board) = Emulated::start(RtlFpga::new(&optics, 1)) else { return };
    let (captured, shots) = run(board.link(), &setup, 1);
    assert!(matches!(captured.ended, Ended::Complete), "{:?}", captured.ended);
    let golden = MemoryLink::new(optics.camera(1).unwrap());
    let (_, expected) = run(Box::new(golden), &setup, 1);
    assert_eq!(shots.len(), 1);
    assert!(shots == expected, "the frames differ");
    println!(
        "one sweep of 1024 patterns and complements through RTL and firmware: {:.2?}",
        captured.elapsed
    );
}

#[test]
fn frames_that_the_rtl_makes_faster_than_the_board_reads_them_are_counted_and_spoil_no_other() {
    let frames = 400;
    let optics = ideal();
    let setup = MeasurementSetup::new(&Order::Natural, 0.05).unwrap();
    let Some(board) = Emulated::start(RtlFpga::new(&optics, 1)) else { return };
    let (captured, shots) = run(board.link(), &setup, frames);
    assert_eq!(captured.counters.total(), u64::from(frames), "{}", captured.counters);
    assert!(captured.counters.lost > 0 && captured.counters.received > 1, "{}", captured.counters);
    let golden = MemoryLink::new(optics.camera(1).unwrap());
    let (_, expected) = run(Box::new(golden), &setup, 1);
    for shot in shots {
        // Without noise every frame has the same samples.
        assert!(shot.samples == expected[0].samples, "frame {}", shot.sequence);
    }
}

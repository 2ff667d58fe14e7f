//! Frames.

use super::*;
use nirspi::capture::Ended;
use nirspi::selftest;
use nirspi_tests::tapped::{Tapped, measure, run};
use std::time::Duration;

#[test]
fn frames_are_those_of_the_virtual_camera_bit_for_bit() {
    let frames = 6;
    let Some(camera) = connected() else { return };
    let (captured, shots) = run(camera.link(), &natural(), frames);
    assert!(matches!(captured.ended, Ended::Complete), "{:?}", captured.ended);
    assert!(captured.counters.is_complete(), "{}; {:?}", captured.counters, captured.status);
    let (_, expected) = run(virtual_camera(), &natural(), frames);
    assert_eq!(shots.len(), frames as usize);
    assert!(shots == expected, "the frames differ");
    camera.assert_no_violation();
}

#[test]
fn an_order_table_and_a_second_run_come_through_too() {
    let setup =
        MeasurementSetup { sweeps: 30, ..MeasurementSetup::new(&Order::Random(7), 0.1).unwrap() };
    let Some(camera) = connected() else { return };
    let (mut found, mut expected) = (Tapped::new(camera.link()), Tapped::new(virtual_camera()));
    for tapped in [&mut found, &mut expected] {
        let mut session = Session::open(tapped.link()).unwrap();
        for frames in [9, 4] {
            let captured = measure(&mut session, &setup, frames);
            assert!(captured.counters.is_complete(), "{}", captured.counters);
        }
    }
    assert_eq!(found.shots().len(), 13);
    assert!(found.shots() == expected.shots());
    camera.assert_no_violation();
}

#[test]
fn it_passes_the_self_test_of_the_host() {
    let Some(camera) = connected() else { return };
    let mut session = Session::open(camera.link()).unwrap();
    let demands = selftest::LinkDemands { min_frames_per_s: 0.0, duration: Duration::from_secs(2) };
    let found = selftest::run(&mut session, demands, &mut |_| {}).unwrap();
    for check in &found.checks {
        println!("{check:?}");
    }
    assert!(found.passed());
    camera.assert_no_violation();
}

/// Up to the signal meter's second look, a quarter of a second after its first: where the FPGA loses frames, the meter then
/// reads every packet (`docs/silicon.md`, What the runs found).
#[test]
fn frames_of_1024_patterns_come_as_fast_as_the_firmwares_page_computes() {
    let Some(camera) = connected_as(even()) else { return };
    let mut session = Session::open(camera.link()).unwrap();
    start(&mut session, &MeasurementSetup { sweeps: 1, ..natural() });
    let sent = |camera: &Camera| {
        camera.with(|machine| machine.chip(|chip| chip.octospi.counts.get(&0x8B).copied()))
    };
    pass(&camera, 50.0);
    let (before, begun) = (sent(&camera).unwrap(), std::time::Instant::now());
    pass(&camera, 150.0);
    let per_s = (sent(&camera).unwrap() - before) as f64 / 0.15;
    println!(
        "{per_s:.0} frames/s of 1024 patterns; 0.15 s of the chip took {:.2} s",
        begun.elapsed().as_secs_f64()
    );
    // The page's table computes 6017, without the signal meter.
    assert!((per_s / 6017.0 - 1.0).abs() < 0.05, "{per_s}");
    session.command(request::Stop, &mut IgnorePackets).unwrap();
    let status = session.status(&mut IgnorePackets).unwrap();
    assert_eq!((status.frames_dropped, status.fpga_frames_corrupt), (0, 0), "{status:?}");
    assert_eq!(status.frames_made, status.frames_sent + status.fpga_frames_lost, "{status:?}");
    camera.assert_no_violation();
}

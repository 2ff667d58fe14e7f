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

#[test]
fn a_second_of_frames_at_the_highest_rate_loses_none_but_those_the_fpga_counts() {
    let Some(camera) = connected_as(even()) else { return };
    let mut session = Session::open(camera.link()).unwrap();
    start(&mut session, &MeasurementSetup { sweeps: 1, ..natural() });
    let begun = std::time::Instant::now();
    pass(&camera, 1_000.0);
    let wall_s = begun.elapsed().as_secs_f64();
    let status = session
        .command(request::Stop, &mut IgnorePackets)
        .and_then(|_| session.status(&mut IgnorePackets))
        .unwrap();
    println!(
        "{} frames of 1024 patterns sent in a second of the chip, {wall_s:.2} s on the wall",
        status.frames_sent
    );
    assert!(status.frames_sent > 3_000, "{status:?}");
    assert_eq!((status.frames_dropped, status.fpga_frames_corrupt), (0, 0), "{status:?}");
    assert_eq!(
        status.frames_made,
        status.frames_sent + status.fpga_frames_lost as u32,
        "{status:?}"
    );
    camera.assert_no_violation();
}

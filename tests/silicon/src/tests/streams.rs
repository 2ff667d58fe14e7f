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

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

/// Frames a second of a run that is as fast as the host port, over some seconds of the chip's time.
fn stream_for(seconds: u32) -> Option<f64> {
    let camera = connected_as(even())?;
    let mut session = Session::open(camera.link()).unwrap();
    start(&mut session, &MeasurementSetup { sweeps: 1, ..natural() });
    let sent = |camera: &Camera| {
        camera.with(|machine| machine.chip(|chip| chip.octospi.counts.get(&0x8B).copied()))
    };
    pass(&camera, 50.0);
    let (before, begun) = (sent(&camera).unwrap(), std::time::Instant::now());
    for _ in 0..seconds {
        pass(&camera, 1_000.0);
        // The host asks once a second, as ours does.
        session.status(&mut IgnorePackets).unwrap();
    }
    let per_s = (sent(&camera).unwrap() - before) as f64 / f64::from(seconds);
    println!(
        "{per_s:.0} frames/s of 1024 patterns; {seconds} s of the chip took {:.1} s",
        begun.elapsed().as_secs_f64()
    );
    let signal = session.status(&mut IgnorePackets).unwrap().signal;
    assert!(signal.is_some(), "the signal meter measures, although the FPGA loses frames");
    session.command(request::Stop, &mut IgnorePackets).unwrap();
    let status = session.status(&mut IgnorePackets).unwrap();
    assert_eq!((status.frames_dropped, status.fpga_frames_corrupt), (0, 0), "{status:?}");
    assert_eq!(status.frames_made, status.frames_sent + status.fpga_frames_lost, "{status:?}");
    assert_eq!(camera.with(|machine| machine.resets.clone()), []);
    camera.assert_no_violation();
    Some(per_s)
}

#[test]
fn frames_of_1024_patterns_come_as_fast_as_the_firmwares_page_computes() {
    let Some(per_s) = stream_for(1) else { return };
    // The page's table computes 5983, without the signal meter.
    assert!((per_s / 5983.0 - 1.0).abs() < 0.05, "{per_s}");
}

/// Three minutes on the wall, so not in the step of CI: `bash .ci/run silicon-minute`.
#[test]
#[ignore = "takes minutes"]
fn a_minute_at_the_highest_rate_loses_no_frame_between_fpga_and_host() {
    let Some(per_s) = stream_for(60) else { return };
    assert!((per_s / 5983.0 - 1.0).abs() < 0.05, "{per_s}");
}

//! Hosts that go away.

use super::*;
use nirspi_tests::tapped::measure;
use nirspi_wire::State;

/// A number below `bound` (xorshift).
fn random(state: &mut u64, bound: u64) -> u64 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    *state % bound
}

/// Pulls the cable, or pushes it in.
fn plug(camera: &Camera, plugged: bool) {
    camera.with(move |machine| machine.chip(|chip| chip.usb.cable.plugged.set(plugged)));
}

#[test]
fn after_each_of_100_cables_pulled_in_mid_stream_the_next_host_gets_its_frames() {
    let Some(camera) = connected_as(even()) else { return };
    let mut seed = 0x9E37_79B9_7F4A_7C15;
    // As many frames as the camera can send.
    let fast = MeasurementSetup { sweeps: 1, ..natural() };
    let mut armed = 0;
    for pull in 0..100 {
        let mut session =
            Session::open(camera.link()).unwrap_or_else(|error| panic!("pull {pull}: {error}"));
        start(&mut session, &fast);
        pass(&camera, 0.5 + random(&mut seed, 4_000) as f64 / 1e3);
        assert!(is_lit(&camera), "pull {pull}");
        armed += u32::from(camera.with(|machine| machine.chip(|chip| chip.usb.is_armed())));
        plug(&camera, false);
        pass(&camera, 12.0);
        assert!(!is_lit(&camera), "pull {pull}");
        plug(&camera, true);
        camera.connect();
    }
    println!("{armed} of 100 cables were pulled while a packet waited");
    assert!(armed > 10);
    let mut session = Session::open(camera.link()).unwrap();
    assert!(measure(&mut session, &natural(), 5).counters.is_complete());
    assert_eq!(camera.with(|machine| machine.resets.clone()), []);
    camera.assert_no_violation();
}

#[test]
fn a_host_that_sleeps_ends_the_light_and_finds_the_camera_when_it_wakes() {
    let Some(camera) = connected_as(even()) else { return };
    let sleep =
        |asleep| camera.with(move |machine| machine.chip(|chip| chip.usb.cable.asleep.set(asleep)));
    for _ in 0..3 {
        let mut session = Session::open(camera.link()).unwrap_or_else(|error| {
            panic!("{error}; {:?}", camera.with(|machine| machine.violations()))
        });
        start(&mut session, &natural());
        pass(&camera, 3.0);
        assert!(is_lit(&camera));
        sleep(true);
        pass(&camera, 12.0);
        assert!(!is_lit(&camera));
        pass(&camera, 500.0);
        sleep(false);
        pass(&camera, 10.0);
    }
    let mut session = Session::open(camera.link()).unwrap();
    assert!(measure(&mut session, &natural(), 3).counters.is_complete());
    camera.assert_no_violation();
}

#[test]
fn a_host_that_stops_reading_loses_the_light_after_five_seconds() {
    let Some(camera) = connected_as(even()) else { return };
    let mut session = Session::open(camera.link()).unwrap();
    start(&mut session, &natural());
    camera.with(|machine| machine.chip(|chip| chip.usb.cable.reads.set(false)));
    pass(&camera, 4_000.0);
    assert!(is_lit(&camera), "the host has five seconds");
    pass(&camera, 1_200.0);
    assert!(!is_lit(&camera));
    camera.with(|machine| machine.chip(|chip| chip.usb.cable.reads.set(true)));
    let mut session = Session::open(camera.link()).unwrap();
    assert_ne!(session.status(&mut IgnorePackets).unwrap().state, State::Running);
    assert!(measure(&mut session, &natural(), 3).counters.is_complete());
    camera.assert_no_violation();
}

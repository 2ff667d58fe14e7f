//! The firmware with the feature `parallel`: PSSI, a list of the DMA, a timer as *ready*.

use super::*;
use crate::camera::parallel_elf;
use nirspi_tests::tapped::{measure, run};
use nirspi_wire::register::Register;

/// A frame of two sweeps takes 164 us: fast enough for the port, and no faster than USB.
pub fn setup() -> MeasurementSetup {
    MeasurementSetup { sweeps: 2, ..natural() }
}

pub fn with_lines(mutation: fn(u32, u32) -> Option<u32>) -> Option<Camera> {
    if !parallel_elf().exists() {
        println!("skipped: no {} (bash .ci/run silicon builds it)", parallel_elf().display());
        return None;
    }
    let camera = Camera::start(Plan {
        parallel: true,
        mutation,
        ..Plan::new(|| {
            Box::new(Golden::with_parallel(optics().fpga(SEED).unwrap(), |fpga| {
                fpga.parallel_packet()
            }))
        })
    })?;
    camera.connect();
    Some(camera)
}

#[test]
fn frames_by_the_parallel_port_are_those_of_the_virtual_camera_bit_for_bit() {
    // More than four rounds of the ring's 128 KB.
    let frames = 200;
    let Some(camera) = with_lines(|_, value| Some(value)) else { return };
    let pins = camera.with(|machine| machine.chip(|chip| chip.wrong_pins()));
    assert_eq!(pins, Vec::<String>::new(), "pins are as in the board's tables");
    let (captured, shots) = run(camera.link(), &setup(), frames);
    assert!(captured.counters.is_complete(), "{}; {:?}", captured.counters, captured.status);
    let bytes = camera.with(|machine| machine.chip(|chip| chip.pssi.bytes));
    println!("{bytes} bytes by the parallel port");
    assert!(bytes > 4 * 128 * 1024, "{bytes} bytes");
    let (_, expected) = run(virtual_camera(), &setup(), frames);
    assert!(shots == expected, "the frames differ");
    camera.assert_no_violation();
}

#[test]
fn a_cable_pulled_while_the_parallel_port_streams_leaves_it_dark_and_ready() {
    let Some(camera) = with_lines(|_, value| Some(value)) else { return };
    for pull in 0..10 {
        let mut session = Session::open(camera.link()).unwrap();
        assert!(session.register(Register::Version, &mut IgnorePackets).is_ok());
        start(&mut session, &setup());
        pass(&camera, 3.0 + f64::from(pull));
        let plug = |plugged| {
            camera.with(move |machine| machine.chip(|chip| chip.usb.cable.plugged.set(plugged)));
        };
        plug(false);
        pass(&camera, 12.0);
        assert!(!is_lit(&camera), "pull {pull}");
        plug(true);
        camera.connect();
    }
    let mut session = Session::open(camera.link()).unwrap();
    assert!(measure(&mut session, &setup(), 50).counters.is_complete());
    assert!(camera.with(|machine| machine.resets.is_empty()));
    camera.assert_no_violation();
}

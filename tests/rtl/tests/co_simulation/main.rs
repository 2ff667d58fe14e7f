//! Tests from light to image through the RTL: host, firmware, four SPI lines, gateware, LEDs,
//! photodiode.
//!
//! A camera with the golden model gets the same scene and the same commands, and must give the same
//! frames.
#![allow(clippy::unwrap_used, reason = "a failed unwrap in a helper fails its test")]

mod bring_up;
mod calibration;
mod emulated;
mod tap;
mod throughput;
mod wires;

use nirspi::capture::{Calibration, Capture, CaptureOptions, Ended, capture};
use nirspi::session::{IgnorePackets, Session, request};
use nirspi::setup::MeasurementSetup;
use nirspi_optics::Scene;
use nirspi_recon::{Measurements, Order, Rows, Side, fwht, metrics, reconstruct};
use nirspi_tests::tapped;
use nirspi_tests_rtl::RtlFpga;
use nirspi_virtual::{MemoryLink, SimulatedFpga, StuckEnable, VirtualCamera, VirtualOptics};
use nirspi_wire::ready;
use nirspi_wire::samples::Width;
use nirspi_wire::{DeviceMessage, Fault, Frame, FrameFlags, SelfTestReport, open};
use std::ops::ControlFlow;
use std::time::Duration;
use tap::{Log, Tap};

const PX: usize = 64;
/// Number of frames. A bus of 16.7 MHz reads a frame more slowly than the FPGA makes one, so only a
/// run's first frame is sure to arrive.
const FRAMES: u32 = 1;

/// A ring on a rough ground: each of the 1024 patterns has a measurement different from zero.
fn scene() -> Scene {
    let rough = |r: usize, c: usize| (r * 37 + c * 101 + r * c * 13) % 97;
    let reflectance = (0..PX * PX).map(|p| {
        let (r, c) = (p / PX, p % PX);
        let ring = (8.0..14.0).contains(&(r as f32 - 40.0).hypot(c as f32 - 24.0));
        0.004 * rough(r / 2, c / 2) as f32 + if ring { 0.5 } else { 0.1 }
    });
    Scene::new(reflectance.collect(), PX, 48.0).unwrap()
}

fn ideal() -> VirtualOptics {
    VirtualOptics::new(scene(), 300.0).unwrap().ideal()
}

/// LEDs, amplifier and ADC with their default settling times, without noise.
fn noiseless() -> VirtualOptics {
    VirtualOptics::new(scene(), 300.0).unwrap().noiseless()
}

fn session<F: SimulatedFpga + 'static>(optics: &VirtualOptics, fpga: F) -> Session {
    let camera = VirtualCamera::new(fpga, optics.depth(1).unwrap(), "co-simulated");
    Session::open(Box::new(MemoryLink::new(camera))).unwrap()
}

fn run(session: &mut Session, setup: &MeasurementSetup, frames: u32) -> Capture {
    let setup = setup.clone();
    let calibration = Calibration::None;
    let options = CaptureOptions { setup, frames: Some(frames), calibration, record: None };
    capture(session, &options, &mut |_| ControlFlow::Continue(())).unwrap()
}

/// What a packet says of its frame. Left out is the device time: firmware behind another bus starts at another clock.
#[derive(Debug, PartialEq)]
struct Told {
    run: u16,
    sequence: u32,
    sweeps: u32,
    flags: FrameFlags,
    samples: Vec<i64>,
}

impl Told {
    /// Takes the packet of `patterns` patterns out of the bytes of one read, which has zeros before and after it.
    fn of(read: &[u8], patterns: usize) -> Self {
        let place = [Width::Bits24, Width::Bits32]
            .into_iter()
            .find_map(|width| ready::packet_in(read, patterns as u16, width));
        let mut packet = read[place.expect("a packet")].to_vec();
        let (delimiter, encoded) = packet.split_last_mut().unwrap();
        assert_eq!(*delimiter, 0);
        let DeviceMessage::Frame(frame) = open(encoded).unwrap() else { panic!("no frame") };
        let Frame { run, sequence, sweeps, flags, samples, .. } = frame;
        Self { run, sequence, sweeps, flags, samples: samples.iter().collect() }
    }
}

/// Captures with the RTL, after a check that the golden model's capture has the same frames.
fn both(optics: &VirtualOptics, setup: &MeasurementSetup, frames: u32) -> Capture {
    let (rtl, rtl_log) = Tap::new(RtlFpga::new(optics, 1));
    let captured = run(&mut session(optics, rtl), setup, frames);
    assert!(matches!(captured.ended, Ended::Complete), "{:?}", captured.ended);
    let (golden, golden_log) = Tap::new(optics.fpga(1).unwrap());
    run(&mut session(optics, golden), setup, frames);
    let [rtl, golden] = [rtl_log, golden_log].map(|log| {
        let reads = log.bytes();
        reads.iter().map(|read| Told::of(read, setup.rows.len())).collect::<Vec<_>>()
    });
    assert_eq!(rtl.len(), frames as usize);
    assert_eq!(rtl, golden);
    captured
}

/// Checks every measurement of an ideal camera against the transform of the scene, to within the
/// rounding of its two readings.
fn check(captured: &Capture) {
    let optics = ideal();
    let counts = optics.budget().electrons_per_led / optics.chain().electrons_per_count;
    let mut expected: Vec<f64> =
        optics.footprint().weights().iter().map(|&w| f64::from(w) * counts).collect();
    fwht(&mut expected).unwrap();
    let measurements = captured.integrated.measurements(&captured.setup, None, true).unwrap();
    assert_eq!(measurements.rows().len(), captured.setup.rows.len());
    for (&row, value) in measurements.rows().iter().zip(measurements.values()) {
        let off = (value - expected[row as usize]).abs();
        assert!(off <= 1.01, "row {row} is {off:.1} ADC counts off");
    }
    if measurements.rows().len() == expected.len() {
        check_image(&optics, &measurements);
    }
}

/// Checks that the image of a full set of measurements is the scene.
fn check_image(optics: &VirtualOptics, measurements: &Measurements) {
    let image = reconstruct::hadamard(measurements);
    let side = Side::INSTRUMENT.pixels();
    let weights = optics.footprint().weights();
    let correlation = metrics::correlation(weights, image.pixels(), side, side).unwrap();
    assert!(correlation > 0.9999, "correlation {correlation}");
}

#[test]
fn a_scene_comes_through_the_rtl_exactly_and_bit_for_bit_as_through_the_golden_model() {
    let setup = MeasurementSetup::new(&Order::Natural, 1.0).unwrap();
    let captured = both(&ideal(), &setup, FRAMES);
    check(&captured);
    assert!(captured.counters.is_complete());
    let each = captured.elapsed / FRAMES;
    println!("one sweep of 1024 patterns and complements, shown, read and sent: {each:.2?}");
}

/// The packets that the RTL makes go through the firmware as they are.
#[test]
fn packets_of_the_rtl_carry_the_samples_of_the_golden_model() {
    let optics = ideal();
    let setup = MeasurementSetup::new(&Order::Natural, 1.0).unwrap();
    let (rtl, log) = Tap::new(RtlFpga::new(&optics, 1));
    let camera = VirtualCamera::new(rtl, optics.depth(1).unwrap(), "co-simulated");
    let (captured, packets) = tapped::run(Box::new(MemoryLink::new(camera)), &setup, 2);
    assert!(matches!(captured.ended, Ended::Complete), "{:?}", captured.ended);
    let read = log.bytes();
    let place = ready::packet_in(&read[0], 1024, Width::Bits24).unwrap();
    assert!(place.start <= ready::LEAD_BYTES);
    println!("{} zeros, then a packet of {} bytes", place.start, place.len());

    let golden = optics.fpga(1).unwrap();
    let camera = VirtualCamera::new(golden, optics.depth(1).unwrap(), "co-simulated");
    let (_, frames) = tapped::run(Box::new(MemoryLink::new(camera)), &setup, 2);
    // A bus of 16.7 MHz loses some frames of the RTL; of those that came, each has the samples of its number.
    assert!(!packets.is_empty());
    for shot in packets {
        assert_eq!(shot.run, 1);
        assert!(shot.samples == frames[0].samples, "frame {}", shot.sequence);
    }
}

#[test]
fn an_order_table_and_a_part_of_the_patterns_come_through_too() {
    let mut setup = MeasurementSetup::new(&Order::Random(7), 0.1).unwrap();
    setup.sweeps = 3;
    let captured = both(&ideal(), &setup, FRAMES);
    assert!(captured.counters.is_complete());
    check(&captured);
}

#[test]
fn slow_leds_and_a_late_adc_give_the_same_frames_with_the_same_latency() {
    let optics = noiseless();
    let mut setup = MeasurementSetup::new(&Order::Natural, 0.25).unwrap();
    setup.adc_latency = optics.chain().adc_latency_clocks;
    both(&optics, &setup, FRAMES);
}

/// Calibration uses a raw burst: equal bursts give equal latency and leak.
#[test]
fn a_calibration_burst_through_the_rtl_is_that_of_the_golden_model() {
    let optics = noiseless();
    let setup = MeasurementSetup {
        rows: Rows::natural(Side::INSTRUMENT).first(1),
        clocks_per_pattern: nirspi::calibration::HALF_PERIOD,
        blanked: 0,
        ..MeasurementSetup::new(&Order::Natural, 1.0).unwrap()
    };
    let burst = |mut session: Session, log: Log| {
        setup
            .with_configuration(|c| session.command(request::Configure(c), &mut IgnorePackets))
            .unwrap();
        session.command(request::RawBurst(1024), &mut IgnorePackets).unwrap();
        while log.bytes().is_empty() {
            session.listen(Duration::from_millis(50), &mut IgnorePackets).unwrap();
        }
        log.bytes()
    };
    let (rtl, rtl_log) = Tap::new(RtlFpga::new(&optics, 1));
    let (golden, golden_log) = Tap::new(optics.fpga(1).unwrap());
    let rtl = burst(session(&optics, rtl), rtl_log);
    assert_eq!(rtl[0].len(), 2 * 1024);
    assert!(rtl == burst(session(&optics, golden), golden_log));
}

#[test]
fn frames_that_a_slow_bus_loses_are_counted_and_spoil_no_other() {
    let frames = 200;
    let setup = MeasurementSetup::new(&Order::Natural, 0.1).unwrap();
    let (fpga, log) = Tap::new(RtlFpga::new(&ideal(), 1));
    let captured = run(&mut session(&ideal(), fpga), &setup, frames);
    let counters = captured.counters;
    assert_eq!(counters.total(), u64::from(frames));
    assert!(counters.lost > 0 && counters.received > 2, "{counters}");
    check(&captured);

    let mut expected = 0;
    for bytes in log.bytes() {
        let Told { sequence, flags, .. } = Told::of(&bytes, setup.rows.len());
        assert_eq!(flags.contains(FrameFlags::AFTER_LOSS), sequence != expected);
        expected = sequence + 1;
    }
}

/// Runs with and without light, at the pins of the RTL.
#[test]
fn the_self_test_tries_each_led_enable_through_the_rtl() {
    let both = SelfTestReport::BOARD_ENABLE | SelfTestReport::FPGA_ENABLE;
    for (stuck, ran, failed) in [
        (None, both, 0),
        (Some(StuckEnable::Fpga), both, SelfTestReport::FPGA_ENABLE),
        (Some(StuckEnable::Board), SelfTestReport::BOARD_ENABLE, SelfTestReport::BOARD_ENABLE),
    ] {
        let mut fpga = RtlFpga::with(&ideal(), 1, stuck);
        // The frequency of the ADC's clock is known after 0.4 ms.
        fpga.advance(60_000);
        let mut session = session(&ideal(), fpga);
        let report = session.self_test(&mut IgnorePackets).unwrap();
        assert_eq!((report.ran & both, report.failed), (ran, failed), "{stuck:?}");
    }
}

#[test]
fn an_open_interlock_keeps_the_rtl_dark_and_the_host_is_told() {
    let mut camera =
        VirtualCamera::new(RtlFpga::new(&ideal(), 1), ideal().depth(1).unwrap(), "co-simulated");
    camera.set_interlock(false);
    let mut session = Session::open(Box::new(MemoryLink::new(camera))).unwrap();
    let setup = MeasurementSetup::new(&Order::Natural, 1.0).unwrap();
    let calibration = Calibration::None;
    let options = CaptureOptions { setup, frames: Some(1), calibration, record: None };
    match capture(&mut session, &options, &mut |_| ControlFlow::Continue(())) {
        Ok(captured) => assert!(matches!(captured.ended, Ended::Fault(Fault::Interlock))),
        Err(error) => assert!(error.to_string().contains("interlock is open"), "{error}"),
    }
}

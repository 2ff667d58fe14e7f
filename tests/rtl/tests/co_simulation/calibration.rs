//! Tests of calibration through the RTL: latency, response and dark level from raw bursts.

use crate::{check_image, noiseless, session};
use nirspi::capture::{Calibration, Capture, CaptureOptions, Ended, capture};
use nirspi::session::Session;
use nirspi::setup::MeasurementSetup;
use nirspi_recon::Order;
use nirspi_tests_rtl::RtlFpga;
use std::ops::ControlFlow;

/// One frame of an instrument that has measured its own latency and leak.
fn calibrated(mut session: Session) -> Capture {
    let setup = MeasurementSetup::new(&Order::Natural, 1.0).unwrap();
    let options =
        CaptureOptions { setup, frames: Some(1), calibration: Calibration::Measure, record: None };
    let captured = capture(&mut session, &options, &mut |_| ControlFlow::Continue(())).unwrap();
    assert!(matches!(captured.ended, Ended::Complete), "{:?}", captured.ended);
    captured
}

#[test]
fn the_rtl_is_calibrated_as_the_golden_model_and_the_scene_comes_back() {
    let optics = noiseless();
    let rtl = calibrated(session(&optics, RtlFpga::new(&optics, 1)));
    let golden = calibrated(session(&optics, optics.fpga(1).unwrap()));

    let settling = rtl.settling.as_ref().expect("no calibration");
    assert_eq!(Some(settling), golden.settling.as_ref());
    assert_eq!(settling.leak(5, 2).unwrap(), golden.settling.as_ref().unwrap().leak(5, 2).unwrap());
    assert_eq!(settling.adc_latency, optics.chain().adc_latency_clocks);
    assert!(settling.leak(5, 2).unwrap().taps()[1] > 0.01, "nothing leaks: {settling:?}");

    let measurements =
        |c: &Capture| c.integrated.measurements(&c.setup, c.settling.as_ref(), false).unwrap();
    assert_eq!(measurements(&rtl).values(), measurements(&golden).values());
    check_image(&optics, &measurements(&rtl));
}

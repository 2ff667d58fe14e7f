//! Tests of the frames of further detectors.

use super::support::*;
use nirspi_wire::fpga::{CRC_BYTES, HEADER_BYTES};
use nirspi_wire::{
    Answer, Channel, Command, DeviceMessage, Frame, Identity, RunLength, Tail, crc32, version,
};
use std::vec;
use std::vec::Vec;

/// A camera of three detectors that measures, for a host of this protocol version. Detector 2 has the frame of detector
/// 0, and detector 1 the frame that `other` makes of it.
fn three(protocol: u16, other: impl Fn(&mut Vec<u8>)) -> (Identity<'static>, Bench) {
    cameras(2, protocol, other)
}

/// Such a camera with this many further detectors.
fn cameras(
    further: usize,
    protocol: u16,
    other: impl Fn(&mut Vec<u8>),
) -> (Identity<'static>, Bench) {
    let mut bench = Bench::new();
    bench.fpga.channels = vec![Vec::new(); further];
    if further > 0 {
        bench.fpga.make_packets();
    }
    let Ok(Answer::Hello(identity)) = bench.ask(Command::Hello { protocol }) else {
        panic!("no session");
    };
    bench.ask(Command::Configure(SMALL)).unwrap();
    assert!(!bench.fpga.sends_packets(), "a packet of the FPGA has detector 0 alone");
    bench.ask(Command::Start(RunLength::Frames(2))).unwrap();
    for _ in 0..2 {
        bench.fpga.make_frame();
        let frame = bench.fpga.frame.clone().unwrap();
        let mut first = frame.clone();
        other(&mut first);
        bench.fpga.channels = [first, frame].into_iter().take(further).collect();
        bench.after(100);
    }
    (identity, bench)
}

fn numbers(heard: &[DeviceMessage<'_>]) -> Vec<(u8, u32)> {
    let frames = heard.iter().filter_map(DeviceMessage::frame);
    frames.map(|(detector, frame)| (detector, frame.sequence)).collect()
}

#[test]
fn each_further_detector_speaks_right_after_the_first_one() {
    let (identity, mut bench) = three(version::CURRENT, |_| {});
    assert_eq!(identity.detectors, Tail(Some(3)));
    let heard = bench.heard();
    assert_eq!(numbers(&heard), [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1)]);
    assert!(matches!(heard[6], DeviceMessage::Event(_)), "the end of the run comes last");
    let [DeviceMessage::Frame(first), DeviceMessage::Channel(Channel { frame, .. })] = heard[3..5]
    else {
        panic!("{heard:?}");
    };
    let of = |frame: Frame<'_>| {
        let Frame { run, sequence, device_time_us, sweeps, flags, samples } = frame;
        let samples: Vec<i64> = samples.iter().collect();
        (run, sequence, device_time_us, sweeps, flags, samples)
    };
    assert_eq!(of(frame), of(first));
}

#[test]
fn a_session_of_version_2_carries_the_first_detector_alone() {
    let (identity, mut bench) = three(2, |_| {});
    assert_eq!(identity.detectors, Tail(None));
    assert_eq!(numbers(&bench.heard()), [(0, 0), (0, 1)]);
}

#[test]
fn a_damaged_frame_of_a_further_detector_is_left_out_and_costs_no_other() {
    let (_, mut bench) = three(version::CURRENT, |frame| frame[40] ^= 1);
    assert_eq!(numbers(&bench.heard()), [(0, 0), (2, 0), (0, 1), (2, 1)]);
    let status = bench.status();
    assert_eq!((status.frames_sent, status.fpga_frames_corrupt), (2, 0));
}

#[test]
fn a_full_link_sends_no_further_detector_without_the_first() {
    let mut bench = Bench::open();
    bench.fpga.channels = vec![Vec::new()];
    bench.ask(Command::Configure(SMALL)).unwrap();
    bench.ask(Command::Start(RunLength::Continuous)).unwrap();
    bench.link.refusals = 1;
    bench.fpga.make_frame();
    bench.fpga.channels = vec![bench.fpga.frame.clone().unwrap()];
    bench.after(100);
    assert_eq!(numbers(&bench.heard()), []);
    assert_eq!(bench.status().frames_dropped, 1);
}

/// The memory of packed samples holds the samples of the last detector when the next frame of detector 0 comes.
#[test]
fn the_signal_meter_compares_frames_of_detector_0_whatever_the_others_see() {
    let dark = |frame: &mut Vec<u8>| {
        let end = frame.len() - CRC_BYTES;
        frame[HEADER_BYTES..end].fill(0);
        let crc = crc32(&frame[..end]).to_le_bytes();
        frame[end..].copy_from_slice(&crc);
    };
    let [alone, beside] = [0, 1].map(|further| {
        let (_, mut bench) = cameras(further, version::CURRENT, dark);
        assert_eq!(numbers(&bench.heard()).len(), 2 * (1 + further));
        bench.status().signal.0.unwrap().unwrap()
    });
    assert_eq!(beside, alone);
}

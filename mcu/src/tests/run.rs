//! Test of a run alone: no machine around it.

use super::*;
use crate::tests::fake_fpga::FakeFpga;
use crate::tests::support::{Link, SMALL};

#[test]
fn a_run_of_one_frame_sends_the_frame_and_ends_when_it_is_through() {
    let (mut bus, mut link, limits) = (FakeFpga::default(), Link::default(), Limits::SIMULATED);
    let setup = configure::check(&SMALL, &limits).unwrap();
    fpga::set(&mut bus, &setup, &limits).unwrap();
    let mut run =
        Run::start(Micros(0), (1, RunLength::Frames(1)), &setup, &limits, &mut bus).unwrap();
    let mut counters = Counters::default().of_next_run();
    assert_eq!(run.progress(Micros(1), &counters), Progress::UnderWay);
    assert_eq!(run.progress(Micros(10_000_000), &counters), Progress::Stalled);

    bus.make_frame();
    let mut scratch = [0; SAMPLE_BYTES];
    let mut release_pending = false;
    let mut meter = Meter::new();
    let path =
        Path { counters: &mut counters, meter: &mut meter, scratch: &mut scratch, may_send: true };
    let coming = (true, &mut release_pending);
    assert!(run.take(Micros(2), path, coming, &mut bus, &mut link));
    assert_eq!((link.packets.len(), counters.sent, release_pending), (1, 1, false));
    assert_eq!(run.progress(Micros(3), &counters), Progress::Complete);

    assert_eq!(run.wind_up(Micros(3), &mut counters, Fpga::Dark, &mut bus), None, "LEDs are on");
    run.end(Micros(4), Some((7, Outcome::DONE)));
    assert_eq!(run.wind_up(Micros(5), &mut counters, Fpga::MayBeLit, &mut bus), None);
    let ended = run.wind_up(Micros(6), &mut counters, Fpga::Dark, &mut bus).unwrap();
    assert_eq!(ended.reply, Some((7, Outcome::DONE)));
    let EventKind::RunEnded { run: 1, frames_made: 1, frames_dropped: 0, .. } = ended.event else {
        panic!("{:?}", ended.event);
    };
}

//! What the chip sees of the time between two polls, what the host sees of the light, and which polls
//! ask for the next one at once.

use super::fake_ecp5::FakeEcp5;
use super::support::*;
use crate::Micros;
use crate::ecp5::{Configuration, IDCODE_LFE5UM5G_85F};
use nirspi_wire::{Command, RunLength};

/// A board polls as fast as it can, so several polls may fall into one microsecond.
#[test]
fn the_chip_sees_the_pulse_that_clears_it_however_fast_the_polls_come() {
    let mut chip = FakeEcp5::running(&[1, 2, 3]);
    let mut configuration = Configuration::new(IDCODE_LFE5UM5G_85F);
    let over = (0..10_000_000).find_map(|poll| {
        let now = Micros(1 + poll / 10);
        chip.pass(now);
        configuration.poll(now, &mut chip, &[0xA5; 500])
    });
    assert_eq!(over, Some(Ok(())));
    assert_eq!(chip.runs.as_deref(), Some(&[0xA5; 500][..]));
}

#[test]
fn the_status_says_that_leds_are_on_in_a_run_and_off_before_and_after_it() {
    let mut bench = Bench::configured();
    assert!(!bench.status().leds_on);
    bench.ask(Command::Start(RunLength::Continuous)).unwrap();
    assert!(bench.status().leds_on && bench.fpga.leds_on());
    bench.ask(Command::Stop).unwrap();
    assert!(!bench.status().leds_on && !bench.fpga.leds_on());
}

/// A board that sleeps after such a poll would leave the next frame waiting.
#[test]
fn a_poll_that_took_a_frame_or_sent_a_notice_has_worked() {
    let mut bench = Bench::running(RunLength::Frames(3));
    assert!(!bench.poll().worked, "nothing to do");
    bench.fpga.make_frame();
    assert!(bench.poll().worked, "a frame");
    // A damaged command gives a notice, which waits for room on the link.
    let damaged = |bench: &mut Bench| {
        bench.link.room = 0;
        bench.receive(&[1, 2, 3, 0]);
        bench.link.room = 10;
    };
    damaged(&mut bench);
    assert!(bench.poll().worked, "a notice");
    damaged(&mut bench);
    bench.fpga.make_frame();
    assert!(bench.poll().worked, "a notice and a frame");
    // After the last frame comes the notice that the run has ended.
    bench.fpga.make_frame();
    assert!(bench.poll().worked, "a frame and a notice");
    assert_eq!(frames(&bench.heard()).len(), 3);
    assert!(!bench.poll().worked, "nothing to do");
}

//! Tests that the first host after a crash gets the crash report, and no later host.

use super::support::*;
use crate::{BoardInfo, CRASH_WORDS, Camera, Crash, Limits, Micros};
use nirspi_wire::message::CRASH_TEXT_MAX;
use nirspi_wire::{Command, CrashReport, DeviceMessage, Version, version};
use proptest::prelude::*;
use std::string::String;
use std::vec::Vec;

fn crash() -> Crash {
    Crash::new(Micros(1 << 40), format_args!("panicked at {}: {}", "run.rs:7", "no"))
}

fn reports(messages: &[DeviceMessage<'_>]) -> Vec<(u64, String)> {
    let report = |message: &DeviceMessage<'_>| match *message {
        DeviceMessage::Crash(CrashReport { uptime_us, text }) => Some((uptime_us, text.into())),
        _ => None,
    };
    messages.iter().filter_map(report).collect()
}

fn hello(bench: &mut Bench, protocol: u16) -> Vec<(u64, String)> {
    bench.send(Command::Hello { protocol });
    bench.poll();
    let heard = bench.heard();
    assert!(matches!(heard[0], DeviceMessage::Reply(_)), "the answer first: {heard:?}");
    reports(&heard)
}

fn crashed() -> Bench {
    let mut bench = Bench::new();
    let info = BoardInfo::new("bench", "0001", Version(1, 2, 3));
    bench.camera = Camera::new(info, Limits::SIMULATED);
    bench.camera.restarted_after(crash());
    bench.train();
    bench
}

#[test]
fn the_first_host_is_told_and_the_next_is_not() {
    let mut bench = crashed();
    let told = hello(&mut bench, version::CURRENT);
    assert_eq!(told, [(1 << 40, "panicked at run.rs:7: no".into())]);
    assert_eq!(hello(&mut bench, version::CURRENT), []);
}

#[test]
fn a_host_of_another_version_leaves_it_to_the_next() {
    let mut bench = crashed();
    assert_eq!(hello(&mut bench, version::CURRENT + 1), []);
    assert_eq!(hello(&mut bench, version::CURRENT).len(), 1);
}

#[test]
fn a_link_without_room_keeps_it() {
    let mut bench = crashed();
    bench.link.room = 1;
    assert_eq!(hello(&mut bench, version::CURRENT), []);
    bench.link.room = 9;
    bench.poll();
    assert_eq!(reports(&bench.heard()).len(), 1);
}

#[test]
fn two_hellos_at_once_hear_of_it_once() {
    let mut bench = crashed();
    bench.link.room = 0;
    bench.send(Command::Hello { protocol: version::CURRENT });
    bench.send(Command::Hello { protocol: version::CURRENT });
    bench.link.room = 9;
    bench.poll();
    assert_eq!(reports(&bench.heard()).len(), 1);
}

proptest! {
    #[test]
    fn a_record_comes_back_and_no_damaged_one_does(
        uptime: u64, text in "\\PC{0,60}", at in 0..CRASH_WORDS, flip in 1u32..,
    ) {
        let crash = Crash::new(Micros(uptime), format_args!("{text}"));
        let mut words = crash.to_words();
        prop_assert_eq!(Crash::from_words(&words), Some(crash));
        words[at] ^= flip;
        prop_assert_eq!(Crash::from_words(&words), None);
    }

    #[test]
    fn a_long_text_is_cut_after_a_whole_character(text in "\\PC{50,200}") {
        let crash = Crash::new(Micros(0), format_args!("{text}"));
        prop_assert!(text.starts_with(crash.text.as_str()));
        prop_assert!(crash.text.len() == text.len() || crash.text.len() + 4 > CRASH_TEXT_MAX);
        prop_assert_eq!(Crash::from_words(&crash.to_words()), Some(crash));
    }
}

#[test]
fn memory_that_nobody_wrote_is_no_record() {
    assert_eq!(Crash::from_words(&[0; CRASH_WORDS]), None);
    assert_eq!(Crash::from_words(&[u32::MAX; CRASH_WORDS]), None);
}

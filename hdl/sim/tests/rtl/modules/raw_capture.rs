//! Tests of raw bursts.

use super::bundles::Settings;
use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;

laws![
    word_t_is_the_sample_of_clock_t_and_the_last_is_marked,
    a_halted_burst_is_never_whole,
    a_run_of_frames_records_nothing,
];

/// Starts a burst with these settings; returns the samples of its active clocks, and the clocks
/// that the module marked.
fn run(
    bench: &mut Bench,
    dice: &mut Dice,
    settings: &Settings,
    halt: u64,
) -> Vec<(u64, bool, bool)> {
    bench.set_fields("settings", &settings.fields());
    bench.set("start", true);
    bench.tick();
    bench.set("start", false);
    let mut recorded = Vec::new();
    for clock in 0..settings.raw_length + 5 {
        let sample = dice.range(0, 0x7FFF);
        bench.set("sample", sample);
        bench.set("halt", clock == halt);
        let (first, last) = (bench.is("first"), bench.is("last"));
        if bench.is("active") {
            recorded.push((sample, first, last));
        } else {
            assert!(!first && !last);
        }
        bench.tick();
    }
    bench.set("halt", false);
    recorded
}

fn word(bench: &mut Bench, address: usize) -> u64 {
    bench.set("host_address", address as u64);
    bench.tick();
    bench.tick();
    bench.get("host_word")
}

fn word_t_is_the_sample_of_clock_t_and_the_last_is_marked(project: &Project) {
    let mut bench = Bench::new(project, "raw_capture");
    let dice = &mut Dice::new(11);
    for length in [1, 2, 3, 77, 4096] {
        let settings = Settings { raw: true, raw_length: length, ..Settings::default() };
        let recorded = run(&mut bench, dice, &settings, u64::MAX);
        assert_eq!(recorded.len() as u64, length);
        for (t, &(sample, first, last)) in recorded.iter().enumerate() {
            assert_eq!((first, last), (t == 0, t as u64 == length - 1), "clock {t} of {length}");
            let (over_range, code) = (sample >> 14, sample & 0x3FFF);
            assert_eq!(word(&mut bench, t), over_range << 15 | code, "word {t} of {length}");
        }
    }
}

fn a_halted_burst_is_never_whole(project: &Project) {
    let mut bench = Bench::new(project, "raw_capture");
    let dice = &mut Dice::new(12);
    for halt in [0, 1, 5, 28] {
        let settings = Settings { raw: true, raw_length: 30, ..Settings::default() };
        let recorded = run(&mut bench, dice, &settings, halt);
        assert_eq!(recorded.len() as u64, halt + 1);
        assert!(recorded.iter().all(|&(_, _, last)| !last));
    }
}

fn a_run_of_frames_records_nothing(project: &Project) {
    let mut bench = Bench::new(project, "raw_capture");
    let dice = &mut Dice::new(13);
    let settings = Settings { raw_length: 1, ..Settings::default() };
    let burst = run(&mut bench, dice, &Settings { raw: true, ..settings }, u64::MAX);
    let [(sample, ..)] = burst[..] else { panic!("{burst:?}") };
    assert!(run(&mut bench, dice, &settings, u64::MAX).is_empty());
    assert_eq!(word(&mut bench, 0), (sample >> 14) << 15 | sample & 0x3FFF);
}

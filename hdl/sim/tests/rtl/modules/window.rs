//! Tests of the attribution of samples to slots.

use super::bundles::{PLACE, Place, Settings};
use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;

/// Clocks from a start to the sample of a run's clock 0.
const TO_SAMPLE: u64 = 2;

laws![
    a_sample_belongs_to_what_was_shown_latency_clocks_before,
    the_sum_of_a_slot_is_that_of_its_unblanked_samples,
    a_raw_burst_attributes_nothing,
];

/// Runs to the end of a finite run; returns each clock's sample, place, and the sum that comes in
/// the next clock.
fn run(bench: &mut Bench, dice: &mut Dice, settings: &Settings) -> Vec<(u64, Option<Place>, u64)> {
    bench.set_fields("settings", &settings.fields());
    let clocks = TO_SAMPLE + settings.latency + settings.frames * settings.frame_clocks() + 4;
    let mut seen = Vec::new();
    for clock in 0..clocks {
        bench.set("start", clock == 0);
        // Sometimes every bit of the code is set.
        let code = if dice.once_in(8) { 0x3FFF } else { dice.range(0, 0x3FFF) };
        let over_range = dice.once_in(2);
        bench.set("sample", u64::from(over_range) << 14 | code);
        let place = Place::from_fields(&bench.get_fields("place", &PLACE));
        bench.tick();
        seen.push((code, place, bench.get("sum")));
    }
    seen
}

fn random(dice: &mut Dice) -> Settings {
    let settings = Settings::random(dice);
    Settings { frames: settings.frames.max(1), ..settings }
}

fn a_sample_belongs_to_what_was_shown_latency_clocks_before(project: &Project) {
    let mut bench = Bench::new(project, "window");
    let dice = &mut Dice::new(8);
    for _ in 0..100 {
        let settings = random(dice);
        let seen = run(&mut bench, dice, &settings);
        for (clock, (_, place, _)) in seen.iter().enumerate() {
            let shown = (clock as u64).checked_sub(TO_SAMPLE + settings.latency);
            let expected = shown.and_then(|t| Place::of(&settings, t));
            assert_eq!(*place, expected, "clock {clock} of {settings:?}");
        }
    }
}

fn the_sum_of_a_slot_is_that_of_its_unblanked_samples(project: &Project) {
    let mut bench = Bench::new(project, "window");
    let dice = &mut Dice::new(9);
    let mut slots = 0;
    for _ in 0..100 {
        let settings = random(dice);
        let seen = run(&mut bench, dice, &settings);
        for (last, (_, place, sum)) in seen.iter().enumerate() {
            if place.is_some_and(|place| place.slot_last) {
                let unblanked = (settings.dwell - settings.blank) as usize;
                let samples = &seen[last + 1 - unblanked..=last];
                assert_eq!(*sum, samples.iter().map(|(code, ..)| code).sum::<u64>());
                slots += 1;
            }
        }
    }
    assert!(slots > 1000, "{slots}");
}

fn a_raw_burst_attributes_nothing(project: &Project) {
    let mut bench = Bench::new(project, "window");
    let dice = &mut Dice::new(10);
    let settings = Settings { raw: true, latency: 0, ..random(dice) };
    assert!(run(&mut bench, dice, &settings).iter().all(|(_, place, _)| place.is_none()));
}

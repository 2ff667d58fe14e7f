//! Tests of the lines at the LEDs.

use super::bundles::{Place, Settings};
use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;

/// Clocks from the choice of a slot to the change of its lines.
const TO_PINS: u64 = 6;

laws![
    an_led_is_lit_where_the_hadamard_row_of_its_pattern_is_positive,
    light_is_told_apart_into_all_none_and_half,
    a_run_without_light_shows_its_lines_and_lights_nothing,
    nothing_is_lit_in_the_clock_after_a_permission_is_withdrawn,
    a_halt_darkens_the_lines_at_once,
];

/// A run; the test answers for the order table.
struct Run {
    bench: Bench,
    settings: Settings,
    table: Vec<u64>,
    /// Indices that the module asked the table for.
    asked: [u64; 2],
    t: u64,
}

impl Run {
    fn start(mut bench: Bench, dice: &mut Dice, settings: Settings) -> Self {
        bench.set_fields("settings", &settings.fields());
        bench.set("permit", true);
        bench.set("permitted", true);
        // Pattern 0 lights all LEDs or none, so the test draws it more often.
        let entry = |dice: &mut Dice| if dice.once_in(4) { 0 } else { dice.range(0, 1023) };
        let table = (0..1024).map(|_| entry(dice)).collect();
        let mut run = Self { bench, settings, table, asked: [0; 2], t: 0 };
        run.bench.set("start", true);
        run.tick();
        run.bench.set("start", false);
        run
    }

    fn tick(&mut self) {
        let answer = self.table[self.asked[1] as usize];
        self.bench.set("table_entry", answer);
        self.asked = [self.bench.get("table_index"), self.asked[0]];
        self.bench.tick();
        self.t += 1;
    }

    /// Pattern at the pins; `None` when dark.
    fn shown(&self) -> Option<Shown> {
        let place = Place::of(&self.settings, self.t.checked_sub(TO_PINS)?)?;
        let pattern = if self.settings.order_table {
            self.table[place.index as usize]
        } else if self.settings.order_sequency {
            let gray = place.index ^ place.index >> 1;
            (0..10).fold(0, |reversed, bit| reversed << 1 | gray >> bit & 1)
        } else {
            place.index
        };
        let Place { complement, inverted, .. } = place;
        Some(Shown { pattern, complement, inverted })
    }

    /// Number of clocks of a run of one frame, and some beyond its end.
    fn clocks(&self) -> u64 {
        self.settings.frame_clocks() + TO_PINS + 5
    }
}

/// What the lines stand for.
#[derive(Debug, Clone, Copy)]
struct Shown {
    pattern: u64,
    complement: bool,
    /// All lines are inverted, which lights the same LEDs.
    inverted: bool,
}

/// Row and column lines by the definition of a pattern: line `i` is the parity of `k & i`, where `k`
/// is the upper (rows) or lower (columns) five bits of the pattern. A complement inverts the rows, and
/// some sweeps invert all lines.
fn lines(Shown { pattern, complement, inverted }: Shown) -> (u64, u64) {
    let line = |k: u64, i: u64| u64::from((k & i).count_ones() % 2);
    let word = |k: u64| (0..32).fold(0, |word, i| word | line(k, i) << i);
    let invert = |word: u64, is: bool| if is { word ^ 0xFFFF_FFFF } else { word };
    (invert(word(pattern >> 5), complement != inverted), invert(word(pattern & 31), inverted))
}

fn random(dice: &mut Dice) -> Settings {
    let all = dice.once_in(10);
    Settings {
        order_table: dice.once_in(2),
        order_sequency: dice.once_in(2),
        patterns: if all { 1024 } else { dice.range(1, 12) },
        dwell: dice.range(1, 3),
        sweeps: if all { 1 } else { dice.range(1, 6) },
        frames: 1,
        blank: 0,
        ..Settings::random(dice)
    }
}

fn an_led_is_lit_where_the_hadamard_row_of_its_pattern_is_positive(project: &Project) {
    let dice = &mut Dice::new(15);
    let mut bench = Bench::new(project, "leds");
    for _ in 0..30 {
        let settings = random(dice);
        let mut run = Run::start(bench, dice, settings);
        for _ in 0..run.clocks() {
            let shown = run.shown();
            let seen = (run.bench.get("rows"), run.bench.get("columns"));
            assert_eq!(run.bench.is("enable"), shown.is_some(), "clock {} of {settings:?}", run.t);
            assert_eq!(seen, shown.map_or((0, 0), lines), "clock {} of {settings:?}", run.t);
            run.tick();
        }
        bench = run.bench;
    }
}

fn light_is_told_apart_into_all_none_and_half(project: &Project) {
    let dice = &mut Dice::new(16);
    let mut bench = Bench::new(project, "leds");
    let mut all = 0;
    for _ in 0..30 {
        let settings = Settings { order_table: true, ..random(dice) };
        let mut run = Run::start(bench, dice, settings);
        for _ in 0..run.clocks() {
            let shown = run.shown();
            let seen = ["lit", "full", "dark"].map(|port| run.bench.is(port));
            let zero =
                |complement| shown.is_some_and(|s| s.pattern == 0 && s.complement == complement);
            assert_eq!(seen, [shown.is_some(), zero(false), zero(true)], "clock {}", run.t);
            all += u64::from(seen[1]);
            run.tick();
        }
        bench = run.bench;
    }
    assert!(all > 20, "{all}");
}

fn a_run_without_light_shows_its_lines_and_lights_nothing(project: &Project) {
    let dice = &mut Dice::new(46);
    let mut bench = Bench::new(project, "leds");
    let mut lit = [0; 2];
    for round in 0..20 {
        let settings = Settings { unlit: round % 2 == 0, order_table: true, ..random(dice) };
        let mut run = Run::start(bench, dice, settings);
        for _ in 0..run.clocks() {
            let shown = run.shown();
            let seen = (run.bench.get("rows"), run.bench.get("columns"));
            assert_eq!(seen, shown.map_or((0, 0), lines), "clock {} of {settings:?}", run.t);
            let light = ["enable", "lit", "full", "dark"].map(|port| run.bench.is(port));
            if settings.unlit {
                assert_eq!(light, [false; 4], "clock {} of {settings:?}", run.t);
            }
            lit[round % 2] += u64::from(light[0]);
            run.tick();
        }
        bench = run.bench;
    }
    assert!(lit[0] == 0 && lit[1] > 20, "{lit:?}");
}

fn nothing_is_lit_in_the_clock_after_a_permission_is_withdrawn(project: &Project) {
    let dice = &mut Dice::new(17);
    let mut bench = Bench::new(project, "leds");
    for _ in 0..30 {
        let settings = random(dice);
        let mut run = Run::start(bench, dice, settings);
        for _ in 0..run.clocks() {
            let (permit, permitted) = (!dice.once_in(3), !dice.once_in(3));
            run.bench.set("permit", permit);
            run.bench.set("permitted", permitted);
            run.tick();
            let shown = run.shown();
            assert_eq!(run.bench.is("enable"), shown.is_some() && permit && permitted);
            // The lines may follow a clock later, but never show light without permission.
            let expected = shown.filter(|_| permitted).map_or((0, 0), lines);
            assert_eq!((run.bench.get("rows"), run.bench.get("columns")), expected);
        }
        bench = run.bench;
    }
}

fn a_halt_darkens_the_lines_at_once(project: &Project) {
    let dice = &mut Dice::new(18);
    let mut bench = Bench::new(project, "leds");
    for _ in 0..40 {
        let settings = Settings { frames: 0, ..random(dice) };
        let mut run = Run::start(bench, dice, settings);
        for _ in 0..dice.range(0, 40) {
            run.tick();
        }
        run.bench.set("halt", true);
        run.tick();
        run.bench.set("halt", false);
        for _ in 0..10 {
            let lines = ["rows", "columns", "enable"].map(|port| run.bench.get(port));
            assert_eq!(lines, [0; 3]);
            run.tick();
        }
        bench = run.bench;
    }
}

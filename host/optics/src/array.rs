//! The LED array with the gateware's lines: 32 row lines, 32 column lines, one enable.
//!
//! A line carries a sign: 0 is +1, 1 is -1. The gate at LED (r, c) XORs its two lines, so the LED
//! is lit if the product of the signs is +1. Inverting all row lines shows the complement.
//!
//! # Invariant
//! Light comes from the *lines*, LED by LED, and never from a pattern number
//! (`lines_light_the_leds_of_the_walsh_pattern_they_stand_for` in `host/optics/tests/array.rs`). A
//! line that is stuck, swapped or inverted therefore shows in the light as with real hardware.

use crate::{Footprint, LEDS, Light, SIDE};
use foldhash::fast::FixedState;
use std::collections::HashMap;

/// The most line states, and changes of lines, kept. Four sweeps have 1024 patterns and their complements
/// in two orders, and with all lines inverted. Twice that number leaves room for an injected fault, and
/// limits the table for any other driver.
const MEMO_LIMIT: usize = 16 * LEDS;

/// LEDs along a side of a tile, which has a supply of its own.
const TILE: usize = 8;
const TILES: usize = SIDE / TILE;

/// The array in front of one scene. Computes the detected light of line states.
#[derive(Debug, Clone)]
pub struct LedArray {
    /// What the spot of each LED sees, as a share of white, row-major.
    seen: Vec<f32>,
    /// Electrons per ADC sample from an LED on a white target.
    electrons_per_led: f64,
    /// Electrons per ADC sample from a lit LED that have not seen the target.
    cover_electrons: f64,
    /// Electrons per ADC sample from each LED when lit, row-major.
    electrons: Vec<f32>,
    /// Light of each LED divided by that of an ideal LED; `None` if all LEDs are ideal.
    gains: Option<Vec<f32>>,
    /// Share of its light that a tile loses if all of its LEDs are lit.
    tile_sag: f64,
    /// Light of lit LEDs, and of LEDs that are switched, on which no supply sags.
    lit: Sums,
    switched: Sums,
    last: Option<(u64, f32)>,
    /// The lines of the clock before, and whether they were enabled.
    before: (u64, bool),
    steps: Steps,
    /// The light of `before`.
    held: Option<f32>,
}

/// Enabled lines that came after others, and their light.
#[derive(Debug, Clone, Copy)]
struct Step {
    before: u64,
    now: u64,
    light: Light,
}

/// The steps of a run in their order, because a run repeats them in this order.
#[derive(Debug, Clone, Default)]
struct Steps {
    list: Vec<Step>,
    /// Where the next step is expected.
    at: usize,
}

impl Steps {
    /// The light of this step, if it is the expected one or begins the list anew.
    #[inline]
    fn next(&mut self, before: u64, now: u64) -> Option<Light> {
        for at in [self.at, 0] {
            if let Some(step) = self.list.get(at).filter(|s| s.before == before && s.now == now) {
                self.at = at + 1;
                return Some(step.light);
            }
        }
        None
    }

    /// Adds a step that was not known, at the end. If another one was expected, the list is of another run.
    fn push(&mut self, step: Step) {
        if self.at < self.list.len() || self.list.len() >= MEMO_LIMIT {
            self.clear();
        }
        self.list.push(step);
        self.at = self.list.len();
    }

    fn clear(&mut self) {
        self.list.clear();
        self.at = 0;
    }
}

/// Light of line states, remembered.
#[derive(Debug, Clone, Default)]
struct Sums {
    /// Light of each row and each of its tiles for a row line of 0 and of 1, by the state of the column lines. A sweep has
    /// few such states.
    rows: HashMap<u32, RowSums, FixedState>,
    /// Bit r of the rows in the high half, bit c of the columns in the low half.
    memo: HashMap<u64, f32, FixedState>,
}

/// For each row, its light for a row line of 0 and of 1.
#[derive(Debug, Clone)]
struct RowSums {
    whole: [[f64; 2]; SIDE],
    /// By tile from left to right; only of a supply that sags.
    tiles: Option<Box<[[[f64; 2]; TILES]; SIDE]>>,
}

impl LedArray {
    /// The array in front of the scene of `footprint`. One LED on a white target gives
    /// `electrons_per_led` electrons per ADC sample ([`crate::Budget::electrons_per_led`]).
    #[must_use]
    pub fn new(footprint: &Footprint, electrons_per_led: f64) -> Self {
        let mut array = Self {
            seen: footprint.weights().to_vec(),
            electrons_per_led,
            cover_electrons: 0.0,
            electrons: Vec::new(),
            gains: None,
            tile_sag: 0.0,
            lit: Sums::default(),
            switched: Sums::default(),
            last: None,
            before: (0, false),
            steps: Steps::default(),
            held: None,
        };
        array.shine();
        array
    }

    /// The same array with real LEDs. `gains` is the light of each LED divided by that of an ideal
    /// LED, 32 x 32, row-major ([`crate::CameraModel::led_gains`]).
    #[must_use]
    pub fn with_gains(mut self, gains: &[f32]) -> Self {
        self.gains = gains.iter().any(|&gain| gain != 1.0).then(|| gains.to_vec());
        self.shine();
        self
    }

    /// The same array behind a cover glass, which throws back `electrons` electrons per ADC sample of each lit LED
    /// ([`crate::Budget::cover_electrons_per_led`]).
    #[must_use]
    pub fn with_cover(mut self, electrons: f64) -> Self {
        self.cover_electrons = electrons;
        self.shine();
        self
    }

    /// The same array with a supply for each tile of 8 x 8 LEDs that gives way: the LEDs of a tile lose the share `sag *
    /// lit / 64` of their light while `lit` of them are lit.
    #[must_use]
    pub fn with_tile_sag(mut self, sag: f64) -> Self {
        self.tile_sag = sag;
        self.forget();
        self
    }

    /// The same array after a change in front of it. `reflectance` is what each LED's spot now
    /// sees, 32 x 32, row-major.
    pub fn relight(&mut self, reflectance: &[f32], electrons_per_led: f64) {
        self.seen.clear();
        self.seen.extend_from_slice(reflectance);
        self.electrons_per_led = electrons_per_led;
        self.shine();
    }

    /// Computes the light of each LED anew.
    fn shine(&mut self) {
        let Self { electrons_per_led, cover_electrons, .. } = *self;
        let light = |&seen: &f32| (f64::from(seen) * electrons_per_led + cover_electrons) as f32;
        self.electrons.clear();
        self.electrons.extend(self.seen.iter().map(light));
        for (electrons, gain) in self.electrons.iter_mut().zip(self.gains.iter().flatten()) {
            *electrons *= gain;
        }
        self.forget();
    }

    fn forget(&mut self) {
        self.lit.clear();
        self.switched.clear();
        self.steps.clear();
        self.last = None;
        self.held = None;
    }

    /// Settled light in electrons per ADC sample. Bit r of `rows` and bit c of `cols` are the lines
    /// of LED (r, c). Without `enabled` no LED is lit.
    #[inline]
    pub fn light(&mut self, rows: u32, cols: u32, enabled: bool) -> f32 {
        let lines = u64::from(rows) << 32 | u64::from(cols);
        match self.last {
            _ if !enabled => 0.0,
            Some((held, light)) if held == lines => light,
            _ => self.changed(rows, cols),
        }
    }

    /// The light of one clock with these lines, with the light of the LEDs that were switched since the last call.
    #[inline]
    pub fn step(&mut self, rows: u32, cols: u32, enabled: bool) -> Light {
        let lines = u64::from(rows) << 32 | u64::from(cols);
        match self.held {
            Some(settled) if self.before == (lines, enabled) => settled.into(),
            _ => self.switch(rows, cols, enabled),
        }
    }

    /// The light of a clock in which lines or enable have changed, or the light of all lines.
    fn switch(&mut self, rows: u32, cols: u32, enabled: bool) -> Light {
        let now = u64::from(rows) << 32 | u64::from(cols);
        let (before, was_enabled) = std::mem::replace(&mut self.before, (now, enabled));
        let both = enabled && was_enabled;
        let known = if both { self.steps.next(before, now) } else { None };
        let light = known.unwrap_or_else(|| {
            let light = self.switched_light(before, was_enabled, now, enabled);
            if both {
                self.steps.push(Step { before, now, light });
            }
            light
        });
        self.held = Some(light.settled);
        light
    }

    fn switched_light(&mut self, before: u64, was_enabled: bool, now: u64, enabled: bool) -> Light {
        let [(rows, cols), (rows_before, cols_before)] =
            [now, before].map(|lines| ((lines >> 32) as u32, lines as u32));
        // The lines rise and fall whether or not the LEDs are enabled.
        let lines_risen = now.count_ones() as i8 - before.count_ones() as i8;
        let switched = match (was_enabled, enabled) {
            (false, false) => 0.0,
            (false, true) => self.switched.of(&self.electrons, rows, cols, 0.0),
            (true, false) => self.switched.of(&self.electrons, rows_before, cols_before, 0.0),
            // An LED has changed where exactly one of its lines has, which is again a pattern.
            (true, true) => {
                let (rows, cols) = (!(rows ^ rows_before), cols ^ cols_before);
                self.switched.of(&self.electrons, rows, cols, 0.0)
            }
        };
        Light { settled: self.light(rows, cols, enabled), switched, lines_risen }
    }

    /// The light of lines that have changed.
    fn changed(&mut self, rows: u32, cols: u32) -> f32 {
        let lines = u64::from(rows) << 32 | u64::from(cols);
        let light = self.lit.of(&self.electrons, rows, cols, self.tile_sag);
        self.last = Some((lines, light));
        light
    }
}

impl Sums {
    fn clear(&mut self) {
        self.rows.clear();
        self.memo.clear();
    }

    /// The light of these lines, enabled.
    fn of(&mut self, electrons: &[f32], rows: u32, cols: u32, tile_sag: f64) -> f32 {
        // An LED is lit where its two lines are equal, so inverted lines light the same LEDs.
        let (rows, cols) = if cols & 1 == 1 { (!rows, !cols) } else { (rows, cols) };
        let lines = u64::from(rows) << 32 | u64::from(cols);
        if self.memo.len() >= MEMO_LIMIT {
            self.clear();
        }
        let by_row = &mut self.rows;
        *self.memo.entry(lines).or_insert_with(|| {
            let sums = by_row.entry(cols).or_insert_with(|| row_sums(electrons, cols, tile_sag));
            let state = |row: usize| (rows >> row & 1) as usize;
            let lit = sums.whole.iter().enumerate().map(|(row, sum)| sum[state(row)]);
            let lit = lit.sum::<f64>();
            match &sums.tiles {
                None => lit as f32,
                Some(tiles) => {
                    let mut lost = 0.0;
                    for (row, sums) in tiles.iter().enumerate() {
                        for (tile, sum) in sums.iter().enumerate() {
                            lost += sum[state(row)] * lit_share(rows, cols, row / TILE, tile);
                        }
                    }
                    (lit - tile_sag * lost) as f32
                }
            }
        })
    }
}

/// Share of the LEDs of a tile that are lit.
fn lit_share(rows: u32, cols: u32, tile_row: usize, tile_column: usize) -> f64 {
    let ones = |lines: u32, tile: usize| f64::from((lines >> (TILE * tile) & 0xff).count_ones());
    let (rows, cols, side) = (ones(rows, tile_row), ones(cols, tile_column), TILE as f64);
    (rows * cols + (side - rows) * (side - cols)) / (side * side)
}

/// Light of each row if its line is 0, which lights the columns at 0, and if its line is 1.
fn row_sums(electrons: &[f32], cols: u32, tile_sag: f64) -> RowSums {
    let mut whole = [[0.0; 2]; SIDE];
    let mut tiles = (tile_sag != 0.0).then(|| Box::new([[[0.0; 2]; TILES]; SIDE]));
    for (row, leds) in electrons.chunks_exact(SIDE).enumerate() {
        for (column, &led) in leds.iter().enumerate() {
            let state = (cols >> column & 1) as usize;
            whole[row][state] += f64::from(led);
            if let Some(tiles) = &mut tiles {
                tiles[row][column / TILE][state] += f64::from(led);
            }
        }
    }
    RowSums { whole, tiles }
}

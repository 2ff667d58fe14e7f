//! The LED array with the gateware's lines: 32 row lines, 32 column lines, one enable.
//!
//! A line carries a sign: 0 is +1, 1 is -1. The gate at LED (r, c) XORs its two lines, so the LED
//! is lit if the product of the signs is +1. Inverting all row lines shows the complement.
//!
//! # Invariant
//! Light comes from the *lines*, LED by LED, and never from a pattern number
//! (`lines_light_the_leds_of_the_walsh_pattern_they_stand_for` in `host/optics/tests/array.rs`). A
//! line that is stuck, swapped or inverted therefore shows in the light as with real hardware.

use crate::{Footprint, LEDS, SIDE};
use foldhash::fast::FixedState;
use std::collections::HashMap;

/// The most line states kept. A sweep has 1024 patterns and their complements. Twice that number
/// leaves room for an injected fault, and limits the table for any other driver.
const MEMO_LIMIT: usize = 4 * LEDS;

/// The array in front of one scene. Computes the detected light of line states.
#[derive(Debug, Clone)]
pub struct LedArray {
    /// Electrons per ADC sample from each LED when lit, row-major.
    electrons: Vec<f32>,
    /// Light of each LED divided by that of an ideal LED; `None` if all LEDs are ideal.
    gains: Option<Vec<f32>>,
    /// Light of each row for a row line of 0 and of 1, by the state of the column lines. A sweep
    /// has few such states.
    rows: HashMap<u32, [[f64; 2]; SIDE], FixedState>,
    /// Bit r of the rows in the high half, bit c of the columns in the low half.
    memo: HashMap<u64, f32, FixedState>,
    last: Option<(u64, f32)>,
}

impl LedArray {
    /// The array in front of the scene of `footprint`. One LED on a white target gives
    /// `electrons_per_led` electrons per ADC sample ([`crate::Budget::electrons_per_led`]).
    #[must_use]
    pub fn new(footprint: &Footprint, electrons_per_led: f64) -> Self {
        let electrons =
            footprint.weights().iter().map(|&w| (f64::from(w) * electrons_per_led) as f32);
        Self {
            electrons: electrons.collect(),
            gains: None,
            rows: HashMap::default(),
            memo: HashMap::default(),
            last: None,
        }
    }

    /// The same array with real LEDs. `gains` is the light of each LED divided by that of an ideal
    /// LED, 32 x 32, row-major ([`crate::CameraModel::led_gains`]).
    #[must_use]
    pub fn with_gains(mut self, gains: &[f32]) -> Self {
        for (electrons, gain) in self.electrons.iter_mut().zip(gains) {
            *electrons *= gain;
        }
        self.gains = gains.iter().any(|&gain| gain != 1.0).then(|| gains.to_vec());
        self
    }

    /// The same array after a change in front of it. `reflectance` is what each LED's spot now
    /// sees, 32 x 32, row-major.
    pub fn relight(&mut self, reflectance: &[f32], electrons_per_led: f64) {
        for (electrons, &seen) in self.electrons.iter_mut().zip(reflectance) {
            *electrons = (f64::from(seen) * electrons_per_led) as f32;
        }
        for (electrons, gain) in self.electrons.iter_mut().zip(self.gains.iter().flatten()) {
            *electrons *= gain;
        }
        self.rows.clear();
        self.memo.clear();
        self.last = None;
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

    /// The light of lines that have changed.
    fn changed(&mut self, rows: u32, cols: u32) -> f32 {
        let lines = u64::from(rows) << 32 | u64::from(cols);
        if self.memo.len() >= MEMO_LIMIT {
            self.memo.clear();
            self.rows.clear();
        }
        let (electrons, by_row) = (&self.electrons, &mut self.rows);
        let light = *self.memo.entry(lines).or_insert_with(|| {
            let sums = by_row.entry(cols).or_insert_with(|| row_sums(electrons, cols));
            let lit = sums.iter().enumerate().map(|(row, sum)| sum[(rows >> row & 1) as usize]);
            lit.sum::<f64>() as f32
        });
        self.last = Some((lines, light));
        light
    }
}

/// Light of each row if its line is 0, which lights the columns at 0, and if its line is 1.
fn row_sums(electrons: &[f32], cols: u32) -> [[f64; 2]; SIDE] {
    let mut sums = [[0.0; 2]; SIDE];
    for (sum, leds) in sums.iter_mut().zip(electrons.chunks_exact(SIDE)) {
        for (column, &led) in leds.iter().enumerate() {
            sum[(cols >> column & 1) as usize] += f64::from(led);
        }
    }
    sums
}

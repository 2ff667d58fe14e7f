//! The LED array as the gateware drives it: 32 row lines, 32 column lines, one enable.
//!
//! A line carries a sign: 0 is +1, 1 is -1. The gate at LED (r, c) XORs its two lines, so the LED is
//! lit where the product of the signs is +1, and inverting all row lines shows the complement.
//!
//! Law: light comes from the *lines*, LED by LED, never from a pattern number. A line that is stuck,
//! swapped or inverted therefore shows in the light as it would on the bench.

use std::collections::HashMap;

use crate::{Footprint, LEDS, SIDE};

/// Line states remembered. A sweep has 1024 patterns and their complements; twice that leaves room
/// for a fault being injected, and a stranger driver cannot make the table grow for ever.
const MEMO_LIMIT: usize = 4 * LEDS;

/// The array in front of one scene: turns line states into detected light.
#[derive(Debug, Clone)]
pub struct LedArray {
    /// Electrons per ADC sample from each LED when lit, row-major.
    electrons: Vec<f32>,
    /// Bit r of the rows in the high half, bit c of the columns in the low half.
    memo: HashMap<u64, f32>,
    last: Option<(u64, f32)>,
}

impl LedArray {
    /// The array lighting the scene of `footprint`, where one LED on a white target gives
    /// `electrons_per_led` electrons per ADC sample ([`crate::Budget::electrons_per_led`]).
    pub fn new(footprint: &Footprint, electrons_per_led: f64) -> Self {
        let electrons =
            footprint.weights().iter().map(|&w| (f64::from(w) * electrons_per_led) as f32);
        Self { electrons: electrons.collect(), memo: HashMap::new(), last: None }
    }

    /// Settled light in electrons per ADC sample. Bit r of `rows` and bit c of `cols` are the lines
    /// of LED (r, c); nothing is lit unless `enabled`.
    pub fn light(&mut self, rows: u32, cols: u32, enabled: bool) -> f32 {
        if !enabled {
            return 0.0;
        }
        let lines = u64::from(rows) << 32 | u64::from(cols);
        if let Some((held, light)) = self.last
            && held == lines
        {
            return light;
        }
        if self.memo.len() >= MEMO_LIMIT {
            self.memo.clear();
        }
        let electrons = &self.electrons;
        let light = *self.memo.entry(lines).or_insert_with(|| sum_lit(electrons, rows, cols));
        self.last = Some((lines, light));
        light
    }
}

fn sum_lit(electrons: &[f32], rows: u32, cols: u32) -> f32 {
    let mut sum = 0.0_f64;
    for (row, leds) in electrons.chunks_exact(SIDE).enumerate() {
        for (column, &led) in leds.iter().enumerate() {
            if (rows >> row ^ cols >> column) & 1 == 0 {
                sum += f64::from(led);
            }
        }
    }
    sum as f32
}

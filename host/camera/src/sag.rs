//! The sag of the LEDs' supplies: measured from a raw burst, and taken back out of readings.
//!
//! # Model
//! Each tile of [`TILE`] x [`TILE`] LEDs has a supply of its own. While `n` of its 64 LEDs are lit, each of them loses the
//! share `sag * n / 64` of its light. A Hadamard pattern either lights a tile whole or not at all, or lights half of its
//! LEDs, in all tiles alike. Before any scene, the light of a pattern is therefore that of a stiff supply times `1 - sag`
//! for the 16 patterns of the first kind and times `1 - sag / 2` for all others, and so is that of its complement and
//! their difference.
//!
//! # Invariant
//! A camera with a supply that sags gives the image of one with a stiff supply
//! (`a_sag_that_was_measured_is_taken_back` in `host/virtual/tests/circuit.rs`).

use nirspi_recon::Rows;

/// LEDs along a side of a tile (`boards/electronics`).
pub const TILE: u32 = 8;

/// The largest sag that a calibration may have.
pub const LARGEST: f64 = 0.5;

/// A sag smaller than this many of its standard errors is not told from none.
const SIGNIFICANT: f64 = 3.0;

/// Whether a pattern lights each tile whole or not at all. The pattern of row `row` is -1 where `row & place` has an odd
/// number of bits, with the LED's row in the high half of `place` and its column in the low half.
fn lights_whole_tiles(row: u32, side: u32) -> bool {
    let within = TILE.min(side) - 1;
    row & ((within * side) | within) == 0
}

/// A row that lights half of each tile: every second column.
pub(crate) const HALF_OF_EACH_TILE: u32 = 1;

/// Takes a `sag` out of readings without dark level, or out of differences: one for each of `rows`.
pub fn correct(sag: f64, rows: &Rows, readings: &mut [f64]) {
    if sag == 0.0 {
        return;
    }
    let side = rows.side().pixels() as u32;
    for (reading, &row) in readings.iter_mut().zip(rows.iter()) {
        let lost = if lights_whole_tiles(row, side) { sag } else { sag / 2.0 };
        *reading /= 1.0 - lost;
    }
}

/// The sag from readings of the same time: for each of several bursts, the light of all LEDs, and the sum of the lights
/// of a pattern that lights half of each tile and of its complement. The second is larger by `sag / 2` of what a stiff
/// supply gives. A sag that is lost in the noise is 0.
pub(crate) fn of_levels(all: &[f64], halves: &[f64]) -> f64 {
    let count = all.len().min(halves.len()) as f64;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / count;
    let more: Vec<f64> = halves.iter().zip(all).map(|(halves, all)| halves - all).collect();
    let (light, more_light) = (mean(all), mean(&more));
    let variance = more.iter().map(|m| (m - more_light).powi(2)).sum::<f64>() / (count - 1.0);
    let error = (variance / count).sqrt();
    // NaN is not significant either.
    if light > 0.0 && more_light > SIGNIFICANT * error {
        // With L for the light of a stiff supply: light = L (1 - sag), more_light = L sag / 2.
        (2.0 * more_light / (light + 2.0 * more_light)).min(LARGEST)
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_recon::Side;
    use proptest::prelude::*;

    /// Light of the LEDs that row `row` lights, or its complement, before LEDs of these lights.
    fn light(leds: &[f64], row: u32, complement: bool, sag: f64) -> f64 {
        let is_lit = |at: usize| (row & at as u32).count_ones().is_multiple_of(2) != complement;
        let tile = |at: usize| (at / 32 / 8, at % 32 / 8);
        let mut lit = [[0; 4]; 4];
        for at in (0..1024).filter(|&at| is_lit(at)) {
            lit[tile(at).0][tile(at).1] += 1;
        }
        let of = |at: usize| leds[at] * (1.0 - sag * f64::from(lit[tile(at).0][tile(at).1]) / 64.0);
        (0..1024).filter(|&at| is_lit(at)).map(of).sum()
    }

    fn leds(seed: u64) -> Vec<f64> {
        (0..1024u64).map(|at| (at.wrapping_mul(seed | 1) >> 7) as f64 % 97.0 + 1.0).collect()
    }

    proptest! {
        #[test]
        fn readings_before_any_scene_are_those_of_a_stiff_supply(
            row in 0u32..1024, seed: u64, sag in 0.0..0.4, is_difference: bool,
        ) {
            let leds = leds(seed);
            let reading = |sag| {
                let complement = if is_difference { light(&leds, row, true, sag) } else { 0.0 };
                light(&leds, row, false, sag) - complement
            };
            let rows = Rows::new(Side::INSTRUMENT, [row]).unwrap();
            let mut readings = [reading(sag)];
            correct(sag, &rows, &mut readings);
            prop_assert!((readings[0] - reading(0.0)).abs() < 1e-6);
        }

        #[test]
        fn the_sag_is_found_before_any_scene(seed: u64, sag in 0.0..0.4) {
            let leds = leds(seed);
            let row = HALF_OF_EACH_TILE;
            let halves = light(&leds, row, false, sag) + light(&leds, row, true, sag);
            let found = of_levels(&[light(&leds, 0, false, sag); 3], &[halves; 3]);
            prop_assert!((found - sag).abs() < 1e-9, "{found} {sag}");
        }
    }

    #[test]
    fn a_sag_within_the_noise_is_none() {
        let noisy = [1004.0, 996.0, 1009.0, 993.0, 1005.0];
        assert_eq!(of_levels(&[1000.0; 5], &noisy), 0.0);
        assert_eq!(of_levels(&[-1000.0; 5], &noisy), 0.0);
        assert_eq!(of_levels(&[f64::NAN; 5], &noisy), 0.0);
        assert!(of_levels(&[1000.0; 5], &noisy.map(|level| level + 20.0)) > 0.03);
    }
}

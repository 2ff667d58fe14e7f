//! Measures the resolution of a camera by a slanted edge and bars, in millimetres on the target.
//!
//! A result is the width of the finest line, which is half a period, and never less than one pixel.
//! Detail beyond the sampling limit is not resolved reliably.

use std::f64::consts::PI;

/// Angle between the test edge and the columns, in degrees: 5, as in ISO 12233.
pub const EDGE_ANGLE_DEG: f64 = 5.0;

/// Width of the bins into which pixels are sorted by their distance from the edge, in pixels.
const BIN_PX: f64 = 0.25;

/// Reach of the edge's profile to either side, as a part of the picture's side.
const REACH: f64 = 13.0 / 32.0;

/// A slanted edge through the middle of `size` x `size` pixels, dark left, bright right,
/// anti-aliased; row-major.
#[must_use]
pub fn edge_scene(size: usize) -> Vec<f32> {
    (0..size * size)
        .map(|i| (from_edge(i % size, i / size, size) + 0.5).clamp(0.0, 1.0) as f32)
        .collect()
}

/// Vertical bars of `bar_px` pixels over `size` x `size` pixels. One bar begins in the centre, so
/// that bars of one pixel fit the grid. Row-major.
#[must_use]
pub fn bar_scene(size: usize, bar_px: f64) -> Vec<f32> {
    let middle = size as f64 / 2.0;
    let bright = |x: f64| (((x - middle) / bar_px).floor() as i64).rem_euclid(2) == 0;
    (0..size * size)
        .map(|i| {
            let lit = (0..8).filter(|k| bright((i % size) as f64 + (f64::from(*k) + 0.5) / 8.0));
            lit.count() as f32 / 8.0
        })
        .collect()
}

/// Signed distance of a pixel's centre from the edge, in pixels.
fn from_edge(x: usize, y: usize, size: usize) -> f64 {
    let middle = (size as f64 - 1.0) / 2.0;
    let (sin, cos) = EDGE_ANGLE_DEG.to_radians().sin_cos();
    (x as f64 - middle) * cos + (y as f64 - middle) * sin
}

/// Number of frequencies of a transfer: 0 to 0.5 cycles a pixel.
const FREQUENCIES: usize = 101;

/// Part of the profile at either end that gives the levels of dark and bright, as a part of the
/// picture's side.
const PLATEAU: f64 = 3.0 / 32.0;

/// The slope of an edge's profile as a function of frequency: its Fourier transform and the height
/// of the edge. Slopes of several pictures add, and the transfer of the sum is that of the mean.
#[derive(Debug, Clone, PartialEq)]
struct Slope {
    waves: Vec<(f64, f64)>,
    height: f64,
}

impl Slope {
    /// The slope of a picture of [`edge_scene`] of any brightness; `None` if a pixel is not finite.
    fn of(picture: &[f32], side: usize) -> Option<Self> {
        assert_eq!(picture.len(), side * side, "a square picture");
        let [reach_px, plateau_px] = [REACH, PLATEAU].map(|part| part * side as f64);
        let bins = (2.0 * reach_px / BIN_PX) as usize;
        let (mut sums, mut counts) = (vec![0.0; bins], vec![0_u32; bins]);
        for (i, &pixel) in picture.iter().enumerate() {
            let bin = (from_edge(i % side, i / side, side) + reach_px) / BIN_PX;
            if bin >= 0.0 && (bin as usize) < bins {
                sums[bin as usize] += f64::from(pixel);
                counts[bin as usize] += 1;
            }
        }
        let profile: Vec<(f64, f64)> = sums
            .iter()
            .zip(&counts)
            .enumerate()
            .filter(|(_, (_, count))| **count > 0)
            .map(|(i, (sum, &count))| {
                ((i as f64 + 0.5) * BIN_PX - reach_px, sum / f64::from(count))
            })
            .collect();
        let level = |inside: &dyn Fn(f64) -> bool| {
            let values: Vec<f64> =
                profile.iter().filter(|(at, _)| inside(*at)).map(|(_, value)| *value).collect();
            values.iter().sum::<f64>() / values.len() as f64
        };
        let bright = level(&|at| at > reach_px - plateau_px);
        let dark = level(&|at| at < plateau_px - reach_px);
        let steps: Vec<(f64, f64)> = profile
            .windows(2)
            .map(|pair| ((pair[0].0 + pair[1].0) / 2.0, pair[1].1 - pair[0].1))
            .collect();
        let waves = (0..FREQUENCIES).map(|k| {
            let frequency = at_frequency(k);
            let wave = |(re, im), &(at, step): &(f64, f64)| {
                let (sin, cos) = (2.0 * PI * frequency * at).sin_cos();
                (re + step * cos, im + step * sin)
            };
            let (re, im) = steps.iter().fold((0.0, 0.0), wave);
            // Binning averages over a bin, and so does the difference of two bins.
            let blurred = PI * frequency * BIN_PX;
            let own = if k == 0 { 1.0 } else { (blurred.sin() / blurred).powi(2) };
            (re / own, im / own)
        });
        let slope = Self { waves: waves.collect(), height: bright - dark };
        let finite = slope.height.is_finite()
            && slope.waves.iter().all(|(re, im)| re.is_finite() && im.is_finite());
        finite.then_some(slope)
    }
}

fn at_frequency(k: usize) -> f64 {
    0.5 * k as f64 / (FREQUENCIES - 1) as f64
}

/// Modulation transfer by spatial frequency in cycles per pixel, 0 to 0.5, from pictures of
/// [`edge_scene`] of any brightness with independent noise. The transfer is the Fourier transform
/// of the derivative of the edge's profile (ISO 12233), divided by the edge's height. Empty without
/// an edge.
///
/// Noise adds its own power to the transfer of every picture, and would raise a small transfer.
/// With several pictures the power of the noise is excluded: the mean product of the transforms of
/// two *different* pictures does not contain it.
///
/// # Panics
/// If a picture does not hold `side * side` pixels.
#[must_use]
pub fn edge_mtf(pictures: &[&[f32]], side: usize) -> Vec<(f64, f64)> {
    let slopes: Option<Vec<Slope>> = pictures.iter().map(|p| Slope::of(p, side)).collect();
    let Some(slopes) = slopes.filter(|slopes| !slopes.is_empty()) else { return Vec::new() };
    let n = slopes.len() as f64;
    let height = slopes.iter().map(|slope| slope.height).sum::<f64>() / n;
    if height == 0.0 {
        return Vec::new();
    }
    (0..FREQUENCIES)
        .map(|k| {
            let waves = || slopes.iter().map(|slope| slope.waves[k]);
            let (re, im) = waves().fold((0.0, 0.0), |(re, im), w| (re + w.0, im + w.1));
            let together = re * re + im * im;
            let own: f64 = waves().map(|(re, im)| re * re + im * im).sum();
            let power =
                if slopes.len() > 1 { (together - own) / (n * (n - 1.0)) } else { together };
            (at_frequency(k), power.max(0.0).sqrt() / height.abs())
        })
        .collect()
}

/// Transfer of a disc of light of this diameter at a frequency (in cycles per unit of the
/// diameter): `2 J1(x) / x` with x = pi times diameter times frequency.
#[must_use]
pub fn disc_transfer(diameter: f64, frequency: f64) -> f64 {
    // The mean over the disc's chords. Equal steps of the angle converge faster than any power.
    const STEPS: usize = 256;
    let angle = |k: usize| (k as f64 + 0.5) * PI / 2.0 / STEPS as f64;
    let chord = |k: usize| {
        let (sin, cos) = angle(k).sin_cos();
        cos * cos * (PI * diameter * frequency * sin).cos()
    };
    (0..STEPS).map(chord).sum::<f64>() * 2.0 / STEPS as f64
}

/// Transfer of a square of light across an edge that is tilted by [`EDGE_ANGLE_DEG`] against its
/// sides.
#[must_use]
pub fn square_transfer(width: f64, frequency: f64) -> f64 {
    let (sin, cos) = EDGE_ANGLE_DEG.to_radians().sin_cos();
    let sinc = |x: f64| if x == 0.0 { 1.0 } else { (PI * x).sin() / (PI * x) };
    sinc(width * cos * frequency) * sinc(width * sin * frequency)
}

/// Width of a line in pixels at the first frequency where the transfer falls to `level`; 1 if the
/// transfer stays above `level` up to the sampling limit, `None` without a transfer.
#[must_use]
pub fn line_width_px(mtf: &[(f64, f64)], level: f64) -> Option<f64> {
    mtf.first()?;
    let crossing = mtf.windows(2).find(|pair| pair[1].1 < level);
    Some(crossing.map_or(1.0, |pair| {
        let [(f0, m0), (f1, m1)] = [pair[0], pair[1]];
        let part = if m0 > m1 { ((m0 - level) / (m0 - m1)).clamp(0.0, 1.0) } else { 1.0 };
        (0.5 / (f0 + (f1 - f0) * part)).max(1.0)
    }))
}

/// The share of the bars' contrast that a picture of [`bar_scene`] keeps: the amplitude of their
/// period divided by the mean, compared with that of the `truth`. Negative if dark and bright have
/// changed places.
///
/// # Panics
/// If the pictures do not hold `side * side` pixels.
#[must_use]
pub fn bar_transfer(picture: &[f32], truth: &[f32], side: usize, bar_px: f64) -> f64 {
    assert!(picture.len() == side * side && truth.len() == side * side, "square pictures");
    let middle = (side as f64 - 1.0) / 2.0;
    let contrast = |values: &[f32]| {
        let (mut amplitude, mut sum) = (0.0, 0.0);
        let (mut weight, mut sines) = (0.0, 0.0);
        let n = values.len() as f64;
        for (i, &value) in values.iter().enumerate() {
            let sine = (PI * ((i % side) as f64 - middle) / bar_px).sin();
            amplitude += f64::from(value) * sine;
            sum += f64::from(value);
            weight += sine * sine;
            sines += sine;
        }
        // The mean correlates with a sine whose number of periods is not whole.
        (amplitude - sum / n * sines) / (weight - sines * sines / n) / (sum / n)
    };
    contrast(picture) / contrast(truth)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The edge seen by pixels with a width of `width` pixels.
    fn blurred_edge(side: usize, width: usize) -> Vec<f32> {
        let fine = edge_scene(side * 8);
        let half = (width * 8 / 2) as i64;
        let at = |x: i64, y: usize| fine[y * side * 8 + x.clamp(0, side as i64 * 8 - 1) as usize];
        (0..side * side)
            .map(|i| {
                let (x, y) = ((i % side) as i64 * 8 + 4, i / side * 8 + 4);
                let row = (x - half..x + half).map(|x| at(x, y));
                row.sum::<f32>() / (2 * half) as f32
            })
            .collect()
    }

    #[test]
    fn a_box_of_light_has_the_transfer_of_a_sinc() {
        for width in [2, 4, 6] {
            let mtf = edge_mtf(&[&blurred_edge(32, width)], 32);
            // sinc falls to a half at 0.6034 divided by the width, a line of 0.829 widths; to 0.1
            // at 0.9125, a line of 0.548 widths.
            let found = line_width_px(&mtf, 0.5).unwrap();
            assert!((found / (0.829 * width as f64) - 1.0).abs() < 0.05, "{width}: {found}");
            let found = line_width_px(&mtf, 0.1).unwrap();
            assert!(
                (found / (0.548 * width as f64).max(1.0) - 1.0).abs() < 0.08,
                "{width}: {found}"
            );
        }
    }

    #[test]
    fn a_sharp_edge_is_resolved_to_the_pixel_and_no_finer() {
        let mtf = edge_mtf(&[&edge_scene(32)], 32);
        assert_eq!(line_width_px(&mtf, 0.5), Some(1.0));
        assert_eq!(line_width_px(&edge_mtf(&[&[0.5; 1024]], 32), 0.5), None);
    }

    /// Nearly normal numbers of variance 1: each is the sum of twelve uniform numbers (splitmix64).
    fn normal(state: &mut u64) -> f32 {
        let mut uniform = || {
            *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mixed = (*state ^ (*state >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            ((mixed ^ (mixed >> 31)) >> 40) as f32 / (1 << 24) as f32
        };
        (0..12).map(|_| uniform()).sum::<f32>() - 6.0
    }

    #[test]
    fn discs_and_squares_have_the_transfers_of_the_books() {
        // 2 J1(x) / x is 0.8801 at x = 1 and 0 at 3.8317; a sinc is 0.6366 at half of its first
        // zero.
        assert!((disc_transfer(1.0, 1.0 / PI) - 0.880_101).abs() < 1e-6);
        assert!(disc_transfer(2.0, 3.831_706 / PI / 2.0).abs() < 1e-6);
        let along = EDGE_ANGLE_DEG.to_radians().cos();
        assert!((square_transfer(1.0 / along, 0.5) - 2.0 / PI).abs() < 2.5e-3);
        assert!((disc_transfer(3.0, 0.0) - 1.0).abs() < 1e-12);
        assert_eq!(square_transfer(3.0, 0.0), 1.0);
    }

    #[test]
    fn noise_does_not_make_the_transfer_look_better_however_few_the_pictures() {
        // White noise with half of the edge's height.
        let clean = blurred_edge(32, 4);
        let truth = line_width_px(&edge_mtf(&[&clean], 32), 0.1).unwrap();
        for count in [40, 400] {
            let mut state = 1_u64;
            let pictures: Vec<Vec<f32>> = (0..count)
                .map(|_| clean.iter().map(|pixel| pixel + 0.5 * normal(&mut state)).collect())
                .collect();
            let pictures: Vec<&[f32]> = pictures.iter().map(Vec::as_slice).collect();
            let found = line_width_px(&edge_mtf(&pictures, 32), 0.1).unwrap();
            let tolerance = 0.05 * (400.0 / f64::from(count)).sqrt();
            assert!((found / truth - 1.0).abs() < tolerance, "{count}: {found} for {truth}");
        }
    }

    #[test]
    fn bars_keep_their_contrast_unless_blurred() {
        for bar_px in [1.0, 1.5, 2.0, 3.0] {
            let truth = bar_scene(32, bar_px);
            assert!((bar_transfer(&truth, &truth, 32, bar_px) - 1.0).abs() < 1e-12, "{bar_px}");
        }
        let truth = bar_scene(32, 4.0);
        assert!((bar_transfer(&truth, &truth, 32, 4.0) - 1.0).abs() < 1e-12);
        let brighter: Vec<f32> = truth.iter().map(|v| v * 700.0).collect();
        assert!((bar_transfer(&brighter, &truth, 32, 4.0) - 1.0).abs() < 1e-6);
        let half: Vec<f32> = truth.iter().map(|v| v * 0.5 + 0.25).collect();
        assert!((bar_transfer(&half, &truth, 32, 4.0) - 0.5).abs() < 1e-3);
        let negative: Vec<f32> = truth.iter().map(|v| 1.0 - v).collect();
        assert!(bar_transfer(&negative, &truth, 32, 4.0) < -0.9);
    }
}

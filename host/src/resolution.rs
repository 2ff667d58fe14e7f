//! How fine a camera sees: slanted edge and bars, in millimetres on the target.
//!
//! The law: a result is the width of the finest line, half a period, and never finer than one pixel: what lies beyond
//! the sampling limit is not resolution but luck.

use std::f64::consts::PI;

/// Angle of the test edge off the columns, in degrees: 5, as ISO 12233 has it.
pub const EDGE_ANGLE_DEG: f64 = 5.0;

/// Width of the bins that pixels are sorted into by their distance from the edge, in pixels.
const BIN_PX: f64 = 0.25;

/// Reach of the edge's profile to either side, in pixels.
const REACH_PX: f64 = 13.0;

/// A slanted edge through the middle of `size` x `size` pixels, dark left, bright right, anti-aliased; row-major.
#[must_use]
pub fn edge_scene(size: usize) -> Vec<f32> {
    (0..size * size)
        .map(|i| (from_edge(i % size, i / size, size) + 0.5).clamp(0.0, 1.0) as f32)
        .collect()
}

/// Vertical bars of `bar_px` pixels over `size` x `size` pixels, one beginning in the centre, so that bars of one
/// pixel fit the grid; row-major.
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

/// Modulation transfer by spatial frequency in cycles per pixel, 0 to 0.5, from a picture of [`edge_scene`] of any
/// brightness: the edge's profile, differentiated, Fourier transformed (ISO 12233), and made 1 at 0. Empty if there
/// is no edge.
///
/// # Panics
/// If the picture does not hold `side * side` pixels.
#[must_use]
pub fn edge_mtf(picture: &[f32], side: usize) -> Vec<(f64, f64)> {
    assert_eq!(picture.len(), side * side, "a square picture");
    let bins = (2.0 * REACH_PX / BIN_PX) as usize;
    let (mut sums, mut counts) = (vec![0.0; bins], vec![0_u32; bins]);
    for (i, &pixel) in picture.iter().enumerate() {
        let bin = (from_edge(i % side, i / side, side) + REACH_PX) / BIN_PX;
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
        .map(|(i, (sum, &count))| ((i as f64 + 0.5) * BIN_PX, sum / f64::from(count)))
        .collect();
    let spread: Vec<(f64, f64)> = profile
        .windows(2)
        .map(|pair| ((pair[0].0 + pair[1].0) / 2.0, pair[1].1 - pair[0].1))
        .collect();
    let total: f64 = spread.iter().map(|(_, step)| step).sum();
    if total == 0.0 || !total.is_finite() {
        return Vec::new();
    }
    (0..=100)
        .map(|k| {
            let frequency = f64::from(k) / 200.0;
            let (mut re, mut im) = (0.0, 0.0);
            for &(at, step) in &spread {
                let (sin, cos) = (2.0 * PI * frequency * at).sin_cos();
                re += step * cos;
                im += step * sin;
            }
            // Binning averages over a bin; the difference of two bins over another.
            let blurred = PI * frequency * BIN_PX;
            let own = if k == 0 { 1.0 } else { (blurred.sin() / blurred).powi(2) };
            (frequency, re.hypot(im) / total.abs() / own)
        })
        .collect()
}

/// Width of a line at the first frequency where the transfer falls to `level`, in pixels; 1 if it never does below
/// the sampling limit, none without a curve.
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

/// How much of the bars' contrast a picture of [`bar_scene`] keeps: the amplitude of their period over the mean,
/// against that of the `truth`. Negative where dark and bright have changed places.
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
        // What the mean has in common with a sine that does not fit a whole number of times.
        (amplitude - sum / n * sines) / (weight - sines * sines / n) / (sum / n)
    };
    contrast(picture) / contrast(truth)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The edge seen through pixels as wide as a box of `width` pixels.
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
            let mtf = edge_mtf(&blurred_edge(32, width), 32);
            // sinc falls to a half at 0.6034 over the width: a line of 0.829 widths; to 0.1 at 0.9125: 0.548.
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
        let mtf = edge_mtf(&edge_scene(32), 32);
        assert_eq!(line_width_px(&mtf, 0.5), Some(1.0));
        assert_eq!(line_width_px(&edge_mtf(&[0.5; 1024], 32), 0.5), None);
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

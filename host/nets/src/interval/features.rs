//! What is known about a pixel of an enhanced image without its truth.

use super::{Readings, Seen};
use crate::grid::{AREA, FINE as SIDE};

/// Number of features of a pixel.
pub(super) const FEATURES: usize = 14;
/// Number of terms of the polynomial of second degree in the features.
pub(super) const TERMS: usize = 1 + FEATURES + FEATURES * (FEATURES + 1) / 2;
/// How busy an image is: how much neighbouring pixels differ.
pub(super) const BUSYNESS: usize = 8;
/// The contrast of an image.
pub(super) const CONTRAST: usize = 10;

/// The names of the features, for the record.
pub(super) const NAMES: [&str; FEATURES] = [
    "range of 3 x 3 pixels",
    "range of 7 x 7 pixels",
    "change by deblurring, mean of 3 x 3 pixels",
    "distance from black or white",
    "noise of the readings",
    "estimated blur",
    "greyness of the image",
    "inconsistency",
    "busyness: mean over the image of the first feature",
    "mean over the image of the third feature",
    "contrast of the image",
    "mean range of 3 x 3 pixels before deblurring",
    "share of the patterns",
    "estimated noise",
];

/// The features of each pixel of an image.
pub(super) fn features(seen: &Seen<'_>, readings: &Readings<'_>) -> Vec<[f32; FEATURES]> {
    let Seen { image, fused, estimate, inconsistency } = *seen;
    let range = |image, radius| {
        let (most, least) = (window(image, radius, f32::max), window(image, radius, f32::min));
        most.into_iter().zip(least).map(|(most, least)| most - least).collect::<Vec<f32>>()
    };
    let logs = |values: &[f32], least: f32| -> Vec<f32> {
        values.iter().map(|value| (value + least).ln()).collect()
    };
    let near = logs(&range(image, 1), 0.01);
    let far = logs(&range(image, 3), 0.02);
    let changed: Vec<f32> = image.iter().zip(fused).map(|(a, b)| (a - b).abs() / 9.0).collect();
    let changed = logs(&window(&changed, 1, |a, b| a + b), 0.005);
    let of_image = [
        (readings.noise.max(0.0) + 0.004).ln(),
        estimate.sigma_px.clamp(0.0, 5.0),
        (mean(image.iter().map(|v| 4.0 * v * (1.0 - v))) + 0.02).ln(),
        inconsistency.clamp(0.3, 3.0).ln(),
        mean(near.iter().copied()),
        mean(changed.iter().copied()),
        (deviation(image) + 0.01).ln(),
        (mean(range(fused, 1).into_iter()) + 0.002).ln(),
        readings.share.max(0.01).ln(),
        (estimate.noise.max(0.0) + 0.004).ln(),
    ];
    (0..AREA)
        .map(|at| {
            let edge = image[at].min(1.0 - image[at]).max(0.0);
            let own = [near[at], far[at], changed[at], (edge + 0.01).ln()];
            let mut all = [0.0; FEATURES];
            all[..own.len()].copy_from_slice(&own);
            all[own.len()..].copy_from_slice(&of_image);
            all
        })
        .collect()
}

/// The mean over an image.
fn mean(values: impl Iterator<Item = f32>) -> f32 {
    values.sum::<f32>() / AREA as f32
}

fn deviation(image: &[f32]) -> f32 {
    let middle = mean(image.iter().copied());
    mean(image.iter().map(|value| (value - middle).powi(2))).sqrt()
}

/// All products of at most two features.
pub(super) fn terms(features: &[f32; FEATURES]) -> [f32; TERMS] {
    let mut terms = [1.0; TERMS];
    terms[1..=FEATURES].copy_from_slice(features);
    let mut at = 1 + FEATURES;
    for (i, a) in features.iter().enumerate() {
        for b in &features[i..] {
            terms[at] = a * b;
            at += 1;
        }
    }
    terms
}

/// `join` over the square of `2 radius + 1` pixels around each pixel; beyond the edge, the image is
/// mirrored at its last pixel.
fn window(image: &[f32], radius: usize, join: impl Fn(f32, f32) -> f32) -> Vec<f32> {
    let mirrored = |at: usize, step: usize| {
        let place = (at + step).abs_diff(radius);
        if place < SIDE { place } else { 2 * (SIDE - 1) - place }
    };
    let along = |at: usize, value: &dyn Fn(usize) -> f32| {
        let rest = (1..=2 * radius).map(|step| value(mirrored(at, step)));
        rest.fold(value(mirrored(at, 0)), &join)
    };
    let rows: Vec<f32> =
        (0..AREA).map(|at| along(at % SIDE, &|column| image[at / SIDE * SIDE + column])).collect();
    (0..AREA).map(|at| along(at / SIDE, &|row| rows[row * SIDE + at % SIDE])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_joins_its_square_and_mirrors_the_edge() {
        let mut dot = vec![0.0; AREA];
        dot[10 * SIDE + 20] = 1.0;
        let sums = window(&dot, 1, |a, b| a + b);
        let lit: Vec<usize> = (0..AREA).filter(|&at| sums[at] > 0.0).collect();
        let expected: Vec<usize> =
            (9..12).flat_map(|row| (19..22).map(move |column| row * SIDE + column)).collect();
        assert_eq!(lit, expected);
        // The pixel beside the corner is seen from the corner twice in each direction.
        let mut near = vec![0.0; AREA];
        near[SIDE + 1] = 1.0;
        assert_eq!(window(&near, 1, |a, b| a + b)[0], 4.0);
        let column = |at: usize| (at % SIDE) as f32;
        let ramp: Vec<f32> = (0..AREA).map(column).collect();
        let most = window(&ramp, 3, f32::max);
        assert_eq!((most[0], most[30], most[SIDE - 1]), (3.0, 33.0, 63.0));
    }

    #[test]
    fn the_terms_are_one_and_every_product_once() {
        // Primes: every product is another number.
        let features =
            [2.0, 3.0, 5.0, 7.0, 11.0, 13.0, 17.0, 19.0, 23.0, 29.0, 31.0, 37.0, 41.0, 43.0];
        let mut found = terms(&features).to_vec();
        found.sort_by(f32::total_cmp);
        found.dedup();
        assert_eq!(found.len(), TERMS, "{found:?}");
        assert!(found.contains(&1.0) && found.contains(&361.0) && found.contains(&6.0));
    }
}

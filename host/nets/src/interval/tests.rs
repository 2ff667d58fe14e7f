//! Tests of the table on drawn images, and of the shipped calibration.

use super::*;
use crate::device::Device;
use crate::random::Noise;
use crate::{Enhancer, Images, Options};

/// An image of a bar whose error is known: noise of strength `error` at the bar's edges, and a tenth
/// of that elsewhere.
struct Drawn {
    image: Vec<f32>,
    fused: Vec<f32>,
    truth: Vec<f32>,
    estimate: Estimate,
}

impl Drawn {
    fn new(number: usize) -> Self {
        let mut noise = Noise::of(7, number);
        let width = 4 + number % 9;
        let truth: Vec<f32> =
            (0..AREA).map(|at| if (at % 64).abs_diff(32) < width { 0.8 } else { 0.1 }).collect();
        let error = 0.02 + 0.01 * (number % 5) as f32;
        let image = (0..AREA).map(|at| {
            let edge = (at % 64).abs_diff(32).abs_diff(width) < 2;
            (truth[at] + noise.draw() * if edge { error } else { error / 10.0 }).clamp(0.0, 1.0)
        });
        let image: Vec<f32> = image.collect();
        let fused = image.iter().map(|v| 0.5 * v + 0.2).collect();
        let estimate = Estimate { sigma_px: 1.0 + error, noise: error };
        Self { image, fused, truth, estimate }
    }

    /// Readings of low noise, of all patterns or of half of them in turn.
    fn readings(&self) -> Readings<'static> {
        let share = if self.estimate.sigma_px > 1.04 { 0.5 } else { 1.0 };
        Readings { method: "tikhonov", share, noise: 0.02 }
    }

    fn seen(&self) -> Seen<'_> {
        let Self { image, fused, estimate, .. } = self;
        Seen { image, fused, estimate: *estimate, inconsistency: 1.0 }
    }

    fn sample(&self) -> Sample<'_> {
        Sample {
            seen: self.seen(),
            readings: self.readings(),
            truth: &self.truth,
            weight: 1.0,
            kind: 0,
        }
    }

    /// Number of pixels whose truth is within the half-width.
    fn within(&self, table: &Table, level: usize) -> usize {
        let widths = table.half_widths(&self.seen(), &self.readings(), level);
        let errors = self.image.iter().zip(&self.truth).map(|(a, b)| (a - b).abs());
        errors.zip(widths).filter(|(error, width)| error <= width).count()
    }
}

fn drawn(numbers: std::ops::Range<usize>) -> Vec<Drawn> {
    numbers.map(Drawn::new).collect()
}

fn learnt(images: &[Drawn]) -> Table {
    let samples: Vec<Sample<'_>> = images.iter().map(Drawn::sample).collect();
    Table::learn(&samples, 8, 2).unwrap()
}

/// The share of all pixels of these images within the half-width of a level.
fn coverage(table: &Table, images: &[Drawn], level: usize) -> f64 {
    let within: usize = images.iter().map(|image| image.within(table, level)).sum();
    within as f64 / (images.len() * AREA) as f64
}

#[test]
fn the_share_of_the_level_lies_within_also_in_images_that_were_not_learnt() {
    let (learn, others) = (drawn(0..40), drawn(100..140));
    let table = learnt(&learn);
    for (images, apart) in [(&learn, 0.01), (&others, 0.025)] {
        let found = coverage(&table, images, LEVEL);
        assert!(found > LEVELS[LEVEL] - apart && found < LEVELS[LEVEL] + 0.03, "{found}");
    }
    let shares: Vec<f64> = (0..LEVELS.len()).map(|l| coverage(&table, &others, l)).collect();
    assert!(shares.is_sorted() && shares[0] < 0.8, "{shares:?}");
    let widths = table.half_widths(&others[0].seen(), &others[0].readings(), LEVEL);
    let edge = others[0].truth.iter().position(|&v| v == 0.8).unwrap();
    assert!(widths[edge] > 3.0 * widths[0], "{} at the edge, {} far away", widths[edge], widths[0]);
}

#[test]
fn a_higher_level_is_never_narrower() {
    let images = drawn(0..20);
    let table = learnt(&images);
    let of = |level| table.half_widths(&images[3].seen(), &images[3].readings(), level);
    let all: Vec<Vec<f32>> = (0..LEVELS.len()).map(of).collect();
    assert!(all.windows(2).all(|pair| pair[0].iter().zip(&pair[1]).all(|(a, b)| a <= b)));
}

#[test]
fn no_half_width_is_below_what_a_bench_can_hold() {
    // The calibration images are perfect, and a bench is not.
    let mut images = drawn(0..20);
    for image in &mut images {
        image.image.clone_from(&image.truth);
    }
    let table = learnt(&images);
    for image in &images {
        let widths = table.half_widths(&image.seen(), &image.readings(), LEVEL);
        assert!(widths.iter().all(|width| *width >= FLOOR));
    }
    let intervals = Intervals::shipped().unwrap();
    let readings = Readings { method: "tikhonov", share: 1.0, noise: 0.0 };
    let black = vec![0.0; AREA];
    let estimate = Estimate { sigma_px: 0.3, noise: 0.0 };
    let seen = Seen { image: &black, fused: &black, estimate, inconsistency: 0.3 };
    let widths = intervals.half_widths(&seen, &readings).unwrap();
    assert!(widths.iter().all(|width| *width >= FLOOR), "{}", widths[0]);
}

#[test]
fn edges_are_the_largest_steps_and_a_flat_image_has_none() {
    let bar = Drawn::new(0).truth;
    let found = edges(&bar);
    let columns: std::collections::BTreeSet<usize> =
        (0..AREA).filter(|&at| found[at]).map(|at| at % 64).collect();
    assert_eq!(columns.into_iter().collect::<Vec<_>>(), [28, 35]);
    assert!(!edges(&vec![0.4; AREA]).contains(&true));
}

#[test]
fn too_few_images_give_no_table() {
    let images = drawn(0..19);
    let samples: Vec<Sample<'_>> = images.iter().map(Drawn::sample).collect();
    let error = Table::learn(&samples, 8, 2).unwrap_err();
    assert_eq!(error.to_string(), "19 images for calibration, expected at least 20");
}

#[test]
fn a_table_with_a_list_of_another_length_is_refused() {
    let shipped: serde_json::Value = serde_json::from_str(nirspi_weights::INTERVALS).unwrap();
    for list in ["scale_bounds", "texture_bounds", "polynomial", "levels", "factors", "cells"] {
        let mut other = shipped.clone();
        other["methods"]["omp"][list].as_array_mut().unwrap().pop();
        let error = Intervals::parse(&other.to_string()).unwrap_err();
        assert!(matches!(error, NoIntervals::Table(TableError::Form)), "{list}: {error}");
    }
    let mut other = shipped;
    other["characters"]["presence"]["output"].as_array_mut().unwrap().pop();
    assert!(Intervals::parse(&other.to_string()).is_err());
    let error = Intervals::parse("{}").unwrap_err().to_string();
    assert!(error.starts_with("the calibration of the intervals cannot be read: "), "{error}");
}

#[test]
fn other_weights_get_no_interval_and_one_line_says_so() {
    let mut networks = Networks::built_in(Device::cpu());
    let options = Options::default();
    let intervals = networks.intervals(Method::default(), &options).unwrap();
    let mut other = Weights::embedded("diffusion").unwrap();
    intervals.expect("diffusion", &other).unwrap();
    let name = other.names().next().unwrap().to_owned();
    let mut array = other.get(&name).unwrap().clone();
    array.values[0] += 1e-3;
    other.insert(name, array);
    let error = intervals.expect("diffusion", &other).unwrap_err().to_string();
    assert!(error.starts_with("no intervals: the weights of diffusion are not those"), "{error}");
    assert_eq!(error.lines().count(), 1);
    let steps = Method::new(Method::default().model(), std::num::NonZeroU32::new(4)).unwrap();
    let error = networks.intervals(steps, &options).unwrap_err();
    assert_eq!(
        error.to_string(),
        "no intervals: they are calibrated for diffusion in 1 step, not for diffusion in 4 steps"
    );
    let free = Options { consistency: false, ..options };
    let error = networks.intervals(Method::default(), &free).unwrap_err().to_string();
    assert!(error.ends_with("not for a result that is not held against the readings"), "{error}");
}

#[test]
fn other_readings_get_no_interval_and_one_line_says_why() {
    let intervals = Intervals::shipped().unwrap();
    let known = Readings { method: "prior", share: 0.5, noise: 0.03 };
    intervals.table(&known).unwrap();
    for (readings, expected) in [
        (Readings { method: "mine", ..known }, "not by mine"),
        (Readings { share: 0.05, ..known }, "10 to 100 % of the patterns, not for 5.0 %"),
        (Readings { share: f32::NAN, ..known }, "of the patterns, not for NaN %"),
        (Readings { noise: 0.3, ..known }, "up to 20 % of white, not for 30.0 %"),
        (Readings { noise: f32::NAN, ..known }, "of white, not for NaN %"),
    ] {
        let error = intervals.table(&readings).unwrap_err().to_string();
        assert!(error.starts_with("no intervals: they are calibrated for"), "{error}");
        assert!(error.ends_with(expected) && error.lines().count() == 1, "{error}");
    }
    for method in ["hadamard", "omp", "tikhonov", "fista", "tv", "prior"] {
        intervals.table(&Readings { method, ..known }).unwrap();
    }
}

#[test]
fn the_shipped_intervals_belong_to_the_shipped_networks_that_of_the_reconstruction_among_them() {
    let intervals = Intervals::shipped().unwrap();
    for network in NETWORKS.into_iter().chain(["prior", "classifier"]) {
        intervals.expect(network, &Weights::embedded(network).unwrap()).unwrap();
    }
}

#[test]
fn the_shipped_intervals_are_wide_at_the_edges_of_a_blurred_bar() {
    let reading: Vec<f32> =
        (0..1024).map(|at| 0.8 * (-((at % 32) as f32 - 15.5).powi(2) / 8.0).exp()).collect();
    let enhancer = Enhancer::built_in(&Device::cpu()).unwrap();
    let images = Images::new(&reading).unwrap();
    let made = enhancer.enhance(images, None, &Options::default(), &mut |_| {}).unwrap();
    let readings = Readings { method: "hadamard", share: 1.0, noise: 0.01 };
    let widths = Intervals::shipped().unwrap().of(&made, &readings).unwrap();
    assert_eq!(widths.len(), AREA);
    let row = &widths[32 * 64..33 * 64];
    let (bar, ground) = (row[16..48].iter().copied().fold(0.0, f32::max), row[2]);
    assert!(bar > 5.0 * ground && bar < 1.0, "{bar} at the bar, {ground} beside it");
    assert!(share_of_prior(&widths) < 0.2);
    assert_eq!(share_of_prior(&[0.1, PRIORS_HALF_WIDTH, 0.6, 0.2]), 0.5);
}

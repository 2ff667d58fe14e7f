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

    fn seen(&self) -> Seen<'_> {
        let Self { image, fused, estimate, .. } = self;
        Seen { image, fused, estimate: *estimate, inconsistency: 1.0 }
    }

    fn sample(&self) -> Sample<'_> {
        Sample { seen: self.seen(), truth: &self.truth, weight: 1.0 }
    }

    /// Number of pixels whose truth is within the half-width.
    fn within(&self, table: &Table, level: usize) -> usize {
        let widths = table.half_widths(&self.seen(), level);
        let errors = self.image.iter().zip(&self.truth).map(|(a, b)| (a - b).abs());
        errors.zip(widths).filter(|(error, width)| error <= width).count()
    }
}

fn drawn(numbers: std::ops::Range<usize>) -> Vec<Drawn> {
    numbers.map(Drawn::new).collect()
}

fn learnt(images: &[Drawn]) -> Table {
    let samples: Vec<Sample<'_>> = images.iter().map(Drawn::sample).collect();
    Table::learn(&samples, 8, 2, 2).unwrap()
}

/// The share of all pixels of these images within the half-width of a level.
fn coverage(table: &Table, images: &[Drawn], level: usize) -> f64 {
    let within: usize = images.iter().map(|image| image.within(table, level)).sum();
    within as f64 / (images.len() * AREA) as f64
}

#[test]
fn the_share_of_each_level_lies_within_also_in_images_that_were_not_learnt() {
    let (learn, others) = (drawn(0..40), drawn(100..140));
    let table = learnt(&learn);
    for (level, &nominal) in LEVELS.iter().enumerate() {
        for (images, apart) in [(&learn, 0.002), (&others, 0.02)] {
            let found = coverage(&table, images, level);
            assert!((found - nominal).abs() < apart, "{nominal}: {found}");
        }
    }
    let widths = table.half_widths(&others[0].seen(), LEVEL);
    let edge = others[0].truth.iter().position(|&v| v == 0.8).unwrap();
    assert!(widths[edge] > 3.0 * widths[0], "{} at the edge, {} far away", widths[edge], widths[0]);
}

#[test]
fn a_higher_level_is_never_narrower() {
    let images = drawn(0..20);
    let table = learnt(&images);
    let all: Vec<Vec<f32>> =
        (0..LEVELS.len()).map(|level| table.half_widths(&images[3].seen(), level)).collect();
    assert!(all.windows(2).all(|pair| pair[0].iter().zip(&pair[1]).all(|(a, b)| a <= b)));
}

#[test]
fn a_bin_of_few_pixels_has_the_half_widths_of_all_blurs() {
    let mut images = drawn(0..40);
    for (k, image) in images.iter_mut().enumerate() {
        image.estimate.sigma_px = 1.0 + 0.05 * k as f32;
    }
    let samples: Vec<Sample<'_>> = images.iter().map(Drawn::sample).collect();
    let together = Table::learn(&samples, 8, 2, 1).unwrap();
    // A bin for the blur of each image: at the bar's edges it has less than half an image's pixels.
    let apart = Table::learn(&samples, 8, 2, 40).unwrap();
    for image in &images {
        let edge = image.truth.iter().position(|&v| v == 0.8).unwrap();
        let [together, apart] = [&together, &apart].map(|t| t.half_widths(&image.seen(), LEVEL));
        assert_eq!(together[edge], apart[edge]);
    }
}

#[test]
fn too_few_images_give_no_table() {
    let images = drawn(0..19);
    let samples: Vec<Sample<'_>> = images.iter().map(Drawn::sample).collect();
    let error = Table::learn(&samples, 8, 2, 2).unwrap_err();
    assert_eq!(error.to_string(), "19 images for calibration, expected at least 20");
}

#[test]
fn a_table_with_a_list_of_another_length_is_refused() {
    let shipped: serde_json::Value = serde_json::from_str(nirspi_weights::INTERVALS).unwrap();
    for list in ["scale_bounds", "blur_bounds", "polynomial", "levels", "half_widths"] {
        let mut other = shipped.clone();
        other["pixels"][list].as_array_mut().unwrap().pop();
        let error = Intervals::parse(&other.to_string()).unwrap_err();
        assert!(matches!(error, NoIntervals::Table(TableError::Form)), "{list}: {error}");
    }
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
fn the_shipped_intervals_are_wide_at_the_edges_of_a_blurred_bar() {
    let reading: Vec<f32> =
        (0..1024).map(|at| 0.8 * (-((at % 32) as f32 - 15.5).powi(2) / 8.0).exp()).collect();
    let enhancer = Enhancer::built_in(&Device::cpu()).unwrap();
    let images = Images::new(&reading).unwrap();
    let made = enhancer.enhance(images, None, &Options::default(), &mut |_| {}).unwrap();
    let widths = Intervals::shipped().unwrap().of(&made).unwrap();
    assert_eq!(widths.len(), AREA);
    let row = &widths[32 * 64..33 * 64];
    let (bar, ground) = (row[16..48].iter().copied().fold(0.0, f32::max), row[2]);
    assert!(bar > 5.0 * ground && bar < 1.0, "{bar} at the bar, {ground} beside it");
    assert!(share_of_prior(&widths) < 0.2);
    assert_eq!(share_of_prior(&[0.1, PRIORS_HALF_WIDTH, 0.6, 0.2]), 0.5);
}

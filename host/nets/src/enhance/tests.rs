//! Tests with the embedded weights.

use super::*;
use crate::deblur::{Method, Model};
use crate::device::Device;
use crate::estimate::Known;
use crate::weights::Weights;

const SIDE: usize = 32;

pub(super) fn enhancer(steps: u32) -> Enhancer {
    let device = Device::cpu();
    let weights = |model| Weights::embedded(model).unwrap();
    let method = Method::new(Model::DIFFUSION, NonZeroU32::new(steps)).unwrap();
    let deblurrer = Deblurrer::new(&device, &weights("diffusion"), method).unwrap();
    let estimator = BlurEstimator::new(&device, &weights("estimator")).unwrap();
    let fusion = Fusion::new(&device, &weights("fsrcnn")).unwrap();
    Enhancer::new(fusion, Sharpener::new(estimator, deblurrer))
}

/// A cross of bars on 64 x 64, with values 0 and 0.9.
pub(super) fn cross() -> Vec<f32> {
    let bar = |at: usize| (26..34).contains(&at);
    let inside = |at: usize| (10..54).contains(&at);
    let lit = |y, x| (bar(x) && inside(y)) || (bar(y) && inside(x));
    (0..AREA).map(|i| if lit(i / 64, i % 64) { 0.9 } else { 0.0 }).collect()
}

/// Readings of `image` by 32 x 32 pixels, through a blur of about `sigma_px` (three boxes), with
/// noise.
pub(super) fn seen(image: &[f32], sigma_px: f32, noise: f32, seed: u64) -> Vec<f32> {
    let radius = ((4.0 * sigma_px * sigma_px + 1.0).sqrt() - 1.0) / 2.0;
    let radius = radius.round() as i64;
    let mut blurred = image.to_vec();
    for _ in 0..3 {
        for step in [1, 64] {
            let source = blurred.clone();
            for (i, value) in blurred.iter_mut().enumerate() {
                let at = (i / step % 64) as i64;
                let tap = |d: i64| {
                    let to = (at + d).clamp(0, 63);
                    source[(i as i64 + (to - at) * step as i64) as usize]
                };
                *value = (-radius..=radius).map(tap).sum::<f32>() / (2 * radius + 1) as f32;
            }
        }
    }
    let mean = |i: usize| {
        let at = i / SIDE * 2 * 64 + i % SIDE * 2;
        [0, 1, 64, 65].iter().map(|d| blurred[at + d]).sum::<f32>() / 4.0
    };
    let clean: Vec<f32> = (0..SIDE * SIDE).map(mean).collect();
    measured_again(&clean, &[Estimate { sigma_px, noise }], seed, 0)
}

fn error(image: &[f32], truth: &[f32]) -> f32 {
    let squares: f32 = image.iter().zip(truth).map(|(a, b)| (a - b).powi(2)).sum();
    (squares / image.len() as f32).sqrt()
}

fn enhance(enhancer: &Enhancer, readings: &[f32], options: &Options) -> Enhanced {
    enhancer.enhance(Images::new(readings).unwrap(), None, options, &mut |_| {}).unwrap()
}

#[test]
fn a_blurred_cross_gets_sharper_at_each_stage_and_the_readings_bear_it_out() {
    let readings = seen(&cross(), 2.0, 0.02, 1);
    let result = enhance(&enhancer(1), &readings, &Options::default());
    let (upscaled, sharp) = (result.upscaled.unwrap(), result.images);
    let plain = crate::upscale_2x(&readings, 1, SIDE, SIDE).unwrap();
    let [plain, fused, sharp] = [&plain, &upscaled, &sharp].map(|image| error(image, &cross()));
    assert!(fused < plain && sharp < 0.7 * fused, "{plain} {fused} {sharp}");
    assert!(result.inconsistency[0] < 1.2, "{:?}", result.inconsistency);
    assert!((result.estimates[0].noise - 0.02).abs() < 0.01, "{:?}", result.estimates);
}

#[test]
fn an_image_is_enhanced_alike_alone_and_among_others() {
    // A stack of more than one batch.
    let stack: Vec<f32> = (0..34).flat_map(|seed| seen(&cross(), 1.0, 0.01, seed)).collect();
    let options = Options { copies: 1, ..Options::default() };
    let enhancer = enhancer(1);
    let (area, mut told) = (SIDE * SIDE, Vec::new());
    let images = Images::new(&stack).unwrap();
    let all = enhancer.enhance(images, None, &options, &mut |done| told.push(done)).unwrap();
    assert_eq!(told.last(), Some(&34));
    let alone = enhance(&enhancer, &stack[33 * area..34 * area], &options);
    assert_eq!(all.images[33 * AREA..34 * AREA], alone.images);
    assert_eq!(all.estimates[33], alone.estimates[0]);
    assert_eq!(all.spread.unwrap().len(), 34 * AREA);
}

#[test]
fn the_spread_is_largest_at_edges_and_none_where_nothing_is() {
    let readings = seen(&cross(), 1.5, 0.02, 5);
    let options = Options { copies: 4, seed: 9, ..Options::default() };
    let enhancer = enhancer(1);
    let spread = enhance(&enhancer, &readings, &options).spread.unwrap();
    let mean = |rows: std::ops::Range<usize>, columns: std::ops::Range<usize>| {
        let (height, width) = (rows.len(), columns.len());
        let sum: f32 = rows.map(|y| spread[y * 64..][columns.clone()].iter().sum::<f32>()).sum();
        sum / (height * width) as f32
    };
    assert!(mean(12..24, 24..36) > 5.0 * mean(0..6, 0..6), "{}", mean(0..6, 0..6));
    assert_eq!(enhance(&enhancer, &readings, &options).spread.unwrap(), spread, "seeded");
}

fn deblur(sharpener: &Sharpener, images: &[f32], options: &Options) -> Enhanced {
    sharpener.deblur(Images::new(images).unwrap(), options, &mut |_| {}).unwrap()
}

#[test]
fn a_sharp_clean_image_is_not_touched_by_deblurring() {
    let (images, sharpener) = (cross(), enhancer(1).sharpener);
    assert_eq!(deblur(&sharpener, &images, &Options::default()).images, images);
    let forced = Options { gate: false, ..Options::default() };
    assert_ne!(deblur(&sharpener, &images, &forced).images, images);
}

#[test]
fn what_is_known_of_the_blur_is_believed() {
    let (readings, enhancer) = (seen(&cross(), 2.0, 0.02, 1), enhancer(1));
    let with = |sigma_px| {
        let estimate = KnownEstimate { sigma_px, ..KnownEstimate::default() };
        // Where a blur is known, images follow the readings further.
        enhance(
            &enhancer,
            &readings,
            &Options { estimate, consistency: false, ..Options::default() },
        )
    };
    let blind = with(Known::Nothing);
    let estimated = blind.estimates[0];
    assert_eq!(blind.estimated, Some(vec![estimated]));
    let told = with(Known::Exactly(3.25));
    assert_eq!(told.estimates[0], Estimate { sigma_px: 3.25, ..estimated });
    assert_eq!(told.estimated, Some(vec![estimated]), "as the estimator found it");
    let bound = with(Known::AtLeast(3.25));
    assert_eq!((bound.estimates[0], bound.images), (told.estimates[0], told.images));
    let low = with(Known::AtLeast(0.5));
    assert_eq!((low.estimates[0], low.images), (estimated, blind.images));
}

#[test]
fn the_built_in_enhancer_is_made_of_the_embedded_weights() {
    let readings = seen(&cross(), 2.0, 0.02, 1);
    let built_in = Enhancer::built_in(&Device::cpu()).unwrap();
    let options = Options::default();
    let ours = enhance(&built_in, &readings, &options).images;
    assert_eq!(ours, enhance(&enhancer(1), &readings, &options).images);
}

/// A network that gives white everywhere.
struct White;

impl Sharpen for White {
    fn guess(&self, batch: deblur::Blurred<'_>) -> Vec<f32> {
        vec![2.0; batch.current.len()]
    }
}

#[test]
fn a_network_of_ones_own_is_held_against_the_readings_and_the_gate_stays() {
    let readings = seen(&cross(), 2.0, 0.02, 1);
    let own = enhancer(1).with_network(Box::new(White), NonZeroU32::MIN);
    let free = Options { consistency: false, ..Options::default() };
    let images = enhance(&own, &readings, &free).images;
    assert!(images.iter().all(|v| *v == 1.0), "nothing holds the guess");
    let held = enhance(&own, &readings, &Options::default());
    let mean = held.images.iter().sum::<f32>() / AREA as f32;
    assert!(mean < 0.5, "the readings do: {mean}");
    let sharp = cross();
    let kept = deblur(&own.sharpener, &sharp, &Options::default()).images;
    assert_eq!(kept, sharp, "a sharp, clean image is not the network's");
}

#[test]
fn sharp_and_clean_readings_come_out_finer_than_they_were_read() {
    let sharp = cross();
    let readings = seen(&sharp, 0.0, 0.0, 1);
    let made = enhance(&enhancer(1), &readings, &Options::default());
    let [found, plain] = [made.images, made.upscaled.unwrap()].map(|image| error(&image, &sharp));
    assert!(1.5 * found < plain, "error {found}, before the deblurring network {plain}");
}

#[test]
fn rows_of_other_readings_are_refused() {
    let readings = seen(&cross(), 2.0, 0.02, 1);
    let measured = MeasuredRows::new(64, &[0, 1, 2]).unwrap();
    let options = Options { measured, ..Options::default() };
    let images = Images::new(&readings).unwrap();
    let error = enhancer(1).enhance(images, None, &options, &mut |_| {}).unwrap_err();
    let expected =
        "the measured Hadamard rows are of 64 x 64 readings, but the readings are 32 x 32";
    assert_eq!(error.to_string(), expected);
}

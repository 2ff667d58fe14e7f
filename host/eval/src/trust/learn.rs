//! Makes the calibration from the calibration half.

use super::{Half, Settings, enhanced, enhancer, fingerprints, letters};
use crate::error::Result;
use crate::quality::{Characters, Condition};
use nirspi_nets::interval::{Calibration, CalibrationStack, Sample, Table};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;

/// The most blur of a calibration image, in pixels of 64 x 64: what the networks were trained for.
const MOST_BLUR_PX: f32 = 4.2;
/// Range of the noise of calibration images.
const NOISE: [f32; 2] = [0.002, 0.1];
/// Share of the calibration images with [`USUAL_NOISE`].
const USUAL: f32 = 0.4;
const USUAL_NOISE: f32 = 0.03;
/// Number of conditions of each calibration image.
const TIMES: usize = 3;
/// Numbers of bins of the table: of the expected error, of the busyness, and of the blur.
const BINS: (usize, usize, usize) = (20, 8, 6);

/// Makes the calibration. `made_by` is the command, for the record; `done` is called with the
/// number of images just enhanced.
///
/// # Errors
/// `EvalError` for weights that cannot be read, or too few images.
pub fn calibrate(settings: &Settings, made_by: &str, done: &dyn Fn(usize)) -> Result<Calibration> {
    let mut networks = settings.networks();
    let enhancer = enhancer(&mut networks)?;
    let images = settings.images(Half::Calibration)?;
    let mut rng = Pcg64Mcg::seed_from_u64(settings.seed);
    let mut rounds = Vec::new();
    for round in 0..TIMES {
        let conditions: Vec<Condition> = images.iter().map(|_| drawn(&mut rng)).collect();
        let seed = settings.seed.wrapping_add(1 + round as u64);
        rounds.push(enhanced(&enhancer, &images, &conditions, seed, done)?);
    }
    let mut samples = Vec::new();
    for made in &rounds {
        for (image, seen) in images.iter().zip(made.seen().into_iter().flatten()) {
            let origin = &images.origins()[image.stack];
            let weight = 1.0 / origin.images as f64;
            samples.push(Sample { seen, truth: &image.sharp, weight });
        }
    }
    let pixels = Table::learn(&samples, BINS.0, BINS.1, BINS.2)?;
    let characters = letters::calibrated(&mut networks, &images, &rounds)?;
    Ok(Calibration {
        made_by: made_by.to_owned(),
        weights: fingerprints(&mut networks)?,
        seed: settings.seed,
        stacks: stacks(&images),
        conditions: format!(
            "blur 0 to {MOST_BLUR_PX} px, noise {USUAL_NOISE} for {USUAL} of the images, otherwise {} to {} with even \
             logarithm",
            NOISE[0], NOISE[1]
        ),
        images: samples.len(),
        pixels,
        characters,
    })
}

/// A condition by chance.
fn drawn(rng: &mut Pcg64Mcg) -> Condition {
    let sigma_px = rng.random_range(0.0..MOST_BLUR_PX);
    let [least, most] = NOISE;
    let noise = match rng.random::<f32>() < USUAL {
        true => USUAL_NOISE,
        false => least * (most / least).powf(rng.random()),
    };
    Condition { sigma_px, noise }
}

fn stacks(images: &Characters) -> Vec<CalibrationStack> {
    let of = |(at, origin): (usize, &crate::quality::Origin)| {
        let of_stack = images.iter().filter(|image| image.stack == at);
        let mut groups: Vec<u32> = of_stack.map(|image| image.group).collect();
        groups.sort_unstable();
        groups.dedup();
        CalibrationStack { stack: origin.stack.clone(), groups, images: origin.images }
    };
    images.origins().iter().enumerate().map(of).collect()
}

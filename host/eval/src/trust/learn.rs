//! Makes the calibration from the calibration half.

use super::shots::{At, Condition, LEAST_SHARE, MOST_NOISE, Shot, Studio};
use super::{Half, Settings, enhancer, fingerprints, letters};
use crate::error::Result;
use crate::quality::{Characters, Origin};
use nirspi_nets::interval::{Calibration, CalibrationStack, Reach, Sample, Table};
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use std::collections::BTreeMap;

/// Numbers of bins of a table: of the expected error, and of texture.
const BINS: (usize, usize) = (10, 4);

/// Makes the calibration. `made_by` is the command, for the record; `done` is called with the
/// number of images just enhanced.
///
/// # Errors
/// `EvalError` for weights that cannot be read, or too few images.
pub fn calibrate(settings: &Settings, made_by: &str, done: &dyn Fn(usize)) -> Result<Calibration> {
    let mut networks = settings.networks();
    let studio = Studio::new(enhancer(&mut networks)?, settings.seed)?;
    let images = settings.images(Half::Calibration)?;
    let mut rng = Pcg64Mcg::seed_from_u64(settings.seed);
    let shots = taken(settings, &studio, &images, &mut rng, done)?;
    let mut methods = BTreeMap::new();
    for (number, method) in studio.methods.iter().enumerate() {
        let of_method = || shots.iter().filter(|(_, shot)| shot.method == number);
        let count = |stack| of_method().filter(|(at, _)| at.0 == stack).count();
        let counts: Vec<usize> = (0..images.origins().len()).map(count).collect();
        let samples: Vec<Sample<'_>> = of_method()
            .filter_map(|(at, shot)| {
                // Natural scenes count as much as all characters together.
                let natural = images.origins()[at.0].stack == super::NATURAL;
                let share = if natural { 3.0 } else { 1.0 };
                Some(Sample {
                    seen: shot.seen()?,
                    readings: shot.readings(&studio),
                    truth: &shot.truth,
                    weight: share / counts[at.0] as f64,
                    kind: usize::from(natural),
                })
            })
            .collect();
        methods.insert(method.argument().to_owned(), Table::learn(&samples, BINS.0, BINS.1)?);
    }
    let characters = letters::calibrated(settings, &mut networks, &studio, &images, &shots, done)?;
    Ok(Calibration {
        made_by: made_by.to_owned(),
        weights: fingerprints(&mut networks)?,
        seed: settings.seed,
        stacks: stacks(&images),
        conditions: format!(
            "virtual camera, paper's description, dry air, 0.3 to 0.6 m (half of the shots at 0.3 m); patterns 10, 25, 50 \
             and 100 % and shares between, zig-zag and cake-cutting; noise of the readings 0.1 to {:.0} % of white; \
             contrast 100 and {:.0} % and between",
            100.0 * MOST_NOISE,
            100.0 * super::shots::LOW_CONTRAST
        ),
        images: shots.len(),
        reach: Reach { least_share: LEAST_SHARE, most_noise: MOST_NOISE },
        methods,
        characters,
    })
}

/// Each image by every method under conditions by chance. The learned method has seen some natural
/// scenes in its training: it gets the others, as often.
pub(super) fn taken(
    settings: &Settings,
    studio: &Studio,
    images: &Characters,
    rng: &mut Pcg64Mcg,
    done: &dyn Fn(usize),
) -> Result<Vec<(At, Shot)>> {
    let unseen_by_prior = settings.unseen_by_prior()?;
    let all: Vec<usize> = (0..studio.methods.len()).collect();
    let prior = [studio.prior()];
    let others: Vec<usize> = all.iter().copied().filter(|number| *number != prior[0]).collect();
    let natural = |stack: usize| images.origins()[stack].stack == super::NATURAL;
    let known = |group: u32| !unseen_by_prior.contains(&group);
    let of_natural = || images.iter().filter(|image| natural(image.stack));
    let (shown, hidden) = (
        of_natural().filter(|image| known(image.group)).count(),
        of_natural().filter(|image| !known(image.group)).count(),
    );
    let times = if hidden > 0 { shown.div_ceil(hidden) } else { 0 };
    let mut shots = Vec::new();
    for (number, image) in images.iter().enumerate() {
        let mut take = |methods: &[usize]| -> Result<()> {
            let condition = Condition::drawn(rng, MOST_NOISE);
            let made = studio.shoot(&[(&image.sharp, methods)], condition, rng)?;
            done(made.len());
            shots.extend(made.into_iter().map(|shot| ((image.stack, number), shot)));
            Ok(())
        };
        if !natural(image.stack) || !known(image.group) {
            take(&all)?;
        } else {
            take(&others)?;
        }
        if natural(image.stack) && !known(image.group) {
            (0..times).try_for_each(|_| take(&prior))?;
        }
    }
    Ok(shots)
}

fn stacks(images: &Characters) -> Vec<CalibrationStack> {
    let of = |(at, origin): (usize, &Origin)| {
        let of_stack = images.iter().filter(|image| image.stack == at);
        let mut groups: Vec<u32> = of_stack.map(|image| image.group).collect();
        groups.sort_unstable();
        groups.dedup();
        CalibrationStack { stack: origin.stack.clone(), groups, images: origin.images }
    };
    images.origins().iter().enumerate().map(of).collect()
}

//! A network for measurements of one kind: trust, and the weights of readings, are found out once, on a
//! sample. Each measurement then takes one completion.

use super::{
    Seen, SharedNetwork, believe, completable, image, support, with_network, without_each,
};
use crate::Measurements;
use crate::reconstruct::kind::{GoingOn, sample};
use crate::reconstruct::weight::KindWeights;
use crate::reconstruct::{HeldBack, ReconstructError, Reconstruction, Report, noise};
use rayon::prelude::*;

/// What is known of one measurement of the sample.
struct Tried {
    seen: Seen,
    noise: f32,
    without: Vec<f32>,
    with: Vec<f32>,
}

/// The images of measurements of one kind; `None` if the network has no use for one of the sample.
pub(in super::super) fn network_kind(
    measurements: &[Measurements],
    network: &SharedNetwork,
    name: &str,
    going_on: GoingOn<'_>,
) -> Result<Option<Vec<Reconstruction>>, ReconstructError> {
    let network = network.get();
    let Some(first) = measurements.first() else { return Ok(Some(Vec::new())) };
    if !network.takes(first.side()) {
        return Ok(None);
    }
    let complete = |seen: &Seen| network.complete(seen).map_err(ReconstructError::Failed);
    let some: Vec<usize> = sample(measurements.len()).collect();
    let trusts: Vec<Option<f32>> = some
        .par_iter()
        .map(|&k| match completable(&measurements[k]) {
            Ok(_) => support(&measurements[k], complete).map(Some),
            Err(_) => Ok(None),
        })
        .collect::<Result<_, ReconstructError>>()?;
    let Some(mut trusts) = trusts.into_iter().collect::<Option<Vec<f32>>>() else {
        return Ok(None);
    };
    trusts.sort_unstable_by(f32::total_cmp);
    let trust = trusts[trusts.len() / 2];
    if trust < super::LEAST_TRUST {
        return Ok(None);
    }
    let tried = |&k: &usize| {
        let Some(seen) = Seen::new(&measurements[k]) else { return Ok(None) };
        let without = without_each(&measurements[k], &seen, trust, &complete)?;
        let mut with = complete(&seen)?;
        believe(&seen, trust, &mut with);
        let noise = seen.in_units(noise::estimated_noise(&measurements[k]));
        Ok(Some(Tried { seen, noise, without, with }))
    };
    let tried: Vec<Option<Tried>> =
        some.par_iter().map(tried).collect::<Result<_, ReconstructError>>()?;
    let rows = first.rows();
    let (mut weights, mut judged) = (KindWeights::new(rows), Vec::new());
    for Tried { seen, noise, without, with } in tried.iter().flatten() {
        let value = |k: usize| seen.values()[rows[k] as usize];
        weights.add(|k| (value(k), *noise), |k| without[k], |k| with[rows[k] as usize]);
        judged.extend(seen.judge(rows, without));
    }
    let held_back = HeldBack::mean(&judged);
    let made = |measured: &Measurements| {
        going_on()?;
        let Ok(seen) = completable(measured) else {
            return with_network(measured, network, name);
        };
        let mut grid = complete(&seen)?;
        believe(&seen, trust, &mut grid);
        let noise = noise::estimated_noise(measured);
        let sigma = seen.in_units(noise);
        let mut report = Report::new(name);
        report.held_back = held_back;
        let reading = |k: usize| (seen.values()[rows[k] as usize], sigma);
        report.reading_weight = Some(weights.weigh(rows, reading, &mut grid));
        report.trust = Some(f64::from(trust));
        report.noise = Some(noise);
        report.residual = Some(seen.residual(&grid));
        Ok(Reconstruction { image: image(&seen, grid), report })
    };
    measurements.par_iter().map(made).collect::<Result<Vec<_>, _>>().map(Some)
}

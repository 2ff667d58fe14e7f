//! A penalty on the images of a kind: one strength for all.

use super::{Common, GoingOn, problems};
use crate::Measurements;
use crate::reconstruct::regularised::STRENGTHS;
use crate::reconstruct::{
    Problem, ReconstructError, Regularised, RegularisedSettings, Strength, selection,
};
use crate::words;
use rayon::prelude::*;

/// The images of measurements of one kind; `None` if nothing can be held back.
pub(in super::super) fn regularised_kind(
    measurements: &[Measurements],
    settings: &RegularisedSettings,
    going_on: GoingOn<'_>,
) -> Result<Option<Vec<Regularised>>, ReconstructError> {
    settings.check()?;
    let some = problems(measurements, |measured| settings.problem(measured));
    let Some(first) = some.first() else { return Ok(Some(Vec::new())) };
    let every: Vec<usize> = (0..first.rows.len()).collect();
    // The strongest first: each strength starts from the result of the one before.
    let with = |problem: &Problem<'_>, strengths: &[f32]| {
        let mut all = settings.predict(problem, &every, strengths);
        all.pop().unwrap_or_default()
    };
    let (strengths, common) = match settings.strength {
        Strength::Fixed(strength) => (vec![strength as f32], Common::believed(first.rows)),
        Strength::CrossValidated { folds } => {
            let (count, trusted) = (STRENGTHS.len(), settings.trusted());
            let predict = |problem: &Problem<'_>, kept: &[usize]| {
                Ok(settings.predict(problem, kept, &STRENGTHS))
            };
            let chosen = selection::choose_together(&some, count, folds, trusted, predict)?;
            let Some(chosen) = chosen else { return Ok(None) };
            let strengths = STRENGTHS[..=chosen.at].to_vec();
            let common = Common::new(&some, &chosen, |problem| {
                Ok::<_, ReconstructError>(with(problem, &strengths))
            })?;
            (strengths, common)
        }
    };
    let strength = match settings.strength {
        Strength::Fixed(strength) => strength,
        Strength::CrossValidated { .. } => words::shortest(strengths[strengths.len() - 1]),
    };
    let image = |measured: &Measurements| {
        going_on()?;
        let problem = settings.problem(measured);
        let found = common.made(&problem, with(&problem, &strengths));
        Ok(Regularised {
            image: found.image,
            strength,
            trust: f64::from(common.trust),
            residual: found.residual,
            reading_weight: found.reading_weight,
            held_back: common.held_back,
            noise: problem.noise_in_units(),
        })
    };
    measurements.par_iter().map(image).collect::<Result<Vec<_>, _>>().map(Some)
}

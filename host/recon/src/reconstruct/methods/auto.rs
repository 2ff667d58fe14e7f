//! The method that held-back readings choose for each picture.
//!
//! Which method is best depends on scene, share of the patterns and light: a learned prior for
//! letters and natural scenes, total variation for a few points, nothing but the readings where
//! there is little to predict. Each method of a short list predicts every reading from others, and
//! the one that predicts most of them makes the picture, with two exceptions that
//! `host/eval/tests/defaults/table.md` has the figures for:
//!
//! - Readings tell how well a method predicts between the patterns that were shown, and not beyond
//!   them. A learned prior loses less beyond them than the others, so another method must do clearly
//!   better where more patterns were left out than shown ([`MOST_LEAD`]).
//! - Readings that hold nothing but noise choose by chance, so Tikhonov's method, which gives an
//!   even picture of them, is taken.

use crate::Measurements;
use crate::reconstruct::method::{Entry, Setting};
use crate::reconstruct::prior::SharedNetwork;
use crate::reconstruct::{
    GoingOn, HeldBack, MatrixMethod, Method, MethodSettings, Reconstruct, ReconstructError,
    Reconstruction, Recursive, RecursiveSettings, believed_frame,
};
use std::sync::Arc;

const NAME: &str = "chosen by held-back readings";

/// The method that chooses among others.
pub(in super::super) const METHOD: Method = Method(&Entry {
    argument: "auto",
    name: NAME,
    about: "Chosen for each picture among tikhonov, fista, tv and prior, by how well each predicts held-back readings",
    takes: &[Setting::Basis, Setting::WarmStart],
    with_matrix: Some(MatrixMethod::Best),
    prepare: |settings| Ok(Box::new(Auto::new(settings)?)),
});

/// The most that the learned prior's [`merit`] counts more than another method's. It counts as many
/// times as patterns were left out for each one that was shown, since so much lies beyond these:
/// once at a half or more of the patterns, three times at a quarter.
const MOST_LEAD: f64 = 4.0;

/// The least merit with which another method takes the prior's place where patterns were left out:
/// of few readings, a merit near 0 is chance.
const LEAST_MERIT: f64 = 0.1;

/// Standard errors by which the variation of plain noise may exceed the stated noise.
const NOISE_ALONE: f64 = 3.0;

/// The methods to choose among. Of equal merits the first counts.
fn candidates() -> [Method; 4] {
    [Method::TIKHONOV, super::FISTA, super::TOTAL_VARIATION, Method::PRIOR]
}

struct Auto {
    candidates: Vec<(Method, Arc<dyn Reconstruct>)>,
    network: Option<SharedNetwork>,
}

impl Auto {
    fn new(settings: &MethodSettings) -> Result<Self, ReconstructError> {
        let network = settings.network.clone();
        let methods = candidates().into_iter();
        let candidates = methods
            .filter(|method| network.is_some() || *method != Method::PRIOR)
            .map(|method| Ok((method, Arc::from(method.prepare(&settings.taken_by(method))?))))
            .collect::<Result<_, ReconstructError>>()?;
        Ok(Self { candidates, network })
    }

    /// The index of the best method, and its picture.
    fn best(
        &self,
        measurements: &Measurements,
    ) -> Result<(usize, Reconstruction), ReconstructError> {
        let mut best: Option<(f64, usize, Reconstruction)> = None;
        let takes = |network: &SharedNetwork| network.get().takes(measurements.side());
        let with_network = self.network.as_ref().is_some_and(takes);
        let (all, shown) = (measurements.side().area(), measurements.rows().len());
        let left_out = all > shown;
        let lead = ((all - shown) as f64 / shown as f64).clamp(1.0, MOST_LEAD);
        let noise_alone = is_noise_alone(measurements);
        for (at, (word, method)) in self.candidates.iter().enumerate() {
            if (*word == Method::PRIOR && !with_network)
                || (*word != Method::TIKHONOV && noise_alone)
            {
                continue;
            }
            let made = method.reconstruct(measurements)?;
            let merit = merit(made.report.held_back);
            let merit = match *word == Method::PRIOR && left_out {
                true => LEAST_MERIT.max(lead * merit),
                false => merit,
            };
            if best.as_ref().is_none_or(|(most, _, _)| merit > *most) {
                best = Some((merit, at, made));
            }
        }
        let (_, at, mut made) = best.ok_or_else(|| {
            ReconstructError::Failed("no method to choose, expected at least one".to_owned())
        })?;
        made.report.chosen = Some(self.candidates[at].0.argument());
        Ok((at, made))
    }
}

/// What a method predicts of held-back readings over what it misses of them: 0 for zero filling, and
/// for a method without a judgement.
fn merit(held_back: Option<HeldBack>) -> f64 {
    held_back.map_or(0.0, |held_back| (2.0 - held_back.miss).max(0.0) / held_back.miss)
}

/// Whether readings of stated noise vary no more than that noise does.
fn is_noise_alone(measurements: &Measurements) -> bool {
    let Some(noise) = measurements.noise().filter(|noise| *noise > 0.0) else { return false };
    let readings = measurements.rows().iter().zip(measurements.values());
    let (count, squares) = readings
        .filter(|(row, _)| **row != 0)
        .fold((0.0, 0.0), |(count, squares), (_, value)| (count + 1.0, squares + value * value));
    squares <= count * noise * noise * (1.0 + NOISE_ALONE * (2.0_f64 / count).sqrt())
}

impl Reconstruct for Auto {
    fn name(&self) -> &str {
        NAME
    }

    fn reconstruct(&self, measurements: &Measurements) -> Result<Reconstruction, ReconstructError> {
        Ok(self.best(measurements)?.1)
    }

    fn reconstruct_kind(
        &self,
        measurements: &[Measurements],
        going_on: GoingOn<'_>,
    ) -> Result<Vec<Reconstruction>, ReconstructError> {
        match measurements.first().map(|first| self.settled(first)).transpose()?.flatten() {
            None => Ok(Vec::new()),
            Some(settled) => settled.reconstruct_kind(measurements, going_on),
        }
    }

    fn settled(
        &self,
        first: &Measurements,
    ) -> Result<Option<Arc<dyn Reconstruct>>, ReconstructError> {
        let (at, _) = self.best(first)?;
        let (method, chosen) = &self.candidates[at];
        Ok(Some(Arc::new(Settled { word: method.argument(), method: chosen.clone() })))
    }

    fn begin_video(&self) -> Result<Option<Recursive>, ReconstructError> {
        Recursive::new(RecursiveSettings::default()).map(Some)
    }

    fn next_frame(
        &self,
        past: &mut Recursive,
        frame: &Measurements,
    ) -> Result<Reconstruction, ReconstructError> {
        believed_frame(self, past, frame)
    }

    fn reconstruct_video(
        &self,
        frames: &[Measurements],
    ) -> Result<Vec<Reconstruction>, ReconstructError> {
        match frames.first().map(|first| self.settled(first)).transpose()?.flatten() {
            None => Ok(Vec::new()),
            Some(settled) => settled.reconstruct_video(frames),
        }
    }
}

/// The method that was chosen for measurements like these.
struct Settled {
    word: &'static str,
    method: Arc<dyn Reconstruct>,
}

impl Settled {
    fn marked(&self, mut made: Reconstruction) -> Reconstruction {
        made.report.chosen = Some(self.word);
        made
    }
}

impl Reconstruct for Settled {
    fn name(&self) -> &str {
        NAME
    }

    fn reconstruct(&self, measurements: &Measurements) -> Result<Reconstruction, ReconstructError> {
        Ok(self.marked(self.method.reconstruct(measurements)?))
    }

    fn reconstruct_kind(
        &self,
        measurements: &[Measurements],
        going_on: GoingOn<'_>,
    ) -> Result<Vec<Reconstruction>, ReconstructError> {
        let made = self.method.reconstruct_kind(measurements, going_on)?;
        Ok(made.into_iter().map(|made| self.marked(made)).collect())
    }

    fn begin_video(&self) -> Result<Option<Recursive>, ReconstructError> {
        self.method.begin_video()
    }

    fn next_frame(
        &self,
        past: &mut Recursive,
        frame: &Measurements,
    ) -> Result<Reconstruction, ReconstructError> {
        Ok(self.marked(self.method.next_frame(past, frame)?))
    }

    fn reconstruct_video(
        &self,
        frames: &[Measurements],
    ) -> Result<Vec<Reconstruction>, ReconstructError> {
        let made = self.method.reconstruct_video(frames)?;
        Ok(made.into_iter().map(|made| self.marked(made)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Rows;
    use crate::testing::{normal, side};
    use rand::SeedableRng;
    use rand_pcg::Pcg64;

    /// Readings of noise 1 that state the noise `stated`, of a scene that only one pattern sees.
    fn measured(signal: f64, stated: f64) -> Measurements {
        let mut random = Pcg64::seed_from_u64(7);
        let rows = Rows::natural(side(16));
        let values = (0..256).map(|k| normal(&mut random) + f64::from(u8::from(k == 1)) * signal);
        let values = values.collect::<Vec<_>>();
        Measurements::from_differential(&rows, &values).unwrap().with_noise(stated).unwrap()
    }

    #[test]
    fn readings_of_plain_noise_get_the_even_picture() {
        let chosen = |measured: &Measurements| {
            let method = METHOD.prepare(&MethodSettings::default()).unwrap();
            method.reconstruct(measured).unwrap().report.chosen.unwrap()
        };
        assert_eq!(chosen(&measured(0.0, 1.0)), "tikhonov");
        // One reading beyond the noise is a scene, and so is noise that is too large for what is stated.
        assert!(is_noise_alone(&measured(0.0, 1.0)) && !is_noise_alone(&measured(16.0, 1.0)));
        assert!(!is_noise_alone(&measured(0.0, 0.8)));
    }

    #[test]
    fn merit_is_what_is_predicted_over_what_is_missed() {
        let of = |miss| merit(Some(HeldBack { miss, confirmed: 0.0, score: 0.0 }));
        assert_eq!([of(1.0), of(0.5), of(2.0), of(3.0), merit(None)], [1.0, 3.0, 0.0, 0.0, 0.0]);
    }
}

//! The method that held-back readings choose for each picture.
//!
//! Which method is best depends on scene, share of the patterns and light: a learned prior for
//! letters and natural scenes, few coefficients for a picture of few photons, nothing but the
//! readings where there is little to predict. Each method of a short list predicts every reading
//! from others, and the one with the least error makes the picture.

use crate::Measurements;
use crate::reconstruct::method::{Entry, Setting};
use crate::reconstruct::{
    MatrixMethod, Method, MethodSettings, Penalty, Reconstruct, ReconstructError, Reconstruction,
    Recursive, RecursiveSettings, believed_frame,
};
use std::sync::Arc;

const NAME: &str = "chosen by held-back readings";

/// The method that chooses among others.
pub(in super::super) const METHOD: Method = Method(&Entry {
    argument: "auto",
    name: NAME,
    about: "Chosen for each picture among tikhonov, fista, tv and prior: the method that predicts held-back readings best",
    takes: &[Setting::Basis, Setting::WarmStart],
    with_matrix: Some(MatrixMethod::Penalty(Penalty::Tikhonov)),
    prepare: |settings| Ok(Box::new(Auto::new(settings)?)),
});

/// The methods to choose among. Of equal errors the first counts.
fn candidates() -> [Method; 4] {
    [Method::TIKHONOV, super::FISTA, super::TOTAL_VARIATION, Method::PRIOR]
}

struct Auto {
    candidates: Vec<(Method, Arc<dyn Reconstruct>)>,
}

impl Auto {
    fn new(settings: &MethodSettings) -> Result<Self, ReconstructError> {
        let without_network = settings.network.is_none();
        let methods = candidates().into_iter();
        let candidates = methods
            .filter(|method| !(without_network && *method == Method::PRIOR))
            .map(|method| Ok((method, Arc::from(method.prepare(&settings.taken_by(method))?))))
            .collect::<Result<_, ReconstructError>>()?;
        Ok(Self { candidates })
    }

    /// The index of the best method, and its picture.
    fn best(
        &self,
        measurements: &Measurements,
    ) -> Result<(usize, Reconstruction), ReconstructError> {
        let mut best: Option<(f64, usize, Reconstruction)> = None;
        for (at, (_, method)) in self.candidates.iter().enumerate() {
            let made = method.reconstruct(measurements)?;
            // A method without a judgement is as good as zero filling.
            let miss = made.report.held_back.map_or(2.0, |held_back| held_back.miss);
            if best.as_ref().is_none_or(|(least, _, _)| miss < *least) {
                best = Some((miss, at, made));
            }
        }
        let (_, at, mut made) = best.ok_or_else(|| {
            ReconstructError::Failed("no method to choose, expected at least one".to_owned())
        })?;
        made.report.chosen = Some(self.candidates[at].0.argument());
        Ok((at, made))
    }
}

impl Reconstruct for Auto {
    fn name(&self) -> &str {
        NAME
    }

    fn reconstruct(&self, measurements: &Measurements) -> Result<Reconstruction, ReconstructError> {
        Ok(self.best(measurements)?.1)
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

//! Tikhonov's method, with a covariance prior; for videos, the recursive estimate.

use super::penalised;
use crate::reconstruct::method::{Entry, Setting};
use crate::reconstruct::{
    GoingOn, MatrixMethod, Method, MethodSettings, Penalty, Reconstruct, ReconstructError,
    Reconstruction, Recursive, RecursiveFrame, RecursiveSettings, Report,
};
use crate::{Basis, Measurements};

const NAME: &str = "Tikhonov";

/// The method with [`Penalty::Tikhonov`].
pub(in super::super) const METHOD: Method = Method(&Entry {
    argument: "tikhonov",
    name: NAME,
    about: "Most likely image if coefficients fall as one over frequency (Tikhonov, a covariance prior)",
    takes: &[Setting::Basis, Setting::Strength, Setting::WarmStart],
    with_matrix: Some(MatrixMethod::Penalty(Penalty::Tikhonov)),
    prepare: |settings| Ok(Box::new(Tikhonov::new(settings)?)),
});

struct Tikhonov {
    alone: Box<dyn Reconstruct>,
    basis: Basis,
    video: RecursiveSettings,
}

impl Tikhonov {
    fn new(settings: &MethodSettings) -> Result<Self, ReconstructError> {
        Ok(Self {
            alone: penalised::prepare(NAME, Penalty::Tikhonov, settings)?,
            basis: settings.basis,
            video: RecursiveSettings {
                strength: settings.strength,
                ..RecursiveSettings::default()
            },
        })
    }
}

impl Reconstruct for Tikhonov {
    fn name(&self) -> &str {
        NAME
    }

    fn reconstruct(&self, measurements: &Measurements) -> Result<Reconstruction, ReconstructError> {
        self.alone.reconstruct(measurements)
    }

    fn reconstruct_kind(
        &self,
        measurements: &[Measurements],
        going_on: GoingOn<'_>,
    ) -> Result<Vec<Reconstruction>, ReconstructError> {
        self.alone.reconstruct_kind(measurements, going_on)
    }

    fn begin_video(&self) -> Result<Option<Recursive>, ReconstructError> {
        if self.basis != Basis::Dct {
            return Err(ReconstructError::Failed(format!(
                "frames that start from the frame before need the dct basis, found {}",
                self.basis
            )));
        }
        Recursive::new(self.video).map(Some)
    }

    fn next_frame(
        &self,
        past: &mut Recursive,
        frame: &Measurements,
    ) -> Result<Reconstruction, ReconstructError> {
        let made = past.add(frame)?;
        let report = report(&made);
        Ok(Reconstruction { image: made.image, report })
    }
}

fn report(made: &RecursiveFrame) -> Report {
    let mut report = Report::new(NAME);
    report.basis = Some(Basis::Dct.to_string());
    report.strength = Some(made.strength);
    report.reading_weight = Some(made.reading_weight);
    report.residual = Some(made.residual);
    report.noise = Some(made.noise);
    report.warm = made.warm;
    report.note = made.note();
    report
}

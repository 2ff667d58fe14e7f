//! The common part of the methods with a [`Penalty`]: settings, and a report.

use crate::Measurements;
use crate::reconstruct::kind::regularised_kind;
use crate::reconstruct::stack::{each, with_statistics};
use crate::reconstruct::{
    GoingOn, MethodSettings, Penalty, Reconstruct, ReconstructError, Reconstruction, Recursive,
    RecursiveSettings, Regularised, RegularisedSettings, Report, fused_frame, regularised,
};

struct Penalised {
    name: &'static str,
    settings: RegularisedSettings,
}

/// Prepares the method with this `penalty`.
pub(super) fn prepare(
    name: &'static str,
    penalty: Penalty,
    settings: &MethodSettings,
) -> Result<Box<dyn Reconstruct>, ReconstructError> {
    let settings = RegularisedSettings {
        basis: settings.basis,
        strength: settings.strength,
        ..RegularisedSettings::new(penalty)
    };
    Ok(Box::new(Penalised { name, settings }))
}

impl Penalised {
    fn reported(&self, found: Regularised) -> Reconstruction {
        let RegularisedSettings { penalty, basis, .. } = self.settings;
        let mut report = Report::new(self.name);
        report.basis = penalty.has_basis().then(|| basis.to_string());
        report.strength = Some(found.strength);
        report.reading_weight = Some(found.reading_weight);
        report.held_back = found.held_back;
        report.residual = Some(found.residual);
        report.trust = Some(found.trust);
        report.noise = Some(found.noise);
        Reconstruction { image: found.image, report }
    }
}

impl Reconstruct for Penalised {
    fn name(&self) -> &str {
        self.name
    }

    fn reconstruct(&self, measurements: &Measurements) -> Result<Reconstruction, ReconstructError> {
        Ok(self.reported(regularised(measurements, &self.settings)?))
    }

    fn reconstruct_kind(
        &self,
        measurements: &[Measurements],
        going_on: GoingOn<'_>,
    ) -> Result<Vec<Reconstruction>, ReconstructError> {
        let measurements = &with_statistics(measurements);
        match regularised_kind(measurements, &self.settings, going_on)? {
            Some(made) => Ok(made.into_iter().map(|found| self.reported(found)).collect()),
            None => each(self, measurements, going_on),
        }
    }

    fn begin_video(&self) -> Result<Option<Recursive>, ReconstructError> {
        Recursive::new(RecursiveSettings::default()).map(Some)
    }

    fn next_frame(
        &self,
        past: &mut Recursive,
        frame: &Measurements,
    ) -> Result<Reconstruction, ReconstructError> {
        fused_frame(self, past, frame)
    }
}

//! Orthogonal matching pursuit, in a basis or over a user's own atoms, on the processor or a GPU.

use crate::omp::BackendError;
use crate::reconstruct::kind::omp_kind;
use crate::reconstruct::method::{Entry, OwnAtoms, Setting};
use crate::reconstruct::stack::{each, with_common_noise};
use crate::reconstruct::{
    ComputedBy, GoingOn, MatrixMethod, Method, MethodSettings, OmpReconstruction, OmpSettings,
    Reconstruct, ReconstructError, Reconstruction, Report, omp, omp_over, omp_video,
};
use crate::{Backend, Measurements};
use std::sync::Arc;

const NAME: &str = "OMP";

/// The method of orthogonal matching pursuit.
pub(in super::super) const METHOD: Method = Method(&Entry {
    argument: "omp",
    name: NAME,
    about: "Orthogonal matching pursuit (the paper's Algorithm 1) in a sparsifying basis",
    takes: &[
        Setting::Basis,
        Setting::Dictionary,
        Setting::Sparsity,
        Setting::Residual,
        Setting::AsPrinted,
        Setting::NonNegative,
        Setting::Backend,
        Setting::WarmStart,
    ],
    with_matrix: Some(MatrixMethod::Omp),
    prepare: |settings| Ok(Box::new(Omp::new(settings)?)),
});

struct Omp {
    settings: OmpSettings,
    atoms: Option<OwnAtoms>,
    /// Name of the GPU, if a GPU computes.
    device: Option<Arc<str>>,
}

impl Omp {
    fn new(asked: &MethodSettings) -> Result<Self, ReconstructError> {
        let device = device(asked.backend).map_err(crate::omp::OmpError::from)?;
        let base = match asked.as_printed {
            true => OmpSettings::as_printed(asked.basis, 0),
            false => OmpSettings { basis: asked.basis, ..OmpSettings::default() },
        };
        let settings = OmpSettings {
            // Whether a GPU is worth it is found out with a stack.
            backend: asked.backend,
            sparsity: asked.sparsity,
            residual: asked.residual,
            non_negative: asked.non_negative,
            ..base
        };
        let device = device.map(Into::into);
        Ok(Self { settings, atoms: asked.dictionary.clone(), device })
    }

    fn reported(&self, found: OmpReconstruction) -> Reconstruction {
        let OmpSettings { basis, backend, sparsity, .. } = self.settings;
        let mut report = Report::new(NAME);
        report.basis = Some(match &self.atoms {
            None => basis.to_string(),
            Some(atoms) => atoms.name.clone(),
        });
        let by = found.by.unwrap_or_else(|| ComputedBy {
            backend: if self.device.is_some() { backend } else { Backend::Cpu },
            device: self.device.clone(),
            said: None,
        });
        report.backend = Some(by.backend);
        report.device = by.device.as_deref().map(str::to_owned);
        report.computed = by.said;
        report.sparsity = Some(found.sparsity);
        report.reading_weight = Some(found.reading_weight);
        report.held_back = found.held_back;
        report.stop = Some(sparsity.reason(found.stop));
        report.residual = Some(found.residual);
        report.unseen_atoms = Some(found.unseen_atoms);
        report.trust = Some(found.trust);
        report.noise = Some(found.noise);
        Reconstruction { image: found.image, report }
    }
}

impl Reconstruct for Omp {
    fn name(&self) -> &str {
        NAME
    }

    fn reconstruct(&self, measurements: &Measurements) -> Result<Reconstruction, ReconstructError> {
        let found = match &self.atoms {
            None => omp(measurements, &self.settings),
            Some(atoms) => omp_over(measurements, &atoms.values, &self.settings),
        };
        Ok(self.reported(found?))
    }

    fn reconstruct_kind(
        &self,
        measurements: &[Measurements],
        going_on: GoingOn<'_>,
    ) -> Result<Vec<Reconstruction>, ReconstructError> {
        let measurements = &with_common_noise(measurements);
        let made = match self.atoms {
            None => omp_kind(measurements, &self.settings, going_on)?,
            Some(_) => None,
        };
        match made {
            Some(made) => Ok(made.into_iter().map(|found| self.reported(found)).collect()),
            None => each(self, measurements, going_on),
        }
    }

    fn reconstruct_video(
        &self,
        frames: &[Measurements],
    ) -> Result<Vec<Reconstruction>, ReconstructError> {
        if self.atoms.is_some() {
            return frames.iter().map(|frame| self.reconstruct(frame)).collect();
        }
        let frames = omp_video(frames, &self.settings)?;
        let reported = frames.into_iter().map(|frame| {
            let mut made = self.reported(frame.reconstruction);
            made.report.warm = frame.warm;
            made
        });
        Ok(reported.collect())
    }
}

/// Name of the GPU for one image, if a GPU was requested by name.
#[cfg(feature = "gpu")]
fn device(backend: Backend) -> Result<Option<String>, BackendError> {
    use crate::omp::gpu::{Choice, choose};
    Ok(match choose(backend, 1)? {
        Choice::Gpu(device) => Some(device.name().to_owned()),
        Choice::Cpu(_) => None,
    })
}

#[cfg(not(feature = "gpu"))]
fn device(backend: Backend) -> Result<Option<String>, BackendError> {
    match backend {
        Backend::Auto | Backend::Cpu => Ok(None),
        Backend::Wgpu | Backend::Cuda => Err(BackendError::not_built()),
    }
}

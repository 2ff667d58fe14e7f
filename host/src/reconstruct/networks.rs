//! Networks after a method, on the processor or a GPU.

use crate::imaging::{Enhance, EnhanceError, FrameReport, FramesError, enhance_alike};
use nirspi_nets::{Device, WeightsError};
use nirspi_recon::omp::backend::{Backend, Failure, Turns};
use nirspi_recon::{Image, Rows};
use thiserror::Error;

/// Networks that are ready on the processor, and on a GPU, if one was asked for or may be faster.
pub(super) struct Networks {
    processor: Enhance,
    gpu: Option<Enhance>,
    turns: Turns,
}

/// Why networks are not ready.
#[derive(Debug, Error)]
pub enum NetworksError {
    /// The requested device is missing.
    #[error(transparent)]
    Device(#[from] nirspi_nets::DeviceError),
    /// The built-in weights cannot be used.
    #[error(transparent)]
    Weights(#[from] WeightsError),
}

impl Networks {
    /// The built-in networks. With [`Backend::Auto`] a GPU, if there is one, computes stacks if it is faster, and one image is
    /// the processor's.
    pub(super) fn on(backend: Backend) -> Result<Self, NetworksError> {
        let device = Device::open(backend)?;
        let processor = Enhance::built_in(&Device::cpu())?;
        let has_gpu = device.backend() != Backend::Cpu;
        let gpu = if has_gpu { Some(Enhance::built_in(&device)?) } else { None };
        let turns = match (has_gpu, backend) {
            (false, _) => Turns::of_processor(),
            (true, Backend::Auto) => Turns::by_time(device.name()),
            (true, _) => Turns::on_device(device.name()),
        };
        Ok(Self { processor, gpu, turns })
    }

    /// What enhances one image.
    pub(super) fn for_one(&self) -> &Enhance {
        self.gpu.as_ref().filter(|_| self.turns.is_asked_for()).unwrap_or(&self.processor)
    }

    /// Who enhances a stack from its beginning.
    pub(super) fn turns(&self) -> Turns {
        self.turns.clone()
    }

    /// Enhances images of one size, made of the same rows, of one white level.
    pub(super) fn enhance(
        &self,
        turns: &mut Turns,
        images: &[&Image],
        rows: &Rows,
        white: f32,
    ) -> Result<Vec<(Vec<f32>, FrameReport)>, FramesError> {
        let by = |enhance: &Enhance, images: &[&Image]| enhance_alike(enhance, images, rows, white);
        let gpu = self.gpu.as_ref().unwrap_or(&self.processor);
        let made = turns.work(
            images.len(),
            |some| by(gpu, &images[some]),
            |some| by(&self.processor, &images[some]),
        );
        Ok(made?.0)
    }
}

impl Failure for FramesError {
    fn is_of_device(&self) -> bool {
        matches!(self, Self::Enhance(EnhanceError::Networks(nirspi_nets::EnhanceError::Device(_))))
    }
}

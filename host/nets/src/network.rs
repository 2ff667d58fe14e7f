//! What a network does on any device: plain slices in, plain vectors out.

use crate::schema::Conditions;

/// The UNet on a device.
pub(crate) trait RunUNet: Send {
    /// The network's output for each pair of images (N, `side`, `side`) under its conditions.
    fn run(
        &self,
        side: usize,
        current: &[f32],
        degraded: &[f32],
        conditions: &[Conditions],
    ) -> Vec<f32>;
}

/// The estimator on a device.
pub(crate) trait RunEstimator: Send {
    /// The two outputs for each image of (N, `side`, `side`).
    fn run(&self, side: usize, images: &[f32]) -> Vec<[f32; 2]>;
}

/// FSRCNN on a device.
pub(crate) trait RunFsrcnn: Send {
    /// The image (N, 2 `side`, 2 `side`), not clamped, from (N, 3, `side`, `side`).
    fn run(&self, side: usize, input: &[f32]) -> Vec<f32>;
}

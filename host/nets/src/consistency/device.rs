//! The same agreement on a GPU, where one kernel makes it for many images.
//!
//! # Invariant
//! The images are those of [`Consistency::agree`](super::Consistency::agree), to 2e-4
//! (`gpu::tests::agreement::images_agree_as_on_the_processor`).

use nirspi_gpu::agreement::{Agreement, Law, Matrices, Told};
use nirspi_gpu::limits::DeviceLimits;
use nirspi_gpu::{GpuError, Kernels};

use super::{
    BISECTIONS, LEAST_LAMBDA, MOST_LOG_LAMBDA, NOISE_FLOOR, OF_IMAGE, OF_READINGS, REACHED, STUCK,
    TAU,
};
use super::{Binding, MeasuredRows, krylov, measured};
use crate::estimate::{KnownEstimate, NOISE_SCALE, SIGMA_SCALE_PX};
use crate::grid::COARSE;

/// The agreement with readings of 32 x 32 that were made from these rows, for the estimator's
/// outputs with what the caller knows, on a device with these limits.
///
/// # Errors
/// [`GpuError::TooLarge`] if the kernel needs more than the device has.
pub(crate) fn agreement(
    engine: &dyn Kernels,
    limits: &DeviceLimits,
    rows: &MeasuredRows,
    binding: Binding,
    known: KnownEstimate,
) -> Result<Agreement, GpuError> {
    let matrices = Matrices {
        waves: OF_IMAGE.waves(),
        cosines: OF_READINGS.waves(),
        walsh: measured::walsh_of_readings(),
        measured: match rows {
            MeasuredRows::All => None,
            MeasuredRows::Rows(rows) => Some(rows.measured()),
        },
    };
    let law = Law {
        binding: binding != Binding::Off,
        tau: TAU,
        // No image is as far off.
        reached: if binding == Binding::OfKnownBlur { 1e30 } else { REACHED },
        stuck: STUCK,
        noise_floor: NOISE_FLOOR,
        logs: [LEAST_LAMBDA.log10(), MOST_LOG_LAMBDA],
        halvings: BISECTIONS,
        steps: [krylov::MOST_STEPS, krylov::STEPS_A_LOOK],
        tolerance: krylov::TOLERANCE as f32,
    };
    let [least, most] = known.bounds();
    let told = Told {
        sigma_scale: SIGMA_SCALE_PX * (super::SIDE / COARSE) as f32,
        sigma: [least.sigma_px, most.sigma_px],
        noise_scale: 1.0 / NOISE_SCALE,
        noise: [least.noise, most.noise],
    };
    engine.agreement(&matrices, &law, &told, limits)
}

//! Agreement with the readings (consistency): images are changed just enough that the readings agree
//! with them to within their noise. `nirspi_nets::consistency` has the law and its constants; the
//! kernel here solves the same equations.
//!
//! | module | contents |
//! |---|---|
//! | `layout` | the order of the numbers that host and kernel share |
//! | `kernels` | the kernel |
//!
//! Work of a frame, in products of two numbers, counted from the kernel's loops: 0.72 million with
//! all rows measured. With some of them 0.66 million, 0.26 million for the two residuals, and 0.13
//! million for each step of Lanczos, at most 60. About 52 KB are read and 16 KB written; with some
//! rows measured, 4 KB more each way for each step.

mod kernels;
mod layout;

use crate::engine::Engine;
use crate::limits::{DeviceLimits, GROUPS};
use crate::{Buffer, GpuError, limits};
use cubecl::prelude::*;
use kernels::{SIDE, Shape, UNITS};
use layout::{FINE, SETTINGS, TABLES};

/// In place of the inconsistency of a frame whose guess has NaN. No inconsistency is negative.
pub const BROKEN: f32 = -1.0;

/// Number of buffers of the kernel.
const BUFFERS: usize = 8;

/// The matrices of the cosine and Walsh transforms, row after row, and the measured rows.
#[derive(Debug, Clone, Copy)]
pub struct Matrices<'a> {
    /// The cosine transform (DCT-II, orthonormal) of 64 numbers: 64 x 64.
    pub waves: &'a [f32],
    /// The same of 32 numbers: 32 x 32.
    pub cosines: &'a [f32],
    /// From the cosine transform of 32 numbers to their Walsh-Hadamard transform: 32 x 32.
    pub walsh: &'a [f32],
    /// Whether each Hadamard row was measured (1024); `None` if all were.
    pub measured: Option<&'a [bool]>,
}

/// The law of the agreement.
#[derive(Debug, Clone, Copy)]
pub struct Law {
    /// Whether images are moved. Their inconsistency is computed in any case.
    pub binding: bool,
    /// Factor on the expected radius of the ball.
    pub tau: f32,
    /// An image stays as it was if the moved one is farther from its readings than this inconsistency,
    pub reached: f32,
    /// and than this share of the distance before.
    pub stuck: f32,
    /// Smallest standard deviation assumed for a reading.
    pub noise_floor: f32,
    /// The interval of lambda, as decimal logarithms.
    pub logs: [f32; 2],
    /// Number of halvings of that interval.
    pub halvings: usize,
    /// Largest number of Lanczos' steps, and number of steps between two checks.
    pub steps: [usize; 2],
    /// Norm of the residual, relative to the right-hand side's norm, at which a solution is
    /// accurate enough.
    pub tolerance: f32,
}

/// From the estimator's outputs to blur and noise as used: each output times its scale, clamped to
/// its bounds.
#[derive(Debug, Clone, Copy)]
pub struct Told {
    /// Blur in pixels of the fine grid for an output of 1.
    pub sigma_scale: f32,
    /// Bounds of the blur.
    pub sigma: [f32; 2],
    /// Noise of a reading for an output of 1.
    pub noise_scale: f32,
    /// Bounds of the noise.
    pub noise: [f32; 2],
}

/// A law, and everything that the kernel needs for it, on a device.
#[derive(Debug)]
pub struct Agreement {
    tables: Buffer,
    settings: Buffer,
    shape: Shape,
}

/// Images in agreement.
#[derive(Debug)]
pub struct Agreed {
    /// frames x 64 x 64, in [0, 1].
    pub images: Buffer,
    /// The inconsistency of each frame; [`BROKEN`] for a frame whose guess has NaN, which its image
    /// hides.
    pub ratios: Buffer,
}

/// Agreement with the readings, on one device.
pub trait Agree: Engine {
    /// Uploads a law, for a device with these limits.
    ///
    /// # Errors
    /// [`GpuError::TooLarge`] if the device has too little shared memory, or too few units or
    /// buffers.
    ///
    /// # Panics
    /// If a matrix has another size.
    fn agreement(
        &self,
        matrices: &Matrices<'_>,
        law: &Law,
        told: &Told,
        limits: &DeviceLimits,
    ) -> Result<Agreement, GpuError>;

    /// Moves `frames` guesses (frames x 64 x 64) into agreement with their readings (frames x 32 x
    /// 32). `estimates` has two outputs of the estimator for each frame.
    fn agree(
        &self,
        agreement: &Agreement,
        readings: &Buffer,
        guesses: &Buffer,
        estimates: &Buffer,
        frames: usize,
    ) -> Agreed;
}

impl Agreement {
    /// Number of numbers of scratch for each frame.
    #[must_use]
    pub fn scratch(&self) -> usize {
        let steps = self.shape.steps + 1;
        if self.shape.sampled && self.shape.binding { steps * SIDE * SIDE } else { 0 }
    }
}

fn transposed(matrix: &[f32]) -> impl Iterator<Item = f32> + '_ {
    (0..SIDE).flat_map(move |column| matrix[column..].iter().step_by(SIDE).copied())
}

fn fits(shape: &Shape, device: &DeviceLimits) -> Result<(), GpuError> {
    limits::check("buffers of a kernel", BUFFERS, device.buffers)?;
    limits::check("units of a workgroup", UNITS, device.units)?;
    limits::check("bytes of shared memory", 4 * shape.shared(), device.shared_bytes)
}

impl<R: Runtime> Agree for ComputeClient<R> {
    fn agreement(
        &self,
        matrices: &Matrices<'_>,
        law: &Law,
        told: &Told,
        limits: &DeviceLimits,
    ) -> Result<Agreement, GpuError> {
        let Matrices { waves, cosines, walsh, measured } = *matrices;
        assert_eq!([waves.len(), cosines.len(), walsh.len()], [4096, 1024, 1024]);
        assert!(measured.is_none_or(|measured| measured.len() == SIDE * SIDE));
        let shape = Shape {
            binding: law.binding,
            sampled: measured.is_some(),
            steps: law.steps[0],
            look: law.steps[1],
            halvings: law.halvings,
        };
        assert!(shape.steps > 0 && shape.look > 0, "an end of Lanczos' steps");
        fits(&shape, limits)?;
        let mut tables = Vec::with_capacity(TABLES);
        tables.extend_from_slice(waves);
        tables.extend_from_slice(cosines);
        tables.extend(transposed(cosines));
        tables.extend_from_slice(walsh);
        tables.extend(transposed(walsh));
        tables.extend(
            (0..SIDE * SIDE)
                .map(|row| f32::from(u8::from(measured.is_none_or(|measured| measured[row])))),
        );
        let degrees = tables[layout::MASK..].iter().sum::<f32>();
        let mut settings = [0.0; 14];
        settings[SETTINGS.sigma_scale] = told.sigma_scale;
        [settings[SETTINGS.sigma_least], settings[SETTINGS.sigma_most]] = told.sigma;
        settings[SETTINGS.noise_scale] = told.noise_scale;
        [settings[SETTINGS.noise_least], settings[SETTINGS.noise_most]] = told.noise;
        settings[SETTINGS.noise_floor] = law.noise_floor;
        settings[SETTINGS.tau] = law.tau;
        settings[SETTINGS.reached] = law.reached;
        settings[SETTINGS.stuck] = law.stuck;
        [settings[SETTINGS.least_log], settings[SETTINGS.most_log]] = law.logs;
        settings[SETTINGS.degrees] = degrees;
        settings[SETTINGS.tolerance] = law.tolerance;
        Ok(Agreement { tables: self.upload(&tables), settings: self.upload(&settings), shape })
    }

    #[expect(unsafe_code, reason = "bounds checks would double the loads of the inner loops")]
    fn agree(
        &self,
        agreement: &Agreement,
        readings: &Buffer,
        guesses: &Buffer,
        estimates: &Buffer,
        frames: usize,
    ) -> Agreed {
        assert!(readings.count() >= frames * SIDE * SIDE);
        assert!(guesses.count() >= frames * FINE * FINE);
        assert!(estimates.count() >= 2 * frames && frames <= GROUPS);
        let images = Engine::empty(self, frames * FINE * FINE);
        let ratios = Engine::empty(self, frames);
        let basis = Engine::empty(self, frames * agreement.scratch());
        // SAFETY: frames are below the lengths checked above; tables and settings have their lengths
        // by construction; barriers are met by all units of a workgroup.
        unsafe {
            kernels::agree::launch_unchecked::<R>(
                self,
                CubeCount::Static(frames as u32, 1, 1),
                CubeDim::new_1d(UNITS as u32),
                readings.arg(),
                guesses.arg(),
                estimates.arg(),
                agreement.tables.arg(),
                agreement.settings.arg(),
                basis.arg(),
                images.arg(),
                ratios.arg(),
                agreement.shape,
            );
        }
        Agreed { images, ratios }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_with_too_little_is_refused_with_what_it_has() {
        let shape = Shape { binding: true, sampled: true, steps: 60, look: 2, halvings: 22 };
        let device =
            DeviceLimits { shared_bytes: 32 << 10, buffer_bytes: 1 << 30, units: 256, buffers: 8 };
        assert_eq!(fits(&shape, &device), Ok(()));
        let small = DeviceLimits { shared_bytes: 16 << 10, ..device };
        let refused = fits(&shape, &small).unwrap_err().to_string();
        assert_eq!(refused, "the GPU has 16384 bytes of shared memory, this problem needs 22736");
        assert!(fits(&shape, &DeviceLimits { units: 128, ..device }).is_err());
        assert!(fits(&shape, &DeviceLimits { buffers: 7, ..device }).is_err());
    }
}

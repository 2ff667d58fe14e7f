//! Images on a device.
//!
//! The one law: they are where they were made, and only [`download`](DeviceImages::download) brings them to the host.

use super::device::Device;
use super::engine::Buffer;
use crate::omp::{OmpError, finite};
use cubecl::bytes::Bytes;
use cubecl::prelude::CubeElement;
use cubecl::server::Handle;

/// Images on a device, `frames x pixels`, row-major `f32`.
#[derive(Debug)]
pub struct DeviceImages {
    device: Device,
    buffer: Buffer,
    frames: usize,
    pixels: usize,
}

/// Images that have come back, `frames x pixels`.
#[derive(Debug)]
pub struct HostImages {
    bytes: Bytes,
    count: usize,
}

impl std::ops::Deref for HostImages {
    type Target = [f32];

    fn deref(&self) -> &[f32] {
        &f32::from_bytes(&self.bytes)[..self.count]
    }
}

impl DeviceImages {
    pub(super) fn of(device: &Device, buffer: Buffer, [frames, pixels]: [usize; 2]) -> Self {
        Self { device: device.clone(), buffer, frames, pixels }
    }

    /// Takes images of `pixels` numbers each to a device.
    ///
    /// # Errors
    /// [`OmpError`] if they are no whole images, a number is not finite, or they do not fit.
    pub fn upload(device: &Device, images: &[f32], pixels: usize) -> Result<Self, OmpError> {
        if pixels == 0 || !images.len().is_multiple_of(pixels) {
            return Err(OmpError::Length { found: images.len(), expected: pixels });
        }
        finite("image", images)?;
        device.limits().fits("bytes of a buffer for the images", images.len())?;
        let buffer = device.engine.upload(images);
        Ok(Self::of(device, buffer, [images.len() / pixels, pixels]))
    }

    /// Brings them to the host.
    ///
    /// # Errors
    /// [`OmpError`] if the device failed.
    pub fn download(&self) -> Result<HostImages, OmpError> {
        let bytes = self.device.engine.read(&[&self.buffer])?.swap_remove(0);
        Ok(HostImages { bytes, count: self.frames * self.pixels })
    }

    /// Where they are.
    #[must_use]
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// How many.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Numbers of each.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.pixels
    }

    /// The memory that they begin in, for who computes on the same device: CubeCL has one client for each.
    #[must_use]
    pub fn handle(&self) -> &Handle {
        self.buffer.handle()
    }
}

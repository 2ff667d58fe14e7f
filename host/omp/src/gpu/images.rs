//! Images on a device. They stay there until [`download`](DeviceImages::download) brings them to
//! the host.

use super::device::Device;
use crate::{OmpError, finite};
use nirspi_gpu::{Buffer, Numbers};

/// Images on a device, `frames x pixels`, row-major `f32`.
#[derive(Debug)]
pub struct DeviceImages {
    device: Device,
    buffer: Buffer,
    frames: usize,
    pixels: usize,
}

/// Images on the host, `frames x pixels`.
#[derive(Debug)]
pub struct HostImages {
    numbers: Numbers,
    count: usize,
}

impl std::ops::Deref for HostImages {
    type Target = [f32];

    fn deref(&self) -> &[f32] {
        &self.numbers.floats()[..self.count]
    }
}

impl DeviceImages {
    pub(super) fn of(device: &Device, buffer: Buffer, [frames, pixels]: [usize; 2]) -> Self {
        Self { device: device.clone(), buffer, frames, pixels }
    }

    /// Uploads images of `pixels` numbers each.
    ///
    /// # Errors
    /// [`OmpError`] if the images are not whole, a number is not finite, or the images do not fit.
    pub fn upload(device: &Device, images: &[f32], pixels: usize) -> Result<Self, OmpError> {
        if pixels == 0 || !images.len().is_multiple_of(pixels) {
            return Err(OmpError::Length { found: images.len(), expected: pixels });
        }
        finite("image", images)?;
        device.limits().fits("bytes of a buffer for the images", images.len())?;
        let buffer = device.engine.upload(images);
        Ok(Self::of(device, buffer, [images.len() / pixels, pixels]))
    }

    /// Downloads the images.
    ///
    /// # Errors
    /// [`OmpError`] if the device failed.
    pub fn download(&self) -> Result<HostImages, OmpError> {
        let numbers = self.device.engine.read(&[&self.buffer])?.swap_remove(0);
        Ok(HostImages { numbers, count: self.frames * self.pixels })
    }

    /// The images' device.
    #[must_use]
    pub fn device(&self) -> &Device {
        &self.device
    }

    /// Number of images.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.frames
    }

    /// Number of pixels of each image.
    #[must_use]
    pub fn pixels(&self) -> usize {
        self.pixels
    }

    /// The images' buffer, for other kernels on the same device. It has at least `frames x pixels`
    /// numbers.
    #[must_use]
    pub fn buffer(&self) -> &Buffer {
        &self.buffer
    }
}

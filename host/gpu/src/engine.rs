//! Buffers on a device, and what every engine does with them.

use crate::error::GpuError;
use crate::limits::DeviceLimits;
use cubecl::bytes::Bytes;
use cubecl::prelude::*;
use cubecl::reader::read_sync;
use cubecl::server::Handle;
use half::f16;
use std::fmt;

/// A buffer of four-byte numbers on a device.
#[derive(Clone, Debug)]
pub struct Buffer {
    handle: Handle,
    count: usize,
}

impl Buffer {
    /// Number of four-byte numbers.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    #[expect(
        unsafe_code,
        reason = "CubeCL trusts the length; it is the one the buffer was made with"
    )]
    pub(crate) fn arg<R: Runtime>(&self) -> ArrayArg<R> {
        // SAFETY: every constructor of a buffer takes the count from what it allocates or uploads.
        unsafe { ArrayArg::from_raw_parts(self.handle.clone(), self.count) }
    }
}

/// Numbers that were read from a device, in the memory into which the driver copied them.
pub struct Numbers {
    bytes: Bytes,
    count: usize,
}

impl fmt::Debug for Numbers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Numbers({})", self.count)
    }
}

impl Numbers {
    /// The numbers as `f32`.
    #[must_use]
    pub fn floats(&self) -> &[f32] {
        &f32::from_bytes(&self.bytes)[..self.count]
    }

    /// The numbers as `u32`.
    #[must_use]
    pub fn words(&self) -> &[u32] {
        &u32::from_bytes(&self.bytes)[..self.count]
    }
}

/// One device. Calls only queue work; a failed launch appears in [`read`](Self::read).
pub trait Engine: Send + Sync {
    /// The limits of the device.
    fn limits(&self) -> DeviceLimits;
    /// A buffer with these numbers.
    fn upload(&self, numbers: &[f32]) -> Buffer;
    /// A buffer of `count` undefined numbers, at least one. With debug assertions they are NaN, so
    /// that tests see each number that a kernel leaves unwritten.
    fn empty(&self, count: usize) -> Buffer;
    /// The numbers of each buffer.
    ///
    /// # Errors
    /// [`GpuError::Failed`] if the device, its driver, or an earlier launch failed.
    fn read(&self, buffers: &[&Buffer]) -> Result<Vec<Numbers>, GpuError>;
}

/// A buffer with an even number of numbers in `f16`, two in each of its four-byte numbers.
pub(crate) fn upload_halves<R: Runtime>(client: &ComputeClient<R>, numbers: &[f16]) -> Buffer {
    assert!(numbers.len().is_multiple_of(2));
    let handle = client.create_from_slice(f16::as_bytes(numbers));
    Buffer { handle, count: numbers.len() / 2 }
}

/// A buffer with these numbers in `f64`; each counts as two of its four-byte numbers.
pub(crate) fn upload_doubles<R: Runtime>(client: &ComputeClient<R>, numbers: &[f64]) -> Buffer {
    let handle = client.create_from_slice(f64::as_bytes(numbers));
    Buffer { handle, count: 2 * numbers.len() }
}

impl<R: Runtime> Engine for ComputeClient<R> {
    fn limits(&self) -> DeviceLimits {
        let properties = self.properties();
        let hardware = &properties.hardware;
        DeviceLimits {
            shared_bytes: hardware.max_shared_memory_size,
            buffer_bytes: usize::try_from(properties.memory.max_page_size).unwrap_or(usize::MAX),
            units: hardware.max_units_per_cube.min(hardware.max_cube_dim.0) as usize,
            buffers: hardware.max_bindings as usize,
        }
    }

    fn upload(&self, numbers: &[f32]) -> Buffer {
        Buffer { handle: self.create_from_slice(f32::as_bytes(numbers)), count: numbers.len() }
    }

    fn empty(&self, count: usize) -> Buffer {
        let count = count.max(1);
        if cfg!(debug_assertions) {
            return self.upload(&vec![f32::NAN; count]);
        }
        Buffer { handle: ComputeClient::empty(self, count * size_of::<f32>()), count }
    }

    fn read(&self, buffers: &[&Buffer]) -> Result<Vec<Numbers>, GpuError> {
        let handles = buffers.iter().map(|buffer| buffer.handle.clone()).collect();
        let all = read_sync(self.read_async(handles)).map_err(|error| {
            // The second line of the message has the cause; a backtrace follows.
            let text = error.to_string();
            GpuError::Failed(text.lines().take(3).map(str::trim).collect::<Vec<_>>().join(" "))
        })?;
        let counts = buffers.iter().map(|buffer| buffer.count);
        Ok(all.into_iter().zip(counts).map(|(bytes, count)| Numbers { bytes, count }).collect())
    }
}

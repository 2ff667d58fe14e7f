//! Launches the kernels on one device, for any runtime of CubeCL.
//!
//! A kernel does not check its indices. So every function here checks the lengths of the buffers
//! before its launch.

use super::budget::{DeviceLimits, ROUNDS, row_launches};
use super::kernels;
use super::layout::{STATE, Shape, TOGETHER};
use crate::omp::BackendError;
use cubecl::prelude::*;
use cubecl::reader::read_sync;
use cubecl::server::Handle;

/// A buffer of four-byte numbers on a device.
#[derive(Clone, Debug)]
pub(super) struct Buffer {
    handle: Handle,
    count: usize,
}

impl Buffer {
    pub(super) fn handle(&self) -> &Handle {
        &self.handle
    }

    #[expect(
        unsafe_code,
        reason = "CubeCL trusts the length; it is the one the buffer was made with"
    )]
    fn arg<R: Runtime>(&self) -> ArrayArg<R> {
        // SAFETY: every constructor of a buffer takes the count from what it allocates or uploads.
        unsafe { ArrayArg::from_raw_parts(self.handle.clone(), self.count) }
    }
}

/// The buffers of a batch of pursuits.
#[derive(Clone, Debug)]
pub(super) struct Pursuit {
    pub shape: Shape,
    pub frames: usize,
    /// Largest number of atoms of a frame.
    pub sparsity: usize,
    pub gram: Buffer,
    /// One over each norm, followed by each squared norm.
    pub atoms: Buffer,
    pub projection: Buffer,
    pub rows: Buffer,
    pub support: Buffer,
    /// For each atom of the support, a step and one over the root of its pivot.
    pub values: Buffer,
    pub state: Buffer,
    pub coefficients: Buffer,
}

impl Pursuit {
    fn width(&self) -> usize {
        self.shape.width()
    }

    fn is_whole(&self) -> bool {
        let (width, chosen) = (self.width(), self.frames * self.sparsity);
        self.gram.count == width * width
            && self.atoms.count == 2 * width
            && self.projection.count >= self.frames * width
            && self.rows.count >= chosen * width
            && self.support.count >= chosen
            && self.values.count >= 2 * chosen
            && self.state.count >= self.frames * STATE
            && self.coefficients.count >= chosen
            && self.sparsity <= self.shape.capacity
    }
}

/// Scores and pivots below these shares count as zero. The thresholds are the CPU's,
/// `Scalar::ROUNDING` and `Scalar::DEPENDENT`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rounding {
    pub score: f32,
    pub pivot: f32,
}

/// One device. Calls only queue work; errors appear in [`read`](Self::read).
pub(super) trait Engine: Send + Sync {
    fn limits(&self) -> DeviceLimits;
    fn upload(&self, numbers: &[f32]) -> Buffer;
    /// A buffer with undefined numbers; at least one.
    fn empty(&self, count: usize) -> Buffer;
    /// The bytes of each buffer.
    fn read(&self, buffers: &[&Buffer]) -> Result<Vec<cubecl::bytes::Bytes>, BackendError>;
    /// `vectors * matrix`, see [`kernels::products`]. A vector has `rows` numbers; `width`, the
    /// number of columns, is a multiple of 64.
    fn products(&self, vectors: &Buffer, matrix: &Buffer, rows: usize, width: usize) -> Buffer;
    /// A mark for each atom, see [`kernels::doubles`].
    fn doubles(&self, gram: &Buffer, width: usize, like: f32) -> Buffer;
    /// Steps `first..last` of the pursuits, see [`kernels::pursue`].
    fn pursue(&self, pursuit: &Pursuit, steps: (usize, usize), rounding: Rounding);
    /// See [`kernels::coefficients`].
    fn coefficients(&self, pursuit: &Pursuit);
    /// See [`kernels::factor`].
    fn factor(&self, pursuit: &Pursuit) -> Buffer;
    /// See [`kernels::images`]; `pictures` are `atoms x pixels`.
    fn images(&self, pursuit: &Pursuit, pictures: &Buffer, pixels: usize) -> Buffer;
    /// See [`kernels::scatter`].
    fn scatter(&self, pursuit: &Pursuit, atoms: usize) -> Buffer;
}

/// Number of units of a workgroup in kernels without shared memory.
const UNITS: usize = 64;

fn cubes(x: usize, y: usize) -> CubeCount {
    CubeCount::Static(x as u32, y as u32, 1)
}

fn units(count: usize) -> CubeDim {
    CubeDim::new_1d(count as u32)
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
        Buffer { handle: ComputeClient::empty(self, count * size_of::<f32>()), count }
    }

    fn read(&self, buffers: &[&Buffer]) -> Result<Vec<cubecl::bytes::Bytes>, BackendError> {
        let handles = buffers.iter().map(|buffer| buffer.handle.clone()).collect();
        read_sync(self.read_async(handles)).map_err(|error| {
            // The second line of the message has the cause; a backtrace follows.
            let text = error.to_string();
            BackendError::Failed(text.lines().take(3).map(str::trim).collect::<Vec<_>>().join(" "))
        })
    }

    #[expect(unsafe_code, reason = "bounds checks would double the loads of the inner loop")]
    fn products(&self, vectors: &Buffer, matrix: &Buffer, rows: usize, width: usize) -> Buffer {
        let count = vectors.count / rows;
        assert!(count.is_multiple_of(TOGETHER) && width.is_multiple_of(UNITS));
        assert_eq!(matrix.count, rows * width);
        let out = Engine::empty(self, count * width);
        for (first, last) in row_launches(rows) {
            // SAFETY: vectors are below `count`, rows below `rows` and columns below `width`, by
            // the asserts above; a launch loops over at most `ROUNDS` rows.
            unsafe {
                kernels::products::launch_unchecked::<R>(
                    self,
                    cubes(width / UNITS, count / TOGETHER),
                    units(UNITS),
                    vectors.arg(),
                    matrix.arg(),
                    out.arg(),
                    rows as u32,
                    width as u32,
                    first as u32,
                    last as u32,
                );
            }
        }
        out
    }

    fn doubles(&self, gram: &Buffer, width: usize, like: f32) -> Buffer {
        assert_eq!(gram.count, width * width);
        assert!(width <= ROUNDS);
        let out = Engine::empty(self, width);
        let (gram, marks) = (gram.arg(), out.arg());
        kernels::doubles::launch::<R>(
            self,
            cubes(width / UNITS, 1),
            units(UNITS),
            gram,
            marks,
            width as u32,
            like,
        );
        out
    }

    #[expect(unsafe_code, reason = "bounds checks would double the loads of the inner loop")]
    fn pursue(&self, pursuit: &Pursuit, (first, last): (usize, usize), rounding: Rounding) {
        assert!(pursuit.is_whole() && last <= pursuit.sparsity);
        // SAFETY: frames, atoms (chosen ones, too, are places of the projection) and steps are
        // below the lengths that `is_whole` has checked; loops are bounded by `last`, and barriers
        // are outside every branch.
        unsafe {
            kernels::pursue::launch_unchecked::<R>(
                self,
                cubes(pursuit.frames, 1),
                units(pursuit.shape.units),
                pursuit.gram.arg(),
                pursuit.atoms.arg(),
                pursuit.projection.arg(),
                pursuit.rows.arg(),
                pursuit.support.arg(),
                pursuit.values.arg(),
                pursuit.state.arg(),
                pursuit.sparsity as u32,
                first as u32,
                last as u32,
                rounding.score,
                rounding.pivot,
                pursuit.shape,
            );
        }
    }

    fn coefficients(&self, pursuit: &Pursuit) {
        assert!(pursuit.is_whole());
        kernels::coefficients::launch::<R>(
            self,
            cubes(pursuit.frames, 1),
            units(pursuit.shape.units),
            pursuit.rows.arg(),
            pursuit.support.arg(),
            pursuit.values.arg(),
            pursuit.state.arg(),
            pursuit.coefficients.arg(),
            pursuit.sparsity as u32,
            pursuit.width() as u32,
            pursuit.shape,
        );
    }

    fn factor(&self, pursuit: &Pursuit) -> Buffer {
        assert!(pursuit.is_whole());
        let triangle = pursuit.sparsity * (pursuit.sparsity + 1) / 2;
        let out = Engine::empty(self, pursuit.frames * triangle);
        kernels::factor::launch::<R>(
            self,
            cubes(pursuit.sparsity, pursuit.frames),
            units(UNITS),
            pursuit.rows.arg(),
            pursuit.support.arg(),
            pursuit.values.arg(),
            pursuit.state.arg(),
            out.arg(),
            pursuit.sparsity as u32,
            pursuit.width() as u32,
            UNITS,
        );
        out
    }

    fn images(&self, pursuit: &Pursuit, pictures: &Buffer, pixels: usize) -> Buffer {
        assert!(pursuit.is_whole());
        let out = Engine::empty(self, pursuit.frames * pixels);
        kernels::images::launch::<R>(
            self,
            cubes(pixels.div_ceil(UNITS), pursuit.frames),
            units(UNITS),
            pictures.arg(),
            pursuit.support.arg(),
            pursuit.coefficients.arg(),
            pursuit.state.arg(),
            out.arg(),
            pursuit.sparsity as u32,
            pixels as u32,
        );
        out
    }

    fn scatter(&self, pursuit: &Pursuit, atoms: usize) -> Buffer {
        assert!(pursuit.is_whole());
        let out = Engine::empty(self, pursuit.frames * atoms);
        kernels::scatter::launch::<R>(
            self,
            cubes(pursuit.frames, 1),
            units(UNITS),
            pursuit.support.arg(),
            pursuit.coefficients.arg(),
            pursuit.state.arg(),
            out.arg(),
            pursuit.sparsity as u32,
            atoms as u32,
            UNITS,
        );
        out
    }
}

//! Orthogonal matching pursuit of many frames at once.
//!
//! | module | contents |
//! |---|---|
//! | [`layout`] | the order of a pursuit's numbers in memory, which kernels and host share |
//! | `budget` | distribution of a pursuit to workgroups and launches within a device's limits |
//! | `kernels` | the kernels |
//! | [`referee`] | choices in double precision |
//!
//! # How
//! One workgroup pursues one frame, with its projections in registers: four atoms a unit for 1024
//! atoms. As on the CPU, the columns of the chosen atoms in the Gram matrix are orthogonalised one
//! by one (a pivoted partial Cholesky factorisation), so a step solves no triangular system. A step
//! reads the earlier rows once, 4 bytes per atom and row, and writes one row. The rows are in the
//! device's memory. Shared memory holds three numbers for each unit and one weight for each chosen
//! atom: 16 KB are enough for 2048 atoms, 32 KB for 4096, so one variant of the kernel serves all
//! sizes. The number of loop rounds grows with the atoms, and `budget` splits a pursuit into as
//! many launches as necessary.

mod budget;
mod kernels;
pub mod layout;
pub mod referee;

use crate::Buffer;
use crate::engine::{Engine, upload_doubles};
use crate::limits::ROUNDS;
use budget::row_launches;
use cubecl::ir::{ElemType, FloatKind};
use cubecl::prelude::*;
use layout::{STATE, Shape, TOGETHER};

/// The buffers of a batch of pursuits.
#[derive(Clone, Debug)]
pub struct Pursuit {
    /// The distribution of atoms to units.
    pub shape: Shape,
    /// Number of frames.
    pub frames: usize,
    /// Largest number of atoms of a frame.
    pub sparsity: usize,
    /// The Gram matrix, `width x width`.
    pub gram: Buffer,
    /// One over each norm, followed by each squared norm.
    pub atoms: Buffer,
    /// The measurements' inner products with the atoms, `frames x width`; overwritten.
    pub projection: Buffer,
    /// Orthogonalised columns of the chosen atoms, `frames x sparsity x width`.
    pub rows: Buffer,
    /// The chosen atoms, `frames x sparsity`, as `u32`.
    pub support: Buffer,
    /// For each atom of the support, a step and one over the root of its pivot.
    pub values: Buffer,
    /// The state of each frame ([`layout`]).
    pub state: Buffer,
    /// The coefficients of the chosen atoms, `frames x sparsity`.
    pub coefficients: Buffer,
    /// What a referee needs, if there is to be one.
    pub exact: Option<Exact>,
}

/// A dictionary and measurements in double precision, for choices that single precision cannot make.
/// A number in `f64` counts as two of a buffer.
#[derive(Clone, Debug)]
pub struct Exact {
    /// The Gram matrix, `width x width`.
    pub gram: Buffer,
    /// One over each norm (`width`), 0 for atoms that are never chosen.
    pub norms: Buffer,
    /// The measurements' inner products with the atoms, `frames x width`.
    pub projection: Buffer,
    /// Smallest lead over the next best atom, relative to the measurement's norm, that needs no
    /// referee.
    pub believed: f32,
}

impl Pursuit {
    fn width(&self) -> usize {
        self.shape.width()
    }

    fn is_whole(&self) -> bool {
        let (width, chosen) = (self.width(), self.frames * self.sparsity);
        self.gram.count() == width * width
            && self.atoms.count() == 2 * width
            && self.projection.count() >= self.frames * width
            && self.rows.count() >= chosen * width
            && self.support.count() >= chosen
            && self.values.count() >= 2 * chosen
            && self.state.count() >= self.frames * STATE
            && self.coefficients.count() >= chosen
            && self.sparsity <= self.shape.capacity
            && self.exact.as_ref().is_none_or(|exact| {
                exact.gram.count() == 2 * width * width
                    && exact.norms.count() == 2 * width
                    && exact.projection.count() >= 2 * self.frames * width
            })
    }
}

/// Scores and pivots below these shares count as zero. `nirspi-recon` takes those of the processor,
/// `Scalar::ROUNDING` and `Scalar::DEPENDENT`.
#[derive(Clone, Copy, Debug)]
pub struct Rounding {
    /// The share for scores, of the first atom's score.
    pub score: f32,
    /// The share for pivots, of the atom's squared norm.
    pub pivot: f32,
}

/// The kernels of orthogonal matching pursuit, on one device.
pub trait Pursue: Engine {
    /// `vectors * matrix`. A vector has `rows` numbers, and the number of vectors is a multiple of
    /// [`TOGETHER`]; `width`, the number of columns, is a multiple of 64.
    fn products(&self, vectors: &Buffer, matrix: &Buffer, rows: usize, width: usize) -> Buffer;
    /// Whether the device has double precision.
    fn has_doubles(&self) -> bool;
    /// Whether the device has double precision, and shared memory for a referee of pursuits of this
    /// shape.
    fn has_referee(&self, shape: &Shape) -> bool;
    /// A buffer with these numbers in `f64`.
    fn upload_doubles(&self, numbers: &[f64]) -> Buffer;
    /// [`products`](Self::products) in `f64`.
    fn exact_products(
        &self,
        vectors: &Buffer,
        matrix: &Buffer,
        rows: usize,
        width: usize,
    ) -> Buffer;
    /// A 1 (`u32`) for each atom that is parallel to a lower one: the square of their cosine is at
    /// least `like`. 0 for the others.
    fn doubles(&self, gram: &Buffer, width: usize, like: f32) -> Buffer;
    /// Steps `first..last` of the pursuits.
    fn pursue(&self, pursuit: &Pursuit, steps: (usize, usize), rounding: Rounding);
    /// Computes the coefficients of each support.
    fn coefficients(&self, pursuit: &Pursuit);
    /// The Cholesky factor of each support, row after row of its lower triangle.
    fn factor(&self, pursuit: &Pursuit) -> Buffer;
    /// Images, `frames x pixels`: each atom's picture (`atoms x pixels`) times its coefficient.
    fn images(&self, pursuit: &Pursuit, pictures: &Buffer, pixels: usize) -> Buffer;
    /// Each coefficient at the place of its atom, 0 elsewhere: `frames x atoms`.
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

/// Number of buffers of a pursuit with a referee.
const REFEREED_BUFFERS: usize = 10;

/// `vectors * matrix` in `F`.
#[expect(unsafe_code, reason = "bounds checks would double the loads of the inner loop")]
fn products<R: Runtime, F: Float>(
    client: &ComputeClient<R>,
    vectors: &Buffer,
    matrix: &Buffer,
    rows: usize,
    width: usize,
) -> Buffer {
    let words = size_of::<F>() / size_of::<f32>();
    let count = vectors.count() / words / rows;
    assert!(count.is_multiple_of(TOGETHER) && width.is_multiple_of(UNITS));
    assert_eq!(matrix.count(), words * rows * width);
    let out = Engine::empty(client, words * count * width);
    for (first, last) in row_launches(rows) {
        // SAFETY: vectors are below `count`, rows below `rows` and columns below `width`, by the
        // asserts above; a launch loops over at most `ROUNDS` rows.
        unsafe {
            kernels::products::launch_unchecked::<F, R>(
                client,
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

/// Launches steps `first..last` of pursuits, with the referee's numbers in `D` if there is a referee.
#[expect(unsafe_code, reason = "bounds checks would double the loads of the inner loop")]
fn pursue<R: Runtime, D: Float>(
    client: &ComputeClient<R>,
    pursuit: &Pursuit,
    (first, last): (usize, usize),
    rounding: Rounding,
) {
    assert!(pursuit.is_whole() && last <= pursuit.sparsity);
    let exact = pursuit.exact.as_ref();
    let [gram, projection, norms] = match exact {
        Some(exact) => [&exact.gram, &exact.projection, &exact.norms],
        // The kernel does not read them.
        None => [&pursuit.gram; 3],
    };
    // SAFETY: frames, atoms (chosen ones, too, are places of the projection) and steps are below the
    // lengths that `is_whole` has checked; loops are bounded by `last`, and all units of a workgroup
    // meet each barrier, because they branch by the same shared numbers.
    unsafe {
        kernels::pursue::launch_unchecked::<D, R>(
            client,
            cubes(pursuit.frames, 1),
            units(pursuit.shape.units),
            pursuit.gram.arg(),
            pursuit.atoms.arg(),
            pursuit.projection.arg(),
            pursuit.rows.arg(),
            pursuit.support.arg(),
            pursuit.values.arg(),
            pursuit.state.arg(),
            gram.arg(),
            projection.arg(),
            norms.arg(),
            pursuit.sparsity as u32,
            first as u32,
            last as u32,
            rounding.score,
            rounding.pivot,
            exact.map_or(0.0, |exact| exact.believed),
            pursuit.shape,
            exact.is_some(),
        );
    }
}

impl<R: Runtime> Pursue for ComputeClient<R> {
    fn products(&self, vectors: &Buffer, matrix: &Buffer, rows: usize, width: usize) -> Buffer {
        products::<R, f32>(self, vectors, matrix, rows, width)
    }

    fn has_doubles(&self) -> bool {
        let double = ElemType::Float(FloatKind::F64);
        // CubeCL does not name f64 for CUDA, because its products of matrices fail with it; it does
        // name sums by several units at once, which every GPU since 2016 has.
        let atomic = Type::new(StorageType::Atomic(double));
        let features = self.features();
        features.supports_type(double) || !features.atomic_type_usage(atomic).is_empty()
    }

    fn has_referee(&self, shape: &Shape) -> bool {
        let limits = Engine::limits(self);
        self.has_doubles()
            && shape.refereed_bytes() <= limits.shared_bytes
            && limits.buffers >= REFEREED_BUFFERS
    }

    fn upload_doubles(&self, numbers: &[f64]) -> Buffer {
        upload_doubles(self, numbers)
    }

    fn exact_products(
        &self,
        vectors: &Buffer,
        matrix: &Buffer,
        rows: usize,
        width: usize,
    ) -> Buffer {
        products::<R, f64>(self, vectors, matrix, rows, width)
    }

    fn doubles(&self, gram: &Buffer, width: usize, like: f32) -> Buffer {
        assert_eq!(gram.count(), width * width);
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

    fn pursue(&self, pursuit: &Pursuit, steps: (usize, usize), rounding: Rounding) {
        match &pursuit.exact {
            Some(_) => pursue::<R, f64>(self, pursuit, steps, rounding),
            None => pursue::<R, f32>(self, pursuit, steps, rounding),
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

//! The measurement operator: rows of the Hadamard matrix by fast transforms, for one image or many.
//!
//! # Invariant
//! `adjoint` is the transpose of `forward` (`test_hadamard.py`, `test_the_adjoint_is_the_transpose`).

use crate::arrays::{array, rows, side, whole};
use crate::errors::refused;
use crate::work::{heavy, quick};
use nirspi_recon::fwht::Real;
use nirspi_recon::{Rows, fwht};
use numpy::{Element, PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use rayon::prelude::*;
use std::ops::{AddAssign, Mul};

/// Numbers from which a batch is worth the threads.
const PARALLEL: usize = 1 << 15;

trait Number: Real + Element + Default + Send + Sync + AddAssign + Mul<Output = Self> {
    fn of(value: f64) -> Self;
}
impl Number for f32 {
    fn of(value: f64) -> Self {
        value as Self
    }
}
impl Number for f64 {
    fn of(value: f64) -> Self {
        value
    }
}

/// What an operator does.
#[derive(Clone, Copy, PartialEq)]
enum What {
    Forward,
    Adjoint,
    Inverse,
}

/// Some rows of the Hadamard matrix of an image, in the order shown.
#[pyclass(frozen, module = "nirspi._nirspi")]
pub struct Operator {
    rows: Rows,
    split: bool,
    /// Rows of norm 1 instead of entries of +1 and -1.
    ortho: bool,
}

impl Operator {
    fn area(&self) -> usize {
        self.rows.side().area()
    }

    fn readings(&self) -> usize {
        self.rows.len() * if self.split { 2 } else { 1 }
    }

    /// Length of an input and of an output.
    fn lengths(&self, what: What) -> (usize, usize) {
        match what {
            What::Forward => (self.area(), self.readings()),
            What::Adjoint | What::Inverse => (self.readings(), self.area()),
        }
    }

    fn unit(&self) -> f64 {
        if self.ortho { 1.0 / self.rows.side().pixels() as f64 } else { 1.0 }
    }

    /// The readings of one image. `grid` is memory for the image.
    fn forward<T: Number>(&self, x: &[T], y: &mut [T], grid: &mut [T]) {
        grid.copy_from_slice(x);
        transform(grid);
        let unit = T::of(self.unit() * if self.split { 0.5 } else { 1.0 });
        if !self.split {
            for (y, &row) in y.iter_mut().zip(self.rows.iter()) {
                *y = grid[row as usize] * unit;
            }
            return;
        }
        // A pattern lights the pixels of +1, its complement those of -1.
        let light = grid[0];
        for (pair, &row) in y.as_chunks_mut::<2>().0.iter_mut().zip(self.rows.iter()) {
            let value = grid[row as usize];
            *pair = [(light + value) * unit, (light - value) * unit];
        }
    }

    /// The image that the transpose, or the pseudo-inverse, makes of one set of readings.
    fn back<T: Number>(&self, y: &[T], x: &mut [T], what: What) {
        x.fill(T::default());
        let area = self.area() as f64;
        let factor = match what {
            What::Inverse => 1.0 / (area * self.unit()),
            _ if self.split => 0.5 * self.unit(),
            _ => self.unit(),
        };
        let factor = T::of(factor);
        if !self.split {
            for (&y, &row) in y.iter().zip(self.rows.iter()) {
                x[row as usize] = y * factor;
            }
        } else {
            let mut light = T::default();
            for (&[plus, minus], &row) in y.as_chunks::<2>().0.iter().zip(self.rows.iter()) {
                x[row as usize] = (plus - minus) * factor;
                light += plus + minus;
            }
            if what == What::Adjoint {
                x[0] += light * factor;
            }
        }
        transform(x);
    }

    fn one<T: Number>(&self, what: What, from: &[T], to: &mut [T], grid: &mut [T]) {
        match what {
            What::Forward => self.forward(from, to, grid),
            What::Adjoint | What::Inverse => self.back(from, to, what),
        }
    }

    /// All results of these values, one after another.
    fn fill<T: Number>(
        &self,
        py: Python<'_>,
        what: What,
        values: &[T],
        made: &mut [T],
    ) -> PyResult<()> {
        let (from, to) = self.lengths(what);
        let grid = if what == What::Forward { self.area() } else { 0 };
        let count = values.len() / from;
        if count * self.area() >= PARALLEL && count > 1 {
            heavy(py, || {
                let pairs = values.par_chunks_exact(from).zip(made.par_chunks_exact_mut(to));
                pairs.for_each_init(
                    || vec![T::default(); grid],
                    |grid, (from, to)| self.one(what, from, to, grid),
                );
                Ok(())
            })
        } else {
            quick(py, || {
                let mut grid = vec![T::default(); grid];
                for (from, to) in values.chunks_exact(from).zip(made.chunks_exact_mut(to)) {
                    self.one(what, from, to, &mut grid);
                }
                Ok(())
            })
        }
    }

    fn apply<'py, T: Number>(
        &self,
        py: Python<'py>,
        what: What,
        values: &Bound<'py, PyArray1<T>>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (from, to) = self.lengths(what);
        let values = values.try_readonly().map_err(|error| refused(error.to_string()))?;
        let values = crate::arrays::slice(&values)?;
        let length = whole("the array", values.len(), from)? * to;
        let Some(out) = out else {
            let mut made = vec![T::default(); length];
            self.fill(py, what, values, &mut made)?;
            return Ok(array(py, made).into_any());
        };
        let wanted = || {
            refused("out is an array of another kind, expected one axis of the type of the values")
        };
        let mut place = out
            .cast::<PyArray1<T>>()
            .map_err(|_| wanted())?
            .try_readwrite()
            .map_err(|error| refused(format!("out: {error}")))?;
        let made = place.as_slice_mut().map_err(|error| refused(format!("out: {error}")))?;
        if made.len() != length {
            return Err(refused(format!("out holds {} values, expected {length}", made.len())));
        }
        self.fill(py, what, values, made)?;
        Ok(out.clone())
    }

    fn of_type<'py>(
        &self,
        py: Python<'py>,
        what: What,
        values: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        if let Ok(values) = values.cast::<PyArray1<f32>>() {
            return self.apply(py, what, values, out);
        }
        match values.cast::<PyArray1<f64>>() {
            Ok(values) => self.apply(py, what, values, out),
            Err(_) => {
                Err(refused("an array of another kind, expected one axis of float32 or float64"))
            }
        }
    }
}

fn transform<T: Number>(grid: &mut [T]) {
    // A side is a power of two, so that the length is one.
    if fwht(grid).is_err() {
        grid.fill(T::default());
    }
}

#[pymethods]
impl Operator {
    #[new]
    fn new(
        n: u64,
        shown: numpy::PyReadonlyArray1<'_, i64>,
        split: bool,
        ortho: bool,
    ) -> PyResult<Self> {
        Ok(Self { rows: rows(side(n)?, &shown)?, split, ortho })
    }

    /// Images of `n * n` values to readings, one after another, into a new array or into `out`.
    #[pyo3(name = "forward", signature = (x, out=None))]
    fn forward_of<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.of_type(py, What::Forward, x, out)
    }

    /// Readings to images by the transpose.
    #[pyo3(signature = (y, out=None))]
    fn adjoint<'py>(
        &self,
        py: Python<'py>,
        y: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.of_type(py, What::Adjoint, y, out)
    }

    /// Readings to images by the pseudo-inverse; of pairs, by the one of their differences.
    #[pyo3(signature = (y, out=None))]
    fn pinv<'py>(
        &self,
        py: Python<'py>,
        y: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.of_type(py, What::Inverse, y, out)
    }
}

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! Every function is a pure function of its arguments: no file, no clock, no thread that outlives a
//! call. Random numbers come from a seed that is an argument or a constant.
//!
//! | module | input | output |
//! |---|---|---|
//! | [`leak`] | readings with light of earlier slots | corrected readings |
//! | [`law`] | readings or differences | one measurement for each Hadamard row, without drop-outs and outliers, and what contradicts the readings |
//! | [`Measurements`] | the same, known to be sound | one measurement for each Hadamard row |
//! | [`Rows`] | numbers of Hadamard rows | checked rows |
//! | [`order`] | the name of an order | rows |
//! | [`fwht`](mod@fwht) | an image | its Hadamard measurements, and back |
//! | [`basis`] | an image | coefficients, most of them nearly zero |
//! | [`omp`] | measurements and a dictionary | a few coefficients that explain the measurements |
//! | [`reconstruct`] | measurements | an image |
//! | [`Repeats`] | measurements of one scene, one after another | their noise |
//! | [`quadrature`] | products with a symmetric matrix | sums over its eigenvalues |
//! | [`gradient`] | an image | a step along its gradient |
//! | [`metrics`] | two images | a number that compares them |
//! | [`backend`] | the name of a backend | a [`Backend`] |
//! | [`Sampling`] | `0.3`, `30%` or `30` | a checked share of the patterns |
//! | [`words`] | a count, a number | the same as people write it |

pub mod gradient;
pub mod law;
pub mod leak;
mod measurements;
pub mod metrics;
pub mod quadrature;
pub mod reconstruct;
mod repeats;
#[cfg(test)]
mod testing;
pub mod words;

pub use law::{Dropout, Outlier};
pub use leak::{Leak, LeakError, Sweep};
pub use measurements::{MeasurementError, Measurements, ShorterSweep};
pub use nirspi_omp::{self as omp, Backend, ParseBackendError, backend};
pub use nirspi_patterns::{
    Basis, FwhtLengthError, Image, NamedOrder, Order, ParseBasisError, ParseOrderError, Rows,
    RowsError, Sampling, SamplingError, Shape, Side, SideError, Size, SizeError, basis, fourier,
    fwht, order, s_matrix,
};
pub use repeats::Repeats;

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! | module | contents |
//! |---|---|
//! | [`Side`], [`Size`] | the size of an image: a power of two, or any |
//! | [`Image`] | pixels, row-major |
//! | [`Rows`] | checked numbers of Hadamard rows |
//! | [`order`] | the order in which patterns are shown |
//! | [`fwht`](mod@fwht) | an image's Hadamard measurements, and back |
//! | [`fourier`] | cosines of each frequency, and the spectrum that they give |
//! | [`s_matrix`] | cyclic S-matrices |
//! | [`basis`] | an image's coefficients, most of them nearly zero |
//! | [`Sampling`] | `0.3`, `30%` or `30`: a checked share of the patterns |

pub mod basis;
pub mod fourier;
pub mod fwht;
mod image;
pub mod order;
mod rows;
pub mod s_matrix;
mod sampling;
mod side;
mod size;
#[cfg(test)]
mod testing;

pub use basis::{Basis, ParseBasisError};
pub use fwht::{FwhtLengthError, fwht};
pub use image::Image;
pub use order::{NamedOrder, Order, ParseOrderError};
pub use rows::{Rows, RowsError};
pub use sampling::{Sampling, SamplingError};
pub use side::{Side, SideError};
pub use size::{Shape, Size, SizeError};

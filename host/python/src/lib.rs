//! The compiled part of the Python package `nirspi`: arrays in, arrays out. The Python files beside this folder make the
//! classes that users meet.
//!
//! # Invariant
//! No call ends the interpreter: bad input is `nirspi.Error` or `OSError` with the library's text, and a panic is a
//! `RuntimeError` (`tests/test_bad_input.py`). Long work runs without the GIL and ends at Ctrl-C ([`work`]).

mod arrays;
mod camera;
mod errors;
mod feed;
mod loaded;
mod made;
mod measurement;
mod metrics;
mod networks;
mod omp;
mod operator;
mod optics;
mod orders;
mod picture;
mod program;
mod reconstruct;
mod recording;
mod trace;
mod work;

use pyo3::prelude::*;

/// The compiled part of `nirspi`.
#[pymodule]
mod _nirspi {
    #[pymodule_export]
    use crate::camera::{Camera, Run};
    #[pymodule_export]
    use crate::errors::Error;
    #[pymodule_export]
    use crate::feed::{Feed, FeedPage, FeedRecorder};
    #[pymodule_export]
    use crate::loaded::{Loaded, load};
    #[pymodule_export]
    use crate::made::provenance;
    #[pymodule_export]
    use crate::measurement::{FlatField, readings};
    #[pymodule_export]
    use crate::metrics::{correlation, fit, psnr, scaled, ssim};
    #[pymodule_export]
    use crate::networks::{deblur, deblur_models, enhance, enhance_readings, fingerprints};
    #[pymodule_export]
    use crate::omp::Dictionary;
    #[pymodule_export]
    use crate::operator::Operator;
    #[pymodule_export]
    use crate::optics::{camera_model, mie, rain};
    #[pymodule_export]
    use crate::orders::{order, orders};
    #[pymodule_export]
    use crate::picture::{picture, sheet};
    #[pymodule_export]
    use crate::program::program;
    #[pymodule_export]
    use crate::reconstruct::{bases, methods, reconstruct, reconstruct_file, reconstruct_matrix};
    #[pymodule_export]
    use crate::recording::read_recording;
    #[pymodule_export]
    use crate::trace::trace;
    #[pymodule_export]
    use crate::work::{devices, panic_for_tests};
}

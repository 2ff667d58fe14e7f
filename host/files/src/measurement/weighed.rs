//! Readings with the weights of their patterns, which are a user's own.

use super::patterns::Patterns;
use crate::provenance::Taken;
use std::sync::Arc;

/// Readings of patterns of a user's own.
#[derive(Debug, Clone, PartialEq)]
pub struct Plain {
    /// What the readings weigh the light with: all patterns, those that were not read included.
    pub patterns: Arc<Patterns>,
    /// The readings, all finite.
    pub values: Vec<f64>,
    /// The pattern of each reading.
    pub places: Vec<usize>,
    /// Patterns that were not read: the file has NaN, or an instrument's word for overload.
    pub not_read: Vec<usize>,
    /// Where the readings come from, without the name of the file.
    pub taken: Taken,
    /// Standard deviation of the noise of a value, if the file says so.
    pub noise: Option<f64>,
    /// What that noise is at most, if more than the values says so: the sums of pairs, or the steps of Fourier patterns.
    pub most_noise: Option<f64>,
    /// What people may not expect, one line each.
    pub notes: Vec<String>,
    /// Whether the values may hold a constant dark level.
    pub dark: bool,
}

/// Which measurements of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Which {
    /// That of [`Selection::index`](super::Selection::index).
    One,
    All,
}

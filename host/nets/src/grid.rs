//! The two grids of images: readings of 32 x 32, and the output of 64 x 64.

/// Side of the readings: that of the instrument's patterns.
pub(crate) const COARSE: usize = nirspi_recon::Side::INSTRUMENT.pixels();

/// Side of the output: twice that of the readings (paper, 2.C).
pub(crate) const FINE: usize = 2 * COARSE;

/// Number of pixels of the output.
pub(crate) const AREA: usize = FINE * FINE;

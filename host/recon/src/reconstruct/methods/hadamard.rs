//! Zero filling: the inverse Walsh-Hadamard transform.

use crate::reconstruct::method::Entry;
use crate::reconstruct::{Method, Reconstruct, ReconstructError, Reconstruction, Report};
use crate::{Image, Measurements, fwht};

/// The method of zero filling.
pub(in super::super) const METHOD: Method = Method(&Entry {
    argument: "hadamard",
    name: "inverse Hadamard transform",
    about: "Inverse Walsh-Hadamard transform; patterns that were not measured count as zero",
    takes: &[],
    with_matrix: None,
    prepare: |_| Ok(Box::new(ZeroFilling { name: "inverse Hadamard transform" })),
});

/// [`hadamard`] as a [`Reconstruct`].
pub(super) struct ZeroFilling {
    pub(super) name: &'static str,
}

impl Reconstruct for ZeroFilling {
    fn name(&self) -> &str {
        self.name
    }

    fn reconstruct(&self, measurements: &Measurements) -> Result<Reconstruction, ReconstructError> {
        Ok(Reconstruction { image: hadamard(measurements), report: Report::new(self.name) })
    }

    fn is_of_each(&self) -> bool {
        true
    }

    fn reconstruct_into(
        &self,
        measurements: &Measurements,
        pixels: &mut [f32],
    ) -> Result<Report, ReconstructError> {
        invert(measurements, pixels);
        Ok(Report::new(self.name))
    }
}

/// Inverts the Walsh-Hadamard transform, with zeros for rows that were not measured.
///
/// From all rows the image is exact. From some rows it is the image of least energy that agrees
/// with them.
#[must_use]
pub fn hadamard(measurements: &Measurements) -> Image {
    let side = measurements.side();
    let mut pixels = vec![0.0; side.area()];
    invert(measurements, &mut pixels);
    Image::new(side, pixels)
}

/// Writes the image of [`hadamard`] to `pixels`.
fn invert(measurements: &Measurements, pixels: &mut [f32]) {
    let area = measurements.side().area();
    assert_eq!(pixels.len(), area, "places for the pixels");
    let mut grid = vec![0.0_f64; area];
    for (&row, &value) in measurements.rows().iter().zip(measurements.values()) {
        grid[row as usize] = value;
    }
    fwht::transform(&mut grid);
    // Exact, as the number of pixels is a power of two.
    let scale = 1.0 / area as f64;
    for (pixel, value) in pixels.iter_mut().zip(grid) {
        *pixel = (value * scale) as f32;
    }
}

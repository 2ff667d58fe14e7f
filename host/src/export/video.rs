//! A recording as a video: the images of its frames.

use super::{ExportError, Whole};
use crate::files::output::write_atomic;
use crate::picture::{Unit, video};
use nirspi_recon::reconstruct::{Method, MethodSettings};
use nirspi_recon::{Image, Measurements};
use std::path::Path;

/// The most images. A longer recording gives sums of neighbouring frames.
const MOST: usize = 1000;

/// Writes the video. Returns the number of images.
pub(super) fn apng(whole: &Whole, out: &Path) -> Result<usize, ExportError> {
    let frames = whole.frames();
    let each = frames.div_ceil(MOST);
    let problem = |frame| {
        let path = whole.path.clone();
        move |problem| ExportError::Image { path, frame, problem }
    };
    let method = Method::default().prepare(&MethodSettings::default()).map_err(problem(0))?;
    let mut images: Vec<Image> = Vec::new();
    let mut sum: Vec<f64> = Vec::new();
    whole.each(|frame| {
        let values = frame.measurements.values();
        if sum.is_empty() {
            sum = values.to_vec();
        } else {
            sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
        }
        let in_sum = frame.index % each + 1;
        if in_sum == each || frame.index + 1 == frames {
            // A mean of one frame is the frame itself.
            sum.iter_mut().for_each(|value| *value /= in_sum as f64);
            let mean = Measurements::from_differential(frame.measurements.rows(), &sum)
                .map_err(|problem| whole.integrate(problem.into()))?;
            let made = method.reconstruct(&mean).map_err(problem(frame.index))?;
            images.push(whole.source.flattened(made.image));
            sum.clear();
        }
        Ok(())
    })?;
    let header = format!("{}, {frames} frames", whole.path.display());
    write_atomic(out, &video(&header, &images, Unit::AdcCounts))?;
    Ok(images.len())
}

//! A recording as a video: the images of its frames.

use super::{ExportError, Whole};
use crate::files::output::{Existing, write_result};
use crate::picture::{Unit, video};
use crate::provenance::Provenance;
use nirspi_recon::reconstruct::{Method, stack};
use nirspi_recon::{Image, Measurements};
use std::path::Path;

/// The most images. A longer recording gives sums of neighbouring frames.
const MOST: usize = 1000;

/// Means of neighbouring frames: groups of one size, and a smaller one of what is left.
struct Groups {
    frames: usize,
    /// Frames of a group.
    each: usize,
    /// Frames so far.
    seen: usize,
    /// The sum of the frames of the group that has begun.
    sum: Vec<f64>,
}

impl Groups {
    /// At most `most` groups of so many frames.
    fn new(frames: usize, most: usize) -> Self {
        Self { frames, each: frames.div_ceil(most), seen: 0, sum: Vec::new() }
    }

    /// Adds the values of the next frame. After the last frame of a group, returns the mean of the group and
    /// its number of frames.
    fn add(&mut self, values: &[f64]) -> Option<(Vec<f64>, usize)> {
        if self.sum.is_empty() {
            self.sum = values.to_vec();
        } else {
            self.sum.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
        }
        let in_group = self.seen % self.each + 1;
        self.seen += 1;
        if in_group < self.each && self.seen < self.frames {
            return None;
        }
        // A mean of one frame is the frame itself.
        let mut mean = std::mem::take(&mut self.sum);
        mean.iter_mut().for_each(|value| *value /= in_group as f64);
        Some((mean, in_group))
    }
}

/// Writes the video. Returns the number of images.
pub(super) fn apng(
    whole: &Whole,
    out: &Path,
    existing: Existing<'_>,
    provenance: &Provenance,
) -> Result<usize, ExportError> {
    let frames = whole.frames();
    let mut groups = Groups::new(frames, MOST);
    let problem = |problem| ExportError::Images { path: whole.path.clone(), problem };
    let method = Method::default().prepare(&super::settings()).map_err(problem)?;
    let mut means = Vec::new();
    whole.each(|_, measurements| {
        if let Some((mean, frames)) = groups.add(measurements.values()) {
            let mean = Measurements::from_differential(measurements.rows(), &mean);
            let noise = measurements.noise().map(|noise| noise / (frames as f64).sqrt());
            let mean = match noise {
                Some(noise) => mean.and_then(|mean| mean.with_noise(noise)),
                None => mean,
            };
            means.push(mean.map_err(|problem| whole.integrate(problem.into()))?);
        }
        Ok(())
    })?;
    let made = stack(&*method, &means).map_err(problem)?;
    let images: Vec<Image> =
        made.into_iter().map(|made| whole.source.flattened(made.image)).collect();
    let header = format!("{}, {frames} frames", whole.path.display());
    let bytes = video(&header, &images, Unit::AdcCounts, provenance);
    write_result(out, existing, &bytes)?;
    Ok(images.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The means of frames whose values are 0, 1, 2, ... and ten times that.
    fn means(frames: u32, most: usize) -> Vec<Vec<f64>> {
        let mut groups = Groups::new(frames as usize, most);
        let add = |k| groups.add(&[k, 10.0 * k]).map(|(mean, _)| mean);
        (0..frames).map(f64::from).filter_map(add).collect()
    }

    #[test]
    fn every_frame_is_in_one_image_and_the_last_group_may_be_smaller() {
        assert_eq!(means(3, 1000), [[0.0, 0.0], [1.0, 10.0], [2.0, 20.0]]);
        assert_eq!(means(7, 3), [[1.0, 10.0], [4.0, 40.0], [6.0, 60.0]]);
        assert_eq!(means(8, 3), [[1.0, 10.0], [4.0, 40.0], [6.5, 65.0]]);
        assert_eq!(means(6, 3), [[0.5, 5.0], [2.5, 25.0], [4.5, 45.0]]);
        for frames in [1, 999, 1000, 1001, 2000, 2001, 12_345] {
            let means = means(frames, MOST);
            let each = (frames as usize).div_ceil(MOST);
            assert_eq!(means.len(), (frames as usize).div_ceil(each));
            assert!(means.len() <= MOST, "{frames}");
        }
    }
}

//! A recording as a video: the images of its frames.

use super::{ExportError, Whole, images};
use crate::files::output::{Existing, write_result};
use crate::picture::{Unit, video};
use crate::provenance::Provenance;
use nirspi_recon::Image;
use std::path::Path;

/// The most images. A longer recording gives sums of neighbouring frames.
const MOST: usize = 1000;

/// Number of neighbouring frames in each image but the last, which may have fewer.
fn of_one_image(frames: usize) -> usize {
    frames.div_ceil(MOST)
}

/// Writes the video. Returns the number of images.
pub(super) fn apng(
    (whole, input): (&Whole<'_>, &Path),
    out: &Path,
    existing: Existing<'_>,
    provenance: &Provenance,
) -> Result<usize, ExportError> {
    let frames = whole.frames.len();
    let each = of_one_image(frames);
    let mut all: Vec<Image> = Vec::new();
    let mut number = 0;
    let begins = move |_| {
        number += 1;
        (number - 1) % each == 0
    };
    images::each((whole, input), begins, |_, solved| {
        all.push(solved.image);
        Ok(())
    })?;
    let header = format!("{}, {frames} frames", input.display());
    let bytes = video(&header, &all, Unit::AdcCounts, provenance);
    write_result(out, existing, &bytes)?;
    Ok(all.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_video_has_as_many_images_as_it_may() {
        for (frames, images) in [
            (1_usize, 1),
            (999, 999),
            (1000, 1000),
            (1001, 501),
            (2000, 1000),
            (2001, 667),
            (12_345, 950),
        ] {
            assert_eq!(frames.div_ceil(of_one_image(frames)), images, "{frames}");
        }
    }
}

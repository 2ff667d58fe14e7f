//! The learned stages on images of unknown white level: one image, or the frames of a video.

use super::{Enhance, EnhanceError, EnhancedImage, ImageContext, Warning, White, warnings};
use crate::stage_times::StageTimes;
use nirspi_nets::{Device, WeightsError};
use nirspi_recon::{Image, Rows};
use serde::Serialize;
use thiserror::Error;

/// The results of the learned stages.
#[derive(Debug, Serialize)]
pub struct FrameReport {
    /// The image's value that was used as white.
    white: f32,
    /// Estimated blur in pixels of the 64 x 64 grid.
    sigma_px: f32,
    /// Estimated noise of a pixel; white is 1.
    noise: f32,
    /// Distance of the readings from the readings of the result, divided by their noise.
    inconsistency: f32,
    /// Reasons not to trust the result.
    pub warnings: Vec<String>,
    /// Short forms of the warnings, for the picture.
    #[serde(skip)]
    pub short: Vec<String>,
}

impl FrameReport {
    fn of(image: &EnhancedImage, warnings: &[Warning]) -> Self {
        Self {
            white: image.white,
            sigma_px: image.blur_px,
            noise: image.noise,
            inconsistency: image.inconsistency,
            short: warnings.iter().map(|warning| warning.short().to_owned()).collect(),
            warnings: warnings.iter().map(Warning::to_string).collect(),
        }
    }

    /// Whether there is a reason not to trust the result.
    #[must_use]
    pub fn warns(&self) -> bool {
        !self.warnings.is_empty()
    }

    /// One line for the user.
    #[must_use]
    pub fn line(&self) -> String {
        format!(
            "enhanced: blur {:.2} px, noise {:.4}, inconsistency {:.2}; white is {:.4} of the image's units",
            self.sigma_px, self.noise, self.inconsistency, self.white
        )
    }
}

/// Images that are enhanced at a time: enough for the networks, few enough for the memory.
const AT_A_TIME: usize = 256;

/// Why frames are not enhanced.
#[derive(Debug, Error)]
pub enum FramesError {
    /// There is no image.
    #[error("no image")]
    Empty,
    /// The built-in weights cannot be used.
    #[error(transparent)]
    Weights(#[from] WeightsError),
    /// The learned stages failed.
    #[error(transparent)]
    Enhance(#[from] EnhanceError),
}

/// Enhances the image of a frame, and says whether the result can be trusted. `white` is the level of
/// a white target in the image's units; `known` says of which Hadamard rows the image was made, how
/// these were read, and which distances a sensor gave at the same time.
///
/// # Errors
/// As [`Enhance::enhance`].
pub fn enhance_frame(
    enhance: &Enhance,
    image: &Image,
    white: f32,
    known: &ImageContext<'_>,
) -> Result<(EnhancedImage, Vec<Warning>), EnhanceError> {
    let made = enhance.enhance(image, White::Known(white), known)?;
    let doubts = warnings(&made);
    Ok((made, doubts))
}

/// Enhances images of 32 x 32 or 64 x 64 pixels, each with the Hadamard rows from which it was
/// made. Each result is 64 x 64 pixels in [0, 1]. All images have the same white level, the median
/// of their own levels, so that a video does not flicker.
///
/// # Errors
/// [`FramesError`] if there is no image, or the learned stages fail.
pub fn enhance_frames(
    frames: &[(&Image, &Rows)],
    times: &mut StageTimes,
) -> Result<(Vec<f32>, Vec<FrameReport>), FramesError> {
    enhance_frames_by(&Enhance::built_in(&Device::cpu())?, frames, times)
}

/// As [`enhance_frames`], by learned stages that the caller keeps.
///
/// # Errors
/// As [`enhance_frames`].
pub fn enhance_frames_by(
    enhance: &Enhance,
    frames: &[(&Image, &Rows)],
    times: &mut StageTimes,
) -> Result<(Vec<f32>, Vec<FrameReport>), FramesError> {
    if frames.is_empty() {
        return Err(FramesError::Empty);
    }
    let white = White::Brightest.median_level(frames.iter().map(|(image, _)| *image));
    let (mut pixels, mut reports) = (Vec::new(), Vec::new());
    times.time("enhance", || -> Result<(), FramesError> {
        let like =
            |a: &(&Image, &Rows), b: &(&Image, &Rows)| a.1 == b.1 && a.0.side() == b.0.side();
        for alike in frames.chunk_by(like).flat_map(|alike| alike.chunks(AT_A_TIME)) {
            let images: Vec<&Image> = alike.iter().map(|(image, _)| *image).collect();
            for (mut made, report) in enhance_alike(enhance, &images, alike[0].1, white)? {
                reports.push(report);
                pixels.append(&mut made);
            }
        }
        Ok(())
    })?;
    Ok((pixels, reports))
}

/// Enhances images of one size, made of the same rows, of one white level. Of each: 64 x 64 pixels in [0, 1], and the report.
///
/// # Errors
/// As [`Enhance::enhance_all`].
pub fn enhance_alike(
    enhance: &Enhance,
    images: &[&Image],
    rows: &Rows,
    white: f32,
) -> Result<Vec<(Vec<f32>, FrameReport)>, FramesError> {
    let context = ImageContext { rows: Some(rows), ..ImageContext::default() };
    let made = enhance.enhance_all(images, white, &context)?;
    let told = |made: EnhancedImage| {
        let report = FrameReport::of(&made, &warnings(&made));
        (made.pixels, report)
    };
    Ok(made.into_iter().map(told).collect())
}

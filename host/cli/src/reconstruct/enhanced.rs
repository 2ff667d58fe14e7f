//! `nirspi reconstruct --enhance`: the learned stages on images whose white level is not known.

use super::super::report::StageTimes;
use anyhow::{Context, Result, bail};
use nirspi::imaging::{Enhance, EnhancedImage, ImageContext, Warning, White, warnings};
use nirspi_nets::Device;
use nirspi_recon::{Image, Rows};
use serde::Serialize;

/// What the learned stages found.
#[derive(Debug, Serialize)]
pub struct Report {
    /// The image's value that was taken for white.
    white: f32,
    /// Blur in pixels of the 64 x 64 grid, as estimated.
    sigma_px: f32,
    /// Noise of a pixel, white being 1, as estimated.
    noise: f32,
    /// Distance of the readings from those of the result, over their noise.
    inconsistency: f32,
    /// Reasons not to trust the result.
    pub warnings: Vec<String>,
    /// The same in a few words, for the picture.
    #[serde(skip)]
    pub short: Vec<String>,
}

impl Report {
    fn of(image: &EnhancedImage) -> Self {
        let warnings = warnings(image);
        Self {
            white: image.white,
            sigma_px: image.blur_px,
            noise: image.noise,
            inconsistency: image.inconsistency,
            short: warnings.iter().map(|warning| warning.short().to_owned()).collect(),
            warnings: warnings.iter().map(Warning::to_string).collect(),
        }
    }

    /// One line for people.
    pub fn line(&self) -> String {
        format!(
            "enhanced: blur {:.2} px, noise {:.4}, inconsistency {:.2}; white is {:.4} of the image's units",
            self.sigma_px, self.noise, self.inconsistency, self.white
        )
    }
}

/// Enhances images of 32 x 32 or 64 x 64, each with the Hadamard rows that it was made from: 64 x 64 pixels in [0, 1]
/// each. White is the same for all, so that a video does not flicker: the median of what each would take for it.
pub fn run(frames: &[(&Image, &Rows)], times: &mut StageTimes) -> Result<(Vec<f32>, Vec<Report>)> {
    if frames.is_empty() {
        bail!("--enhance: no image");
    }
    let white = White::Brightest.median_level(frames.iter().map(|(image, _)| *image));
    let enhance = Enhance::built_in(&Device::cpu())?;
    let (mut pixels, mut reports) = (Vec::new(), Vec::new());
    times.time("enhance", || -> Result<()> {
        for (image, rows) in frames {
            let known = ImageContext { rows: Some(rows), ..ImageContext::default() };
            let mut made =
                enhance.enhance(image, White::Known(white), &known).context("--enhance")?;
            reports.push(Report::of(&made));
            pixels.append(&mut made.pixels);
        }
        Ok(())
    })?;
    Ok((pixels, reports))
}

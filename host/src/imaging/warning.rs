//! Reasons to distrust a picture: one rule for every command, page and file.

use super::EnhancedImage;
use nirspi_nets::consistency::{CONTRADICTED, is_contradicted};
use std::fmt;

/// The largest blur, in pixels of the 64 x 64 grid, for which the networks were trained
/// (`host/nets/weights/README.md`).
const TRAINED_BLUR_PX: f32 = 4.2;
/// The largest noise of a pixel for which the networks were trained; white is 1.
const TRAINED_NOISE: f32 = 0.1;

/// A reason not to trust a picture.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Warning {
    /// The readings contradict the enhanced image.
    Inconsistent {
        /// Distance of the readings from the readings of the image, divided by their noise.
        inconsistency: f32,
    },
    /// The blur is larger than the networks were trained to remove.
    Blurred {
        /// Standard deviation in pixels of the 64 x 64 grid.
        blur_px: f32,
    },
    /// The noise is too large for the light.
    Dim {
        /// Noise of one pixel; white is 1.
        noise: f32,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Inconsistent { inconsistency } => write!(
                f,
                "the readings contradict the enhanced image (inconsistency {inconsistency:.2}, expected at most \
                 {CONTRADICTED}): do not trust its strokes; more light helps"
            ),
            Self::Blurred { blur_px } => write!(
                f,
                "blurred by {blur_px:.1} px, more than the {TRAINED_BLUR_PX} px that the networks have learned: move the \
                 target to where the lens is focused"
            ),
            Self::Dim { noise } => write!(
                f,
                "too little light: the noise is {:.0} % of white, expected at most {:.0} %; capture more frames or come \
                 nearer",
                100.0 * noise,
                100.0 * TRAINED_NOISE
            ),
        }
    }
}

impl Warning {
    /// A few words for the picture itself.
    #[must_use]
    pub fn short(&self) -> &'static str {
        match self {
            Self::Inconsistent { .. } => "readings contradict it",
            Self::Blurred { .. } => "too blurred",
            Self::Dim { .. } => "too little light",
        }
    }
}

/// All warnings for this picture, worst first.
#[must_use]
pub fn warnings(image: &EnhancedImage) -> Vec<Warning> {
    let EnhancedImage { inconsistency, blur_px, noise, .. } = *image;
    // NaN counts as beyond the limit.
    let beyond = |value: f32, limit: f32| value > limit || value.is_nan();
    [
        is_contradicted(inconsistency).then_some(Warning::Inconsistent { inconsistency }),
        beyond(noise, TRAINED_NOISE).then_some(Warning::Dim { noise }),
        beyond(blur_px, TRAINED_BLUR_PX).then_some(Warning::Blurred { blur_px }),
    ]
    .into_iter()
    .flatten()
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(inconsistency: f32, blur_px: f32, noise: f32) -> EnhancedImage {
        EnhancedImage {
            scaled: Vec::new(),
            white: 1.0,
            fused: None,
            pixels: Vec::new(),
            blur_px,
            estimated_blur_px: blur_px,
            noise,
            inconsistency,
            spread: None,
            half_width: None,
            no_interval: None,
        }
    }

    #[test]
    fn a_good_picture_has_no_warning_and_each_fault_its_own() {
        assert!(warnings(&image(1.1, 2.0, 0.03)).is_empty());
        let shorts = |image| warnings(&image).iter().map(Warning::short).collect::<Vec<_>>();
        assert_eq!(shorts(image(1.3, 2.0, 0.03)), ["readings contradict it"]);
        assert_eq!(shorts(image(1.0, 4.5, 0.03)), ["too blurred"]);
        assert_eq!(shorts(image(1.0, 2.0, 0.2)), ["too little light"]);
        assert_eq!(shorts(image(f32::NAN, 9.0, 0.2)).len(), 3);
    }

    #[test]
    fn a_warning_is_one_line_with_its_number() {
        let all = warnings(&image(2.5, 9.25, 0.2));
        let lines: Vec<String> = all.iter().map(ToString::to_string).collect();
        assert!(lines[0].contains("2.50") && lines[1].contains("20 %") && lines[2].contains("9.2"));
        assert!(lines.iter().all(|line| line.lines().count() == 1));
    }
}

//! Estimates white in an image of unknown scale: the mean of the brightest 2 x 2 pixels.
//!
//! Black needs no estimate, because a differential measurement reads 0 without light. One bright
//! pixel alone may be noise. A percentile of all pixels says nothing about a letter on a dark
//! ground.

use nirspi_recon::Image;

/// The smallest step of white that counts as a change of the scene; a smaller step counts as noise.
const JUMP: f32 = 0.25;
/// Share of a small change of white that a [`SteadyWhite`] takes over from each image.
const SHARE: f32 = 0.1;

/// The largest mean of 2 x 2 neighbours among pixels in rows of `width`; 0 for an image without light.
#[must_use]
#[cfg(feature = "enhance")]
pub fn brightest(pixels: &[f32], width: usize) -> f32 {
    let corners = (0..pixels.len().saturating_sub(width)).filter(|at| at % width + 1 < width);
    let means = corners.map(|at| {
        (pixels[at] + pixels[at + 1] + pixels[at + width] + pixels[at + width + 1]) / 4.0
    });
    means.fold(0.0, f32::max)
}

/// The white level of a live view. The level follows a change of the scene at once and noise only
/// slowly, so that the view does not flicker
/// (`tests::white_follows_the_scene_at_once_and_noise_hardly`).
#[derive(Debug, Clone, Copy, Default)]
pub struct SteadyWhite {
    level: f32,
}

impl SteadyWhite {
    /// The white level for an image whose own estimate is `found`.
    pub fn follow(&mut self, found: f32) -> f32 {
        let change = found - self.level;
        self.level =
            if change.abs() > JUMP * self.level { found } else { self.level + SHARE * change };
        self.level
    }
}

/// The image as shares of white: each pixel divided by the reading of a pixel that sees a white
/// sheet. Nothing is clamped, so noise stays below 0 and above 1.
#[must_use]
pub fn share_of_white(image: &Image, white: f32) -> Image {
    Image::new(image.side(), image.pixels().iter().map(|&value| value / white).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_recon::Side;

    #[test]
    #[cfg(feature = "enhance")]
    fn one_bright_pixel_is_not_white_and_four_are() {
        let mut pixels = vec![0.0; 64];
        pixels[9] = 8.0;
        assert_eq!(brightest(&pixels, 8), 2.0);
        for at in [10, 17, 18] {
            pixels[at] = 8.0;
        }
        assert_eq!(brightest(&pixels, 8), 8.0);
        assert_eq!((brightest(&[-1.0; 16], 4), brightest(&[1.0], 1)), (0.0, 0.0));
    }

    #[test]
    fn shares_of_white_keep_the_noise_below_black_and_above_white() {
        let counts = vec![-30.0, 0.0, 150.0, 330.0];
        let shares = share_of_white(&Image::new(Side::new(2).unwrap(), counts), 300.0);
        assert_eq!(shares.pixels(), [-0.1, 0.0, 0.5, 1.1]);
    }

    #[test]
    fn white_follows_the_scene_at_once_and_noise_hardly() {
        let mut white = SteadyWhite::default();
        assert_eq!(white.follow(100.0), 100.0);
        assert_eq!(white.follow(120.0), 102.0);
        assert_eq!(white.follow(10.0), 10.0);
        for _ in 0..100 {
            white.follow(11.0);
        }
        assert!((white.follow(11.0) - 11.0).abs() < 0.01);
    }
}

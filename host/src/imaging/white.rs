//! The level of white in an image of unknown scale: the mean of the brightest 2 x 2 pixels.
//!
//! Black needs no estimate: a differential measurement reads 0 without light. One bright pixel alone may be noise, and
//! a percentile of all pixels says nothing about a letter on a dark ground.

/// A step of white that the scene makes; below it is noise.
const JUMP: f32 = 0.25;
/// Share of what white has moved by noise that a [`SteadyWhite`] takes over from an image.
const SHARE: f32 = 0.1;

/// The largest mean of 2 x 2 neighbours among `side` x `side` pixels; 0 where there is no light.
#[must_use]
pub fn brightest(pixels: &[f32], side: usize) -> f32 {
    let corners =
        (0..side.saturating_sub(1)).flat_map(|y| (0..side - 1).map(move |x| y * side + x));
    let means = corners
        .map(|at| (pixels[at] + pixels[at + 1] + pixels[at + side] + pixels[at + side + 1]) / 4.0);
    means.fold(0.0, f32::max)
}

/// The white of a live view: it follows the scene at once, and noise hardly, so that nothing flickers.
#[derive(Debug, Clone, Copy, Default)]
pub struct SteadyWhite {
    level: f32,
}

impl SteadyWhite {
    /// The white for an image whose own is `found`.
    pub fn follow(&mut self, found: f32) -> f32 {
        let change = found - self.level;
        self.level =
            if change.abs() > JUMP * self.level { found } else { self.level + SHARE * change };
        self.level
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
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

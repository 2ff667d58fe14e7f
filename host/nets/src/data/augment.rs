//! Augmentation: a changed view of an image, moved, bent a little, or on another ground.
//!
//! # Invariant
//! Values stay in `[0, 1]` (`tests::a_view_stays_within_range_and_is_the_same_for_the_same_seed`),
//! and a sharp edge stays sharp, because the networks learn sharp edges
//! (`tests::a_bent_character_keeps_its_edges_sharp`). A bent character is therefore sampled at 4 x
//! 4 points per pixel, and its grey rim is narrowed to its former width before averaging.

use super::canvas::{Surface, draw};
use super::{AREA_PX, Kind, SIDE_PX};
use rand::{Rng, RngExt};

/// Limits of the changes. The default suits characters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Augmentation {
    /// Share of the images that are bent as well as moved.
    pub bent: f32,
    /// Largest shift in each direction, in whole pixels.
    pub shift_px: i32,
    /// Largest turn, in degrees.
    pub turn_deg: f32,
    /// Largest relative change of width and of height.
    pub stretch: f32,
    /// Largest shear.
    pub shear: f32,
    /// Share of the characters on a surface instead of on black.
    pub on_ground: f32,
    /// Share of the photographs that are shown as negatives.
    pub inverted: f32,
}

impl Default for Augmentation {
    fn default() -> Self {
        Self {
            bent: 0.6,
            shift_px: 4,
            turn_deg: 8.0,
            stretch: 0.2,
            shear: 0.15,
            on_ground: 0.2,
            inverted: 0.5,
        }
    }
}

/// Steepness of the rim of a bent character: a rim that bilinear sampling spreads over two pixels
/// is narrowed to half a pixel.
const STEEPNESS: f32 = 4.0;

impl Augmentation {
    /// A changed view of `image` (64 x 64 levels): 4096 values in `[0, 1]`.
    ///
    /// # Panics
    /// If the image is not 64 x 64; images of a stack always are.
    #[must_use]
    pub fn view(&self, image: &[u8], kind: Kind, rng: &mut impl Rng) -> Vec<f32> {
        assert_eq!(image.len(), AREA_PX, "levels of a 64 x 64 image");
        let shift = [(); 2].map(|()| rng.random_range(-self.shift_px..=self.shift_px) as f32);
        let bent = rng.random::<f32>() < self.bent;
        let values =
            if bent { self.bend(image, kind, shift, rng) } else { moved(image, kind, shift) };
        match kind {
            Kind::Drawn if rng.random::<f32>() < self.on_ground => on_ground(&values, rng),
            Kind::Drawn => values,
            Kind::Photograph => {
                let negative = rng.random::<f32>() < self.inverted;
                let gain = rng.random_range(0.75..1.25_f32);
                let offset = rng.random_range(-0.1..0.1_f32);
                let exposed = |v: f32| {
                    let v = if negative { 1.0 - v } else { v };
                    (gain * (v - 0.5) + 0.5 + offset).clamp(0.0, 1.0)
                };
                values.into_iter().map(exposed).collect()
            }
        }
    }

    /// Applies a small affine map about the centre.
    fn bend(&self, image: &[u8], kind: Kind, shift: [f32; 2], rng: &mut impl Rng) -> Vec<f32> {
        let mut within = |limit: f32| limit * rng.random_range(-1.0..=1.0_f32);
        let (sin, cos) = within(self.turn_deg).to_radians().sin_cos();
        let (wide, high) = (within(self.stretch).exp(), within(self.stretch).exp());
        let shear = within(self.shear);
        let centre = SIDE_PX as f32 / 2.0;
        draw(|x, y| {
            let (x, y) = (x - centre - shift[0], y - centre - shift[1]);
            let (x, y) = (cos * x + sin * y, cos * y - sin * x);
            let v = bilinear(image, kind, (x + shear * y) / wide + centre, y / high + centre);
            match kind {
                Kind::Drawn => (STEEPNESS * (v - 0.5) + 0.5).clamp(0.0, 1.0),
                Kind::Photograph => v,
            }
        })
    }
}

/// Level of a whole pixel. Beyond the edge a character continues black, a photograph with its edge
/// pixel.
fn level(image: &[u8], kind: Kind, column: i32, row: i32) -> f32 {
    let last = SIDE_PX as i32 - 1;
    let (inner_column, inner_row) = (column.clamp(0, last), row.clamp(0, last));
    if kind == Kind::Drawn && (inner_column, inner_row) != (column, row) {
        return 0.0;
    }
    f32::from(image[inner_row as usize * SIDE_PX + inner_column as usize]) / 255.0
}

/// Level at a point, in pixels from the corner; pixel centres are at halves.
fn bilinear(image: &[u8], kind: Kind, x: f32, y: f32) -> f32 {
    let (x, y) = (x - 0.5, y - 0.5);
    let (column, row) = (x.floor(), y.floor());
    let (right, down) = (x - column, y - row);
    let at = |dx: i32, dy: i32| level(image, kind, column as i32 + dx, row as i32 + dy);
    let upper = at(0, 0) * (1.0 - right) + at(1, 0) * right;
    let lower = at(0, 1) * (1.0 - right) + at(1, 1) * right;
    upper * (1.0 - down) + lower * down
}

/// The image moved by whole pixels, without interpolation.
fn moved(image: &[u8], kind: Kind, shift: [f32; 2]) -> Vec<f32> {
    let from = |at: usize, shift: f32| at as i32 - shift as i32;
    (0..AREA_PX)
        .map(|at| level(image, kind, from(at % SIDE_PX, shift[0]), from(at / SIDE_PX, shift[1])))
        .collect()
}

/// The character as paint of one brightness on a surface of another, as on a sign.
fn on_ground(mask: &[f32], rng: &mut impl Rng) -> Vec<f32> {
    let mut surface =
        |level: f32| Surface { level, slope: [(); 2].map(|()| rng.random_range(-0.25..0.25_f32)) };
    let (mut ground, mut ink) = (surface(0.0), surface(0.0));
    ground.level = rng.random();
    // The two brightnesses differ enough to be visible.
    let apart = rng.random_range(0.25..0.75_f32);
    ink.level = if ground.level < 0.5 { ground.level + apart } else { ground.level - apart };
    mask.iter()
        .enumerate()
        .map(|(at, &share)| {
            let (x, y) = ((at % SIDE_PX) as f32, (at / SIDE_PX) as f32);
            ground.at(x, y) * (1.0 - share) + ink.at(x, y) * share
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Purpose, stream};
    use proptest::prelude::*;

    /// A bright disc in the middle.
    fn disc() -> Vec<u8> {
        (0..AREA_PX)
            .map(|at| {
                let (x, y) = ((at % SIDE_PX) as f32 - 31.5, (at / SIDE_PX) as f32 - 31.5);
                if x.hypot(y) < 18.0 { 255 } else { 0 }
            })
            .collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn a_view_stays_within_range_and_is_the_same_for_the_same_seed(
            seed: u64, levels in prop::collection::vec(any::<u8>(), AREA_PX), drawn: bool
        ) {
            let kind = if drawn { Kind::Drawn } else { Kind::Photograph };
            let view = || {
                Augmentation::default().view(&levels, kind, &mut stream(seed, Purpose::Training, 0))
            };
            let first = view();
            prop_assert!(first.iter().all(|v| (0.0..=1.0).contains(v)));
            prop_assert_eq!(first, view());
        }
    }

    #[test]
    fn a_bent_character_keeps_its_edges_sharp() {
        let bent = Augmentation { bent: 1.0, on_ground: 0.0, ..Augmentation::default() };
        for index in 0..8 {
            let view = bent.view(&disc(), Kind::Drawn, &mut stream(1, Purpose::Training, index));
            let grey = view.iter().filter(|v| (0.1..0.9).contains(*v)).count();
            let bright = view.iter().filter(|v| **v >= 0.9).count();
            // A rim of one pixel around a disc of diameter 18 has 113 pixels; a rim of two, as
            // without sharpening, 226.
            assert!(bright > 600 && grey < 140, "{bright} bright, {grey} grey");
        }
    }

    #[test]
    fn a_shift_alone_moves_levels_as_they_are() {
        let plain = Augmentation { bent: 0.0, on_ground: 0.0, ..Augmentation::default() };
        let view = plain.view(&disc(), Kind::Drawn, &mut stream(3, Purpose::Training, 0));
        let bright = disc().iter().filter(|v| **v == 255).count();
        assert!(view.iter().all(|v| *v == 0.0 || *v == 1.0));
        assert_eq!(view.iter().filter(|v| **v == 1.0).count(), bright);
    }
}

//! Deblurring with another blur in each part of an image: what a depth map says about defocus.
//!
//! The networks and the classical methods remove one blur from a whole image. [`BlurZones`] cuts
//! the image into zones of nearly equal blur; the caller deblurs the whole image once for each
//! zone, and [`BlurZones::blend`] takes each zone from the image that was made for the zone's blur.
//!
//! # Invariant
//! The weights of all zones add up to 1 at each pixel, so equal images blend to the same image
//! (`tests::equal_images_blend_to_themselves`).

use crate::blur::Blur;
use crate::enhance::{EnhanceError, Enhanced, Enhancer, Options};
use crate::estimate::Known;
use crate::fusion::{self, DepthMaps};
use crate::images::Images;

/// Side of the images that are blended.
const SIDE: usize = crate::grid::FINE;

/// Blurs that differ by less than this are one zone, in pixels of the 64 x 64 grid. The estimator
/// of blur is no finer.
const APART_PX: f32 = 0.3;

/// Width of the seam between zones, a standard deviation in pixels of the 64 x 64 grid: a pixel of
/// the readings.
const SEAM_PX: f32 = 1.0;

/// Zones of nearly equal blur in an image of 64 x 64.
#[derive(Debug, Clone, PartialEq)]
pub struct BlurZones {
    widths_px: Vec<f32>,
    /// Weight of each zone at each pixel.
    weights: Vec<Vec<f32>>,
}

impl BlurZones {
    /// Zones from a map of the blur, a square of a side that divides 64: a standard deviation in
    /// pixels of the 64 x 64 grid at each place. A place with NaN, whose distance is not known, is
    /// given the blur of most other places. `None` if no place has a blur, or the map has another
    /// shape.
    #[must_use]
    pub fn new(map_px: &[f32]) -> Option<Self> {
        let side = map_px.len().isqrt();
        if side * side != map_px.len() || side == 0 || !SIDE.is_multiple_of(side) {
            return None;
        }
        let known = |width: &f32| width.is_finite() && *width >= 0.0;
        let mut sorted: Vec<f32> = map_px.iter().copied().filter(known).collect();
        sorted.sort_unstable_by(f32::total_cmp);
        let mut zones: Vec<Vec<f32>> = Vec::new();
        for width in sorted {
            match zones.last_mut() {
                Some(zone) if width - zone[0] < APART_PX => zone.push(width),
                _ => zones.push(vec![width]),
            }
        }
        let most = (0..zones.len()).max_by_key(|&zone| zones[zone].len())?;
        let zone_of = |width: f32| match known(&width) {
            true => zones.partition_point(|zone| zone[0] <= width) - 1,
            false => most,
        };
        let blown_up = SIDE / side;
        let place = |at: usize| at / SIDE / blown_up * side + at % SIDE / blown_up;
        let of_pixel: Vec<usize> = (0..SIDE * SIDE).map(|at| zone_of(map_px[place(at)])).collect();
        let seam = Blur::new(SIDE, SIDE, SEAM_PX);
        let weight = |zone: usize| {
            let inside: Vec<f32> =
                of_pixel.iter().map(|&of| f32::from(u8::from(of == zone))).collect();
            seam.apply(&inside)
        };
        Some(Self {
            weights: (0..zones.len()).map(weight).collect(),
            widths_px: zones.iter().map(|zone| zone[zone.len() / 2]).collect(),
        })
    }

    /// The blur of each zone, the smallest first: standard deviations in pixels of the 64 x 64
    /// grid.
    #[must_use]
    pub fn widths_px(&self) -> &[f32] {
        &self.widths_px
    }

    /// What is known about the blur of each zone. Several zones: exactly the blur of the distance,
    /// because an estimate of the whole image mixes the zones. One zone: the blur of the distance
    /// or the estimate, whichever is larger.
    pub fn known(&self) -> impl Iterator<Item = Known> + '_ {
        let alone = self.widths_px.len() == 1;
        let of = move |&width| if alone { Known::AtLeast(width) } else { Known::Exactly(width) };
        self.widths_px.iter().map(of)
    }

    /// One image of 64 x 64 from one image for each zone, in the order of
    /// [`widths_px`](Self::widths_px).
    ///
    /// # Panics
    /// If there is not one image of 64 x 64 for each zone.
    #[must_use]
    pub fn blend(&self, images: &[Vec<f32>]) -> Vec<f32> {
        assert_eq!(images.len(), self.weights.len(), "one image for each zone");
        let mut blended = vec![0.0; SIDE * SIDE];
        for (image, weights) in images.iter().zip(&self.weights) {
            assert_eq!(image.len(), blended.len(), "images of 64 x 64");
            for ((sum, value), weight) in blended.iter_mut().zip(image).zip(weights) {
                *sum += weight * value;
            }
        }
        blended
    }
}

impl Enhancer {
    /// Enhances one image of 32 x 32 with another blur in each zone, which takes the time of one
    /// image for each zone. Numbers about the image are those of the zone with the largest
    /// inconsistency, and there is no spread.
    ///
    /// # Errors
    /// As [`Enhancer::enhance`].
    pub fn enhance_in_zones(
        &self,
        image: Images<'_, { fusion::SIDE }>,
        depth: Option<&DepthMaps>,
        options: &Options,
        zones: &BlurZones,
    ) -> Result<Enhanced, EnhanceError> {
        let mut worst: Option<Enhanced> = None;
        let mut each = Vec::with_capacity(zones.widths_px.len());
        for known in zones.known() {
            let mut options = Options { copies: 0, ..options.clone() };
            options.estimate.sigma_px = known;
            let mut made = self.enhance(image, depth, &options, &mut |_| {})?;
            each.push(std::mem::take(&mut made.images));
            let of = |made: &Enhanced| made.inconsistency.first().copied().unwrap_or(0.0);
            if worst.as_ref().is_none_or(|worst| of(&made) > of(worst)) {
                worst = Some(made);
            }
        }
        let images = zones.blend(&each);
        Ok(Enhanced { images, ..worst.unwrap_or_default() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Device, Networks};
    use proptest::prelude::*;

    /// A map of 8 x 8 whose left half has one blur and whose right half another one.
    fn halves(left: f32, right: f32) -> Vec<f32> {
        (0..64).map(|at| if at % 8 < 4 { left } else { right }).collect()
    }

    proptest! {
        #[test]
        fn equal_images_blend_to_themselves(
            map in prop::collection::vec(prop_oneof![Just(f32::NAN), 0.0_f32..5.0], 64),
            seed in 0_u32..100,
        ) {
            let image: Vec<f32> =
                (0..SIDE * SIDE).map(|at| ((at as u32 * 7 + seed) % 101) as f32 / 101.0).collect();
            if let Some(zones) = BlurZones::new(&map) {
                let blended = zones.blend(&vec![image.clone(); zones.widths_px().len()]);
                prop_assert!(blended.iter().zip(&image).all(|(a, b)| (a - b).abs() < 1e-4));
                prop_assert!(zones.widths_px().is_sorted());
            }
        }
    }

    #[test]
    fn each_zone_is_taken_from_the_image_of_its_own_blur() {
        let zones = BlurZones::new(&halves(0.0, 2.2)).unwrap();
        assert_eq!(zones.widths_px(), [0.0, 2.2]);
        let image = |value: f32| vec![value; SIDE * SIDE];
        let blended = zones.blend(&[image(0.2), image(0.8)]);
        assert!((blended[10 * SIDE + 20] - 0.2).abs() < 1e-3);
        assert!((blended[10 * SIDE + 44] - 0.8).abs() < 1e-3);
        let known: Vec<Known> = zones.known().collect();
        assert_eq!(known, [Known::Exactly(0.0), Known::Exactly(2.2)]);
    }

    #[test]
    fn nearly_equal_blurs_are_one_zone_and_unknown_places_join_the_largest() {
        let noisy: Vec<f32> = (0..64).map(|at| 2.0 + 0.002 * at as f32).collect();
        let zones = BlurZones::new(&noisy).unwrap();
        assert_eq!(zones.widths_px().len(), 1);
        assert!(matches!(zones.known().next(), Some(Known::AtLeast(width)) if width > 2.0));
        let mut map = halves(0.5, 3.0);
        map[0] = f32::NAN;
        map[7] = 0.5;
        let zones = BlurZones::new(&map).unwrap();
        assert!((zones.weights[0][0] - 1.0).abs() < 1e-3, "32 of 63 places have 0.5 px");
        assert_eq!(BlurZones::new(&[f32::NAN; 64]), None);
        assert_eq!(BlurZones::new(&[1.0; 63]), None);
        assert_eq!(BlurZones::new(&[1.0; 25]), None);
    }

    #[test]
    fn one_zone_is_what_the_enhancer_makes_alone() {
        let mut networks = Networks::built_in(Device::cpu());
        let enhancer = networks.enhancer(crate::Method::default()).unwrap();
        let readings: Vec<f32> =
            (0..32 * 32).map(|at| if at % 32 < 13 { 0.2 } else { 0.7 }).collect();
        let readings = Images::new(&readings).unwrap();
        let mut options = Options::default();
        let zones = BlurZones::new(&[1.5; 64]).unwrap();
        let blended = enhancer.enhance_in_zones(readings, None, &options, &zones).unwrap();
        options.estimate.sigma_px = Known::AtLeast(1.5);
        let alone = enhancer.enhance(readings, None, &options, &mut |_| {}).unwrap();
        let near = |(a, b): (&f32, &f32)| (a - b).abs() < 1e-4;
        assert!(blended.images.iter().zip(&alone.images).all(near));
        assert_eq!(blended.inconsistency, alone.inconsistency);
    }
}

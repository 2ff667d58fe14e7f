//! Fusion of intensity and depth into an image with twice the side, by FSRCNN (the paper's section
//! 2.C).
//!
//! # Invariant
//! A zone without depth differs from a near zone: its depth and its validity are both 0
//! (`tests::a_zone_covers_its_pixels_and_a_blind_one_is_marked`). Training gives the network the
//! same input (`test_the_program_gives_fsrcnn_the_depth_that_training_gives_it` of the
//! Python package).

use std::iter::repeat_n;

use thiserror::Error;

use crate::device::Device;
use crate::images::Images;
use crate::network::RunFsrcnn;
use crate::weights::{Weights, WeightsError};

/// Side of the intensity image.
pub const SIDE: usize = crate::grid::COARSE;

/// The depth in metres that is 1 on the network's scale; a greater depth is 1 too.
const DEPTH_SCALE_M: f32 = 3.0;

/// Why depth maps are refused.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum DepthError {
    /// The maps' side does not divide 32, or their number is neither one nor the number of images.
    #[error(
        "{maps} depth maps of {height} x {width}, expected 1 or {images} of a side that divides 32"
    )]
    Shape {
        /// Number of maps.
        maps: usize,
        /// Rows of each map.
        height: usize,
        /// Columns of each map.
        width: usize,
        /// Number of images.
        images: usize,
    },
}

/// Depth maps of a time-of-flight sensor, 8 x 8 to 32 x 32 zones.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthMaps {
    side: usize,
    /// Distances in metres. NaN, infinity, zero or less mean that the zone has no distance.
    zones_m: Vec<f32>,
}

impl DepthMaps {
    /// `maps` depth maps of `height` x `width` zones in metres, row-major, for `images` images: one
    /// map for each image, or one for all. A zone whose value is not a positive number has no
    /// distance.
    ///
    /// # Errors
    /// [`DepthError`] if the numbers do not fit.
    pub fn new(
        zones_m: Vec<f32>,
        [maps, height, width]: [usize; 3],
        images: usize,
    ) -> Result<Self, DepthError> {
        let fits = height == width
            && height > 0
            && SIDE.is_multiple_of(height)
            && (maps == images || maps == 1)
            && zones_m.len() == maps * height * width;
        if fits {
            Ok(Self { side: height, zones_m })
        } else {
            Err(DepthError::Shape { maps, height, width, images })
        }
    }

    /// The maps of `count` images, beginning with `first`.
    pub(crate) fn of(&self, first: usize, count: usize) -> Self {
        let area = self.side * self.side;
        let zones_m = if self.zones_m.len() == area {
            self.zones_m.clone()
        } else {
            self.zones_m[first * area..(first + count) * area].to_vec()
        };
        Self { side: self.side, zones_m }
    }

    /// Distance of a zone of one image's map, in metres.
    fn zone_m(&self, image: usize, zone: usize) -> Option<f32> {
        let area = self.side * self.side;
        let map = if self.zones_m.len() == area { 0 } else { image };
        let depth_m = self.zones_m[map * area + zone];
        (depth_m > 0.0 && depth_m.is_finite()).then_some(depth_m)
    }
}

/// Appends FSRCNN's depth input for one image: depth over 3 m, then its validity, 32 x 32 values
/// each.
pub(crate) fn push_planes(depth: Option<&DepthMaps>, image: usize, planes: &mut Vec<f32>) {
    let side = depth.map_or(1, |depth| depth.side);
    push_zones(side, |zone| depth?.zone_m(image, zone), planes);
}

/// The same for a map of `side` x `side` zones; `zone_m` gives a zone's distance in metres, if
/// there is one.
pub(crate) fn push_zones(
    side: usize,
    zone_m: impl Fn(usize) -> Option<f32>,
    planes: &mut Vec<f32>,
) {
    let pixels = SIDE / side;
    let zones: Vec<(f32, f32)> = (0..side * side)
        .map(|zone| zone_m(zone).map_or((0.0, 0.0), |m| ((m / DEPTH_SCALE_M).min(1.0), 1.0)))
        .collect();
    let mut push = |value: fn(&(f32, f32)) -> f32| {
        for zones in zones.chunks_exact(side) {
            let row = zones.iter().flat_map(|zone| repeat_n(value(zone), pixels));
            let row: Vec<f32> = row.collect();
            (0..pixels).for_each(|_| planes.extend_from_slice(&row));
        }
    };
    push(|zone| zone.0);
    push(|zone| zone.1);
}

/// FSRCNN with depth as its second input.
pub struct Fusion {
    network: Box<dyn RunFsrcnn>,
    batch: usize,
}

impl Fusion {
    /// The network with these weights (model `fsrcnn`).
    ///
    /// # Errors
    /// [`WeightsError`] if the weights belong to another network.
    pub fn new(device: &Device, weights: &Weights) -> Result<Self, WeightsError> {
        weights.expect_model("fsrcnn")?;
        Ok(Self { network: device.fsrcnn(weights)?, batch: device.batch() })
    }

    /// Each image at 64 x 64, in [0, 1]: enlarged and denoised, with its blur unchanged.
    pub fn upscale(&self, images: Images<'_, SIDE>, depth: Option<&DepthMaps>) -> Vec<f32> {
        let all: Vec<&[f32]> = images.iter().collect();
        let mut out = Vec::with_capacity(4 * images.values().len());
        for (chunk, images) in all.chunks(self.batch).enumerate() {
            let mut input = Vec::with_capacity(3 * images.len() * SIDE * SIDE);
            for (i, image) in images.iter().enumerate() {
                input.extend_from_slice(image);
                push_planes(depth, chunk * self.batch + i, &mut input);
            }
            out.extend(self.network.run(SIDE, &input).into_iter().map(|v| v.clamp(0.0, 1.0)));
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Depth over 3 m and validity at one pixel of the 32 x 32 grid.
    fn planes_at(depth: &DepthMaps, image: usize, pixel: usize) -> (f32, f32) {
        let mut planes = Vec::new();
        push_planes(Some(depth), image, &mut planes);
        assert_eq!(planes.len(), 2 * SIDE * SIDE);
        (planes[pixel], planes[SIDE * SIDE + pixel])
    }

    #[test]
    fn a_zone_covers_its_pixels_and_a_blind_one_is_marked() {
        let mut zones = vec![1.5; 2 * 64];
        zones[64 + 9] = f32::NAN;
        zones[64 + 10] = 0.0;
        zones[64 + 11] = 30.0;
        let depth = DepthMaps::new(zones, [2, 8, 8], 2).unwrap();
        let at = |image, pixel| planes_at(&depth, image, pixel);
        assert_eq!(at(1, 0), (0.5, 1.0));
        // Zone (1, 1) covers pixels 4 to 7 of rows 4 to 7.
        assert_eq!(at(1, 4 * SIDE + 7), (0.0, 0.0));
        assert_eq!(at(1, 7 * SIDE + 8), (0.0, 0.0));
        assert_eq!(at(1, 4 * SIDE + 12), (1.0, 1.0));
        assert_eq!(at(1, 8 * SIDE + 4), (0.5, 1.0));
        assert_eq!(at(0, 4 * SIDE + 7), (0.5, 1.0));
    }

    #[test]
    fn one_map_serves_all_images_and_other_shapes_are_refused() {
        let one = DepthMaps::new(vec![0.3; 64], [1, 8, 8], 5).unwrap();
        assert_eq!(planes_at(&one, 4, 100), (0.1, 1.0));
        for shape in [[2, 8, 8], [1, 5, 5], [1, 8, 4], [1, 0, 0], [1, 64, 64]] {
            let zones = vec![1.0; shape.iter().product()];
            assert!(DepthMaps::new(zones, shape, 5).is_err(), "{shape:?}");
        }
    }
}

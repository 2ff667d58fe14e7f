//! Draws images from a function that gives the brightness at a point.

use super::{AREA_PX, SIDE_PX};

/// Number of points per pixel along each axis.
const FINE: usize = 4;

/// The image of 64 x 64 whose pixels are means of `shade` over 4 x 4 points each. Points are in
/// pixels from the top left corner, column first.
pub(super) fn draw(mut shade: impl FnMut(f32, f32) -> f32) -> Vec<f32> {
    let at = |i: usize, fine: usize| i as f32 + (fine as f32 + 0.5) / FINE as f32;
    let mut image = vec![0.0; AREA_PX];
    for (index, pixel) in image.iter_mut().enumerate() {
        let (row, column) = (index / SIDE_PX, index % SIDE_PX);
        let mut sum = 0.0;
        for fine_row in 0..FINE {
            for fine_column in 0..FINE {
                sum += shade(at(column, fine_column), at(row, fine_row));
            }
        }
        *pixel = sum / (FINE * FINE) as f32;
    }
    image
}

/// An unevenly lit surface: a level and a slope.
#[derive(Debug, Clone, Copy)]
pub(super) struct Surface {
    pub(super) level: f32,
    pub(super) slope: [f32; 2],
}

impl Surface {
    /// Brightness of the surface at a point, in `[0, 1]`.
    pub(super) fn at(&self, x: f32, y: f32) -> f32 {
        let part = |v: f32| v / SIDE_PX as f32 - 0.5;
        (self.level + self.slope[0] * part(x) + self.slope[1] * part(y)).clamp(0.0, 1.0)
    }
}

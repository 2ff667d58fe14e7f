//! The target: a square reflectance map on a plane that faces the camera.
//!
//! # Invariant
//! A [`Scene`] is always physical: every reflectance is in [0, 1] but in its [`Specular`] spot, and the side is a positive number
//! of millimetres, because the constructor refuses anything else
//! (`tests::bad_maps_are_refused_with_the_place_named`). The mean over any rectangle is exact for
//! the piecewise-constant map (a summed-area table), for any size of the rectangle
//! (`tests::a_mean_counts_parts_of_pixels_and_the_surround`).

use crate::pose::Pose;
use thiserror::Error;

/// Pixels along the side of a target that a motion has taken elsewhere.
const POSED_PX: usize = 512;

/// Why a reflectance map is not a scene.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The number of values does not fit a square with this side.
    #[error(
        "scene: {found} reflectances given, {size_px} x {size_px} = {expected} expected",
        expected = .size_px.saturating_mul(*.size_px)
    )]
    Shape {
        /// Side given, in pixels.
        size_px: usize,
        /// Number of values given.
        found: usize,
    },
    /// A reflectance is NaN or outside [0, 1].
    #[error("scene: reflectance at row {row}, column {column} is {value}, expected 0 to 1")]
    Reflectance {
        /// Row from the top.
        row: usize,
        /// Column from the left.
        column: usize,
        /// The value found.
        value: f32,
    },
    /// The reflectance around the map is NaN or outside [0, 1].
    #[error("scene: surround reflectance is {0}, expected 0 to 1")]
    Surround(f32),
    /// The side is not a positive finite length.
    #[error("scene: side is {0} mm, expected a positive length")]
    Side(f64),
    /// A spot that no target can have.
    #[error("scene: a specular spot {times} times as bright as white, expected {expected}", expected = Specular::EXPECTED)]
    Specular {
        /// The brightness given.
        times: f64,
    },
}

/// A square spot of the target that sends the LEDs' light straight back, as a drop, a screw or a varnished edge does.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Specular {
    /// Its brightness, divided by that of white. It is added to that of the map.
    pub times: f64,
    /// Its centre on the target plane, to the right of the map's centre.
    pub x_mm: f64,
    /// Its centre below that of the map.
    pub y_mm: f64,
    /// Its side.
    pub side_mm: f64,
}

impl Specular {
    /// The brightness that a spot may have, in words.
    pub const EXPECTED: &str = "more than 0 and at most 100000";

    /// Mean brightness that it adds over a square of side `width_mm` centred at (`x_mm`, `y_mm`).
    fn mean_over_square(&self, x_mm: f64, y_mm: f64, width_mm: f64) -> f64 {
        let common = |a_mm: f64, b_mm: f64| {
            let (a, b) = (width_mm / 2.0, self.side_mm / 2.0);
            ((a_mm + a).min(b_mm + b) - (a_mm - a).max(b_mm - b)).max(0.0)
        };
        self.times * common(x_mm, self.x_mm) * common(y_mm, self.y_mm) / (width_mm * width_mm)
    }
}

/// A square reflectance map on the target plane, centred on the optical axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    reflectance: Vec<f32>,
    size_px: usize,
    side_mm: f64,
    surround: f32,
    specular: Option<Specular>,
    /// `(size_px + 1)^2` sums of all reflectances above and to the left of a pixel corner.
    summed: Vec<f64>,
}

impl Scene {
    /// A scene from `size_px` x `size_px` reflectances in [0, 1], row-major, top row first, that
    /// covers `side_mm` x `side_mm` of the target plane. The reflectance around the scene is 0 (see
    /// [`Scene::with_surround`]).
    ///
    /// # Errors
    /// [`SceneError`] if the number of values is wrong, one is not in [0, 1], or the side is not a
    /// positive length.
    pub fn new(reflectance: Vec<f32>, size_px: usize, side_mm: f64) -> Result<Self, SceneError> {
        if size_px == 0 || size_px.checked_mul(size_px) != Some(reflectance.len()) {
            return Err(SceneError::Shape { size_px, found: reflectance.len() });
        }
        if !(side_mm.is_finite() && side_mm > 0.0) {
            return Err(SceneError::Side(side_mm));
        }
        if let Some(at) = reflectance.iter().position(|v| !(0.0..=1.0).contains(v)) {
            return Err(SceneError::Reflectance {
                row: at / size_px,
                column: at % size_px,
                value: reflectance[at],
            });
        }
        let summed = summed_area(&reflectance, size_px);
        Ok(Self { reflectance, size_px, side_mm, surround: 0.0, specular: None, summed })
    }

    /// An infinite white sheet with reflectance 1.
    #[must_use]
    pub fn white() -> Self {
        let reflectance = vec![1.0];
        let summed = summed_area(&reflectance, 1);
        Self { reflectance, size_px: 1, side_mm: 1.0, surround: 1.0, specular: None, summed }
    }

    /// The same scene in front of a background of reflectance `surround`.
    ///
    /// # Errors
    /// [`SceneError::Surround`] if the reflectance is not in [0, 1].
    pub fn with_surround(mut self, surround: f32) -> Result<Self, SceneError> {
        if !(0.0..=1.0).contains(&surround) {
            return Err(SceneError::Surround(surround));
        }
        self.surround = surround;
        Ok(self)
    }

    /// The same scene with a specular spot.
    ///
    /// # Errors
    /// [`SceneError::Specular`] for a spot without a positive brightness and size, or brighter than 100 000 times white.
    pub fn with_specular(mut self, spot: Specular) -> Result<Self, SceneError> {
        let Specular { times, x_mm, y_mm, side_mm } = spot;
        let is_placed = (x_mm + y_mm).is_finite() && side_mm.is_finite() && side_mm > 0.0;
        if !(times > 0.0 && times <= 1e5 && is_placed) {
            return Err(SceneError::Specular { times });
        }
        self.specular = Some(spot);
        Ok(self)
    }

    /// The largest mean over any square: 1, or that of the specular spot on white.
    #[must_use]
    pub fn brightest(&self) -> f64 {
        1.0 + self.specular.map_or(0.0, |spot| spot.times)
    }

    /// Reflectances, row-major, `size_px` x `size_px`, without the specular spot.
    #[must_use]
    pub fn reflectance(&self) -> &[f32] {
        &self.reflectance
    }

    /// Pixels along one side.
    #[must_use]
    pub fn size_px(&self) -> usize {
        self.size_px
    }

    /// Side on the target plane, in millimetres.
    #[must_use]
    pub fn side_mm(&self) -> f64 {
        self.side_mm
    }

    /// Reflectance outside the map.
    #[must_use]
    pub fn surround(&self) -> f32 {
        self.surround
    }

    /// Mean reflectance over a square of side `width_mm` centred at (`x_mm`, `y_mm`); the origin is
    /// the centre of the map, x to the right, y down.
    #[must_use]
    pub fn mean_over_square(&self, x_mm: f64, y_mm: f64, width_mm: f64) -> f64 {
        let px_per_mm = self.size_px as f64 / self.side_mm;
        let centre_px = self.size_px as f64 / 2.0;
        let half_px = width_mm * px_per_mm / 2.0;
        let limit = self.size_px as f64;
        let span = |at_mm: f64| {
            let at = at_mm * px_per_mm + centre_px;
            ((at - half_px).clamp(0.0, limit), (at + half_px).clamp(0.0, limit))
        };
        let (left, right) = span(x_mm);
        let (top, bottom) = span(y_mm);
        let inside = self.integral_to(right, bottom) - self.integral_to(left, bottom)
            + self.integral_to(left, top)
            - self.integral_to(right, top);
        let covered_px2 = (right - left) * (bottom - top);
        let area_px2 = 4.0 * half_px * half_px;
        let diffuse = (inside + f64::from(self.surround) * (area_px2 - covered_px2)) / area_px2;
        self.specular.map_or(diffuse, |spot| diffuse + spot.mean_over_square(x_mm, y_mm, width_mm))
    }

    /// The same target where a motion has taken it: what of it lies in a square of side `side_mm` around the axis. A specular
    /// spot keeps its place on the target, and its sides those of the square.
    #[must_use]
    pub fn posed(&self, pose: Pose, side_mm: f64) -> Self {
        let pixel_mm = side_mm / POSED_PX as f64;
        let at_mm = |i: usize| (i as f64 + 0.5) * pixel_mm - side_mm / 2.0;
        let diffuse = Self { specular: None, ..self.clone() };
        let of_pixel = |pixel: usize| {
            let [x_mm, y_mm] = pose.on_target(at_mm(pixel % POSED_PX), at_mm(pixel / POSED_PX));
            diffuse.mean_over_square(x_mm, y_mm, pixel_mm).clamp(0.0, 1.0) as f32
        };
        let reflectance: Vec<f32> = (0..POSED_PX * POSED_PX).map(of_pixel).collect();
        let summed = summed_area(&reflectance, POSED_PX);
        let specular = self.specular.map(|spot| {
            let [x_mm, y_mm] = pose.before_camera(spot.x_mm, spot.y_mm);
            Specular { x_mm, y_mm, ..spot }
        });
        Self { reflectance, size_px: POSED_PX, side_mm, specular, summed, ..diffuse }
    }

    /// Integral of the map over [0, x] x [0, y], in pixels, for x and y in [0, `size_px`].
    fn integral_to(&self, x: f64, y: f64) -> f64 {
        let last = self.size_px - 1;
        let (column, row) = ((x as usize).min(last), (y as usize).min(last));
        let (fx, fy) = (x - column as f64, y - row as f64);
        let stride = self.size_px + 1;
        let corner = |r: usize, c: usize| self.summed[r * stride + c];
        let above = corner(row, column) * (1.0 - fx) + corner(row, column + 1) * fx;
        let below = corner(row + 1, column) * (1.0 - fx) + corner(row + 1, column + 1) * fx;
        above * (1.0 - fy) + below * fy
    }
}

fn summed_area(values: &[f32], size: usize) -> Vec<f64> {
    let stride = size + 1;
    let mut summed = vec![0.0; stride * stride];
    for row in 0..size {
        let mut along_row = 0.0;
        for column in 0..size {
            along_row += f64::from(values[row * size + column]);
            summed[(row + 1) * stride + column + 1] = summed[row * stride + column + 1] + along_row;
        }
    }
    summed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bad_maps_are_refused_with_the_place_named() {
        assert_eq!(
            Scene::new(vec![0.0; 3], 2, 1.0),
            Err(SceneError::Shape { size_px: 2, found: 3 })
        );
        assert!(matches!(Scene::new(vec![], 0, 1.0), Err(SceneError::Shape { .. })));
        assert!(matches!(Scene::new(vec![], usize::MAX, 1.0), Err(SceneError::Shape { .. })));
        for side in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(Scene::new(vec![0.0], 1, side), Err(SceneError::Side(_))));
        }
        for bad in [-0.01, 1.01, f32::NAN] {
            let error = Scene::new(vec![0.0, 0.0, bad, 0.0], 2, 1.0).unwrap_err();
            assert!(matches!(error, SceneError::Reflectance { row: 1, column: 0, .. }), "{error}");
            let scene = Scene::new(vec![0.0], 1, 1.0).unwrap();
            assert!(matches!(scene.with_surround(bad), Err(SceneError::Surround(_))));
        }
    }

    #[test]
    fn a_mean_counts_parts_of_pixels_and_the_surround() {
        // Two pixels of 1 mm a side: 0 1 / 0.5 0.25, with a surround of 1.
        let scene =
            Scene::new(vec![0.0, 1.0, 0.5, 0.25], 2, 2.0).unwrap().with_surround(1.0).unwrap();
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} against {b}");
        close(scene.mean_over_square(0.5, -0.5, 1.0), 1.0);
        close(scene.mean_over_square(0.0, 0.0, 2.0), 0.4375);
        close(scene.mean_over_square(0.0, -0.5, 1.0), 0.5);
        close(scene.mean_over_square(0.25, 0.5, 0.1), 0.25);
        // half a pixel of 0.5 and half outside
        close(scene.mean_over_square(-1.0, 0.5, 1.0), 0.75);
        close(scene.mean_over_square(50.0, 0.0, 1.0), 1.0);
    }
    #[test]
    fn a_specular_spot_adds_its_light_where_it_lies() {
        let grey = Scene::white().with_surround(0.5).unwrap();
        let spot = Specular { times: 20.0, x_mm: 3.0, y_mm: -1.0, side_mm: 2.0 };
        let shining = grey.clone().with_specular(spot).unwrap();
        let close = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} against {b}");
        close(
            shining.mean_over_square(3.0, -1.0, 0.5),
            grey.mean_over_square(3.0, -1.0, 0.5) + 20.0,
        );
        // A quarter of the square.
        close(shining.mean_over_square(4.0, 0.0, 2.0), grey.mean_over_square(4.0, 0.0, 2.0) + 5.0);
        close(
            shining.mean_over_square(3.0, -1.0, 4.0),
            grey.mean_over_square(3.0, -1.0, 4.0) + 5.0,
        );
        close(shining.mean_over_square(-3.0, 1.0, 2.0), 0.5);
        assert_eq!((grey.brightest(), shining.brightest()), (1.0, 21.0));
        for bad in [
            Specular { times: 0.0, ..spot },
            Specular { times: f64::NAN, ..spot },
            Specular { times: 1e6, ..spot },
            Specular { side_mm: 0.0, ..spot },
            Specular { x_mm: f64::INFINITY, ..spot },
        ] {
            let error = grey.clone().with_specular(bad).unwrap_err();
            assert!(matches!(error, SceneError::Specular { .. }), "{error}");
        }
    }
}

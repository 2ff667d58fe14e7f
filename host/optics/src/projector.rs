//! The projector: which part of the target each LED lights.
//!
//! A thin lens images the LED array onto the focus plane. On the focus plane each LED is a sharp
//! square. In front of the plane and behind it, the cone of light from the aperture meets the
//! target as a disc. The spot is the magnified emitter convolved with that disc.
//!
//! # Invariant
//! A spot is a *weighted mean* of reflectance (its weights sum to 1). The footprint is linear in
//! the scene (`the_footprint_is_linear_in_reflectance` in `host/optics/tests/projector.rs`). A
//! target of one reflectance gives that reflectance at every LED at any distance
//! (`a_flat_target_is_seen_flat_at_every_distance`). [`crate::budget`] computes the light of a
//! spot.

use serde::{Deserialize, Serialize};
use std::f64::consts::PI;
use thiserror::Error;

use crate::{LEDS, SIDE, Scene};

/// Grid points per LED pitch on which spots are integrated.
const SAMPLES_PER_PITCH: usize = 8;

/// A blur disc wider than this many fields leaves no pattern on the target (and would need a very
/// large grid).
const MAX_BLUR_FIELDS: f64 = 4.0;

/// Why the projection cannot be computed.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ProjectorError {
    /// A length is not positive and finite.
    #[error("projector: {name} is {value_mm} mm, expected a positive length")]
    Length {
        /// The setting or argument.
        name: &'static str,
        /// The value found, in millimetres.
        value_mm: f64,
    },
    /// Emitters would overlap.
    #[error("projector: emitter_mm {emitter_mm} is wider than led_pitch_mm {led_pitch_mm}")]
    Emitter {
        /// Emitter width found, in millimetres.
        emitter_mm: f64,
        /// LED pitch, in millimetres.
        led_pitch_mm: f64,
    },
    /// The lens has no real image at the focus distance.
    #[error(
        "projector: focus_distance_mm {focus_distance_mm} must be more than \
         focal_length_mm {focal_length_mm}"
    )]
    NoRealImage {
        /// Focus distance found, in millimetres.
        focus_distance_mm: f64,
        /// Focal length, in millimetres.
        focal_length_mm: f64,
    },
    /// The blur is so much wider than the field that no pattern remains.
    #[error(
        "projector: at {distance_mm} mm the blur of {blur_mm:.1} mm washes out the field of \
         {field_mm:.1} mm; move nearer to the focus"
    )]
    WashedOut {
        /// The requested distance, in millimetres.
        distance_mm: f64,
        /// Diameter of the defocus disc at that distance, in millimetres.
        blur_mm: f64,
        /// Side of the field at that distance, in millimetres.
        field_mm: f64,
    },
}

/// The LED array behind its lens. All lengths are in millimetres.
///
/// The default is the paper's camera. `cameras/paper.toml` says which values the paper gives and
/// which were chosen.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Projector {
    /// Distance between neighbouring LEDs.
    pub led_pitch_mm: f64,
    /// Width of the square emitter of one LED.
    pub emitter_mm: f64,
    /// Focal length of the lens.
    pub focal_length_mm: f64,
    /// Distance from the lens to the plane on which the LEDs are sharp.
    pub focus_distance_mm: f64,
    /// Diameter of the lens.
    pub aperture_mm: f64,
    /// Share of the light lost at the corners of the field. The loss grows with the square of the
    /// distance from the centre.
    pub corner_vignetting: f64,
}

impl Projector {
    /// Checks the settings.
    ///
    /// # Errors
    /// [`ProjectorError`] naming the setting that is not physical.
    pub fn validate(&self) -> Result<(), ProjectorError> {
        positive("led_pitch_mm", self.led_pitch_mm)?;
        positive("emitter_mm", self.emitter_mm)?;
        positive("focal_length_mm", self.focal_length_mm)?;
        positive("focus_distance_mm", self.focus_distance_mm)?;
        positive("aperture_mm", self.aperture_mm)?;
        let Self { led_pitch_mm, emitter_mm, focal_length_mm, focus_distance_mm, .. } = *self;
        if emitter_mm > led_pitch_mm {
            return Err(ProjectorError::Emitter { emitter_mm, led_pitch_mm });
        }
        if focus_distance_mm <= focal_length_mm {
            return Err(ProjectorError::NoRealImage { focus_distance_mm, focal_length_mm });
        }
        Ok(())
    }

    /// Distance from the array to the lens that focuses it: `1 / (1/f - 1/focus)`, in millimetres.
    #[must_use]
    pub fn array_distance_mm(&self) -> f64 {
        1.0 / (1.0 / self.focal_length_mm - 1.0 / self.focus_distance_mm)
    }

    /// Size on the target divided by size on the array, for a target at `distance_mm`.
    #[must_use]
    pub fn magnification(&self, distance_mm: f64) -> f64 {
        distance_mm / self.array_distance_mm()
    }

    /// Side of the square that the 32 x 32 LEDs cover at `distance_mm`, in millimetres.
    #[must_use]
    pub fn field_mm(&self, distance_mm: f64) -> f64 {
        SIDE as f64 * self.led_pitch_mm * self.magnification(distance_mm)
    }

    /// Side of the field divided by the distance of the target, which is the same at every
    /// distance.
    #[must_use]
    pub fn field_over_distance(&self) -> f64 {
        SIDE as f64 * self.led_pitch_mm / self.array_distance_mm()
    }

    /// Diameter of the defocus disc at `distance_mm`, in millimetres: the cone from the aperture to
    /// a point on the focus plane, cut by the target, `aperture * |1 - D / focus|`.
    #[must_use]
    pub fn blur_mm(&self, distance_mm: f64) -> f64 {
        self.aperture_mm * (1.0 - distance_mm / self.focus_distance_mm).abs()
    }

    /// The finest line on a target at `distance_mm` that keeps `contrast` of its own contrast after
    /// blur by emitter and defocus, in millimetres and at least one pixel; `None` if even a line as
    /// wide as the field loses more.
    #[must_use]
    pub fn finest_line_mm(&self, distance_mm: f64, contrast: f64) -> Option<f64> {
        let pixel_mm = self.field_mm(distance_mm) / SIDE as f64;
        let kept = |line_mm: f64| self.transfer(1.0 / (2.0 * line_mm), distance_mm);
        let width = |step: i32| pixel_mm * (SIDE as f64).powf(f64::from(step) / 2000.0);
        // The search starts at the widest line: after the first null the contrast comes back
        // inverted, which is not resolution.
        let lost = (0..=2000).rev().find(|&step| kept(width(step)) < contrast);
        match lost {
            None => Some(pixel_mm),
            Some(step) if step < 2000 => Some(width(step + 1)),
            Some(_) => None,
        }
    }

    /// Contrast of a sine on a target at `distance_mm` after blur by emitter and defocus, at
    /// `cycles_per_mm`: a square's transfer times a disc's.
    #[must_use]
    pub fn transfer(&self, cycles_per_mm: f64, distance_mm: f64) -> f64 {
        let spot_mm = self.emitter_mm * self.magnification(distance_mm);
        let square = sinc(PI * cycles_per_mm * spot_mm);
        square * disc(PI * cycles_per_mm * self.blur_mm(distance_mm))
    }

    /// The mean reflectance that each LED's spot sees on a scene at `distance_mm`, centred on the
    /// axis. LED row 0 is the top of the scene and column 0 its left. The lens inverts the picture,
    /// and the wiring of the array undoes the inversion.
    ///
    /// # Errors
    /// [`ProjectorError`] if a setting or the distance is not physical, or if the target is so far
    /// out of focus that no pattern remains.
    pub fn footprint(&self, scene: &Scene, distance_mm: f64) -> Result<Footprint, ProjectorError> {
        let step_mm = self.grid_mm(distance_mm)?;
        let radius = self.blur_mm(distance_mm) / 2.0 / step_mm;
        let emitter_mm = self.emitter_mm / self.led_pitch_mm * SAMPLES_PER_PITCH as f64 * step_mm;
        // A point on every LED's axis, and a margin for the disc.
        let margin = radius.ceil() as usize + 1;
        let points = (SIDE - 1) * SAMPLES_PER_PITCH + 1 + 2 * margin;
        let sharp = SharpGrid::new(scene, step_mm, emitter_mm, points);
        let at = |led: usize| margin + led * SAMPLES_PER_PITCH;
        let mut weights = Vec::with_capacity(LEDS);
        for row in 0..SIDE {
            for column in 0..SIDE {
                // Differences of running sums may leave the range by the last bit.
                let mean = sharp.mean_over_disc(at(row), at(column), radius);
                weights.push(mean.clamp(0.0, scene.brightest()) as f32);
            }
        }
        Ok(Footprint { weights })
    }

    /// Distance of the points of the grid on which spots are integrated at `distance_mm`.
    ///
    /// # Errors
    /// As [`Projector::footprint`].
    pub(crate) fn grid_mm(&self, distance_mm: f64) -> Result<f64, ProjectorError> {
        self.validate()?;
        positive("distance_mm", distance_mm)?;
        let (field_mm, blur_mm) = (self.field_mm(distance_mm), self.blur_mm(distance_mm));
        if blur_mm > MAX_BLUR_FIELDS * field_mm {
            return Err(ProjectorError::WashedOut { distance_mm, blur_mm, field_mm });
        }
        Ok(field_mm / (SIDE * SAMPLES_PER_PITCH) as f64)
    }
}

/// Transfer of a square of width w, with x = pi f w.
fn sinc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { x.sin() / x }
}

/// Transfer of a disc of diameter d, with x = pi f d (Goodman, Introduction to Fourier Optics, 2.1.5).
fn disc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { 2.0 * libm::j1(x) / x }
}

fn positive(name: &'static str, value_mm: f64) -> Result<(), ProjectorError> {
    if value_mm.is_finite() && value_mm > 0.0 {
        Ok(())
    } else {
        Err(ProjectorError::Length { name, value_mm })
    }
}

/// The scene seen through one sharp emitter, sampled on a grid of points around its centre. Stored as running
/// sums along rows, so that each row of a disc is one difference.
pub(crate) struct SharpGrid {
    running: Vec<f64>,
    stride: usize,
}

impl SharpGrid {
    /// `points` x `points`, `step_mm` apart.
    pub(crate) fn new(scene: &Scene, step_mm: f64, emitter_mm: f64, points: usize) -> Self {
        let at_mm = |i: usize| (i as f64 - (points - 1) as f64 / 2.0) * step_mm;
        let stride = points + 1;
        let mut running = vec![0.0; points * stride];
        for (row, sums) in running.chunks_exact_mut(stride).enumerate() {
            let mut sum = 0.0;
            for column in 0..points {
                sum += scene.mean_over_square(at_mm(column), at_mm(row), emitter_mm);
                sums[column + 1] = sum;
            }
        }
        Self { running, stride }
    }

    /// Mean over the disc of `radius` grid steps around the point (`y`, `column`), at least as far from the edge.
    pub(crate) fn mean_over_disc(&self, y: usize, column: usize, radius: f64) -> f64 {
        let x = column as f64 + 0.5;
        if radius < 0.5 {
            // A disc smaller than the grid is hidden by the emitter's own width.
            return self.sum_to(y, x + 0.5) - self.sum_to(y, x - 0.5);
        }
        let reach = radius.floor() as usize;
        let (mut sum, mut length) = (0.0, 0.0);
        for line in y - reach..=y + reach {
            let dy = line.abs_diff(y) as f64;
            let half = (radius * radius - dy * dy).sqrt();
            sum += self.sum_to(line, x + half) - self.sum_to(line, x - half);
            length += 2.0 * half;
        }
        sum / length
    }

    /// Integral along grid row `line` up to `x`, where grid point i covers [i, i + 1].
    fn sum_to(&self, line: usize, x: f64) -> f64 {
        let whole = x as usize;
        let sums = &self.running[line * self.stride..(line + 1) * self.stride];
        let next = sums[(whole + 1).min(self.stride - 1)];
        sums[whole] + (next - sums[whole]) * (x - whole as f64)
    }
}

/// The mean reflectance under the spot of each LED, 32 x 32, row-major: 0 to 1, and more in a specular spot.
///
/// The image that an ideal camera of this resolution would reconstruct.
#[derive(Debug, Clone, PartialEq)]
pub struct Footprint {
    weights: Vec<f32>,
}

impl Footprint {
    /// The 1024 reflectances, row-major, row 0 at the top of the scene.
    #[must_use]
    pub fn weights(&self) -> &[f32] {
        &self.weights
    }

    /// Reflectance under all LEDs together.
    #[must_use]
    pub fn mean(&self) -> f64 {
        self.weights.iter().map(|&w| f64::from(w)).sum::<f64>() / LEDS as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The projection of a disc onto one axis is made of chords.
    #[test]
    fn the_transfer_of_a_disc_is_that_of_its_chords() {
        const PARTS: u32 = 1000;
        for x in [0.0, 1e-9, 0.1, 1.0, 3.8317, 10.0, 60.0] {
            let chord = |i: u32| {
                let angle = PI * ((f64::from(i) + 0.5) / f64::from(PARTS) - 0.5);
                angle.cos().powi(2) * (x * angle.sin()).cos()
            };
            let chords = (0..PARTS).map(chord).sum::<f64>() * 2.0 / f64::from(PARTS);
            assert!((disc(x) - chords).abs() < 1e-12, "{x}: {} {chords}", disc(x));
        }
    }
}

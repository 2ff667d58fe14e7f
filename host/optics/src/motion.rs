//! A target that moves: it crosses the field in a straight line, comes again from the other side, and may turn.
//!
//! # Model
//! The target moves in its plane, which faces the camera. Its centre is on the axis at time 0. Emitter and defocus blur the
//! scene once, and each LED's spot then sees the blurred scene at its place relative to the target, between the points of a
//! grid of an eighth of a pixel. The square emitter does not turn with the target, which the blur ignores.
//!
//! # Invariant
//! At time 0 the light is that of the target at rest
//! (`a_target_starts_where_it_rests_and_comes_back` in `host/optics/tests/motion.rs`).

use crate::pose::Pose;
use crate::projector::{ProjectorError, SharpGrid};
use crate::{LEDS, Projector, SIDE, Scene};
use thiserror::Error;

/// How a target moves.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Motion {
    /// Speed of its centre.
    pub speed_m_per_s: f64,
    /// Where its centre goes: 0 is to the right of the image, 90 is down.
    pub direction_deg: f64,
    /// Turning about its centre, clockwise in the image.
    pub turning_deg_per_s: f64,
}

/// Why a target cannot move so.
#[derive(Debug, Clone, Copy, PartialEq, Error)]
#[error("{name} is {value}, expected {least} to {most}")]
pub struct MotionError {
    /// The number, with its unit.
    pub name: &'static str,
    /// The value found.
    pub value: f64,
    /// The smallest value.
    pub least: f64,
    /// The largest value.
    pub most: f64,
}

impl Motion {
    /// Whether the target is at rest.
    #[must_use]
    pub fn is_none(&self) -> bool {
        self.speed_m_per_s == 0.0 && self.turning_deg_per_s == 0.0
    }

    /// Checks the numbers.
    ///
    /// # Errors
    /// [`MotionError`] names the number that is out of range.
    pub fn validate(&self) -> Result<(), MotionError> {
        let limits = [
            ("target speed in m/s", self.speed_m_per_s, 0.0, 100.0),
            ("target direction in degrees", self.direction_deg, -360.0, 360.0),
            ("target turning in degrees a second", self.turning_deg_per_s, -36_000.0, 36_000.0),
        ];
        match limits.into_iter().find(|(_, value, least, most)| !(least..=most).contains(&value)) {
            Some((name, value, least, most)) => Err(MotionError { name, value, least, most }),
            None => Ok(()),
        }
    }
}

/// A moving target before the projector.
#[derive(Debug, Clone)]
pub struct MovingTarget {
    motion: Motion,
    /// The blurred scene, row-major, `side` x `side` points around the target's centre.
    blurred: Vec<f32>,
    side: usize,
    step_mm: f64,
    surround: f32,
    pixel_mm: f64,
    /// Distance of the target's centre from the axis where it leaves the field.
    reach_mm: f64,
    /// The largest distance of a point of the target from its centre.
    radius_mm: f64,
}

impl MovingTarget {
    /// `scene` at `distance_mm` before the projector.
    ///
    /// # Errors
    /// [`ProjectorError`] as [`Projector::footprint`].
    pub fn new(
        motion: Motion,
        projector: &Projector,
        scene: &Scene,
        distance_mm: f64,
    ) -> Result<Self, ProjectorError> {
        let field_mm = projector.field_mm(distance_mm);
        let step_mm = projector.grid_mm(distance_mm)?;
        let radius = projector.blur_mm(distance_mm) / 2.0 / step_mm;
        let emitter_mm = projector.emitter_mm / projector.led_pitch_mm * field_mm / SIDE as f64;
        // Beyond the scene, the emitter and the blur there is the surround alone.
        let half_mm = (scene.side_mm() + emitter_mm) / 2.0 + (radius + 2.0) * step_mm;
        let side = 2 * (half_mm / step_mm).ceil() as usize + 1;
        let margin = radius.ceil() as usize + 1;
        let sharp = SharpGrid::new(scene, step_mm, emitter_mm, side + 2 * margin);
        let points = (0..side * side).map(|at| (at / side + margin, at % side + margin));
        let blurred = points
            .map(|(row, column)| sharp.mean_over_disc(row, column, radius))
            .map(|mean| mean.clamp(0.0, scene.brightest()) as f32)
            .collect();
        let (sin, cos) = motion.direction_deg.to_radians().sin_cos();
        let along = sin.abs() + cos.abs();
        let turned = if motion.turning_deg_per_s == 0.0 { along } else { 2.0_f64.sqrt() };
        let reach_mm = (field_mm * along + scene.side_mm() * turned) / 2.0;
        Ok(Self {
            motion,
            blurred,
            side,
            step_mm,
            surround: scene.surround(),
            pixel_mm: field_mm / SIDE as f64,
            reach_mm,
            radius_mm: scene.side_mm() / 2.0_f64.sqrt(),
        })
    }

    /// Where the target is at this time.
    #[must_use]
    pub fn pose(&self, seconds: f64) -> Pose {
        let Motion { speed_m_per_s, direction_deg, turning_deg_per_s } = self.motion;
        let gone_mm = speed_m_per_s * 1e3 * seconds;
        let along_mm = (gone_mm + self.reach_mm).rem_euclid(2.0 * self.reach_mm) - self.reach_mm;
        let (sin, cos) = direction_deg.to_radians().sin_cos();
        let turned_deg = (turning_deg_per_s * seconds).rem_euclid(360.0);
        Pose { x_mm: along_mm * cos, y_mm: along_mm * sin, turned_deg }
    }

    /// The mean reflectance under the spot of each LED at this time, 32 x 32, row-major.
    #[must_use]
    pub fn seen(&self, seconds: f64) -> Vec<f32> {
        let pose = self.pose(seconds);
        let at_mm = |i: usize| (i as f64 + 0.5 - SIDE as f64 / 2.0) * self.pixel_mm;
        let spot = |led: usize| {
            let [x_mm, y_mm] = pose.on_target(at_mm(led % SIDE), at_mm(led / SIDE));
            self.at(x_mm, y_mm)
        };
        (0..LEDS).map(spot).collect()
    }

    /// Seconds in which no point of the target moves more than this share of a pixel.
    #[must_use]
    pub fn seconds_for(&self, pixels: f64) -> f64 {
        let turning_mm = self.motion.turning_deg_per_s.to_radians().abs() * self.radius_mm;
        pixels * self.pixel_mm / (self.motion.speed_m_per_s * 1e3 + turning_mm)
    }

    /// The blurred scene at a place of the target, from its centre.
    fn at(&self, x_mm: f64, y_mm: f64) -> f32 {
        let centre = (self.side / 2) as f64;
        let (x, y) = (x_mm / self.step_mm + centre, y_mm / self.step_mm + centre);
        let last = (self.side - 1) as f64;
        if !(0.0..last).contains(&x) || !(0.0..last).contains(&y) {
            return self.surround;
        }
        let (column, row) = (x as usize, y as usize);
        let (fx, fy) = ((x - column as f64) as f32, (y - row as f64) as f32);
        let value = |row: usize, column: usize| self.blurred[row * self.side + column];
        let above = value(row, column) * (1.0 - fx) + value(row, column + 1) * fx;
        let below = value(row + 1, column) * (1.0 - fx) + value(row + 1, column + 1) * fx;
        above * (1.0 - fy) + below * fy
    }
}

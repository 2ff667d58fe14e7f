//! Where a target is on its plane, and how far it has turned.

/// Where the target is at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Place of the centre on the target plane, to the right of the axis.
    pub x_mm: f64,
    /// Place of the centre below the axis.
    pub y_mm: f64,
    /// Angle by which the target has turned clockwise.
    pub turned_deg: f64,
}

impl Pose {
    /// The point of the target that the camera sees at this point of its field: from the axis, in mm, to the right and down. The
    /// result is from the centre of the target, along its own sides.
    #[must_use]
    pub fn on_target(&self, x_mm: f64, y_mm: f64) -> [f64; 2] {
        let (sin, cos) = self.turned_deg.to_radians().sin_cos();
        let (x, y) = (x_mm - self.x_mm, y_mm - self.y_mm);
        // The target's own axes have turned clockwise, with y down.
        [x * cos + y * sin, y * cos - x * sin]
    }

    /// The point of the camera's field at which it sees this point of the target: the inverse of [`on_target`](Self::on_target).
    #[must_use]
    pub fn before_camera(&self, x_mm: f64, y_mm: f64) -> [f64; 2] {
        let (sin, cos) = self.turned_deg.to_radians().sin_cos();
        [self.x_mm + x_mm * cos - y_mm * sin, self.y_mm + x_mm * sin + y_mm * cos]
    }
}

//! The reading of a camera's depth sensor in the camera's image.

use nirspi_optics::CameraModel;
use nirspi_wire::Depth;

/// (32, 32) distances in metres, 0 where the sensor has no reading; `None` for a sensor with other than
/// 8 x 8 zones, because the positions of its zones are not known.
#[must_use]
pub fn pixels_m(model: &CameraModel, depth: &Depth<'_>) -> Option<Vec<f32>> {
    let zones_mm: Vec<u16> = depth.distances_mm.iter().collect();
    let field = model.projector().field_over_distance();
    let view = model.depth_geometry().view(zones_mm.as_slice().try_into().ok()?, field);
    Some(view.pixels_mm.iter().map(|&mm| f32::from(mm) * 1e-3).collect())
}

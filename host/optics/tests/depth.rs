//! Which zones of the depth sensor see the field of the LEDs.

use nirspi_optics::depth::{DEPTH_SIDE, DEPTH_ZONES, DepthGeometry};

/// At 1 m the field covers four zones of a sensor of 45 degrees, whose axis is 0.2 m beside the lens.
const FIELD_OVER_DISTANCE: f64 = 0.3;
const OFFSET_MM: f64 = 200.0;

/// Zones whose lower half of indices along an axis is at 1 m, and the other half at 2 m.
fn zones(near: impl Fn(usize, usize) -> bool) -> [u16; DEPTH_ZONES] {
    std::array::from_fn(|zone| if near(zone / DEPTH_SIDE, zone % DEPTH_SIDE) { 1000 } else { 2000 })
}

#[test]
fn a_sensor_beside_the_lens_sees_the_field_in_the_zones_on_the_other_side() {
    let half = DEPTH_SIDE / 2;
    let beside = DepthGeometry { fov_deg: 45.0, offset_mm: [OFFSET_MM, 0.0] };
    let across = beside.view(&zones(|_, column| column < half), FIELD_OVER_DISTANCE);
    assert_eq!((across.median_mm, across.zones), (Some(1000), half * half));
    assert!(across.pixels_mm.iter().all(|&mm| mm == 1000));

    let above = DepthGeometry { offset_mm: [0.0, OFFSET_MM], ..beside };
    let down = above.view(&zones(|row, _| row < half), FIELD_OVER_DISTANCE);
    assert_eq!(down, across);
}

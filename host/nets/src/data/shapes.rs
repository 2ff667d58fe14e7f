//! Procedural scenes without letters, so that a network that has learnt letters does not see
//! letters everywhere.

use super::canvas::{Surface, draw};
use super::{AREA_PX, SIDE_PX};
use rand::{Rng, RngExt};
use std::f32::consts::{PI, TAU};

/// The content of a procedural scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// Soft round blobs.
    Blobs,
    /// Polygons, each of one brightness.
    Polygons,
    /// A surface lit from one side.
    Gradient,
    /// A Siemens star.
    Star,
    /// Parallel bars, sharp or sinusoidal.
    Bars,
    /// Straight strokes in any direction.
    Strokes,
    /// Points of light.
    Points,
    /// Noise with a grain.
    Noise,
    /// One brightness, which may be 0.
    Empty,
}

impl Shape {
    /// Every shape.
    pub const ALL: [Self; 9] = [
        Self::Blobs,
        Self::Polygons,
        Self::Gradient,
        Self::Star,
        Self::Bars,
        Self::Strokes,
        Self::Points,
        Self::Noise,
        Self::Empty,
    ];

    /// Draws a scene of 64 x 64 in `[0, 1]`.
    #[must_use]
    pub fn draw(self, rng: &mut impl Rng) -> Vec<f32> {
        let side = SIDE_PX as f32;
        let anywhere = |rng: &mut dyn Rng| [(); 2].map(|()| rng.random_range(-4.0..side + 4.0));
        let ground =
            Surface { level: if rng.random() { 0.0 } else { rng.random() }, slope: [0.0; 2] };
        match self {
            Self::Blobs => {
                let blobs: Vec<([f32; 2], f32, f32)> = (0..rng.random_range(1..14))
                    .map(|_| (anywhere(rng), rng.random_range(1.5..14.0_f32), rng.random()))
                    .collect();
                draw(|x, y| {
                    let light: f32 = blobs
                        .iter()
                        .map(|(at, width, level)| {
                            let r = (x - at[0]).hypot(y - at[1]) / width;
                            level * (-0.5 * r * r).exp()
                        })
                        .sum();
                    (ground.level * 0.5 + light).min(1.0)
                })
            }
            Self::Polygons => {
                let polygons: Vec<(Vec<[f32; 2]>, f32)> = (0..rng.random_range(1..9))
                    .map(|_| {
                        let (centre, reach) = (anywhere(rng), rng.random_range(3.0..26.0_f32));
                        (corners(centre, reach, rng), rng.random())
                    })
                    .collect();
                draw(|x, y| {
                    let above = polygons.iter().rev().find(|(corners, _)| inside(corners, x, y));
                    above.map_or(ground.level, |(_, level)| *level)
                })
            }
            Self::Gradient => {
                let slope = [(); 2].map(|()| rng.random_range(-1.0..1.0));
                let surface = Surface { level: rng.random(), slope };
                draw(|x, y| surface.at(x, y))
            }
            Self::Star => {
                let spokes = rng.random_range(3..19) as f32;
                let turn = rng.random_range(0.0..TAU);
                let centre = [(); 2].map(|()| side / 2.0 + rng.random_range(-10.0..10.0));
                let reach = rng.random_range(14.0..40.0_f32);
                draw(|x, y| {
                    let (dx, dy) = (x - centre[0], y - centre[1]);
                    let lit = (spokes * dy.atan2(dx) + turn).sin() > 0.0 && dx.hypot(dy) < reach;
                    if lit { 1.0 } else { 0.0 }
                })
            }
            Self::Bars => {
                let (sin, cos) = rng.random_range(0.0..PI).sin_cos();
                let period = rng.random_range(3.0..32.0_f32);
                let phase = rng.random_range(0.0..TAU);
                let (low, high): (f32, f32) = (rng.random(), rng.random());
                let sharp: bool = rng.random();
                draw(|x, y| {
                    let wave = (TAU * (x * cos + y * sin) / period + phase).sin();
                    let share =
                        if sharp { f32::from(u8::from(wave > 0.0)) } else { 0.5 + 0.5 * wave };
                    low + (high - low) * share
                })
            }
            Self::Strokes => {
                let strokes: Vec<([f32; 2], [f32; 2], f32, f32)> = (0..rng.random_range(1..9))
                    .map(|_| {
                        let ends = (anywhere(rng), anywhere(rng));
                        (
                            ends.0,
                            ends.1,
                            rng.random_range(0.5..4.0_f32),
                            rng.random_range(0.3..=1.0),
                        )
                    })
                    .collect();
                draw(|x, y| {
                    let over =
                        strokes.iter().filter(|(a, b, half, _)| to_segment([x, y], *a, *b) < *half);
                    over.map(|(.., level)| *level).fold(0.0, f32::max)
                })
            }
            Self::Points => {
                let points: Vec<([f32; 2], f32, f32)> = (0..rng.random_range(1..40))
                    .map(|_| {
                        (anywhere(rng), rng.random_range(0.4..2.0_f32), rng.random_range(0.3..=1.0))
                    })
                    .collect();
                draw(|x, y| {
                    let over = points.iter().filter(|(at, r, _)| (x - at[0]).hypot(y - at[1]) < *r);
                    over.map(|(.., level)| *level).fold(0.0, f32::max)
                })
            }
            Self::Noise => {
                let grain = rng.random_range(1..7_usize);
                let cells = SIDE_PX.div_ceil(grain);
                let levels: Vec<f32> = (0..cells * cells).map(|_| rng.random()).collect();
                (0..AREA_PX)
                    .map(|at| levels[at / SIDE_PX / grain * cells + at % SIDE_PX / grain])
                    .collect()
            }
            Self::Empty => vec![ground.level; AREA_PX],
        }
    }
}

/// Corners of a polygon in order around its centre, so that it does not cross itself.
fn corners(centre: [f32; 2], reach: f32, rng: &mut impl Rng) -> Vec<[f32; 2]> {
    let count = rng.random_range(3..8);
    let turn = rng.random_range(0.0..TAU);
    (0..count)
        .map(|k| {
            let (sin, cos) = (turn + TAU * k as f32 / count as f32).sin_cos();
            let r = reach * rng.random_range(0.4..1.0_f32);
            [centre[0] + r * cos, centre[1] + r * sin]
        })
        .collect()
}

/// Whether a ray from the point crosses the outline an odd number of times.
fn inside(corners: &[[f32; 2]], x: f32, y: f32) -> bool {
    let mut within = false;
    for (k, a) in corners.iter().enumerate() {
        let b = corners[(k + 1) % corners.len()];
        if (a[1] > y) != (b[1] > y) && x < (b[0] - a[0]) * (y - a[1]) / (b[1] - a[1]) + a[0] {
            within = !within;
        }
    }
    within
}

/// Distance from a point to a stroke's middle line.
fn to_segment(p: [f32; 2], a: [f32; 2], b: [f32; 2]) -> f32 {
    let (dx, dy) = (b[0] - a[0], b[1] - a[1]);
    let length = dx * dx + dy * dy;
    let along = if length > 0.0 { ((p[0] - a[0]) * dx + (p[1] - a[1]) * dy) / length } else { 0.0 };
    let along = along.clamp(0.0, 1.0);
    (p[0] - a[0] - along * dx).hypot(p[1] - a[1] - along * dy)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{Purpose, stream};

    #[test]
    fn every_shape_is_in_range_and_differs_by_seed_alone() {
        for shape in Shape::ALL {
            let drawn = |seed| shape.draw(&mut stream(seed, Purpose::Training, 0));
            for seed in 0..6 {
                let image = drawn(seed);
                assert_eq!(image.len(), AREA_PX);
                assert!(image.iter().all(|v| (0.0..=1.0).contains(v)), "{shape:?}");
                assert_eq!(image, drawn(seed), "{shape:?}");
            }
            let others = (0..6).filter(|&seed| drawn(seed) != drawn(seed + 1)).count();
            assert!(others >= 3, "{shape:?} is always the same");
        }
    }

    #[test]
    fn a_point_is_inside_its_polygon_alone() {
        let square = [[1.0, 1.0], [5.0, 1.0], [5.0, 5.0], [1.0, 5.0]];
        assert!(inside(&square, 3.0, 3.0));
        assert!(!inside(&square, 6.0, 3.0) && !inside(&square, 3.0, 0.5));
    }
}

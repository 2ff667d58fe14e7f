//! A drawing as pixels.
//!
//! # Invariant
//! What a shape covers in part is mixed with the ground (`tests::a_line_covers_what_it_should`).
//! Parts outside the picture are cut.

use super::drawing::{Drawing, Shape};
use super::look::Colour;
use super::text::{Font, height_of, placed_glyphs};
use ab_glyph::{Font as _, ScaleFont as _, point};
use nirspi_files::image::{Canvas, Filter, resample};

impl Drawing {
    /// The drawing as an image.
    #[must_use]
    pub fn raster(&self) -> Canvas {
        let mut canvas = Canvas::new(self.width, self.height, self.ground);
        for shape in &self.shapes {
            match shape {
                Shape::Box { at, colour } => fill(&mut canvas, *at, *colour),
                Shape::Line { points, width, dashes, colour } => {
                    let mut along = 0.0;
                    for pair in points.windows(2) {
                        let ends = (pair[0], pair[1]);
                        along = dashed(&mut canvas, ends, (*width, *colour), dashes, along);
                    }
                }
                Shape::Area { corners, colour } => area(&mut canvas, corners, *colour),
                Shape::Text { x, baseline, size, colour, text } => {
                    glyphs(&mut canvas, text, (*x as f32, *baseline as f32), *size as f32, *colour);
                }
                Shape::Image { at, columns, levels, smooth } => {
                    grey(&mut canvas, *at, *columns, levels, *smooth);
                }
            }
        }
        canvas
    }
}

/// Steps from the ground to the ink. Few steps make few colours, and smaller files.
const STEPS: f64 = 16.0;

fn blend(ground: &mut Colour, ink: Colour, coverage: f64) {
    let coverage = (coverage * STEPS).round() / STEPS;
    for (ground, ink) in ground.iter_mut().zip(ink) {
        let mixed =
            f64::from(*ground) + (f64::from(ink) - f64::from(*ground)) * coverage.clamp(0.0, 1.0);
        *ground = mixed.round() as u8;
    }
}

/// Mixes one pixel with ink. Outside of the picture there is nothing to draw on.
fn mix(canvas: &mut Canvas, x: u32, y: u32, ink: Colour, coverage: f64) {
    if let Some(pixel) = canvas.pixel_mut(x, y) {
        blend(pixel, ink, coverage);
    }
}

fn put(canvas: &mut Canvas, x: u32, y: u32, colour: Colour) {
    if let Some(pixel) = canvas.pixel_mut(x, y) {
        *pixel = colour;
    }
}

/// The pixels of the canvas from `from` to `to`, along one edge of this length.
fn within(from: f64, to: f64, length: u32) -> std::ops::Range<u32> {
    let bounded = |v: f64| v.clamp(0.0, f64::from(length)) as u32;
    bounded(from.floor())..bounded(to.ceil())
}

fn fill(canvas: &mut Canvas, [left, top, wide, high]: [f64; 4], colour: Colour) {
    let whole = |v: f64| v.round();
    for y in within(whole(top), whole(top + high), canvas.height()) {
        for x in within(whole(left), whole(left + wide), canvas.width()) {
            put(canvas, x, y, colour);
        }
    }
}

/// Draws a line with this pattern of dashes; solid without any. `along` is the position in the
/// pattern at the start; the result is the position at the end.
fn dashed(
    canvas: &mut Canvas,
    (from, to): ((f64, f64), (f64, f64)),
    ink: (f64, Colour),
    pattern: &[f64],
    along: f64,
) -> f64 {
    if pattern.is_empty() {
        stroke(canvas, from, to, ink);
        return 0.0;
    }
    let length = (to.0 - from.0).hypot(to.1 - from.1);
    let at = |px: f64| {
        let part = px.clamp(0.0, length) / length;
        (from.0 + part * (to.0 - from.0), from.1 + part * (to.1 - from.1))
    };
    let period: f64 = pattern.iter().sum();
    let mut start = -along;
    while start < length && length > 0.0 {
        let mut dash = start;
        for pair in pattern.chunks(2) {
            if dash + pair[0] > 0.0 && dash < length {
                stroke(canvas, at(dash), at(dash + pair[0]), ink);
            }
            dash += pair.iter().sum::<f64>();
        }
        start += period;
    }
    (along + length) % period
}

/// Draws a straight line of some width.
fn stroke(canvas: &mut Canvas, from: (f64, f64), to: (f64, f64), (width, colour): (f64, Colour)) {
    let length = (to.0 - from.0).hypot(to.1 - from.1);
    if !length.is_finite() || length > 1e5 {
        return;
    }
    let half = width / 2.0;
    let (x0, x1) = (from.0.min(to.0) - half - 1.0, from.0.max(to.0) + half + 1.0);
    let (y0, y1) = (from.1.min(to.1) - half - 1.0, from.1.max(to.1) + half + 1.0);
    for y in within(y0, y1, canvas.height()) {
        for x in within(x0, x1, canvas.width()) {
            let (px, py) = (f64::from(x) + 0.5 - from.0, f64::from(y) + 0.5 - from.1);
            let (dx, dy) = (to.0 - from.0, to.1 - from.1);
            let along = if length > 0.0 {
                ((px * dx + py * dy) / (length * length)).clamp(0.0, 1.0)
            } else {
                0.0
            };
            let off = (px - along * dx).hypot(py - along * dy);
            let cover = (half + 0.5 - off).clamp(0.0, 1.0);
            if cover > 0.0 {
                mix(canvas, x, y, colour, cover);
            }
        }
    }
}

/// Fills the inside of an outline; each pixel is asked at 4 x 4 places.
fn area(canvas: &mut Canvas, corners: &[(f64, f64)], colour: Colour) {
    const ASKED: u32 = 4;
    let ends = |of: fn(&(f64, f64)) -> f64| {
        let values = corners.iter().map(of);
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
    };
    let ((left, right), (top, bottom)) = (ends(|c| c.0), ends(|c| c.1));
    let is_inside = |x: f64, y: f64| {
        let edges = corners.iter().zip(corners.iter().cycle().skip(1));
        let crossed = |(a, b): &(&(f64, f64), &(f64, f64))| {
            (a.1 > y) != (b.1 > y) && x < a.0 + (y - a.1) / (b.1 - a.1) * (b.0 - a.0)
        };
        edges.filter(crossed).count() % 2 == 1
    };
    let place = |k: u32| (f64::from(k) + 0.5) / f64::from(ASKED);
    for y in within(top, bottom, canvas.height()) {
        for x in within(left, right, canvas.width()) {
            let asked = (0..ASKED * ASKED).map(|k| (place(k % ASKED), place(k / ASKED)));
            let (fx, fy) = (f64::from(x), f64::from(y));
            let inside = asked.filter(|(dx, dy)| is_inside(fx + dx, fy + dy)).count();
            let cover = inside as f64 / f64::from(ASKED * ASKED);
            mix(canvas, x, y, colour, cover);
        }
    }
}

fn glyphs(canvas: &mut Canvas, text: &str, (x, baseline): (f32, f32), size: f32, colour: Colour) {
    let height = height_of(size);
    let font = Font::sans().as_scaled(height);
    let mut pen = x;
    for (_, id, kern) in placed_glyphs(text, size) {
        pen += kern;
        let glyph = id.with_scale_and_position(height, point(pen, baseline));
        pen += font.h_advance(id);
        let Some(outlined) = font.outline_glyph(glyph) else { continue };
        let bounds = outlined.px_bounds();
        outlined.draw(|dx, dy, coverage| {
            let (x, y) = (bounds.min.x as i64 + i64::from(dx), bounds.min.y as i64 + i64::from(dy));
            let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y)) else { return };
            mix(canvas, x, y, colour, f64::from(coverage));
        });
    }
}

fn grey(
    canvas: &mut Canvas,
    [left, top, wide, high]: [u32; 4],
    columns: u32,
    levels: &[u8],
    smooth: bool,
) {
    let rows = levels.len() as u32 / columns;
    let mut put = |x: u32, y: u32, level: u8| put(canvas, left + x, top + y, [level; 3]);
    if smooth {
        let levels: Vec<f32> = levels.iter().map(|&level| level.into()).collect();
        let shown = resample(&levels, (columns, rows), (wide, high), Filter::Triangle);
        for (level, at) in shown.into_iter().zip(0..) {
            put(at % wide, at / wide, level.round() as u8);
        }
        return;
    }
    for y in 0..high {
        let row = (y * rows / high * columns) as usize;
        let row = &levels[row..row + columns as usize];
        (0..wide).for_each(|x| put(x, y, row[(x * columns / wide) as usize]));
    }
}

#[cfg(test)]
mod tests {
    use super::super::look::FigureStyle;
    use super::*;

    #[test]
    fn a_line_covers_what_it_should() {
        let mut drawing = Drawing::new(&FigureStyle::Paper.look(), 12, 9);
        drawing.line([(-5.0, 4.5), (50.0, 4.5)], 2.0, [0, 0, 0]);
        let corners = vec![(2.0, 6.0), (4.0, 6.0), (4.0, 8.5), (2.0, 8.5)];
        drawing.shapes.push(Shape::Area { corners, colour: [0, 0, 0] });
        let canvas = drawing.raster();
        let column: Vec<u8> = (0..9).map(|y| canvas.pixel(3, y).unwrap()[0]).collect();
        assert_eq!(column, [255, 255, 255, 128, 0, 128, 0, 0, 128]);
    }
}

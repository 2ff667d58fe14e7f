//! A drawing: lines, texts, points and images at their places, which is written as PNG, SVG or PDF.
//!
//! # Invariant
//! PNG, SVG and PDF are made of the same shapes
//! (`tests::the_three_files_of_a_figure_have_the_same_texts_and_images`).

use super::look::{Colour, Look};
use nirspi_files::provenance::Provenance;

/// One thing that is drawn. Lengths are pixels of the PNG, from the upper left corner.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Shape {
    /// A filled rectangle: left, top, width, height.
    Box { at: [f64; 4], colour: Colour },
    /// Straight pieces from point to point.
    Line { points: Vec<(f64, f64)>, width: f64, dashes: Vec<f64>, colour: Colour },
    /// A closed outline, filled.
    Area { corners: Vec<(f64, f64)>, colour: Colour },
    /// A line of text from `x` on, above its baseline. `size` is the size of the font.
    Text { x: f64, baseline: f64, size: f64, colour: Colour, text: String },
    /// Grey levels, row by row, in a rectangle: left, top, width, height.
    Image { at: [u32; 4], columns: u32, levels: Vec<u8>, smooth: bool },
}

/// A drawing that is laid out.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawing {
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) dpi: f64,
    pub(super) ground: Colour,
    pub(super) shapes: Vec<Shape>,
}

impl Drawing {
    /// Ground of so many columns and rows.
    pub(super) fn new(look: &Look, width: u32, height: u32) -> Self {
        let (dpi, ground) = (look.dpi, look.palette.ground);
        Self { width, height, dpi, ground, shapes: Vec::new() }
    }

    /// Draws a filled rectangle.
    pub(super) fn rect(&mut self, at: [u32; 4], colour: Colour) {
        self.shapes.push(Shape::Box { at: at.map(f64::from), colour });
    }

    /// Draws a straight line.
    pub(super) fn line(&mut self, ends: [(f64, f64); 2], width: f64, colour: Colour) {
        let points = ends.to_vec();
        self.shapes.push(Shape::Line { points, width, dashes: Vec::new(), colour });
    }

    /// Draws another drawing into this one.
    pub(super) fn place(&mut self, other: Self, left: u32, top: u32) {
        let (x, y) = (f64::from(left), f64::from(top));
        let moved = |points: &mut Vec<(f64, f64)>| {
            points.iter_mut().for_each(|point| *point = (point.0 + x, point.1 + y));
        };
        for mut shape in other.shapes {
            match &mut shape {
                Shape::Box { at, .. } => (at[0], at[1]) = (at[0] + x, at[1] + y),
                Shape::Line { points, .. } => moved(points),
                Shape::Area { corners, .. } => moved(corners),
                Shape::Text { x: at, baseline, .. } => (*at, *baseline) = (*at + x, *baseline + y),
                Shape::Image { at, .. } => (at[0], at[1]) = (at[0] + left, at[1] + top),
            }
            self.shapes.push(shape);
        }
    }

    /// The drawing as files: endings and bytes of its PNG, of SVG and of PDF.
    pub(super) fn files(
        &self,
        png: Vec<u8>,
        provenance: &Provenance,
    ) -> Vec<(&'static str, Vec<u8>)> {
        vec![
            ("png", png),
            ("svg", self.svg(provenance).into_bytes()),
            ("pdf", self.pdf(provenance)),
        ]
    }

    /// Columns and rows as a PNG.
    #[must_use]
    pub fn size(&self) -> (u32, u32) {
        (self.width, self.height)
    }

    /// Points of the typesetter in a pixel.
    pub(super) fn points_per_pixel(&self) -> f64 {
        72.0 / self.dpi
    }
}

/// An image enlarged by a whole factor, so that programs that smooth small images leave its pixels
/// sharp: columns and levels.
pub(super) fn enlarged(columns: u32, levels: &[u8], smooth: bool) -> (u32, Vec<u8>) {
    const LEAST: u32 = 256;
    let rows = levels.len() as u32 / columns.max(1);
    let factor = if smooth || rows == 1 { 1 } else { LEAST.div_ceil(columns.max(rows)).max(1) };
    let (wide, high) = (columns * factor, rows * factor);
    let at = |(x, y)| levels[(y / factor * columns + x / factor) as usize];
    (wide, (0..high).flat_map(|y| (0..wide).map(move |x| (x, y))).map(at).collect())
}

//! What tests ask of a drawing.

use super::drawing::{Drawing, Shape};
use super::text;

impl Drawing {
    /// A text that is not within this distance of the edges.
    pub(super) fn beyond(&self, margin: u32) -> Option<&Shape> {
        let (margin, width, height) =
            (f64::from(margin), f64::from(self.width), f64::from(self.height));
        self.shapes.iter().find(|shape| match shape {
            Shape::Text { x, baseline, size, text: line, .. } => {
                let right = x + f64::from(text::width(line, *size));
                let tall = baseline - 0.7 * size >= 0.0 && baseline + 0.2 * size <= height;
                *x + 1.0 < margin || right > width - margin + 1.0 || !tall
            }
            _ => false,
        })
    }

    /// Two texts that overlap.
    pub(super) fn overlapping(&self) -> Option<(&Shape, &Shape)> {
        // Left, right, top, bottom of the letters without accents.
        let place = |shape: &Shape| match shape {
            Shape::Text { x, baseline, size, text: line, .. } if !line.trim().is_empty() => {
                let right = x + f64::from(text::width(line, *size));
                Some([*x, right, baseline - 0.7 * size, *baseline])
            }
            _ => None,
        };
        let placed: Vec<_> = self.shapes.iter().filter_map(|s| Some((s, place(s)?))).collect();
        let apart = |a: [f64; 4], b: [f64; 4]| {
            a[1] <= b[0] + 0.5 || b[1] <= a[0] + 0.5 || a[3] <= b[2] || b[3] <= a[2]
        };
        let pairs = (0..placed.len()).flat_map(|b| (0..b).map(move |a| (a, b)));
        let mut touching = pairs.filter(|&(a, b)| !apart(placed[a].1, placed[b].1));
        touching.next().map(|(a, b)| (placed[a].0, placed[b].0))
    }

    /// All texts, with the size of their font in points.
    pub(super) fn texts(&self) -> Vec<(&str, f64)> {
        let texts = self.shapes.iter().filter_map(|shape| match shape {
            Shape::Text { text, size, .. } => Some((text.as_str(), size * self.points_per_pixel())),
            _ => None,
        });
        texts.collect()
    }
}

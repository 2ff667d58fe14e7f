//! Writes the patterns of an order as files for a DMD or another projector.
//!
//! # Invariant
//! The patterns are those that `--shown` means: a scene that they light gives its image
//! (`tests::a_scene_that_the_pictures_light_gives_its_image`).

use crate::files::FileError;
use crate::files::image::encode_bits;
use crate::files::measurement::{NamedPatterns, Patterns};
use crate::files::npy;
use crate::files::output::OutputDir;
use crate::provenance::{Made, Origin, Taken};
use nirspi_recon::law::Form;
use nirspi_recon::{Order, RowsError, Side, Size};
use std::path::Path;
use thiserror::Error;

/// Which patterns to write.
#[derive(Debug, Clone, PartialEq)]
pub struct PatternSet {
    /// Their order.
    pub order: Order,
    /// Side of the image.
    pub side: Side,
    /// Number of patterns, the first of the order; `None` for all.
    pub patterns: Option<usize>,
    /// How complements follow patterns.
    pub form: Form,
    /// Pixels of a picture along each side of a pixel of the pattern, at least 1.
    pub scale: u32,
    /// Whether to write one array instead of a picture each.
    pub one_array: bool,
}

/// Why patterns cannot be written. `Display` is one line.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PatternsError {
    /// A file cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The order is none of this side.
    #[error("order {order} for n = {n}: {problem}")]
    Rows {
        /// The order.
        order: String,
        /// The side.
        n: usize,
        /// The problem.
        problem: RowsError,
    },
    /// More patterns than the order has, or none.
    #[error("{asked} patterns, expected 1 to {most} for n = {n}")]
    Count {
        /// The number that was asked for.
        asked: usize,
        /// The number of all.
        most: usize,
        /// The side.
        n: usize,
    },
    /// A named set has no such patterns.
    #[error("{set}: {found}, expected {expected}")]
    Set {
        /// The set.
        set: String,
        /// What was found.
        found: String,
        /// What was expected.
        expected: String,
    },
    /// Differences are of no pictures.
    #[error(
        "readings differences, expected pairs, halves or single: a projector shows no difference"
    )]
    Differences,
}

/// What was written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WrittenPatterns {
    /// Number of patterns and complements.
    pub shown: usize,
    /// The header of a feed of readings under these patterns.
    pub header: String,
}

/// Writes the patterns of a named set into a folder: `patterns.npy`, (M, height, width), float32 from 0 to 1, in the order in
/// which they are shown, and `header.json`, the header of a feed of readings under them. Without a size, an S-matrix has the
/// one nearest to a square.
///
/// # Errors
/// [`PatternsError`], one line.
pub fn write_set(
    set: NamedPatterns,
    size: Option<Size>,
    out: &Path,
) -> Result<WrittenPatterns, PatternsError> {
    let refused = |(found, expected)| PatternsError::Set { set: set.to_string(), found, expected };
    let Patterns { size, count, weights } = set.patterns(size).map_err(refused)?;
    let (height, width) = (size.height(), size.width());
    let weights: Vec<f32> = weights.into_iter().map(|weight| weight as f32).collect();
    let header = format!(
        "{{\"height\": {height}, \"width\": {width}, \"patterns\": {count}, \"readings\": \"single\"}}"
    );
    let mut folder = OutputDir::create(out)?;
    folder.write("header.json", format!("{header}\n").as_bytes())?;
    folder.write("patterns.npy", &npy::encode(&[count, height, width], &weights))?;
    folder.commit()?;
    Ok(WrittenPatterns { shown: count, header })
}

impl PatternSet {
    /// Writes the patterns into a folder, in the order in which they are shown: `00000.png` and so on, 1 bit a pixel, white for
    /// light; or `patterns.npy`, (M, n, n / 8), with 8 pixels a byte as `numpy.packbits` has them. Beside them are
    /// `order.txt`, all rows of the order for `--shown table:order.txt`, and `header.json`, the header of a feed.
    ///
    /// # Errors
    /// [`PatternsError`], one line.
    pub fn write(&self, out: &Path, made: &Made) -> Result<WrittenPatterns, PatternsError> {
        let (n, area) = (self.side.pixels(), self.side.area());
        let rows = self.order.rows(self.side).map_err(|problem| {
            let order = self.order.to_string();
            PatternsError::Rows { order, n, problem }
        })?;
        let count = self.patterns.unwrap_or(area);
        if !(1..=area).contains(&count) {
            return Err(PatternsError::Count { asked: count, most: area, n });
        }
        let shown: Vec<(u32, bool)> = match self.form {
            Form::Pairs => {
                rows[..count].iter().flat_map(|&row| [(row, true), (row, false)]).collect()
            }
            Form::Halves => {
                let half = |light| rows[..count].iter().map(move |&row| (row, light));
                half(true).chain(half(false)).collect()
            }
            Form::Single => rows[..count].iter().map(|&row| (row, true)).collect(),
            Form::Differences => return Err(PatternsError::Differences),
        };
        let mut folder = OutputDir::create(out)?;
        let table: String = rows.iter().map(|row| format!("{row}\n")).collect();
        let named = format!(
            "# {}, n = {n}: entry k is the natural-order Hadamard row shown k-th\n",
            self.order
        );
        folder.write("order.txt", (named + &table).as_bytes())?;
        let header = self.header(&rows[..count]);
        folder.write("header.json", format!("{header}\n").as_bytes())?;
        if self.one_array {
            let wide = n.div_ceil(8);
            let bits: Vec<u8> =
                shown.iter().flat_map(|&(row, light)| bits(row, light, n, 1)).collect();
            folder.write("patterns.npy", &npy::encode(&[shown.len(), n, wide], &bits))?;
        } else {
            let provenance = Taken::without_camera(Origin::Computed).made(made);
            let side = n as u32 * self.scale;
            // Sorted by name, the pictures are in their order.
            let digits = (shown.len() - 1).to_string().len().max(5);
            for (at, &(row, light)) in shown.iter().enumerate() {
                let bits = bits(row, light, n, self.scale as usize);
                folder
                    .write(&format!("{at:0digits$}.png"), &encode_bits(side, &bits, &provenance))?;
            }
        }
        folder.commit()?;
        Ok(WrittenPatterns { shown: shown.len(), header })
    }

    /// The header of a feed of readings under these patterns.
    fn header(&self, rows: &[u32]) -> String {
        let (n, readings) = (self.side.pixels(), self.form.name());
        match (&self.order, rows.len() == self.side.area()) {
            (Order::Table(_), _) => {
                let rows: Vec<String> = rows.iter().map(ToString::to_string).collect();
                let rows = rows.join(",");
                format!("{{\"n\": {n}, \"h_row\": [{rows}], \"readings\": \"{readings}\"}}")
            }
            (order, true) => {
                format!("{{\"n\": {n}, \"order\": \"{order}\", \"readings\": \"{readings}\"}}")
            }
            (order, false) => format!(
                "{{\"n\": {n}, \"order\": \"{order}\", \"patterns\": {}, \"readings\": \"{readings}\"}}",
                rows.len()
            ),
        }
    }
}

/// The pixels of a pattern, or of its complement, 8 in a byte, the first in the highest bit. Each line begins with a byte.
fn bits(row: u32, light: bool, n: usize, scale: usize) -> Vec<u8> {
    let mut bits = Vec::new();
    for r in 0..n {
        let mut line = vec![0_u8; (n * scale).div_ceil(8)];
        for x in 0..n * scale {
            let pixel = (r * n + x / scale) as u32;
            let plus = (row & pixel).count_ones().is_multiple_of(2);
            line[x / 8] |= u8::from(plus == light) << (7 - x % 8);
        }
        (0..scale).for_each(|_| bits.extend_from_slice(&line));
    }
    bits
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::feed::Header;
    use crate::files::image::read_grey;
    use crate::order_table::read_order_table;
    use nirspi_recon::Measurements;
    use nirspi_recon::reconstruct::hadamard;

    fn set(form: Form) -> PatternSet {
        let (order, side) = (Order::ZigZag, Side::new(8).unwrap());
        PatternSet { order, side, patterns: None, form, scale: 1, one_array: false }
    }

    fn made() -> Made {
        Made::by("nirspi", None, [""; 0], 0)
    }

    #[test]
    fn a_scene_that_the_pictures_light_gives_its_image() {
        let scene: Vec<f32> = (0..64).map(|pixel| (pixel * 7 % 11) as f32).collect();
        for scale in [1, 3] {
            let folder = tempfile::tempdir().unwrap();
            let set = PatternSet { scale, ..set(Form::Pairs) };
            let written = set.write(folder.path(), &made()).unwrap();
            assert_eq!(written.shown, 128);
            let light = |at: usize| -> f64 {
                let grey = read_grey(&folder.path().join(format!("{at:05}.png"))).unwrap();
                assert_eq!(grey.width, 8 * scale);
                let lit = |pixel: usize| {
                    let (r, c) = (pixel / 8 * scale as usize, pixel % 8 * scale as usize);
                    grey.values[r * grey.width as usize + c]
                };
                (0..64).map(|pixel| f64::from(lit(pixel) * scene[pixel])).sum()
            };
            let readings: Vec<f64> = (0..128).map(light).collect();
            let rows = set.order.rows(set.side).unwrap();
            let read = Measurements::from_pairs(&rows, &readings).unwrap();
            let image = hadamard(&read.measurements);
            for (found, expected) in image.pixels().iter().zip(&scene) {
                assert!((found - expected).abs() < 1e-3, "{found} {expected}");
            }
            // The table and the header mean the same patterns.
            let table = read_order_table(&folder.path().join("order.txt")).unwrap();
            assert_eq!(table, *rows);
            let header: Header = written.header.parse().unwrap();
            assert_eq!((header.hadamard().unwrap().1, header.form), (&rows[..], Form::Pairs));
        }
    }

    #[test]
    fn an_array_has_the_bits_of_the_pictures_in_the_order_of_the_form() {
        let folder = tempfile::tempdir().unwrap();
        let set = PatternSet { one_array: true, patterns: Some(3), ..set(Form::Halves) };
        let written = set.write(folder.path(), &made()).unwrap();
        let bytes = std::fs::read(folder.path().join("patterns.npy")).unwrap();
        let rows = set.order.rows(set.side).unwrap();
        let shown = [(0, true), (1, true), (2, true), (0, false), (1, false), (2, false)];
        let bits = shown.map(|(at, light)| bits(rows[at], light, 8, 1)).concat();
        assert_eq!((written.shown, bits.len()), (6, 48));
        assert!(bytes.ends_with(&bits) && bytes.len() == 128 + 48, "{}", bytes.len());
        assert_eq!(&bits[..8], &[0xff; 8], "the first pattern is all light");
        assert!(written.header.contains("\"patterns\": 3, \"readings\": \"halves\""));
        let refused = |set: PatternSet| set.write(folder.path(), &made()).unwrap_err().to_string();
        let many = PatternSet { patterns: Some(65), ..set.clone() };
        assert_eq!(refused(many), "65 patterns, expected 1 to 64 for n = 8");
        let table = PatternSet { order: Order::Table(vec![0, 1]), ..set };
        assert!(refused(table).starts_with("order table for n = 8: "));
    }
}

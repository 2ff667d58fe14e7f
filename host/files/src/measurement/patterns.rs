//! Patterns of a user's own: an array in a file of any format, or a folder of pictures.

use super::FileError;
use crate::array::{has_shape, shape_text};
use crate::fields::{Fields, UNNAMED};
use crate::folder::by_number;
use crate::image::{pictures_in, read_grey};
use crate::plain::MAX_MEMORY_BYTES;
use nirspi_recon::Size;
use std::borrow::Cow;
use std::path::Path;

/// The names of an array of patterns in a file of several arrays.
const NAMES: [&str; 2] = ["patterns", "matrix"];

/// Patterns, one after another, each row-major.
#[derive(Debug, Clone, PartialEq)]
pub struct Patterns {
    /// Height and width of a pattern.
    pub size: Size,
    /// Number of patterns, at least 1.
    pub count: usize,
    /// `count * size.area()` finite weights.
    pub weights: Vec<f64>,
}

impl Patterns {
    /// The weights of these patterns, one after another. If all are chosen, nothing is copied.
    ///
    /// # Panics
    /// If a pattern does not exist.
    #[must_use]
    pub fn select(&self, patterns: &[usize]) -> Cow<'_, [f64]> {
        let area = self.size.area();
        match patterns.iter().copied().eq(0..patterns.len()) {
            true => Cow::Borrowed(&self.weights[..patterns.len() * area]),
            false => patterns
                .iter()
                .flat_map(|pattern| &self.weights[pattern * area..(pattern + 1) * area])
                .copied()
                .collect(),
        }
    }

    /// What a difference of pattern and complement weighs the light with: a weight and its distance
    /// to full light, or positive and negative weights, whose parts were shown one after the other.
    #[must_use]
    pub fn differences(mut self) -> Self {
        let full = self.weights.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if self.weights.iter().all(|&weight| weight >= 0.0) {
            self.weights.iter_mut().for_each(|weight| *weight = 2.0 * *weight - full);
        }
        self
    }
}

/// What the file of the patterns does not say.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PatternSelection {
    /// Height and width of a pattern. By default those of a stack of pictures, or of a square.
    pub size: Option<Size>,
    /// The array of the patterns. By default the only one with two or three axes, or that of one of
    /// the names `patterns` and `matrix`.
    pub field: Option<String>,
    /// Whether the pixels of a pattern in a row are numbered down the columns of the image.
    pub transpose: bool,
}

/// An array of patterns, of which the number of readings says where its patterns are.
pub(super) struct PatternArray<'p> {
    path: &'p Path,
    name: String,
    shape: Vec<usize>,
    weights: Vec<f64>,
    transpose: bool,
}

/// A way to take an array as patterns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Arrangement {
    /// Number of patterns.
    pub(super) count: usize,
    pub(super) size: Size,
    /// Whether patterns are along the last axis instead of the first.
    pub(super) is_last: bool,
}

impl<'p> PatternArray<'p> {
    pub(super) fn open(path: &'p Path, want: &PatternSelection) -> Result<Self, FileError> {
        let (name, shape, weights) = match path.is_dir() {
            true => pictures(path)?,
            false => array(path, want.field.as_deref())?,
        };
        let found = Self { path, name, shape, weights, transpose: want.transpose };
        if found.transpose && found.shape.len() == 3 {
            let expected = "patterns as rows for --transpose: pictures have rows and columns";
            return Err(found.refused(has_shape(&found.axes()), expected));
        }
        if let Some(at) = found.weights.iter().position(|weight| !weight.is_finite()) {
            return Err(found.refused(
                format!("is {} at {}", found.weights[at], found.place(at)),
                "finite weights",
            ));
        }
        Ok(found)
    }

    /// How the array can be taken, the usual way first: at least one.
    pub(super) fn arrangements(&self, size: Option<Size>) -> Result<Vec<Arrangement>, FileError> {
        let of_area = |area| match size {
            Some(size) => (size.area() == area).then_some(size),
            None => Size::square(area),
        };
        let of_sides = |height, width| {
            Size::new(height, width).ok().filter(|own| size.is_none_or(|size| size == *own))
        };
        let (first, last, sizes) = match self.shape[..] {
            [first, last] => (first, last, [of_area(last), of_area(first)]),
            [first, middle, last] => {
                (first, last, [of_sides(middle, last), of_sides(first, middle)])
            }
            _ => (0, 0, [None, None]),
        };
        let along = |count, size: Option<Size>, is_last| {
            size.filter(|_| count > 0).map(|size| Arrangement { count, size, is_last })
        };
        let found: Vec<Arrangement> = [along(first, sizes[0], false), along(last, sizes[1], true)]
            .into_iter()
            .flatten()
            .collect();
        match found.is_empty() {
            false => Ok(found),
            true => {
                let expected = match size {
                    Some(size) => format!(
                        "(M, {}) or (M, {}, {}): patterns of {size} pixels",
                        size.area(),
                        size.height(),
                        size.width()
                    ),
                    None => "(M, n * n), a pattern a row, or (M, height, width), a picture a pattern; or --size HxW for rows of \
                             other patterns"
                        .to_owned(),
                };
                Err(self.refused(has_shape(&self.axes()), expected))
            }
        }
    }

    /// The patterns in this arrangement.
    pub(super) fn patterns(self, arrangement: Arrangement) -> Patterns {
        let Arrangement { count, size, is_last } = arrangement;
        let area = size.area();
        let mut weights = match is_last {
            false => self.weights,
            true => {
                (0..count * area).map(|at| self.weights[(at % area) * count + at / area]).collect()
            }
        };
        if self.transpose {
            let mut turned = vec![0.0; area];
            for pattern in weights.chunks_exact_mut(area) {
                for (at, turned) in turned.iter_mut().enumerate() {
                    *turned = pattern[(at % size.width()) * size.height() + at / size.width()];
                }
                pattern.copy_from_slice(&turned);
            }
        }
        Patterns { size, count, weights }
    }

    /// A note for an arrangement that is not the usual one.
    pub(super) fn note(&self, arrangement: Arrangement) -> Option<String> {
        arrangement.is_last.then(|| {
            format!(
                "the patterns are along the last axis of {}, of shape {}",
                self.path.display(),
                shape_text(&self.axes())
            )
        })
    }

    pub(super) fn axes(&self) -> Vec<u64> {
        self.shape.iter().map(|&axis| axis as u64).collect()
    }

    /// The place of a number in the array, as NumPy writes it.
    fn place(&self, mut at: usize) -> String {
        let mut places = Vec::new();
        for &axis in self.shape.iter().rev() {
            places.insert(0, (at % axis).to_string());
            at /= axis;
        }
        format!("[{}]", places.join(", "))
    }

    pub(super) fn refused(&self, found: String, expected: impl Into<String>) -> FileError {
        FileError::field(self.path, self.name.clone(), found, expected)
    }
}

/// The pictures of a folder, in the order of the numbers in their names: grey levels from 0 to 1.
fn pictures(folder: &Path) -> Result<(String, Vec<usize>, Vec<f64>), FileError> {
    let mut files = pictures_in(folder)?;
    files.sort_by(|a, b| by_number(a, b));
    let (mut weights, mut first) = (Vec::new(), None);
    for file in &files {
        let grey = read_grey(file)?;
        let size = (grey.height, grey.width);
        if *first.get_or_insert(size) != size {
            let expected = "pictures of one size in a folder of patterns";
            let found = format!("is {} x {} pixels", size.0, size.1);
            return Err(FileError::field(file, "the picture", found, expected));
        }
        if (weights.len() + grey.values.len()) as u64 * 8 > MAX_MEMORY_BYTES {
            return Err(FileError::kind(
                folder,
                "too many pictures",
                "patterns of at most 512 MiB",
            ));
        }
        weights.extend(grey.values.into_iter().map(f64::from));
    }
    match first {
        Some((height, width)) => {
            let shape = vec![files.len(), height as usize, width as usize];
            Ok(("pictures".to_owned(), shape, weights))
        }
        None => Err(FileError::kind(
            folder,
            "a folder without pictures",
            "PNG files, a pattern each, or a file of patterns",
        )),
    }
}

/// The array of the patterns in a file: its name, shape and numbers.
fn array(path: &Path, asked: Option<&str>) -> Result<(String, Vec<usize>, Vec<f64>), FileError> {
    let mut fields = Fields::open(path, false)?;
    let name = match asked {
        _ if fields.is_unnamed() => UNNAMED.to_owned(),
        Some(asked) if fields.holds(asked) => asked.to_owned(),
        Some(asked) => {
            let expected = format!("--matrix-field with one of {}", fields.names().join(", "));
            return Err(FileError::field(path, asked.to_owned(), "is not in the file", expected));
        }
        None => only_array(&mut fields)?,
    };
    if asked.is_some() && fields.is_unnamed() {
        let expected = "no --matrix-field for an array without a name";
        return Err(FileError::field(path, UNNAMED, "is all that the file holds", expected));
    }
    let found = fields.into_field(&name)?;
    match found.imaginary {
        None => Ok((name, found.shape, found.real)),
        Some(_) => Err(FileError::field(path, name, "has complex numbers", "real weights")),
    }
}

/// The only array of two or three axes, or the one with a name of patterns.
fn only_array(fields: &mut Fields) -> Result<String, FileError> {
    let named = NAMES.into_iter().find(|name| fields.holds(name));
    if let Some(name) = named {
        return Ok(name.to_owned());
    }
    let mut found = Vec::new();
    for name in fields.names().to_vec() {
        let shape = fields.open_field(&name, |_| Ok(())).map(|(shape, _)| shape);
        if shape.is_ok_and(|shape| shape.iter().filter(|&&axis| axis > 1).count() >= 2) {
            found.push(name);
        }
    }
    match &mut found[..] {
        [only] => Ok(std::mem::take(only)),
        _ => {
            let expected = "an array `patterns` or `matrix`, or --matrix-field NAME";
            Err(FileError::missing(fields.path(), "patterns", fields.names(), expected))
        }
    }
}

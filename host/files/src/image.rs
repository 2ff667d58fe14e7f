//! Grey pictures: PNG and JPEG in, PNG out.
//!
//! A grey level is the value: v / 255 (or v / 65 535), in both directions, without linearisation.
//! Test scenes and data sets of the field use the same convention. A written file reads back as it
//! was written (`tests::all_256_grey_levels_survive_a_round_trip`), and metrics against a user's
//! own file use the user's numbers. Undoing the tone curve of a photograph would not give a
//! reflectance at 1550 nm: a visible picture does not show what a surface reflects there.
//!
//! A picture with labels that this program has written (title, grey bar, warnings) is read as the
//! image in it.

mod canvas;
mod encoded;
mod labelled;
mod resample;
mod signed;

use super::FileError;
use super::plain::{MAX_MEMORY_BYTES, kind_by_start, open_file};
use crate::provenance::Provenance;
use std::borrow::Cow;
use std::collections::HashMap;
use std::io::{BufRead, BufReader, Seek};
use std::path::{Path, PathBuf};

use encoded::{Encoded, Kind, Unread};

pub use canvas::Canvas;
pub use labelled::{Placed, encode_labelled};
pub use resample::{Filter, resample};
pub use signed::provenance_of;
pub use signed::sign;

const EXPECTED: &str = "a PNG or JPEG image";

/// A square map of reflectance in `[0, 1]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Reflectance {
    /// Edge in pixels, at least 1.
    pub size_px: usize,
    /// `size_px * size_px` values, row-major.
    pub values: Vec<f32>,
}

/// Reads a JPEG, or a PNG of any kind (grey, RGB, palette, with or without alpha, up to 16 bit) as
/// reflectance.
///
/// Colour becomes Rec. 709 luma (0.2126 R + 0.7152 G + 0.0722 B of the stored values). Transparent
/// pixels show a black ground. A picture that is not square is cropped to its centre.
///
/// # Errors
/// [`FileError`], one line that names file, what was found and what was expected.
pub fn read_reflectance(path: &Path) -> Result<Reflectance, FileError> {
    let square = read_grey(path)?.central_square();
    Ok(Reflectance { size_px: square.width as usize, values: square.values })
}

/// A grey picture in `[0, 1]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Grey {
    /// Columns, at least 1.
    pub width: u32,
    /// Rows, at least 1.
    pub height: u32,
    /// `width * height` values, row-major.
    pub values: Vec<f32>,
}

/// Reads a PNG or JPEG of any kind as [`read_reflectance`] does, but of any shape and without
/// cropping.
///
/// # Errors
/// [`FileError`], one line that names file, what was found and what was expected.
pub fn read_grey(path: &Path) -> Result<Grey, FileError> {
    read_grey_if(path, |_| Ok(()))
}

/// As [`read_grey`], for a caller that needs pictures of a certain size: `fits` judges width and height, in pixels,
/// before the pixels are decoded. The header also says how much memory the pixels and their grey levels will take.
///
/// # Errors
/// As [`read_grey`], and the errors of `fits`.
pub fn read_grey_if<E: From<FileError>>(
    path: &Path,
    fits: impl FnOnce((u32, u32)) -> Result<(), E>,
) -> Result<Grey, E> {
    let (file, _) = open_file(path, EXPECTED)?;
    let read = |error| FileError::io(path, "read", error);
    let mut stream = BufReader::new(file);
    let start = stream.fill_buf().map_err(read)?;
    let Some(kind) = Kind::by_start(start) else {
        // The signature goes on behind what names the kind.
        let found = match start.starts_with(b"\x89PNG") {
            true => "a PNG image with a damaged signature",
            false => kind_by_start(start),
        };
        return Err(FileError::kind(path, found, EXPECTED).into());
    };
    let labels = match kind {
        Kind::Png => labelled::labels_of(&mut stream),
        Kind::Jpeg => None,
    };
    stream.rewind().map_err(read)?;
    let wrong = |(found, expected): (String, &'static str)| FileError::kind(path, found, expected);
    let labels = labels.transpose().map_err(|e| wrong((format!("labels: {e}"), EXPECTED)))?;

    let unread = |error: Unread| match error {
        Unread::TooLarge => too_large(path, None),
        Unread::Damaged(found) => FileError::damaged(path, found, EXPECTED),
    };
    let encoded = Encoded::open(stream, kind, MAX_MEMORY_BYTES).map_err(unread)?;
    let (width, height) = encoded.size();
    let grey_bytes = u64::from(width) * u64::from(height) * size_of::<f32>() as u64;
    if encoded.decoded_bytes().saturating_add(grey_bytes) > MAX_MEMORY_BYTES {
        return Err(too_large(path, Some((width, height))).into());
    }
    // The image in a picture with labels is smaller.
    if labels.is_none() {
        fits((width, height))?;
    }
    let picture = encoded.grey().map_err(unread)?;
    match labels {
        None => Ok(picture),
        Some(labels) => Ok(labelled::image_in(&picture, &labels).map_err(wrong)?),
    }
}

impl Grey {
    /// The picture's central square, averaged down or interpolated to `side_px` pixels an edge.
    /// Values stay in `[0, 1]`.
    ///
    /// # Panics
    /// If `side_px` is 0.
    #[must_use]
    pub fn resized(&self, side_px: u32) -> Self {
        self.central_square().scaled((side_px, side_px), Filter::Triangle)
    }

    /// The picture's central square.
    fn central_square(&self) -> Self {
        let edge = self.width.min(self.height);
        self.part(((self.width - edge) / 2, (self.height - edge) / 2), (edge, edge))
    }

    /// A part of the picture.
    ///
    /// # Panics
    /// If the part does not lie inside of the picture, or has no pixel.
    #[must_use]
    pub fn part(&self, (left, top): (u32, u32), (width, height): (u32, u32)) -> Self {
        assert!(left + width <= self.width && width * height > 0, "a part of {width} x {height}");
        let row = |y| &self.values[(y * self.width + left) as usize..][..width as usize];
        Self { width, height, values: (top..top + height).flat_map(row).copied().collect() }
    }

    /// The picture with so many columns and rows. Values stay in `[0, 1]`.
    ///
    /// # Panics
    /// If a side is 0.
    #[must_use]
    pub fn scaled(&self, size: (u32, u32), filter: Filter) -> Self {
        let mut values = resample(&self.values, (self.width, self.height), size, filter);
        values.iter_mut().for_each(|value| *value = value.clamp(0.0, 1.0));
        Self { width: size.0, height: size.1, values }
    }

    /// One pixel's value.
    ///
    /// # Panics
    /// Outside of the picture.
    #[must_use]
    pub fn value(&self, x: u32, y: u32) -> f32 {
        self.values[(y * self.width + x) as usize]
    }
}

/// The error for a picture that takes more memory than [`MAX_MEMORY_BYTES`].
fn too_large(path: &Path, size: Option<(u32, u32)>) -> FileError {
    let size = size.map(|(width, height)| format!(" ({width} x {height} pixels)"));
    let found = format!("an image that is too large{}", size.unwrap_or_default());
    FileError::kind(path, found, "at most 512 MiB in memory, decoded and as grey levels of 4 bytes")
}

/// The ending of pictures for people beside results for programs. Folders are read without them.
pub const FOR_PEOPLE: &str = ".picture.png";

/// Whether a file's name is that of a PNG or JPEG.
#[must_use]
pub fn is_picture(path: &Path) -> bool {
    let has = |ending: &str| path.extension().is_some_and(|e| e.eq_ignore_ascii_case(ending));
    ["png", "jpg", "jpeg"].into_iter().any(has)
}

/// The PNG and JPEG files of a folder, sorted by name, without the pictures for people.
///
/// # Errors
/// [`FileError`] if the folder cannot be read.
pub fn pictures_in(folder: &Path) -> Result<Vec<PathBuf>, FileError> {
    let io = |system| FileError::io(folder, "read", system);
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(io)? {
        let file = entry.map_err(io)?.path();
        let for_people = file.to_string_lossy().ends_with(FOR_PEOPLE);
        if is_picture(&file) && !for_people {
            files.push(file);
        }
    }
    files.sort();
    Ok(files)
}

/// The bytes of an 8-bit grey PNG of values in `[0, 1]`, row-major, with their provenance. Values outside the range are
/// clipped; NaN becomes black.
///
/// # Panics
/// If there are not exactly `width * height` values, or none.
#[must_use]
pub fn encode_grey(
    width: usize,
    height: usize,
    values: &[f32],
    provenance: &Provenance,
) -> Vec<u8> {
    assert_eq!(width * height, values.len(), "values of a {width} x {height} picture");
    let levels: Vec<u8> = values.iter().map(|&value| to_level(value)).collect();
    written((width as u32, height as u32), provenance, |encoder| {
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_compression(png::Compression::Fast);
        Ok(levels.into())
    })
}

/// The bytes of an 8-bit colour PNG with its provenance.
///
/// # Panics
/// If the picture has no pixel.
#[must_use]
pub fn encode_rgb(picture: &Canvas, provenance: &Provenance) -> Vec<u8> {
    encode_colours(picture, &[], provenance)
}

/// The bytes of a colour PNG with more text chunks. A picture of few colours has a palette: its file
/// is a third smaller.
fn encode_colours(picture: &Canvas, texts: &[(&str, String)], provenance: &Provenance) -> Vec<u8> {
    written((picture.width(), picture.height()), provenance, |encoder| {
        for (key, text) in texts {
            encoder.add_text_chunk((*key).to_owned(), text.clone())?;
        }
        match indexed(picture) {
            Some((palette, pixels)) => {
                encoder.set_color(png::ColorType::Indexed);
                encoder.set_palette(palette);
                encoder.set_filter(png::Filter::NoFilter);
                Ok(pixels.into())
            }
            None => {
                encoder.set_color(png::ColorType::Rgb);
                Ok(picture.pixels().as_flattened().into())
            }
        }
    })
}

/// The colours of a picture, three bytes each, and the number of each pixel's colour; `None` for a
/// picture of more than 256 colours.
fn indexed(picture: &Canvas) -> Option<(Vec<u8>, Vec<u8>)> {
    let mut numbers = HashMap::new();
    let mut palette = Vec::new();
    let colours = picture.pixels();
    let mut pixels = Vec::with_capacity(colours.len());
    // Most pixels have the colour of the one before.
    for run in colours.chunk_by(|a, b| a == b) {
        let colour = run[0];
        let number = match numbers.get(&colour) {
            Some(number) => *number,
            None => {
                let number = u8::try_from(numbers.len()).ok()?;
                numbers.insert(colour, number);
                palette.extend(colour);
                number
            }
        };
        pixels.resize(pixels.len() + run.len(), number);
    }
    Some((palette, pixels))
}

/// The 8-bit grey level of a value in `[0, 1]`; NaN is black.
#[must_use]
pub fn to_level(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0).round() as u8
}

/// The bytes of an 8-bit PNG with its provenance, unless `set` sets another depth; `set` gives the pixels.
fn written<'p>(
    (width, height): (u32, u32),
    provenance: &Provenance,
    set: impl FnOnce(&mut png::Encoder<'_, &mut Vec<u8>>) -> Result<Cow<'p, [u8]>, png::EncodingError>,
) -> Vec<u8> {
    let mut bytes = Vec::new();
    let encoded = (|| {
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_depth(png::BitDepth::Eight);
        let pixels = set(&mut encoder)?;
        sign(&mut encoder, provenance)?;
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&pixels)?;
        writer.finish()
    })();
    encoded.expect("a picture of at least one pixel encodes into memory");
    bytes
}

/// A square picture of black and white: 8 pixels in a byte, the first in the highest bit; each line begins with a byte.
///
/// # Panics
/// If there are not as many bytes as the picture has.
#[must_use]
pub fn encode_bits(side: u32, bits: &[u8], provenance: &Provenance) -> Vec<u8> {
    written((side, side), provenance, |encoder| {
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(png::BitDepth::One);
        Ok(bits.into())
    })
}

#[cfg(test)]
mod tests;

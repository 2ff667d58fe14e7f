//! PNG and JPEG as they lie in files, and their grey levels.
//!
//! Size and memory are known before a pixel is decoded.

use super::Grey;
use std::io::{BufRead, Read as _, Seek};
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// The first bytes of each kind of file.
const PNG: &[u8] = b"\x89PNG\r\n\x1a\n";
const JPEG: &[u8] = b"\xff\xd8\xff";

/// The longest side that a JPEG can state.
const LONGEST_JPEG: usize = u16::MAX as usize;

/// The kinds of picture that are read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    Png,
    Jpeg,
}

impl Kind {
    /// The kind of a file that begins with these bytes.
    pub(super) fn by_start(bytes: &[u8]) -> Option<Self> {
        let kinds = [(PNG, Self::Png), (JPEG, Self::Jpeg)];
        kinds.into_iter().find_map(|(start, kind)| bytes.starts_with(start).then_some(kind))
    }
}

/// Why a picture is not read.
#[derive(Debug)]
pub(super) enum Unread {
    /// It would take more memory than it may.
    TooLarge,
    /// What is wrong with the file.
    Damaged(String),
}

impl From<png::DecodingError> for Unread {
    fn from(error: png::DecodingError) -> Self {
        match error {
            png::DecodingError::LimitsExceeded => Self::TooLarge,
            error => Self::Damaged(error.to_string()),
        }
    }
}

/// A picture whose header has been read, and no pixel.
pub(super) struct Encoded<R: BufRead + Seek> {
    pixels: Pixels<R>,
    /// Columns and rows as they are stored.
    width: usize,
    height: usize,
    upright: Upright,
}

enum Pixels<R: BufRead + Seek> {
    Png(Box<png::Reader<R>>),
    Jpeg(Box<JpegDecoder<ZCursor<Vec<u8>>>>),
}

impl<R: BufRead + Seek> Encoded<R> {
    /// Reads the header, with at most so many bytes of memory.
    pub(super) fn open(stream: R, kind: Kind, most_bytes: u64) -> Result<Self, Unread> {
        match kind {
            Kind::Png => Self::open_png(stream, most_bytes),
            Kind::Jpeg => Self::open_jpeg(stream, most_bytes),
        }
    }

    fn open_png(stream: R, most_bytes: u64) -> Result<Self, Unread> {
        let bytes = usize::try_from(most_bytes).unwrap_or(usize::MAX);
        let mut decoder = png::Decoder::new_with_limits(stream, png::Limits { bytes });
        // Palettes become colours, and few bits become eight.
        decoder.set_transformations(png::Transformations::EXPAND);
        let reader = decoder.read_info()?;
        let info = reader.info();
        let upright = info.exif_metadata.as_deref().map_or(Upright::default(), Upright::of_exif);
        let (width, height) = (info.width as usize, info.height as usize);
        Ok(Self { pixels: Pixels::Png(Box::new(reader)), width, height, upright })
    }

    fn open_jpeg(stream: R, most_bytes: u64) -> Result<Self, Unread> {
        let damaged = |error: &dyn std::fmt::Display| Unread::Damaged(error.to_string());
        let mut file = Vec::new();
        let mut stream = stream.take(most_bytes + 1);
        stream.read_to_end(&mut file).map_err(|error| damaged(&error))?;
        if file.len() as u64 > most_bytes {
            return Err(Unread::TooLarge);
        }
        // As browsers do: what can be read is read.
        let options = DecoderOptions::default()
            .set_strict_mode(false)
            .set_max_width(LONGEST_JPEG)
            .set_max_height(LONGEST_JPEG);
        let mut decoder = JpegDecoder::new_with_options(ZCursor::new(file), options);
        decoder.decode_headers().map_err(|error| damaged(&error))?;
        let (Some((width, height)), Some(stored)) =
            (decoder.dimensions(), decoder.input_colorspace())
        else {
            return Err(Unread::Damaged("no size".to_owned()));
        };
        let shown = if stored == ColorSpace::Luma { stored } else { ColorSpace::RGB };
        decoder.set_options(decoder.options().jpeg_set_out_colorspace(shown));
        let upright = decoder.exif().map_or(Upright::default(), |exif| Upright::of_exif(exif));
        Ok(Self { pixels: Pixels::Jpeg(Box::new(decoder)), width, height, upright })
    }

    /// Columns and rows, the right side up.
    pub(super) fn size(&self) -> (u32, u32) {
        let (width, height) = self.upright.size(self.width, self.height);
        (width as u32, height as u32)
    }

    /// Bytes that its decoded pixels take.
    pub(super) fn decoded_bytes(&self) -> u64 {
        let bytes = match &self.pixels {
            Pixels::Png(reader) => reader.output_buffer_size(),
            Pixels::Jpeg(decoder) => decoder.output_buffer_size(),
        };
        bytes.map_or(u64::MAX, |bytes| bytes as u64)
    }

    /// The grey levels, the right side up.
    pub(super) fn grey(self) -> Result<Grey, Unread> {
        let size = self.size();
        let bytes = usize::try_from(self.decoded_bytes()).map_err(|_| Unread::TooLarge)?;
        let mut bytes = vec![0; bytes];
        let (channels, is_deep) = match self.pixels {
            Pixels::Png(mut reader) => {
                let (colour, depth) = reader.output_color_type();
                reader.next_frame(&mut bytes)?;
                (colour.samples(), depth == png::BitDepth::Sixteen)
            }
            Pixels::Jpeg(mut decoder) => {
                let damaged = |error| Unread::Damaged(format!("{error}"));
                decoder.decode_into(&mut bytes).map_err(damaged)?;
                let is_grey = decoder.output_colorspace() == Some(ColorSpace::Luma);
                (if is_grey { 1 } else { 3 }, false)
            }
        };
        let stored = Stored { bytes, channels, is_deep };
        let values =
            self.upright.places(self.width, self.height).map(|at| stored.grey(at)).collect();
        Ok(Grey { width: size.0, height: size.1, values })
    }
}

/// Pixels as they are stored, row-major.
struct Stored {
    bytes: Vec<u8>,
    /// Grey, grey and opacity, colour, colour and opacity.
    channels: usize,
    /// Whether a sample has 16 bits, the high ones first.
    is_deep: bool,
}

impl Stored {
    /// One sample, 0 to 1.
    fn sample(&self, at: usize) -> f32 {
        if self.is_deep {
            let bytes = [self.bytes[2 * at], self.bytes[2 * at + 1]];
            return f32::from(u16::from_be_bytes(bytes)) / 65_535.0;
        }
        f32::from(self.bytes[at]) / 255.0
    }

    /// The grey level of one pixel, 0 to 1.
    fn grey(&self, pixel: usize) -> f32 {
        let sample = |channel| self.sample(pixel * self.channels + channel);
        let [r, g, b, opacity] = match self.channels {
            // Through colour, it would be rounded.
            1 => return sample(0),
            2 => [sample(0), sample(0), sample(0), sample(1)],
            3 => [sample(0), sample(1), sample(2), 1.0],
            _ => [sample(0), sample(1), sample(2), sample(3)],
        };
        ((0.2126 * r + 0.7152 * g + 0.0722 * b) * opacity).clamp(0.0, 1.0)
    }
}

/// How a stored picture becomes upright. A phone stores the picture as its sensor was held, and the
/// file states which side is up.
#[derive(Debug, Clone, Copy, Default)]
struct Upright {
    /// Rows become columns.
    is_transposed: bool,
    /// The stored columns run from right to left.
    flips_x: bool,
    /// The stored rows run from bottom to top.
    flips_y: bool,
}

impl Upright {
    /// Tag `Orientation` of Exif 2.32, section 4.6.4. A file that states nothing is upright.
    fn of_exif(exif: &[u8]) -> Self {
        let number = orientation(exif).unwrap_or(1);
        Self {
            is_transposed: matches!(number, 5..=8),
            flips_x: matches!(number, 2 | 3 | 7 | 8),
            flips_y: matches!(number, 3 | 4 | 6 | 7),
        }
    }

    /// Columns and rows.
    fn size(self, width: usize, height: usize) -> (usize, usize) {
        if self.is_transposed { (height, width) } else { (width, height) }
    }

    /// For each pixel of the upright picture, row-major, the stored pixel.
    fn places(self, width: usize, height: usize) -> impl Iterator<Item = usize> {
        let (columns, rows) = self.size(width, height);
        (0..rows).flat_map(move |y| {
            (0..columns).map(move |x| {
                let (x, y) = if self.is_transposed { (y, x) } else { (x, y) };
                let x = if self.flips_x { width - 1 - x } else { x };
                let y = if self.flips_y { height - 1 - y } else { y };
                y * width + x
            })
        })
    }
}

/// The number of the tag `Orientation` in Exif, which is a TIFF file without an image.
fn orientation(exif: &[u8]) -> Option<u16> {
    const ORIENTATION: u16 = 0x112;
    const SHORT: u16 = 3;
    let is_big = match exif.first_chunk()? {
        b"MM\0\x2a" => true,
        b"II\x2a\0" => false,
        _ => return None,
    };
    let short = |at: usize| {
        let bytes = *exif.get(at..)?.first_chunk()?;
        Some(if is_big { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) })
    };
    let long = |at: usize| {
        let bytes = *exif.get(at..)?.first_chunk()?;
        Some(if is_big { u32::from_be_bytes(bytes) } else { u32::from_le_bytes(bytes) })
    };
    let list = long(4)? as usize;
    let mut entries = (0..usize::from(short(list)?)).map(|k| list + 2 + 12 * k);
    let entry = entries.find(|at| {
        let stated = (short(*at), short(at + 2), long(at + 4));
        stated == (Some(ORIENTATION), Some(SHORT), Some(1))
    })?;
    short(entry + 8)
}

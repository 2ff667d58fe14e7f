//! Pictures for people that programs can read, too: a PNG with labels states where its image is.
//!
//! The statement is a text chunk with the key `nirspi-picture`, in JSON. A reader takes the image
//! out of the picture, one value for each of the image's own pixels, and leaves the labels.
//!
//! # Invariant
//! Labels are never read as an image (`super::tests::labels_are_never_read_as_an_image`).

use super::signed::text_of;
use super::{Canvas, Grey, encode_colours, to_level};
use crate::provenance::Provenance;
use serde::{Deserialize, Serialize};
use std::io::{BufRead, Seek};

const KEY: &str = "nirspi-picture";

/// The place of an image in its picture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Placed {
    /// The upper left corner in the picture.
    pub left: u32,
    /// The upper left corner in the picture.
    pub top: u32,
    /// Edge of one of the image's pixels in the picture.
    pub cell: u32,
    /// Columns of the image.
    pub width: u32,
    /// Rows of the image.
    pub height: u32,
    /// The value of black, for readers.
    pub black: f32,
    /// The value of white, for readers.
    pub white: f32,
}

#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Labels {
    /// Columns and rows of the picture with its labels.
    size: [u32; 2],
    /// The number of images in the picture.
    images: usize,
    /// The place of a single image.
    image: Option<Placed>,
}

/// The bytes of a colour PNG that shows so many images, with the place of a single one and their
/// provenance.
///
/// # Panics
/// If the picture has no pixel.
#[must_use]
pub fn encode_labelled(
    picture: &Canvas,
    images: usize,
    image: Option<Placed>,
    provenance: &Provenance,
) -> Vec<u8> {
    let labels = Labels { size: [picture.width(), picture.height()], images, image };
    let text = serde_json::to_string(&labels).expect("numbers are JSON");
    encode_colours(picture, &[(KEY, text)], provenance)
}

/// The labels of a PNG, if it states any. The stream is read up to the first pixel.
pub(super) fn labels_of(stream: impl BufRead + Seek) -> Option<Result<Labels, serde_json::Error>> {
    Some(serde_json::from_str(&text_of(stream, KEY).ok()??))
}

/// The image in a picture with labels, or what is wrong with the picture: found and expected.
pub(super) fn image_in(picture: &Grey, labels: &Labels) -> Result<Grey, (String, &'static str)> {
    let Labels { size, images, image } = labels;
    const BESIDE: &str = "one image; the numbers are in the .npy file beside the picture";
    if *size != [picture.width, picture.height] {
        let found = "a picture with labels that another program has resized";
        return Err((found.to_owned(), BESIDE));
    }
    let Some(placed) = image else {
        return Err((format!("a picture of {images} images with labels"), BESIDE));
    };
    let Placed { left, top, cell, width, height, black, white } = *placed;
    let fits = |start: u32, count: u32, all: u32| {
        let end = count.checked_mul(cell).and_then(|long| long.checked_add(start));
        count > 0 && end.is_some_and(|end| end <= all)
    };
    if cell == 0 || !fits(left, width, size[0]) || !fits(top, height, size[1]) {
        return Err(("a picture with damaged labels".to_owned(), BESIDE));
    }
    let value = |at: u32| {
        let (x, y) = (at % width, at / width);
        let shown = picture.value(left + x * cell + cell / 2, top + y * cell + cell / 2);
        // The level as it was written, without the rounding of three colours.
        let level = f32::from(to_level(shown)) / 255.0;
        (black + (white - black) * level).clamp(0.0, 1.0)
    };
    Ok(Grey { width, height, values: (0..width * height).map(value).collect() })
}

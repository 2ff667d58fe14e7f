//! A contact sheet: many images of a video in one picture.

use crate::files::image::encode_grey;
use nirspi_recon::Image;

/// Number of images in a row.
const COLUMNS: usize = 8;

/// The most images in the picture.
const SHOWN: usize = 64;

/// Edge of an image in the picture, in pixels, unless the image itself is larger.
const TILE_PX: usize = 128;

/// The first 64 images in rows of eight as a PNG, each stretched to its own black and white. All
/// images must have the same side. Without images the picture is empty.
#[must_use]
pub fn contact_sheet(images: &[Image]) -> Vec<u8> {
    let shown = &images[..images.len().min(SHOWN)];
    let n = shown.first().map_or(1, |image| image.side().pixels());
    let factor = (TILE_PX / n).max(1);
    let (columns, tile) = (shown.len().clamp(1, COLUMNS), n * factor);
    let (width, height) = (columns * tile, shown.len().div_ceil(columns).max(1) * tile);
    let mut pixels = vec![0.0; width * height];
    for (at, image) in shown.iter().enumerate() {
        let (top, left) = (at / columns * tile, at % columns * tile);
        let stretched = image.stretched();
        for (r, c) in (0..tile).flat_map(|r| (0..tile).map(move |c| (r, c))) {
            pixels[(top + r) * width + left + c] = stretched.pixels()[r / factor * n + c / factor];
        }
    }
    encode_grey(width, height, &pixels)
}

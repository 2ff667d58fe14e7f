//! The line of provenance below a picture.

use super::text::{Block, Font, Style};
use super::{DIM, GROUND};
use crate::files::image::encode_rgb;
use crate::provenance::Provenance;
use image::{RgbImage, imageops};

/// The words below the images.
pub(super) const FOOTER: fn() -> Style =
    || Style { font: Font::sans(), size_px: 18.0, line_px: 24, colour: DIM };

const LEFT_PX: u32 = 36;
const BELOW_PX: u32 = 16;

/// The picture with its provenance in words below it.
pub(super) fn signed(picture: &RgbImage, provenance: &Provenance) -> RgbImage {
    let (width, height) = picture.dimensions();
    let line = provenance.to_string();
    let words = Block::new(FOOTER, [line.as_str()], width.saturating_sub(2 * LEFT_PX).max(1));
    let mut canvas = RgbImage::from_pixel(width, height + words.height() + BELOW_PX, GROUND);
    imageops::replace(&mut canvas, picture, 0, 0);
    words.draw(&mut canvas, LEFT_PX.min(width), height);
    canvas
}

/// The bytes of a PNG of a chart, or of several pictures, with the provenance in words below it and
/// in its text chunks.
///
/// # Panics
/// If the picture has no pixel.
#[must_use]
pub fn signed_png(picture: &RgbImage, provenance: &Provenance) -> Vec<u8> {
    encode_rgb(&signed(picture, provenance), provenance)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::{Axis, Chart};
    use crate::testing::provenance;

    #[test]
    fn a_picture_stays_as_it_is_above_its_line_of_provenance() {
        let axis = |name| Axis::of(name, vec![0.0, 1.0], false);
        let (header, footer) = (String::new(), String::new());
        let chart = Chart { header, x: axis("x"), y: axis("y"), lines: Vec::new(), footer };
        let picture = chart.render();
        let signed = signed(&picture, &provenance());
        let (width, height) = picture.dimensions();
        assert!(signed.width() == width && signed.height() > height);
        let above = imageops::crop_imm(&signed, 0, 0, width, height).to_image();
        assert_eq!(above, picture);
        let bright = signed.rows().skip(height as usize).flatten().filter(|p| **p != GROUND);
        assert!(bright.count() > 500);
    }
}

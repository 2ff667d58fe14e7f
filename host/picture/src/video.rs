//! Many images as a video: an animated PNG, which browsers play.
//!
//! # Invariant
//! The video has a frame for every image, or evenly chosen ones, and each frame names its image
//! (`tests::a_video_decodes_to_as_many_frames_as_it_has_images`). All frames have one size.

use super::drawing::Drawing;
use super::layout::{Panel, SideBySide};
use super::look::{FigureStyle, Look};
use super::scale::{Range, Unit};
use super::sheet::{MOST_BESIDE, Sheet, evenly};
use super::signature::signed;
use nirspi_files::image::{Canvas, sign};
use nirspi_files::provenance::Provenance;
use nirspi_recon::{Image, Shape};
use rayon::prelude::*;

/// The most frames of a video that is made for itself.
const MOST: usize = 1000;
/// Frames that are drawn at a time, on all processors.
const TOGETHER: usize = 64;
/// Frames a second.
const RATE_HZ: u16 = 10;

/// An animated PNG.
pub(super) struct Video {
    pub(super) bytes: Vec<u8>,
    pub(super) frames: usize,
}

/// Some images of a sheet, one after another, on the sheet's scale: a video to look at beside the results.
///
/// # Panics
/// If there is no image.
pub(super) fn beside(sheet: &Sheet<'_>, style: FigureStyle, provenance: &Provenance) -> Video {
    encode(sheet, MOST_BESIDE, style, provenance)
}

fn encode(sheet: &Sheet<'_>, most: usize, style: FigureStyle, provenance: &Provenance) -> Video {
    let shown = evenly(sheet.count(), most);
    let look = style.on_screen();
    let pictures: Vec<Drawing> =
        shown.iter().map(|&index| drawn(&frame(sheet, index), &look)).collect();
    // The text below an image may be longer than that of another.
    let height = pictures.iter().map(|picture| picture.height).max().unwrap_or(1);
    let mut bytes = Vec::new();
    let encoded = (|| {
        let drawn = |picture: &Drawing| {
            let padded = Drawing { height, ..picture.clone() };
            signed(padded, &look, provenance).raster()
        };
        let together = |some: &[Drawing]| some.par_iter().map(drawn).collect::<Vec<_>>();
        let mut pictures = pictures.chunks(TOGETHER).flat_map(together);
        let mut before = pictures.next().unwrap_or_else(|| Canvas::new(1, 1, [0; 3]));
        let mut encoder = png::Encoder::new(&mut bytes, before.width(), before.height());
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::Fast);
        encoder.set_animated(shown.len() as u32, 0)?;
        encoder.set_frame_delay(1, RATE_HZ)?;
        sign(&mut encoder, provenance)?;
        let mut writer = encoder.write_header()?;
        writer.write_image_data(before.pixels().as_flattened())?;
        for picture in pictures {
            // A frame is what has changed since the one before.
            let (left, top, width, height) = changed(&before, &picture);
            // The place is checked against the size before it, and the size against the place.
            writer.reset_frame_position()?;
            writer.set_frame_dimension(width, height)?;
            writer.set_frame_position(left, top)?;
            let part = picture.part((left, top), (width, height));
            writer.write_image_data(part.pixels().as_flattened())?;
            before = picture;
        }
        writer.finish()
    })();
    encoded.expect("pictures of one size encode into memory");
    Video { bytes, frames: shown.len() }
}

/// The bytes of a video of these images, all on one scale. There must be at least one image.
#[must_use]
pub fn of_images(
    header: &str,
    images: &[Image<impl Shape>],
    unit: Unit,
    provenance: &Provenance,
) -> Vec<u8> {
    let size = images.first().map_or((1, 1), size_of);
    let values = images.iter().map(Image::pixels).collect();
    let sheet = Sheet::new(header.to_owned(), size, values, unit);
    encode(&sheet, MOST, FigureStyle::Paper, provenance).bytes
}

/// Height and width.
pub(super) fn size_of(image: &Image<impl Shape>) -> (usize, usize) {
    (image.size().height(), image.size().width())
}

fn frame(sheet: &Sheet<'_>, index: usize) -> SideBySide {
    let scale = sheet.scale_of(index);
    let title = format!("frame {index}, of 0 to {}", sheet.count() - 1);
    let warning = sheet.is_warned(index).then(|| "a warning stands in the report".to_owned());
    let (height, width) = sheet.size();
    Panel {
        width,
        height,
        range: Range::Fixed(scale.black, scale.white),
        warnings: warning.into_iter().collect(),
        ..Panel::square(&title, width, sheet.image(index), sheet.unit())
    }
    .into()
}

fn drawn(picture: &SideBySide, look: &Look) -> Drawing {
    picture.draw(look, picture.width(look)).0
}

/// The smallest part that holds all changes, at least a pixel: left, top, width, height.
fn changed(before: &Canvas, after: &Canvas) -> (u32, u32, u32, u32) {
    let (mut left, mut top, mut right, mut bottom) = (u32::MAX, u32::MAX, 0, 0);
    let wide = after.width() as usize;
    let rows = before.pixels().chunks_exact(wide).zip(after.pixels().chunks_exact(wide));
    for (y, (old, new)) in rows.enumerate().filter(|(_, (old, new))| old != new) {
        let differs = |x: &usize| old[*x] != new[*x];
        let first = (0..wide).find(differs).unwrap_or(0) as u32;
        let last = (0..wide).rev().find(differs).unwrap_or(0) as u32;
        (left, right) = (left.min(first), right.max(last));
        (top, bottom) = (top.min(y as u32), y as u32);
    }
    match left {
        u32::MAX => (0, 0, 1, 1),
        _ => (left, top, right - left + 1, bottom - top + 1),
    }
}

#[cfg(test)]
mod tests {
    use super::super::scale::Unit;
    use super::*;
    use crate::testing::provenance;
    use std::io::Cursor;

    #[test]
    fn a_video_decodes_to_as_many_frames_as_it_has_images() {
        // The third image is the second again, and the last is brighter than all.
        let images: Vec<Vec<f32>> = [1.0_f32, 2.0, 2.0, 9.0]
            .iter()
            .map(|gain| (0..64).map(|p| gain * p as f32).collect())
            .collect();
        let images: Vec<&[f32]> = images.iter().map(Vec::as_slice).collect();
        let sheet = Sheet::new(String::new(), (8, 8), images, Unit::AdcCounts);
        let video = encode(&sheet, MOST, FigureStyle::Paper, &provenance());
        assert_eq!(video.frames, 4);
        let mut reader = png::Decoder::new(Cursor::new(&video.bytes)).read_info().unwrap();
        let (width, height) = reader.info().size();
        assert_eq!(reader.info().animation_control.unwrap().num_frames, 4);
        let mut shown = Canvas::new(width, height, [0; 3]);
        for index in 0..4 {
            let mut part = vec![0; reader.output_buffer_size().unwrap()];
            reader.next_frame(&mut part).unwrap();
            let control = *reader.info().frame_control().unwrap();
            assert_eq!((control.delay_num, control.delay_den), (1, RATE_HZ));
            // What has changed is drawn over the frame before.
            for (pixel, at) in part.as_chunks::<3>().0.iter().zip(0..control.width * control.height)
            {
                let (x, y) = (at % control.width, at / control.width);
                *shown.pixel_mut(control.x_offset + x, control.y_offset + y).unwrap() = *pixel;
            }
            let wanted = drawn(&frame(&sheet, index), &FigureStyle::Paper.on_screen()).raster();
            let size = (wanted.width(), wanted.height());
            assert!(height >= size.1 && shown.part((0, 0), size) == wanted, "frame {index}");
        }
        assert!(reader.next_frame(&mut [0; 1 << 20]).is_err(), "a fifth frame");
    }

    #[test]
    fn a_video_of_very_many_images_says_how_many_it_leaves_out() {
        assert_eq!(evenly(20_000, MOST).len(), 1000);
        let many = Sheet::new(String::new(), (2, 2), vec![&[0.0; 4]; 101], Unit::AdcCounts);
        assert_eq!(beside(&many, FigureStyle::Paper, &provenance()).frames, 100);
        let one = vec![0.0; 4];
        let sheet = Sheet::new(String::new(), (2, 2), vec![&one; 1234], Unit::AdcCounts);
        assert_eq!(frame(&sheet, 17).panels[0].title, "frame 17, of 0 to 1233");
    }
}

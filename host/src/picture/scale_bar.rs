//! A bar below an image that says how long a part of the image is on the target.

use super::MIDDLE;
use super::text::{Font, Style};
use super::ticks::label;
use image::RgbImage;

/// The height of a bar with its label.
pub(super) const HEIGHT_PX: u32 = 24;
const LINE_PX: u32 = 3;
const END_PX: u32 = 11;
/// Blank between the bar and its label.
const BLANK_PX: u32 = 10;

/// A round length in millimetres, 1, 2 or 5 times a power of ten: the longest that is at most a
/// third of the field. `None` for a field without a size.
pub(super) fn length_mm(field_mm: f64) -> Option<f64> {
    let most = field_mm / 3.0;
    if !(most.is_finite() && most > 1e-6) {
        return None;
    }
    let power = most.log10().floor() as i32;
    let round = |digit: f64| {
        if power < 0 { digit / 10_f64.powi(-power) } else { digit * 10_f64.powi(power) }
    };
    [5.0, 2.0, 1.0].map(round).into_iter().find(|length| *length <= most)
}

/// Draws the bar of an image of `width_px` that shows `field_mm`, with its upper left corner at
/// `(left, top)`.
pub(super) fn draw_scale_bar(
    canvas: &mut RgbImage,
    field_mm: f64,
    width_px: u32,
    (left, top): (u32, u32),
) {
    let Some(length_mm) = length_mm(field_mm) else { return };
    let length_px = ((length_mm / field_mm * f64::from(width_px)).round() as u32).max(2);
    let middle = top + HEIGHT_PX / 2;
    for x in left..left + length_px {
        for y in 0..LINE_PX {
            canvas.put_pixel(x, middle - LINE_PX / 2 + y, MIDDLE);
        }
    }
    for end in [left, left + length_px - 1] {
        for y in 0..END_PX {
            canvas.put_pixel(end, middle - END_PX / 2 + y, MIDDLE);
        }
    }
    let style = Style { font: Font::sans(), size_px: 16.0, line_px: HEIGHT_PX, colour: MIDDLE };
    let text = format!("{} mm", label(length_mm));
    style.draw(canvas, &text, (left + length_px + BLANK_PX) as f32, top as f32);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_has_a_round_length_below_a_third_of_the_field() {
        for (field_mm, length) in
            [(48.0, 10.0), (96.0, 20.0), (160.0, 50.0), (0.9, 0.2), (3.0, 1.0), (1e6, 2e5)]
        {
            let found = length_mm(field_mm).unwrap();
            assert!((found - length).abs() < 1e-9, "{field_mm}: {found}");
        }
        for field_mm in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert_eq!(length_mm(field_mm), None, "{field_mm}");
        }
    }
}

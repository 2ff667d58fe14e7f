//! The grey bar below an image: which grey is which value.

use super::scale::Scale;
use super::text::{Font, Style};
use super::ticks::{between, label};
use super::{FRAME, MIDDLE};
use crate::files::image::to_level;
use image::{Rgb, RgbImage};

const GREYS_PX: u32 = 14;
const TICK_PX: u32 = 5;
const LABEL_PX: u32 = 20;
/// The height of a bar with its ticks and their labels.
pub(super) const HEIGHT_PX: u32 = GREYS_PX + TICK_PX + LABEL_PX;
/// Blank between two labels.
const BLANK_PX: f32 = 12.0;

/// Draws a bar of this width with its upper left corner at `(left, top)`. Labels stay within the
/// width, and one that would touch its neighbour is left out.
pub(super) fn draw_bar(
    canvas: &mut RgbImage,
    scale: &Scale,
    (left, top): (u32, u32),
    width_px: u32,
) {
    for x in 0..width_px {
        let grey = to_level(x as f32 / (width_px - 1).max(1) as f32);
        for y in 0..GREYS_PX {
            let on_edge = x == 0 || y == 0 || x + 1 == width_px || y + 1 == GREYS_PX;
            let colour = if on_edge { FRAME } else { Rgb([grey; 3]) };
            canvas.put_pixel(left + x, top + y, colour);
        }
    }
    let style = Style { font: Font::sans(), size_px: 16.0, line_px: LABEL_PX, colour: MIDDLE };
    let (black, white) = (f64::from(scale.black), f64::from(scale.white));
    let mut free_from = left as f32;
    for tick in between(black, white, 5) {
        let part = (tick - black) / (white - black);
        let x = left + (part * f64::from(width_px - 1)).round() as u32;
        for y in 0..TICK_PX {
            canvas.put_pixel(x, top + GREYS_PX + y, MIDDLE);
        }
        let text = label(tick);
        let wide = style.width(&text);
        let most = (left + width_px) as f32 - wide;
        let at = (x as f32 - wide / 2.0).clamp(left as f32, most.max(left as f32));
        if at >= free_from {
            style.draw(canvas, &text, at, (top + GREYS_PX + TICK_PX) as f32);
            free_from = at + wide + BLANK_PX;
        }
    }
}

//! The grey bar below an image: which grey is which value.

use super::drawing::{Drawing, Shape};
use super::look::Look;
use super::scale::Scale;
use super::text::Style;
use super::ticks::{between, label};

/// The height of a bar with its ticks and their labels.
pub(super) fn height(look: &Look) -> u32 {
    greys(look) + tick(look) + Style::plain(look).line_px
}

fn greys(look: &Look) -> u32 {
    look.px(10)
}

fn tick(look: &Look) -> u32 {
    look.px(4)
}

/// Draws a bar of this width with its upper left corner at `(left, top)`. Labels stay within the
/// width, and one that would touch its neighbour is left out.
pub(super) fn draw_bar(
    canvas: &mut Drawing,
    look: &Look,
    scale: &Scale,
    (left, top): (u32, u32),
    width: u32,
) {
    let (edge, greys) = (look.px(1), greys(look));
    canvas.rect([left, top, width, greys], look.palette.frame);
    let inside = [left + edge, top + edge, width - 2 * edge, greys - 2 * edge];
    let levels = (0..=255).collect();
    canvas.shapes.push(Shape::Image { at: inside, columns: 256, levels, smooth: false });
    let (black, white) = (f64::from(scale.black), f64::from(scale.white));
    let at = |value: f64| {
        let part = (value - black) / (white - black);
        f64::from(left) + part * f64::from(width - 1) + 0.5
    };
    let ticks: Vec<(f64, String)> =
        between(black, white, 5).into_iter().map(|value| (at(value), label(value))).collect();
    draw_ticks(canvas, look, &ticks, top + greys, (left, left + width));
}

/// Draws ticks and their labels below this line. Labels stay between the ends.
pub(super) fn draw_ticks(
    canvas: &mut Drawing,
    look: &Look,
    ticks: &[(f64, String)],
    top: u32,
    (left, right): (u32, u32),
) {
    let (style, long) = (Style::plain(look), tick(look));
    let thick = f64::from(look.px(1));
    let mut free_from = left as f32;
    for (x, text) in ticks {
        let ends = [(*x, f64::from(top)), (*x, f64::from(top + long))];
        canvas.line(ends, thick, style.colour);
        let wide = style.width(text);
        let most = (right as f32 - wide).max(left as f32);
        let at = (*x as f32 - wide / 2.0).clamp(left as f32, most);
        if at >= free_from {
            style.draw(canvas, text, at, (top + long) as f32);
            free_from = at + wide + look.px(10) as f32;
        }
    }
}

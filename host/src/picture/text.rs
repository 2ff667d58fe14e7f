//! Measures, wraps and draws text in the embedded fonts.
//!
//! # Invariant
//! A line from [`Style::wrap`] is at most as wide as requested
//! (`tests::no_line_is_wider_than_asked_and_no_character_is_lost`). [`Style::draw`] paints at most
//! the width that [`Style::width`] returns, except for the anti-aliasing of the last glyph.

use ab_glyph::{Font as _, FontRef, ScaleFont as _, point};
use image::{Rgb, RgbImage};
use std::sync::LazyLock;

static SANS: LazyLock<FontRef<'static>> =
    LazyLock::new(|| parse(epaint_default_fonts::UBUNTU_LIGHT));
static MONO: LazyLock<FontRef<'static>> =
    LazyLock::new(|| parse(epaint_default_fonts::HACK_REGULAR));

fn parse(bytes: &'static [u8]) -> FontRef<'static> {
    FontRef::try_from_slice(bytes)
        .expect("the embedded fonts are whole: every test that draws relies on it")
}

/// The embedded fonts.
pub(super) struct Font;

impl Font {
    /// Ubuntu Light, proportional: titles and running text.
    pub(super) fn sans() -> &'static FontRef<'static> {
        &SANS
    }

    /// Hack, fixed width: figures in columns.
    pub(super) fn mono() -> &'static FontRef<'static> {
        &MONO
    }
}

/// A font with a size and a colour.
#[derive(Clone, Copy)]
pub(super) struct Style {
    pub(super) font: &'static FontRef<'static>,
    /// Height from descent to ascent.
    pub(super) size_px: f32,
    pub(super) line_px: u32,
    pub(super) colour: Rgb<u8>,
}

impl Style {
    /// Width of a line of text in pixels.
    pub(super) fn width(&self, text: &str) -> f32 {
        let font = self.font.as_scaled(self.size_px);
        let mut previous = None;
        text.chars()
            .map(|character| {
                let id = font.glyph_id(character);
                let kern = previous.replace(id).map_or(0.0, |left| font.kern(left, id));
                kern + font.h_advance(id)
            })
            .sum()
    }

    /// Breaks text into lines of at most `width_px`: between words if possible, else inside a word
    /// that is longer than a line. Control characters count as blanks. Text that fits keeps its
    /// blanks. A line has at least one character, however narrow the line.
    pub(super) fn wrap(&self, text: &str, width_px: f32) -> Vec<String> {
        let text = text.replace(char::is_control, " ");
        let text = text.trim();
        if !text.is_empty() && self.width(text) <= width_px {
            return vec![text.to_owned()];
        }
        let mut lines = Vec::new();
        let mut line = String::new();
        for word in text.split_whitespace() {
            let joined = if line.is_empty() { word.to_owned() } else { format!("{line} {word}") };
            if self.width(&joined) <= width_px {
                line = joined;
                continue;
            }
            if !line.is_empty() {
                lines.push(std::mem::take(&mut line));
            }
            for character in word.chars() {
                line.push(character);
                if self.width(&line) > width_px && line.chars().count() > 1 {
                    line.pop();
                    lines.push(std::mem::replace(&mut line, character.to_string()));
                }
            }
        }
        if !line.is_empty() {
            lines.push(line);
        }
        lines
    }

    /// Draws a line of text with the top left corner of its box at `(x, y)`. Parts outside the
    /// canvas are cut.
    pub(super) fn draw(&self, canvas: &mut RgbImage, text: &str, x: f32, y: f32) {
        let font = self.font.as_scaled(self.size_px);
        let baseline = (y + (self.line_px as f32 - font.height()) / 2.0 + font.ascent()).round();
        let mut pen = x;
        let mut previous = None;
        for character in text.chars() {
            let id = font.glyph_id(character);
            pen += previous.replace(id).map_or(0.0, |left| font.kern(left, id));
            let glyph = id.with_scale_and_position(self.size_px, point(pen, baseline));
            pen += font.h_advance(id);
            let Some(outlined) = font.outline_glyph(glyph) else { continue };
            let bounds = outlined.px_bounds();
            outlined.draw(|dx, dy, coverage| {
                let (x, y) =
                    (bounds.min.x as i64 + i64::from(dx), bounds.min.y as i64 + i64::from(dy));
                let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y)) else { return };
                if let Some(pixel) = canvas.get_pixel_mut_checked(x, y) {
                    blend(pixel, self.colour, coverage);
                }
            });
        }
    }
}

/// Text broken into lines.
pub(super) struct Block {
    pub(super) style: Style,
    lines: Vec<String>,
}

impl Block {
    /// These texts below each other, each in lines of at most `width_px`. An empty text has no line.
    pub(super) fn new<'a>(
        style: fn() -> Style,
        texts: impl IntoIterator<Item = &'a str>,
        width_px: u32,
    ) -> Self {
        let style = style();
        let lines = texts.into_iter().flat_map(|text| style.wrap(text, width_px as f32)).collect();
        Self { style, lines }
    }

    pub(super) fn height(&self) -> u32 {
        self.lines.len() as u32 * self.style.line_px
    }

    /// The height with a space below; 0 without text.
    pub(super) fn height_and(&self, space_px: u32) -> u32 {
        if self.lines.is_empty() { 0 } else { self.height() + space_px }
    }

    /// The width of the widest line.
    pub(super) fn width(&self) -> f32 {
        self.lines.iter().map(|line| self.style.width(line)).fold(0.0, f32::max)
    }

    pub(super) fn draw(&self, canvas: &mut RgbImage, left: u32, top: u32) {
        for (k, line) in self.lines.iter().enumerate() {
            let y = top + k as u32 * self.style.line_px;
            self.style.draw(canvas, line, left as f32, y as f32);
        }
    }
}

fn blend(ground: &mut Rgb<u8>, ink: Rgb<u8>, coverage: f32) {
    for (ground, ink) in ground.0.iter_mut().zip(ink.0) {
        let mixed =
            f32::from(*ground) + (f32::from(ink) - f32::from(*ground)) * coverage.clamp(0.0, 1.0);
        *ground = mixed.round() as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn style() -> Style {
        Style { font: Font::sans(), size_px: 20.0, line_px: 24, colour: Rgb([255; 3]) }
    }

    proptest! {
        #[test]
        fn no_line_is_wider_than_asked_and_no_character_is_lost(
            text in "[ -~\n\té×]{0,80}|[A-Z]{30,60}",
            width in 30f32..400.0,
        ) {
            let style = style();
            let lines = style.wrap(&text, width);
            for line in &lines {
                prop_assert!(style.width(line) <= width, "{line:?}");
            }
            let solid = |text: &str| text.split_whitespace().collect::<String>();
            prop_assert_eq!(solid(&lines.concat()), solid(&text));
        }
    }

    #[test]
    fn lines_break_between_words_where_they_can() {
        let style = style();
        let lines = style.wrap("one two three", style.width("one two") + 1.0);
        assert_eq!(lines, ["one two", "three"]);
    }

    #[test]
    fn text_that_fits_keeps_its_blanks() {
        assert_eq!(style().wrap("PSNR 23.4 dB   SSIM 0.81", 400.0), ["PSNR 23.4 dB   SSIM 0.81"]);
    }

    #[test]
    fn signs_of_measurements_are_in_both_fonts() {
        for font in [Font::sans(), Font::mono()] {
            for sign in "×·µ±−–≥≤°²³λσ%".chars() {
                assert_ne!(font.glyph_id(sign).0, 0, "{sign}");
            }
        }
    }
}

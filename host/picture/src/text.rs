//! Measures, wraps and places text in the embedded font.
//!
//! # Invariant
//! A line from [`Style::wrap`] is at most as wide as requested
//! (`tests::no_line_is_wider_than_asked_and_no_character_is_lost`).

use super::drawing::{Drawing, Shape};
use super::look::{Colour, Look};
use ab_glyph::{Font as _, FontRef, GlyphId, ScaleFont as _};
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
    /// Ubuntu Light, proportional: all text of pictures.
    pub(super) fn sans() -> &'static FontRef<'static> {
        &SANS
    }

    /// Hack, fixed width: a typeface of scenes.
    pub(super) fn mono() -> &'static FontRef<'static> {
        &MONO
    }
}

/// The height from descent to ascent of a font of this size.
pub(super) fn height_of(size: f32) -> f32 {
    let font = Font::sans();
    size * font.height_unscaled() / font.units_per_em().unwrap_or(1000.0)
}

/// The letters of a line with their glyphs, and how far each is moved from the one before.
pub(super) fn placed_glyphs(text: &str, size: f32) -> impl Iterator<Item = (char, GlyphId, f32)> {
    let font = Font::sans().as_scaled(height_of(size));
    let mut previous = None;
    text.chars().map(move |letter| {
        let id = font.glyph_id(letter);
        let kern = previous.replace(id).map_or(0.0, |left| font.kern(left, id));
        (letter, id, kern)
    })
}

/// Width of a line of text in a font of this size.
pub(super) fn width(text: &str, size: f64) -> f32 {
    let font = Font::sans().as_scaled(height_of(size as f32));
    placed_glyphs(text, size as f32).map(|(_, id, kern)| kern + font.h_advance(id)).sum()
}

/// A size and a colour of text.
#[derive(Clone, Copy)]
pub(super) struct Style {
    /// The size of the font, in pixels.
    pub(super) size: f64,
    pub(super) line_px: u32,
    pub(super) colour: Colour,
}

impl Style {
    fn of(look: &Look, sixteenths: u32, colour: Colour) -> Self {
        let size = f64::from(sixteenths) / 16.0 * look.em();
        Self { size, line_px: (1.3 * size).ceil() as u32, colour }
    }

    /// The header of a picture.
    pub(super) fn header(look: &Look) -> Self {
        Self::of(look, 20, look.palette.strong)
    }

    /// The title of an image or of a chart.
    pub(super) fn title(look: &Look) -> Self {
        Self::of(look, 17, look.palette.strong)
    }

    /// Running text.
    pub(super) fn plain(look: &Look) -> Self {
        Self::of(look, 16, look.palette.plain)
    }

    /// The source.
    pub(super) fn faint(look: &Look) -> Self {
        Self::of(look, 16, look.palette.faint)
    }

    /// A warning.
    pub(super) fn warning(look: &Look) -> Self {
        Self::of(look, 16, look.palette.warning)
    }

    /// Width of a line of text in pixels.
    pub(super) fn width(&self, text: &str) -> f32 {
        width(text, self.size)
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

    /// Draws a line of text with the top left corner of its box at `(x, y)`.
    pub(super) fn draw(&self, canvas: &mut Drawing, text: &str, x: f32, y: f32) {
        let height = height_of(self.size as f32);
        let font = Font::sans().as_scaled(height);
        let baseline = (y + (self.line_px as f32 - font.height()) / 2.0 + font.ascent()).round();
        canvas.shapes.push(Shape::Text {
            x: f64::from(x),
            baseline: f64::from(baseline),
            size: self.size,
            colour: self.colour,
            text: text.to_owned(),
        });
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
        style: Style,
        texts: impl IntoIterator<Item = &'a str>,
        width_px: u32,
    ) -> Self {
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

    pub(super) fn draw(&self, canvas: &mut Drawing, left: u32, top: u32) {
        for (k, line) in self.lines.iter().enumerate() {
            let y = top + k as u32 * self.style.line_px;
            self.style.draw(canvas, line, left as f32, y as f32);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn style() -> Style {
        Style { size: 20.0, line_px: 24, colour: [255; 3] }
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

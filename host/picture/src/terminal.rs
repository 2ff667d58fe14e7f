//! An image for a terminal: each character is the upper half block, whose two colours are the grey
//! levels of one pixel and of the pixel below it.

use super::{Range, Scale, Unit};
use nirspi_recon::Image;
use std::fmt::Write;

/// The grey tones that a terminal can show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tones {
    /// Black, white and the 24 greys of the 256 colours of xterm.
    Of256,
    /// 256 greys.
    True,
}

/// The 256 colours of xterm end with 24 greys.
const FIRST_GREY: u8 = 232;
/// Levels of [`Tones::Of256`]: black, 24 greys, white.
const LEVELS_OF_256: f32 = 26.0;
/// Black of the colour cube of xterm.
const BLACK_OF_256: u8 = 16;
/// White of the colour cube of xterm.
const WHITE_OF_256: u8 = 231;

impl Tones {
    /// The tones that the environment announces. `None` where the user or the terminal wants no
    /// colours: `NO_COLOR` is set to something, or `TERM` is `dumb` or not there.
    #[must_use]
    pub fn announced(variable: impl Fn(&str) -> Option<String>) -> Option<Self> {
        let term = variable("TERM").filter(|term| !term.is_empty() && term != "dumb");
        let plain = variable("NO_COLOR").is_some_and(|value| !value.is_empty());
        let depth = variable("COLORTERM").unwrap_or_default();
        match (plain, term) {
            (true, _) | (_, None) => None,
            _ if matches!(depth.as_str(), "truecolor" | "24bit") => Some(Self::True),
            _ => Some(Self::Of256),
        }
    }

    /// The parameters of the control sequence that chooses a grey level from 0 to 1. `layer` is 38
    /// for the character and 48 for its ground.
    fn choose(self, layer: u8, level: f32, line: &mut String) {
        let _ = match self {
            Self::True => {
                let grey = (level * 255.0).round() as u8;
                write!(line, "{layer};2;{grey};{grey};{grey}")
            }
            Self::Of256 => {
                let colour = match (level * (LEVELS_OF_256 - 1.0)).round() as u8 {
                    0 => BLACK_OF_256,
                    grey @ 1..=24 => FIRST_GREY + (grey - 1),
                    _ => WHITE_OF_256,
                };
                write!(line, "{layer};5;{colour}")
            }
        };
    }
}

/// The lines of an image of `n x n` pixels, stretched between its [`PERCENTILES`]: `n / 2` lines of
/// `n` characters. Colours end with each line.
///
/// [`PERCENTILES`]: super::PERCENTILES
#[must_use]
pub fn half_blocks(image: &Image, tones: Tones) -> Vec<String> {
    let scale = Scale::of(Range::Stretched, Unit::AdcCounts, image.pixels().iter().copied());
    let rows: Vec<&[f32]> = image.pixels().chunks(image.side().pixels()).collect();
    let line = |pair: &[&[f32]]| {
        let mut line = String::new();
        for (upper, lower) in pair[0].iter().zip(pair[1]) {
            line.push_str("\x1b[");
            tones.choose(38, scale.level(*upper), &mut line);
            line.push(';');
            tones.choose(48, scale.level(*lower), &mut line);
            line.push_str("m▀");
        }
        line + "\x1b[0m"
    };
    rows.chunks_exact(2).map(line).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_recon::Side;

    fn image() -> Image {
        Image::new(Side::new(2).expect("a side"), vec![0.0, 1.0, 2.0, 4.0])
    }

    #[test]
    fn a_character_shows_two_pixels_one_above_the_other() {
        let seen = half_blocks(&image(), Tones::True);
        let black_over_half = "\x1b[38;2;0;0;0;48;2;128;128;128m▀";
        let quarter_over_white = "\x1b[38;2;64;64;64;48;2;255;255;255m▀";
        assert_eq!(seen, [format!("{black_over_half}{quarter_over_white}\x1b[0m")]);
    }

    #[test]
    fn a_terminal_of_256_colours_gets_its_greys() {
        let seen = half_blocks(&image(), Tones::Of256);
        assert_eq!(seen, ["\x1b[38;5;16;48;5;244m▀\x1b[38;5;237;48;5;231m▀\x1b[0m"]);
    }

    #[test]
    fn the_environment_says_which_tones_there_are() {
        let announced = |set: &[(&str, &str)]| {
            let set: Vec<_> = set.iter().map(|&(n, v)| (n.to_owned(), v.to_owned())).collect();
            Tones::announced(|name| set.iter().find(|(n, _)| n == name).map(|(_, v)| v.clone()))
        };
        assert_eq!(announced(&[]), None);
        assert_eq!(announced(&[("TERM", "dumb")]), None);
        assert_eq!(announced(&[("TERM", "xterm"), ("NO_COLOR", "1")]), None);
        assert_eq!(announced(&[("TERM", "xterm"), ("NO_COLOR", "")]), Some(Tones::Of256));
        assert_eq!(announced(&[("TERM", "xterm"), ("COLORTERM", "truecolor")]), Some(Tones::True));
    }
}

//! The look of a figure: its width, the size of its text, its colours.
//!
//! # Invariant
//! Text of a figure for paper has at least 8 points, and all text stands out from the ground
//! (`tests::text_is_large_enough_and_stands_out`). Ten curves differ by colour or dashes for people
//! who confuse colours, too, and by the shape of their points (`tests::ten_curves_differ_for_everyone`).

use std::str::FromStr;

/// A colour as red, green and blue.
pub(super) type Colour = [u8; 3];

/// What a figure is made for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FigureStyle {
    /// Both columns of a page.
    #[default]
    Paper,
    /// One column of a page.
    Column,
    /// A slide of a talk.
    Slide,
    /// A dark screen.
    Screen,
}

impl FigureStyle {
    /// All styles.
    pub const ALL: [Self; 4] = [Self::Paper, Self::Column, Self::Slide, Self::Screen];

    /// The name, as users write it.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Paper => "paper",
            Self::Column => "column",
            Self::Slide => "slide",
            Self::Screen => "screen",
        }
    }

    /// The style in words.
    #[must_use]
    pub fn about(self) -> &'static str {
        match self {
            Self::Paper => "white ground, 178 mm wide (a single image 85 mm), text of 8 points",
            Self::Column => "white ground, 85 mm wide, text of 8 points",
            Self::Slide => "white ground, 320 mm wide, text of 14 points",
            Self::Screen => "dark ground, 1440 pixels wide",
        }
    }

    /// The measures and colours.
    #[must_use]
    pub fn look(self) -> Look {
        let light = |width_mm, single_mm, text_pt, dpi| Look {
            width_mm,
            single_mm,
            text_pt,
            dpi,
            palette: &LIGHT,
        };
        match self {
            Self::Paper => light(178.0, 85.0, 8.0, 300.0),
            Self::Column => light(85.0, 85.0, 8.0, 300.0),
            Self::Slide => light(320.0, 150.0, 14.0, 150.0),
            Self::Screen => Look { palette: &DARK, ..light(254.0, 90.0, 9.0, 144.0) },
        }
    }

    /// The same colours for a picture that is looked at on a screen: a frame of a video, or a cell
    /// of a notebook.
    #[must_use]
    pub fn on_screen(self) -> Look {
        Look { palette: self.look().palette, ..Self::Screen.look() }
    }
}

impl FromStr for FigureStyle {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|style| style.name() == name);
        found.ok_or_else(|| format!("{name}: expected {}", Self::ALL.map(Self::name).join(", ")))
    }
}

/// The measures and colours of a figure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Look {
    width_mm: f64,
    single_mm: f64,
    text_pt: f64,
    /// Pixels an inch of the figure as a PNG. They are the unit of a layout.
    pub(super) dpi: f64,
    pub(super) palette: &'static Palette,
}

impl Look {
    /// Width of a figure.
    pub(super) fn width(&self) -> u32 {
        (self.width_mm / 25.4 * self.dpi).round() as u32
    }

    /// Width of a figure of a single image.
    pub(super) fn single(&self) -> u32 {
        (self.single_mm / 25.4 * self.dpi).round() as u32
    }

    /// Size of running text, in pixels. No text is smaller.
    pub(super) fn em(&self) -> f64 {
        self.text_pt / 72.0 * self.dpi
    }

    /// A length in sixteenths of the size of running text.
    pub(super) fn px(&self, sixteenths: u32) -> u32 {
        (f64::from(sixteenths) / 16.0 * self.em()).round() as u32
    }
}

/// The colours of a figure.
#[derive(Debug, PartialEq)]
pub(super) struct Palette {
    pub(super) ground: Colour,
    /// Lines behind curves.
    pub(super) grid: Colour,
    /// Around images.
    pub(super) frame: Colour,
    /// Titles.
    pub(super) strong: Colour,
    /// Running text, ticks.
    pub(super) plain: Colour,
    /// Sources.
    pub(super) faint: Colour,
    /// Warnings.
    pub(super) warning: Colour,
    /// Curves.
    pub(super) curves: [Colour; CURVE_COLOURS],
}

/// Number of colours of curves. Later curves have these colours with other dashes.
pub(super) const CURVE_COLOURS: usize = 5;

/// Greys are without a tint: pictures without curves and warnings have at most 256 colours.
const LIGHT: Palette = Palette {
    ground: [255, 255, 255],
    grid: [227; 3],
    frame: [144; 3],
    strong: [20; 3],
    plain: [52; 3],
    faint: [88; 3],
    warning: [168, 66, 0],
    curves: [[0, 94, 162], [213, 94, 0], [0, 158, 115], [136, 34, 85], [20; 3]],
};

const DARK: Palette = Palette {
    ground: [19, 21, 26],
    grid: [44, 48, 57],
    frame: [72, 77, 88],
    strong: [236, 238, 242],
    plain: [176, 181, 191],
    faint: [146, 152, 164],
    warning: [255, 184, 77],
    curves: [[90, 170, 255], [240, 170, 30], [0, 150, 110], [225, 120, 190], [236, 238, 242]],
};

#[cfg(test)]
mod tests {
    use super::super::chart::{DASHES, Line, Point};
    use super::*;

    /// Linear light of a colour, as `[f64; 3]`.
    fn linear(colour: Colour) -> [f64; 3] {
        colour.map(|level| {
            let level = f64::from(level) / 255.0;
            if level <= 0.04045 { level / 12.92 } else { ((level + 0.055) / 1.055).powf(2.4) }
        })
    }

    /// The contrast of two colours by the rules for web pages (WCAG 2), 1 to 21.
    fn contrast(a: Colour, b: Colour) -> f64 {
        let light = |colour| {
            let [red, green, blue] = linear(colour);
            0.2126 * red + 0.7152 * green + 0.0722 * blue + 0.05
        };
        let (a, b): (f64, f64) = (light(a), light(b));
        a.max(b) / a.min(b)
    }

    #[test]
    fn text_is_large_enough_and_stands_out() {
        for style in FigureStyle::ALL {
            let look = style.look();
            assert!(look.text_pt >= 8.0, "{style:?}");
            let Palette { ground, strong, plain, faint, warning, curves, .. } = look.palette;
            for text in [strong, plain, faint, warning] {
                assert!(contrast(*text, *ground) >= 4.5, "{style:?}: {text:?}");
            }
            for curve in curves {
                assert!(contrast(*curve, *ground) >= 3.0, "{style:?}: {curve:?}");
            }
        }
        let [paper, column] = [FigureStyle::Paper, FigureStyle::Column].map(FigureStyle::look);
        assert_eq!((paper.width(), column.width()), (2102, 1004));
        assert_eq!(paper.palette.ground, [255; 3]);
    }

    /// What people without one kind of cones see (Machado, Oliveira and Fernandes 2009, in full).
    const SEEN: [[[f64; 3]; 3]; 4] = [
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        [
            [0.152_286, 1.052_583, -0.204_868],
            [0.114_503, 0.786_281, 0.099_216],
            [-0.003_882, -0.048_116, 1.051_998],
        ],
        [
            [0.367_322, 0.860_646, -0.227_968],
            [0.280_085, 0.672_501, 0.047_413],
            [-0.011_820, 0.042_940, 0.968_881],
        ],
        [
            [1.255_528, -0.076_749, -0.178_779],
            [-0.078_411, 0.930_809, 0.147_602],
            [0.004_733, 0.691_367, 0.303_900],
        ],
    ];

    /// The colour that is seen, in CIELAB.
    fn seen(colour: Colour, eye: &[[f64; 3]; 3]) -> [f64; 3] {
        let light = linear(colour);
        let times = |row: &[f64; 3], light: &[f64; 3]| -> f64 {
            row.iter().zip(light).map(|(a, b)| a * b).sum()
        };
        let light = [0, 1, 2].map(|row| times(&eye[row], &light).clamp(0.0, 1.0));
        let root = |t: f64| if t > 0.008_856 { t.cbrt() } else { 7.787 * t + 16.0 / 116.0 };
        let x = root(times(&[0.4124, 0.3576, 0.1805], &light) / 0.9505);
        let y = root(times(&[0.2126, 0.7152, 0.0722], &light));
        let z = root(times(&[0.0193, 0.1192, 0.9505], &light) / 1.089);
        [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
    }

    #[test]
    fn ten_curves_differ_for_everyone() {
        let line = |colour| Line { name: String::new(), colour, dashed: false, points: Vec::new() };
        for style in [FigureStyle::Paper, FigureStyle::Screen] {
            let palette = style.look().palette;
            for (a, b) in (0..10).flat_map(|b| (0..b).map(move |a| (a, b))) {
                let (one, other) = (line(a), line(b));
                assert_ne!(Point::of(&one), Point::of(&other), "{a} and {b}");
                let ((hue, dashes), (other_hue, other_dashes)) = (one.look(), other.look());
                if DASHES[dashes] != DASHES[other_dashes] {
                    continue;
                }
                for eye in &SEEN {
                    let (a, b) =
                        (seen(palette.curves[hue], eye), seen(palette.curves[other_hue], eye));
                    let off: f64 = a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum();
                    assert!(off.sqrt() > 15.0, "{style:?}: {hue} and {other_hue}: {}", off.sqrt());
                }
            }
        }
    }
}

//! A picture of panels in a row, with a header above and a footer below.
//!
//! # Invariant
//! The picture grows with its text
//! (`tests::more_text_makes_a_taller_picture_and_less_a_lower_one`). No text is cut or overlaps
//! (`tests::text_of_any_length_stays_inside_its_panel`).

use super::text::{Font, Style};
use crate::files::image::to_level;
use image::imageops::{self, FilterType};
use image::{ImageBuffer, Luma, Rgb, RgbImage};

/// Edge of every panel's image: a multiple of the sides 32, 64 and 128, so that their pixels stay
/// square.
const PANEL_PX: u32 = 384;
const GAP_PX: u32 = 28;
const MARGIN_PX: u32 = 36;

const GROUND: Rgb<u8> = Rgb([19, 21, 26]);
const FRAME: Rgb<u8> = Rgb([52, 56, 66]);
const BRIGHT: Rgb<u8> = Rgb([236, 238, 242]);
const MIDDLE: Rgb<u8> = Rgb([176, 181, 191]);
const DIM: Rgb<u8> = Rgb([146, 152, 164]);
const AMBER: Rgb<u8> = Rgb([255, 184, 77]);

/// How a panel's values become grey levels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Range {
    /// 0 is black and 1 is white, so that panels can be compared.
    Unit,
    /// The panel's own lowest value is black and its highest is white.
    Stretched,
    /// These values are black and white.
    Fixed(f32, f32),
}

/// One image with its title and notes.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// The title above the image.
    pub title: String,
    /// Columns of the image, at least 1.
    pub width: usize,
    /// Rows of the image, at least 1.
    pub height: usize,
    /// `width * height` values, row-major.
    pub values: Vec<f32>,
    /// How values become grey levels.
    pub range: Range,
    /// Lines below the image, such as `PSNR 23.4 dB  SSIM 0.81`.
    pub caption: Vec<String>,
    /// Reasons not to trust the image, directly below the image in amber.
    pub warnings: Vec<String>,
}

/// A row of panels with a header and a footer line. Empty texts take no room.
#[derive(Debug, Clone, PartialEq)]
pub struct SideBySide {
    /// The header, such as `Letter R at 0.3 m`.
    pub header: String,
    /// The panels from left to right.
    pub panels: Vec<Panel>,
    /// The source of the images, such as `simulated: virtual camera`.
    pub footer: String,
}

impl SideBySide {
    /// Draws the picture; [`encode_rgb`](crate::files::image::encode_rgb) makes a PNG of it.
    ///
    /// # Panics
    /// If there is no panel, or a panel does not have exactly `width * height` values, at least
    /// one.
    #[must_use]
    pub fn render(&self) -> RgbImage {
        assert!(!self.panels.is_empty(), "a picture of at least one panel");
        let columns = self.panels.len() as u32;
        let inner = columns * PANEL_PX + (columns - 1) * GAP_PX;

        let header = Block::new(HEADER, [self.header.as_str()], inner);
        let titles = self.blocks(TITLE, |panel| vec![panel.title.as_str()]);
        let warnings =
            self.blocks(WARNING, |panel| panel.warnings.iter().map(String::as_str).collect());
        let captions =
            self.blocks(CAPTION, |panel| panel.caption.iter().map(String::as_str).collect());
        let footer = Block::new(FOOTER, [self.footer.as_str()], inner);
        let tallest = |blocks: &[Block]| blocks.iter().map(Block::height).max().unwrap_or(0);

        let header_top = MARGIN_PX;
        let title_top = header_top + header.height_and(18);
        let image_top = title_top + spaced(tallest(&titles), 10);
        let warning_top = image_top + PANEL_PX + 12;
        let caption_top = warning_top + spaced(tallest(&warnings), 8);
        let footer_top = caption_top + spaced(tallest(&captions), 16);
        let height = footer_top + footer.height() + MARGIN_PX;

        let mut canvas = RgbImage::from_pixel(inner + 2 * MARGIN_PX, height, GROUND);
        header.draw(&mut canvas, MARGIN_PX, header_top);
        for (column, panel) in self.panels.iter().enumerate() {
            let left = MARGIN_PX + column as u32 * (PANEL_PX + GAP_PX);
            let title = &titles[column];
            // A short title is directly above its image, also if a neighbour's title has more
            // lines.
            title.draw(&mut canvas, left, image_top - spaced(title.height(), 10));
            draw_image(&mut canvas, panel, left, image_top);
            warnings[column].draw(&mut canvas, left, warning_top);
            captions[column].draw(&mut canvas, left, caption_top);
        }
        footer.draw(&mut canvas, MARGIN_PX, footer_top);
        canvas
    }

    fn blocks<'a>(
        &'a self,
        style: fn() -> Style,
        texts: impl Fn(&'a Panel) -> Vec<&'a str>,
    ) -> Vec<Block> {
        self.panels.iter().map(|panel| Block::new(style, texts(panel), PANEL_PX)).collect()
    }
}

/// Rows of panels below each other, with aligned left edges.
///
/// # Panics
/// As [`SideBySide::render`].
#[must_use]
pub fn stacked(rows: &[SideBySide]) -> RgbImage {
    let drawn: Vec<RgbImage> = rows.iter().map(SideBySide::render).collect();
    let width = drawn.iter().map(RgbImage::width).max().unwrap_or(1);
    let height = drawn.iter().map(RgbImage::height).sum::<u32>().max(1);
    let mut canvas = RgbImage::from_pixel(width, height, GROUND);
    let mut top = 0;
    for row in &drawn {
        imageops::replace(&mut canvas, row, 0, i64::from(top));
        top += row.height();
    }
    canvas
}

const HEADER: fn() -> Style =
    || Style { font: Font::sans(), size_px: 32.0, line_px: 40, colour: BRIGHT };
const TITLE: fn() -> Style =
    || Style { font: Font::sans(), size_px: 23.0, line_px: 28, colour: BRIGHT };
const CAPTION: fn() -> Style =
    || Style { font: Font::mono(), size_px: 16.0, line_px: 22, colour: MIDDLE };
const WARNING: fn() -> Style =
    || Style { font: Font::sans(), size_px: 19.0, line_px: 26, colour: AMBER };
const FOOTER: fn() -> Style =
    || Style { font: Font::sans(), size_px: 18.0, line_px: 24, colour: DIM };

/// Text broken into lines.
struct Block {
    style: Style,
    lines: Vec<String>,
}

impl Block {
    fn new<'a>(
        style: fn() -> Style,
        texts: impl IntoIterator<Item = &'a str>,
        width_px: u32,
    ) -> Self {
        let style = style();
        let lines = texts.into_iter().flat_map(|text| style.wrap(text, width_px as f32)).collect();
        Self { style, lines }
    }

    fn height(&self) -> u32 {
        self.lines.len() as u32 * self.style.line_px
    }

    fn height_and(&self, space_px: u32) -> u32 {
        spaced(self.height(), space_px)
    }

    fn draw(&self, canvas: &mut RgbImage, left: u32, top: u32) {
        for (k, line) in self.lines.iter().enumerate() {
            self.style.draw(
                canvas,
                line,
                left as f32,
                (top + k as u32 * self.style.line_px) as f32,
            );
        }
    }
}

/// A height and the space after it. A height of 0 gets no space.
fn spaced(height_px: u32, space_px: u32) -> u32 {
    if height_px == 0 { 0 } else { height_px + space_px }
}

fn draw_image(canvas: &mut RgbImage, panel: &Panel, left: u32, top: u32) {
    let (width, height) = (panel.width as u32, panel.height as u32);
    assert!(
        panel.values.len() == panel.width * panel.height && !panel.values.is_empty(),
        "values of a panel"
    );
    let (black, white) = panel.range.limits(&panel.values);
    let span = if white > black { white - black } else { 1.0 };
    let grey: Vec<f32> = panel.values.iter().map(|&value| (value - black) / span).collect();
    let grey: ImageBuffer<Luma<f32>, _> =
        ImageBuffer::from_raw(width, height, grey).expect("a panel has width * height values");

    // The longer edge fills the panel. Whole multiples keep the camera's pixels square.
    let longer = width.max(height);
    let (wide, high) = (scaled(width, longer), scaled(height, longer));
    let filter =
        if PANEL_PX.is_multiple_of(longer) { FilterType::Nearest } else { FilterType::Triangle };
    let shown = imageops::resize(&grey, wide, high, filter);

    let (x0, y0) = (left + (PANEL_PX - wide) / 2, top + (PANEL_PX - high) / 2);
    for y in 0..high + 2 {
        for x in 0..wide + 2 {
            canvas.put_pixel(x0 + x - 1, y0 + y - 1, FRAME);
        }
    }
    for (x, y, pixel) in shown.enumerate_pixels() {
        let level = to_level(pixel.0[0]);
        canvas.put_pixel(x0 + x, y0 + y, Rgb([level; 3]));
    }
}

fn scaled(edge: u32, longer: u32) -> u32 {
    ((u64::from(edge) * u64::from(PANEL_PX) / u64::from(longer)) as u32).max(1)
}

impl Range {
    /// The values of black and of white.
    fn limits(self, values: &[f32]) -> (f32, f32) {
        match self {
            Self::Unit => (0.0, 1.0),
            Self::Fixed(black, white) => (black, white),
            Self::Stretched => values
                .iter()
                .filter(|value| value.is_finite())
                .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), &v| {
                    (low.min(v), high.max(v))
                }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn panel(title: &str, side: usize, caption: &[&str]) -> Panel {
        Panel {
            title: title.to_owned(),
            width: side,
            height: side,
            values: (0..side * side).map(|i| i as f32 / (side * side - 1) as f32).collect(),
            range: Range::Unit,
            caption: caption.iter().map(|&line| line.to_owned()).collect(),
            warnings: Vec::new(),
        }
    }

    fn side_by_side(header: &str, panels: Vec<Panel>, footer: &str) -> SideBySide {
        SideBySide { header: header.to_owned(), panels, footer: footer.to_owned() }
    }

    fn is_blank(
        canvas: &RgbImage,
        columns: impl Iterator<Item = u32> + Clone,
        rows: std::ops::Range<u32>,
    ) -> bool {
        rows.into_iter().all(|y| columns.clone().all(|x| *canvas.get_pixel(x, y) == GROUND))
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn text_of_any_length_stays_inside_its_panel(
            texts in prop::collection::vec("[ -~µ×−\n]{0,90}|[a-zW@]{60,90}", 7),
        ) {
            let left = panel(&texts[0], 32, &[&texts[1], &texts[2]]);
            let panels = vec![left, panel(&texts[3], 64, &[&texts[4]])];
            let canvas = side_by_side(&texts[5], panels, &texts[6]).render();
            let (width, height) = canvas.dimensions();
            prop_assert_eq!(width, 2 * MARGIN_PX + 2 * PANEL_PX + GAP_PX);
            // A glyph may extend beyond its box by a pixel or two.
            let lean = 3;
            prop_assert!(is_blank(&canvas, 0..MARGIN_PX - lean, 0..height));
            prop_assert!(is_blank(&canvas, width - MARGIN_PX + lean..width, 0..height));
            prop_assert!(is_blank(&canvas, 0..width, 0..MARGIN_PX - lean));
            prop_assert!(is_blank(&canvas, 0..width, height - MARGIN_PX + lean..height));
            // Between the panels only header and footer, which are as wide as both panels, may be
            // drawn.
            let inner = 2 * PANEL_PX + GAP_PX;
            let header = Block::new(HEADER, [texts[5].as_str()], inner).height_and(18);
            let footer = Block::new(FOOTER, [texts[6].as_str()], inner).height();
            let gap = MARGIN_PX + PANEL_PX + lean..MARGIN_PX + PANEL_PX + GAP_PX - lean;
            let rows = MARGIN_PX + header..height - MARGIN_PX - footer;
            prop_assert!(is_blank(&canvas, gap, rows));
        }
    }

    #[test]
    fn pixels_of_the_camera_stay_square_and_unmixed() {
        let canvas = side_by_side("", vec![panel("", 32, &[])], "").render();
        let cell = PANEL_PX / 32;
        for row in 0..32 {
            for column in 0..32 {
                let level = to_level((row * 32 + column) as f32 / 1023.0);
                for (dx, dy) in [(0, 0), (cell - 1, 0), (0, cell - 1), (cell - 1, cell - 1)] {
                    let found = canvas
                        .get_pixel(MARGIN_PX + column * cell + dx, MARGIN_PX + row * cell + dy);
                    assert_eq!(*found, Rgb([level; 3]), "{row} {column} {dx} {dy}");
                }
            }
        }
    }

    #[test]
    fn the_range_says_what_is_black_and_white() {
        let levels = |range| {
            let values = vec![-1.0, 0.0, 0.5, 3.0];
            let panel = Panel { width: 2, height: 2, values, range, ..panel("", 2, &[]) };
            let canvas = side_by_side("", vec![panel], "").render();
            let half = PANEL_PX / 2;
            [(0, 0), (half, 0), (0, half), (half, half)]
                .map(|(x, y)| canvas.get_pixel(MARGIN_PX + x, MARGIN_PX + y).0[0])
        };
        assert_eq!(levels(Range::Unit), [0, 0, 128, 255]);
        assert_eq!(levels(Range::Stretched), [0, 64, 96, 255]);
        assert_eq!(levels(Range::Fixed(0.0, 0.5)), [0, 0, 255, 255]);
    }

    #[test]
    fn flat_wide_and_broken_images_are_drawn_too() {
        for (width, height, value) in
            [(1, 1, 0.5), (7, 3, 0.0), (3, 700, 1.0), (2, 2, f32::NAN), (2, 2, f32::INFINITY)]
        {
            for range in [Range::Unit, Range::Stretched, Range::Fixed(1.0, 1.0)] {
                let values = vec![value; width * height];
                let odd = Panel { width, height, values, range, ..panel("odd", 2, &["x"]) };
                let canvas = side_by_side("h", vec![odd], "f").render();
                assert!(canvas.width() == PANEL_PX + 2 * MARGIN_PX);
            }
        }
    }

    #[test]
    fn a_warning_is_drawn_below_its_image_in_amber() {
        let warned =
            Panel { warnings: vec!["too little light".to_owned()], ..panel("", 2, &["x"]) };
        let canvas = side_by_side("", vec![panel("", 2, &["x"]), warned], "").render();
        let amber = |from: u32| {
            let columns = from..from + PANEL_PX;
            let rows = MARGIN_PX + PANEL_PX..canvas.height();
            rows.flat_map(|y| columns.clone().map(move |x| (x, y)))
                // Glyphs are anti-aliased: much red, little blue.
                .filter(|&(x, y)| {
                    let [red, _, blue] = canvas.get_pixel(x, y).0;
                    red > 100 && red / 2 > blue
                })
                .count()
        };
        assert_eq!(amber(MARGIN_PX), 0);
        assert!(amber(MARGIN_PX + PANEL_PX + GAP_PX) > 20);
    }

    #[test]
    fn more_text_makes_a_taller_picture_and_less_a_lower_one() {
        let height =
            |caption: &str| side_by_side("", vec![panel("", 2, &[caption])], "").render().height();
        assert_eq!(height(""), 2 * MARGIN_PX + PANEL_PX + 12);
        assert!(height(&"word ".repeat(40)) > height("word") && height("word") > height(""));
    }
}

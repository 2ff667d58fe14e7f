//! A picture of panels in a row, with a header above and a footer below. Below each image is a grey
//! bar with ticks in the image's unit, and the range of its values.
//!
//! # Invariant
//! The picture grows with its text
//! (`tests::more_text_makes_a_taller_picture_and_less_a_lower_one`). No text is cut or overlaps
//! (`tests::text_of_any_length_stays_inside_its_panel`). A square image has at least 256 pixels an
//! edge (`tests::an_image_is_enlarged_by_a_whole_factor_to_256_pixels_at_least`).

use super::bar::{self, draw_bar};
use super::scale::{PERCENTILES, Range, Scale, Unit};
use super::scale_bar::{self, draw_scale_bar};
use super::signature::{FOOTER, signed};
use super::text::{Block, Font, Style};
use super::{AMBER, BRIGHT, FRAME, GROUND, MIDDLE};
use crate::files::image::{Placed, encode_labelled, to_level};
use crate::provenance::Provenance;
use image::imageops::{self, FilterType};
use image::{ImageBuffer, Luma, Rgb, RgbImage};
use nirspi_recon::{Image, Shape};

/// Edge of a panel's image, unless a panel needs more: a multiple of the sides 32, 64 and 128, so
/// that their pixels stay square.
const PANEL_PX: u32 = 384;
/// The least shorter edge of an image that is enlarged.
pub(super) const LEAST_PX: u32 = 256;
const GAP_PX: u32 = 28;
const MARGIN_PX: u32 = 36;

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
    /// The unit of the values.
    pub unit: Unit,
    /// Lines below the image, such as `PSNR 23.4 dB  SSIM 0.81`.
    pub caption: Vec<String>,
    /// Reasons not to trust the image, below the image in amber.
    pub warnings: Vec<String>,
    /// Width of what the image shows on the target, for a bar in millimetres below the image;
    /// `None` for no bar.
    pub field_mm: Option<f64>,
}

impl Panel {
    /// A square image of `side` x `side` values, stretched, without caption and warnings.
    #[must_use]
    pub fn square(title: &str, side: usize, values: &[f32], unit: Unit) -> Self {
        Self {
            title: title.to_owned(),
            width: side,
            height: side,
            values: values.to_vec(),
            range: Range::Stretched,
            unit,
            caption: Vec::new(),
            warnings: Vec::new(),
            field_mm: None,
        }
    }

    /// An image, stretched, without caption and warnings.
    #[must_use]
    pub fn of_image(title: &str, image: &Image<impl Shape>, unit: Unit) -> Self {
        let (width, height) = (image.size().width(), image.size().height());
        Self { width, height, ..Self::square(title, width, image.pixels(), unit) }
    }

    /// The values that are black and white in the picture.
    #[must_use]
    pub fn scale(&self) -> Scale {
        Scale::of(self.range, self.unit, self.values.iter().copied())
    }

    /// Where readers find the image in the picture; nowhere if the image is made smaller.
    fn placed(&self, scale: &Scale, shown: (u32, u32), at: (u32, u32)) -> Option<Placed> {
        let (width, height) = (self.width as u32, self.height as u32);
        // Readers give values from 0 to 1.
        let (black, white) =
            if self.unit.is_fraction() { (scale.black, scale.white) } else { (0.0, 1.0) };
        let (left, top) = at;
        let cell = shown.0 / width;
        (cell > 0 && shown.0.is_multiple_of(width)).then_some(Placed {
            left,
            top,
            cell,
            width,
            height,
            black,
            white,
        })
    }

    /// Columns and rows of the image in the picture, in a panel of this edge. Beside other panels
    /// an image that is nearly as large as a panel fills the panel.
    fn shown_px(&self, panel_px: u32, is_alone: bool) -> (u32, u32) {
        let (width, height) = (self.width as u32, self.height as u32);
        let (longer, shorter) = (width.max(height), width.min(height));
        let fills = longer > panel_px || (!is_alone && 2 * longer > panel_px);
        if fills {
            let scaled = |edge| (u64::from(edge) * u64::from(panel_px) / u64::from(longer)) as u32;
            return (scaled(width).max(1), scaled(height).max(1));
        }
        let mut factor = panel_px / longer;
        if longer == shorter {
            factor = factor.max(LEAST_PX.div_ceil(shorter));
        }
        (width * factor, height * factor)
    }
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

impl From<Panel> for SideBySide {
    fn from(panel: Panel) -> Self {
        Self { header: String::new(), panels: vec![panel], footer: String::new() }
    }
}

impl SideBySide {
    /// Draws the picture without its provenance; [`signed_png`](super::signed_png) makes a PNG of it.
    ///
    /// # Panics
    /// If there is no panel, or a panel does not have exactly `width * height` values, at least
    /// one.
    #[must_use]
    pub fn render(&self) -> RgbImage {
        self.draw(PANEL_PX).0
    }

    /// As [`render`](Self::render), with panels of another edge.
    #[must_use]
    pub fn render_at(&self, panel_px: u32) -> RgbImage {
        self.draw(panel_px).0
    }

    /// The picture as a PNG, with its provenance below it. Readers of this program find the image of
    /// a single panel in the picture, and refuse a picture of several.
    ///
    /// # Panics
    /// As [`render`](Self::render).
    #[must_use]
    pub fn png(&self, provenance: &Provenance) -> Vec<u8> {
        let (picture, placed) = self.draw(PANEL_PX);
        encode_labelled(&signed(&picture, provenance), self.panels.len(), placed, provenance)
    }

    /// Rows of the picture.
    pub(super) fn height(&self) -> u32 {
        self.lay(PANEL_PX).height
    }

    fn lay(&self, panel_px: u32) -> Laid {
        assert!(!self.panels.is_empty(), "a picture of at least one panel");
        let columns = self.panels.len() as u32;
        let shown = |panel: &Panel| panel.shown_px(panel_px, columns == 1);
        let shown: Vec<(u32, u32)> = self.panels.iter().map(shown).collect();
        let edge = shown.iter().map(|&(w, h)| w.max(h)).max().unwrap_or(0).max(LEAST_PX);
        let edge = if columns == 1 { edge } else { edge.max(panel_px) };
        let inner = columns * edge + (columns - 1) * GAP_PX;
        let scales: Vec<Scale> = self.panels.iter().map(Panel::scale).collect();

        let header = Block::new(HEADER, [self.header.as_str()], inner);
        let titles = self.blocks(TITLE, edge, |panel| vec![panel.title.as_str()]);
        let ranges: Vec<Block> =
            scales.iter().map(|scale| Block::new(RANGE, [scale.line().as_str()], edge)).collect();
        let warnings =
            self.blocks(WARNING, edge, |panel| panel.warnings.iter().map(String::as_str).collect());
        let captions =
            self.blocks(CAPTION, edge, |panel| panel.caption.iter().map(String::as_str).collect());
        let footer = Block::new(FOOTER, [self.footer.as_str(), &self.stretch_line()], inner);
        let tallest = |blocks: &[Block]| blocks.iter().map(Block::height).max().unwrap_or(0);

        let title_top = MARGIN_PX + header.height_and(18);
        let image_top = title_top + spaced(tallest(&titles), 10);
        let has_length = self.panels.iter().any(|panel| panel.field_mm.is_some());
        let length_top = image_top + edge + 6;
        let bar_top = length_top + if has_length { scale_bar::HEIGHT_PX } else { 0 } + 6;
        let range_top = bar_top + bar::HEIGHT_PX + 4;
        let warning_top = range_top + spaced(tallest(&ranges), 8);
        let caption_top = warning_top + spaced(tallest(&warnings), 8);
        let footer_top = caption_top + spaced(tallest(&captions), 16);
        let height = footer_top + footer.height() + MARGIN_PX;
        Laid {
            shown,
            edge,
            inner,
            scales,
            header,
            titles,
            ranges,
            warnings,
            captions,
            footer,
            image_top,
            length_top,
            bar_top,
            range_top,
            warning_top,
            caption_top,
            footer_top,
            height,
        }
    }

    /// The picture, and the place of a single image in it.
    fn draw(&self, panel_px: u32) -> (RgbImage, Option<Placed>) {
        let laid = self.lay(panel_px);
        let mut canvas = RgbImage::from_pixel(laid.inner + 2 * MARGIN_PX, laid.height, GROUND);
        laid.header.draw(&mut canvas, MARGIN_PX, MARGIN_PX);
        let mut placed = None;
        for (column, panel) in self.panels.iter().enumerate() {
            let left = MARGIN_PX + column as u32 * (laid.edge + GAP_PX);
            let title = &laid.titles[column];
            // A short title is directly above its image, also if a neighbour's title has more
            // lines.
            title.draw(&mut canvas, left, laid.image_top - spaced(title.height(), 10));
            let (scale, (wide, high)) = (&laid.scales[column], laid.shown[column]);
            let (x, y) = (left + (laid.edge - wide) / 2, laid.image_top + (laid.edge - high) / 2);
            draw_image(&mut canvas, panel, scale, (wide, high), (x, y));
            if self.panels.len() == 1 {
                placed = panel.placed(scale, (wide, high), (x, y));
            }
            if let Some(field_mm) = panel.field_mm {
                draw_scale_bar(&mut canvas, field_mm, wide, (x, laid.length_top));
            }
            draw_bar(&mut canvas, scale, (left, laid.bar_top), laid.edge);
            laid.ranges[column].draw(&mut canvas, left, laid.range_top);
            laid.warnings[column].draw(&mut canvas, left, laid.warning_top);
            laid.captions[column].draw(&mut canvas, left, laid.caption_top);
        }
        laid.footer.draw(&mut canvas, MARGIN_PX, laid.footer_top);
        (canvas, placed)
    }

    /// What the bars show of stretched images.
    fn stretch_line(&self) -> String {
        match self.panels.iter().any(|panel| panel.range == Range::Stretched) {
            true => stretch_words("each image"),
            false => String::new(),
        }
    }

    fn blocks<'a>(
        &'a self,
        style: fn() -> Style,
        width_px: u32,
        texts: impl Fn(&'a Panel) -> Vec<&'a str>,
    ) -> Vec<Block> {
        self.panels.iter().map(|panel| Block::new(style, texts(panel), width_px)).collect()
    }
}

/// The texts of a picture in lines, and where everything is.
struct Laid {
    /// Columns and rows of each image in the picture.
    shown: Vec<(u32, u32)>,
    /// Edge of a panel.
    edge: u32,
    /// Width without margins.
    inner: u32,
    scales: Vec<Scale>,
    header: Block,
    titles: Vec<Block>,
    ranges: Vec<Block>,
    warnings: Vec<Block>,
    captions: Vec<Block>,
    footer: Block,
    image_top: u32,
    length_top: u32,
    bar_top: u32,
    range_top: u32,
    warning_top: u32,
    caption_top: u32,
    footer_top: u32,
    height: u32,
}

/// The rule of stretched pictures in words.
pub(super) fn stretch_words(of: &str) -> String {
    let [low, high] = PERCENTILES;
    format!("black and white: percentiles {low} and {high} of {of}")
}

/// Rows of panels below each other, with aligned left edges.
///
/// # Panics
/// As [`SideBySide::render`].
#[must_use]
pub fn stacked(rows: &[SideBySide]) -> RgbImage {
    below(&rows.iter().map(SideBySide::render).collect::<Vec<_>>())
}

/// Ground of so many columns and rows.
#[must_use]
pub fn blank(width: u32, height: u32) -> RgbImage {
    RgbImage::from_pixel(width, height, GROUND)
}

/// Pictures below each other, with aligned left edges.
#[must_use]
pub fn below(pictures: &[RgbImage]) -> RgbImage {
    let width = pictures.iter().map(RgbImage::width).max().unwrap_or(1);
    let height = pictures.iter().map(RgbImage::height).sum::<u32>().max(1);
    let mut canvas = RgbImage::from_pixel(width, height, GROUND);
    let mut top = 0;
    for picture in pictures {
        imageops::replace(&mut canvas, picture, 0, i64::from(top));
        top += picture.height();
    }
    canvas
}

/// Pictures beside each other, with aligned upper edges.
#[must_use]
pub fn beside(pictures: &[RgbImage]) -> RgbImage {
    let width = pictures.iter().map(RgbImage::width).sum::<u32>().max(1);
    let height = pictures.iter().map(RgbImage::height).max().unwrap_or(1);
    let mut canvas = RgbImage::from_pixel(width, height, GROUND);
    let mut left = 0;
    for picture in pictures {
        imageops::replace(&mut canvas, picture, i64::from(left), 0);
        left += picture.width();
    }
    canvas
}

pub(super) const HEADER: fn() -> Style =
    || Style { font: Font::sans(), size_px: 32.0, line_px: 40, colour: BRIGHT };
const TITLE: fn() -> Style =
    || Style { font: Font::sans(), size_px: 23.0, line_px: 28, colour: BRIGHT };
const RANGE: fn() -> Style =
    || Style { font: Font::sans(), size_px: 17.0, line_px: 22, colour: MIDDLE };
const CAPTION: fn() -> Style =
    || Style { font: Font::mono(), size_px: 16.0, line_px: 22, colour: MIDDLE };
pub(super) const WARNING: fn() -> Style =
    || Style { font: Font::sans(), size_px: 19.0, line_px: 26, colour: AMBER };

/// A height and the space after it. A height of 0 gets no space.
pub(super) fn spaced(height_px: u32, space_px: u32) -> u32 {
    if height_px == 0 { 0 } else { height_px + space_px }
}

fn draw_image(
    canvas: &mut RgbImage,
    panel: &Panel,
    scale: &Scale,
    (wide, high): (u32, u32),
    (x0, y0): (u32, u32),
) {
    let (width, height) = (panel.width as u32, panel.height as u32);
    assert!(
        panel.values.len() == panel.width * panel.height && !panel.values.is_empty(),
        "values of a panel"
    );
    let grey: Vec<f32> = panel.values.iter().map(|&value| scale.level(value)).collect();
    let grey: ImageBuffer<Luma<f32>, _> =
        ImageBuffer::from_raw(width, height, grey).expect("a panel has width * height values");

    // Whole multiples keep the camera's pixels square and unmixed.
    let whole = wide.is_multiple_of(width) && high.is_multiple_of(height);
    let filter = if whole { FilterType::Nearest } else { FilterType::Triangle };
    let shown = imageops::resize(&grey, wide, high, filter);
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
            unit: Unit::OfWhite,
            caption: caption.iter().map(|&line| line.to_owned()).collect(),
            warnings: Vec::new(),
            field_mm: None,
        }
    }

    #[test]
    fn images_of_one_field_have_bars_of_one_length() {
        let with = |side: usize, field_mm| Panel { field_mm, ..panel("", side, &[]) };
        let bars = |panels: Vec<Panel>| {
            let picture = side_by_side("", panels, "");
            let canvas = picture.render();
            let y = picture.lay(PANEL_PX).length_top + scale_bar::HEIGHT_PX / 2;
            let lit = |from: u32| {
                // The label begins after a gap.
                (from..).take_while(|&x| *canvas.get_pixel(x, y) == MIDDLE).count()
            };
            [0, 1].map(|column| lit(MARGIN_PX + column * (PANEL_PX + GAP_PX)))
        };
        // 20 of 96 mm in 384 pixels.
        assert_eq!(bars(vec![with(32, Some(96.0)), with(64, Some(96.0))]), [80, 80]);
        let height = |field_mm| side_by_side("", vec![with(32, field_mm)], "").render().height();
        assert_eq!(height(Some(96.0)), height(None) + scale_bar::HEIGHT_PX);
    }

    #[test]
    fn an_image_is_enlarged_by_a_whole_factor_to_256_pixels_at_least() {
        for side in (1..300).chain([512]) {
            let panel = Panel::square("", side, &vec![0.0; side * side], Unit::OfWhite);
            let (wide, high) = panel.shown_px(PANEL_PX, true);
            assert!(wide == high && wide >= LEAST_PX, "{side}: {wide} x {high}");
            assert!(side > 384 || (wide as usize).is_multiple_of(side), "{side}: {wide}");
        }
        let of = |width, height| {
            let values = vec![0.0; width * height];
            Panel { width, height, values, ..Panel::square("", 0, &[], Unit::OfWhite) }
        };
        assert_eq!(of(7, 3).shown_px(PANEL_PX, true), (378, 162));
        assert_eq!(of(3, 700).shown_px(PANEL_PX, true), (1, 384));
        assert_eq!(of(100, 900).shown_px(PANEL_PX, true), (42, 384));
        // A scene of 256 pixels beside the camera's image.
        assert_eq!(of(256, 256).shown_px(PANEL_PX, false), (384, 384));
        assert_eq!(of(128, 128).shown_px(PANEL_PX, false), (384, 384));
    }

    #[test]
    fn the_bar_goes_from_black_to_white_and_has_ticks_in_the_units_of_the_image() {
        let canvas = side_by_side("", vec![panel("", 32, &[])], "").render();
        let row = MARGIN_PX + PANEL_PX + 12 + 7;
        let greys: Vec<u8> =
            (1..PANEL_PX - 1).map(|x| canvas.get_pixel(MARGIN_PX + x, row).0[0]).collect();
        assert!(greys.is_sorted() && greys[0] <= 1 && greys[381] >= 254, "{greys:?}");
        // A tick at 0.2 of 0 to 1, below the bar.
        let tick = MARGIN_PX + (0.2 * f64::from(PANEL_PX - 1)).round() as u32;
        assert_eq!(*canvas.get_pixel(tick, MARGIN_PX + PANEL_PX + 12 + 15), MIDDLE);
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
        // 200 values and more have percentiles of their own; of four, these are the ends.
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
                let wide = LEAST_PX + 2 * MARGIN_PX..=PANEL_PX + 2 * MARGIN_PX;
                assert!(wide.contains(&canvas.width()), "{width} x {height}");
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
        let below = 12 + bar::HEIGHT_PX + 4 + 22 + 8;
        assert_eq!(height(""), 2 * MARGIN_PX + PANEL_PX + below);
        assert!(height(&"word ".repeat(40)) > height("word") && height("word") > height(""));
    }
}

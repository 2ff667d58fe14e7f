//! A picture of panels in rows, with a header above and a footer below. Below each image are
//! millimetres, where they are known, and a grey bar with ticks in the image's unit. Images of a row
//! that share one scale have one bar.
//!
//! # Invariant
//! The picture grows with its text
//! (`tests::more_text_makes_a_taller_picture_and_less_a_lower_one`). No text is cut or overlaps
//! (`tests::text_of_any_length_stays_inside_its_panel`). A panel has room for a line of words
//! (`tests::panels_have_as_many_rows_as_their_text_needs`). The image of a single panel is enlarged
//! by a whole factor, so that programs can read it (`tests::a_single_image_has_whole_pixels`).

use super::bar::{self, draw_bar, draw_ticks};
use super::drawing::{Drawing, Shape};
use super::look::Look;
use super::scale::{PERCENTILES, Range, Scale, Unit};
use super::signature::MARGIN;
use super::text::{Block, Style};
use super::ticks::{between, label};
use nirspi_files::image::{Placed, to_level};
use nirspi_recon::Image;

/// Blank between panels, in sixteenths of the text's size.
const GAP: u32 = 14;
/// The least edge of a panel beside others.
const LEAST: u32 = 172;
/// Room for the labels of millimetres left of the first panel of a row.
const AXIS: u32 = 36;

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
    /// Reasons not to trust the image, below the image in the colour of warnings.
    pub warnings: Vec<String>,
    /// Width of what the image shows on the target, for axes in millimetres; `None` for no axes.
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
    pub fn of_image(title: &str, image: &Image<impl nirspi_recon::Shape>, unit: Unit) -> Self {
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

    /// Columns and rows of the image in a panel of this edge. Images beside each other are of one
    /// size. A single image has whole pixels, unless it is larger than the panel.
    fn shown_px(&self, edge: u32, is_alone: bool) -> (u32, u32) {
        let (width, height) = (self.width as u32, self.height as u32);
        let longer = width.max(height);
        if is_alone && longer <= edge {
            let factor = edge / longer;
            return (width * factor, height * factor);
        }
        let scaled = |side| (u64::from(side) * u64::from(edge) / u64::from(longer)) as u32;
        (scaled(width).max(1), scaled(height).max(1))
    }

    /// Draws the image.
    fn draw(&self, canvas: &mut Drawing, look: &Look, scale: &Scale, at: [u32; 4]) {
        assert!(
            self.values.len() == self.width * self.height && !self.values.is_empty(),
            "values of a panel"
        );
        let [left, top, wide, high] = at;
        let edge = look.px(1).max(1);
        canvas
            .rect([left - edge, top - edge, wide + 2 * edge, high + 2 * edge], look.palette.frame);
        let levels = self.values.iter().map(|&value| to_level(scale.level(value))).collect();
        let columns = self.width as u32;
        // The camera's pixels stay square and unmixed. A photograph's pixels are not looked at.
        let smooth = wide < 3 * columns && !wide.is_multiple_of(columns);
        canvas.shapes.push(Shape::Image { at, columns, levels, smooth });
    }
}

/// Panels in rows with a header and a footer line. Empty texts take no room.
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
    /// Draws the picture in this width, without its provenance, and says where a single image is.
    ///
    /// # Panics
    /// If there is no panel, or a panel does not have exactly `width * height` values, at least
    /// one.
    pub(super) fn draw(&self, look: &Look, width: u32) -> (Drawing, Option<Placed>) {
        assert!(!self.panels.is_empty(), "a picture of at least one panel");
        let margin = look.px(MARGIN);
        let inner = width - 2 * margin;
        let header = Block::new(Style::header(look), [self.header.as_str()], inner);
        let footer =
            Block::new(Style::faint(look), [self.footer.as_str(), &self.stretch_line()], inner);
        let (columns, edge) = self.columns(look, inner);
        let rows: Vec<(Drawing, Option<Placed>)> =
            self.panels.chunks(columns).map(|row| self.row(look, row, inner, edge)).collect();
        let rows_px: u32 = rows.iter().map(|(row, _)| row.height).sum();
        let top = margin + header.height_and(look.px(8));
        let height = top + rows_px + footer.height() + margin / 2;
        let mut canvas = Drawing::new(look, width, height);
        header.draw(&mut canvas, margin, margin);
        let (mut top, mut placed) = (top, None);
        for (row, found) in rows {
            placed = found.map(|found| Placed {
                left: found.left + margin,
                top: found.top + top,
                ..found
            });
            let high = row.height;
            canvas.place(row, margin, top);
            top += high;
        }
        footer.draw(&mut canvas, margin, top);
        (canvas, placed)
    }

    /// Width of the picture, which is smaller for a single image.
    pub(super) fn width(&self, look: &Look) -> u32 {
        if self.panels.len() == 1 { look.single().min(look.width()) } else { look.width() }
    }

    /// Whether there are axes in millimetres.
    fn has_axes(&self) -> bool {
        self.panels.iter().any(|panel| panel.field_mm.is_some())
    }

    /// Panels in a row, and the edge of each.
    fn columns(&self, look: &Look, inner: u32) -> (usize, u32) {
        let axis = if self.has_axes() { look.px(AXIS) } else { 0 };
        let (gap, count) = (look.px(GAP), self.panels.len() as u32);
        let most = ((inner - axis + gap) / (look.px(LEAST) + gap)).max(1);
        let columns = count.div_ceil(count.div_ceil(most));
        // A frame extends beyond its image.
        let edge = (inner - axis - (columns - 1) * gap) / columns - 2 * look.px(1);
        (columns as usize, edge)
    }

    /// A row of panels without margins.
    fn row(
        &self,
        look: &Look,
        panels: &[Panel],
        inner: u32,
        edge: u32,
    ) -> (Drawing, Option<Placed>) {
        let is_alone = self.panels.len() == 1;
        let axis = if self.has_axes() { look.px(AXIS) } else { 0 };
        let scales: Vec<Scale> = panels.iter().map(Panel::scale).collect();
        let shared = panels.len() > 1 && scales.iter().all(|scale| scale.is_drawn_as(&scales[0]));
        let shown: Vec<(u32, u32)> =
            panels.iter().map(|panel| panel.shown_px(edge, is_alone)).collect();
        let tall = shown.iter().map(|&(_, high)| high).max().unwrap_or(1);
        let plain = Style::plain(look);

        let titles = blocks(panels, Style::title(look), edge, |panel| vec![&panel.title]);
        let ranges: Vec<Block> = scales
            .iter()
            .map(|scale| if shared { scale.found() } else { scale.line() })
            .map(|line| Block::new(plain, [line.as_str()], edge))
            .collect();
        let warnings = blocks(panels, Style::warning(look), edge, |p| p.warnings.iter().collect());
        let captions = blocks(panels, plain, edge, |p| p.caption.iter().collect());
        let common = if shared { units(&scales) } else { String::new() };
        let common = Block::new(plain, [common.as_str()], inner - axis);
        let tallest = |blocks: &[Block]| blocks.iter().map(Block::height).max().unwrap_or(0);

        let image_top = spaced(tallest(&titles), look.px(4)) + look.px(1);
        let axis_top = image_top + tall + look.px(1);
        let axis_px = if axis > 0 { look.px(4) + plain.line_px } else { 0 };
        let bar_top = axis_top + axis_px + look.px(5);
        let own_bar_px = if shared { 0 } else { bar::height(look) + look.px(2) };
        let text_top = bar_top + own_bar_px;
        // Texts of a panel follow each other.
        let text_px = |column: usize| {
            let blocks = [&ranges[column], &warnings[column], &captions[column]];
            blocks.map(|block| spaced(block.height(), look.px(3))).iter().sum::<u32>()
        };
        let most_text = (0..panels.len()).map(text_px).max().unwrap_or(0);
        let common_top = text_top + most_text + look.px(4);
        let common_px = if shared { bar::height(look) + common.height() + look.px(4) } else { 0 };
        let height = common_top + common_px + look.px(8);

        let mut canvas = Drawing::new(look, inner, height);
        let mut placed = None;
        for (column, panel) in panels.iter().enumerate() {
            let left = axis + column as u32 * (edge + 2 * look.px(1) + look.px(GAP)) + look.px(1);
            let title = &titles[column];
            // A short title is directly above its image, also if a neighbour's title has more
            // lines.
            let title_top = image_top - look.px(1) - spaced(title.height(), look.px(4));
            title.draw(&mut canvas, left, title_top);
            let (scale, (wide, high)) = (&scales[column], shown[column]);
            panel.draw(&mut canvas, look, scale, [left, image_top, wide, high]);
            if is_alone {
                placed = panel.placed(scale, (wide, high), (left, image_top));
            }
            if let Some(field_mm) = panel.field_mm {
                let at = [left, image_top, wide, high];
                draw_axes(&mut canvas, look, field_mm, at, column == 0);
            }
            if !shared {
                draw_bar(
                    &mut canvas,
                    look,
                    scale,
                    (left, bar_top),
                    if is_alone { wide.max(look.px(LEAST)) } else { edge },
                );
            }
            let mut top = text_top;
            for block in [&ranges[column], &warnings[column], &captions[column]] {
                block.draw(&mut canvas, left, top);
                top += spaced(block.height(), look.px(3));
            }
        }
        if shared {
            let wide = panels.len() as u32 * (edge + 2 * look.px(1) + look.px(GAP)) - look.px(GAP);
            draw_bar(
                &mut canvas,
                look,
                &scales[0],
                (axis + look.px(1), common_top),
                wide - 2 * look.px(1),
            );
            common.draw(&mut canvas, axis + look.px(1), common_top + bar::height(look));
        }
        (canvas, placed)
    }

    /// What the bars show of stretched images.
    fn stretch_line(&self) -> String {
        match self.panels.iter().any(|panel| panel.range == Range::Stretched) {
            true => stretch_words("each image"),
            false => String::new(),
        }
    }
}

/// The units of a scale that images share.
fn units(scales: &[Scale]) -> String {
    let mut names: Vec<&str> = scales.iter().map(|scale| scale.unit.name()).collect();
    names.dedup();
    names.join(", ")
}

fn blocks<'a>(
    panels: &'a [Panel],
    style: Style,
    width: u32,
    texts: impl Fn(&'a Panel) -> Vec<&'a String>,
) -> Vec<Block> {
    let block = |panel| Block::new(style, texts(panel).into_iter().map(String::as_str), width);
    panels.iter().map(block).collect()
}

/// Millimetres below an image and, for the first of a row, left of it: 0 is the lower left corner.
fn draw_axes(
    canvas: &mut Drawing,
    look: &Look,
    field_mm: f64,
    [left, top, wide, high]: [u32; 4],
    with_vertical: bool,
) {
    let style = Style::plain(look);
    // The last label has the unit, and must not touch the one before.
    let round = between(0.0, field_mm, if wide < look.px(288) { 3 } else { 5 });
    let below = top + high + look.px(1);
    let per_mm = f64::from(wide) / field_mm;
    let last = round.len().saturating_sub(1);
    let words = |(k, mm): (usize, &f64)| {
        let unit = if k == last { " mm" } else { "" };
        (f64::from(left) + mm * per_mm, format!("{}{unit}", label(*mm)))
    };
    let ticks: Vec<(f64, String)> = round.iter().enumerate().map(words).collect();
    draw_ticks(canvas, look, &ticks, below, (left, left + wide));
    if with_vertical {
        let edge = f64::from(left - look.px(1));
        for mm in round {
            let y = f64::from(top + high) - mm * per_mm;
            if y + 1.0 < f64::from(top) {
                continue;
            }
            let start = edge - f64::from(look.px(4));
            canvas.line([(start, y), (edge, y)], f64::from(look.px(1)), style.colour);
            let text = label(mm);
            let x = start as f32 - look.px(2) as f32 - style.width(&text);
            style.draw(canvas, &text, x.max(0.0), y as f32 - style.line_px as f32 / 2.0);
        }
    }
}

/// The rule of stretched pictures in words.
pub(super) fn stretch_words(of: &str) -> String {
    let [low, high] = PERCENTILES;
    format!("black and white: percentiles {low} and {high} of {of}")
}

/// A height and the space after it. A height of 0 gets no space.
pub(super) fn spaced(height_px: u32, space_px: u32) -> u32 {
    if height_px == 0 { 0 } else { height_px + space_px }
}

#[cfg(test)]
mod tests;

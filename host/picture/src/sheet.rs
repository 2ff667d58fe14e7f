//! A contact sheet: many images in one picture, each with its number.
//!
//! # Invariant
//! A sheet shows every image, or evenly chosen ones from the first to the last, and says how many
//! of how many (`tests::a_sheet_shows_the_first_and_the_last_and_says_how_many`).

use super::bar::{self, draw_bar};
use super::drawing::{Drawing, Shape};
use super::layout::{spaced, stretch_words};
use super::look::{Colour, FigureStyle, Look};
use super::scale::{Range, Scale, Unit};
use super::signature::{MARGIN, signed};
use super::text::{Block, Style};
use super::ticks::number;
use nirspi_files::image::{encode_labelled, to_level};
use nirspi_files::provenance::Provenance;
use rayon::prelude::*;

/// The least edge of an image in the picture, in sixteenths of the text's size: its label stays
/// below it.
const TILE: u32 = 96;
/// Most images in a row.
const COLUMNS: usize = 8;
/// The most images in the picture.
const MOST: usize = 64;
/// The most images of a video beside it, which must not delay other results.
pub(super) const MOST_BESIDE: usize = 100;
const GAP: u32 = 10;
/// The grey bar is at most so wide.
const BAR: u32 = 512;
/// An image of a smaller share of the common range would not be seen: then each has its own.
const VISIBLE_SHARE: f32 = 0.125;

/// Many images of one size and unit.
#[derive(Debug, Clone)]
pub struct Sheet<'a> {
    header: String,
    /// Height and width of each image.
    size: (usize, usize),
    /// Number of images that there are.
    count: usize,
    /// Those at hand, and their numbers, which rise.
    images: Vec<&'a [f32]>,
    numbers: Vec<usize>,
    unit: Unit,
    warned: Vec<usize>,
    scale: CommonOrOwn,
}

#[derive(Debug, Clone)]
enum CommonOrOwn {
    Common(Scale),
    Own(Vec<Scale>),
}

impl<'a> Sheet<'a> {
    /// A sheet of images of this height and width.
    ///
    /// All images have one scale. If some images would not be seen on the common scale, each has
    /// its own.
    ///
    /// # Panics
    /// If an image has another number of values, or none.
    #[must_use]
    pub fn new(header: String, size: (usize, usize), images: Vec<&'a [f32]>, unit: Unit) -> Self {
        let numbers = (0..images.len()).collect();
        Self::of_chosen(header, size, images.len(), (numbers, images), unit)
    }

    /// A sheet of `count` images, of which those with the numbers [`chosen`] are at hand.
    ///
    /// # Panics
    /// As [`new`](Self::new).
    #[must_use]
    pub fn of_chosen(
        header: String,
        size: (usize, usize),
        count: usize,
        (numbers, images): (Vec<usize>, Vec<&'a [f32]>),
        unit: Unit,
    ) -> Self {
        let (height, width) = size;
        let whole = images.iter().all(|image| image.len() == height * width);
        assert!(height > 0 && width > 0 && whole, "images of {height} x {width}");
        let of = |values: &[f32]| Scale::of(Range::Stretched, unit, values.iter().copied());
        let all = images.iter().flat_map(|image| image.iter().copied());
        let common = Scale::of(Range::Stretched, unit, all);
        let own: Vec<Scale> = images.par_iter().map(|image| of(image)).collect();
        let span = |scale: &Scale| scale.white - scale.black;
        // A flat image is dark on every scale.
        let hidden =
            |scale: &Scale| span(scale) > 0.0 && span(scale) < VISIBLE_SHARE * span(&common);
        let scale = match own.iter().any(hidden) {
            true => CommonOrOwn::Own(own),
            false => CommonOrOwn::Common(common),
        };
        Self { header, size, count, images, numbers, unit, warned: Vec::new(), scale }
    }

    /// The same sheet, with these images marked as not to be trusted.
    #[must_use]
    pub fn with_warned(mut self, warned: Vec<usize>) -> Self {
        self.warned = warned;
        self
    }

    /// Number of images that there are.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// The images in the picture.
    pub(super) fn shown(&self) -> Vec<usize> {
        evenly(self.count, MOST)
    }

    /// Where an image at hand stands among these.
    fn place(&self, index: usize) -> usize {
        self.numbers.binary_search(&index).expect("a chosen image")
    }

    /// The common scale, or each image's with its number.
    pub(super) fn scales(&self) -> Vec<(String, Scale)> {
        match &self.scale {
            CommonOrOwn::Common(scale) => vec![("all".to_owned(), *scale)],
            CommonOrOwn::Own(own) => {
                self.numbers.iter().zip(own).map(|(k, scale)| (k.to_string(), *scale)).collect()
            }
        }
    }

    pub(super) fn size(&self) -> (usize, usize) {
        self.size
    }

    pub(super) fn unit(&self) -> Unit {
        self.unit
    }

    pub(super) fn image(&self, index: usize) -> &'a [f32] {
        self.images[self.place(index)]
    }

    pub(super) fn scale_of(&self, index: usize) -> Scale {
        match &self.scale {
            CommonOrOwn::Common(scale) => *scale,
            CommonOrOwn::Own(own) => own[self.place(index)],
        }
    }

    pub(super) fn is_warned(&self, index: usize) -> bool {
        self.warned.contains(&index)
    }

    /// The sheet as a PNG with its provenance, which this program's readers refuse as an image.
    #[must_use]
    pub fn png(&self, look: &Look, provenance: &Provenance) -> Vec<u8> {
        let picture = signed(self.draw(look), look, provenance).raster();
        encode_labelled(&picture, self.count, None, provenance)
    }

    /// The sheet as files: endings and bytes of PNG, SVG and PDF.
    #[must_use]
    pub fn files(
        &self,
        style: FigureStyle,
        provenance: &Provenance,
    ) -> Vec<(&'static str, Vec<u8>)> {
        let look = style.look();
        let drawing = signed(self.draw(&look), &look, provenance);
        drawing.files(self.png(&look, provenance), provenance)
    }

    /// What is shown of how many, and on which scale.
    fn lines(&self) -> Vec<String> {
        let (shown, count) = (self.shown().len(), self.count());
        let chosen = match shown < count {
            true => format!("{shown} of {count} images shown, evenly chosen"),
            false if count == 1 => "1 image".to_owned(),
            false => format!("all {count} images"),
        };
        match &self.scale {
            CommonOrOwn::Common(scale) => {
                let of = match self.images.len() < count {
                    true => "the chosen images together",
                    false => "all images together",
                };
                vec![chosen, scale.line(), stretch_words(of)]
            }
            CommonOrOwn::Own(_) => {
                let unit = self.unit;
                vec![
                    format!("{chosen}; each has its own scale, below it, in {unit}"),
                    stretch_words("each image"),
                ]
            }
        }
    }

    fn label(&self, index: usize) -> String {
        match &self.scale {
            CommonOrOwn::Common(_) => index.to_string(),
            CommonOrOwn::Own(_) => {
                let Scale { black, white, .. } = self.scale_of(index);
                format!("{index}: {} to {}", number(black), number(white))
            }
        }
    }

    /// Draws the sheet. Without images it has its text alone.
    #[must_use]
    pub fn draw(&self, look: &Look) -> Drawing {
        let shown = self.shown();
        let (margin, gap) = (look.px(MARGIN), look.px(GAP));
        let inner = look.width() - 2 * margin;
        let most = (((inner + gap) / (look.px(TILE) + gap)) as usize).clamp(1, COLUMNS);
        let columns = shown.len().clamp(1, most);
        // Few images are not larger than a picture of one.
        let room = (inner + gap) / columns as u32 - gap;
        let room = room.min(look.single());
        let (high, tile) = self.tile(room);

        let header = Block::new(Style::header(look), [self.header.as_str()], inner);
        let labels: Vec<Block> = shown
            .iter()
            .map(|&index| {
                let style =
                    if self.is_warned(index) { Style::warning(look) } else { Style::plain(look) };
                Block::new(style, [self.label(index).as_str()], tile)
            })
            .collect();
        let label_px = labels.iter().map(Block::height).max().unwrap_or(0);
        let warning = Block::new(Style::warning(look), [self.warning().as_str()], inner);
        let lines = self.lines();
        let footer = Block::new(Style::faint(look), lines.iter().map(String::as_str), inner);
        let has_bar = matches!(self.scale, CommonOrOwn::Common(_));
        let rows = shown.len().div_ceil(columns) as u32;

        let grid_top = margin + header.height_and(look.px(8));
        let row_px = high + look.px(3) + label_px + gap;
        let bar_top = grid_top + rows * row_px;
        let warning_top = bar_top + if has_bar { bar::height(look) + look.px(4) } else { 0 };
        let footer_top = warning_top + spaced(warning.height(), look.px(4));
        let height = footer_top + footer.height() + margin;
        let mut canvas = Drawing::new(look, look.width(), height);
        header.draw(&mut canvas, margin, margin);
        for (at, &index) in shown.iter().enumerate() {
            let left = margin + (at % columns) as u32 * (tile + gap);
            let top = grid_top + (at / columns) as u32 * row_px;
            let warned = self.is_warned(index);
            let border = if warned { look.palette.warning } else { look.palette.frame };
            // A warning is a wider frame.
            let edge = look.px(if warned { 3 } else { 1 }).max(1);
            self.draw_tile(&mut canvas, index, [left, top, tile, high], edge, border);
            labels[at].draw(&mut canvas, left, top + high + look.px(3));
        }
        if let CommonOrOwn::Common(scale) = &self.scale {
            draw_bar(&mut canvas, look, scale, (margin, bar_top), inner.min(look.px(BAR)));
        }
        warning.draw(&mut canvas, margin, warning_top);
        footer.draw(&mut canvas, margin, footer_top);
        canvas
    }

    fn warning(&self) -> String {
        match self.warned.len() {
            0 => String::new(),
            count => format!("{count} of {} with warnings: wide frames", self.count()),
        }
    }

    /// Height and width of an image in the picture, neither more than `room`: whole pixels, if the room
    /// is enough.
    fn tile(&self, room: u32) -> (u32, u32) {
        let (height, width) = (self.size.0 as u32, self.size.1 as u32);
        let longer = height.max(width);
        match room / longer {
            0 => ((height * room / longer).max(1), (width * room / longer).max(1)),
            cell => (height * cell, width * cell),
        }
    }

    fn draw_tile(
        &self,
        canvas: &mut Drawing,
        index: usize,
        at: [u32; 4],
        edge: u32,
        border: Colour,
    ) {
        let [left, top, wide, high] = at;
        canvas.rect([left - edge, top - edge, wide + 2 * edge, high + 2 * edge], border);
        let scale = self.scale_of(index);
        let levels = self.image(index).iter().map(|&v| to_level(scale.level(v))).collect();
        let columns = self.size.1 as u32;
        let smooth = !wide.is_multiple_of(columns);
        canvas.shapes.push(Shape::Image { at, columns, levels, smooth });
    }
}

/// The numbers of the images that a sheet of `count` images, and a video beside it, show.
#[must_use]
pub fn chosen(count: usize) -> Vec<usize> {
    let mut numbers = [evenly(count, MOST), evenly(count, MOST_BESIDE)].concat();
    numbers.sort_unstable();
    numbers.dedup();
    numbers
}

/// At most `most` of `count` indices, evenly from the first to the last.
pub(super) fn evenly(count: usize, most: usize) -> Vec<usize> {
    if count <= most {
        return (0..count).collect();
    }
    (0..most).map(|k| k * (count - 1) / (most - 1)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sheet<'a>(header: &str, values: &'a [f32], side: usize) -> Sheet<'a> {
        let images = values.chunks_exact(side * side).collect();
        Sheet::new(header.to_owned(), (side, side), images, Unit::Readings)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]
        #[test]
        fn text_of_any_length_stays_inside_the_sheet(
            header in "[ -~µ×−\n]{0,90}|[a-zW@]{60,90}", count in 1usize..20, gain in -1e9f32..1e9,
        ) {
            let values: Vec<f32> = (0..count * 16)
                .map(|p| gain * (1.0 + (p / 16) as f32).powi(3) * ((p % 16) as f32))
                .collect();
            let look = FigureStyle::Column.look();
            let drawing = sheet(&header, &values, 4).draw(&look);
            prop_assert!(drawing.beyond(look.px(MARGIN)).is_none(), "{:?}", drawing.beyond(look.px(MARGIN)));
            prop_assert!(drawing.overlapping().is_none(), "{:?}", drawing.overlapping());
        }

        #[test]
        fn chosen_images_are_evenly_spread(count in 0usize..5000, most in 2usize..70) {
            let chosen = evenly(count, most);
            prop_assert_eq!(chosen.len(), count.min(most));
            prop_assert!(chosen.is_sorted_by(|a, b| a < b));
            if count > 0 {
                prop_assert_eq!((chosen[0], chosen[chosen.len() - 1]), (0, count - 1));
            }
            let gaps: Vec<usize> = chosen.windows(2).map(|pair| pair[1] - pair[0]).collect();
            let (least, most) = (gaps.iter().min(), gaps.iter().max());
            prop_assert!(least.zip(most).is_none_or(|(least, most)| most - least <= 1));
        }
    }

    #[test]
    fn a_sheet_shows_the_first_and_the_last_and_says_how_many() {
        let values = vec![0.5; 1000 * 16];
        let many = sheet("", &values, 4);
        let shown = many.shown();
        assert_eq!((shown.len(), shown[0], shown[63]), (64, 0, 999));
        assert_eq!(many.lines()[0], "64 of 1000 images shown, evenly chosen");
        let few = sheet("", &values[..99 * 16], 4);
        assert_eq!(few.lines()[0], "64 of 99 images shown, evenly chosen");
        assert_eq!(sheet("", &values[..64 * 16], 4).lines()[0], "all 64 images");
    }

    #[test]
    fn chosen_images_are_shown_under_their_numbers() {
        let (count, numbers) = (1000, chosen(1000));
        assert!(numbers.len() < 164 && numbers.contains(&999), "{}", numbers.len());
        let values: Vec<f32> = numbers.iter().flat_map(|&k| vec![k as f32; 16]).collect();
        let images = values.chunks_exact(16).collect();
        let at_hand = (numbers.clone(), images);
        let sheet = Sheet::of_chosen(String::new(), (4, 4), count, at_hand, Unit::Readings);
        assert!(numbers.iter().all(|&k| sheet.image(k) == [k as f32; 16]));
        assert!(
            sheet.shown().iter().chain(&evenly(count, MOST_BESIDE)).all(|k| numbers.contains(k))
        );
        let lines = sheet.lines();
        assert_eq!(lines[0], "64 of 1000 images shown, evenly chosen");
        assert!(lines[2].ends_with("of the chosen images together"), "{}", lines[2]);
    }

    #[test]
    fn images_have_one_scale_unless_some_would_be_black_on_it() {
        let ramp = |gain: f32| (0..16).map(move |p| gain * p as f32);
        let alike: Vec<f32> = ramp(1.0).chain(ramp(0.5)).collect();
        assert_eq!(sheet("", &alike, 4).scales().len(), 1);
        let unlike: Vec<f32> = ramp(1.0).chain(ramp(0.01)).collect();
        let own = sheet("", &unlike, 4);
        assert_eq!(own.scales().len(), 2);
        assert_eq!(own.label(1), "1: 0 to 0.15");
        assert!(own.lines()[0].contains("its own scale"));
    }

    #[test]
    fn pixels_of_tiles_are_square_and_warned_images_are_marked() {
        let values: Vec<f32> = (0..16).map(|p| p as f32).collect();
        let look = FigureStyle::Paper.look();
        let drawing = sheet("", &values, 4).with_warned(vec![0]).draw(&look);
        let tile = drawing.shapes.iter().find_map(|shape| match shape {
            Shape::Image { at, columns: 4, levels, smooth: false } => Some((*at, levels.clone())),
            _ => None,
        });
        let ([left, top, wide, high], levels) = tile.unwrap();
        assert!(wide == high && wide.is_multiple_of(4), "{wide} x {high}");
        assert_eq!((levels[0], levels[15]), (0, 255));
        let canvas = drawing.raster();
        let warned = look.palette.warning;
        assert_eq!(canvas.pixel(left - 1, top), Some(&warned));
        assert_ne!(warned, look.palette.frame);
    }

    #[test]
    fn a_sheet_of_large_images_shows_them_smaller() {
        let values = vec![0.5; 2 * 700 * 700];
        let drawing = sheet("", &values, 700).draw(&FigureStyle::Column.look());
        assert!(drawing.shapes.iter().any(|shape| {
            matches!(shape, Shape::Image { at, smooth: true, .. } if at[2] < 700)
        }));
    }
}

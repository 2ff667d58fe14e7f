//! A line chart, such as SNR against distance, or sharpness against bar width.
//!
//! # Invariant
//! Every point lies where its axes say (`tests::a_point_lies_where_its_axes_say`), clipped to the
//! frame (`tests::points_outside_the_frame_or_nowhere_are_left_out`). Every line is named in the
//! legend beside the frame, where it covers no line, and no two [`looks`](Line::look) are alike
//! (`tests::no_two_looks_are_alike`). Labels of ticks do not touch
//! (`tests::labels_that_would_touch_are_left_out`).

use super::text::{Block, Font, Style};
use super::ticks::{around, label};
use super::{BRIGHT, DIM, GRID, GROUND};
use image::{Rgb, RgbImage};

/// The frame of a chart: columns and rows.
const FRAME_PX: (u32, u32) = (950, 500);
const LEFT_PX: u32 = 110;
const MARGIN_PX: u32 = 24;
/// Room for a piece of the line before its name in the legend.
const LEGEND_LINE_PX: u32 = 50;
/// The widest name in a legend. A longer one has several lines.
const LEGEND_PX: u32 = 330;
/// A line of up to this many points shows each point.
const POINTS_MARKED: usize = 24;

/// Colours of the lines, chosen to differ for people who confuse red and green (Okabe and Ito, on a
/// dark ground).
const COLOURS: [Rgb<u8>; 8] = [
    Rgb([86, 180, 233]),
    Rgb([230, 159, 0]),
    Rgb([0, 158, 115]),
    Rgb([204, 121, 167]),
    Rgb([240, 228, 66]),
    Rgb([213, 94, 0]),
    Rgb([236, 238, 242]),
    Rgb([118, 130, 255]),
];

/// Lengths drawn and left out along a line, in turn; solid without any.
const DASHES_PX: [&[f64]; 4] = [&[], &[10.0, 7.0], &[2.5, 6.0], &[14.0, 5.0, 2.5, 5.0]];

/// One axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// The quantity with its unit.
    pub name: String,
    /// The value at its start.
    pub from: f64,
    /// The value at its end.
    pub to: f64,
    /// Whether the axis is logarithmic.
    pub logarithmic: bool,
    /// The labelled values.
    pub ticks: Vec<f64>,
}

impl Axis {
    /// A linear axis around all of these values, with a few ticks at 1, 2 or 5 times a power of
    /// ten. Values that are not finite have no part in it.
    #[must_use]
    pub fn around(name: &str, values: impl IntoIterator<Item = f64>) -> Self {
        let finite = values.into_iter().filter(|value| value.is_finite());
        let (low, high) = finite
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        let ticks = if low <= high { around(low, high, 6) } else { around(0.0, 1.0, 6) };
        Self::of(name, ticks, false)
    }

    /// A logarithmic axis of whole decades around all of these values, at most `most` decades from
    /// the largest value down. Values that are not positive have no part in it.
    #[must_use]
    pub fn decades(name: &str, values: impl IntoIterator<Item = f64>, most: i32) -> Self {
        let positive = values.into_iter().filter(|value| value.is_finite() && *value > 0.0);
        let (low, high) = positive
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        let (low, high) = if low <= high { (low, high) } else { (1.0, 10.0) };
        let end = high.log10().ceil() as i32;
        let start = (low.log10().floor() as i32).max(end - most).min(end - 1);
        Self::of(name, (start..=end).map(|power| 10_f64.powi(power)).collect(), true)
    }

    /// An axis from the first of these ticks to the last.
    ///
    /// # Panics
    /// If there are fewer than two ticks.
    #[must_use]
    pub fn of(name: &str, ticks: Vec<f64>, logarithmic: bool) -> Self {
        let &[from, .., to] = ticks.as_slice() else { panic!("an axis of two ticks at least") };
        Self { name: name.to_owned(), from, to, logarithmic, ticks }
    }

    /// The position of a value along the axis: 0 at `from`, 1 at `to`.
    fn at(&self, value: f64) -> f64 {
        if self.logarithmic {
            (value / self.from).ln() / (self.to / self.from).ln()
        } else {
            (value - self.from) / (self.to - self.from)
        }
    }
}

/// One line of a chart.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// The name in the legend.
    pub name: String,
    /// Which of the eight colours. Beyond them the colours come again with dots.
    pub colour: usize,
    /// Whether the line is dashed.
    pub dashed: bool,
    /// Points as x and y.
    pub points: Vec<(f64, f64)>,
}

impl Line {
    /// Colour and dashes as indices: equal for two lines that look alike.
    #[must_use]
    pub fn look(&self) -> (usize, usize) {
        let again = self.colour / COLOURS.len() % 2;
        (self.colour % COLOURS.len(), 2 * again + usize::from(self.dashed))
    }

    fn colour(&self) -> Rgb<u8> {
        COLOURS[self.look().0]
    }

    fn dashes(&self) -> &'static [f64] {
        DASHES_PX[self.look().1]
    }
}

/// A chart.
#[derive(Debug, Clone, PartialEq)]
pub struct Chart {
    /// The title above the chart.
    pub header: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// The lines in the order of the legend.
    pub lines: Vec<Line>,
    /// The text below the chart: the source.
    pub footer: String,
}

const TITLE: fn() -> Style =
    || Style { font: Font::sans(), size_px: 28.0, line_px: 34, colour: BRIGHT };
const SMALL: fn() -> Style =
    || Style { font: Font::sans(), size_px: 18.0, line_px: 22, colour: DIM };

/// Where everything of a chart is, in pixels.
struct Laid {
    header: Block,
    y_name: Block,
    x_name: Block,
    footer: Block,
    names: Vec<Block>,
    /// The frame: left and right, top and bottom.
    x_px: (f64, f64),
    y_px: (f64, f64),
    size: (u32, u32),
}

impl Chart {
    /// Draws the chart; [`signed_png`](super::signed_png) makes a PNG of it.
    #[must_use]
    pub fn render(&self) -> RgbImage {
        self.render_at(FRAME_PX)
    }

    /// As [`render`](Self::render), with a frame of so many columns and rows.
    #[must_use]
    pub fn render_at(&self, frame_px: (u32, u32)) -> RgbImage {
        let laid = self.lay(frame_px);
        let mut canvas = RgbImage::from_pixel(laid.size.0, laid.size.1, GROUND);
        let ((left, right), (top, bottom)) = (laid.x_px, laid.y_px);
        let x_px = |x: f64| left + self.x.at(x) * (right - left);
        let y_px = |y: f64| bottom - self.y.at(y) * (bottom - top);

        laid.header.draw(&mut canvas, LEFT_PX, MARGIN_PX);
        laid.y_name.draw(&mut canvas, LEFT_PX, top as u32 - laid.y_name.height() - 8);
        let small = SMALL();
        let mut free_from = 0.0;
        for &tick in &self.x.ticks {
            stroke(&mut canvas, (x_px(tick), top), (x_px(tick), bottom), GRID, 1.0);
            let text = label(tick);
            let wide = small.width(&text);
            let at = x_px(tick) as f32 - wide / 2.0;
            if at >= free_from {
                small.draw(&mut canvas, &text, at, bottom as f32 + 6.0);
                free_from = at + wide + 8.0;
            }
        }
        let mut free_to = f64::INFINITY;
        for &tick in &self.y.ticks {
            stroke(&mut canvas, (left, y_px(tick)), (right, y_px(tick)), GRID, 1.0);
            let text = label(tick);
            if y_px(tick) <= free_to {
                let at = LEFT_PX as f32 - small.width(&text) - 10.0;
                small.draw(&mut canvas, &text, at.max(0.0), y_px(tick) as f32 - 11.0);
                free_to = y_px(tick) - 20.0;
            }
        }
        let x_left = right - f64::from(laid.x_name.width());
        laid.x_name.draw(&mut canvas, x_left as u32, bottom as u32 + 32);
        let footer_top = laid.size.1 - MARGIN_PX - laid.footer.height();
        laid.footer.draw(&mut canvas, LEFT_PX, footer_top);

        for line in &self.lines {
            self.draw(&mut canvas, line, x_px, y_px);
        }
        self.legend(&mut canvas, &laid);
        canvas
    }

    fn lay(&self, (wide, high): (u32, u32)) -> Laid {
        let names: Vec<Block> = self
            .lines
            .iter()
            .map(|line| Block::new(SMALL, [line.name.as_str()], LEGEND_PX))
            .collect();
        let widest = names.iter().map(Block::width).fold(0.0, f32::max).ceil() as u32;
        let legend_px = if names.is_empty() { 0 } else { LEGEND_LINE_PX + widest + MARGIN_PX };
        let header = Block::new(TITLE, [self.header.as_str()], wide + legend_px);
        let footer = Block::new(SMALL, [self.footer.as_str()], wide + legend_px);
        let y_name = Block::new(SMALL, [self.y.name.as_str()], wide);
        let x_name = Block::new(SMALL, [self.x.name.as_str()], wide);
        let top = MARGIN_PX + header.height() + 8 + y_name.height() + 8;
        let legend_bottom = top + 10 + names.iter().map(|name| name.height() + 2).sum::<u32>();
        let below = (top + high + 32 + x_name.height()).max(legend_bottom);
        let height = below + footer.height() + 16 + MARGIN_PX;
        Laid {
            x_px: (f64::from(LEFT_PX), f64::from(LEFT_PX + wide)),
            y_px: (f64::from(top), f64::from(top + high)),
            size: (LEFT_PX + wide + MARGIN_PX + legend_px, height),
            header,
            y_name,
            x_name,
            footer,
            names,
        }
    }

    fn draw(
        &self,
        canvas: &mut RgbImage,
        line: &Line,
        x_px: impl Fn(f64) -> f64,
        y_px: impl Fn(f64) -> f64,
    ) {
        let colour = line.colour();
        let inside = |at: f64| (0.0..=1.0).contains(&at);
        let seen = |&(x, y): &(f64, f64)| inside(self.x.at(x)) && inside(self.y.at(y));
        // Dashes continue from one piece to the next.
        let mut along = 0.0;
        for pair in line.points.windows(2) {
            if pair.iter().all(seen) {
                let [from, to] = [pair[0], pair[1]].map(|(x, y)| (x_px(x), y_px(y)));
                along = dashes(canvas, (from, to), colour, line.dashes(), along);
            }
        }
        if line.points.len() <= POINTS_MARKED {
            for &(x, y) in line.points.iter().filter(|point| seen(point)) {
                let at = (x_px(x), y_px(y));
                stroke(canvas, at, at, colour, 8.0);
            }
        }
    }

    /// Draws the legend right of the frame.
    fn legend(&self, canvas: &mut RgbImage, laid: &Laid) {
        let left = laid.x_px.1 + f64::from(MARGIN_PX);
        let mut top = laid.y_px.0 + 10.0;
        for (line, name) in self.lines.iter().zip(&laid.names) {
            let ends = ((left, top + 11.0), (left + 38.0, top + 11.0));
            dashes(canvas, ends, line.colour(), line.dashes(), 0.0);
            name.draw(canvas, left as u32 + LEGEND_LINE_PX, top as u32);
            top += f64::from(name.height() + 2);
        }
    }
}

/// Draws a line with this pattern of dashes; solid without any. `along` is the position in the
/// pattern at the start; the result is the position at the end.
fn dashes(
    canvas: &mut RgbImage,
    (from, to): ((f64, f64), (f64, f64)),
    colour: Rgb<u8>,
    pattern: &[f64],
    along: f64,
) -> f64 {
    const WIDTH_PX: f64 = 2.5;
    if pattern.is_empty() {
        stroke(canvas, from, to, colour, WIDTH_PX);
        return 0.0;
    }
    let length = (to.0 - from.0).hypot(to.1 - from.1);
    let at = |px: f64| {
        let part = px.clamp(0.0, length) / length;
        (from.0 + part * (to.0 - from.0), from.1 + part * (to.1 - from.1))
    };
    let period: f64 = pattern.iter().sum();
    let mut start = -along;
    while start < length && length > 0.0 {
        let mut dash = start;
        for pair in pattern.chunks(2) {
            if dash + pair[0] > 0.0 && dash < length {
                stroke(canvas, at(dash), at(dash + pair[0]), colour, WIDTH_PX);
            }
            dash += pair.iter().sum::<f64>();
        }
        start += period;
    }
    (along + length) % period
}

/// Draws a straight line of some width. Parts outside the canvas are cut.
fn stroke(canvas: &mut RgbImage, from: (f64, f64), to: (f64, f64), colour: Rgb<u8>, width_px: f64) {
    let length = (to.0 - from.0).hypot(to.1 - from.1);
    if !length.is_finite() || length > 1e5 {
        return;
    }
    let half = width_px / 2.0;
    let (x0, x1) = (from.0.min(to.0) - half - 1.0, from.0.max(to.0) + half + 1.0);
    let (y0, y1) = (from.1.min(to.1) - half - 1.0, from.1.max(to.1) + half + 1.0);
    let bounded = |v: f64, limit: u32| v.clamp(0.0, f64::from(limit)) as u32;
    for y in bounded(y0, canvas.height())..bounded(y1.ceil(), canvas.height()) {
        for x in bounded(x0, canvas.width())..bounded(x1.ceil(), canvas.width()) {
            let (px, py) = (f64::from(x) + 0.5 - from.0, f64::from(y) + 0.5 - from.1);
            let (dx, dy) = (to.0 - from.0, to.1 - from.1);
            let along = if length > 0.0 {
                ((px * dx + py * dy) / (length * length)).clamp(0.0, 1.0)
            } else {
                0.0
            };
            let off = (px - along * dx).hypot(py - along * dy);
            let cover = (half + 0.5 - off).clamp(0.0, 1.0);
            if cover > 0.0 {
                let pixel = canvas.get_pixel_mut(x, y);
                for (ground, ink) in pixel.0.iter_mut().zip(colour.0) {
                    let mixed = f64::from(*ground) + (f64::from(ink) - f64::from(*ground)) * cover;
                    *ground = mixed.round() as u8;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn chart(points: Vec<(f64, f64)>) -> Chart {
        let axis = |logarithmic| Axis {
            name: "m".to_owned(),
            from: 0.1,
            to: 10.0,
            logarithmic,
            ticks: vec![0.1, 1.0, 10.0],
        };
        let line = Line { name: "line".to_owned(), colour: 0, dashed: false, points };
        Chart {
            header: "h".to_owned(),
            x: axis(true),
            y: axis(false),
            lines: vec![line],
            footer: "f".to_owned(),
        }
    }

    /// The middle of the frame.
    fn middle(chart: &Chart) -> (u32, u32) {
        let laid = chart.lay(FRAME_PX);
        let middle = |(from, to): (f64, f64)| ((from + to) / 2.0) as u32;
        (middle(laid.x_px), middle(laid.y_px))
    }

    #[test]
    fn a_point_lies_where_its_axes_say() {
        // A short line at x = 1, the middle of a logarithmic axis of 0.1 to 10, and y = 5.05, the
        // middle of a linear one.
        let chart = chart(vec![(0.99, 5.05), (1.01, 5.05)]);
        let (x, y) = middle(&chart);
        assert_eq!(*chart.render().get_pixel(x, y), COLOURS[0]);
    }

    #[test]
    fn no_two_looks_are_alike() {
        let look = |k: usize| {
            let (name, points) = (String::new(), Vec::new());
            Line { name, colour: k / 2, dashed: k % 2 == 1, points }.look()
        };
        let looks: std::collections::BTreeSet<_> = (0..32).map(look).collect();
        assert_eq!(looks.len(), 32);
        let distance = |a: Rgb<u8>, b: Rgb<u8>| {
            let square = |(a, b): (u8, u8)| (f64::from(a) - f64::from(b)).powi(2);
            a.0.into_iter().zip(b.0).map(square).sum::<f64>().sqrt()
        };
        for (k, a) in COLOURS.iter().enumerate() {
            assert!(distance(*a, GROUND) > 150.0, "{a:?} on the ground");
            assert!(COLOURS[..k].iter().all(|b| distance(*a, *b) > 60.0), "{a:?}");
        }
    }

    #[test]
    fn labels_that_would_touch_are_left_out() {
        let mut crowded = chart(vec![]);
        crowded.lines.clear();
        crowded.x = Axis::of("x", (0..=200).map(f64::from).collect(), false);
        crowded.y = Axis::of("y", (0..=200).map(f64::from).collect(), false);
        let canvas = crowded.render();
        let laid = crowded.lay(FRAME_PX);
        let blank = |x: u32, y: u32| *canvas.get_pixel(x, y) == GROUND;
        // Between labels there are blank columns below the frame, and blank rows beside it.
        let below = laid.y_px.1 as u32 + 6..laid.y_px.1 as u32 + 28;
        let columns =
            (LEFT_PX..laid.x_px.1 as u32).filter(|&x| below.clone().all(|y| blank(x, y))).count();
        assert!(columns > 200, "{columns}");
        let beside = LEFT_PX - 60..LEFT_PX - 8;
        let rows = (laid.y_px.0 as u32..laid.y_px.1 as u32)
            .filter(|&y| beside.clone().all(|x| blank(x, y)))
            .count();
        assert!(rows > 100, "{rows}");
    }

    #[test]
    fn an_axis_holds_its_values_between_round_ticks() {
        for (values, ticks) in [
            (vec![17.2, 31.4], vec![15.0, 20.0, 25.0, 30.0, 35.0]),
            (vec![0.46, 0.99], vec![0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0]),
            (vec![3.0], vec![3.0, 3.001]),
            (vec![f64::NAN], vec![0.0, 0.2, 0.4, 0.6, 0.8, 1.0]),
        ] {
            let axis = Axis::around("", values);
            assert_eq!(axis.ticks.len(), ticks.len(), "{:?}", axis.ticks);
            assert!(axis.ticks.iter().zip(&ticks).all(|(a, b)| (a - b).abs() < 1e-9));
        }
        assert_eq!(Axis::decades("", [0.02, 3.0, -1.0], 9).ticks, [0.01, 0.1, 1.0, 10.0]);
        assert_eq!(Axis::decades("", [1e-30, 3.0], 2).ticks, [0.1, 1.0, 10.0]);
        assert_eq!(Axis::decades("", [], 2).ticks, [1.0, 10.0]);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]
        #[test]
        fn text_of_any_length_stays_inside_the_chart(
            texts in prop::collection::vec("[ -~µ×−\n]{0,200}|[a-zW@]{60,160}", 4..16),
        ) {
            let mut chart = chart(vec![]);
            chart.header = texts[0].clone();
            chart.footer = texts[1].clone();
            chart.x.name = texts[2].clone();
            chart.y.name = texts[3].clone();
            chart.lines = texts[3..]
                .iter()
                .enumerate()
                .map(|(colour, name)| {
                    Line { name: name.clone(), colour, dashed: false, points: vec![] }
                })
                .collect();
            let canvas = chart.render_at((420, 200));
            let (width, height) = canvas.dimensions();
            let lean = 3;
            for (x, y, pixel) in canvas.enumerate_pixels() {
                let edge = MARGIN_PX - lean;
                let inside =
                    (edge..width - edge).contains(&x) && (edge..height - edge).contains(&y);
                prop_assert!(inside || *pixel == GROUND, "{} {} of {} x {}", x, y, width, height);
            }
        }
    }

    #[test]
    fn a_dashed_line_is_drawn_in_part_whatever_its_points() {
        let across: Vec<(f64, f64)> =
            (0..=200).map(|i| (0.1 * 10_f64.powf(f64::from(i) / 100.0), 5.05)).collect();
        let drawn = |dashed, points: &[(f64, f64)]| {
            let mut chart = chart(points.to_vec());
            chart.lines[0].dashed = dashed;
            let (canvas, (_, y)) = (chart.render(), middle(&chart));
            let right = chart.lay(FRAME_PX).x_px.1 as u32;
            (LEFT_PX..right).filter(|&x| *canvas.get_pixel(x, y) == COLOURS[0]).count()
        };
        let whole = drawn(false, &across);
        for points in [across.clone(), vec![across[0], across[200]]] {
            let part = drawn(true, &points) as f64 / whole as f64;
            assert!((0.5..0.75).contains(&part), "{part} of the line");
        }
    }

    #[test]
    fn points_outside_the_frame_or_nowhere_are_left_out() {
        let nothing = chart(vec![]).render();
        for points in [
            vec![(100.0, 5.0), (200.0, 5.0)],
            vec![(1.0, f64::NAN), (1.1, f64::INFINITY)],
            vec![(-1.0, 5.0), (1.0, 50.0)],
        ] {
            assert_eq!(chart(points).render(), nothing);
        }
    }
}

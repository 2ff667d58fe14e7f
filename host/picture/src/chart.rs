//! A line chart, such as SNR against distance, or sharpness against bar width.
//!
//! # Invariant
//! Every point lies where its axes say (`tests::a_point_lies_where_its_axes_say`), clipped to the
//! frame (`tests::points_outside_the_frame_or_nowhere_are_left_out`). Every line is named in the
//! legend below the frame, where it covers no line, and no two [`looks`](Line::look) are alike
//! (`tests::no_two_looks_are_alike`). Labels of ticks do not touch
//! (`tests::labels_that_would_touch_are_left_out`).

use super::bar::draw_ticks;
use super::drawing::{Drawing, Shape};
use super::look::{CURVE_COLOURS, Colour, Look};
use super::signature::MARGIN;
use super::text::{Block, Style};
use super::ticks::{around, label};

/// A line of up to this many points shows each point.
const POINTS_MARKED: usize = 24;
/// Room for a piece of the line before its name in the legend, in sixteenths of the text's size.
const LEGEND_LINE: u32 = 44;

/// Lengths drawn and left out along a line, in turn, in sixteenths of the text's size; solid without
/// any.
pub(super) const DASHES: [&[u32]; 4] = [&[], &[9, 6], &[16, 5, 3, 5], &[2, 5]];

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
    /// Which of ten looks: five colours, then the same with other dashes, each with its own shape of
    /// points.
    pub colour: usize,
    /// Whether the line is dashed.
    pub dashed: bool,
    /// Points as x and y.
    pub points: Vec<(f64, f64)>,
}

impl Line {
    /// Number of lines without `dashed` that differ in colour or dashes.
    pub const LOOKS: usize = 2 * CURVE_COLOURS;

    /// Colour and dashes as indices: equal for two lines that look alike.
    #[must_use]
    pub fn look(&self) -> (usize, usize) {
        let again = self.colour / CURVE_COLOURS % 2;
        (self.colour % CURVE_COLOURS, 2 * again + usize::from(self.dashed))
    }

    fn colour(&self, look: &Look) -> Colour {
        look.palette.curves[self.look().0]
    }

    fn dashes(&self, look: &Look) -> Vec<f64> {
        DASHES[self.look().1].iter().map(|&length| f64::from(look.px(length))).collect()
    }
}

/// The shape of a line's points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Point(usize);

impl Point {
    pub(super) fn of(line: &Line) -> Self {
        Self(line.colour % Line::LOOKS)
    }

    /// The corners of a point of about this radius.
    fn corners(self, (x, y): (f64, f64), radius: f64) -> Vec<(f64, f64)> {
        // Angle of the first corner in degrees, clockwise from the right; the distances of corners in turn.
        let (count, first, distances): (u32, f64, &[f64]) = match self.0 {
            0 => (16, 0.0, &[1.0]),
            1 => (4, 45.0, &[1.2]),
            2 => (3, -90.0, &[1.35]),
            3 => (4, 0.0, &[1.3]),
            4 => (3, 90.0, &[1.35]),
            5 => (10, -90.0, &[1.5, 0.6]),
            6 => (3, 0.0, &[1.35]),
            7 => (8, 45.0, &[1.5, 0.45]),
            8 => (8, 0.0, &[1.5, 0.45]),
            _ => (3, 180.0, &[1.35]),
        };
        let corner = |k: u32| {
            let angle = (first + 360.0 * f64::from(k) / f64::from(count)).to_radians();
            let far = radius * distances[k as usize % distances.len()];
            (x + far * angle.cos(), y + far * angle.sin())
        };
        (0..count).map(corner).collect()
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

/// What of a chart stands below its frame; neighbours may say the same.
#[derive(Debug, Clone, Copy)]
pub(super) struct Below {
    pub(super) legend: bool,
    pub(super) footer: bool,
}

/// Where everything of a chart is, in pixels.
struct Laid {
    header: Block,
    y_name: Block,
    x_name: Block,
    /// The frame: left and right, top and bottom.
    x_px: (f64, f64),
    y_px: (f64, f64),
    size: (u32, u32),
}

impl Chart {
    /// The names of the lines and their looks: what the legend says.
    pub(super) fn legend_of(&self) -> Vec<(&str, (usize, usize))> {
        self.lines.iter().map(|line| (line.name.as_str(), line.look())).collect()
    }

    /// Draws the chart in this width.
    pub(super) fn draw(&self, look: &Look, width: u32, below: Below) -> Drawing {
        let legend = below.legend.then(|| self.legend(look, width));
        let legend_px = legend.as_ref().map_or(0, |legend| legend.size().1);
        let source = below.footer.then(|| self.source(look, width));
        let source_px = source.as_ref().map_or(0, |source| source.size().1);
        let laid = self.lay(look, width, legend_px + source_px);
        let margin = look.px(MARGIN);
        let mut canvas = Drawing::new(look, laid.size.0, laid.size.1);
        let ((left, right), (top, bottom)) = (laid.x_px, laid.y_px);
        let x_px = |x: f64| left + self.x.at(x) * (right - left);
        let y_px = |y: f64| bottom - self.y.at(y) * (bottom - top);
        let plain = Style::plain(look);
        let thin = f64::from(look.px(1));

        laid.header.draw(&mut canvas, margin, margin);
        laid.y_name.draw(&mut canvas, margin, top as u32 - laid.y_name.height() - look.px(10));
        for &tick in &self.x.ticks {
            let ends = [(x_px(tick), top), (x_px(tick), bottom)];
            canvas.line(ends, thin, look.palette.grid);
        }
        let mut free_to = f64::INFINITY;
        for &tick in &self.y.ticks {
            let ends = [(left, y_px(tick)), (right, y_px(tick))];
            canvas.line(ends, thin, look.palette.grid);
            let text = label(tick);
            if y_px(tick) <= free_to {
                let at = left as f32 - plain.width(&text) - look.px(6) as f32;
                let high = plain.line_px as f32;
                plain.draw(&mut canvas, &text, at, y_px(tick) as f32 - high / 2.0);
                free_to = y_px(tick) - f64::from(high);
            }
        }
        for ends in [[(left, top), (left, bottom)], [(left, bottom), (right, bottom)]] {
            canvas.line(ends, thin, look.palette.frame);
        }
        let ticks: Vec<(f64, String)> =
            self.x.ticks.iter().map(|&tick| (x_px(tick), label(tick))).collect();
        draw_ticks(&mut canvas, look, &ticks, bottom as u32, (margin, width - margin));
        for line in &self.lines {
            self.draw_line(&mut canvas, look, line, x_px, y_px);
        }
        let x_left = right - f64::from(laid.x_name.width());
        let name_top = bottom as u32 + look.px(6) + plain.line_px;
        laid.x_name.draw(&mut canvas, (x_left as u32).max(margin), name_top);
        let legend_top = name_top + laid.x_name.height_and(look.px(8));
        if let Some(legend) = legend {
            canvas.place(legend, 0, legend_top);
        }
        if let Some(source) = source {
            canvas.place(source, 0, legend_top + legend_px);
        }
        canvas
    }

    fn lay(&self, look: &Look, width: u32, below_px: u32) -> Laid {
        let margin = look.px(MARGIN);
        let inner = width - 2 * margin;
        let plain = Style::plain(look);
        let widest = self.y.ticks.iter().map(|&tick| plain.width(&label(tick))).fold(0.0, f32::max);
        let left = margin + widest.ceil() as u32 + look.px(6);
        // The last tick's label extends beyond the frame.
        let right = width - margin - look.px(8);
        let header = Block::new(Style::title(look), [self.header.as_str()], inner);
        let y_name = Block::new(plain, [self.y.name.as_str()], inner);
        let x_name = Block::new(plain, [self.x.name.as_str()], right - left);
        let top = margin + header.height_and(look.px(6)) + y_name.height() + look.px(10);
        // Wide charts are flatter.
        let high = look.px(160) + (right - left) * 28 / 100;
        let bottom = top + high;
        let names = look.px(6) + plain.line_px + x_name.height_and(look.px(8));
        let height = bottom + names + below_px + look.px(4);
        Laid {
            x_px: (f64::from(left), f64::from(right)),
            y_px: (f64::from(top), f64::from(bottom)),
            size: (width, height),
            header,
            y_name,
            x_name,
        }
    }

    fn draw_line(
        &self,
        canvas: &mut Drawing,
        look: &Look,
        line: &Line,
        x_px: impl Fn(f64) -> f64,
        y_px: impl Fn(f64) -> f64,
    ) {
        let inside = |at: f64| (0.0..=1.0).contains(&at);
        let seen = |&(x, y): &(f64, f64)| inside(self.x.at(x)) && inside(self.y.at(y));
        for piece in line.points.split(|point| !seen(point)).filter(|piece| piece.len() > 1) {
            let points = piece.iter().map(|&(x, y)| (x_px(x), y_px(y))).collect();
            canvas.shapes.push(curve(look, line, points));
        }
        if line.points.len() <= POINTS_MARKED {
            for &(x, y) in line.points.iter().filter(|point| seen(point)) {
                canvas.shapes.push(mark(look, line, (x_px(x), y_px(y))));
            }
        }
    }

    /// The text below the chart.
    pub(super) fn source(&self, look: &Look, width: u32) -> Drawing {
        let margin = look.px(MARGIN);
        let text = Block::new(Style::faint(look), [self.footer.as_str()], width - 2 * margin);
        let mut canvas = Drawing::new(look, width, text.height_and(look.px(6)));
        text.draw(&mut canvas, margin, 0);
        canvas
    }

    /// The legend: columns of lines and their names.
    pub(super) fn legend(&self, look: &Look, width: u32) -> Drawing {
        let (margin, before, gap) = (look.px(MARGIN), look.px(LEGEND_LINE), look.px(16));
        let inner = width - 2 * margin;
        let plain = Style::plain(look);
        let names: Vec<Block> = self
            .lines
            .iter()
            .map(|line| Block::new(plain, [line.name.as_str()], inner - before))
            .collect();
        let widest = names.iter().map(Block::width).fold(0.0, f32::max).ceil() as u32;
        let column = before + widest + gap;
        let columns = ((inner + gap) / column).max(1) as usize;
        let rows = names.len().div_ceil(columns).max(1);
        let high = |row: usize| {
            let of_row = names.iter().enumerate().filter(|(k, _)| k % rows == row);
            of_row.map(|(_, name)| name.height()).max().unwrap_or(0)
        };
        let tops: Vec<u32> = (0..rows)
            .scan(0, |top, row| {
                let at = *top;
                *top += high(row);
                Some(at)
            })
            .collect();
        let height = (0..rows).map(high).sum::<u32>();
        let below = if names.is_empty() { 0 } else { look.px(6) };
        let mut canvas = Drawing::new(look, width, height + below);
        for (k, (line, name)) in self.lines.iter().zip(&names).enumerate() {
            // Down each column in turn.
            let left = margin + (k / rows) as u32 * column;
            let top = tops[k % rows];
            let middle = f64::from(top + plain.line_px / 2);
            let ends = [f64::from(left), f64::from(left + before - look.px(8))];
            canvas.shapes.push(curve(look, line, ends.map(|x| (x, middle)).to_vec()));
            if line.points.len() <= POINTS_MARKED {
                canvas.shapes.push(mark(look, line, ((ends[0] + ends[1]) / 2.0, middle)));
            }
            name.draw(&mut canvas, left + before, top);
        }
        canvas
    }
}

/// A line through these places.
fn curve(look: &Look, line: &Line, points: Vec<(f64, f64)>) -> Shape {
    let (dashes, colour) = (line.dashes(look), line.colour(look));
    Shape::Line { points, width: look.em() / 9.0, dashes, colour }
}

/// A point of a line.
fn mark(look: &Look, line: &Line, at: (f64, f64)) -> Shape {
    let corners = Point::of(line).corners(at, look.em() / 4.5);
    Shape::Area { corners, colour: line.colour(look) }
}

#[cfg(test)]
mod tests {
    use super::super::look::FigureStyle;
    use super::*;
    use proptest::prelude::*;

    const WHOLE: Below = Below { legend: true, footer: true };

    fn look() -> Look {
        FigureStyle::Column.look()
    }

    fn drawn(chart: &Chart) -> Drawing {
        chart.draw(&look(), look().width(), WHOLE)
    }

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

    /// The curves of a drawing: lines in the colour of the first curve, without that of the legend.
    fn curves(drawing: &Drawing) -> Vec<Vec<(f64, f64)>> {
        let colour = look().palette.curves[0];
        let mut found: Vec<_> = drawing
            .shapes
            .iter()
            .filter_map(|shape| match shape {
                Shape::Line { points, colour: of, .. } if *of == colour => Some(points.clone()),
                _ => None,
            })
            .collect();
        found.pop();
        found
    }

    #[test]
    fn a_point_lies_where_its_axes_say() {
        // From x = 1, the middle of a logarithmic axis of 0.1 to 10, and y = 5.05, the middle of a linear one.
        let chart = chart(vec![(1.0, 5.05), (10.0, 10.0)]);
        let laid = chart.lay(&look(), look().width(), 0);
        let ((left, right), (top, bottom)) = (laid.x_px, laid.y_px);
        let found = curves(&drawn(&chart));
        assert_eq!(found.len(), 1);
        let expected = [((left + right) / 2.0, (top + bottom) / 2.0), (right, top)];
        for (found, expected) in found[0].iter().zip(expected) {
            assert!((found.0 - expected.0).abs() < 1e-6 && (found.1 - expected.1).abs() < 1e-6);
        }
    }

    #[test]
    fn no_two_looks_are_alike() {
        let look = |k: usize| {
            let (name, points) = (String::new(), Vec::new());
            Line { name, colour: k / 2, dashed: k % 2 == 1, points }.look()
        };
        let looks: std::collections::BTreeSet<_> = (0..2 * Line::LOOKS).map(look).collect();
        assert_eq!(looks.len(), 2 * Line::LOOKS);
    }

    #[test]
    fn labels_that_would_touch_are_left_out() {
        let mut crowded = chart(vec![]);
        crowded.lines.clear();
        crowded.x = Axis::of("x", (0..=200).map(f64::from).collect(), false);
        crowded.y = Axis::of("y", (0..=200).map(f64::from).collect(), false);
        let drawing = drawn(&crowded);
        let mut places: Vec<(f64, f64, f64)> = Vec::new();
        for shape in &drawing.shapes {
            if let Shape::Text { x, baseline, size, text, .. } = shape {
                let wide = f64::from(super::super::text::width(text, *size));
                places.push((*x, x + wide, *baseline));
            }
        }
        assert!(places.len() > 20, "{places:?}");
        for (k, a) in places.iter().enumerate() {
            for b in &places[..k] {
                let line = f64::from(Style::plain(&look()).line_px);
                let apart = a.1 < b.0 || b.1 < a.0 || (a.2 - b.2).abs() >= 0.9 * line;
                assert!(apart, "{a:?} {b:?}");
            }
        }
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
        #![proptest_config(ProptestConfig::with_cases(24))]
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
            let drawing = drawn(&chart);
            prop_assert!(drawing.beyond(look().px(MARGIN)).is_none(), "{:?}", drawing.beyond(look().px(MARGIN)));
            prop_assert!(drawing.overlapping().is_none(), "{:?}", drawing.overlapping());
        }
    }

    #[test]
    fn points_outside_the_frame_or_nowhere_are_left_out() {
        for points in [
            vec![(100.0, 5.0), (200.0, 5.0)],
            vec![(1.0, f64::NAN), (1.1, f64::INFINITY)],
            vec![(-1.0, 5.0), (1.0, 50.0)],
        ] {
            let drawing = drawn(&chart(points));
            assert!(curves(&drawing).is_empty());
            let areas = drawing.shapes.iter().filter(|s| matches!(s, Shape::Area { .. })).count();
            assert_eq!(areas, 1, "the legend's alone");
        }
    }
}

//! A line chart, such as SNR against distance, or sharpness against bar width.
//!
//! # Invariant
//! Every point lies where its axes say (`tests::a_point_lies_where_its_axes_say`), clipped to the
//! frame (`tests::points_outside_the_frame_or_nowhere_are_left_out`). Every line is named in the
//! legend. A legend of many lines is beside the frame, where it covers no line
//! (`tests::many_lines_have_their_legend_beside_the_frame`).

use super::text::{Font, Style};
use image::{Rgb, RgbImage};

const WIDTH_PX: u32 = 1100;
const HEIGHT_PX: u32 = 720;
const LEFT_PX: u32 = 110;
const RIGHT_PX: u32 = 40;
const TOP_PX: u32 = 90;
const BOTTOM_PX: u32 = 130;
/// With more lines than this, the legend is beside the frame.
const LINES_INSIDE: usize = 6;
/// A line of up to this many points shows each point.
const POINTS_MARKED: usize = 24;
/// Room for a piece of the line before its name in the legend.
const LEGEND_LINE_PX: u32 = 50;
/// Lengths drawn and left out along a dashed line.
const DASH_PX: [f64; 2] = [10.0, 7.0];

const GROUND: Rgb<u8> = Rgb([19, 21, 26]);
const GRID: Rgb<u8> = Rgb([44, 48, 57]);
const BRIGHT: Rgb<u8> = Rgb([236, 238, 242]);
const DIM: Rgb<u8> = Rgb([146, 152, 164]);

/// Colours of the lines, chosen to differ for people who confuse red and green (Okabe and Ito).
const COLOURS: [Rgb<u8>; 6] = [
    Rgb([86, 180, 233]),
    Rgb([230, 159, 0]),
    Rgb([0, 158, 115]),
    Rgb([204, 121, 167]),
    Rgb([240, 228, 66]),
    Rgb([213, 94, 0]),
];

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
    /// Which of the six colours.
    pub colour: usize,
    /// Whether the line is dashed.
    pub dashed: bool,
    /// Points as x and y.
    pub points: Vec<(f64, f64)>,
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
    /// The line of text below the chart: the source.
    pub footer: String,
}

impl Chart {
    /// Draws the chart; [`encode_rgb`](crate::files::image::encode_rgb) makes a PNG of it.
    #[must_use]
    pub fn render(&self) -> RgbImage {
        let style =
            |size_px, line_px, colour| Style { font: Font::sans(), size_px, line_px, colour };
        let (title, small) = (style(28.0, 34, BRIGHT), style(18.0, 22, DIM));
        let legend_px = if self.lines.len() > LINES_INSIDE {
            self.widest(&small) as u32 + LEGEND_LINE_PX + RIGHT_PX
        } else {
            0
        };
        let mut canvas = RgbImage::from_pixel(WIDTH_PX + legend_px, HEIGHT_PX, GROUND);
        let (width, height) =
            (f64::from(WIDTH_PX - LEFT_PX - RIGHT_PX), f64::from(HEIGHT_PX - TOP_PX - BOTTOM_PX));
        let x_px = |x: f64| f64::from(LEFT_PX) + self.x.at(x) * width;
        let y_px = |y: f64| f64::from(TOP_PX) + (1.0 - self.y.at(y)) * height;

        title.draw(&mut canvas, &self.header, LEFT_PX as f32, 18.0);
        small.draw(&mut canvas, &self.y.name, LEFT_PX as f32, 60.0);
        let (bottom, right) = (f64::from(HEIGHT_PX - BOTTOM_PX), f64::from(WIDTH_PX - RIGHT_PX));
        for &tick in &self.x.ticks {
            stroke(&mut canvas, (x_px(tick), f64::from(TOP_PX)), (x_px(tick), bottom), GRID, 1.0);
            let text = label(tick);
            let left = x_px(tick) as f32 - small.width(&text) / 2.0;
            small.draw(&mut canvas, &text, left, bottom as f32 + 6.0);
        }
        for &tick in &self.y.ticks {
            stroke(&mut canvas, (f64::from(LEFT_PX), y_px(tick)), (right, y_px(tick)), GRID, 1.0);
            let text = label(tick);
            let left = LEFT_PX as f32 - small.width(&text) - 10.0;
            small.draw(&mut canvas, &text, left, y_px(tick) as f32 - 11.0);
        }
        let name_left = right as f32 - small.width(&self.x.name);
        small.draw(&mut canvas, &self.x.name, name_left, bottom as f32 + 32.0);
        small.draw(&mut canvas, &self.footer, LEFT_PX as f32, HEIGHT_PX as f32 - 40.0);

        for line in &self.lines {
            self.draw(&mut canvas, line, x_px, y_px);
        }
        self.legend(&mut canvas, &small, right + f64::from(legend_px));
        canvas
    }

    fn draw(
        &self,
        canvas: &mut RgbImage,
        line: &Line,
        x_px: impl Fn(f64) -> f64,
        y_px: impl Fn(f64) -> f64,
    ) {
        let colour = COLOURS[line.colour % COLOURS.len()];
        let inside = |at: f64| (0.0..=1.0).contains(&at);
        let seen = |&(x, y): &(f64, f64)| inside(self.x.at(x)) && inside(self.y.at(y));
        // Dashes continue from one piece to the next.
        let mut along = 0.0;
        for pair in line.points.windows(2) {
            if pair.iter().all(seen) {
                let [from, to] = [pair[0], pair[1]].map(|(x, y)| (x_px(x), y_px(y)));
                if line.dashed {
                    along = dashes(canvas, from, to, colour, along);
                } else {
                    stroke(canvas, from, to, colour, 2.5);
                }
            }
        }
        if line.points.len() <= POINTS_MARKED {
            for &(x, y) in line.points.iter().filter(|point| seen(point)) {
                let at = (x_px(x), y_px(y));
                stroke(canvas, at, at, colour, 8.0);
            }
        }
    }

    fn widest(&self, style: &Style) -> f32 {
        self.lines.iter().map(|line| style.width(&line.name)).fold(0.0, f32::max)
    }

    /// Draws the legend in the upper right corner, where falling lines leave room, or right of the
    /// frame.
    fn legend(&self, canvas: &mut RgbImage, style: &Style, right: f64) {
        let left = right - f64::from(self.widest(style)) - 20.0;
        for (k, line) in self.lines.iter().enumerate() {
            let top = f64::from(TOP_PX) + 10.0 + 24.0 * k as f64;
            let colour = COLOURS[line.colour % COLOURS.len()];
            let ends =
                if line.dashed { vec![(0.0, 14.0), (24.0, 38.0)] } else { vec![(0.0, 38.0)] };
            for (from, to) in ends {
                let at = |dx: f64| (left - f64::from(LEGEND_LINE_PX) + dx, top + 11.0);
                stroke(canvas, at(from), at(to), colour, 2.5);
            }
            style.draw(canvas, &line.name, left as f32, top as f32);
        }
    }
}

/// Draws a dashed line. `along` is the position in the dash pattern at the start; the result is the
/// position at the end.
fn dashes(
    canvas: &mut RgbImage,
    from: (f64, f64),
    to: (f64, f64),
    colour: Rgb<u8>,
    along: f64,
) -> f64 {
    let length = (to.0 - from.0).hypot(to.1 - from.1);
    let at = |px: f64| {
        let part = px.clamp(0.0, length) / length;
        (from.0 + part * (to.0 - from.0), from.1 + part * (to.1 - from.1))
    };
    let period = DASH_PX[0] + DASH_PX[1];
    let mut start = -along;
    while start < length && length > 0.0 {
        if start + DASH_PX[0] > 0.0 {
            stroke(canvas, at(start), at(start + DASH_PX[0]), colour, 2.5);
        }
        start += period;
    }
    (along + length) % period
}

fn label(tick: f64) -> String {
    // Values that three digits would round away, and values wider than the margin.
    if tick != 0.0 && !(1e-3..1e6).contains(&tick.abs()) {
        return format!("{tick:e}");
    }
    let text = format!("{tick:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
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

    #[test]
    fn a_point_lies_where_its_axes_say() {
        // A short line at x = 1, the middle of a logarithmic axis of 0.1 to 10, and y = 5.05, the
        // middle of a linear one.
        let canvas = chart(vec![(0.99, 5.05), (1.01, 5.05)]).render();
        let x = LEFT_PX + (WIDTH_PX - LEFT_PX - RIGHT_PX) / 2;
        let y = TOP_PX + (HEIGHT_PX - TOP_PX - BOTTOM_PX) / 2;
        assert_eq!(*canvas.get_pixel(x, y), COLOURS[0]);
    }

    #[test]
    fn ticks_are_written_so_that_they_can_be_told_apart() {
        let labels = [0.0, 1e-4, 0.001, 0.25, 2.0, 1e5, 1e10].map(label);
        assert_eq!(labels, ["0", "1e-4", "0.001", "0.25", "2", "100000", "1e10"]);
    }

    #[test]
    fn many_lines_have_their_legend_beside_the_frame() {
        let mut many = chart(vec![(1.0, 5.0)]);
        let frame = many.render().width();
        many.lines = vec![many.lines[0].clone(); LINES_INSIDE];
        assert_eq!(many.render().width(), frame);
        many.lines.push(many.lines[0].clone());
        assert!(many.render().width() > frame + LEGEND_LINE_PX);
    }

    #[test]
    fn a_dashed_line_is_drawn_in_part_whatever_its_points() {
        let across: Vec<(f64, f64)> =
            (0..=200).map(|i| (0.1 * 10_f64.powf(f64::from(i) / 100.0), 5.05)).collect();
        let drawn = |dashed, points: &[(f64, f64)]| {
            let mut chart = chart(points.to_vec());
            chart.lines[0].dashed = dashed;
            let canvas = chart.render();
            let y = TOP_PX + (HEIGHT_PX - TOP_PX - BOTTOM_PX) / 2;
            (LEFT_PX..WIDTH_PX - RIGHT_PX)
                .filter(|&x| *canvas.get_pixel(x, y) == COLOURS[0])
                .count()
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

//! The figures of a sampling study: the best image at each share and, for each order, the gain over
//! zero filling of the best methods, on one axis; and the images of the best methods of each order.
//!
//! # Invariant
//! A method has the same colour in all orders, and no two methods of one order look alike
//! (`super::tests::the_picture_has_a_panel_for_each_order_with_lines_that_differ`). All charts have
//! the same axes.

use super::tables::signed;
use super::{Report, Shown, ZERO_FILLING};
use nirspi::picture::{Axis, Chart, Figure, Line, Panel, Range, Scale, SideBySide, Unit};
use nirspi_recon::Image;

/// Number of methods with a line in the chart of an order.
const LINES: usize = 4;
/// The look of zero filling: the last colour, dashed. No method has this colour.
const ZERO_COLOUR: usize = Line::LOOKS / 2 - 1;

/// The best image at each share, and the charts of all orders.
pub(super) fn curves(report: &Report, orders: &[String], methods: &[String]) -> Figure {
    let charts = Figure::grid(2, charts(report, orders, methods));
    match summary(report) {
        Some(images) => Figure::column([Figure::Images(images), charts]),
        None => charts,
    }
}

/// The images of the best methods of each order; `None` without images.
pub(super) fn best_images(report: &Report, orders: &[String]) -> Option<Figure> {
    let share = telling_share(report);
    let rows: Vec<SideBySide> =
        orders.iter().filter_map(|order| images(report, order, share)).collect();
    (!rows.is_empty()).then(|| Figure::column(rows))
}

/// A method's gains over zero filling.
struct Ranked<'a> {
    method: &'a str,
    /// In dB, over the shares.
    mean: f64,
    /// Share in percent, gain in dB.
    points: Vec<(f64, f64)>,
}

/// The gain of the best methods of each order against the share.
pub(super) fn charts(report: &Report, orders: &[String], methods: &[String]) -> Vec<Chart> {
    // Colours in the order in which methods appear, so that few orders have few colours.
    let mut coloured: Vec<&str> = Vec::new();
    let mut shares: Vec<f64> = report.rows.iter().map(|row| 100.0 * row.sampling).collect();
    shares.sort_unstable_by(f64::total_cmp);
    shares.dedup();
    let mut ticks = shares.clone();
    if ticks.len() < 2 {
        ticks.insert(0, 0.0);
    }
    if ticks.len() < 2 {
        ticks.push(100.0);
    }
    let ends = [ticks[0], ticks.last().copied().unwrap_or(100.0)];
    let mut charts = Vec::new();
    for order in orders {
        let mut ranked: Vec<Ranked> = Vec::new();
        for method in methods.iter().filter(|method| *method != ZERO_FILLING) {
            let of = |row: &&super::Row| row.order == *order && row.method == *method;
            let rows = report.rows.iter().filter(of);
            let mut gains: Vec<(f64, f64)> =
                rows.filter_map(|row| Some((100.0 * row.sampling, row.gain_db?))).collect();
            gains.sort_by(|a, b| a.0.total_cmp(&b.0));
            if gains.iter().any(|gain| gain.1.abs() >= 0.005) {
                let mean = gains.iter().map(|gain| gain.1).sum::<f64>() / gains.len() as f64;
                ranked.push(Ranked { method, mean, points: gains });
            }
        }
        ranked.sort_by(|a, b| b.mean.total_cmp(&a.mean));
        ranked.truncate(LINES);
        let mut lines: Vec<Line> = Vec::new();
        for Ranked { method, points, .. } in ranked {
            let known = coloured.iter().position(|name| *name == method);
            let colour = known.unwrap_or_else(|| {
                coloured.push(method);
                coloured.len() - 1
            });
            // Four colours, the same with other dashes, then both dashed.
            let (round, hue) = (colour / ZERO_COLOUR, colour % ZERO_COLOUR);
            let colour = hue + round % 2 * Line::LOOKS / 2;
            let dashed = round / 2 % 2 == 1;
            let name = method.to_owned();
            lines.push(Line { name, colour, dashed, points });
        }
        let zero = ends.map(|share| (share, 0.0)).to_vec();
        let name = "zero filling".to_owned();
        lines.push(Line { name, colour: ZERO_COLOUR, dashed: true, points: zero });
        charts.push(Chart {
            header: order.clone(),
            x: Axis::of("share of the patterns, %", ticks.clone(), false),
            y: Axis::around("", []),
            lines,
            footer: String::new(),
        });
    }
    // Orders are compared: all charts have one axis.
    let points = charts.iter().flat_map(|chart| &chart.lines).flat_map(|line| &line.points);
    let values: Vec<f64> = points.map(|point| point.1).collect();
    let y = Axis::around("gain over zero filling, dB", values);
    charts.iter_mut().for_each(|chart| chart.y = y.clone());
    charts
}

/// The share at which methods differ most from zero filling.
fn telling_share(report: &Report) -> f64 {
    let gain = |share: f64| -> f64 {
        let of = |shown: &&Shown| shown.sampling == share;
        report.shown.iter().filter(of).map(Shown::best_gain_db).sum()
    };
    let shares = report.shown.iter().map(|shown| shown.sampling);
    shares.max_by(|a, b| gain(*a).total_cmp(&gain(*b)).then(b.total_cmp(a))).unwrap_or(1.0)
}

fn panel(report: &Report, title: &str, image: &Image, caption: Vec<String>) -> Panel {
    // All images have the scale of the image of all patterns.
    let scale = report
        .full
        .as_ref()
        .map(|full| Scale::of(Range::Stretched, Unit::Readings, full.pixels().iter().copied()));
    let range = scale.map_or(Range::Stretched, |scale| Range::Fixed(scale.black, scale.white));
    let side = image.side().pixels();
    Panel { range, caption, ..Panel::square(title, side, image.pixels(), Unit::Readings) }
}

/// The image of all patterns, and the best image at each share.
fn summary(report: &Report) -> Option<SideBySide> {
    let full = report.full.as_ref()?;
    let mut panels = vec![panel(report, "all patterns", full, vec!["the reference".to_owned()])];
    let mut shares: Vec<f64> = report.shown.iter().map(|shown| shown.sampling).collect();
    shares.sort_unstable_by(f64::total_cmp);
    shares.dedup();
    for share in shares {
        let of = |shown: &&Shown| shown.sampling == share && !shown.best.is_empty();
        let at = report.shown.iter().filter(of);
        let Some(best) = at.max_by(|a, b| a.best[0].psnr_db.total_cmp(&b.best[0].psnr_db)) else {
            continue;
        };
        let winner = &best.best[0];
        let caption = vec![format!("{:.2} dB", winner.psnr_db), format!("order {}", best.order)];
        let title = format!("{:.0} %: {}", 100.0 * share, winner.method);
        panels.push(panel(report, &title, &winner.image, caption));
    }
    Some(SideBySide {
        header: format!("Best image at each share of the patterns: {}", report.input.display()),
        panels,
        footer: "PSNR against the image of all patterns, on whose scale all images are. Below: the gain of the best \
                 methods of each order, on one axis"
            .to_owned(),
    })
}

/// Zero filling and the best methods of an order.
fn images(report: &Report, order: &str, share: f64) -> Option<SideBySide> {
    let of = |shown: &&Shown| shown.sampling == share && shown.order == order;
    let shown = report.shown.iter().find(of)?;
    let zero = &shown.zero;
    let caption = vec![format!("{:.2} dB", zero.psnr_db)];
    let title = format!("{:.0} %: zero filling", 100.0 * share);
    let mut panels = vec![panel(report, &title, &zero.image, caption)];
    panels.extend(shown.best.iter().map(|best| {
        let gain = signed(best.psnr_db - zero.psnr_db);
        let caption = format!("{:.2} dB, {gain}", best.psnr_db);
        panel(report, &best.method, &best.image, vec![caption])
    }));
    Some(SideBySide { header: format!("order {order}"), panels, footer: String::new() })
}

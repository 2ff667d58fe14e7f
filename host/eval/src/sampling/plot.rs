//! The picture of a sampling study: the best image at each share; and for each order the gain over
//! zero filling of the best methods, with their images.
//!
//! # Invariant
//! A method has the same colour in all orders, and no two methods of one order look alike
//! (`super::tests::the_picture_has_a_panel_for_each_order_with_lines_that_differ`).

use super::tables::signed;
use super::{Report, Shown, ZERO_FILLING};
use image::RgbImage;
use nirspi::picture::{
    Axis, Chart, Line, Panel, Range, Scale, SideBySide, Unit, below, beside, blank,
};
use nirspi_recon::Image;

/// Number of methods with a line in the chart of an order.
const LINES: usize = 4;
/// Frame of a chart, and edge of an image.
const FRAME_PX: (u32, u32) = (460, 270);
const IMAGE_PX: u32 = 256;

/// The whole picture.
pub(super) fn draw(report: &Report, orders: &[String], methods: &[String]) -> RgbImage {
    let mut rows: Vec<RgbImage> =
        summary(report).map(|row| row.render_at(IMAGE_PX)).into_iter().collect();
    let share = telling_share(report);
    let charts = charts(report, orders, methods);
    let drawn: Vec<RgbImage> = charts.iter().map(|chart| chart.render_at(FRAME_PX)).collect();
    // Images of all orders below each other, also where the names of methods are short.
    let widest = drawn.iter().map(RgbImage::width).max().unwrap_or(1);
    for (chart, drawn) in charts.iter().zip(drawn) {
        let space = blank(widest - drawn.width(), 1);
        let mut row = vec![drawn, space];
        row.extend(images(report, &chart.header, share).map(|row| row.render_at(IMAGE_PX)));
        rows.push(beside(&row));
    }
    below(&rows)
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
            // Six colours, then the same with dots, and with dashes; the seventh is zero filling's.
            let (round, colour) = (colour / 6, colour % 6 + colour / 6 % 2 * 8);
            let name = method.to_owned();
            lines.push(Line { name, colour, dashed: round / 2 % 2 == 1, points });
        }
        let values = lines.iter().flat_map(|line| &line.points).map(|point| point.1);
        let y = Axis::around("gain over zero filling, dB", values.chain([0.0]));
        let zero = ends.map(|share| (share, 0.0)).to_vec();
        lines.push(Line { name: "zero filling".to_owned(), colour: 6, dashed: true, points: zero });
        charts.push(Chart {
            header: order.clone(),
            x: Axis::of("share of the patterns, %", ticks.clone(), false),
            y,
            lines,
            footer: String::new(),
        });
    }
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
        footer: "PSNR against the image of all patterns, on whose scale all images are. Below: each order; the \
                 charts have their own axes"
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
    Some(SideBySide { header: String::new(), panels, footer: String::new() })
}

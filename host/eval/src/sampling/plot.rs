//! Curves as an SVG picture, laid out without font metrics.

use std::fmt::Write;

/// PSNR in dB over the share of patterns.
pub struct Curve {
    /// The name in the legend.
    pub name: String,
    /// Points as share and dB.
    pub points: Vec<(f64, f64)>,
}

const WIDTH: f64 = 900.0;
const HEIGHT: f64 = 520.0;
const LEFT: f64 = 60.0;
const RIGHT: f64 = 660.0;
const TOP: f64 = 40.0;
const BOTTOM: f64 = 470.0;
/// Okabe and Ito's colours, which most people can distinguish.
const COLOURS: [&str; 8] =
    ["#000000", "#e69f00", "#56b4e9", "#009e73", "#f0e442", "#0072b2", "#d55e00", "#cc79a7"];
/// After the last colour, the colours repeat with dashes.
const DASHES: [&str; 3] = ["none", "8 3", "2 3"];

/// The picture of these curves, measured in one order.
pub fn draw(curves: &[Curve], order: &str) -> String {
    let points = || curves.iter().flat_map(|curve| curve.points.iter().copied());
    let bounds = |pick: fn((f64, f64)) -> f64| {
        points().map(pick).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        })
    };
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" font-family=\"sans-serif\" \
         font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n"
    );
    let mut line = |text: String| {
        svg.push_str(&text);
        svg.push('\n');
    };
    line(format!(
        "<text x=\"{LEFT}\" y=\"24\" font-size=\"15\">PSNR in dB over the share of patterns, order {order}</text>"
    ));
    let ((left, right), (low, high)) = (bounds(|p| p.0), bounds(|p| p.1));
    let (low, high) = ((low / 5.0).floor() * 5.0, (high / 5.0).ceil() * 5.0);
    if left.is_finite() && low.is_finite() {
        let x = |share: f64| LEFT + (RIGHT - LEFT) * (share - left) / (right - left).max(1e-9);
        let y = |db: f64| BOTTOM - (BOTTOM - TOP) * (db - low) / (high - low).max(1e-9);
        let mut db = low;
        while db <= high {
            let at = y(db);
            line(format!(
                "<path d=\"M{LEFT} {at:.1}H{RIGHT}\" stroke=\"#ddd\"/><text x=\"28\" y=\"{:.1}\">{db}</text>",
                at + 4.0
            ));
            db += 5.0;
        }
        let mut shares: Vec<f64> = points().map(|p| p.0).collect();
        shares.sort_unstable_by(f64::total_cmp);
        shares.dedup();
        for share in shares {
            let at = x(share);
            line(format!(
                "<text x=\"{:.1}\" y=\"{:.1}\">{:.0} %</text>",
                at - 10.0,
                BOTTOM + 20.0,
                100.0 * share
            ));
        }
        for (index, curve) in curves.iter().enumerate() {
            let (colour, dash) = (COLOURS[index % 8], DASHES[index / 8 % 3]);
            let mut path = String::new();
            for (k, &(share, db)) in curve.points.iter().enumerate() {
                // Writing to a string cannot fail.
                let _ =
                    write!(path, "{}{:.1} {:.1}", if k == 0 { 'M' } else { 'L' }, x(share), y(db));
            }
            let style = format!(
                "fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\" stroke-dasharray=\"{dash}\""
            );
            line(format!("<path d=\"{path}\" {style}/>"));
            let row = TOP + 22.0 * index as f64;
            line(format!("<path d=\"M{:.1} {row:.1}h28\" {style}/>", RIGHT + 20.0));
            line(format!(
                "<text x=\"{:.1}\" y=\"{:.1}\">{}</text>",
                RIGHT + 56.0,
                row + 4.0,
                curve.name
            ));
        }
    }
    svg.push_str("</svg>\n");
    svg
}

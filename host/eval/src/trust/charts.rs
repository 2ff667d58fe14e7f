//! The coverage curve, and a picture of images with their intervals, the worst among them.

use super::{AREA, CONDITIONS, Covered, TARGETS};
use crate::error::{EvalError, Result};
use crate::quality::{Characters, Condition};
use image::RgbImage;
use nirspi::picture::{Axis, Chart, Line, Panel, Range, SideBySide, Unit};
use nirspi_nets::interval::{Intervals, share_of_prior};
use nirspi_nets::reading::Reader;
use nirspi_nets::{Enhanced, Images};

/// The condition of the picture: the strongest blur of the targets.
pub(super) const SHOWN: usize = TARGETS - 1;

/// The nominal coverage against that seen, one line a stack: the mean of the targets' conditions.
pub(super) fn curve(coverage: &[Covered]) -> RgbImage {
    let targets = &CONDITIONS[..TARGETS];
    let mut stacks: Vec<&str> = coverage.iter().map(|covered| covered.stack.as_str()).collect();
    stacks.dedup();
    stacks.sort_unstable();
    stacks.dedup();
    let percent = |share: f64| 100.0 * share;
    let line = |(colour, stack): (usize, &&str)| {
        let taken =
            coverage.iter().filter(|c| c.stack == **stack && targets.contains(&c.condition));
        let rows: Vec<&Covered> = taken.collect();
        let levels = rows.first().map_or([0.0; 7], |row| row.levels);
        let seen = |k: usize| rows.iter().map(|row| row.seen[k]).sum::<f64>() / rows.len() as f64;
        let points = levels.iter().enumerate();
        Line {
            name: (*stack).to_owned(),
            colour,
            dashed: false,
            points: points.map(|(k, &level)| (percent(level), percent(seen(k)))).collect(),
        }
    };
    let mut lines: Vec<Line> = stacks.iter().enumerate().map(line).collect();
    let colour = lines.len();
    let points = vec![(50.0, 50.0), (100.0, 100.0)];
    lines.push(Line { name: "as it should be".to_owned(), colour, dashed: true, points });
    let ticks = vec![40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 95.0, 100.0];
    let images: usize = stacks
        .iter()
        .filter_map(|s| coverage.iter().find(|c| c.stack == *s))
        .map(|c| c.images)
        .sum();
    let chart = Chart {
        header: "Coverage of the intervals, blur 1 to 3 px, noise 3 %".to_owned(),
        x: Axis::of("nominal, per cent of the pixels", ticks[1..].to_vec(), false),
        y: Axis::of("seen, per cent of the pixels", ticks, false),
        lines,
        footer: format!(
            "simulated: {images} images that neither training nor calibration has seen, three blurs each"
        ),
    };
    chart.render()
}

/// One image for the picture: its values, and what to write below it.
pub(super) struct Shown {
    title: String,
    values: [Vec<f32>; 4],
    caption: Vec<String>,
}

/// Of each stack the image whose coverage is the median, and the image with the worst.
pub(super) fn cases(
    intervals: &Intervals,
    reader: &Reader,
    images: &Characters,
    made: &Enhanced,
) -> Result<Vec<Shown>> {
    let seen = made.seen().ok_or_else(|| EvalError::Content("no images of 64 x 64".to_owned()))?;
    let readings = reader.read(Images::new(&made.images)?);
    let mut all: Vec<(usize, f64, Shown)> = images
        .iter()
        .zip(seen)
        .zip(readings)
        .map(|((image, seen), reading)| {
            let widths = intervals.half_widths(&seen);
            let errors: Vec<f32> =
                seen.image.iter().zip(&image.sharp).map(|(a, b)| (a - b).abs()).collect();
            let within = errors.iter().zip(&widths).filter(|(e, w)| e <= w).count();
            let within = within as f64 / AREA as f64;
            let caption = vec![
                format!("{:.1} % of the pixels within", 100.0 * within),
                format!("{:.1} % the prior's", 100.0 * share_of_prior(&widths)),
                reading.to_string(),
            ];
            let values = [seen.image.to_vec(), image.sharp.clone(), widths, errors];
            (image.stack, within, Shown { title: String::new(), values, caption })
        })
        .collect();
    all.sort_by(|a, b| a.1.total_cmp(&b.1));
    let mut chosen = Vec::new();
    for (at, origin) in images.origins().iter().enumerate() {
        let (of_stack, rest): (Vec<_>, Vec<_>) = all.into_iter().partition(|case| case.0 == at);
        all = rest;
        let middle = of_stack.len() / 2;
        for (place, (.., mut case)) in of_stack.into_iter().enumerate() {
            let which = match place {
                0 => "worst",
                place if place == middle => "median",
                _ => continue,
            };
            case.title = format!("{}: {which}", origin.stack);
            chosen.push(case);
        }
    }
    Ok(chosen)
}

/// Half-width and error are drawn so much brighter.
const BRIGHTER: f32 = 2.0;

/// The picture: each case is a square of enhanced image and truth above half-width and error.
pub(super) fn picture(cases: Vec<Shown>, condition: Condition) -> RgbImage {
    let panels = cases.into_iter().map(|case| {
        let [image, truth, widths, errors] = &case.values;
        let row = |values: &[f32], row: usize| values[64 * row..64 * (row + 1)].to_vec();
        let upper = (0..64).flat_map(|at| [row(image, at), row(truth, at)].concat());
        let lower = (0..64).flat_map(|at| [row(widths, at), row(errors, at)].concat());
        let values: Vec<f32> =
            upper.chain(lower.map(|value| (BRIGHTER * value).min(1.0))).collect();
        Panel {
            range: Range::Unit,
            caption: case.caption,
            ..Panel::square(&case.title, 128, &values, Unit::OfWhite)
        }
    });
    let panels: Vec<Panel> = panels.collect();
    let all = SideBySide {
        header: format!(
            "Enhanced image and truth, half-width of the 95 % interval and error: blur {} px, noise {} %",
            condition.sigma_px,
            100.0 * condition.noise
        ),
        panels,
        footer: "simulated; of each stack the image with the worst coverage and that with the median; above: enhanced, \
                 truth; below: half-width, error, both twice as bright"
            .to_owned(),
    };
    all.render()
}

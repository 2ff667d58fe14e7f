//! The coverage curve, and a picture of images with their intervals, the worst among them.

use super::shots::{At, Shot, Studio};
use super::{AREA, Covered, NATURAL};
use crate::error::Result;
use nirspi::picture::{Axis, Chart, Figure, Line, Panel, Range, SideBySide, Unit};
use nirspi_nets::interval::{Intervals, share_of_prior};

/// The nominal coverage against that seen on natural scenes, one line a method.
pub(super) fn curve(coverage: &[Covered]) -> Figure {
    let percent = |share: f64| 100.0 * share;
    let rows: Vec<&Covered> =
        coverage.iter().filter(|row| row.images_of == NATURAL && row.condition == "all").collect();
    let line = |(colour, row): (usize, &&Covered)| Line {
        name: row.method.clone(),
        colour,
        dashed: false,
        points: row
            .levels
            .iter()
            .zip(row.seen)
            .map(|(&l, seen)| (percent(l), percent(seen)))
            .collect(),
    };
    let mut lines: Vec<Line> = rows.iter().enumerate().map(line).collect();
    let colour = lines.len();
    let points = vec![(50.0, 50.0), (100.0, 100.0)];
    lines.push(Line { name: "as it should be".to_owned(), colour, dashed: true, points });
    let ticks = vec![40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 95.0, 100.0];
    let images: usize = rows.iter().map(|row| row.images).sum();
    let chart = Chart {
        header: "Coverage of the intervals on natural scenes, by method".to_owned(),
        x: Axis::of("nominal, per cent of the pixels", ticks[1..].to_vec(), false),
        y: Axis::of("seen, per cent of the pixels", ticks, false),
        lines,
        footer: format!(
            "simulated: {images} images that neither training nor calibration has seen"
        ),
    };
    chart.into()
}

/// One image for the picture: its values, and what to write below it.
pub(super) struct Shown {
    title: String,
    values: [Vec<f32>; 4],
    caption: Vec<String>,
}

/// Of each method the shot whose coverage is the median, and the shot with the worst.
pub(super) fn cases(
    intervals: &Intervals,
    studio: &Studio,
    shots: &[(At, Shot)],
) -> Result<Vec<Shown>> {
    let mut chosen = Vec::new();
    for (number, method) in studio.methods.iter().enumerate() {
        let mut all = Vec::new();
        for (_, shot) in shots.iter().filter(|(_, shot)| shot.method == number) {
            let Some(seen) = shot.seen() else { continue };
            let widths = intervals.half_widths(&seen, &shot.readings(studio))?;
            let errors: Vec<f32> =
                seen.image.iter().zip(&shot.truth).map(|(a, b)| (a - b).abs()).collect();
            let within = errors.iter().zip(&widths).filter(|(e, w)| e <= w).count();
            all.push((within, shot, widths, errors));
        }
        all.sort_by_key(|(within, ..)| *within);
        let middle = all.len() / 2;
        for (place, (within, shot, widths, errors)) in all.into_iter().enumerate() {
            let which = match place {
                0 => "worst",
                place if place == middle => "median",
                _ => continue,
            };
            let condition = shot.condition;
            let caption = vec![
                format!("{:.1} % of the pixels within", 100.0 * within as f64 / AREA as f64),
                format!("{:.1} % the prior's", 100.0 * share_of_prior(&widths)),
                format!(
                    "{:.0} % of the patterns, noise {:.1} %",
                    100.0 * condition.share,
                    100.0 * condition.noise
                ),
            ];
            let values = [shot.made.images.clone(), shot.truth.clone(), widths, errors];
            chosen.push(Shown {
                title: format!("{}: {which}", method.argument()),
                values,
                caption,
            });
        }
    }
    Ok(chosen)
}

/// Half-width and error are drawn so much brighter.
const BRIGHTER: f32 = 2.0;

/// The picture: each case is a square of enhanced image and truth above half-width and error.
pub(super) fn picture(cases: Vec<Shown>) -> Figure {
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
        header: "Enhanced image and truth, half-width of the 95 % interval and error".to_owned(),
        panels,
        footer: "simulated; of each method the image with the worst coverage and that with the median; above: enhanced, \
                 truth; below: half-width, error, both twice as bright"
            .to_owned(),
    };
    all.into()
}

//! Charts of a quality report: PSNR, SSIM and Fréchet character distance below each other, over
//! blur, noise and steps.

use super::MIDDLE;
use super::characters::Characters;
use super::condition::Condition;
use super::contenders::Method;
use super::measure::Figures;
use nirspi::picture::{Axis, Chart, Figure, Line};
use nirspi_nets::classical::Method as Classical;

/// The classical method in the charts over steps.
pub const BEST_CLASSICAL: Classical = Classical::TotalVariation;

/// The most steps of the bridge in a chart. Further steps change nothing.
pub const MOST_BRIDGE_STEPS: u32 = 50;

/// The vertical axis of a chart.
struct Measure {
    name: &'static str,
    of: fn(&Figures) -> f64,
}

const MEASURES: [Measure; 3] = [
    Measure { name: "PSNR, dB (higher is better)", of: |f| f.psnr_db.value },
    Measure { name: "SSIM (higher is better)", of: |f| f.ssim.value },
    Measure {
        name: "Fréchet character distance (lower is better; not FID)",
        of: |f| f.frechet_character_distance.value,
    },
];

/// Names and figures of all charts.
pub fn all(
    measured: &[Figures],
    steps: &[Figures],
    characters: &Characters,
    few: &Characters,
) -> Vec<(&'static str, Figure)> {
    let Condition { sigma_px, noise } = MIDDLE;
    let whole: Vec<&Figures> = measured.iter().filter(|f| f.stack.is_none()).collect();
    let along = |of: fn(&Condition) -> f64, fixed: fn(&Condition) -> bool| {
        Method::ALL.map(|method| {
            let row = whole.iter().filter(|f| f.method == method && fixed(&f.condition));
            let mut row: Vec<(f64, &Figures)> = row.map(|f| (of(&f.condition), *f)).collect();
            row.sort_by(|a, b| a.0.total_cmp(&b.0));
            (method.name(), row)
        })
    };
    let blur = along(|c| f64::from(c.sigma_px), |c| c.noise == MIDDLE.noise);
    let noises = along(|c| f64::from(c.noise), |c| c.sigma_px == MIDDLE.sigma_px);
    let count = characters.len();
    vec![
        (
            "blur",
            column(
                &format!("Quality against blur, noise {noise}"),
                &linear("blur, sigma in pixels of 64 x 64", &[0.0, 1.0, 2.0, 3.0, 4.0]),
                &blur,
                count,
            ),
        ),
        (
            "noise",
            column(
                &format!("Quality against noise, blur {sigma_px} px"),
                &linear("noise of the readings, 1 is white", &[0.0, 0.02, 0.04, 0.06, 0.08]),
                &noises,
                count,
            ),
        ),
        (
            "steps",
            column(
                &format!("Quality against steps, blur {sigma_px} px, noise {noise}"),
                &Axis {
                    logarithmic: true,
                    ..linear("network calls an image", &[1.0, 2.0, 4.0, 10.0, 50.0, 500.0])
                },
                &by_steps(steps),
                few.len(),
            ),
        ),
    ]
}

type Row<'a> = (String, Vec<(f64, &'a Figures)>);

/// Rows by steps. A row without a choice of steps extends over the whole axis.
fn by_steps(steps: &[Figures]) -> Vec<Row<'_>> {
    let whole = || steps.iter().filter(|f| f.stack.is_none());
    let stepped = |name: &str, of: fn(Method) -> bool| {
        let points = whole().filter(|f| of(f.method));
        let points = points.filter_map(|f| Some((f64::from(f.method.steps()?), f))).collect();
        (name.to_owned(), points)
    };
    let mut rows = vec![
        stepped("diffusion (bridge)", |method| matches!(method, Method::Diffusion(_))),
        stepped("ancestral sampler", |method| matches!(method, Method::Ancestral(_))),
    ];
    let flat = whole().filter(|f| f.method.steps().is_none());
    rows.extend(flat.map(|f| (f.row.clone(), vec![(1.0, f), (500.0, f)])));
    rows
}

fn linear(name: &str, ticks: &[f64]) -> Axis {
    Axis::of(name, ticks.to_vec(), false)
}

/// The three charts of one axis, below each other.
fn column(header: &str, x: &Axis, rows: &[Row<'_>], images: usize) -> Figure {
    let charts = MEASURES.map(|measure| {
        let lines: Vec<Line> = rows
            .iter()
            .enumerate()
            .map(|(k, (name, points))| Line {
                name: name.clone(),
                colour: k,
                dashed: false,
                points: points.iter().map(|(x, f)| (*x, (measure.of)(f))).collect(),
            })
            .collect();
        let values = lines.iter().flat_map(|line| line.points.iter().map(|point| point.1));
        Chart {
            header: header.to_owned(),
            x: x.clone(),
            y: Axis::around(measure.name, values),
            lines,
            footer: format!("simulated: {images} characters that training has not seen"),
        }
    });
    Figure::column(charts)
}

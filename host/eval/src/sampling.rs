//! The quality of images of a part of the patterns, by order, basis and method, judged by readings
//! that the images were not made from.
//!
//! The image of all patterns of the same readings has the noise of the judged images, which favours
//! methods that keep noise. So an independent measurement of the scene judges: the other half of a
//! recording's frames, or a second file. Without an independent measurement, the same readings judge,
//! and the report says so.

mod plot;
mod tables;

use crate::error::{EvalError, Result};
use nirspi::picture::Figure;
use nirspi_recon::reconstruct::{
    self, Method, MethodSettings, Reconstruct, ReconstructError, Setting, Sparsity,
};
use nirspi_recon::{Basis, Image, Measurements, NamedOrder, Order, metrics};
use serde::Serialize;
use std::fmt;
use std::path::PathBuf;

/// The name of the order of the measurements.
pub const RECORDED: &str = "recorded";

/// The method that all others are compared with: what was not measured is 0.
const ZERO_FILLING: &str = "hadamard";

/// Number of methods of each order and share whose images are kept.
const KEPT: usize = 3;

/// The orders that are compared by default: the recorded order, every named order except deepinv's,
/// which are transposes of others, and a shuffle.
#[must_use]
pub fn default_orders() -> Vec<String> {
    let own = |named: &&NamedOrder| named.package.is_none_or(|package| package == "SPyRiT");
    let named = Order::NAMED.iter().filter(own).map(|named| named.name.to_owned());
    std::iter::once(RECORDED.to_owned()).chain(named).chain(["random:1".to_owned()]).collect()
}

/// A method ready to run, with its name in the tables.
struct Candidate {
    name: String,
    method: Box<dyn Reconstruct>,
}

/// Every method, in every basis where it has one, and Algorithm 1 as printed.
fn candidates() -> Result<Vec<Candidate>, ReconstructError> {
    let mut all = Vec::new();
    let mut add = |name: String, method: Method, settings: MethodSettings| {
        method.prepare(&settings).map(|method| all.push(Candidate { name, method }))
    };
    let default = nirspi_nets::prior::settings();
    for &method in Method::ALL {
        if !method.takes(Setting::Basis) || method == Method::AUTO {
            add(method.to_string(), method, default.clone())?;
            continue;
        }
        for basis in Basis::ALL {
            let settings = MethodSettings { basis, ..default.clone() };
            add(format!("{method}, {basis}"), method, settings)?;
        }
    }
    let sparsity = Sparsity::Fixed(PRINTED_SPARSITY);
    let printed = MethodSettings { as_printed: true, sparsity, ..MethodSettings::default() };
    let name = format!("as printed, {}, k = {PRINTED_SPARSITY}", printed.basis);
    add(name, Method::OMP, printed)?;
    Ok(all)
}

/// Number of atoms of the printed algorithm.
const PRINTED_SPARSITY: usize = 100;

/// The image of one method from one part of the patterns.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Share of the patterns.
    pub sampling: f64,
    /// The order whose first patterns were used.
    pub order: String,
    /// The method, with its basis.
    pub method: String,
    /// PSNR against the reference, whose range of values is the peak. For an independent reference,
    /// after the gain and offset of least squares, because its exposure may be another one.
    pub psnr_db: f64,
    /// PSNR minus that of zero filling of the same patterns; `null` if either is the image of all
    /// patterns itself.
    pub gain_db: Option<f64>,
    /// Pearson's correlation with the reference.
    pub correlation: f64,
}

/// What judges the images of a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum JudgedBy {
    /// The image of all patterns of the same readings, which has their noise.
    SameReadings,
    /// The other half of the recording's frames.
    OtherFrames,
    /// Another measurement of the same scene.
    OtherMeasurement,
}

impl fmt::Display for JudgedBy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::SameReadings => {
                "the image of all patterns of the same readings, which has the noise of the judged images: \
                 methods that keep noise look better than they are. Give a second measurement of the scene with \
                 --against, or a recording of several frames"
            }
            Self::OtherFrames => {
                "the image of all patterns of the other frames, whose noise is independent (PSNR after a fit of \
                 gain and offset)"
            }
            Self::OtherMeasurement => {
                "the image of all patterns of the other measurement, whose noise is independent (PSNR after a \
                 fit of gain and offset)"
            }
        })
    }
}

/// Every order, method and share.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// The source of the measurements.
    pub input: PathBuf,
    /// Side of the image.
    pub n: usize,
    /// Number of measurements of all patterns.
    pub measurements: usize,
    /// What judges the images.
    pub judged_by: JudgedBy,
    /// Each share, order and method.
    pub rows: Vec<Row>,
    /// The image of all patterns.
    #[serde(skip)]
    full: Option<Image>,
    /// The images of the best methods of each share and order.
    #[serde(skip)]
    shown: Vec<Shown>,
}

/// Images of one share and order.
#[derive(Debug, Clone, PartialEq)]
struct Shown {
    sampling: f64,
    order: String,
    zero: Made,
    /// The best methods, the best first, without those that are zero filling by another name.
    best: Vec<Made>,
}

/// The image of a method.
#[derive(Debug, Clone, PartialEq)]
struct Made {
    method: String,
    image: Image,
    psnr_db: f64,
}

impl Shown {
    fn best_gain_db(&self) -> f64 {
        let gain = self.best.first().and_then(|best| gain_db(best.psnr_db, self.zero.psnr_db));
        gain.unwrap_or(0.0)
    }
}

/// A PSNR beyond this is the image itself but for rounding.
const ITSELF_DB: f64 = 100.0;

fn gain_db(psnr_db: f64, zero_db: f64) -> Option<f64> {
    (psnr_db.is_finite() && zero_db < ITSELF_DB).then_some(psnr_db - zero_db)
}

impl Report {
    fn empty(input: PathBuf, n: usize) -> Self {
        let judged_by = JudgedBy::SameReadings;
        Self {
            input,
            n,
            measurements: 0,
            judged_by,
            rows: Vec::new(),
            full: None,
            shown: Vec::new(),
        }
    }

    /// Adds the images of all methods with their PSNR and correlation, and keeps the best images.
    fn add(&mut self, sampling: f64, order: &str, made: Vec<(Made, f64)>) {
        let zero = made.iter().find(|(made, _)| made.method == ZERO_FILLING);
        let Some(zero) = zero.map(|(made, _)| made.clone()) else { return };
        let row = |(made, correlation): &(Made, f64)| Row {
            sampling,
            order: order.to_owned(),
            method: made.method.clone(),
            psnr_db: made.psnr_db,
            gain_db: gain_db(made.psnr_db, zero.psnr_db),
            correlation: *correlation,
        };
        self.rows.extend(made.iter().map(row));
        let other = |made: &Made| gain_db(made.psnr_db, zero.psnr_db).is_some_and(|db| db != 0.0);
        let mut best: Vec<Made> = made.into_iter().map(|(made, _)| made).filter(other).collect();
        best.sort_by(|a, b| b.psnr_db.total_cmp(&a.psnr_db));
        best.truncate(KEPT);
        self.shown.push(Shown { sampling, order: order.to_owned(), zero, best });
    }

    /// PSNR of a method; NaN if the study did not run the method.
    fn psnr_db(&self, share: f64, order: &str, method: &str) -> f64 {
        let sought =
            |row: &&Row| row.sampling == share && row.order == order && row.method == method;
        self.rows.iter().find(sought).map_or(f64::NAN, |row| row.psnr_db)
    }
}

/// What to compare.
pub struct Study {
    /// Orders by name; `None` is the order of the measurements.
    orders: Vec<(String, Option<Order>)>,
    shares: Vec<f64>,
    methods: Vec<Candidate>,
}

impl Study {
    /// Every method at these shares of the patterns, using the first patterns of each order.
    ///
    /// # Errors
    /// [`EvalError::Setting`] for a share out of range.
    pub fn new(orders: Vec<(String, Option<Order>)>, shares: Vec<f64>) -> Result<Self> {
        match shares.iter().find(|share| !(**share > 0.0 && **share <= 1.0)) {
            Some(found) => Err(EvalError::setting("sampling", found, "more than 0, at most 1")),
            None => Ok(Self { orders, shares, methods: candidates()? }),
        }
    }

    /// Number of images to make.
    #[must_use]
    pub fn images(&self) -> usize {
        self.orders.len() * self.shares.len() * self.methods.len()
    }

    /// Makes and judges every image; `done` is called after each. `judge` is an independent
    /// measurement of the scene, and what it is.
    ///
    /// # Errors
    /// [`EvalError::PartialSweep`] for fewer than 99 % of the patterns; [`EvalError::Content`] for
    /// two measurements that do not show the same scene; other errors for an order that is not a
    /// permutation, or measurements that a method cannot invert.
    pub fn run(
        &self,
        input: PathBuf,
        all: &Measurements,
        judge: Option<(&Measurements, JudgedBy)>,
        done: &dyn Fn(),
    ) -> Result<Report> {
        let reference = judge.map_or(all, |(judge, _)| judge);
        for measured in [all, reference] {
            let (found, expected) = (measured.rows().len(), measured.side().area());
            // The reference remains usable without a few patterns that dropped out or were not read.
            if found * 100 < expected * 99 {
                return Err(EvalError::PartialSweep { found, expected });
            }
        }
        let full = reconstruct::hadamard(reference);
        same_scene(&reconstruct::hadamard(all), &full)?;
        let mut report = Report::empty(input, full.side().pixels());
        report.measurements = all.rows().len();
        report.judged_by = judge.map_or(JudgedBy::SameReadings, |(_, judged_by)| judged_by);
        let fitted = judge.is_some();
        for &sampling in &self.shares {
            for (name, order) in &self.orders {
                let part = all.take(order.as_ref(), sampling)?;
                let mut made = Vec::with_capacity(self.methods.len());
                for candidate in &self.methods {
                    let image = match candidate.method.reconstruct(&part) {
                        Ok(made) => made.image,
                        // The tables have a dash where a method makes no images of this side.
                        Err(ReconstructError::NetworkSide { .. }) => {
                            done();
                            continue;
                        }
                        Err(error) => return Err(error.into()),
                    };
                    let (psnr_db, correlation) = judged(&full, &image, fitted)?;
                    made.push((
                        Made { method: candidate.name.clone(), image, psnr_db },
                        correlation,
                    ));
                    done();
                }
                report.add(sampling, name, made);
            }
        }
        report.full = Some(full);
        Ok(report)
    }

    /// Markdown tables for each share: the best methods of each order, then PSNR of every method.
    #[must_use]
    pub fn tables(&self, report: &Report) -> String {
        tables::all(report, &self.order_names(), &self.method_names(), &self.shares)
    }

    /// The figures and their names: `sampling`, the best image at each share, and for each order the
    /// gain over zero filling of the best methods against the share; `sampling_images`, the images of
    /// the best methods of each order. An order that repeats another is left out.
    #[must_use]
    pub fn figures(&self, report: &Report) -> Vec<(&'static str, Figure)> {
        let methods = self.method_names();
        let (orders, _) =
            tables::telling_orders(report, &self.order_names(), &methods, &self.shares);
        let mut figures = vec![("sampling", plot::curves(report, &orders, &methods))];
        figures
            .extend(plot::best_images(report, &orders).map(|images| ("sampling_images", images)));
        figures
    }

    fn order_names(&self) -> Vec<String> {
        self.orders.iter().map(|(name, _)| name.clone()).collect()
    }

    fn method_names(&self) -> Vec<String> {
        self.methods.iter().map(|candidate| candidate.name.clone()).collect()
    }
}

/// Standard errors of the correlation of two images of noise from which they show one scene.
const ONE_SCENE: f64 = 5.0;

/// Refuses two measurements whose images of all patterns have nothing in common.
fn same_scene(one: &Image, other: &Image) -> Result<()> {
    let [side, other_side] = [one, other].map(|image| image.side().pixels());
    if side != other_side {
        return Err(EvalError::Content(format!(
            "the measurements have {side} x {side} and {other_side} x {other_side} pixels, expected the same"
        )));
    }
    let correlation = metrics::correlation(one.pixels(), other.pixels(), side, side)?;
    if correlation * side as f64 >= ONE_SCENE {
        return Ok(());
    }
    Err(EvalError::Content(format!(
        "the two measurements do not show the same scene: the correlation of their images of all patterns is \
         {correlation:.2}, expected at least {:.2}",
        ONE_SCENE / side as f64
    )))
}

/// The image times the gain plus the offset of least squares to the reference.
fn fitted_to(full: &Image, image: &Image) -> Image {
    let mean = |v: &[f32]| v.iter().map(|&v| f64::from(v)).sum::<f64>() / v.len() as f64;
    let (to, from) = (mean(full.pixels()), mean(image.pixels()));
    let (mut both, mut square) = (0.0, 0.0);
    for (&reference, &pixel) in full.pixels().iter().zip(image.pixels()) {
        let pixel = f64::from(pixel) - from;
        both += pixel * (f64::from(reference) - to);
        square += pixel * pixel;
    }
    let gain = if square > 0.0 { both / square } else { 0.0 };
    let fit = |&pixel: &f32| (to + gain * (f64::from(pixel) - from)) as f32;
    Image::new(image.side(), image.pixels().iter().map(fit).collect())
}

/// Compares an image with the full image: PSNR with the full image's range of values as the peak,
/// and correlation. `fitted`: after the gain and offset of least squares.
fn judged(full: &Image, image: &Image, fitted: bool) -> Result<(f64, f64), metrics::MetricError> {
    let fit = fitted.then(|| fitted_to(full, image));
    let image = fit.as_ref().unwrap_or(image);
    let side = full.side().pixels();
    let (low, high) = full
        .pixels()
        .iter()
        .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)));
    let range = f64::from(high) - f64::from(low);
    Ok((
        metrics::psnr(full.pixels(), image.pixels(), side, side, range)?,
        metrics::correlation(full.pixels(), image.pixels(), side, side)?,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_recon::{Rows, Side, fwht};

    const METHODS: [&str; 2] = ["hadamard", "tikhonov, dct"];

    /// Measurements of a disc, all rows of a 16 x 16 Hadamard matrix.
    fn disc() -> Measurements {
        let side = Side::new(16).unwrap();
        let lit = |p: usize| ((p / 16) as f64 - 6.0).hypot((p % 16) as f64 - 9.0) < 4.5;
        let mut seen: Vec<f64> = (0..256).map(|p| if lit(p) { 0.9 } else { 0.1 }).collect();
        fwht(&mut seen).unwrap();
        Measurements::from_differential(&Rows::natural(side), &seen).unwrap()
    }

    fn study(shares: &[f64]) -> Study {
        let orders = vec![(RECORDED.to_owned(), None), ("zig-zag".to_owned(), Some(Order::ZigZag))];
        let mut study = Study::new(orders, shares.to_vec()).unwrap();
        study.methods.retain(|candidate| METHODS.contains(&candidate.name.as_str()));
        study
    }

    #[test]
    fn more_patterns_give_a_better_image_and_low_frequencies_first_the_best() {
        let done = std::cell::Cell::new(0);
        let study = study(&[0.25, 0.75]);
        let report = study.run("disc".into(), &disc(), None, &|| done.set(done.get() + 1)).unwrap();
        assert_eq!((done.get(), report.rows.len()), (study.images(), 8));
        let psnr = |sampling: f64, order: &str, method: &str| {
            let sought =
                |r: &&Row| r.sampling == sampling && r.order == order && r.method == method;
            report.rows.iter().find(sought).unwrap().psnr_db
        };
        let zero = |share, order| psnr(share, order, "hadamard");
        assert!(zero(0.75, "zig-zag") > zero(0.25, "zig-zag"));
        assert!(zero(0.25, "zig-zag") > zero(0.25, RECORDED));
        assert!(psnr(0.25, "zig-zag", "tikhonov, dct") > zero(0.25, "zig-zag"));
        let tables = study.tables(&report);
        assert!(tables.contains("| method | recorded | zig-zag |"), "{tables}");
        // At each share, the best method of each order is bold.
        assert!(tables.matches("**").count() >= 2 * 2 * 2, "{tables}");
    }

    #[test]
    fn the_picture_has_a_panel_for_each_order_with_lines_that_differ() {
        let study = study(&[0.25, 0.75]);
        let report = study.run("disc".into(), &disc(), None, &|| {}).unwrap();
        let charts = plot::charts(&report, &study.order_names(), &study.method_names());
        assert_eq!(charts.len(), 2);
        for chart in &charts {
            assert_eq!(crate::looks(chart), 2, "{chart:?}");
            let gains = &chart.lines[0].points;
            assert_eq!(gains.len(), 2);
            let row = |row: &&Row| row.order == chart.header && row.method == "tikhonov, dct";
            let row = report.rows.iter().find(row).unwrap();
            assert_eq!(gains[0], (25.0, row.gain_db.unwrap()));
        }
        // The image of the best method is kept beside zero filling's. Rows that only repeat each other, as
        // the first ones in recorded order do, support no prediction: the images are then the same.
        for shown in &report.shown {
            let gain_db = shown.best_gain_db();
            // Below this a gain is rounding.
            let least = if shown.order == RECORDED { -1e-9 } else { 1e-9 };
            assert!(
                shown.best.len() == 1 && gain_db > least,
                "{} {}: {gain_db}",
                shown.order,
                shown.sampling
            );
        }
        let figures = study.figures(&report);
        let names: Vec<&str> = figures.iter().map(|(name, _)| *name).collect();
        assert_eq!(names, ["sampling", "sampling_images"]);
        assert_eq!(figures[0].1.charts().len(), 2);
    }

    #[test]
    fn many_methods_have_looks_of_their_own() {
        let mut report = Report::empty("many".into(), 16);
        let methods: Vec<String> = std::iter::once(ZERO_FILLING.to_owned())
            .chain((0..14).map(|m| format!("m{m}")))
            .collect();
        let orders: Vec<String> = (0..7).map(|order| format!("o{order}")).collect();
        for (o, order) in orders.iter().enumerate() {
            for (m, method) in methods.iter().enumerate() {
                let gain_db = if m == 0 { 0.0 } else { 1.0 + ((m + 2 * o) % 14) as f64 };
                let (order, method) = (order.clone(), method.clone());
                let (sampling, correlation, psnr_db) = (0.5, 1.0, 10.0 + gain_db);
                let gain_db = Some(gain_db);
                report.rows.push(Row { sampling, order, method, psnr_db, gain_db, correlation });
            }
        }
        let charts = plot::charts(&report, &orders, &methods);
        // Orders are compared on one axis.
        assert!(charts.iter().all(|chart| chart.y == charts[0].y && chart.x == charts[0].x));
        let mut looks = std::collections::BTreeMap::new();
        for chart in &charts {
            assert_eq!(crate::looks(chart), chart.lines.len());
            for line in &chart.lines {
                assert_eq!(*looks.entry(line.name.clone()).or_insert(line.look()), line.look());
            }
        }
        let distinct: std::collections::BTreeSet<_> = looks.values().collect();
        assert_eq!(distinct.len(), looks.len(), "{looks:?}");
    }

    /// A disc with noise.
    fn noisy(sigma: f64, seed: u64) -> Measurements {
        use rand::{RngExt, SeedableRng};
        let mut random = rand_pcg::Pcg64::seed_from_u64(seed);
        let all = disc();
        let mut draw = || sigma * random.sample::<f64, _>(rand_distr::StandardNormal);
        let values: Vec<f64> = all.values().iter().map(|v| v + draw()).collect();
        Measurements::from_differential(all.rows(), &values).unwrap()
    }

    #[test]
    fn an_independent_measurement_does_not_reward_noise_that_is_kept() {
        let study = study(&[1.0]);
        let (one, other) = (noisy(4.0, 1), noisy(4.0, 2));
        let correlation = |report: &Report, method: &str| {
            let row = |row: &&Row| row.method == method && row.order == RECORDED;
            report.rows.iter().find(row).unwrap().correlation
        };
        let by_itself = study.run("a".into(), &one, None, &|| {}).unwrap();
        assert_eq!(by_itself.judged_by, JudgedBy::SameReadings);
        assert!(correlation(&by_itself, "hadamard") > 0.9999);
        assert!(correlation(&by_itself, "tikhonov, dct") < 0.99);
        let judge = Some((&other, JudgedBy::OtherMeasurement));
        let by_other = study.run("a".into(), &one, judge, &|| {}).unwrap();
        assert_eq!(by_other.judged_by, JudgedBy::OtherMeasurement);
        assert!(
            correlation(&by_other, "hadamard") + 0.01 < correlation(&by_other, "tikhonov, dct")
        );
        // Another exposure has another gain.
        let bright: Vec<f64> = other.values().iter().map(|v| 3.0 * v).collect();
        let bright = Measurements::from_differential(other.rows(), &bright).unwrap();
        let judge = Some((&bright, JudgedBy::OtherMeasurement));
        let by_bright = study.run("a".into(), &one, judge, &|| {}).unwrap();
        for (a, b) in by_bright.rows.iter().zip(&by_other.rows) {
            assert!((a.psnr_db - b.psnr_db).abs() < 1e-2, "{a:?} {b:?}");
        }
    }

    #[test]
    fn measurements_of_two_scenes_are_refused() {
        let stripes: Vec<f64> = (0..256).map(|p| f64::from(u8::from(p % 2 == 0))).collect();
        let mut d = stripes;
        fwht(&mut d).unwrap();
        let rows = Rows::natural(Side::new(16).unwrap());
        let other = Measurements::from_differential(&rows, &d).unwrap();
        let judge = Some((&other, JudgedBy::OtherMeasurement));
        let error = study(&[0.5]).run("a".into(), &disc(), judge, &|| {}).unwrap_err().to_string();
        assert!(error.contains("do not show the same scene"), "{error}");
        let small =
            Measurements::from_differential(&Rows::natural(Side::new(8).unwrap()), &[1.0; 64])
                .unwrap();
        let judge = Some((&small, JudgedBy::OtherMeasurement));
        let error = study(&[0.5]).run("a".into(), &disc(), judge, &|| {}).unwrap_err().to_string();
        assert!(error.contains("16 x 16 and 8 x 8"), "{error}");
    }

    #[test]
    fn a_share_out_of_range_is_named() {
        for (share, told) in [(0.0, "0"), (1.5, "1.5"), (f64::NAN, "NaN")] {
            let error = Study::new(Vec::new(), vec![0.5, share]).err().unwrap();
            let expected = format!("sampling is {told}, expected more than 0, at most 1");
            assert_eq!(error.to_string(), expected);
        }
    }
}

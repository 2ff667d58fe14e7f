//! The quality of images of a part of the patterns, by order, basis and method, compared with the
//! image of all patterns.

mod plot;

use crate::error::{EvalError, Result};
use nirspi_recon::reconstruct::{
    self, Method, MethodSettings, Reconstruct, ReconstructError, Setting, Sparsity,
};
use nirspi_recon::{Basis, Image, Measurements, NamedOrder, Order, metrics};
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;

/// The name of the order of the measurements.
pub const RECORDED: &str = "recorded";

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
    for &method in Method::ALL {
        if !method.takes(Setting::Basis) {
            add(method.to_string(), method, MethodSettings::default())?;
            continue;
        }
        for basis in Basis::ALL {
            let settings = MethodSettings { basis, ..MethodSettings::default() };
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
    /// PSNR against the image of all patterns, whose range of values is the peak.
    pub psnr_db: f64,
    /// Pearson's correlation with the image of all patterns.
    pub correlation: f64,
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
    /// Each share, order and method.
    pub rows: Vec<Row>,
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

    /// Makes and judges every image; `done` is called after each.
    ///
    /// # Errors
    /// [`EvalError::PartialSweep`] for fewer than 99 % of the patterns; other errors for an order
    /// that is not a permutation, or measurements that a method cannot invert.
    pub fn run(&self, input: PathBuf, all: &Measurements, done: &dyn Fn()) -> Result<Report> {
        let (found, expected) = (all.rows().len(), all.side().area());
        // The reference remains usable without a few patterns that dropped out or were not read.
        if found * 100 < expected * 99 {
            return Err(EvalError::PartialSweep { found, expected });
        }
        let full = reconstruct::hadamard(all);
        let mut rows = Vec::with_capacity(self.images());
        for &sampling in &self.shares {
            for (name, order) in &self.orders {
                let part = all.take(order.as_ref(), sampling)?;
                for candidate in &self.methods {
                    let image = candidate.method.reconstruct(&part)?.image;
                    rows.push(judge(&full, &image, sampling, name, &candidate.name)?);
                    done();
                }
            }
        }
        let n = full.side().pixels();
        Ok(Report { input, n, measurements: all.rows().len(), rows })
    }

    /// PSNR as Markdown tables, one for each share: methods down, orders across, the best of each
    /// order in bold.
    #[must_use]
    pub fn tables(&self, report: &Report) -> String {
        table(report, &self.order_names(), &self.method_names(), &self.shares)
    }

    /// PSNR over the share for each method in the best order, as an SVG picture.
    #[must_use]
    pub fn plot(&self, report: &Report) -> String {
        let orders = self.order_names();
        let best = best_order(report, &orders);
        plot::draw(&curves(report, best, &self.method_names()), best)
    }

    fn order_names(&self) -> Vec<String> {
        self.orders.iter().map(|(name, _)| name.clone()).collect()
    }

    fn method_names(&self) -> Vec<String> {
        self.methods.iter().map(|candidate| candidate.name.clone()).collect()
    }
}

/// Compares an image with the full image: PSNR with the full image's range of values as the peak,
/// without a fit.
fn judge(
    full: &Image,
    image: &Image,
    sampling: f64,
    order: &str,
    method: &str,
) -> Result<Row, metrics::MetricError> {
    let side = full.side().pixels();
    let (low, high) = full
        .pixels()
        .iter()
        .fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), &p| (low.min(p), high.max(p)));
    let range = f64::from(high) - f64::from(low);
    Ok(Row {
        sampling,
        order: order.to_owned(),
        method: method.to_owned(),
        psnr_db: metrics::psnr(full.pixels(), image.pixels(), side, side, range)?,
        correlation: metrics::correlation(full.pixels(), image.pixels(), side, side)?,
    })
}

/// A table of PSNR for each share: methods down, orders across, the best of each order in bold.
fn table(report: &Report, orders: &[String], methods: &[String], shares: &[f64]) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    for &share in shares {
        let _ = writeln!(
            text,
            "PSNR in dB against the image of all patterns, {:.0} % sampling\n",
            100.0 * share
        );
        let _ = writeln!(text, "| method | {} |", orders.join(" | "));
        let _ = writeln!(text, "|---|{}", "---|".repeat(orders.len()));
        let at = |order: &str, method: &str| {
            let sought =
                |row: &&Row| row.sampling == share && row.order == order && row.method == method;
            report.rows.iter().find(sought).map_or(f64::NAN, |row| row.psnr_db)
        };
        for method in methods {
            let _ = write!(text, "| {method} |");
            for order in orders {
                let best = methods.iter().map(|m| at(order, m)).fold(f64::NEG_INFINITY, f64::max);
                let found = at(order, method);
                let mark = if found == best { "**" } else { "" };
                let _ = write!(text, " {mark}{found:.2}{mark} |");
            }
            text.push('\n');
        }
        text.push('\n');
    }
    text
}

/// The order whose best method is best over all shares.
fn best_order<'a>(report: &Report, orders: &'a [String]) -> &'a str {
    let merit = |order: &str| {
        let of_order = report.rows.iter().filter(|row| row.order == order);
        let mut best = std::collections::BTreeMap::new();
        for row in of_order {
            let entry = best.entry(row.sampling.to_bits()).or_insert(row.psnr_db);
            *entry = row.psnr_db.max(*entry);
        }
        best.values().filter(|psnr| psnr.is_finite()).sum::<f64>()
    };
    let better = |a: &&String, b: &&String| merit(a).total_cmp(&merit(b));
    orders.iter().max_by(better).map_or("", String::as_str)
}

/// PSNR over share for each method, in one order.
fn curves(report: &Report, order: &str, methods: &[String]) -> Vec<plot::Curve> {
    methods
        .iter()
        .map(|method| {
            let points = report
                .rows
                .iter()
                .filter(|row| row.order == order && row.method == *method)
                .filter(|row| row.psnr_db.is_finite())
                .map(|row| (row.sampling, row.psnr_db))
                .collect();
            plot::Curve { name: method.clone(), points }
        })
        .collect()
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
        let report = study.run("disc".into(), &disc(), &|| done.set(done.get() + 1)).unwrap();
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
        assert!(study.plot(&report).contains("order zig-zag"));
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

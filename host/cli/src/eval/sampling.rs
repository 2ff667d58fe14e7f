//! `nirspi eval sampling`: what part of the patterns gives what quality, by every order, basis and method.

mod plot;

use crate::Usage;
use crate::camera::parse_order;
use crate::print;
use crate::report::to_json;
use crate::source::SourceArgs;
use anyhow::{Context, Result};
use indicatif::ProgressBar;
use nirspi::files::output::OutputDir;
use nirspi_recon::reconstruct::{
    self, OmpSettings, Penalty, ReconstructError, RegularisedSettings,
};
use nirspi_recon::{Basis, Image, Measurements, Order, metrics};
use serde::Serialize;
use std::fmt::Write;
use std::path::PathBuf;
use std::process::ExitCode;

/// Compare orders, bases and methods at partial sampling, on measurements of a full sweep
///
/// The image of all patterns is the reference. Writes sampling.md (tables), sampling.json (every number) and
/// sampling.svg (a plot for the best order).
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n\
    \x20 nirspi eval sampling wing.npz --out sampling/")]
pub struct Args {
    #[command(flatten)]
    source: SourceArgs,
    /// Shares of the patterns
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_values_t = [0.1, 0.2, 0.3, 0.5])]
    sampling: Vec<f64>,
    /// Orders: `recorded`, or an order's name
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_values_t = ORDERS.map(str::to_owned))]
    orders: Vec<String>,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "sampling")]
    out: PathBuf,
    /// Print the numbers as JSON
    #[arg(long)]
    json: bool,
}

const ORDERS: [&str; 8] = [
    "recorded",
    "zig-zag",
    "cake-cutting",
    "russian-dolls",
    "total-variation",
    "sequency",
    "natural",
    "random:1",
];

/// A method, with its basis where it has one.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Method {
    ZeroFilling,
    Omp(Basis),
    AsPrinted(Basis),
    Penalty(Penalty, Basis),
}

impl Method {
    fn all() -> Vec<Self> {
        let mut all = vec![Self::ZeroFilling];
        all.extend(Basis::ALL.map(Self::Omp));
        all.extend(Basis::ALL.map(|basis| Self::Penalty(Penalty::Tikhonov, basis)));
        all.extend(Basis::ALL.map(|basis| Self::Penalty(Penalty::Sparse, basis)));
        all.push(Self::Penalty(Penalty::TotalVariation, Basis::Pixel));
        all.push(Self::AsPrinted(Basis::Dct));
        all
    }

    fn name(self) -> String {
        match self {
            Self::ZeroFilling => "hadamard".to_owned(),
            Self::Omp(basis) => format!("omp, {basis}"),
            Self::AsPrinted(basis) => format!("as printed, {basis}, k = {PRINTED_SPARSITY}"),
            Self::Penalty(Penalty::Tikhonov, basis) => format!("tikhonov, {basis}"),
            Self::Penalty(Penalty::Sparse, basis) => format!("fista, {basis}"),
            Self::Penalty(Penalty::TotalVariation, _) => "tv".to_owned(),
        }
    }

    fn image(self, part: &Measurements) -> Result<Image, ReconstructError> {
        let omp = |settings: &OmpSettings| Ok(reconstruct::omp(part, settings)?.image);
        match self {
            Self::ZeroFilling => Ok(reconstruct::hadamard(part)),
            Self::Omp(basis) => omp(&OmpSettings { basis, ..OmpSettings::default() }),
            Self::AsPrinted(basis) => omp(&OmpSettings::as_printed(basis, PRINTED_SPARSITY)),
            Self::Penalty(penalty, basis) => {
                let settings = RegularisedSettings { basis, ..RegularisedSettings::new(penalty) };
                Ok(reconstruct::regularised(part, &settings)?.image)
            }
        }
    }
}

/// Atoms of the printed algorithm.
const PRINTED_SPARSITY: usize = 100;

#[derive(Debug, Serialize)]
struct Row {
    sampling: f64,
    order: String,
    method: String,
    psnr_db: f64,
    correlation: f64,
}

#[derive(Debug, Serialize)]
struct Report {
    input: PathBuf,
    n: usize,
    measurements: usize,
    rows: Vec<Row>,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let orders: Vec<(String, Option<Order>)> = args
        .orders
        .iter()
        .map(|name| {
            let order = (name != "recorded").then(|| parse_order(name)).transpose()?;
            Ok((name.clone(), order))
        })
        .collect::<Result<_>>()?;
    if let Some(found) = args.sampling.iter().find(|share| !(**share > 0.0 && **share <= 1.0)) {
        let text = format!("--sampling is {found}, expected more than 0, at most 1");
        return Err(Usage(text).into());
    }
    let all = args.source.load()?.measurements;
    let full = reconstruct::hadamard(&all);
    let methods = Method::all();
    let steps = orders.len() * args.sampling.len() * methods.len();
    let progress = ProgressBar::new(steps as u64);
    let mut rows = Vec::with_capacity(steps);
    let named = || args.source.input.display().to_string();
    for &sampling in &args.sampling {
        for (name, order) in &orders {
            let part = all.take(order.as_ref(), sampling).with_context(named)?;
            for &method in &methods {
                let image = method.image(&part).with_context(named)?;
                rows.push(judge(&full, &image, sampling, name, method).with_context(named)?);
                progress.inc(1);
            }
        }
    }
    progress.finish_and_clear();
    let report = Report {
        input: args.source.input.clone(),
        n: full.side().pixels(),
        measurements: all.rows().len(),
        rows,
    };
    let names: Vec<String> = methods.iter().map(|method| method.name()).collect();
    let table = table(&report, &args.orders, &names, &args.sampling);
    let mut out = OutputDir::create(&args.out)?;
    out.write("sampling.md", table.as_bytes())?;
    out.write("sampling.json", to_json(&report)?.as_bytes())?;
    let best = best_order(&report, &args.orders);
    out.write("sampling.svg", plot::draw(&curves(&report, best, &names), best).as_bytes())?;
    out.commit()?;
    if args.json {
        print::json(&report)?;
    } else {
        print::line(table.trim_end())?;
        let folder = args.out.display();
        print::line(format_args!("wrote sampling.md, sampling.json and sampling.svg to {folder}"))?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Against the full image: PSNR with its own range of values for a peak, no fit.
fn judge(
    full: &Image,
    image: &Image,
    sampling: f64,
    order: &str,
    method: Method,
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
        method: method.name(),
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
            let wanted =
                |row: &&Row| row.sampling == share && row.order == order && row.method == method;
            report.rows.iter().find(wanted).map_or(f64::NAN, |row| row.psnr_db)
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

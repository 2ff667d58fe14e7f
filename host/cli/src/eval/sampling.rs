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
    self, Method, MethodSettings, Reconstruct, ReconstructError, Setting, Sparsity,
};
use nirspi_recon::{Basis, Image, Order, metrics};
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
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_values_t = default_orders())]
    orders: Vec<String>,
    /// Folder for the results
    #[arg(long, value_name = "DIR", default_value = "sampling")]
    out: PathBuf,
    /// Print the numbers as JSON
    #[arg(long)]
    json: bool,
}

/// The recorded order, every order with a name, and a shuffle.
fn default_orders() -> Vec<String> {
    let named = Order::NAMED.iter().map(|named| named.name.to_owned());
    std::iter::once("recorded".to_owned()).chain(named).chain(["random:1".to_owned()]).collect()
}

/// A method ready to run, under the name that the tables give it.
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
    let methods = candidates()?;
    let steps = orders.len() * args.sampling.len() * methods.len();
    let progress = ProgressBar::new(steps as u64);
    let mut rows = Vec::with_capacity(steps);
    let named = || args.source.input.display().to_string();
    for &sampling in &args.sampling {
        for (name, order) in &orders {
            let part = all.take(order.as_ref(), sampling).with_context(named)?;
            for Candidate { name: method_name, method } in &methods {
                let image = method.reconstruct(&part).with_context(named)?.image;
                rows.push(judge(&full, &image, sampling, name, method_name).with_context(named)?);
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
    let names: Vec<String> = methods.into_iter().map(|candidate| candidate.name).collect();
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

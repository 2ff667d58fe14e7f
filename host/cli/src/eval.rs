//! `nirspi eval`: how good results are: the paper's tables, ours beside them, and what less sampling costs.

mod enhanced;
mod quality;
mod sampling;
mod shot;
mod table1;
mod table3;
mod table4;

use super::range;
use anyhow::Result;
use clap::{Args, Subcommand};
use serde::Serialize;
use std::process::ExitCode;

/// The paper's tables, ours beside them (ours simulated); what less sampling costs
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi eval table2\n\
    \x20 nirspi eval table3 --scenes 200 --out table3/\n\
    \x20 nirspi eval sampling wing.npz --out sampling/\n\
    \x20 nirspi eval quality --data chars74k/ --out quality/")]
pub struct EvalArgs {
    #[command(subcommand)]
    table: Table,
}

#[derive(Debug, Subcommand)]
enum Table {
    Table1(table1::Args),
    /// Range in light and heavy rain: the same as `nirspi range`
    Table2(range::Args),
    Table3(table3::Args),
    Table4(table4::Args),
    Sampling(sampling::Args),
    Quality(quality::Args),
}

pub fn run(args: &EvalArgs) -> Result<ExitCode> {
    match &args.table {
        Table::Table1(args) => table1::run(args),
        Table::Table2(args) => range::run(args),
        Table::Table3(args) => table3::run(args),
        Table::Table4(args) => table4::run(args),
        Table::Sampling(args) => sampling::run(args),
        Table::Quality(args) => quality::run(args),
    }
}

/// The paper's distances, in m (section 5).
const DISTANCES_M: [f64; 3] = [0.3, 0.6, 1.0];

/// A mean with the half width of its 95 % confidence interval.
#[derive(Debug, Clone, Copy, Serialize)]
struct Estimate {
    mean: f64,
    /// 1.96 standard errors; `null` of a single value.
    ci95: Option<f64>,
    n: usize,
}

impl Estimate {
    /// Of independent values; none of none.
    fn of(values: &[f64]) -> Option<Self> {
        let n = values.len();
        let mean = values.iter().sum::<f64>() / n as f64;
        let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        let ci95 = (n > 1).then(|| 1.96 * (squares / (n - 1) as f64 / n as f64).sqrt());
        (n > 0).then_some(Self { mean, ci95, n })
    }

    fn text(&self, digits: usize) -> String {
        match self.ci95 {
            Some(ci) => format!("{:.digits$} ± {ci:.digits$}", self.mean),
            None => format!("{:.digits$}", self.mean),
        }
    }
}

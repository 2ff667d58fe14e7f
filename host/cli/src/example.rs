//! `nirspi example`: a measurement for trying the program.

use super::report::{Overwrite, words};
use super::{Usage, print, provenance};
use anyhow::Result;
use nirspi::files::measurement;
use nirspi::files::output::{Existing, write_result};
use nirspi_virtual::example::Example;
use std::path::PathBuf;
use std::process::ExitCode;

/// Write a simulated measurement, to try the next commands on
///
/// The virtual camera makes it: n, h_row and d in a .npz file. The measurement is simulated, and the file says so: its field `simulated` is 1.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n\
    \x20 nirspi example wing --out wing.npz")]
pub struct Args {
    /// Which example
    #[arg(value_parser = words(&Example::ALL, |example| (example.name(), example.about())))]
    example: Example,
    /// File to write [default: the example's name with .npz]
    #[arg(long, value_name = "FILE.npz")]
    out: Option<PathBuf>,
    /// Seed of the simulated noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    overwrite: Overwrite,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let path = args.out.clone().unwrap_or_else(|| format!("{}.npz", args.example.name()).into());
    if path.extension().is_none_or(|extension| extension != "npz") {
        let found = path.display();
        return Err(Usage(format!("--out {found}: expected a name that ends in .npz")).into());
    }
    let existing = Existing::of(args.overwrite.overwrite, None);
    existing.check(&path)?;
    let measured = args.example.measure(args.seed)?;
    let encoded = measurement::encode(&path, &measured, &provenance::simulated())?;
    write_result(&path, existing, &encoded)?;
    let (patterns, n) = (measured.rows().len(), measured.side().pixels());
    print::line(format_args!(
        "wrote {}: {n} x {n}, {patterns} patterns, simulated",
        path.display()
    ))?;
    Ok(ExitCode::SUCCESS)
}

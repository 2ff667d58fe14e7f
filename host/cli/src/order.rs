//! `nirspi order`: the patterns of an order as files, for a DMD.

use super::camera::parse_order;
use super::report::words;
use super::{Usage, feed, print, provenance};
use anyhow::Result;
use nirspi::files::measurement::{Form, NamedPatterns};
use nirspi::patterns::{PatternSet, PatternsError, write_set};
use nirspi_recon::{Order, Side, Size};
use std::path::PathBuf;
use std::process::ExitCode;

/// Write the patterns of an order as pictures or an array, for a DMD
///
/// The command writes a picture for each pattern and each complement, 1 bit a pixel, in the order in which they are shown:
/// 00000.png, 00001.png and so on. With --npy it writes patterns.npy instead, (M, n, n / 8), 8 pixels a byte, for
/// numpy.unpackbits. Beside them are order.txt, for --shown table:order.txt, and header.json, the first line of a feed of
/// readings under these patterns (docs/feeds.md).
///
/// Of the sets fourier:3, fourier:4 and s-matrix:N (docs/own-patterns.md) it writes patterns.npy, (M, height, width), float32,
/// and header.json.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi order zig-zag --n 64 --out patterns/\n\
    \x20 nirspi order cake-cutting --n 32 --patterns 300 --scale 24 --out patterns/\n\
    \x20 nirspi order s-matrix:255 --out patterns/")]
pub struct Args {
    #[arg(value_name = "ORDER", help = order_help())]
    order: String,
    /// Side of the image: a power of two from 2 to 256
    #[arg(long, value_name = "N", default_value_t = 32)]
    n: u64,
    /// Number of patterns, the first of the order [default: all]
    #[arg(long, value_name = "M")]
    patterns: Option<usize>,
    /// How complements follow patterns: pairs, halves, or single for none
    #[arg(long, value_name = "FORM", default_value = Form::Pairs.name(),
          value_parser = words(&Form::ALL, |form| (form.name(), form.about())))]
    readings: Form,
    /// Pixels of a picture along each side of a pixel of the pattern
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=64))]
    scale: u32,
    /// Write one array, patterns.npy, instead of pictures
    #[arg(long, conflicts_with = "scale")]
    npy: bool,
    /// Folder for the files
    #[arg(long, value_name = "DIR", default_value = "patterns")]
    out: PathBuf,
}

fn order_help() -> String {
    format!("The order: {}, or table:FILE", Order::expected())
}

pub fn run(args: &Args) -> Result<ExitCode> {
    if args.order.starts_with("fourier:") || args.order.starts_with("s-matrix:") {
        return run_set(args);
    }
    let side = Side::new(args.n).map_err(|error| Usage(format!("--n: {error}")))?;
    let set = PatternSet {
        order: parse_order("ORDER", &args.order)?,
        side,
        patterns: args.patterns,
        form: args.readings,
        scale: args.scale,
        one_array: args.npy,
    };
    let written = set.write(&args.out, provenance::made()).map_err(|error| match error {
        error @ (PatternsError::Count { .. } | PatternsError::Differences) => {
            Usage(error.to_string()).into()
        }
        error => anyhow::Error::from(error),
    })?;
    let what = if args.npy { "patterns.npy" } else { "pictures" };
    print::line(format_args!(
        "wrote {} patterns and complements ({what}), order.txt and header.json to {}",
        written.shown,
        args.out.display()
    ))?;
    Ok(ExitCode::SUCCESS)
}

/// Writes a named set. Only its size can be chosen, and only that of a Fourier set.
fn run_set(args: &Args) -> Result<ExitCode> {
    let usage = |error: String| Usage(format!("{}: {error}", args.order));
    let set: NamedPatterns = args.order.parse().map_err(usage)?;
    let is_fourier = matches!(set, NamedPatterns::Fourier { .. });
    let taken = |name: &&str| feed::is_given(name) && !(is_fourier && **name == *"n");
    if let Some(other) = ["n", "patterns", "readings", "scale"].iter().find(|name| taken(name)) {
        return Err(usage(format!("--{other} does not go with this set")).into());
    }
    let n = usize::try_from(args.n).unwrap_or(usize::MAX);
    let size = Size::new(n, n).map_err(|error| Usage(format!("--n: {error}")))?;
    let written = write_set(set, is_fourier.then_some(size), &args.out)?;
    let (shown, out) = (written.shown, args.out.display());
    print::line(format_args!("wrote {shown} patterns (patterns.npy) and header.json to {out}"))?;
    Ok(ExitCode::SUCCESS)
}

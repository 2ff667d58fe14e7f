//! Arguments for the measurements to read.

use super::Usage;
use super::camera::parse_order;
use super::report::words;
use anyhow::Result;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use nirspi::files::measurement::{Form, Remedy, Selection};
use nirspi::provenance::Taken;
use nirspi::source::{Index, Part, Source, SourceError, SourceOptions};
use nirspi_recon::{Measurements, Order, Side};
use std::path::PathBuf;

/// Which measurements.
#[derive(Debug, Clone, clap::Args)]
#[command(next_help_heading = "Input")]
pub struct SourceArgs {
    /// Measurement file (.npz, .npy, .mat, .h5, .csv, .txt, .wav) or recording (.mcap)
    pub input: PathBuf,
    /// Which measurement of a file that holds several: a number from 0, or all. With all, each measurement of a file and
    /// each frame of a recording is one frame of a video; without this option, the frames of a recording are summed
    #[arg(long, value_name = "N|all")]
    pub index: Option<Index>,
    #[arg(long, value_name = "ORDER", help = shown_help())]
    pub shown: Option<String>,
    /// Side of the image in pixels, for a file that does not say its side and holds part of a sweep
    #[arg(long, value_name = "N")]
    pub side: Option<u64>,
    /// The field of the file that holds the readings, or the two fields of patterns and complements, with a comma between
    /// [default: y if the file has it, else d]. Beside it, fields that the file calls something else: volts,h_row=order,n=side;
    /// so can sign
    #[arg(long, value_name = "NAME")]
    pub field: Option<String>,
    /// How readings belong to patterns [default: pairs; differences in the field d]
    #[arg(long, value_name = "FORM", value_parser = words(&Form::ALL, |form| (form.name(), form.about())))]
    pub readings: Option<Form>,
    /// The same as --readings single
    #[arg(long, conflicts_with = "readings")]
    pub non_differential: bool,
    /// The patterns are along the first axis of the readings, not along the last axis
    #[arg(long)]
    pub patterns_first: bool,
    /// The pixels are numbered down the columns of the image, as in MATLAB
    #[arg(long)]
    pub transpose: bool,
    /// Every comma in a text file is a decimal comma
    #[arg(long)]
    pub decimal_comma: bool,
    /// Each complement comes before its pattern
    #[arg(long)]
    pub complements_first: bool,
    /// All readings have the other sign, as behind an inverting amplifier
    #[arg(long)]
    pub inverted: bool,
    /// The file lacks the first K readings of the sweep; with -K, its first K readings were taken before the sweep
    #[arg(
        long,
        value_name = "K",
        default_value_t = 0,
        allow_negative_numbers = true,
        hide_default_value = true
    )]
    pub shift: i32,
    /// The file holds K sweeps of the same patterns, one after another, and no h_row. Their mean is used
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u32).range(1..))]
    pub sweeps: Option<u32>,
    /// Divide by the lamp's level, against a lamp that drifts or flickers: pairs by the sum of pattern and complement, other
    /// readings by those of an all-on pattern that is shown again and again. Ambient light makes this correction too weak
    #[arg(long)]
    pub divide_by_lamp: bool,
    /// Which part of complex readings to show
    #[arg(long, value_name = "PART", default_value = Part::Magnitude.name(), value_parser = parts())]
    pub part: Part,
    /// Do not correct the readings of a recording for the leak from pattern to pattern
    #[arg(long)]
    pub keep_leak: bool,
    /// Do not correct the image of a recording for unequal LEDs, even if a flat field is kept for its camera
    #[arg(long)]
    pub no_flat_field: bool,
}

fn shown_help() -> String {
    format!(
        "The order in which patterns were shown, for a file without h_row: {}, or table:FILE (numbers, entry k the \
         natural-order Hadamard row shown k-th)",
        Order::expected()
    )
}

fn parts() -> impl TypedValueParser<Value = Part> {
    PossibleValuesParser::new(Part::ALL.map(Part::name)).try_map(|word| word.parse::<Part>())
}

impl SourceArgs {
    /// The selection: what the file itself does not say.
    pub fn selection(&self) -> Result<Selection> {
        let side = self.side.map(Side::new).transpose();
        let shown = self.shown.as_deref().map(|name| parse_order("--shown", name)).transpose()?;
        Ok(Selection {
            index: None,
            form: self.readings.or(self.non_differential.then_some(Form::Single)),
            field: self.field.clone(),
            patterns_first: self.patterns_first,
            side: side.map_err(|error| Usage(format!("--side: {error}")))?,
            shown,
            transpose: self.transpose,
            decimal_comma: self.decimal_comma,
            remedy: Remedy {
                complements_first: self.complements_first,
                inverted: self.inverted,
                shift: self.shift,
                sweeps: self.sweeps.unwrap_or(0),
                divide_by_lamp: self.divide_by_lamp,
            },
        })
    }

    /// How to read measurements.
    pub fn options(&self) -> Result<SourceOptions> {
        let Self { index, part, keep_leak, no_flat_field, .. } = *self;
        let file = self.selection()?;
        Ok(SourceOptions { index, file, part, keep_leak, no_flat_field })
    }

    /// Reads one measurement.
    pub fn load(&self) -> Result<Source> {
        Source::read(&self.input, &self.options()?).map_err(usage_or_failure)
    }

    /// Reads one measurement of real readings, and where they come from.
    pub fn load_real(&self) -> Result<(Measurements, Taken)> {
        let source = self.load()?;
        let taken = source.taken.clone();
        Ok((source.real(&self.input).map_err(usage_or_failure)?, taken))
    }

    /// Two halves of a recording's frames; `None` for a file that is no recording of several.
    pub fn halves(&self) -> Result<Option<[Measurements; 2]>> {
        Source::halves(&self.input, &self.options()?).map_err(usage_or_failure)
    }

    /// The requested index.
    pub fn one(&self) -> Result<Option<usize>> {
        self.options()?.one().map_err(usage_or_failure)
    }
}

/// Conflicting options count as wrong usage; every other error counts as a failure.
pub fn usage_or_failure(error: SourceError) -> anyhow::Error {
    match error {
        error if error.is_of_options() => Usage(error.to_string()).into(),
        // The command line handles these errors by their own types.
        SourceError::File(error) => error.into(),
        SourceError::Recording(error) => error.into(),
        error => error.into(),
    }
}

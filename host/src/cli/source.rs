//! Measurements from a file, ours or anybody's.

use super::Usage;
use anyhow::{Context, Result, bail};
use nirspi::account::LossCounters;
use nirspi::files::npz::{self, Readings, Selection};
use nirspi::recording::{self, Recording};
use nirspi::tally::tally_recording;
use nirspi_recon::{Dropout, Image, Measurements};
use std::io::Read;
use std::path::PathBuf;

/// Which measurements.
#[derive(Debug, clap::Args)]
pub struct SourceArgs {
    /// Measurement file or recording
    pub input: PathBuf,
    /// Which measurement of a file that holds several
    #[arg(long, value_name = "N")]
    pub index: Option<usize>,
    /// The file's `y` holds one reading a pattern, taken without complements
    #[arg(long)]
    pub non_differential: bool,
    /// Leave the settling leak of a recording as it is
    #[arg(long)]
    pub keep_leak: bool,
}

/// Measurements with what is known about where they come from.
pub struct Source {
    pub measurements: Measurements,
    pub dropouts: Vec<Dropout>,
    pub reference: Option<Image>,
    pub frames: Option<LossCounters>,
    pub notes: Vec<String>,
}

impl SourceArgs {
    /// Reads them.
    pub fn load(&self) -> Result<Source> {
        let mut magic = [0; 4];
        let is_mcap = std::fs::File::open(&self.input)
            .and_then(|mut file| file.read_exact(&mut magic))
            .is_ok_and(|()| magic[1..] == *b"MCA");
        let named_mcap = self.input.extension().is_some_and(|e| e == "mcap");
        if is_mcap || named_mcap {
            if self.index.is_some() || self.non_differential {
                let text = "--index and --non-differential belong to .npz files, not to recordings";
                return Err(Usage(text.to_owned()).into());
            }
            from_recording(self)
        } else {
            from_npz(self)
        }
    }
}

fn from_npz(args: &SourceArgs) -> Result<Source> {
    let selection = Selection { index: args.index, non_differential: args.non_differential };
    let file = npz::read(&args.input, selection)?;
    let named = || args.input.display().to_string();
    let rows = &file.h_row;
    let mut notes = file.notes;
    let (measurements, dropouts) = match &file.readings {
        Readings::Pairs(y) => Measurements::from_pairs(file.side, rows, y).with_context(named)?,
        Readings::Differential(d) => {
            (Measurements::from_differential(file.side, rows, d).with_context(named)?, Vec::new())
        }
        Readings::Single(y) => {
            let mut measurements =
                Measurements::from_single(file.side, rows, y).with_context(named)?;
            if let Some(level) = measurements.remove_dark_level() {
                notes.push(format!("a dark level of {level:.4} was found in `y` and removed"));
            }
            (measurements, Vec::new())
        }
    };
    Ok(Source { measurements, dropouts, reference: file.reference, frames: None, notes })
}

/// Sums the frames of a recording, counting again what became of each.
fn from_recording(args: &SourceArgs) -> Result<Source> {
    let path = &args.input;
    // The setup stands at the start of the file; packets are summed in a second pass.
    let Recording { setup, settling, cut_short, account, .. } = recording::read(path, |_, _| {})?;
    let (integrated, counters) = tally_recording(path, &setup)?;
    if integrated.frames() == 0 {
        bail!("{}: no intact frame in the recording, expected at least one", path.display());
    }
    let mut notes: Vec<String> = integrated.warnings().into_iter().map(str::to_owned).collect();
    if let Some(reason) = cut_short {
        notes.push(format!("the recording is cut short or damaged: {reason}"));
    }
    if account.is_some_and(|account| account != counters) {
        notes.push("the frames found are not those that the capture counted".to_owned());
    }
    if settling.is_none() {
        notes.push("no calibration in the recording: the settling leak stays".to_owned());
    }
    let measurements = integrated
        .measurements(&setup, settling.as_ref(), args.keep_leak)
        .with_context(|| path.display().to_string())?;
    Ok(Source {
        measurements,
        dropouts: Vec::new(),
        reference: None,
        frames: Some(counters),
        notes,
    })
}

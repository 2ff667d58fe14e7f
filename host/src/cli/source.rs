//! Measurements from a file, ours or anybody's.

use super::Usage;
use anyhow::{Context, Result, bail};
use nirspi::account::LossCounters;
use nirspi::files::npz::{self, MeasurementFile, Readings, Selection};
use nirspi::integrate::Integrated;
use nirspi::recording::{End, Recording};
use nirspi::tally::{self, tally_recording};
use nirspi_recon::{Dropout, Image, Measurements};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Which measurements.
#[derive(Debug, clap::Args)]
pub struct SourceArgs {
    /// Measurement file or recording
    pub input: PathBuf,
    /// Which measurement of a file that holds several: a number, or all of them, as frames of a video; all frames of a
    /// recording likewise, which are summed otherwise
    #[arg(long, value_name = "N|all")]
    pub index: Option<Index>,
    /// The file's `y` holds one reading a pattern, taken without complements
    #[arg(long)]
    pub non_differential: bool,
    /// Leave the settling leak of a recording as it is
    #[arg(long)]
    pub keep_leak: bool,
}

/// A measurement of several.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Index {
    /// This one.
    One(usize),
    /// Each.
    All,
}

impl FromStr for Index {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "all" => Ok(Self::All),
            _ => text.parse().map(Self::One).map_err(|_| "expected a number or all".to_owned()),
        }
    }
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
    /// Reads one.
    pub fn load(&self) -> Result<Source> {
        let index = self.one()?;
        if self.is_recording()? {
            return from_recording(self);
        }
        let non_differential = self.non_differential;
        from_npz(self, npz::read(&self.input, Selection { index, non_differential })?)
    }

    /// Reads all of a file or recording.
    pub fn load_all(&self) -> Result<Vec<Source>> {
        if self.is_recording()? {
            return frames_of_recording(self);
        }
        let files = npz::read_all(&self.input, self.non_differential)?;
        files.into_iter().map(|file| from_npz(self, file)).collect()
    }

    /// The one that is asked for.
    pub fn one(&self) -> Result<Option<usize>> {
        match self.index {
            None => Ok(None),
            Some(Index::One(index)) => Ok(Some(index)),
            Some(Index::All) => {
                Err(Usage("--index all, expected one measurement here".to_owned()).into())
            }
        }
    }

    fn is_recording(&self) -> Result<bool> {
        let mut magic = [0; 4];
        let is_mcap = std::fs::File::open(&self.input)
            .and_then(|mut file| file.read_exact(&mut magic))
            .is_ok_and(|()| magic[1..] == *b"MCA");
        let named_mcap = self.input.extension().is_some_and(|e| e == "mcap");
        let one = matches!(self.index, Some(Index::One(_)));
        if (is_mcap || named_mcap) && (one || self.non_differential) {
            let text = "--index N and --non-differential belong to .npz files, not to recordings";
            return Err(Usage(text.to_owned()).into());
        }
        Ok(is_mcap || named_mcap)
    }
}

fn from_npz(args: &SourceArgs, file: MeasurementFile) -> Result<Source> {
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
    let mut recording = Recording::open(&args.input)?;
    let (integrated, counters) = tally_recording(&mut recording)?;
    if integrated.frames() == 0 {
        return no_frame(&args.input);
    }
    of_frames(args, &recording, &integrated, counters)
}

fn frames_of_recording(args: &SourceArgs) -> Result<Vec<Source>> {
    let mut recording = Recording::open(&args.input)?;
    let (frames, counters) = tally::frames_of_recording(&mut recording)?;
    if frames.is_empty() {
        return no_frame(&args.input);
    }
    frames.iter().map(|frame| of_frames(args, &recording, frame, counters)).collect()
}

fn no_frame<T>(path: &Path) -> Result<T> {
    bail!("{}: no intact frame in the recording, expected at least one", path.display())
}

/// What the sum of some frames says.
fn of_frames(
    args: &SourceArgs,
    recording: &Recording,
    integrated: &Integrated,
    counters: LossCounters,
) -> Result<Source> {
    let Recording { setup, settling, .. } = recording;
    let End { cut_short, account, .. } = recording.end();
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
        .measurements(setup, settling.as_ref(), args.keep_leak)
        .with_context(|| args.input.display().to_string())?;
    let (dropouts, frames) = (Vec::new(), Some(counters));
    Ok(Source { measurements, dropouts, reference: None, frames, notes })
}

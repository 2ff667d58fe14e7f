//! Reads the frames of a recording as measurements: their sum, or each of them.

use super::several::fits_together;
use super::{NOT_CALIBRATED, Source, SourceError, SourceOptions, not_whole};
use crate::calibration::KeptFlatField;
use crate::causes;
use crate::integrate::Integrated;
use crate::moving::followed;
use crate::provenance::Taken;
use crate::recording::{self, End, Recording, tally_recording};
use crate::tally::Tally;
use rayon::prelude::*;
use std::path::Path;

/// Sums the frames of a recording, and makes their account again.
pub(super) fn from_recording(path: &Path, options: &SourceOptions) -> Result<Source, SourceError> {
    let mut recording = Recording::open(path)?;
    let tally = tally_recording(&mut recording)?;
    of_sum(path, options, &recording, &tally)
}

/// The measurements of the sum of all frames.
pub(crate) fn of_sum(
    path: &Path,
    options: &SourceOptions,
    recording: &Recording,
    tally: &Tally,
) -> Result<Source, SourceError> {
    match tally.integrated() {
        integrated if integrated.frames() > 0 => {
            let flat_field = flat_field(options, recording);
            let integrated = integrated.clone().of_run(&tally.known());
            of_frames(path, options, recording, &integrated, tally, &flat_field)
        }
        _ => Err(no_frame(path, tally)),
    }
}

/// Why a recording has no valid frame.
fn no_frame(path: &Path, tally: &Tally) -> SourceError {
    let path = path.to_owned();
    match tally.misfit() {
        Some(misfit) => SourceError::Misfit { path, misfit },
        None => SourceError::NoFrame(path),
    }
}

pub(super) fn frames_of_recording(
    path: &Path,
    options: &SourceOptions,
) -> Result<Vec<Source>, SourceError> {
    let mut recording = Recording::open(path)?;
    let (rows, area) = (recording.setup.rows.len(), recording.setup.rows.side());
    let fits = |count| fits_together(path, count, rows, area);
    let (frames, tally) = recording::frames_of_recording(&mut recording, fits)?;
    if frames.is_empty() {
        return Err(no_frame(path, &tally));
    }
    let flat_field = flat_field(options, &recording);
    let source = |frame| of_frames(path, options, &recording, frame, &tally, &flat_field);
    frames.par_iter().map(source).collect()
}

/// The flat field that is kept for the camera, or why it cannot be read; `None` if none is wanted.
type FlatFieldRead = Option<Result<Option<KeptFlatField>, String>>;

fn flat_field(options: &SourceOptions, recording: &Recording) -> FlatFieldRead {
    let read = || KeptFlatField::of(&recording.identity).map_err(|e| causes::in_one_line(&e));
    (!options.no_flat_field).then(read)
}

/// The measurements of the sum of some frames.
fn of_frames(
    path: &Path,
    options: &SourceOptions,
    recording: &Recording,
    integrated: &Integrated,
    tally: &Tally,
    flat_field: &FlatFieldRead,
) -> Result<Source, SourceError> {
    let counters = tally.account().counters();
    let Recording { setup, settling, .. } = recording;
    let End { cut_short, account, .. } = recording.end();
    let (measurements, mut notes) =
        followed(integrated, setup, settling.as_ref(), options.keep_leak)
            .map_err(|problem| SourceError::Integrate { path: path.to_owned(), problem })?;
    let mut lacks = Vec::new();
    lacks.extend(cut_short.as_ref().map(|reason| format!("cut short or damaged: {reason}")));
    if let Some(account) = account {
        if account.counters != counters {
            lacks.push(format!("the capture had {}", account.counters));
        }
        lacks.extend(account.missing.clone());
    }
    lacks.extend(tally.misfit().map(|misfit| format!("some frames are left out: {misfit}")));
    if settling.is_none() {
        notes.push(NOT_CALIBRATED.to_owned());
    }
    let read = super::of_frames(measurements)
        .map_err(|problem| SourceError::Measurements { path: path.to_owned(), problem })?;
    let (dropouts, not_read, frames) = (Vec::new(), Vec::new(), Some(counters));
    let (imaginary, reference) = (None, None);
    let source = Source {
        measurements: read.measurements,
        imaginary,
        dropouts,
        outliers: read.outliers,
        not_read,
        reference,
        frames,
        taken: Taken::by(&recording.identity).from_file(path),
        damage: (!lacks.is_empty()).then(|| not_whole(counters, &lacks)),
        warnings: read.doubts.iter().map(ToString::to_string).collect(),
        notes,
        lamp: None,
        flat_field: None,
    };
    Ok(match flat_field {
        None | Some(Ok(None)) => source,
        Some(Ok(Some(kept))) => source.with_flat_field(kept.clone()),
        Some(Err(problem)) => {
            let mut source = source;
            source.notes.push(format!("flat field not used: {problem}"));
            source
        }
    })
}

//! Reads the frames of a recording as measurements: their sum, each of them, or the sum at each detector.

use super::several::fits_together;
use super::{NOT_CALIBRATED, Source, SourceError, SourceOptions, first_of, not_whole};
use crate::account::{LossAccount, LossCounters};
use crate::calibration::KeptFlatField;
use crate::causes;
use crate::integrate::Integrated;
use crate::provenance::Taken;
use crate::recording::{End, Recording};
use crate::tally::{self, Tally, tally_recording};
use std::path::Path;

/// A flat field also corrects what the place of its detector does to the light of each LED.
const FLAT_FIELD_OF_FIRST: &str = "the flat field was measured at detector 0: it corrects unequal LEDs, and not what this detector's place does to the light";

/// Sums the frames of a recording, and makes their account again.
pub(super) fn from_recording(path: &Path, options: &SourceOptions) -> Result<Source, SourceError> {
    let mut recording = Recording::open(path)?;
    let detector = options.detector_of(path, &recording.identity)?;
    let tally = tally_recording(&mut recording)?;
    of_sum(path, options, &recording, detector, &tally)
}

/// The sum of the frames of each detector.
pub(super) fn detectors_of_recording(
    path: &Path,
    options: &SourceOptions,
) -> Result<Vec<Source>, SourceError> {
    let mut recording = Recording::open(path)?;
    let tally = tally_recording(&mut recording)?;
    (0..recording.identity.detectors.max(1))
        .map(|detector| of_sum(path, options, &recording, detector, &tally))
        .collect()
}

/// The measurements of the sum of the frames of a detector.
pub(crate) fn of_sum(
    path: &Path,
    options: &SourceOptions,
    recording: &Recording,
    detector: u8,
    tally: &Tally,
) -> Result<Source, SourceError> {
    match tally.detector(detector) {
        Some((integrated, _)) if integrated.frames() > 0 => {
            of_frames(path, options, recording, (detector, integrated), tally)
        }
        _ => Err(no_frame(path, detector, tally)),
    }
}

/// Why a recording has no valid frame.
fn no_frame(path: &Path, detector: u8, tally: &Tally) -> SourceError {
    let path = path.to_owned();
    match tally.misfit() {
        Some(misfit) => SourceError::Misfit { path, misfit },
        None if detector > 0 => SourceError::NoFrameOf { path, detector },
        None => SourceError::NoFrame(path),
    }
}

pub(super) fn frames_of_recording(
    path: &Path,
    options: &SourceOptions,
) -> Result<Vec<Source>, SourceError> {
    let mut recording = Recording::open(path)?;
    let detector = options.detector_of(path, &recording.identity)?;
    let (rows, area) = (recording.setup.rows.len(), recording.setup.rows.side());
    let fits = |count| fits_together(path, count, rows, area);
    let (frames, tally) = tally::frames_of_recording(&mut recording, detector, fits)?;
    if frames.is_empty() {
        return Err(no_frame(path, detector, &tally));
    }
    let frames = frames.iter().map(|frame| (detector, frame));
    frames.map(|frame| of_frames(path, options, &recording, frame, &tally)).collect()
}

/// The measurements of the sum of some frames of a detector.
fn of_frames(
    path: &Path,
    options: &SourceOptions,
    recording: &Recording,
    (detector, integrated): (u8, &Integrated),
    tally: &Tally,
) -> Result<Source, SourceError> {
    let of_detector = tally.detector(detector).map(|(_, account)| account);
    let counters = of_detector.map_or_else(LossCounters::default, LossAccount::counters);
    let Recording { setup, settling, .. } = recording;
    let End { cut_short, account, .. } = recording.end();
    let mut notes: Vec<String> = integrated.warnings().into_iter().map(str::to_owned).collect();
    if let Some(reason) = cut_short {
        notes.push(format!("the recording is cut short or damaged: {reason}"));
    }
    if let Some(account) = account {
        let kept = usize::from(detector).checked_sub(1).map(|at| account.further.get(at));
        if kept.unwrap_or(Some(&account.counters)) != Some(&counters) {
            notes.push("the frames found are not those that the capture counted".to_owned());
        }
        notes.extend(account.missing.as_deref().map(not_whole));
    }
    notes.extend(tally.misfit().map(|misfit| format!("some frames are left out: {misfit}")));
    if settling.is_none() {
        notes.push(NOT_CALIBRATED.to_owned());
    }
    if options.detector.is_none() {
        notes.extend(first_of(1 + tally.further().len()));
    }
    let measurements = integrated
        .measurements_of(detector, setup, settling.as_ref(), options.keep_leak)
        .map_err(|problem| SourceError::Integrate { path: path.to_owned(), problem })?;
    let read = super::of_frames(measurements)
        .map_err(|problem| SourceError::Measurements { path: path.to_owned(), problem })?;
    let (dropouts, not_read, frames) = (Vec::new(), Vec::new(), Some(counters));
    let (imaginary, reference, flat_field) = (None, None, None);
    let source = Source {
        measurements: read.measurements,
        imaginary,
        dropouts,
        outliers: read.outliers,
        not_read,
        reference,
        frames,
        taken: Taken::by(&recording.identity).from_file(path),
        warnings: read.doubts.iter().map(ToString::to_string).collect(),
        notes,
        flat_field,
    };
    if options.no_flat_field {
        return Ok(source);
    }
    Ok(match KeptFlatField::of(&recording.identity) {
        Ok(Some(kept)) => {
            let mut source = source.with_flat_field(kept);
            if detector > 0 {
                source.notes.push(FLAT_FIELD_OF_FIRST.to_owned());
            }
            source
        }
        Ok(None) => source,
        Err(problem) => {
            let mut source = source;
            source.notes.push(format!("flat field not used: {}", causes::in_one_line(&problem)));
            source
        }
    })
}

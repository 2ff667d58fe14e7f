//! The readings of all detectors of a camera, for arrays with an axis of detectors.

use super::{ExportError, Whole, alone, number_of};
use crate::files::FileError;
use crate::files::npy::{Element, header};
use crate::recording::Recording;
use crate::tally::{hear_recording, tally_recording};
use std::io::Write;
use std::path::Path;

/// Number of detectors of the recorded camera.
pub(super) fn number(whole: &Whole) -> usize {
    usize::from(whole.identity.detectors.max(1))
}

/// The mean of all frames of each detector, (D, M) in C order. A detector without a frame has NaN.
pub(super) fn means(whole: &Whole) -> Result<Vec<f64>, ExportError> {
    let mut recording = Recording::open(&whole.path)?;
    let tally = tally_recording(&mut recording)?;
    let mut means = Vec::new();
    for detector in 0..number(whole) as u8 {
        match tally.detector(detector) {
            Some((integrated, _)) if integrated.frames() > 0 => {
                let measurements = integrated
                    .measurements_of(
                        detector,
                        &recording.setup,
                        recording.settling.as_ref(),
                        whole.keep_leak,
                    )
                    .map_err(|problem| whole.integrate(problem))?;
                means.extend_from_slice(measurements.values());
            }
            _ => means.resize(means.len() + whole.setup.rows.len(), f64::NAN),
        }
    }
    Ok(means)
}

/// Writes the readings of each frame as one array (F, D, M). Frame f is frame f of detector 0; where a
/// further detector has no frame of its number, the readings are NaN.
pub(super) fn frames(whole: &Whole, out: &Path, to: &mut impl Write) -> Result<(), ExportError> {
    let mut write =
        |bytes: &[u8]| to.write_all(bytes).map_err(|error| FileError::io(out, "write", error));
    let (detectors, patterns) = (number(whole), whole.setup.rows.len());
    write(&header::<f64>(&[whole.frames(), detectors, patterns]))?;
    let mut recording = Recording::open(&whole.path)?;
    let (setup, settling) = (recording.setup.clone(), recording.settling.clone());
    if setup != whole.setup {
        return Err(ExportError::Changed(whole.path.clone()));
    }
    // The frame that is being collected: its number, and the readings of every detector.
    let mut open: Option<(i64, Vec<f64>)> = None;
    let mut written = 0;
    let mut finish = |readings: &[f64]| -> Result<(), ExportError> {
        let mut bytes = Vec::with_capacity(8 * readings.len());
        readings.iter().for_each(|value| value.append(&mut bytes));
        written += 1;
        Ok(write(&bytes)?)
    };
    hear_recording(&mut recording, |heard, tally| {
        let Some((detector, frame)) = heard.any_frame() else { return Ok(()) };
        let number = number_of(tally, detector);
        if detector == 0 {
            let empty = vec![f64::NAN; detectors * patterns];
            if let Some((_, readings)) = open.replace((number, empty)) {
                finish(&readings)?;
            }
        }
        let Some((_, readings)) = open.as_mut().filter(|(open, _)| *open == number) else {
            return Ok(());
        };
        let measurements = alone(frame, &setup)
            .measurements_of(detector, &setup, settling.as_ref(), whole.keep_leak)
            .map_err(|problem| whole.integrate(problem))?;
        let at = usize::from(detector) * patterns;
        if let Some(place) = readings.get_mut(at..at + patterns) {
            place.copy_from_slice(measurements.values());
        }
        Ok::<(), ExportError>(())
    })?;
    if let Some((_, readings)) = open {
        finish(&readings)?;
    }
    if written == whole.frames() { Ok(()) } else { Err(ExportError::Changed(whole.path.clone())) }
}

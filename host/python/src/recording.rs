//! Recordings: every frame with its times, and what else the file says.

use crate::arrays::array;
use crate::errors::{of_recording, refused};
use crate::work::long;
use nirspi::events;
use nirspi::recording::{Recording, RecordingError, hear_recording};
use nirspi_wire::DeviceMessage;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Serialize;
use std::path::PathBuf;
use std::sync::atomic::Ordering;

/// The frames of a recording that count, in order of arrival.
#[derive(Default)]
struct Frames {
    sums: Vec<i64>,
    sequence: Vec<i64>,
    device_time_us: Vec<i64>,
    time_ns: Vec<i64>,
    sweeps: Vec<i64>,
    flags: Vec<i64>,
}

fn json(value: &impl Serialize) -> PyResult<String> {
    serde_json::to_string(value).map_err(|error| refused(error.to_string()))
}

fn signed(value: u64) -> i64 {
    i64::try_from(value).unwrap_or(i64::MAX)
}

/// Why a recording is not read to its end.
enum Ended {
    Stopped,
    Recording(RecordingError),
}

impl From<RecordingError> for Ended {
    fn from(problem: RecordingError) -> Self {
        Self::Recording(problem)
    }
}

/// Everything in a recording. With `frames` false, the frames are counted and not kept.
#[pyfunction]
pub fn read_recording<'py>(
    py: Python<'py>,
    path: PathBuf,
    frames: bool,
) -> PyResult<Bound<'py, PyDict>> {
    let (recording, found, happened, count) = long(py, |stop| {
        let mut recording = Recording::open(&path).map_err(of_recording)?;
        let (mut found, mut happened) = (Frames::default(), Vec::new());
        let count = hear_recording(&mut recording, |heard, _| {
            if stop.load(Ordering::Relaxed) {
                return Err(Ended::Stopped);
            }
            match (heard.frame(), heard.content) {
                (Some(frame), _) if frames => {
                    found.sums.extend(frame.samples.iter());
                    found.sequence.push(i64::from(frame.sequence));
                    found.device_time_us.push(signed(frame.device_time_us));
                    found.time_ns.push(signed(heard.time_ns));
                    found.sweeps.push(i64::from(frame.sweeps));
                    found.flags.push(i64::from(frame.flags.0));
                }
                (_, Ok(DeviceMessage::Event(event))) => {
                    happened.push((heard.time_ns, events::as_it_happens(&event.kind)));
                }
                (_, Ok(DeviceMessage::Crash(report))) => {
                    happened.push((heard.time_ns, events::crash(report)));
                }
                _ => {}
            }
            Ok(())
        });
        let count = count.map_err(|ended| match ended {
            Ended::Stopped => refused("stopped"),
            Ended::Recording(problem) => of_recording(problem),
        })?;
        Ok((recording, found, happened, count))
    })?;
    let dict = PyDict::new(py);
    dict.set_item("identity", json(&recording.identity)?)?;
    dict.set_item("setup", json(&recording.setup)?)?;
    dict.set_item("settling", recording.settling.as_ref().map(json).transpose()?)?;
    dict.set_item("account", recording.end().account.as_ref().map(json).transpose()?)?;
    dict.set_item("cut_short", recording.end().cut_short.clone())?;
    dict.set_item("packets", recording.end().packets)?;
    let counted = count.account().counters();
    let counted = (counted.received, counted.lost, counted.corrupt, counted.late);
    dict.set_item("counted", counted)?;
    dict.set_item("misfit", count.misfit().map(|misfit| misfit.to_string()))?;
    dict.set_item("events", happened)?;
    dict.set_item("sums", array(py, found.sums))?;
    dict.set_item("sequence", array(py, found.sequence))?;
    dict.set_item("device_time_us", array(py, found.device_time_us))?;
    dict.set_item("time_ns", array(py, found.time_ns))?;
    dict.set_item("sweeps", array(py, found.sweeps))?;
    dict.set_item("flags", array(py, found.flags))?;
    Ok(dict)
}

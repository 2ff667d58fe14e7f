//! The report of a capture, for people and scripts.

use super::{Capture, CaptureError};
use crate::capture::{Choice, Origin};
use nirspi_camera::account::{FailedChecks, LossCounters};
use nirspi_camera::signal::Signal;
use nirspi_files::causes::in_one_line;
use nirspi_files::identity::CameraIdentity;
use serde::Serialize;
use std::io;
use std::path::{Path, PathBuf};

/// What a capture gave, and what it lacks.
#[derive(Debug, Serialize)]
pub struct CaptureReport<'r> {
    /// The camera.
    pub camera: &'r CameraIdentity,
    /// The file, or the first of several files.
    pub recording: &'r Path,
    /// All files, in their order.
    pub files: &'r [PathBuf],
    /// Size of all files.
    pub bytes: u64,
    /// The loss counters.
    pub frames: LossCounters,
    /// As counted by the camera; `null` if the camera disconnected before it reported.
    pub made: Option<u64>,
    /// How many damaged packets of any kind failed which check. A packet fails one check.
    pub failed_checks: FailedChecks,
    /// Messages that this program does not know.
    pub unknown_packets: u64,
    /// Frames that arrived twice.
    pub repeated: u64,
    /// Frames requested; `null` for a run until Ctrl-C.
    pub asked: Option<u32>,
    /// What ended the capture, in words.
    pub ended: &'static str,
    /// Whether nothing is missing.
    pub complete: bool,
    /// What the capture lacks; `null` if nothing is missing.
    pub missing: Option<String>,
    /// Duration of the capture.
    pub seconds: f64,
    /// Received frames a second.
    pub frames_per_s: f64,
    /// What the camera's signal meter saw; `null` for a single frame.
    pub signal: Option<Signal>,
    /// What is wrong with the readings, one line each.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub notes: Vec<String>,
    /// The ADC latency that was used.
    pub adc_latency_clocks: u8,
    /// Whether readings are corrected for the leak.
    pub calibrated: bool,
    /// Time and file of the kept calibration; `null` if none was used.
    pub calibration: Option<Origin>,
    /// Why a kept calibration was not used.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibration_note: Option<&'r str>,
    /// Why the kept calibration was used instead of a new one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibration_problem: Option<String>,
}

impl<'r> CaptureReport<'r> {
    /// The report of a capture with this choice of calibration.
    ///
    /// # Errors
    /// If a file of the recording is gone.
    pub fn new(
        camera: &'r CameraIdentity,
        choice: &'r Choice,
        captured: &'r Capture,
    ) -> io::Result<Self> {
        let files = &captured.files;
        let bytes = files.iter().map(|path| Ok(std::fs::metadata(path)?.len()));
        let counters = captured.counters;
        let seconds = captured.elapsed.as_secs_f64();
        let missing = captured.missing();
        Ok(Self {
            camera,
            recording: files.first().map_or(Path::new(""), PathBuf::as_path),
            files,
            bytes: bytes.sum::<io::Result<u64>>()?,
            frames: counters,
            made: captured.made,
            failed_checks: captured.failed_checks,
            unknown_packets: captured.unknown_packets,
            repeated: captured.repeated,
            asked: captured.asked,
            ended: captured.ended.in_words(),
            complete: missing.is_none(),
            missing,
            seconds,
            frames_per_s: counters.received as f64 / seconds,
            signal: captured.status.as_ref().and_then(Signal::of),
            notes: captured.integrated.what_happened(),
            adc_latency_clocks: captured.setup.adc_latency,
            calibrated: captured.settling.is_some(),
            calibration: choice.used(captured).cloned(),
            calibration_note: choice.note.as_deref(),
            calibration_problem: captured.calibration_problem.as_ref().map(|p| in_one_line(p)),
        })
    }

    /// The report of a capture whose recording could not be finished, because the disk was full or went away; `None`
    /// for any other error.
    ///
    /// # Errors
    /// If the file is gone.
    pub fn of_cut(
        camera: &'r CameraIdentity,
        choice: &'r Choice,
        error: &'r CaptureError,
    ) -> io::Result<Option<Self>> {
        let CaptureError::RecordingCut { captured, .. } = error else { return Ok(None) };
        let report = Self::new(camera, choice, captured)?;
        let missing = std::iter::once(in_one_line(error)).chain(report.missing);
        let missing = Some(missing.collect::<Vec<_>>().join("; "));
        Ok(Some(Self { complete: false, missing, ..report }))
    }
}

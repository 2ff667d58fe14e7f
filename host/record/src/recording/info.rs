//! What a recording holds, for people and scripts.

use super::{Part, Recording, RecordingError, RunAccount};
use crate::recording::hear_recording;
use nirspi_camera::account::{FailedChecks, LossCounters};
use nirspi_files::clock::date;
use nirspi_files::identity::CameraIdentity;
use nirspi_files::provenance::Made;
use nirspi_recon::words::count;
use serde::Serialize;
use std::fmt;
use std::path::{Path, PathBuf};

/// What a recording holds. Every packet is read for it.
#[derive(Debug, Serialize)]
pub struct RecordingInfo {
    /// The file.
    pub recording: PathBuf,
    /// Size of the file.
    pub bytes: u64,
    /// The recorded camera.
    pub camera: CameraIdentity,
    /// The program that wrote the recording, its command line and when it started; `null` if the recording does not say.
    pub written_by: Option<Made>,
    /// Time of the first packet, as `2026-11-20 08:30 UTC`; `null` without a packet.
    pub begun: Option<String>,
    /// Duration by the camera's clock, from the first frame to the last.
    pub device_seconds: f64,
    /// Duration by the host's clock, from the first packet to the last.
    pub host_seconds: f64,
    /// Number of packets.
    pub packets: u64,
    /// The loss counters, counted again.
    pub frames: LossCounters,
    /// How many damaged packets failed which check.
    pub failed_checks: FailedChecks,
    /// The account as the capture wrote it; `null` if the recording is cut short.
    pub account: Option<RunAccount>,
    /// Number of the recorded run.
    pub run: Option<u16>,
    /// The place of the file in a run of several files; `null` for a run in one file.
    pub part: Option<Part>,
    /// Name of the patterns' order.
    pub order: String,
    /// Patterns of a sweep.
    pub patterns: usize,
    /// Whether each pattern is followed by its complement.
    pub differential: bool,
    /// Whether sweeps differ so that the faults of LEDs and lines cancel in every four.
    pub alternating: bool,
    /// Sweeps summed into a frame.
    pub sweeps: u32,
    /// ADC clocks for which each pattern is shown.
    pub clocks_per_pattern: u16,
    /// ADC samples left out at the start of each pattern.
    pub blanked: u16,
    /// ADC clocks from light to sample.
    pub adc_latency: u8,
    /// Whether the recording holds the camera's settling.
    pub calibrated: bool,
    /// What is wrong with the file; `null` if it is whole.
    pub damage: Option<String>,
}

impl RecordingInfo {
    /// Reads a recording.
    ///
    /// # Errors
    /// [`RecordingError`] if the file is not a recording, or its first part is missing.
    pub fn read(path: &Path) -> Result<Self, RecordingError> {
        let mut recording = Recording::open(path)?;
        let mut times: Option<(u64, u64)> = None;
        let mut device: Option<(u64, u64)> = None;
        let widened = |span: Option<(u64, u64)>, at| {
            Some(span.map_or((at, at), |(first, last)| (first.min(at), last.max(at))))
        };
        let count = hear_recording(&mut recording, |heard, _| {
            times = widened(times, heard.time_ns);
            if let Some(frame) = heard.frame() {
                device = widened(device, frame.device_time_us);
            }
            Ok::<(), RecordingError>(())
        })?;
        let seconds = |span: Option<(u64, u64)>, unit: f64| {
            span.map_or(0.0, |(first, last)| (last - first) as f64 * unit)
        };
        let end = recording.end().clone();
        let Recording { identity, setup, settling, run, part, provenance, .. } = recording;
        Ok(Self {
            recording: path.to_owned(),
            bytes: std::fs::metadata(path).map_or(0, |file| file.len()),
            camera: identity,
            written_by: provenance.map(|provenance| provenance.made),
            begun: times.map(|(first, _)| date(first / 1_000_000_000)),
            device_seconds: seconds(device, 1e-6),
            host_seconds: seconds(times, 1e-9),
            packets: end.packets,
            frames: count.account().counters(),
            failed_checks: count.account().failed_checks(),
            account: end.account,
            run,
            part,
            patterns: setup.rows.len(),
            alternating: setup.alternates(),
            order: setup.order,
            differential: setup.differential,
            sweeps: setup.sweeps,
            clocks_per_pattern: setup.clocks_per_pattern,
            blanked: setup.blanked,
            adc_latency: setup.adc_latency,
            calibrated: settling.is_some(),
            damage: end.cut_short,
        })
    }
}

/// The same in words, one fact a line. Texts of the file are shown without control characters.
impl fmt::Display for RecordingInfo {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { camera, .. } = self;
        let begun = self.begun.as_deref().unwrap_or("without a packet");
        let megabytes = self.bytes as f64 / 1e6;
        writeln!(f, "{}: recording of {begun}, {megabytes:.1} MB", self.recording.display())?;
        if let Some(Part { number, first_frame, follows }) = &self.part {
            let follows = follows.as_ref().map(|name| format!(", after {}", name.escape_debug()));
            let goes_on = self.account.as_ref().and_then(|account| account.continues.as_ref());
            let goes_on = goes_on.map(|name| format!(", goes on in {}", name.escape_debug()));
            let (follows, goes_on) = (follows.unwrap_or_default(), goes_on.unwrap_or_default());
            writeln!(f, "file {number} of its run, from frame {first_frame} on{follows}{goes_on}")?;
        }
        let (board, serial) = (camera.board.escape_debug(), camera.serial.escape_debug());
        writeln!(f, "camera {board} {serial}, wire protocol {}", camera.protocol)?;
        if let Some(made) = &self.written_by {
            let Made { program, command, date, .. } = made;
            let text = format!("written by {program}, {date}: {command}");
            writeln!(f, "{}", text.replace(char::is_control, "?"))?;
        }
        let pairs = match (self.differential, self.alternating) {
            (true, true) => "pairs of a pattern and its complement, by turns,",
            (true, false) => "pairs of a pattern and its complement",
            (false, _) => "patterns",
        };
        let order = self.order.escape_debug();
        let (sweeps, latency) = (count(u64::from(self.sweeps), "sweep"), self.adc_latency);
        writeln!(f, "{} {pairs} in {order} order, {sweeps} a frame", self.patterns)?;
        let (clocks, blanked) = (self.clocks_per_pattern, self.blanked);
        writeln!(f, "{clocks} ADC clocks a pattern, {blanked} left out, latency {latency}")?;
        let known = if self.calibrated { "in the recording" } else { "not in the recording" };
        writeln!(f, "settling of the LEDs: {known}")?;
        let (device, host) = (self.device_seconds, self.host_seconds);
        let packets = count(self.packets, "packet");
        writeln!(f, "{} in {packets}", self.frames)?;
        if self.failed_checks.packets() > 0 {
            writeln!(f, "damaged packets: {}", self.failed_checks)?;
        }
        write!(f, "{device:.6} s by the camera's clock, {host:.3} s by the computer's")?;
        match &self.account {
            None => write!(f, "\nno account at the end: the capture did not end by itself")?,
            Some(RunAccount { missing: Some(missing), .. }) => {
                write!(f, "\nthe capture was not whole: {}", missing.escape_debug())?;
            }
            Some(account) if account.counters != self.frames => {
                write!(f, "\nthe capture counted {}", account.counters)?;
            }
            Some(_) => {}
        }
        match &self.damage {
            Some(damage) => write!(f, "\ndamaged: {damage}"),
            None => Ok(()),
        }
    }
}

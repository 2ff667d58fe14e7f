//! The reports of a camera in words: after the greeting, events while no host was connected; later,
//! events as they happen.

use nirspi_recon::words::count;
use nirspi_wire::message::CRASH_TEXT_MAX;
use nirspi_wire::{CrashReport, DeviceMessage, EventKind};
use serde::Serialize;

/// How serious an event is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Level {
    /// The event belongs to ordinary work.
    Info,
    /// Something was lost or damaged, and the camera goes on.
    Warning,
    /// The camera stopped or crashed.
    Error,
}

/// An event or a crash in words, and how serious it is; `None` for any other message.
#[must_use]
pub fn line(message: &DeviceMessage<'_>) -> Option<(Level, String)> {
    match message {
        DeviceMessage::Event(event) => {
            let level = match event.kind {
                EventKind::RunEnded { .. } => Level::Info,
                EventKind::Fault(_) => Level::Error,
                EventKind::RawDropped
                | EventKind::CommandDamaged
                | EventKind::FpgaAccessesDamaged { .. } => Level::Warning,
            };
            Some((level, as_it_happens(&event.kind)))
        }
        DeviceMessage::Crash(report) => Some((Level::Error, crash(report))),
        _ => None,
    }
}

/// The words for an event that happened before the greeting; `None` for an event that an earlier
/// host caused.
#[must_use]
pub fn at_greeting(kind: &EventKind) -> Option<String> {
    match kind {
        EventKind::Fault(_) => Some(as_it_happens(kind)),
        EventKind::RunEnded { .. }
        | EventKind::RawDropped
        | EventKind::CommandDamaged
        | EventKind::FpgaAccessesDamaged { .. } => None,
    }
}

/// The words for an event of a connected camera.
#[must_use]
pub fn as_it_happens(kind: &EventKind) -> String {
    match *kind {
        EventKind::Fault(fault) => format!("the camera switched its LEDs off: {fault}"),
        EventKind::RunEnded {
            run,
            frames_made,
            frames_dropped,
            fpga_frames_lost,
            fpga_frames_corrupt,
        } => {
            let losses = [
                (frames_dropped, "dropped for want of room on the link"),
                (fpga_frames_lost, "lost in the FPGA"),
                (fpga_frames_corrupt, "damaged between FPGA and firmware"),
            ];
            let told = losses.iter().filter(|(count, _)| *count > 0);
            let told: String = told.map(|(count, how)| format!(", {count} {how}")).collect();
            format!("run {run} has ended: {} made{told}", count(frames_made, "frame"))
        }
        EventKind::RawDropped => "a raw burst was dropped for want of room on the link".to_owned(),
        EventKind::CommandDamaged => "a command came damaged to the camera".to_owned(),
        EventKind::FpgaAccessesDamaged { total } => format!(
            "register accesses between firmware and FPGA came damaged and were repeated, {total} since \
             power-up: check the wires of the host port"
        ),
    }
}

/// The words for the firmware's last crash. The text comes from the device, and is shown as one
/// line.
#[must_use]
pub fn crash(report: &CrashReport<'_>) -> String {
    let seconds = report.uptime_us as f64 / 1e6;
    // A text that is longer than the protocol allows is cut.
    let text: String =
        report.text.chars().take(CRASH_TEXT_MAX).flat_map(char::escape_debug).collect();
    format!("the firmware crashed {seconds:.1} s after its last start and was restarted: {text}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_end_of_a_run_names_what_was_lost_and_nothing_else() {
        let ended = |frames_dropped| EventKind::RunEnded {
            run: 3,
            frames_made: 12,
            frames_dropped,
            fpga_frames_lost: 0,
            fpga_frames_corrupt: 0,
        };
        assert_eq!(as_it_happens(&ended(0)), "run 3 has ended: 12 frames made");
        let told = as_it_happens(&ended(2));
        assert_eq!(told, "run 3 has ended: 12 frames made, 2 dropped for want of room on the link");
    }

    #[test]
    fn a_crash_is_told_in_one_line() {
        let report = CrashReport { uptime_us: 12_340_000, text: "src/run.rs:7: full\nof it" };
        let told = crash(&report);
        assert!(told.contains("12.3 s") && told.contains("src/run.rs:7"), "{told}");
        assert_eq!(told.lines().count(), 1);
    }
}

//! What befell a camera while nobody listened, in words: it reports that right after the greeting.

use nirspi_wire::{CrashReport, EventKind};

/// One such event, as people read it; `None` for what an earlier host has left behind.
#[must_use]
pub fn at_greeting(kind: &EventKind) -> Option<String> {
    match kind {
        EventKind::Fault(fault) => Some(format!("the camera switched its LEDs off: {fault:?}")),
        EventKind::RunEnded { .. } | EventKind::RawDropped | EventKind::CommandDamaged => None,
    }
}

/// What the firmware's last crash left behind, as people read it. The text is the device's: it is shown as one line.
#[must_use]
pub fn crash(report: &CrashReport<'_>) -> String {
    let seconds = report.uptime_us as f64 / 1e6;
    let text = report.text.escape_debug();
    format!("the firmware crashed {seconds:.1} s after its last start and was restarted: {text}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crash_is_told_in_one_line() {
        let report = CrashReport { uptime_us: 12_340_000, text: "src/run.rs:7: full\nof it" };
        let told = crash(&report);
        assert!(told.contains("12.3 s") && told.contains("src/run.rs:7"), "{told}");
        assert_eq!(told.lines().count(), 1);
    }
}

//! Says in words what a capture lacks.

use super::{Capture, Ended, StopCause};
use nirspi_camera::account::{FailedChecks, LossCounters};
use nirspi_camera::tally::FrameCount;
use nirspi_files::causes;
use nirspi_recon::words::count;

impl Capture {
    /// What is missing, in one line; `None` if the capture is whole. A capture is whole if all
    /// requested frames were made and arrived, no other packet was damaged, and the camera reports
    /// that no fault is latched. A run without a number of frames is whole when the user has
    /// stopped it, or its time is over, and all frames made have arrived.
    #[must_use]
    pub fn missing(&self) -> Option<String> {
        lacks(self.end(), self.counters, self.failed_checks)
    }

    /// The same for the last file of several, whose frames these are.
    pub(super) fn missing_in(&self, count: &FrameCount) -> Option<String> {
        lacking(self.end(), count)
    }

    /// How the run ended, if not as requested.
    fn end(&self) -> Option<String> {
        match &self.ended {
            Ended::Complete => None,
            Ended::Stopped(StopCause::Signal(signal)) => {
                Some(format!("ended by {signal}{}", self.of_asked()))
            }
            Ended::Stopped(StopCause::User | StopCause::TimeOver) => self.asked.map(|asked| {
                let made = self.made.unwrap_or_default();
                format!("stopped by the user after {made} of {asked} frames")
            }),
            Ended::Fault(fault) => {
                let made = self.of_asked();
                Some(format!("the camera switched its LEDs off{made}: {fault}"))
            }
            Ended::WrongNumber { made, asked: Some(asked) } => {
                Some(format!("the camera made {}, {asked} were asked for", count(*made, "frame")))
            }
            Ended::WrongNumber { made, asked: None } => {
                Some(format!("the camera ended the run by itself after {}", count(*made, "frame")))
            }
            Ended::Unconfirmed(error) => Some(format!(
                "the camera did not say after the run whether a fault stands: {}",
                causes::in_one_line(error)
            )),
            Ended::Junk { bytes } => {
                let received = count(self.counters.received, "frame");
                let megabytes = bytes / 1_000_000;
                Some(format!(
                    "{megabytes} MB of damaged packets and packets of other runs came with {received}, and the \
                     capture was ended"
                ))
            }
            Ended::NoFrames { waited } => {
                let (frames, seconds) = (self.counters.total(), waited.as_secs());
                let after = match frames {
                    0 => String::new(),
                    frames => format!(" after {}", count(frames, "frame")),
                };
                Some(format!(
                    "the camera said that it was measuring and sent nothing{after} for {seconds} s, and the capture was ended"
                ))
            }
            Ended::LinkLost(error) => {
                let error = causes::in_one_line(error);
                Some(format!("{error}; what the camera made after the last frame is not known"))
            }
        }
    }

    fn of_asked(&self) -> String {
        match (self.made, self.asked) {
            (Some(made), Some(asked)) => format!(" after {made} of {asked} frames"),
            (Some(made), None) => format!(" after {}", count(made, "frame")),
            (None, _) => String::new(),
        }
    }
}

/// What a file of a run lacks, besides how the run ended.
pub(super) fn lacking(end: Option<String>, count: &FrameCount) -> Option<String> {
    lacks(end, count.account().counters(), count.account().failed_checks())
}

fn lacks(end: Option<String>, counters: LossCounters, failed: FailedChecks) -> Option<String> {
    let parts = [end, frames(counters), packets(counters, failed)];
    let parts: Vec<String> = parts.into_iter().flatten().collect();
    (!parts.is_empty()).then(|| parts.join("; "))
}

/// Damaged packets: the checks that they failed, and how many were no frames of the run.
fn packets(counters: LossCounters, failed: FailedChecks) -> Option<String> {
    let packets = failed.packets();
    let others = match packets.saturating_sub(counters.corrupt) {
        0 => String::new(),
        others => format!("; {others} of them of unknown content, beyond these frames"),
    };
    (packets > 0).then(|| format!("{}: {failed}{others}", count(packets, "damaged packet")))
}

/// Frames made that did not arrive whole and in order.
fn frames(counters: LossCounters) -> Option<String> {
    (!counters.is_complete())
        .then(|| format!("of {} made: {counters}", count(counters.total(), "frame")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_camera::integrate::Integrated;
    use nirspi_camera::session::SessionError;
    use nirspi_camera::setup::MeasurementSetup;
    use nirspi_files::identity::CameraIdentity;
    use nirspi_files::interrupt::Signal;
    use nirspi_recon::Order;
    use nirspi_wire::Fault;
    use std::time::Duration;

    fn camera() -> CameraIdentity {
        CameraIdentity::current("virtual", "virtual-1")
    }

    fn wrong_crc(packets: u64) -> FailedChecks {
        FailedChecks { crc: packets, ..Default::default() }
    }

    /// A capture of 50 frames without anything missing.
    fn whole() -> Capture {
        let setup = MeasurementSetup::new(&Order::Natural, 0.1).unwrap();
        Capture {
            camera: camera(),
            integrated: Integrated::new(&setup),
            setup,
            settling: None,
            calibration_problem: None,
            counters: LossCounters { received: 50, ..Default::default() },
            failed_checks: FailedChecks::default(),
            unknown_packets: 0,
            repeated: 0,
            status: None,
            asked: Some(50),
            made: Some(50),
            recording: None,
            files: Vec::new(),
            ended: Ended::Complete,
            elapsed: Duration::from_secs(1),
        }
    }

    #[test]
    fn a_capture_is_whole_only_if_nothing_is_missing() {
        assert_eq!(whole().missing(), None);
        let no_answer = || SessionError::NoAnswer { command: "Status" };
        let short = || LossCounters { received: 3, ..Default::default() };
        let cases: [(Capture, &[&str]); 10] = [
            (
                Capture {
                    counters: short(),
                    made: Some(3),
                    ended: Ended::WrongNumber { made: 3, asked: Some(50) },
                    ..whole()
                },
                &["made 3 frames, 50 were asked for"],
            ),
            (
                Capture {
                    counters: short(),
                    made: Some(3),
                    failed_checks: wrong_crc(1),
                    ended: Ended::Fault(Fault::Interlock),
                    ..whole()
                },
                &[
                    "LEDs off after 3 of 50 frames",
                    "interlock",
                    "1 damaged packet: wrong CRC-32 in 1; 1 of them of unknown",
                ],
            ),
            (
                Capture {
                    counters: LossCounters { received: 48, lost: 1, corrupt: 1, late: 0 },
                    failed_checks: FailedChecks { cobs: 1, ..Default::default() },
                    ..whole()
                },
                &[
                    "of 50 frames made: 48 received, 1 lost, 1 corrupt, 0 late",
                    "1 damaged packet: broken COBS code in 1",
                ],
            ),
            (Capture { failed_checks: wrong_crc(2), ..whole() }, &["2 damaged packets"]),
            (Capture { ended: Ended::Unconfirmed(no_answer()), ..whole() }, &["whether a fault"]),
            (
                Capture { ended: Ended::Stopped(StopCause::User), made: Some(7), ..whole() },
                &["stopped by the user after 7 of 50"],
            ),
            (
                Capture {
                    ended: Ended::Stopped(StopCause::Signal(Signal::Hangup)),
                    asked: None,
                    ..whole()
                },
                &["ended by the end of the terminal (SIGHUP) after 50 frames"],
            ),
            (Capture { ended: Ended::Junk { bytes: 67_000_000 }, ..whole() }, &["67 MB"]),
            (Capture { ended: Ended::LinkLost(no_answer()), ..whole() }, &["not known"]),
            (
                Capture { ended: Ended::NoFrames { waited: Duration::from_secs(6) }, ..whole() },
                &["sent nothing after 50 frames for 6 s"],
            ),
        ];
        for (capture, words) in cases {
            let missing = capture.missing().unwrap();
            assert!(words.iter().all(|word| missing.contains(word)), "{missing}");
        }
    }

    #[test]
    fn a_run_without_a_length_is_whole_when_the_user_stops_it() {
        for cause in [StopCause::User, StopCause::TimeOver] {
            let stopped = Capture { asked: None, ended: Ended::Stopped(cause), ..whole() };
            assert_eq!(stopped.missing(), None);
        }
        let ended = Ended::WrongNumber { made: 50, asked: None };
        let by_itself = Capture { asked: None, ended, ..whole() };
        assert!(by_itself.missing().unwrap().contains("by itself after 50 frames"));
    }
}

//! Makes telemetry and log of the packets of a run.

use super::schemas::Telemetry;
use nirspi_camera::events::{self, Level};
use nirspi_camera::tally::FrameCount;
use nirspi_wire::{Answer, DeviceMessage, PacketError, Reply, Status};

/// Time between two records of telemetry.
const EVERY_NS: u64 = 100_000_000;

/// Watches the packets of a run.
#[derive(Debug, Default)]
pub(super) struct Monitor {
    /// Time of the last record, and the frames received until then.
    last: Option<(u64, u64)>,
    status: Option<Status>,
}

impl Monitor {
    /// The line of the log for a packet, if the packet says something.
    pub(super) fn line(
        &mut self,
        content: &Result<DeviceMessage<'_>, PacketError>,
    ) -> Option<(Level, String)> {
        let message = content.as_ref().ok()?;
        if let DeviceMessage::Reply(Reply { outcome: Ok(Answer::Status(status)), .. }) = message {
            self.status = Some(*status);
        }
        events::line(message)
    }

    /// The telemetry at `time_ns`, ten times a second.
    pub(super) fn telemetry(&mut self, time_ns: u64, count: &FrameCount) -> Option<Telemetry> {
        if self.last.is_some_and(|(last, _)| time_ns.saturating_sub(last) < EVERY_NS) {
            return None;
        }
        let counters = count.account().counters();
        let frames_per_s = match self.last {
            Some((last, before)) => {
                let seconds = (time_ns - last) as f64 * 1e-9;
                counters.received.saturating_sub(before) as f64 / seconds
            }
            None => 0.0,
        };
        self.last = Some((time_ns, counters.received));
        Some(Telemetry {
            device_time_us: count.device_time_us(),
            counters,
            damaged_packets: count.account().failed_checks().packets(),
            frames_per_s,
            status: self.status,
        })
    }
}

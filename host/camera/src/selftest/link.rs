//! Checks the link: the number of frames a second that it carries, and that it loses no frame at a
//! slower pace.
//!
//! # Invariant
//! A slow or busy computer is no loss of the link. The pace follows from the frames that arrived in a
//! second of the camera's clock, and a run with frames for which link or firmware had no time is
//! repeated at half the pace (`host/virtual/tests/selftest.rs`). A frame that was damaged, or lost
//! after the firmware sent it, is lost at any pace.

use super::LinkDemands;
use super::stream::stream;
use crate::check::{Check, Limit};
use crate::session::{Session, SessionError};
use crate::setup::MeasurementSetup;
use nirspi_recon::{Rows, Side};
use nirspi_wire::CLOCKS_PER_PATTERN;
use nirspi_wire::ready::MAX_SUMMED_SAMPLES;

/// Name of the check of the losses.
pub const LOSSES: &str = "link losses";
/// Name of the check of the speed.
pub const SPEED: &str = "link throughput";

/// Share of its top speed at which a link must lose no frame.
const PACE: f64 = 0.8;
/// The most runs, each at half the pace of the one before.
const RUNS: u32 = 4;

/// Samples left out at the start of each pattern.
const BLANKED: u16 = 2;

fn setup(sweeps: u32) -> MeasurementSetup {
    MeasurementSetup {
        order: "natural".to_owned(),
        rows: Rows::natural(Side::INSTRUMENT),
        differential: true,
        alternating: false,
        clocks_per_pattern: CLOCKS_PER_PATTERN,
        blanked: BLANKED,
        adc_latency: 0,
        sweeps,
    }
}

/// Runs at top speed, then at [`PACE`] of the top speed.
pub fn check(session: &mut Session, demands: LinkDemands) -> Result<Vec<Check>, SessionError> {
    let fastest = stream(session, &setup(1), demands.duration)?;
    let seconds = fastest.elapsed.as_secs_f64();
    let received = fastest.count.account().counters().received;
    if received == 0 {
        let skipped = Check::skipped(LOSSES, "no frame came");
        return Ok(vec![Check::told(SPEED, false, "no frame came"), skipped]);
    }
    let frames_per_s = received as f64 / seconds;
    let megabytes_per_s = fastest.bytes as f64 / seconds / 1e6;
    let speed = Check::measured(
        SPEED,
        frames_per_s.round(),
        "frames/s",
        Limit::AtLeast(demands.min_frames_per_s),
    )
    .noting(&format!("{megabytes_per_s:.2} MB/s"));

    // By the camera's clock: a simulated camera may be much slower than the clock of this computer.
    let sweeps_per_s = 1e9 / setup(1).frame_ns();
    let carried_per_s = fastest.frames_per_device_s().unwrap_or(sweeps_per_s);
    let most_sweeps = MAX_SUMMED_SAMPLES / u32::from(CLOCKS_PER_PATTERN - BLANKED);
    let wanted = (sweeps_per_s / (PACE * carried_per_s)).ceil() as u32;
    let mut sweeps = wanted.clamp(1, most_sweeps);
    let pace = |sweeps: u32| sweeps_per_s / f64::from(sweeps);
    let mut paced = stream(session, &setup(sweeps), demands.duration)?;
    let mut too_fast = String::new();
    for _ in 1..RUNS {
        // The FPGA loses frames that the firmware fetches too late.
        let late = paced.status.frames_dropped + paced.status.fpga_frames_lost;
        if late == 0 || sweeps >= most_sweeps {
            break;
        }
        too_fast = format!("; at {:.0} frames/s some frames came too late", pace(sweeps));
        sweeps = (2 * sweeps).min(most_sweeps);
        paced = stream(session, &setup(sweeps), demands.duration)?;
    }
    let counters = paced.count.account().counters();
    let missing = counters.total() - counters.received;
    let status = paced.status;
    let mut note = format!("of {} at {:.0} frames/s", counters.total(), pace(sweeps));
    if missing > 0 {
        let (fpga, firmware) = (status.fpga_frames_lost, status.frames_dropped);
        let bus = status.fpga_frames_corrupt;
        note += &format!(
            ": {fpga} lost in the FPGA, {bus} damaged on its bus, {firmware} dropped by the firmware, {} on the link",
            missing.saturating_sub(u64::from(fpga) + u64::from(bus) + u64::from(firmware))
        );
    }
    let losses = Check::measured(LOSSES, missing as f64, "frames", Limit::Exactly(0.0));
    let losses =
        if counters.total() == 0 { Check::told(LOSSES, false, "no frame came") } else { losses };
    Ok(vec![speed, losses.noting(&(note + &too_fast))])
}

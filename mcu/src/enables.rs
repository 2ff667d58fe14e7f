//! Whether each of the two LED enables keeps the array dark alone. While both work, a stuck one shows nowhere: the other
//! still switches the LEDs on and off.
//!
//! The self-test asks, and so does the first light after power-up, after gateware was loaded and after the FPGA was absent:
//! a run or a raw burst begins once both enables are sound. [`Limits::tries_enables`] says whether a board does that; the
//! virtual camera and the emulated board do not.
//!
//! All LEDs go on and off in slots of two microseconds, three times for 0.3 milliseconds, and the detector says whether
//! their light follows:
//!
//! | board's enable | FPGA's enable | the detector must see |
//! |---|---|---|
//! | low | high in the run | nothing |
//! | high | low: the run is without light ([`mode::UNLIT`]) | nothing |
//! | high | high in the run | light |
//!
//! Without light in the third run the darkness of the first two proves nothing: the self-test leaves both checks out, and a
//! run begins all the same, because a dark scene is no fault. The next one asks again.
//!
//! # Invariant
//! Both enables are high together only after each of them has kept the array dark alone
//! (`tests::enables::both_enables_are_high_only_after_each_has_kept_the_array_dark`).

use crate::configure::Setup;
use crate::test_frame::{begin, look};
use crate::{FpgaBus, Limits, Micros, burst, run};
use nirspi_wire::fpga::FpgaFrame;
use nirspi_wire::register::mode;
use nirspi_wire::{Fault, FrameFlags, Refusal, RunLength, SelfTestReport};

/// Time from the poll that changes the board's pin to the run: the pin changes after the poll, and the array's gates follow
/// within microseconds.
const SETTLE: Micros = Micros(1_000);

/// Pattern 0 and its complement: all LEDs, none. Sweeps alternate, so that the charge of the lines cancels. The samples
/// that count begin later in a slot than any latency and any settling, so no calibration is needed.
const SETUP: Setup = Setup {
    mode: mode::DIFFERENTIAL | mode::ALTERNATING,
    patterns: 1,
    dwell: 256,
    blank: 128,
    latency: 0,
    sweeps: 64,
    over_range_trip: 0,
    duty_permille: 500,
};

/// Samples of a slot that count, in the whole frame.
const SAMPLES: u64 = (SETUP.dwell - SETUP.blank) as u64 * SETUP.sweeps as u64;

/// Counts of a sample, as a mean, from which on a difference of all LEDs and none is light. A noise of 100 counts a sample
/// makes 1.6 of it.
const DARK_COUNTS: u64 = 16;

/// Counts from which on the light is strong enough to judge by: that of a stuck enable is as strong.
const LIGHT_COUNTS: u64 = 64;

/// Which enables are high in a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum High {
    FpgaAlone,
    BoardAlone,
    Both,
}

/// Light that a host asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Asked {
    Run(RunLength),
    /// A raw burst of this many samples.
    Burst(u16),
}

impl Asked {
    /// Refuses a length that no run or burst has.
    pub fn check(self) -> Result<(), Refusal> {
        match self {
            Self::Run(length) => run::frames(length).map(|_| ()),
            Self::Burst(samples) => burst::check(samples),
        }
    }
}

/// What the test is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Purpose {
    /// The self-test, with the checks before.
    Report(SelfTestReport),
    /// The first light, which follows.
    First(Asked),
}

/// A test of the enables in progress.
#[derive(Debug)]
#[cfg_attr(test, derive(Clone))]
pub(crate) struct Enables {
    /// The command that waits for the reply.
    pub id: u16,
    pub purpose: Purpose,
    high: High,
    /// The run has begun. Before, the board's pin settles.
    shows: bool,
    /// The poll that began the run, or after which the pin has changed; `None` before the first poll.
    since: Option<Micros>,
}

/// How the test has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// Each enable keeps the array dark, and both let it shine.
    Sound,
    /// There is light although this enable is low.
    Stuck(Fault),
    /// There is too little light to judge by.
    NoLight,
    /// A frame did not come, or came damaged.
    NoFrame,
}

/// Counts of a sample by which all LEDs differ from none; `None` if the bytes are no frame of these runs.
fn light_counts(bytes: &[u8]) -> Option<u64> {
    let frame = FpgaFrame::parse(bytes).ok()?;
    let header = frame.header;
    let fits = header.sweeps == SETUP.sweeps
        && header.patterns == SETUP.patterns
        && header.flags.contains(FrameFlags::DIFFERENTIAL)
        && !header.flags.contains(FrameFlags::TEST_SOURCE);
    let sums = frame.sums().next().filter(|_| fits)?;
    sums.difference().unsigned_abs().checked_div(SAMPLES)
}

impl Enables {
    pub fn new(id: u16, purpose: Purpose) -> Self {
        Self { id, purpose, high: High::FpgaAlone, shows: false, since: None }
    }

    /// What the rest of the test depends on, with ages for times.
    #[cfg(test)]
    pub fn key(&self, age: impl Fn(Micros) -> u64) -> [u64; 5] {
        let purpose = match self.purpose {
            Purpose::Report(_) => 0,
            Purpose::First(Asked::Run(RunLength::Continuous)) => 1,
            Purpose::First(Asked::Run(RunLength::Frames(frames))) => 2 + u64::from(frames),
            Purpose::First(Asked::Burst(samples)) => u64::MAX - u64::from(samples),
        };
        [
            self.id.into(),
            self.high as u64,
            self.shows.into(),
            self.since.map_or(u64::MAX, age),
            purpose,
        ]
    }

    /// Level of the board's own LED enable.
    pub fn pin(&self) -> bool {
        self.high != High::FpgaAlone
    }

    /// Goes on: begins a run, or looks at its frame. `None` while the test lasts.
    pub fn step(
        &mut self,
        now: Micros,
        bus: &mut impl FpgaBus,
        limits: &Limits,
    ) -> Option<Verdict> {
        let since = *self.since.get_or_insert(now);
        if !self.shows {
            if now.since(since) < SETTLE {
                return None;
            }
            let unlit = if self.high == High::BoardAlone { mode::UNLIT } else { 0 };
            let setup = Setup { mode: SETUP.mode | unlit, ..SETUP };
            if !begin(bus, &setup, limits) {
                return Some(Verdict::NoFrame);
            }
            (self.shows, self.since) = (true, Some(now));
            return None;
        }
        let Some(counts) = look(now, since, bus, light_counts)?.flatten() else {
            return Some(Verdict::NoFrame);
        };
        let is_dark = counts < DARK_COUNTS;
        self.high = match self.high {
            High::FpgaAlone if is_dark => High::BoardAlone,
            High::FpgaAlone => return Some(Verdict::Stuck(Fault::BoardEnableStuck)),
            High::BoardAlone if is_dark => High::Both,
            High::BoardAlone => return Some(Verdict::Stuck(Fault::FpgaEnableStuck)),
            High::Both if counts < LIGHT_COUNTS => return Some(Verdict::NoLight),
            High::Both => return Some(Verdict::Sound),
        };
        (self.shows, self.since) = (false, Some(now));
        None
    }
}

/// The report of a self-test whose checks before are `before`.
pub(crate) fn report(verdict: Verdict, before: SelfTestReport) -> SelfTestReport {
    use SelfTestReport as Report;
    const BOTH: u32 = Report::BOARD_ENABLE | Report::FPGA_ENABLE;
    let (ran, failed) = match verdict {
        Verdict::Sound => (BOTH, 0),
        Verdict::Stuck(Fault::BoardEnableStuck) => (Report::BOARD_ENABLE, Report::BOARD_ENABLE),
        // The light shows that the darkness before was that of the board's enable.
        Verdict::Stuck(_) => (BOTH, Report::FPGA_ENABLE),
        Verdict::NoLight => (0, 0),
        Verdict::NoFrame => (0, Report::TEST_FRAME),
    };
    Report { ran: before.ran | ran, failed: before.failed | failed }
}

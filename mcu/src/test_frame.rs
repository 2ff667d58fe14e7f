//! What the self-test, the test of the LED enables and the training share: a run of one frame, and the FPGA's test
//! generator.
//!
//! # Invariant
//! The sums that are expected of the test generator are those of the register map's definition
//! (`tests::selftest::a_wrong_sum_fails_the_test_frame`; `tests::fake_fpga` computes them in another way).

use crate::configure::Setup;
use crate::{FpgaBus, Limits, Micros, fpga};
use nirspi_wire::fpga::Sums;
use nirspi_wire::register::{Register, TEST_SEED, control, mode, test_sample};
use nirspi_wire::{CLOCKS_PER_PATTERN, FrameFlags, PATTERNS};

/// Longest time that a frame may take. The frames here need less than a millisecond and a transfer.
pub(crate) const PATIENCE: Micros = Micros(100_000);

/// Every pattern and its complement from the test generator, so that every accumulator of the FPGA takes part; without
/// light.
pub(crate) const GENERATOR: Setup = Setup {
    mode: mode::DIFFERENTIAL | mode::TEST_SOURCE | mode::UNLIT,
    patterns: PATTERNS,
    dwell: CLOCKS_PER_PATTERN,
    blank: 2,
    latency: 3,
    sweeps: 1,
    over_range_trip: 0,
    duty_permille: 0,
};

/// Flags of a frame of [`GENERATOR`].
pub(crate) const GENERATOR_FLAGS: FrameFlags =
    FrameFlags::TEST_SOURCE.with(FrameFlags::DIFFERENTIAL);

/// The sums of the frame of [`GENERATOR`].
pub(crate) fn expected_sums() -> impl Iterator<Item = Sums> {
    let mut state = TEST_SEED;
    let mut sample = move || {
        let this = state;
        state = test_sample(state);
        u64::from(this)
    };
    // A sample before the arrival of the first light belongs to no slot.
    for _ in 0..GENERATOR.latency {
        sample();
    }
    let mut slot = move || {
        let blanked = (0..GENERATOR.blank).map(|_| sample()).map(|_| 0);
        let blanked: u64 = blanked.sum();
        (GENERATOR.blank..GENERATOR.dwell).fold(blanked, |sum, _| sum.saturating_add(sample()))
    };
    (0..GENERATOR.patterns).map(move |_| Sums { positive: slot(), negative: slot() })
}

/// Starts a run of one frame; true if the FPGA accepted the start. The FPGA may run in both cases.
pub(crate) fn begin(bus: &mut impl FpgaBus, setup: &Setup, limits: &Limits) -> bool {
    fpga::set(bus, setup, limits).is_ok()
        && fpga::write(bus, Register::Frames, 1).is_ok()
        && fpga::start(bus, control::START).is_ok()
}

/// What `judge` says of the bytes of the frame that was begun at `since`. `None` while it may still come; the inner
/// `None` if it does not come.
pub(crate) fn look<T>(
    now: Micros,
    since: Micros,
    bus: &mut impl FpgaBus,
    judge: impl Fn(&[u8]) -> T,
) -> Option<Option<T>> {
    match bus.frame_ready().then(|| bus.frame().map(|bytes| bytes.map(judge))) {
        None | Some(Ok(None)) if now.since(since) <= PATIENCE => None,
        Some(Ok(Some(verdict))) => Some(Some(verdict)),
        _ => Some(None),
    }
}

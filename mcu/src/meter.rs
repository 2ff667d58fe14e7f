//! Signal meter: how strong the light is, how much of it depends on the pattern, and how much is
//! noise. It helps to align the optics and to set the gain, without a reconstruction.
//!
//! Four times a second the meter compares two frames of a run, reading by reading: two successive ones, or where the FPGA
//! loses frames two that are at most [`APART`] apart. What a
//! reading changes by from one frame to the next is noise; what the readings of one frame differ by
//! is signal and noise. The meter adds up integers while frames pass; [`Tally::signal`] computes
//! counts and decibels in floating point when the host asks for the status.
//!
//! The meter reads the samples in a frame's packet, and the sum of all
//! samples and the number over range in registers of the FPGA. A packet that the wires have damaged is no
//! frame. When a packet of the parallel port is looked at, the registers are already those of a frame that the FPGA
//! sends after it; between two frames the registers hold 0, and the meter measures nothing.
//!
//! The first packets of a run are also the training of the port that carries them: where none of them arrives whole, the port
//! is sampled at the wrong phase or its wires are bad, and the run ends ([`Meter::has_no_whole_packet`]).
//!
//! # Invariant
//! No frame passes through floating point (`tests/tests/budgets.rs`:
//! `only_the_telemetry_computes_with_floating_point`).

use crate::configure::Setup;
use crate::{BusError, FpgaBus, Micros, float, fpga};
use nirspi_wire::ready::Reader;
use nirspi_wire::register::{Register, mode};
use nirspi_wire::{ADC_BITS, FrameFlags, Signal};

/// Time between two comparisons.
const PERIOD: Micros = Micros(250_000);

/// Most frames from the first of a pair to the second.
const APART: u32 = 8;

/// A run ends if the first packets of it, this many, were looked at and all of them were damaged.
const TRAINING: u8 = 8;

/// Bits of a reading as the meter keeps it, sign included: the squares of 1024 differences of two
/// such readings fit in 64 bits.
const READING_BITS: u32 = 26;

/// Decibels, in hundredths, where the signal drowns in the noise and where there is no noise.
const SNR_CENTI_DB: (f32, f32) = (-2_000.0, 12_000.0);

/// What one reading is the sum of.
#[derive(Debug, Clone, Copy, Default)]
struct Exposure {
    /// ADC samples in each of the two sums of a pattern.
    samples: u64,
    /// Sums of a pattern in which there are samples: 2 with complements, else 1.
    halves: u32,
    /// ADC samples of a frame, blanked ones included.
    clocks: u64,
}

impl Exposure {
    fn of(setup: &Setup) -> Self {
        let summed = u64::from(setup.dwell.saturating_sub(setup.blank));
        Self {
            samples: summed.saturating_mul(setup.sweeps.into()),
            halves: if setup.mode & mode::DIFFERENTIAL == 0 { 1 } else { 2 },
            clocks: setup.frame_clocks(),
        }
    }

    /// Bits by which a reading is shifted right.
    fn shift(&self) -> u32 {
        let sample_bits = u64::BITS.saturating_sub(self.samples.leading_zeros());
        let bits = sample_bits.saturating_add(u32::from(ADC_BITS)).saturating_add(1);
        bits.saturating_sub(READING_BITS)
    }
}

#[derive(Debug, Clone, Copy)]
enum Pair {
    /// The next pair begins at this time.
    Due(Micros),
    /// The first frame of a pair has passed, and its samples lie in the scratch memory.
    Begun { sequence: u32, at: Micros },
}

#[derive(Debug)]
#[cfg_attr(test, derive(Clone))]
pub(crate) struct Meter {
    exposure: Exposure,
    pair: Pair,
    last: Option<Tally>,
    /// Damaged packets from the beginning of the run on; `None` once a packet has come whole.
    damaged: Option<u8>,
}

impl Meter {
    pub const fn new() -> Self {
        let exposure = Exposure { samples: 0, halves: 1, clocks: 0 };
        Self { exposure, pair: Pair::Due(Micros(0)), last: None, damaged: Some(0) }
    }

    /// Forgets what the run before has shown.
    pub fn start(&mut self, now: Micros, setup: &Setup) {
        self.exposure = Exposure::of(setup);
        self.pair = Pair::Due(now);
        self.last = None;
        self.damaged = Some(0);
    }

    /// Whether no packet of this run has come whole, of enough to say so.
    pub fn has_no_whole_packet(&self) -> bool {
        self.damaged.is_some_and(|damaged| damaged >= TRAINING)
    }

    /// Notes whether a packet has come whole.
    pub fn judge(&mut self, whole: bool) {
        self.damaged = self.damaged.filter(|_| !whole).map(|damaged| damaged.saturating_add(1));
    }

    /// Whether [`look`](Self::look) would read a packet now.
    pub fn wants(&self, now: Micros) -> bool {
        !matches!(self.pair, Pair::Due(at) if now < at)
    }

    /// Looks at the packet of a frame that the FPGA still delivers, if a pair begins or ends with it. The samples of
    /// a pair's first frame lie in `scratch`.
    pub fn look(
        &mut self,
        now: Micros,
        (packet, patterns): (&[u8], u16),
        scratch: &mut [u8],
        bus: &mut impl FpgaBus,
    ) {
        let due = match self.pair {
            Pair::Due(at) if now < at => return,
            Pair::Due(at) | Pair::Begun { at, .. } => at,
        };
        let mut reader = Reader::new(packet, patterns);
        let sequence = reader.sequence;
        let counts = !reader.flags.contains(FrameFlags::OVERFLOW);
        let apart = match self.pair {
            Pair::Begun { sequence: before, .. } => Some(sequence.wrapping_sub(before)),
            Pair::Due(_) => None,
        };
        let length = usize::from(patterns).saturating_mul(4);
        let Some(memory) = scratch.get_mut(..length) else { return };
        self.pair = Pair::Due(due);
        if let Some(apart) = apart {
            // Whatever comes of this pair: a look at two packets takes as long as many others.
            self.pair = Pair::Due(Micros(due.0.saturating_add(PERIOD.0)));
            if !counts || apart == 0 || apart > APART {
                return;
            }
            let tally = self.tally(&mut || reader.sample(), memory);
            let whole = reader.is_intact();
            self.judge(whole);
            if let (true, Ok((levels, over_range))) = (whole, measures(bus)) {
                self.last = Some(Tally { levels, over_range, ..tally });
            }
        } else {
            let (words, _) = memory.as_chunks_mut::<4>();
            for word in words {
                *word = reader.sample().to_le_bytes();
            }
            let whole = reader.is_intact();
            self.judge(whole);
            if counts && whole {
                self.pair = Pair::Begun { sequence, at: now };
            }
        }
    }

    /// Notes that the scratch memory holds something else now.
    pub fn forget(&mut self) {
        if let Pair::Begun { at, .. } = self.pair {
            self.pair = Pair::Due(at);
        }
    }

    /// What the last pair of this run or the last one has shown.
    pub fn signal(&self) -> Option<Signal> {
        self.last.as_ref().map(Tally::signal)
    }

    /// Sums over the readings of a frame, which `next` gives one by one, and of the frame before.
    fn tally(&self, next: &mut dyn FnMut() -> i32, before: &[u8]) -> Tally {
        let mut tally = Tally { exposure: self.exposure, ..Tally::default() };
        let shift = self.exposure.shift();
        let (words, _) = before.as_chunks();
        for word in words {
            let reading = next() >> shift;
            let change = reading.wrapping_sub(i32::from_le_bytes(*word) >> shift);
            tally.readings = tally.readings.wrapping_add(1);
            tally.sum = tally.sum.wrapping_add(reading.into());
            tally.squares = tally.squares.wrapping_add(square(reading));
            tally.changes = tally.changes.wrapping_add(square(change));
        }
        tally
    }
}

/// Sum of all samples of the delivered frame, and the number over range. A board with a parallel port may ask between
/// two frames, when the sum is 0: that is an error.
fn measures(bus: &mut impl FpgaBus) -> Result<(u64, u32), BusError> {
    let mut word = |register| fpga::read(bus, register);
    let (low, high) = (word(Register::SumLow)?, word(Register::SumHigh)?);
    let found = (u64::from(high) << 32 | u64::from(low), word(Register::OverRange)?);
    if bus.ring().is_some() && found.0 == 0 {
        return Err(BusError::Transfer);
    }
    Ok(found)
}

/// One instruction for the product of two words.
fn square(value: i32) -> i64 {
    i64::from(value).wrapping_mul(value.into())
}

/// Sums over the readings of a frame and the frame before.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    exposure: Exposure,
    readings: u32,
    /// Both sums of each pattern, added.
    levels: u64,
    sum: i64,
    squares: i64,
    /// Squares of the change of each reading.
    changes: i64,
    over_range: u32,
}

impl Tally {
    /// Squares of the readings' distances from their mean. The products wrap, their sum does not:
    /// it is at most `squares`, so it is right modulo 2^64 and in its range.
    fn centred_squares(&self) -> u64 {
        let readings = i64::from(self.readings);
        let mean = self.sum.checked_div(readings).unwrap_or(0);
        let twice = self.sum.wrapping_mul(2);
        let shift = readings.wrapping_mul(mean).wrapping_sub(twice).wrapping_mul(mean);
        self.squares.wrapping_add(shift).max(0).unsigned_abs()
    }

    /// Never inlined, so that a check of the machine code finds the floating point in this function
    /// alone.
    #[inline(never)]
    fn signal(&self) -> Signal {
        let Self { exposure: Exposure { samples, halves, clocks }, readings, .. } = *self;
        let readings = readings as f32;
        let samples = float::from_u64(samples.max(1));
        let mean = float::from_u64(self.levels) / (samples * halves as f32 * readings);
        // Mean squares, in shifted readings.
        let noise = float::from_u64(self.changes.unsigned_abs()) / (2.0 * readings);
        let signal = float::from_u64(self.centred_squares()) / readings - noise;
        let counts = float::power_of_two(self.exposure.shift()) / samples;
        let (least, most) = SNR_CENTI_DB;
        let snr = if noise > 0.0 && signal > 0.0 {
            1_000.0 * core::f32::consts::LOG10_E * float::ln(signal / noise)
        } else if noise > 0.0 {
            least
        } else {
            most
        };
        let over_range = u64::from(self.over_range).saturating_mul(1_000_000);
        Signal {
            mean_milli_counts: rounded(1_000.0 * mean),
            signal_milli_counts: rounded(1_000.0 * counts * float::root(signal)),
            noise_milli_counts: rounded(1_000.0 * counts * float::root(noise)),
            snr_centi_db: snr.clamp(least, most) as i16,
            over_range_ppm: u32::try_from(over_range.checked_div(clocks).unwrap_or(0))
                .unwrap_or(u32::MAX),
        }
    }
}

/// The nearest integer; numbers out of range end at the range.
fn rounded(value: f32) -> u32 {
    (value + 0.5) as u32
}

#[cfg(test)]
#[path = "tests/meter.rs"]
mod tests;

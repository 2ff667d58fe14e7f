//! The FPGA's register map: 16-bit addresses, 32-bit values. The gateware is checked against this
//! table.
//!
//! The behaviour of the gateware, in terms of these registers:
//!
//! * A *slot* is the time one pattern or complement is shown: [`Register::Dwell`] clocks. A sweep
//!   has [`Register::Patterns`] slots, twice as many if differential (pattern, complement, next
//!   pattern...). [`Register::Sweeps`] sweeps are a frame. Slots, sweeps and frames follow each
//!   other without a gap.
//! * The sample of clock `t` belongs to what was shown at clock `t - Latency`. The sample is summed
//!   unless its clock within that slot is below [`Register::Blank`].
//! * Settings are copied when a run starts: writes while it runs hold for the next one. The order
//!   table is not copied: writes to it while running are refused and set [`status::WRITE_REFUSED`].
//! * Up to [`WAITING_FRAMES`] frames wait for the host. The oldest is the delivered frame, and its release delivers
//!   the next. A frame that is complete while so many wait is lost: counted in [`Register::FramesLost`], and the next
//!   frame that is not lost carries `AFTER_LOSS`.
//! * With [`mode::PACKETS`] a frame is read as a packet of the host's link in the layout of [`ready`](crate::ready).
//!   Its device time is `Time + (clock of its first slot - clock of the last read of ClockLow) / 125`, all as of
//!   the start.
//! * With [`mode::NARROW`] too, the samples of a packet have three bytes.
//! * With [`mode::PARALLEL`] too, the FPGA sends each packet by its parallel port as soon as the frame is complete, and
//!   takes the frame back itself: [`status::FRAME_READY`] stays 0, a read of the frame gives zeros, and
//!   [`control::RELEASE`] gives back raw bursts alone. A frame that the receiver does not take in time is lost and
//!   counted like any other. A start cuts a packet that is under way.
//! * The host port has a clock of its own. [`Register::Identity`], [`Register::Version`],
//!   [`Register::Clocks`], [`Register::Design`] and [`Register::Sampling`] are answered with or without the ADC's clock. Everything
//!   else needs the ADC's clock: without it a read gives [`NO_CLOCK`], a write does nothing, and frames
//!   and bursts are zeros. When the clock comes back, everything but these five is as after reset.
//! * LEDs are on only while a run or raw burst without [`mode::UNLIT`] is under way, no fault is latched and the interlock
//!   input is closed. A fault ends the run at once, discards the unfinished frame and latches its
//!   first code.

/// Whether a register can be written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Access {
    /// Writes are ignored.
    ReadOnly,
    /// Reads give what was written.
    ReadWrite,
    /// Reads give 0; a written 1 acts once.
    Command,
}

macro_rules! registers {
    ($($(#[$doc:meta])* $name:ident = $address:literal, $access:ident, $reset:expr;)*) => {
        /// A register of the FPGA.
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum Register { $($(#[$doc])* $name,)* }

        impl Register {
            /// All registers, by address.
            pub const ALL: &'static [Self] = &[$(Self::$name,)*];

            /// Address on the host port.
            #[must_use]
            pub const fn address(self) -> u16 {
                match self { $(Self::$name => $address,)* }
            }

            /// Whether it can be written.
            #[must_use]
            pub const fn access(self) -> Access {
                match self { $(Self::$name => Access::$access,)* }
            }

            /// Value after reset.
            #[must_use]
            pub const fn reset(self) -> u32 {
                match self { $(Self::$name => $reset,)* }
            }

            /// The register at this address, if there is one.
            #[must_use]
            pub const fn at(address: u16) -> Option<Self> {
                match address { $($address => Some(Self::$name),)* _ => None }
            }
        }
    };
}

registers! {
    /// Always [`IDENTITY`].
    Identity = 0x00, ReadOnly, IDENTITY;
    /// Gateware version, `major << 16 | minor << 8 | patch`.
    Version = 0x01, ReadOnly, 0x0000_0400;
    /// Holds what was written, for bus tests.
    Scratch = 0x02, ReadWrite, 0;
    /// See [`control`].
    Control = 0x03, Command, 0;
    /// See [`status`].
    Status = 0x04, ReadOnly, 0;
    /// Latched reason for LEDs off, see [`FaultCode`].
    Fault = 0x05, ReadOnly, 0;
    /// The ADC's clock as the host port sees it, see [`clocks`].
    Clocks = 0x06, ReadOnly, 0;
    /// What the gateware is built for, see [`Design`].
    Design = 0x07, ReadOnly, Design::Camera as u32;
    /// See [`mode`].
    Mode = 0x08, ReadWrite, 0;
    /// Patterns of a sweep, 1 to 1024.
    Patterns = 0x09, ReadWrite, crate::PATTERNS as u32;
    /// Clocks a slot lasts, 1 to 65 535.
    Dwell = 0x0A, ReadWrite, crate::CLOCKS_PER_PATTERN as u32;
    /// Samples left out at the start of a slot, below `Dwell`.
    Blank = 0x0B, ReadWrite, 2;
    /// Clocks from light to sample, 0 to 63.
    Latency = 0x0C, ReadWrite, 0;
    /// Sweeps of a frame, at least 1.
    Sweeps = 0x0D, ReadWrite, 1;
    /// Frames of a run; 0 runs until stopped.
    Frames = 0x0E, ReadWrite, 0;
    /// Samples of a raw burst, 1 to [`RAW_SAMPLES_MAX`].
    RawLength = 0x0F, ReadWrite, RAW_SAMPLES_MAX as u32;
    /// Clocks without any access to the host port after which a run is ended, 1 to
    /// [`WATCHDOG_MAX`].
    Watchdog = 0x10, ReadWrite, crate::ADC_HZ / 5;
    /// Light budget in each window of [`DUTY_WINDOW`] clocks, in half-arrays lit for a clock: a
    /// slot of pattern 0 costs 2 a clock, its complement 0, any other pattern or complement 1. At
    /// most [`DUTY_LIMIT_MAX`]. Windows are fixed, one begins whenever the clock since reset is a
    /// multiple of their length, so that no sequence of starts gets around the limit.
    DutyLimit = 0x11, ReadWrite, DUTY_LIMIT_MAX;
    /// The run ends when this number of samples of one frame or raw burst, blanked ones included, are over
    /// range. 0 never ends a run.
    OverRangeTrip = 0x12, ReadWrite, 4096;
    /// Frames completed in this run, lost ones too.
    FramesMade = 0x13, ReadOnly, 0;
    /// Frames of this run that were lost because [`WAITING_FRAMES`] before them were not released.
    FramesLost = 0x14, ReadOnly, 0;
    /// Clocks since reset, low word; reading it holds the high word for the next read.
    ClockLow = 0x15, ReadOnly, 0;
    /// Clocks since reset, high word as of the last read of the low one.
    ClockHigh = 0x16, ReadOnly, 0;
    /// Writes taken since reset, to registers and to the order table, modulo 2^32. A write whose check is
    /// wrong is not taken.
    Writes = 0x17, ReadOnly, 0;
    /// Number of the run that packets carry, bits 0 to 15. With [`mode::PACKETS`] alone, like the next two.
    Run = 0x18, ReadWrite, 0;
    /// Device time in microseconds of the clock that the last read of `ClockLow` before the start gave, low
    /// word.
    TimeLow = 0x19, ReadWrite, 0;
    /// High word of that time.
    TimeHigh = 0x1A, ReadWrite, 0;
    /// Sum of all samples of the delivered frame that were not blanked, low word; modulo 2^64, however its
    /// sums wrapped. 0 while no frame is delivered.
    SumLow = 0x1B, ReadOnly, 0;
    /// High word of that sum.
    SumHigh = 0x1C, ReadOnly, 0;
    /// Samples of the delivered frame that were over range, blanked ones included. 0 while no frame is
    /// delivered.
    OverRange = 0x1D, ReadOnly, 0;
    /// The result of the last scan of the ADC's sampling phase, see [`sampling`]. 0 before the first scan is
    /// over, and on a board that has none.
    Sampling = 0x1E, ReadOnly, 0;
}

/// `"NSPI"` in ASCII.
pub const IDENTITY: u32 = 0x4E53_5049;
/// What a read gives while the ADC's domain has no clock or is in reset. No register holds this value by
/// itself but [`Register::Scratch`] and settings into which it was written.
pub const NO_CLOCK: u32 = 0xDEAD_C10C;
/// What stands for the identity of an FPGA whose answers come damaged, in
/// [`Fault::FpgaAbsent`](crate::Fault::FpgaAbsent). No register holds this value by itself.
pub const DAMAGED: u32 = 0xBAD0_C4EC;
/// Whether gateware with this [`Register::Version`] has the registers of this table: the same major and minor
/// version. Gateware and firmware of one release fit.
#[must_use]
pub const fn has_this_map(version: u32) -> bool {
    version >> 8 == Register::Version.reset() >> 8
}

/// Frames that can wait for the host, the delivered one included.
pub const WAITING_FRAMES: usize = 2;
/// Address of the order table's first entry; entry `i` is at `ORDER_TABLE + i`, read and write, 10
/// bits.
pub const ORDER_TABLE: u16 = 0x0400;
/// Most samples that a raw burst can have.
pub const RAW_SAMPLES_MAX: u16 = 4096;
/// Largest watchdog setting: one second. There is no way to switch it off.
pub const WATCHDOG_MAX: u32 = crate::ADC_HZ;
/// Clocks of a duty window: 8.4 ms.
pub const DUTY_WINDOW: u32 = 1 << 20;
/// Largest duty limit, and the one after reset: 62.5 % of the array lit on average.
pub const DUTY_LIMIT_MAX: u32 = DUTY_WINDOW / 4 * 5;
/// Largest latency setting.
pub const LATENCY_MAX: u8 = 63;

/// Bits of [`Register::Control`]. More than one at a time act in the order listed.
pub mod control {
    /// Ends a run or raw burst; the unfinished frame is discarded.
    pub const STOP: u32 = 1 << 0;
    /// Forgets a latched fault. Ignored while running.
    pub const CLEAR_FAULT: u32 = 1 << 1;
    /// Gives the delivered frame's buffer back. A frame that waits behind it is delivered at once.
    pub const RELEASE: u32 = 1 << 2;
    /// Starts a run, unless one is under way, a fault is latched, the interlock is open or a
    /// setting is out of range (then [`status::CONFIG_ERROR`](super::status::CONFIG_ERROR) is set).
    /// Resets the frame counters, drops undelivered frames and raw samples.
    pub const START: u32 = 1 << 3;
    /// Like `START`, for one raw burst: the sweep of the settings, from its first slot on, with
    /// every sample stored from clock 0, none summed, no latency or blanking applied.
    pub const START_RAW: u32 = 1 << 4;
}

/// Bits of [`Register::Status`].
pub mod status {
    /// A run or raw burst is under way.
    pub const RUNNING: u32 = 1 << 0;
    /// A frame can be read.
    pub const FRAME_READY: u32 = 1 << 1;
    /// A raw burst can be read.
    pub const RAW_READY: u32 = 1 << 2;
    /// LEDs are driven.
    pub const LEDS_ON: u32 = 1 << 3;
    /// A fault is latched.
    pub const FAULT: u32 = 1 << 4;
    /// The interlock input is closed.
    pub const INTERLOCK_CLOSED: u32 = 1 << 5;
    /// The last start was refused for a setting out of range; the next accepted start clears it.
    pub const CONFIG_ERROR: u32 = 1 << 6;
    /// The order table was written while running; the next accepted start clears it.
    pub const WRITE_REFUSED: u32 = 1 << 7;
}

/// Fields of [`Register::Clocks`].
pub mod clocks {
    /// Frequency of the ADC's data clock in units of [`UNIT_HZ`], by the FPGA's own oscillator, which is
    /// off by up to [`TOLERANCE_PERCENT`]. 0 without a clock, and in the first 0.4 ms.
    pub const FREQUENCY: u32 = 0xFFFF;
    /// The PLL that cleans the ADC's clock is locked.
    pub const LOCKED: u32 = 1 << 16;
    /// The PLL's output ticks.
    pub const ALIVE: u32 = 1 << 17;
    /// The ADC's domain is out of reset: its registers answer.
    pub const READY: u32 = 1 << 18;
    /// Unit of [`FREQUENCY`].
    pub const UNIT_HZ: u32 = 10_000;
    /// Clocks of the host port (310 MHz / 3) in which the ADC's clock is counted: 0.4 ms.
    pub const WINDOW: u32 = 41_333;
    /// Clocks of the ADC that count as one. In 0.4 ms, one stands for 10 kHz.
    pub const PRESCALER: u32 = 4;
    /// Largest error of the FPGA's own oscillator.
    pub const TOLERANCE_PERCENT: u32 = 15;

    /// Whether the ADC's domain answers, and its clock is that of [`ADC_HZ`](crate::ADC_HZ) as far as the
    /// FPGA's oscillator can tell.
    #[must_use]
    pub const fn fit(word: u32) -> bool {
        const EXPECTED: u32 = crate::ADC_HZ / UNIT_HZ;
        const OFF: u32 = EXPECTED * TOLERANCE_PERCENT / 100;
        let ready = LOCKED | ALIVE | READY;
        word & ready == ready && (word & FREQUENCY).abs_diff(EXPECTED) <= OFF
    }
}

/// Fields of [`Register::Sampling`].
///
/// Whenever the ADC's clock has come, and before anything else happens in its domain, the FPGA lets the ADC send
/// its checkerboard (each sample is [`CHECKERBOARD`](sampling::CHECKERBOARD) or its complement, in turn), moves its
/// sampling clock through one period in [`STEPS`](sampling::STEPS) steps, and stays in the middle of the longest
/// window of steps in which every sample is right.
pub mod sampling {
    /// Steps from the phase at which the gateware was built to the phase in use.
    pub const PHASE: u32 = 0xFF;
    /// Width of the window in steps, bits 8 to 15. 0 if no step was right: the phase is then as built.
    pub const WIDTH: u32 = 0xFF00;
    /// Steps of a period, bits 16 to 23.
    pub const PERIOD: u32 = 0x00FF_0000;
    /// The scan is over.
    pub const DONE: u32 = 1 << 24;
    /// Steps of a period: eight for each period of the PLL's oscillator, which has 625 MHz.
    pub const STEPS: u32 = 40;
    /// Samples that are looked at in each step.
    pub const SAMPLES: u32 = 256;
    /// One of the two samples of the checkerboard of a converter with 14 bits (Analog Devices AN-877, register
    /// 0x0D, value 4).
    pub const CHECKERBOARD: u16 = 0x2AAA;
    /// What is written to the ADC's serial port before the scan, 16 bits of address and 8 of data each: the
    /// checkerboard, and the transfer that makes it take effect (AN-877, registers 0x0D and 0xFF).
    pub const BEFORE: [u32; 2] = [0x0000_0D04, 0x0000_FF01];
    /// What is written after the scan: the converter's own samples again.
    pub const AFTER: [u32; 2] = [0x0000_0D00, 0x0000_FF01];
}

/// What gateware is built for: the value of [`Register::Design`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Design {
    /// The camera: clock and samples come from the ADC.
    Camera = 1,
    /// Two evaluation boards without an ADC: the clock comes from the FPGA board's oscillator, and samples
    /// from the levels of the LED lines ([`loopback`]).
    BringUp = 2,
}

impl Design {
    /// The design with this number.
    #[must_use]
    pub const fn from_register(value: u32) -> Option<Self> {
        match value {
            1 => Some(Self::Camera),
            2 => Some(Self::BringUp),
            _ => None,
        }
    }
}

/// Clock of [`Design::BringUp`]: the board's 12 MHz through a PLL.
pub const BRING_UP_HZ: u32 = 124_800_000;
/// Counts of one LED of the scene that [`loopback`] sees.
pub const LOOPBACK_COUNTS: u16 = 256;
/// Counts of [`loopback`] without light.
pub const LOOPBACK_DARK: u16 = 512;

/// The sample that [`Design::BringUp`] makes of the levels at the LED pins: the light of an array of which
/// only the LEDs on the diagonal reach the detector, all equally bright. A line that is stuck or joined to
/// another shows in the picture.
#[must_use]
pub const fn loopback(rows: u32, columns: u32, enable: bool) -> u16 {
    let lit = if enable { (!(rows ^ columns)).count_ones() } else { 0 };
    LOOPBACK_DARK + LOOPBACK_COUNTS * lit as u16
}

/// Bits of [`Register::Mode`].
pub mod mode {
    /// Shows complements too and keeps a negative half.
    pub const DIFFERENTIAL: u32 = 1 << 0;
    /// Sequency order without a table.
    pub const ORDER_SEQUENCY: u32 = 1 << 1;
    /// Order from the table; wins over `ORDER_SEQUENCY`.
    pub const ORDER_TABLE: u32 = 1 << 2;
    /// Samples from the test generator instead of the ADC.
    pub const TEST_SOURCE: u32 = 1 << 3;
    /// Frames are sent as packets of the host's link ([`ready`](crate::ready)).
    pub const PACKETS: u32 = 1 << 4;
    /// Samples of packets have 24 bits instead of 32: the lower bits of the difference. Without `PACKETS` the bit
    /// changes nothing.
    pub const NARROW: u32 = 1 << 5;
    /// Packets leave by the parallel port. A start with this bit and without `PACKETS` is refused.
    pub const PARALLEL: u32 = 1 << 6;
    /// Sweeps differ, with a period of four that begins with the run. Every second one, from the second on, shows each
    /// complement before its pattern. The third and the fourth invert all lines, which lights the same LEDs. The sums
    /// stay those of pattern and complement. What comes of the place in a pair, or of the lines' own charge, changes its
    /// sign and cancels in four sweeps. Without `DIFFERENTIAL` the bit changes nothing.
    pub const ALTERNATING: u32 = 1 << 7;
    /// The run shows its lines without light: the LED enable stays low, and nothing is spent of the light budget. All else
    /// is as in any run: samples, sums, frames, packets, raw bursts, interlock, faults.
    pub const UNLIT: u32 = 1 << 8;
    /// Every bit that has a meaning; a start with any other is refused.
    pub const DEFINED: u32 = DIFFERENTIAL
        | ORDER_SEQUENCY
        | ORDER_TABLE
        | TEST_SOURCE
        | PACKETS
        | NARROW
        | PARALLEL
        | ALTERNATING
        | UNLIT;
}

/// Reason latched in [`Register::Fault`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum FaultCode {
    /// None.
    None = 0,
    /// No access to the host port for [`Register::Watchdog`] clocks while running.
    Watchdog = 1,
    /// [`Register::DutyLimit`] exceeded.
    Duty = 2,
    /// [`Register::OverRangeTrip`] reached.
    OverRange = 3,
    /// The interlock opened while running.
    Interlock = 4,
}

impl FaultCode {
    /// The code with this number.
    #[must_use]
    pub const fn from_register(value: u32) -> Option<Self> {
        match value {
            0 => Some(Self::None),
            1 => Some(Self::Watchdog),
            2 => Some(Self::Duty),
            3 => Some(Self::OverRange),
            4 => Some(Self::Interlock),
            _ => None,
        }
    }
}

/// The test generator's state at the first clock of a run.
pub const TEST_SEED: u16 = 1;

/// The test generator's next state, which is also its next sample: a 14-bit Fibonacci shift
/// register, `x^14 + x^5 + x^3 + x + 1`, of period 2^14 - 1. The sample of a run's clock 0 is
/// [`TEST_SEED`]. The generator replaces the ADC, so latency and blanking apply as for any sample.
#[must_use]
pub const fn test_sample(state: u16) -> u16 {
    let bit = (state >> 13) ^ (state >> 4) ^ (state >> 2) ^ state;
    ((state << 1) | (bit & 1)) & crate::ADC_MAX
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_register_is_found_at_its_address_and_none_elsewhere() {
        for address in 0..=u16::MAX {
            if let Some(register) = Register::at(address) {
                assert_eq!(register.address(), address);
                assert!(address < ORDER_TABLE);
            }
        }
        let found = (0..=u16::MAX).filter_map(Register::at).count();
        assert_eq!(found, Register::ALL.len());
    }

    #[test]
    fn the_test_generator_visits_every_code_but_zero() {
        let mut state = TEST_SEED;
        let mut period = 0u32;
        loop {
            state = test_sample(state);
            period += 1;
            if state == TEST_SEED {
                break;
            }
        }
        assert_eq!(period, (1 << 14) - 1);
    }
}

//! The top level: connects the blocks, and offers the pins.
//!
//! # Invariant
//! A clock does sample, safety, storage and LEDs in this order, so a fault in a clock discards
//! whatever the same clock would have completed
//! (`golden::safety::a_fault_in_the_clock_that_completes_a_frame_discards_it`).

use crate::frames::Frames;
use crate::leds::{Leds, Lines};
use crate::order::OrderTable;
use crate::packet::Stamp;
use crate::parallel::on_lines;
use crate::raw::RawCapture;
use crate::registers::Registers;
use crate::safety::{Clock, Safety};
use crate::settings::Settings;
use crate::source::{AdcSample, Source};
use crate::window::Window;
use nirspi_wire::ADC_HZ;
use nirspi_wire::register::{Design, FaultCode, NO_CLOCK, Register, clocks, control, status};

/// Where the samples of a run go.
#[derive(Debug, Clone)]
enum Capture {
    Frames(Window),
    Raw(RawCapture),
}

/// A run or raw burst in progress.
#[derive(Debug, Clone)]
struct Run {
    settings: Settings,
    source: Source,
    leds: Leds,
    capture: Capture,
}

/// The FPGA.
///
/// `Default` is the state after power-up: registers at reset, interlock open, LEDs off, ADC clock present.
#[derive(Debug, Clone)]
pub struct Gateware {
    design: Design,
    /// The register `Sampling`.
    sampling: u32,
    /// Frequency of the ADC's clock in Hz; `None` without a clock.
    adc_hz: Option<u32>,
    /// Clocks since reset.
    clock: u64,
    /// The clock at the last read of its low word.
    clock_read: u64,
    registers: Registers,
    /// Writes taken since reset.
    writes: u32,
    table: OrderTable,
    config_error: bool,
    write_refused: bool,
    run: Option<Run>,
    safety: Safety,
    frames: Frames,
    raw: Option<Vec<u8>>,
}

impl Default for Gateware {
    fn default() -> Self {
        Self {
            design: Design::Camera,
            sampling: Register::Sampling.reset(),
            adc_hz: Some(ADC_HZ),
            clock: 0,
            clock_read: 0,
            registers: Registers::new(),
            writes: 0,
            table: OrderTable::new(),
            config_error: false,
            write_refused: false,
            run: None,
            safety: Safety::new(),
            frames: Frames::new(),
            raw: None,
        }
    }
}

impl Gateware {
    /// The state after power-up.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The state after power-up of this design.
    #[must_use]
    pub fn of(design: Design) -> Self {
        Self { design, ..Self::default() }
    }

    /// Sets the frequency of the ADC's clock in Hz; `None` takes the clock away. Without a clock only
    /// `Identity`, `Version`, `Clocks`, `Design` and `Sampling` answer, and no clock may be ticked. A clock that comes back
    /// finds everything as after power-up but the level of the interlock input.
    pub fn set_adc_clock(&mut self, hz: Option<u32>) {
        if self.adc_hz.is_some() != hz.is_some() {
            let closed = self.safety.interlock_closed();
            *self = Self { design: self.design, sampling: self.sampling, ..Self::default() };
            self.set_interlock(closed);
        }
        self.adc_hz = hz;
    }

    /// Sets what the board says of the ADC's sampling phase: the register [`Register::Sampling`]. The model has no
    /// phases; every sample is right.
    pub fn set_sampling(&mut self, word: u32) {
        self.sampling = word;
    }

    /// Whether the ADC's clock ticks.
    #[must_use]
    pub fn has_adc_clock(&self) -> bool {
        self.adc_hz.is_some()
    }

    fn clocks(&self) -> u32 {
        let Some(hz) = self.adc_hz else { return 0 };
        let frequency = (hz / clocks::UNIT_HZ).min(clocks::FREQUENCY);
        frequency | clocks::LOCKED | clocks::ALIVE | clocks::READY
    }

    /// Reads a register or an entry of the order table; `None` if the address has neither. Without a clock
    /// of the ADC, every address but those of the host port's own registers reads [`NO_CLOCK`].
    pub fn read(&mut self, address: u16) -> Option<u32> {
        self.safety.feed();
        match Register::at(address) {
            Some(Register::Clocks) => return Some(self.clocks()),
            Some(Register::Design) => return Some(self.design as u32),
            Some(Register::Sampling) => return Some(self.sampling),
            Some(Register::Identity | Register::Version) => {}
            _ if self.adc_hz.is_none() => return Some(NO_CLOCK),
            _ => {}
        }
        let Some(register) = Register::at(address) else {
            return self.table.at(address);
        };
        Some(match register {
            Register::Control => 0,
            Register::Writes => self.writes,
            Register::Status => self.status(),
            Register::Fault => self.safety.fault() as u32,
            Register::FramesMade => self.frames.made(),
            Register::FramesLost => self.frames.lost(),
            Register::SumLow => self.frames.measures().0 as u32,
            Register::SumHigh => (self.frames.measures().0 >> 32) as u32,
            Register::OverRange => self.frames.measures().1,
            Register::ClockLow => {
                self.clock_read = self.clock;
                self.clock as u32
            }
            Register::ClockHigh => (self.clock_read >> 32) as u32,
            constant_or_stored => self.registers.get(constant_or_stored),
        })
    }

    /// Writes a register or an entry of the order table; false if the address has neither. Writes
    /// to read-only registers, to the order table during a run, and without a clock of the ADC return true and
    /// change nothing.
    pub fn write(&mut self, address: u16, value: u32) -> bool {
        self.safety.feed();
        if self.adc_hz.is_none() {
            return true;
        }
        self.writes = self.writes.wrapping_add(1);
        match Register::at(address) {
            Some(Register::Control) => self.control(value),
            Some(register) => self.registers.set(register, value),
            None if self.table.at(address).is_none() => return false,
            None if self.running() => self.write_refused = true,
            None => self.table.write(address, value),
        }
        true
    }

    /// Levels of the LED lines in the current clock.
    #[must_use]
    pub fn lines(&self) -> Lines {
        // The last gate before the pins checks the permission again, though a trip has already
        // ended the run.
        match &self.run {
            Some(run) if self.safety.permits() => run.leds.lines(),
            _ => Lines::default(),
        }
    }

    /// Ends the current clock, for which the ADC delivers `sample`.
    #[inline]
    pub fn tick(&mut self, sample: AdcSample) {
        debug_assert!(self.adc_hz.is_some(), "a clock without a clock");
        let now = self.clock;
        self.clock = now.wrapping_add(1);
        self.safety.enter(now);
        let Some(run) = &mut self.run else { return };

        let sample = run.source.sample(sample);
        let over_range = match &mut run.capture {
            Capture::Frames(window) => window.take(&run.settings, sample),
            Capture::Raw(raw) => raw.take(sample),
        };
        let clock = Clock { half_arrays: run.leds.half_arrays(), over_range };
        if self.safety.step(&run.settings, clock) {
            self.run = None;
            return;
        }
        let over = match &mut run.capture {
            Capture::Frames(window) => window.step(&run.settings, &mut self.frames, now),
            Capture::Raw(raw) => {
                self.raw = raw.complete(&run.settings);
                self.raw.is_some()
            }
        };
        if over {
            self.run = None;
        } else {
            run.leds.step(&run.settings, &self.table);
        }
    }

    /// Whether a run or raw burst is in progress.
    #[must_use]
    pub fn running(&self) -> bool {
        self.run.is_some()
    }

    /// Whether a run or raw burst in progress takes the ADC's samples, and not those of the test generator.
    #[must_use]
    #[inline]
    pub fn reads_adc(&self) -> bool {
        self.run.as_ref().is_some_and(|run| !run.settings.test_source)
    }

    /// Level of the `frame ready` pin.
    #[must_use]
    pub fn frame_ready(&self) -> bool {
        self.frames.ready()
    }

    /// The delivered frame in the layout of [`nirspi_wire::fpga`], or with `PACKETS` as the packet of
    /// [`nirspi_wire::ready`]. The frame stays until `RELEASE` or the next start.
    pub fn frame(&mut self) -> Option<&[u8]> {
        self.safety.feed();
        self.frames.bytes()
    }

    /// What the parallel port sends next or is sending: the packet, with the zeros around it ([`on_lines`]). `None` while
    /// no frame of a run with `PARALLEL` waits. How fast the bytes go, only the receiver and the RTL know.
    pub fn outgoing(&mut self) -> Option<Vec<u8>> {
        self.frames.outgoing().map(on_lines)
    }

    /// The parallel port has sent the last of those bytes: the frame is taken back.
    pub fn sent(&mut self) {
        self.frames.sent();
    }

    /// Level of the `raw ready` pin.
    #[must_use]
    pub fn raw_ready(&self) -> bool {
        self.raw.is_some()
    }

    /// The raw burst: little-endian words, bit 15 set where the sample was over range. The burst
    /// stays until `RELEASE` or the next start.
    pub fn raw(&mut self) -> Option<&[u8]> {
        self.safety.feed();
        self.raw.as_deref()
    }

    /// Level of the interlock input; open after power-up. Opening it during a run is a fault.
    pub fn set_interlock(&mut self, closed: bool) {
        if self.safety.set_interlock(closed, self.running()) {
            self.run = None;
        }
    }

    fn status(&self) -> u32 {
        [
            (self.running(), status::RUNNING),
            (self.frames.ready(), status::FRAME_READY),
            (self.raw_ready(), status::RAW_READY),
            (self.lines().enable, status::LEDS_ON),
            (self.safety.fault() != FaultCode::None, status::FAULT),
            (self.safety.interlock_closed(), status::INTERLOCK_CLOSED),
            (self.config_error, status::CONFIG_ERROR),
            (self.write_refused, status::WRITE_REFUSED),
        ]
        .into_iter()
        .filter(|(set, _)| *set)
        .fold(0, |word, (_, bit)| word | bit)
    }

    fn control(&mut self, word: u32) {
        if word & control::STOP != 0 {
            self.run = None;
        }
        // A latched fault has already ended the run, so clearing the fault changes no run.
        if word & control::CLEAR_FAULT != 0 {
            self.safety.clear();
        }
        if word & control::RELEASE != 0 {
            self.frames.release();
            self.raw = None;
        }
        if word & control::START != 0 {
            self.start(|settings, now| Capture::Frames(Window::start(settings, now)));
        }
        if word & control::START_RAW != 0 {
            self.start(|settings, _| {
                settings.frames = 0;
                Capture::Raw(RawCapture::start(settings))
            });
        }
    }

    /// What packets of a run that starts now carry beside their frames.
    fn stamp(&self) -> Stamp {
        let word = |register| self.registers.get(register);
        let (low, high) = (word(Register::TimeLow), word(Register::TimeHigh));
        Stamp {
            run: word(Register::Run) as u16,
            clock: self.clock_read,
            time_us: u64::from(high) << 32 | u64::from(low),
        }
    }

    fn start(&mut self, capture: impl FnOnce(&mut Settings, u64) -> Capture) {
        if self.running() || !self.safety.permits() {
            return;
        }
        let Some(mut settings) = Settings::copy(&self.registers) else {
            self.config_error = true;
            return;
        };
        let capture = capture(&mut settings, self.clock);
        self.config_error = false;
        self.write_refused = false;
        self.frames.restart(self.stamp(), settings.parallel);
        self.raw = None;
        self.run = Some(Run {
            source: Source::new(settings.test_source),
            leds: Leds::start(&settings, &self.table),
            capture,
            settings,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 2^32 clocks are 34 s of the instrument: too many to tick.
    #[test]
    fn both_words_of_the_clock_belong_to_one_moment() {
        let mut gateware = Gateware { clock: (7 << 32) - 1, ..Gateware::new() };
        assert_eq!(gateware.read(Register::ClockLow.address()), Some(u32::MAX));
        gateware.tick(AdcSample::default());
        assert_eq!(gateware.read(Register::ClockHigh.address()), Some(6));
        assert_eq!(gateware.read(Register::ClockLow.address()), Some(0));
        assert_eq!(gateware.read(Register::ClockHigh.address()), Some(7));
    }
}

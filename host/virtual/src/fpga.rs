//! The golden model of the gateware, with simulated light, behind the firmware's FPGA bus.

use nirspi_hdl_model::{AdcSample, Gateware, Lines};
use nirspi_mcu::{BusError, FpgaBus};
use nirspi_optics::rain::RainySpots;
use nirspi_optics::{Chain, LedArray, MovingTarget};
use nirspi_wire::register::{BRING_UP_HZ, Design, loopback};
use std::collections::VecDeque;

/// ADC clocks between two updates of the drops: one differential sweep, in which a 2 mm drop falls
/// half a millimetre.
const WEATHER_CLOCKS: u64 = 10_240;
/// The most that a target moves between two updates, in pixels.
const STEP_PX: f64 = 0.02;
/// The fewest ADC clocks between two updates.
const LEAST_CLOCKS: u64 = 64;

/// An FPGA whose time the virtual camera advances.
pub trait SimulatedFpga: FpgaBus + Send {
    /// Advances the time by ADC clocks.
    fn advance(&mut self, clocks: u32);
    /// ADC clocks since power-up.
    fn clock(&self) -> u64;
    /// Whether LEDs can be lit: a run or raw burst is under way.
    fn running(&self) -> bool;
    /// Opens or closes the interlock input.
    fn set_interlock(&mut self, closed: bool);
    /// Sets the level of the board's own LED enable, which the array joins with the FPGA's by an AND gate.
    fn set_board_enable(&mut self, high: bool);
}

/// One of the two LED enables, which is high whatever its chip says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StuckEnable {
    /// The FPGA's.
    Fpga,
    /// The board's.
    Board,
}

/// The LED array's answer to the lines of the FPGA: its settled light in electrons a sample.
/// Correct wiring gives [`LedArray::light`] of the lines unchanged; tests use faulty wiring. The receiver then sees the sum
/// of the light rise or fall, not single LEDs: with LEDs whose rise and fall differ, this is coarse. No lines inject charge.
pub type Wiring = Box<dyn FnMut(&mut LedArray, Lines) -> f32 + Send>;

/// The golden model of the gateware between an LED array and a photodiode's ADC.
pub struct OpticalFpga {
    detector: Detector,
    wiring: Option<Wiring>,
    clock: u64,
    front: Option<Front>,
    /// The clock of the last update of what changes in front of the array.
    updated: u64,
    /// The levels at the LED pins in the last clocks, of a bring-up design.
    loopback: Option<VecDeque<Lines>>,
}

/// The gateware with the light that its detector gets.
struct Detector {
    gateware: Gateware,
    array: LedArray,
    chain: Chain,
    /// The lines whose light the chain holds; `None` if the light has changed without them.
    shown: Option<Lines>,
    /// Whether there was light since the chain has rested.
    lit: bool,
    /// Level of the board's LED enable. High until a board sets it, for tests of the FPGA alone.
    board_enable: bool,
    stuck: Option<StuckEnable>,
}

impl Detector {
    /// Powers up with the interlock closed.
    fn new(array: LedArray, chain: Chain) -> Self {
        let mut gateware = Gateware::new();
        gateware.set_interlock(true);
        Self { gateware, array, chain, shown: None, lit: false, board_enable: true, stuck: None }
    }

    /// The lines as the LEDs have them, behind the gate of the two enables.
    #[inline(always)]
    fn lines(&self) -> Lines {
        let lines = self.gateware.lines();
        let fpga = lines.enable || self.stuck == Some(StuckEnable::Fpga);
        let board = self.board_enable || self.stuck == Some(StuckEnable::Board);
        Lines { enable: fpga && board, ..lines }
    }

    /// Changes what is in front of the LEDs.
    fn relight(&mut self, reflectance: &[f32], electrons_per_led: f64) {
        self.array.relight(reflectance, electrons_per_led);
        self.shown = None;
    }

    /// The sample of the light of these lines.
    // Apart from the loops of `advance`, which take what is called there alone into themselves.
    #[inline(never)]
    fn sample(&mut self, lines: Lines) -> AdcSample {
        if self.chain.sees_switching() {
            self.switching_sample(lines)
        } else {
            self.linear_sample(lines)
        }
    }

    /// Of a camera whose light is described by its sum.
    #[inline(always)]
    fn linear_sample(&mut self, lines: Lines) -> AdcSample {
        let light = self.array.light(lines.rows, lines.columns, lines.enable);
        word(self.chain.sample_sum(light))
    }

    /// Of a camera with LEDs and lines that switch one by one.
    #[inline(always)]
    fn switching_sample(&mut self, lines: Lines) -> AdcSample {
        let new = (self.shown != Some(lines)).then(|| {
            self.shown = Some(lines);
            self.array.step(lines.rows, lines.columns, lines.enable)
        });
        word(self.chain.sample_switching(new))
    }

    /// Advances the time. A simulation spends most of its time here.
    fn advance(&mut self, clocks: u64) {
        if self.chain.sees_switching() {
            self.advance_with(clocks, Self::switching_sample);
        } else {
            self.advance_with(clocks, Self::linear_sample);
        }
    }

    #[inline(always)]
    fn advance_with(&mut self, clocks: u64, sample: impl Fn(&mut Self, Lines) -> AdcSample) {
        for _ in 0..clocks {
            // The ADC is not read outside a run nor in one of the test generator, and drawing its noise is most of the work.
            let sample = if self.gateware.reads_adc() {
                self.lit = true;
                sample(self, self.lines())
            } else {
                self.rest();
                DARK
            };
            self.gateware.tick(sample);
        }
    }

    /// What is seen of the light between two runs: the next one begins in the dark.
    #[inline]
    fn rest(&mut self) {
        if std::mem::take(&mut self.lit) {
            let Lines { rows, columns, .. } = self.gateware.lines();
            self.array.step(rows, columns, false);
            self.shown = None;
            self.chain.rest();
        }
    }
}

/// What the gateware gets of the ADC outside a run.
const DARK: AdcSample = AdcSample { code: 0, over_range: false };

/// The ADC's word, as the gateware gets it.
#[inline]
fn word(sample: nirspi_optics::AdcSample) -> AdcSample {
    AdcSample { code: sample.counts, over_range: sample.over_range }
}

/// Clocks from the choice of the levels at the LED pins to the sample that `Design::BringUp` makes of them: two
/// registers on the way out, one on the way in, four of `loopback`.
const LOOPBACK_CLOCKS: usize = 7;

/// What changes in front of the array: rain, a target that moves, or both.
pub struct Front {
    /// Rain between array and target.
    pub rain: Option<RainySpots>,
    /// A target that moves.
    pub target: Option<MovingTarget>,
    /// Electrons a sample of an LED on a white target in dry air.
    pub electrons_per_led: f64,
}

impl Front {
    /// ADC clocks between two updates.
    fn clocks(&self) -> u64 {
        let target = self.target.as_ref().map_or(u64::MAX, |target| {
            let clocks = target.seconds_for(STEP_PX) * f64::from(nirspi_wire::ADC_HZ);
            (clocks as u64).max(LEAST_CLOCKS)
        });
        target.min(WEATHER_CLOCKS)
    }

    /// The reflectances that the spots see, `passed` seconds after the last call and `now` seconds after the start.
    fn reflectance(&mut self, passed: f64, now: f64) -> Vec<f32> {
        let seen = self.target.as_ref().map(|target| target.seen(now));
        match (&mut self.rain, seen) {
            (Some(rain), seen) => {
                if let Some(seen) = seen {
                    rain.look_at(seen);
                }
                rain.advance(passed);
                rain.reflectance()
            }
            (None, seen) => seen.unwrap_or_default(),
        }
    }
}

impl OpticalFpga {
    /// Powers up in front of a scene, with the interlock closed.
    #[must_use]
    pub fn new(array: LedArray, chain: Chain) -> Self {
        let detector = Detector::new(array, chain);
        let (wiring, front, loopback) = (None, None, None);
        Self { detector, wiring, clock: 0, front, updated: 0, loopback }
    }

    /// The bring-up design on the same boards: neither ADC nor LEDs.
    #[must_use]
    pub fn bring_up(self) -> Self {
        let mut gateware = Gateware::of(Design::BringUp);
        gateware.set_adc_clock(Some(BRING_UP_HZ));
        gateware.set_interlock(true);
        let loopback = Some(VecDeque::from([Lines::default(); LOOPBACK_CLOCKS]));
        let detector = Detector { gateware, ..self.detector };
        Self { detector, loopback, front: None, ..self }
    }

    /// Loses everything, as after a dip of the supply: registers, frames, LEDs off. The clock starts again at 0
    /// in the gateware; the time of the simulation goes on.
    pub fn reset(&mut self) {
        self.detector.gateware = Gateware::new();
        self.detector.gateware.set_interlock(true);
    }

    /// The next packet that the FPGA's parallel port sends, which then counts as sent.
    pub fn parallel_packet(&mut self) -> Option<Vec<u8>> {
        let packet = self.detector.gateware.outgoing()?;
        self.detector.gateware.sent();
        Some(packet)
    }

    /// Whether the FPGA lets LEDs shine now.
    #[must_use]
    pub fn leds_on(&self) -> bool {
        self.detector.gateware.lines().enable
    }

    /// Whether LEDs can shine now: whether both enables are high, or look so.
    #[must_use]
    pub fn shines(&self) -> bool {
        self.detector.lines().enable
    }

    /// The same camera with an LED enable that is stuck high.
    #[must_use]
    pub fn stuck(mut self, enable: StuckEnable) -> Self {
        self.detector.stuck = Some(enable);
        self
    }

    /// The same camera with another frequency of the ADC's clock in Hz; `None` is no clock at all.
    #[must_use]
    pub fn adc_clock(mut self, hz: Option<u32>) -> Self {
        self.detector.gateware.set_adc_clock(hz);
        self
    }

    /// The sample of a clock in a run.
    fn sample(&mut self) -> AdcSample {
        let lines = self.detector.lines();
        if let Some(late) = &mut self.loopback {
            // The design sees the levels of its own pins.
            late.push_back(self.detector.gateware.lines());
            let seen = late.pop_front().unwrap_or_default();
            let code = loopback(seen.rows, seen.columns, seen.enable);
            return AdcSample { code, over_range: false };
        }
        match &mut self.wiring {
            None => self.detector.sample(lines),
            Some(wiring) => {
                let light = wiring(&mut self.detector.array, lines);
                word(self.detector.chain.sample(light))
            }
        }
    }

    /// One clock.
    fn tick(&mut self) {
        let gateware = &self.detector.gateware;
        let sample = if gateware.reads_adc() || self.loopback.is_some() && gateware.running() {
            self.detector.lit = true;
            self.sample()
        } else {
            self.detector.rest();
            DARK
        };
        self.detector.gateware.tick(sample);
    }

    /// The same camera with other wiring between FPGA and LEDs.
    #[must_use]
    pub fn wired(self, wiring: impl FnMut(&mut LedArray, Lines) -> f32 + Send + 'static) -> Self {
        Self { wiring: Some(Box::new(wiring)), ..self }
    }

    /// The same camera with something in front of it that changes.
    #[must_use]
    pub fn behind(mut self, mut front: Front) -> Self {
        self.detector.relight(&front.reflectance(0.0, 0.0), front.electrons_per_led);
        self.front = Some(front);
        self
    }

    /// Updates what changes in front of the array if the last update is long ago. Returns the clocks until the next update;
    /// outside a run, and before a target at rest in dry air, nothing is to be updated.
    fn look_in_front(&mut self) -> u64 {
        let (now, running) = (self.clock, self.running());
        let Some(front) = self.front.as_mut().filter(|_| running) else { return u64::MAX };
        let (passed, clocks) = (now - self.updated, front.clocks());
        if passed < clocks {
            return clocks - passed;
        }
        let seconds = |clocks: u64| clocks as f64 / f64::from(nirspi_wire::ADC_HZ);
        let reflectance = front.reflectance(seconds(passed), seconds(now));
        self.detector.relight(&reflectance, front.electrons_per_led);
        self.updated = now;
        clocks
    }
}

impl SimulatedFpga for OpticalFpga {
    fn advance(&mut self, clocks: u32) {
        let end = self.clock + u64::from(clocks);
        if !self.detector.gateware.has_adc_clock() {
            self.clock = end;
        }
        // A camera without these needs none of their checks in each clock: docs/log/performance.md has its speed.
        let plain = self.wiring.is_none() && self.loopback.is_none();
        while self.clock < end {
            let stretch = self.look_in_front().min(end - self.clock);
            if plain {
                self.detector.advance(stretch);
            } else {
                (0..stretch).for_each(|_| self.tick());
            }
            self.clock += stretch;
        }
    }

    fn clock(&self) -> u64 {
        self.clock
    }

    fn running(&self) -> bool {
        self.detector.gateware.running()
    }

    fn set_interlock(&mut self, closed: bool) {
        self.detector.gateware.set_interlock(closed);
    }

    fn set_board_enable(&mut self, high: bool) {
        self.detector.board_enable = high;
    }
}

impl FpgaBus for OpticalFpga {
    fn read(&mut self, address: u16) -> Result<u32, BusError> {
        // An address without a register reads as zero, as on the real port.
        Ok(self.detector.gateware.read(address).unwrap_or(0))
    }

    fn write(&mut self, address: u16, value: u32) -> Result<(), BusError> {
        self.detector.gateware.write(address, value);
        Ok(())
    }

    fn frame_ready(&mut self) -> bool {
        self.detector.gateware.frame_ready()
    }

    fn raw_ready(&mut self) -> bool {
        self.detector.gateware.raw_ready()
    }

    fn frame(&mut self) -> Result<Option<&[u8]>, BusError> {
        Ok(self.detector.gateware.frame())
    }

    fn raw(&mut self) -> Result<Option<&[u8]>, BusError> {
        Ok(self.detector.gateware.raw())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::VirtualOptics;
    use nirspi_optics::rain::Air;
    use nirspi_optics::{CameraModel, Scene};
    use nirspi_wire::register::{Register, control, mode};

    /// Frames of a run that is advanced in stretches of these lengths.
    fn frames(mut fpga: OpticalFpga, stretches: &[u32]) -> Vec<Vec<u8>> {
        for (register, value) in [
            (Register::Mode, mode::DIFFERENTIAL),
            (Register::Patterns, 64),
            (Register::Frames, 60),
            (Register::Control, control::START),
        ] {
            fpga.write(register.address(), value).unwrap();
        }
        let mut frames = Vec::new();
        // Two frames take 1280 clocks, and three can wait.
        for stretch in stretches.iter().cycle() {
            if !fpga.running() && !fpga.frame_ready() {
                break;
            }
            fpga.advance(*stretch);
            while let Some(frame) = fpga.frame().unwrap() {
                frames.push(frame.to_vec());
                fpga.write(Register::Control.address(), control::RELEASE).unwrap();
            }
        }
        frames
    }

    const CIRCUIT: &str = "[leds]\nrise_ns = 12.8\nfall_ns = 16.3\nturn_on_delay_ns = 1.4\ntile_sag = 0.0165\n\
                           line_crosstalk_ff = 1";

    /// The chain holds the light of lines that do not change.
    #[test]
    fn what_changes_in_front_of_the_leds_is_seen_without_a_change_of_the_lines() {
        let camera = CameraModel::parse(CIRCUIT).unwrap();
        let optics = VirtualOptics::of(&camera, Scene::white(), 300.0).unwrap().noiseless();
        let mut detector = optics.fpga(1).unwrap().detector;
        let lines = Lines { rows: 0, columns: 0, enable: true };
        let settled = |detector: &mut Detector| {
            (0..100).map(|_| detector.sample(lines).code).last().unwrap_or_default()
        };
        let white = settled(&mut detector);
        detector.relight(&[0.0; 1024], 26.0);
        let black = settled(&mut detector);
        assert!(white > black + 5000, "{white} {black}");
    }

    /// In rain the drops move three times within the run, in whichever stretches the time passes.
    #[test]
    fn the_same_light_comes_in_long_stretches_and_clock_by_clock() {
        let mut seen_by = Vec::new();
        for (air, camera) in [("none", ""), ("heavy", ""), ("none", CIRCUIT), ("heavy", CIRCUIT)] {
            let air: Air = air.parse().unwrap();
            let is_circuit = !camera.is_empty();
            let camera = CameraModel::parse(camera).unwrap();
            let optics = VirtualOptics::of(&camera, Scene::white(), 300.0).unwrap();
            let optics = optics.in_air(&air).unwrap();
            let fpga = || optics.fpga(1).unwrap();
            let seen = frames(fpga(), &[1280]);
            assert_eq!(seen.len(), 60);
            assert_eq!(frames(fpga(), &[1, 7, 1023]), seen);
            assert!(!seen_by.contains(&seen), "{air} {is_circuit}");
            seen_by.push(seen.clone());
            if is_circuit {
                // Of faulty wiring only the sum of the light is known.
                continue;
            }
            let wired =
                fpga().wired(|array, lines| array.light(lines.rows, lines.columns, lines.enable));
            assert_eq!(frames(wired, &[999]), seen, "by the loop of faulty wiring");
        }
    }
}

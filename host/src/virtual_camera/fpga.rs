//! The golden model of the gateware, with simulated light, behind the firmware's FPGA bus.

use nirspi_hdl_model::{AdcSample, Gateware, Lines};
use nirspi_mcu::{BusError, FpgaBus};
use nirspi_optics::rain::RainySpots;
use nirspi_optics::{Chain, LedArray};
use nirspi_wire::register::{BRING_UP_HZ, Design, FaultCode, Register, loopback, status};
use std::collections::VecDeque;

/// ADC clocks between two updates of the drops: one differential sweep, in which a 2 mm drop falls
/// half a millimetre.
const WEATHER_CLOCKS: u64 = 10_240;

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
}

/// The LED array's answer to the lines of the FPGA: its settled light in electrons a sample.
/// Correct wiring gives [`LedArray::light`] of the lines unchanged; tests use faulty wiring.
pub type Wiring = Box<dyn FnMut(&mut LedArray, Lines) -> f32 + Send>;

/// The golden model of the gateware between an LED array and a photodiode's ADC.
pub struct OpticalFpga {
    gateware: Gateware,
    array: LedArray,
    wiring: Option<Wiring>,
    chain: Chain,
    /// Detectors beside the first one.
    further: Vec<Detector>,
    clock: u64,
    rain: Option<Rain>,
    /// The levels at the LED pins in the last clocks, of a bring-up design.
    loopback: Option<VecDeque<Lines>>,
}

/// A further detector behind an ADC of its own. Its gateware is a second copy of the model that gets every access of the
/// first one, so both show the same patterns in the same clocks.
struct Detector {
    gateware: Gateware,
    array: LedArray,
    chain: Chain,
}

/// Clocks from the choice of the levels at the LED pins to the sample that `Design::BringUp` makes of them: two
/// registers on the way out, one on the way in, four of `loopback`.
const LOOPBACK_CLOCKS: usize = 7;

/// Rain between the array and the scene.
struct Rain {
    spots: RainySpots,
    electrons_per_led: f64,
    /// The clock of the last update of the drops.
    seen: u64,
}

impl OpticalFpga {
    /// Powers up in front of a scene, with the interlock closed.
    #[must_use]
    pub fn new(array: LedArray, chain: Chain) -> Self {
        let mut gateware = Gateware::new();
        gateware.set_interlock(true);
        let (wiring, further, rain, loopback) = (None, Vec::new(), None, None);
        Self { gateware, array, wiring, chain, further, clock: 0, rain, loopback }
    }

    /// The same camera with a further detector, which has the light of `array`.
    #[must_use]
    pub fn with_detector(mut self, array: LedArray, chain: Chain) -> Self {
        let mut gateware = Gateware::new();
        gateware.set_interlock(true);
        self.further.push(Detector { gateware, array, chain });
        self
    }

    /// The bring-up design on the same boards: neither ADC nor LEDs.
    #[must_use]
    pub fn bring_up(self) -> Self {
        let mut gateware = Gateware::of(Design::BringUp);
        gateware.set_adc_clock(Some(BRING_UP_HZ));
        gateware.set_interlock(true);
        let loopback = Some(VecDeque::from([Lines::default(); LOOPBACK_CLOCKS]));
        Self { gateware, loopback, further: Vec::new(), ..self }
    }

    /// Loses everything, as after a dip of the supply: registers, frames, LEDs off. The clock starts again at 0
    /// in the gateware; the time of the simulation goes on.
    pub fn reset(&mut self) {
        for gateware in self.gatewares() {
            *gateware = Gateware::new();
            gateware.set_interlock(true);
        }
    }

    fn gatewares(&mut self) -> impl Iterator<Item = &mut Gateware> {
        std::iter::once(&mut self.gateware)
            .chain(self.further.iter_mut().map(|detector| &mut detector.gateware))
    }

    /// Whether the FPGA lets LEDs shine now.
    #[must_use]
    pub fn leds_on(&self) -> bool {
        self.lines().enable
    }

    /// The levels at the LED pins. Each detector's gateware can switch the LEDs off.
    fn lines(&self) -> Lines {
        let lines = self.gateware.lines();
        let all_enable = self.further.iter().all(|detector| detector.gateware.lines().enable);
        Lines { enable: lines.enable && all_enable, ..lines }
    }

    /// The same camera with another frequency of the ADC's clock in Hz; `None` is no clock at all.
    #[must_use]
    pub fn adc_clock(mut self, hz: Option<u32>) -> Self {
        self.gatewares().for_each(|gateware| gateware.set_adc_clock(hz));
        self
    }

    /// The sample of a clock in a run. The gateware of each further detector takes its own sample.
    fn sample(&mut self, at: u64) -> AdcSample {
        let lines = self.lines();
        if let Some(late) = &mut self.loopback {
            late.push_back(lines);
            let seen = late.pop_front().unwrap_or_default();
            let code = loopback(seen.rows, seen.columns, seen.enable);
            return AdcSample { code, over_range: false };
        }
        if self.rain.is_some() {
            self.look_at_the_rain(at);
        }
        for Detector { gateware, array, chain } in &mut self.further {
            let sample = chain.sample(array.light(lines.rows, lines.columns, lines.enable));
            gateware.tick(AdcSample { code: sample.counts, over_range: sample.over_range });
        }
        let light = match &mut self.wiring {
            None => self.array.light(lines.rows, lines.columns, lines.enable),
            Some(wiring) => wiring(&mut self.array, lines),
        };
        let sample = self.chain.sample(light);
        AdcSample { code: sample.counts, over_range: sample.over_range }
    }

    /// The same camera with other wiring between FPGA and LEDs.
    #[must_use]
    pub fn wired(self, wiring: impl FnMut(&mut LedArray, Lines) -> f32 + Send + 'static) -> Self {
        Self { wiring: Some(Box::new(wiring)), ..self }
    }

    /// The same camera with rain in front of it. In dry air, an LED on a white target gives
    /// `electrons_per_led`.
    #[must_use]
    pub fn in_rain(mut self, spots: RainySpots, electrons_per_led: f64) -> Self {
        let reflectance = spots.reflectance();
        for array in self.arrays() {
            array.relight(&reflectance, electrons_per_led);
        }
        self.rain = Some(Rain { spots, electrons_per_led, seen: 0 });
        self
    }

    /// Updates the positions of the drops for `clock`, if the last update is long ago.
    fn look_at_the_rain(&mut self, clock: u64) {
        let Some(rain) = self.rain.as_mut().filter(|rain| clock - rain.seen >= WEATHER_CLOCKS)
        else {
            return;
        };
        rain.spots.advance((clock - rain.seen) as f64 / f64::from(nirspi_wire::ADC_HZ));
        rain.seen = clock;
        let (reflectance, electrons_per_led) = (rain.spots.reflectance(), rain.electrons_per_led);
        for array in self.arrays() {
            array.relight(&reflectance, electrons_per_led);
        }
    }

    fn arrays(&mut self) -> impl Iterator<Item = &mut LedArray> {
        std::iter::once(&mut self.array)
            .chain(self.further.iter_mut().map(|detector| &mut detector.array))
    }
}

impl SimulatedFpga for OpticalFpga {
    fn advance(&mut self, clocks: u32) {
        let begun = self.clock;
        self.clock += u64::from(clocks);
        if !self.gateware.has_adc_clock() {
            return;
        }
        for passed in 0..clocks {
            // The ADC is not read outside a run, and drawing its noise is most of the work.
            let sample = if self.gateware.running() {
                self.sample(begun + u64::from(passed))
            } else {
                let dark = AdcSample { code: 0, over_range: false };
                self.further.iter_mut().for_each(|detector| detector.gateware.tick(dark));
                dark
            };
            self.gateware.tick(sample);
        }
    }

    fn clock(&self) -> u64 {
        self.clock
    }

    fn running(&self) -> bool {
        self.gateware.running()
    }

    fn set_interlock(&mut self, closed: bool) {
        self.gatewares().for_each(|gateware| gateware.set_interlock(closed));
    }
}

impl FpgaBus for OpticalFpga {
    fn read(&mut self, address: u16) -> Result<u32, BusError> {
        // An address without a register reads as zero, as on the real port.
        let mut answer = self.gateware.read(address).unwrap_or(0);
        for detector in &mut self.further {
            let own = detector.gateware.read(address).unwrap_or(0);
            // A fault that one detector has found, such as light over its range, is a fault of the camera.
            match Register::at(address) {
                Some(Register::Status) => answer |= own & status::FAULT,
                Some(Register::Fault) if answer == FaultCode::None as u32 => answer = own,
                _ => {}
            }
        }
        Ok(answer)
    }

    fn write(&mut self, address: u16, value: u32) -> Result<(), BusError> {
        for gateware in self.gatewares() {
            gateware.write(address, value);
        }
        Ok(())
    }

    fn detectors(&self) -> u8 {
        self.further.len().try_into().map_or(u8::MAX, |further: u8| further.saturating_add(1))
    }

    fn channel(&mut self, detector: u8) -> Result<Option<&[u8]>, BusError> {
        let of_further = usize::from(detector).checked_sub(1);
        let found = of_further.and_then(|at| self.further.get_mut(at));
        Ok(found.and_then(|detector| detector.gateware.frame()))
    }

    fn frame_ready(&mut self) -> bool {
        self.gateware.frame_ready()
    }

    fn raw_ready(&mut self) -> bool {
        self.gateware.raw_ready()
    }

    fn frame(&mut self) -> Result<Option<&[u8]>, BusError> {
        Ok(self.gateware.frame())
    }

    fn raw(&mut self) -> Result<Option<&[u8]>, BusError> {
        Ok(self.gateware.raw())
    }
}

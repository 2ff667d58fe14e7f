//! The golden model of the gateware, with simulated light, behind the firmware's FPGA bus.

use nirspi_hdl_model::{AdcSample, Gateware, Lines};
use nirspi_mcu::{BusError, FpgaBus};
use nirspi_optics::rain::RainySpots;
use nirspi_optics::{Chain, LedArray};
use nirspi_wire::register::{BRING_UP_HZ, Design, loopback};
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
    clock: u64,
    rain: Option<Rain>,
    /// The levels at the LED pins in the last clocks, of a bring-up design.
    loopback: Option<VecDeque<Lines>>,
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
        Self { gateware, array, wiring: None, chain, clock: 0, rain: None, loopback: None }
    }

    /// The bring-up design on the same boards: neither ADC nor LEDs.
    #[must_use]
    pub fn bring_up(self) -> Self {
        let mut gateware = Gateware::of(Design::BringUp);
        gateware.set_adc_clock(Some(BRING_UP_HZ));
        gateware.set_interlock(true);
        let loopback = Some(VecDeque::from([Lines::default(); LOOPBACK_CLOCKS]));
        Self { gateware, loopback, ..self }
    }

    /// Loses everything, as after a dip of the supply: registers, frames, LEDs off. The clock starts again at 0
    /// in the gateware; the time of the simulation goes on.
    pub fn reset(&mut self) {
        self.gateware = Gateware::new();
        self.gateware.set_interlock(true);
    }

    /// Whether the FPGA lets LEDs shine now.
    #[must_use]
    pub fn leds_on(&self) -> bool {
        self.gateware.lines().enable
    }

    /// The same camera with another frequency of the ADC's clock in Hz; `None` is no clock at all.
    #[must_use]
    pub fn adc_clock(mut self, hz: Option<u32>) -> Self {
        self.gateware.set_adc_clock(hz);
        self
    }

    /// The sample of a clock in a run.
    fn sample(&mut self, at: u64) -> AdcSample {
        let lines = self.gateware.lines();
        if let Some(late) = &mut self.loopback {
            late.push_back(lines);
            let seen = late.pop_front().unwrap_or_default();
            let code = loopback(seen.rows, seen.columns, seen.enable);
            return AdcSample { code, over_range: false };
        }
        if self.rain.is_some() {
            self.look_at_the_rain(at);
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
        self.array.relight(&spots.reflectance(), electrons_per_led);
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
        self.array.relight(&rain.spots.reflectance(), rain.electrons_per_led);
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
                AdcSample { code: 0, over_range: false }
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
        self.gateware.set_interlock(closed);
    }
}

impl FpgaBus for OpticalFpga {
    fn read(&mut self, address: u16) -> Result<u32, BusError> {
        // An address without a register reads as zero, as on the real port.
        Ok(self.gateware.read(address).unwrap_or(0))
    }

    fn write(&mut self, address: u16, value: u32) -> Result<(), BusError> {
        self.gateware.write(address, value);
        Ok(())
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

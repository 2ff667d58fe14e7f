//! Sensors, LED enable, watchdog, restart.

use crate::{clocks, crash, restart};
use embassy_stm32::adc::{Adc, AdcConfig, AnyAdcChannel, Averaging, SampleTime};
use embassy_stm32::gpio::{Input, Output};
use embassy_stm32::peripherals::{ADC1, IWDG};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_time::{Duration, Instant};
use nirspi_app::Board;
use nirspi_mcu::ntc::Thermistor;
use nirspi_mcu::{Inputs, Lamps};
use nirspi_wire::RebootInto;

/// The system memory's boot loader (AN2606, STM32U59x and U5Ax).
pub const BOOTLOADER: usize = 0x0BF9_0000;

/// A conversion takes 22 us.
const TEMPERATURE_PERIOD: Duration = Duration::from_micros(nirspi_mcu::TEMPERATURE_PERIOD_US);

/// The thermistor at the LED array, and the resistor in series with it. An array with another thermistor needs other
/// numbers here.
const THERMISTOR: Thermistor = Thermistor::REFERENCE;

/// 14 bits, the mean of 16 conversions.
pub fn adc_config() -> AdcConfig {
    AdcConfig { averaging: Some(Averaging::Samples16), ..AdcConfig::default() }
}

/// The board's own parts.
pub struct Nucleo {
    pub led_enable: Output<'static>,
    pub lamp_ready: Option<Output<'static>>,
    pub lamp_light: Output<'static>,
    pub lamp_fault: Output<'static>,
    pub interlock: Input<'static>,
    pub adc: Adc<'static, ADC1>,
    pub thermistor: AnyAdcChannel<'static, ADC1>,
    pub temperature: Option<i16>,
    pub temperature_due: Instant,
    pub watchdog: IndependentWatchdog<'static, IWDG>,
}

impl Board for Nucleo {
    fn inputs(&mut self) -> Inputs {
        if clocks::supply_is_low() {
            crash::die(format_args!("the supply is below 2.8 V"));
        }
        if Instant::now() >= self.temperature_due {
            let reading = self.adc.blocking_read(&mut self.thermistor, SampleTime::CYCLES39_5);
            self.temperature = THERMISTOR.centi_celsius(reading << 2);
            self.temperature_due = Instant::now() + TEMPERATURE_PERIOD;
        }
        Inputs {
            interlock_closed: self.interlock.is_high(),
            temperature_centi_celsius: self.temperature,
        }
    }

    fn enable_leds(&mut self, enabled: bool) {
        self.led_enable.set_level(enabled.into());
    }

    fn show(&mut self, Lamps { ready, light, fault }: Lamps) {
        if let Some(lamp) = &mut self.lamp_ready {
            lamp.set_level(ready.into());
        }
        self.lamp_light.set_level(light.into());
        self.lamp_fault.set_level(fault.into());
    }

    fn feed_watchdog(&mut self) {
        self.watchdog.pet();
        restart::is_alive(Instant::now().as_millis() as u32);
    }

    fn restart(&mut self, into: RebootInto) -> ! {
        self.led_enable.set_low();
        restart::restart(into)
    }
}

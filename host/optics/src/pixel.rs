//! Signal and noise of one reconstructed pixel, term by term.
//!
//! A differential Hadamard measurement shows N patterns and their complements; the inverse transform gives each pixel
//! `(1/N) sum of sign * (pattern - complement)`. Its signal is the light of one LED in one exposure; its noise
//! variance is 2/N of that of one exposure (`Var(pattern - complement) = 2 sigma^2`, N of them, over N^2). So `SNR =
//! signal / sigma * sqrt(N / 2)` (Harwit and Sloane, *Hadamard Transform Optics*, 1979, chapter 3).
//!
//! An exposure is the time that one pattern's light is summed: samples of a pattern times sweeps. The paper's T_ext
//! of 8 to 25 us is taken to be that: 1024 patterns of 8 us and their complements are 16 ms, of 25 us without
//! complements 26 ms, about the 18 to 24 ms of its Table 1.

use crate::budget::BudgetError;
use crate::rain::{RainError, Weather};
use crate::{Budget, BudgetSettings, ChainSettings, LEDS, Projector};
use std::f64::consts::PI;
use thiserror::Error;

/// Charge of an electron in C (SI, exact).
const ELECTRON_C: f64 = 1.602_176_634e-19;

/// Counts of a 14-bit ADC.
const ADC_COUNTS: f64 = 16384.0;

/// Why there is no budget of a pixel.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PixelError {
    /// Light.
    #[error(transparent)]
    Budget(#[from] BudgetError),
    /// Weather.
    #[error(transparent)]
    Rain(#[from] RainError),
    /// A number is outside its range.
    #[error("pixel budget: {name} is {value}, expected {expected}")]
    Setting {
        /// Which.
        name: &'static str,
        /// The value found.
        value: f64,
        /// What it may be.
        expected: &'static str,
    },
}

/// The whole instrument, as a budget sees it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instrument {
    /// Light.
    pub budget: BudgetSettings,
    /// Lens and array.
    pub projector: Projector,
    /// Amplifier and ADC.
    pub chain: ChainSettings,
    /// Dark current of the photodiode, in nA. Assumed: an InGaAs diode of 0.15 mm at a few volts stays under it. At 2
    /// nA its shot noise is 10 electrons a sample, against some 530 of the amplifier.
    pub dark_current_na: f64,
    /// Signal-to-noise ratio of the ADC for a full-scale sine, in dB: 72, common for 14 bit at 125 MS/s.
    pub adc_snr_db: f64,
    /// Distance between projector and collector, in mm (assumed; the paper's box is 110 mm wide).
    pub baseline_mm: f64,
}

impl Default for Instrument {
    fn default() -> Self {
        Self {
            budget: BudgetSettings::default(),
            projector: Projector::default(),
            chain: ChainSettings::default(),
            dark_current_na: 2.0,
            adc_snr_db: 72.0,
            baseline_mm: 40.0,
        }
    }
}

/// Where light is lost and noise gained on the way to one pixel. Electrons are per ADC sample unless said otherwise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PixelBudget {
    /// Light of one LED on a white target in dry air, and of daylight.
    pub dry: Budget,
    /// Share that rain leaves in the LED's own spot.
    pub rain_out: f64,
    /// Share that rain leaves on the way back.
    pub rain_back: f64,
    /// Light of one LED from the target.
    pub signal_electrons: f64,
    /// Light of one LED from drops that it lights on the way.
    pub backscatter_electrons: f64,
    /// Light of all LEDs that a pattern lights, half of them, from a target of this reflectance.
    pub pattern_electrons: f64,
    /// Daylight from the target.
    pub daylight_electrons: f64,
    /// Daylight from the drops.
    pub airlight_electrons: f64,
    /// Dark current.
    pub dark_electrons: f64,
    /// Noise of the arrival of all these, rms.
    pub shot_noise: f64,
    /// Noise of the amplifier, rms.
    pub amplifier_noise: f64,
    /// Noise of the ADC beyond rounding, rms.
    pub adc_noise: f64,
    /// Noise of rounding to counts, rms: a count over sqrt(12).
    pub quantisation_noise: f64,
    /// All noise, rms.
    pub noise: f64,
    /// Electrons per count that the gain was set to.
    pub electrons_per_count: f64,
    /// Samples of one exposure.
    pub samples: f64,
    /// Signal of one exposure over its noise.
    pub exposure_snr: f64,
    /// Signal of one reconstructed pixel over its noise.
    pub pixel_snr: f64,
}

impl PixelBudget {
    /// One pixel of a target of `reflectance` at `distance_mm` in this weather, each pattern exposed for
    /// `exposure_us`.
    ///
    /// # Errors
    /// [`PixelError`] naming what is out of range.
    pub fn new(
        instrument: &Instrument,
        weather: &Weather,
        distance_mm: f64,
        reflectance: f64,
        exposure_us: f64,
    ) -> Result<Self, PixelError> {
        let setting = |holds, name, value, expected| match holds {
            true => Ok(()),
            false => Err(PixelError::Setting { name, value, expected }),
        };
        let seen = reflectance > 0.0 && reflectance <= 1.0;
        setting(seen, "reflectance", reflectance, "more than 0 and at most 1")?;
        let timed = exposure_us > 0.0 && exposure_us.is_finite();
        setting(timed, "exposure_us", exposure_us, "more than 0")?;

        let Instrument { projector, chain, .. } = instrument;
        let dry = Budget::new(&instrument.budget, projector, distance_mm)?;
        let blur = weather.blur(distance_mm)?;
        let field_mm = projector.field_mm(distance_mm);
        // A spot, taken as a circle of the same area.
        let own_mm = field_mm / crate::SIDE as f64 / PI.sqrt();
        let rain_out = blur.unscattered() + blur.scattered_within(own_mm);
        let rain_back = blur.returned(field_mm / distance_mm);
        let veil = weather.veil(projector, distance_mm, instrument.baseline_mm)?;

        let signal_electrons = dry.electrons_per_led * reflectance * rain_out * rain_back;
        let backscatter_electrons = dry.electrons_per_led * veil.backscatter;
        let lit = LEDS as f64 / 2.0;
        let pattern_electrons = lit * (signal_electrons + backscatter_electrons);
        let daylight_electrons = dry.ambient_electrons_white * reflectance * rain_back;
        let airlight_electrons = dry.ambient_electrons_white * veil.airlight;
        let sample_s = instrument.budget.sample_ns * 1e-9;
        let dark_electrons = instrument.dark_current_na * 1e-9 * sample_s / ELECTRON_C;

        let arriving = pattern_electrons + daylight_electrons + airlight_electrons + dark_electrons;
        let gain = chain.auto_gain(&dry).map_err(|_| PixelError::Setting {
            name: "brightest light",
            value: dry.brightest_electrons(),
            expected: "electrons per sample that some gain fits",
        })?;
        let full_scale_rms = ADC_COUNTS / 2.0 / 2.0_f64.sqrt();
        let adc_noise = full_scale_rms / 10_f64.powf(instrument.adc_snr_db / 20.0) * gain;
        let quantisation_noise = gain / 12.0_f64.sqrt();
        let amplifier_noise = chain.amplifier_noise_electrons;
        let noise =
            (arriving + amplifier_noise.powi(2) + adc_noise.powi(2) + quantisation_noise.powi(2))
                .sqrt();
        let samples = exposure_us * 1e3 / instrument.budget.sample_ns;
        let exposure_snr = signal_electrons * samples.sqrt() / noise;
        Ok(Self {
            dry,
            rain_out,
            rain_back,
            signal_electrons,
            backscatter_electrons,
            pattern_electrons,
            daylight_electrons,
            airlight_electrons,
            dark_electrons,
            shot_noise: arriving.sqrt(),
            amplifier_noise,
            adc_noise,
            quantisation_noise,
            noise,
            electrons_per_count: gain,
            samples,
            exposure_snr,
            pixel_snr: exposure_snr * (LEDS as f64 / 2.0).sqrt(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rain::Drops;
    use crate::water::Water;

    fn dry() -> Weather {
        Weather::new(Drops::none(), 1550.0, Water::Segelstein).unwrap()
    }

    fn at(distance_mm: f64, exposure_us: f64) -> PixelBudget {
        PixelBudget::new(&Instrument::default(), &dry(), distance_mm, 1.0, exposure_us).unwrap()
    }

    #[test]
    fn the_budget_of_a_pixel_agrees_with_one_worked_by_hand() {
        // docs/physics.md works this out: white target, 0.3 m, 25 us, dry, 15 klx.
        let pixel = at(300.0, 25.0);
        let close = |name: &str, found: f64, expected: f64| {
            assert!((found / expected - 1.0).abs() < 0.01, "{name}: {found} against {expected}");
        };
        close("signal", pixel.signal_electrons, 25.96);
        close("pattern", pixel.pattern_electrons, 512.0 * 25.96);
        close("daylight", pixel.daylight_electrons, 2081.8);
        close("dark", pixel.dark_electrons, 99.86);
        // sqrt(13 292 + 2 082 + 100) = 124.4
        close("shot noise", pixel.shot_noise, 124.4);
        // 1.1 pA/sqrt(Hz) over pi/2 * 60 MHz for 8 ns: 533.2
        close("amplifier noise", pixel.amplifier_noise, 533.2);
        close("samples", pixel.samples, 3125.0);
        // 25.96 * sqrt(3125) / 547.5 * sqrt(512)
        close("SNR", pixel.pixel_snr, 25.96 * 3125_f64.sqrt() / pixel.noise * 512_f64.sqrt());
        close("noise", pixel.noise, 547.5);
    }

    #[test]
    fn twice_the_distance_costs_four_times_the_signal_and_four_times_the_exposure_gains_two() {
        assert!(
            (at(300.0, 25.0).signal_electrons / at(600.0, 25.0).signal_electrons - 4.0).abs()
                < 1e-9
        );
        assert!((at(300.0, 32.0).pixel_snr / at(300.0, 8.0).pixel_snr - 2.0).abs() < 1e-9);
    }

    #[test]
    fn rain_costs_a_pixel_what_its_extinction_says_and_no_more() {
        let heavy = Drops::monodisperse(5.6, 2.0).unwrap();
        let rain = Weather::new(heavy, 1550.0, Water::Segelstein).unwrap();
        let wet = PixelBudget::new(&Instrument::default(), &rain, 1000.0, 1.0, 25.0).unwrap();
        let loss = 1.0 - wet.signal_electrons / at(1000.0, 25.0).signal_electrons;
        let extinction = 1.0 - rain.medium().transmission(2.0);
        // The forward half of what is scattered stays in the spot and in view.
        assert!(loss > 0.4 * extinction && loss < extinction, "{loss} of {extinction}");
        assert!(wet.airlight_electrons > 0.0 && wet.backscatter_electrons > 0.0);
    }

    #[test]
    fn what_is_out_of_range_is_named() {
        let named = |reflectance, exposure| {
            PixelBudget::new(&Instrument::default(), &dry(), 300.0, reflectance, exposure)
                .unwrap_err()
                .to_string()
        };
        assert!(named(0.0, 8.0).contains("reflectance is 0"));
        assert!(named(1.5, 8.0).contains("at most 1"));
        assert!(named(1.0, 0.0).contains("exposure_us is 0"));
    }
}

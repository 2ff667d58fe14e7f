//! Signal and noise of one reconstructed pixel, term by term.
//!
//! A differential Hadamard measurement shows N patterns and their complements. The inverse
//! transform gives each pixel `(1/N) sum of sign * (pattern - complement)`. A pixel's signal is the
//! light of one LED in one exposure. Its noise variance is 2/N of that of one exposure
//! (`Var(pattern - complement) = 2 sigma^2`, N of them, over N^2). So `SNR = signal / sigma *
//! sqrt(N / 2)`. (Harwit and Sloane, *Hadamard Transform Optics*, 1979, treat these masks; the
//! factor is derived here.)
//!
//! An exposure is the time for which one pattern is shown: its clocks times the sweeps. The
//! complement is shown as long. The camera excludes the blanked samples. The other samples show the
//! pattern's own share `r` of the light, and `1 - r` of the pattern before. Correcting that leak
//! keeps `r - (1 - r) / 2` of a difference (`host/recon/src/leak.rs` derives this factor), so the
//! signal is that share of the light. The amplifier's pole correlates the noise of neighbouring
//! samples ([`crate::chain`]).

use crate::budget::BudgetError;
use crate::camera::{Instrument, Readout};
use crate::rain::{RainError, Weather};
use crate::{Budget, ChainSettings, LEDS};
use std::f64::consts::PI;
use thiserror::Error;

/// Why the budget of a pixel cannot be computed.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
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
        /// The name of the number.
        name: &'static str,
        /// The value found.
        value: f64,
        /// The allowed values.
        expected: &'static str,
    },
}

/// Losses of light and sources of noise on the path to one pixel. Electrons are per ADC sample
/// unless stated otherwise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PixelBudget {
    /// Light of one LED on a white target in dry air, and light of daylight.
    pub dry: Budget,
    /// Share of light that stays in the LED's own spot in rain.
    pub rain_out: f64,
    /// Share of light that remains on the path back in rain.
    pub rain_back: f64,
    /// Light of one LED from the target.
    pub signal_electrons: f64,
    /// Light of one LED from illuminated drops on the path.
    pub backscatter_electrons: f64,
    /// Light of all LEDs of a pattern, half of the LEDs, from a target of this reflectance.
    pub pattern_electrons: f64,
    /// Daylight from the target.
    pub daylight_electrons: f64,
    /// Daylight from the drops.
    pub airlight_electrons: f64,
    /// Dark current.
    pub dark_electrons: f64,
    /// Shot noise of all this light, over the amplifier's noise bandwidth, rms.
    pub shot_noise: f64,
    /// Noise of the amplifier, rms.
    pub amplifier_noise: f64,
    /// Noise of the ADC beyond rounding, rms.
    pub adc_noise: f64,
    /// Noise of rounding to counts, rms: a count over sqrt(12).
    pub quantisation_noise: f64,
    /// All noise, rms.
    pub noise: f64,
    /// Factor by which the correlation of neighbouring samples raises the variance of their sum.
    pub correlated: f64,
    /// Share of the light that remains in a pattern minus its complement after correcting the leak.
    pub settled: f64,
    /// Electrons per count of the chosen gain.
    pub electrons_per_count: f64,
    /// Number of used samples of one exposure.
    pub samples: f64,
    /// Signal of one exposure: of all used samples, after correcting the leak.
    pub exposure_signal: f64,
    /// Noise of one exposure, rms.
    pub exposure_noise: f64,
    /// Signal of one exposure divided by its noise.
    pub exposure_snr: f64,
    /// Signal of one reconstructed pixel divided by its noise.
    pub pixel_snr: f64,
}

impl PixelBudget {
    /// One pixel of a target of `reflectance` at `distance_mm` in this weather, each pattern and
    /// each complement shown for `exposure_us`.
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
        // A spot is approximated by a circle of the same area.
        let own_mm = field_mm / crate::SIDE as f64 / PI.sqrt();
        let rain_out = blur.unscattered() + blur.scattered_within(own_mm);
        let rain_back = blur.returned(field_mm / distance_mm);
        let veil = weather.veil(projector, distance_mm, instrument.baseline_mm)?;

        let signal_electrons = dry.electrons_per_led * reflectance * rain_out * rain_back;
        let backscatter_electrons = dry.electrons_per_led * veil.backscatter;
        let lit = LEDS as f64 / 2.0;
        let pattern_electrons =
            lit * (signal_electrons + backscatter_electrons + dry.cover_electrons_per_led);
        let daylight_electrons = dry.ambient_electrons_white * reflectance * rain_back;
        let airlight_electrons = dry.ambient_electrons_white * veil.airlight;
        let light = pattern_electrons + daylight_electrons + airlight_electrons;
        let gain = chain.auto_gain(&dry).map_err(|_| PixelError::Setting {
            name: "brightest light",
            value: dry.brightest_electrons(),
            expected: "electrons per sample that some gain fits",
        })?;
        let chain = ChainSettings { electrons_per_count: gain, ..*chain };
        let adc_noise = chain.adc_noise_counts * gain;
        let quantisation_noise = gain / 12.0_f64.sqrt();
        let (amplifier_noise, shot_noise) =
            (chain.amplifier_noise_electrons, chain.shot_variance(light).sqrt());
        let noise = chain.variance_of_mean(light, 1).sqrt();
        let Readout { clocks_per_pattern, blanked, .. } = instrument.readout;
        let window = u32::from(clocks_per_pattern.saturating_sub(blanked).max(1));
        let own = chain.own_share(clocks_per_pattern.into(), blanked.into());
        // Calibrated readings are those of a stiff supply. But for 16 of 1024, they were divided by 1 - sag / 2, and their
        // noise with them.
        let sagged = 1.0 - instrument.tile_sag / 2.0;
        let settled = (own - (1.0 - own) / 2.0) * sagged;
        let clocks = exposure_us * 1e3 / instrument.budget.sample_ns;
        let samples = clocks * f64::from(window) / f64::from(clocks_per_pattern);
        // Windows are so far apart that their noise is independent.
        let window_noise = (chain.variance_of_mean(light, window) * f64::from(window)).sqrt();
        let exposure_signal = signal_electrons * settled * samples;
        let exposure_noise = window_noise * samples.sqrt();
        let exposure_snr = exposure_signal / exposure_noise;
        Ok(Self {
            dry,
            rain_out,
            rain_back,
            signal_electrons,
            backscatter_electrons,
            pattern_electrons,
            daylight_electrons,
            airlight_electrons,
            dark_electrons: chain.dark_electrons,
            shot_noise,
            amplifier_noise,
            adc_noise,
            quantisation_noise,
            noise,
            correlated: chain.correlated(window),
            settled,
            electrons_per_count: gain,
            samples,
            exposure_signal,
            exposure_noise,
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
        // docs/log/physics.md has the same example: white target, 0.3 m, 25 us, dry, 15 klx.
        let pixel = at(300.0, 25.0);
        let close = |name: &str, found: f64, expected: f64| {
            assert!((found / expected - 1.0).abs() < 1e-3, "{name}: {found} against {expected}");
        };
        close("signal", pixel.signal_electrons, 25.97);
        close("pattern", pixel.pattern_electrons, 512.0 * 25.973);
        close("daylight", pixel.daylight_electrons, 2741.1);
        close("dark", pixel.dark_electrons, 99.86);
        // sqrt((13 298 + 2 741 + 100) * pi * 60 MHz * 8 ns) = sqrt(16 139 * 1.5080)
        close("shot noise", pixel.shot_noise, 156.0);
        // 1.0991 pA/sqrt(Hz) over pi/2 * 60 MHz for 8 ns
        close("amplifier noise", pixel.amplifier_noise, 532.8);
        close("noise", pixel.noise, 555.2);
        // Three of five samples of 8 ns.
        close("samples", pixel.samples, 1875.0);
        // rho = exp(-2 pi * 60 MHz * 8 ns) = 0.0490: 1 + 2 (2/3 rho + 1/3 rho^2)
        close("correlation", pixel.correlated, 1.0669);
        // Settled to 0.9515, 0.9849, 0.9953: 0.9772; 0.9772 - 0.0228 / 2
        close("settled", pixel.settled, 0.9659);
        // 25.973 * 0.9659 * sqrt(1875) / (555.2 * sqrt(1.0669)) * sqrt(512)
        close("SNR", pixel.pixel_snr, 42.86);
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
        // The forward half of the scattered light stays in the spot and in view.
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

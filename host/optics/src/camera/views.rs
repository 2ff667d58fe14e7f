//! The settings of each stage of the light's path, from the camera description. The defaults are
//! those of the paper's camera: the stages themselves know no camera.

use super::{CameraModel, Leds, Readout};
use crate::budget::photon_j;
use crate::chain::{adc_noise_counts, amplifier_noise_electrons};
use crate::depth::DepthGeometry;
use crate::instrument::SAMPLE_NS;
use crate::{BudgetSettings, ChainSettings, LEDS, LedEdges, Projector, SIDE};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use std::f64::consts::TAU;

/// Charge of an electron in C (SI, exact).
pub(crate) const ELECTRON_C: f64 = 1.602_176_634e-19;

/// Four times Boltzmann's constant (SI, exact) at 300 K, in J.
const FOUR_KT_J: f64 = 4.0 * 1.380_649e-23 * 300.0;

/// The whole instrument for a budget: [`CameraModel::instrument`]. The default is the paper's
/// camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instrument {
    /// Light.
    pub budget: BudgetSettings,
    /// Lens and array.
    pub projector: Projector,
    /// Amplifier and ADC.
    pub chain: ChainSettings,
    /// Which samples of a pattern are used.
    pub readout: Readout,
    /// Distance between projector and collector, in mm.
    pub baseline_mm: f64,
    /// Share of its light that a tile of LEDs loses if all of them are lit.
    pub tile_sag: f64,
}

impl CameraModel {
    /// The lens before the array.
    #[must_use]
    pub fn projector(&self) -> Projector {
        self.projector
    }

    /// Electrons per photon: responsivity times photon energy over the electron's charge.
    #[must_use]
    pub fn quantum_efficiency(&self) -> f64 {
        self.detector.responsivity_a_per_w * photon_j(self.wavelength_nm) / ELECTRON_C
    }

    /// The settings of the photon budget.
    #[must_use]
    pub fn budget_settings(&self) -> BudgetSettings {
        BudgetSettings {
            led_power_mw: self.leds.power_mw,
            led_half_angle_deg: self.leds.half_angle_deg,
            led_spectrum_nm: self.leds.spectrum_fwhm_nm,
            wavelength_nm: self.wavelength_nm,
            collector_aperture_mm: self.collector.aperture_mm,
            detector_diameter_mm: self.detector.diameter_mm,
            detector_na: self.detector.numerical_aperture,
            glass_transmission: self.collector.glass_transmission,
            cover_veil: self.collector.cover_veil,
            quantum_efficiency: self.quantum_efficiency(),
            sample_ns: SAMPLE_NS,
            light: self.light.source,
            ambient_klx: self.light.illuminance_klx,
            filter_width_nm: self.collector.filter_width_nm,
        }
    }

    /// Input noise of the amplifier, in pA/sqrt(Hz): `sqrt(4 k T / R)` of the feedback resistor at
    /// 300 K, plus the voltage noise across all capacitance, with a mean over the bandwidth of `2
    /// pi B C e / sqrt(3)`.
    #[must_use]
    pub fn amplifier_noise_pa_per_sqrt_hz(&self) -> f64 {
        let amplifier = &self.amplifier;
        let resistor_a = (FOUR_KT_J / (amplifier.feedback_kohm * 1e3)).sqrt();
        let farad = (self.detector.capacitance_pf + amplifier.input_capacitance_pf) * 1e-12;
        let volt = amplifier.voltage_noise_nv_per_sqrt_hz * 1e-9;
        let voltage_a = TAU * amplifier.bandwidth_mhz * 1e6 * farad * volt / 3.0_f64.sqrt();
        resistor_a.hypot(voltage_a) * 1e12
    }

    /// Gain-bandwidth product that the amplifier needs, in GHz: `2 pi R C B^2`.
    #[must_use]
    pub fn gain_bandwidth_ghz(&self) -> f64 {
        let amplifier = &self.amplifier;
        let farad = (self.detector.capacitance_pf + amplifier.input_capacitance_pf) * 1e-12;
        let bandwidth_hz = amplifier.bandwidth_mhz * 1e6;
        TAU * amplifier.feedback_kohm * 1e3 * farad * bandwidth_hz.powi(2) * 1e-9
    }

    /// How the LEDs follow their lines.
    #[must_use]
    pub fn led_edges(&self) -> LedEdges {
        let Leds { rise_ns, fall_ns, turn_on_delay_ns, turn_off_delay_ns, .. } = self.leds;
        LedEdges { rise_ns, fall_ns, turn_on_delay_ns, turn_off_delay_ns }
    }

    /// Charge that a changing line injects into the amplifier: capacitance times swing, in electrons.
    fn line_electrons(&self) -> f64 {
        self.leds.line_crosstalk_ff * 1e-15 * self.leds.line_swing_v / ELECTRON_C
    }

    /// The receiver before its gain is set, without daylight.
    #[must_use]
    pub fn chain_settings(&self) -> ChainSettings {
        let bandwidth_hz = self.amplifier.bandwidth_mhz * 1e6;
        let noise_pa = self.amplifier_noise_pa_per_sqrt_hz();
        ChainSettings {
            sample_ns: SAMPLE_NS,
            led: self.led_edges(),
            line_electrons: self.line_electrons(),
            amplifier_bandwidth_hz: bandwidth_hz,
            ambient_electrons: 0.0,
            dark_electrons: self.detector.dark_current_na * 1e-9 * SAMPLE_NS * 1e-9 / ELECTRON_C,
            shot_noise: true,
            amplifier_noise_electrons: amplifier_noise_electrons(noise_pa, bandwidth_hz, SAMPLE_NS),
            adc_noise_counts: adc_noise_counts(self.adc.snr_db),
            electrons_per_count: 3.0,
            // The ranges were checked when the description was read.
            adc_offset_counts: self.adc.offset_counts as u16,
            adc_latency_clocks: self.adc.latency_clocks as u8,
        }
    }

    /// The whole instrument, for the budget of a pixel.
    #[must_use]
    pub fn instrument(&self) -> Instrument {
        Instrument {
            budget: self.budget_settings(),
            projector: self.projector,
            chain: self.chain_settings(),
            readout: self.readout,
            baseline_mm: self.collector.baseline_mm,
            tile_sag: self.leds.tile_sag,
        }
    }

    /// The positions of the zones of the time-of-flight sensor.
    #[must_use]
    pub fn depth_geometry(&self) -> DepthGeometry {
        DepthGeometry {
            fov_deg: self.tof.fov_deg,
            offset_mm: [self.tof.offset_x_mm, self.tof.offset_y_mm],
        }
    }

    /// Light of each LED from a white target, divided by that of an ideal LED: 32 x 32, row-major.
    /// The factors are the spread of power, the spread of pointing (intensity `cos^m` towards the
    /// lens), vignetting, and 0 for a dead LED.
    #[must_use]
    pub fn led_gains(&self) -> Vec<f32> {
        let leds = &self.leds;
        let mut rng = Pcg64Mcg::seed_from_u64(u64::from(leds.spread_seed));
        let m = 0.5_f64.ln() / leds.half_angle_deg.to_radians().cos().ln();
        let centre = (SIDE - 1) as f64 / 2.0;
        let gain = |at: usize| {
            let mut normal = || rng.sample::<f64, _>(StandardNormal);
            let power = (1.0 + leds.power_spread * normal()).max(0.0);
            let off = (leds.pointing_spread_deg.to_radians() * normal())
                .hypot(leds.pointing_spread_deg.to_radians() * normal());
            let pointing = off.cos().max(0.0).powf(m);
            let (row, column) = (at / SIDE, at % SIDE);
            let (y, x) = (row as f64 - centre, column as f64 - centre);
            let vignetting =
                1.0 - self.projector.corner_vignetting * (x * x + y * y) / (2.0 * centre * centre);
            let lit = !leds.dead.contains(&[row as u32, column as u32]);
            if lit { (power * pointing * vignetting) as f32 } else { 0.0 }
        };
        (0..LEDS).map(gain).collect()
    }
}

impl Default for Projector {
    fn default() -> Self {
        CameraModel::paper().projector()
    }
}

impl Default for BudgetSettings {
    fn default() -> Self {
        CameraModel::paper().budget_settings()
    }
}

impl Default for ChainSettings {
    fn default() -> Self {
        CameraModel::paper().chain_settings()
    }
}

impl Default for Instrument {
    fn default() -> Self {
        CameraModel::paper().instrument()
    }
}

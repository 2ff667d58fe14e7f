//! The photon budget of one pixel: every term of its signal and noise, with its formula.

use crate::error::{EvalError, Result};
use nirspi_optics::daylight::irradiance_w_per_m2;
use nirspi_optics::pixel::PixelBudget;
use nirspi_optics::rain::{Drops, Weather};
use nirspi_optics::water::Water;
use nirspi_optics::{Budget, BudgetSettings, CameraModel};
use serde::Serialize;
use std::ops::RangeInclusive;

/// Distances of a budget, in metres. Closer than a quarter of the lens's focal length, light fills
/// the ADC at any gain. The depth sensor's readings end at 65 m.
pub const DISTANCES_M: RangeInclusive<f64> = 0.05..=65.0;

/// Settings of the budget.
#[derive(Debug, Clone)]
pub struct Settings {
    /// The weather between camera and target.
    pub drops: Drops,
    /// Distance of the target.
    pub distance_m: f64,
    /// Reflectance of the target.
    pub reflectance: f64,
    /// Exposure of each pattern.
    pub exposure_us: f64,
    /// Wavelengths for comparing daylight.
    pub wavelengths_nm: Vec<f64>,
    /// The camera.
    pub camera: CameraModel,
}

/// One term of the budget.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Term {
    /// Its name.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// The unit; empty for a ratio.
    pub unit: &'static str,
    /// The formula, or the source of the number.
    pub how: String,
}

/// The budget of one pixel.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Always true.
    pub simulated: bool,
    /// The camera description's name.
    pub camera: String,
    /// Distance of the target.
    pub distance_m: f64,
    /// Reflectance of the target.
    pub reflectance: f64,
    /// Exposure of each pattern.
    pub exposure_us: f64,
    /// Terms in the order of the light's path.
    pub terms: Vec<Term>,
    /// Daylight at other wavelengths.
    pub daylight: Vec<DaylightReport>,
    /// Visible daylight on the target.
    #[serde(skip)]
    pub ambient_klx: f64,
    /// Width of the filter before the detector.
    #[serde(skip)]
    pub filter_width_nm: f64,
    /// Signal of the pixel divided by its noise.
    pub snr_per_pixel: f64,
}

/// Daylight through the same lens and an equally wide filter, at another wavelength.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct DaylightReport {
    /// The wavelength.
    pub wavelength_nm: f64,
    /// Irradiance of the target.
    pub on_target_w_per_m2: f64,
    /// Power on the detector.
    pub on_detector_nw: f64,
    /// Photons on the detector in a sample.
    pub photons_per_sample: f64,
}

/// The budget of one pixel.
///
/// # Errors
/// A setting out of range: [`EvalError::is_setting`] holds for every error.
pub fn budget(settings: &Settings) -> Result<Report> {
    super::check_distance(settings.distance_m)?;
    if !DISTANCES_M.contains(&settings.distance_m) {
        let (near, far) = (DISTANCES_M.start(), DISTANCES_M.end());
        let expected = format!("{near} to {far} metres for a budget");
        return Err(EvalError::setting("distance_m", settings.distance_m, expected));
    }
    let instrument = settings.camera.instrument();
    let nm = instrument.budget.wavelength_nm;
    // Settings are checked before computations that take time.
    for &nm in &settings.wavelengths_nm {
        daylight_on_target(&instrument.budget, nm)?;
    }
    let weather = Weather::new(settings.drops.clone(), nm, Water::Segelstein)?;
    let Settings { distance_m, reflectance, exposure_us, .. } = *settings;
    let pixel =
        PixelBudget::new(&instrument, &weather, distance_m * 1e3, reflectance, exposure_us)?;
    Ok(Report {
        ambient_klx: instrument.budget.ambient_klx,
        filter_width_nm: instrument.budget.filter_width_nm,
        simulated: true,
        camera: settings.camera.name.clone(),
        distance_m,
        reflectance,
        exposure_us,
        terms: terms(&settings.camera, &pixel, &weather, reflectance),
        daylight: settings
            .wavelengths_nm
            .iter()
            .map(|&nm| daylight(&instrument.budget, &pixel.dry, reflectance, nm))
            .collect::<Result<_>>()?,
        snr_per_pixel: pixel.pixel_snr,
    })
}

fn daylight_on_target(settings: &BudgetSettings, wavelength_nm: f64) -> Result<f64> {
    irradiance_w_per_m2(settings.ambient_klx, wavelength_nm, settings.filter_width_nm)
        .map_err(|error| EvalError::refused("wavelengths_nm", &error))
}

fn daylight(
    settings: &BudgetSettings,
    dry: &Budget,
    reflectance: f64,
    wavelength_nm: f64,
) -> Result<DaylightReport> {
    let irradiance = daylight_on_target(settings, wavelength_nm)?;
    let on_detector_w = reflectance * dry.daylight_on_detector_w(irradiance);
    // The energy of the instrument's photons, at another wavelength.
    let photon_j = dry.terms.photon_j * settings.wavelength_nm / wavelength_nm;
    Ok(DaylightReport {
        wavelength_nm,
        on_target_w_per_m2: irradiance,
        on_detector_nw: on_detector_w * 1e9,
        photons_per_sample: on_detector_w * settings.sample_ns * 1e-9 / photon_j,
    })
}

fn terms(
    camera: &CameraModel,
    pixel: &PixelBudget,
    weather: &Weather,
    reflectance: f64,
) -> Vec<Term> {
    let dry = &pixel.dry.terms;
    let term = |name, value, unit, how: &str| Term { name, value, unit, how: how.to_owned() };
    let e = "e/sample";
    let (light, readout) = (camera.light, camera.readout);
    let (blanked, clocks) = (readout.blanked, readout.clocks_per_pattern);
    let width_nm = camera.collector.filter_width_nm;
    let light_on_target = format!(
        "{} klx of {} within the filter of {width_nm} nm",
        light.illuminance_klx, light.source
    );
    let amplifier = format!(
        "{:.3} pA/sqrt(Hz) over pi/2 of {} MHz",
        camera.amplifier_noise_pa_per_sqrt_hz(),
        camera.amplifier.bandwidth_mhz
    );
    let adc = format!("{} dB of full scale", camera.adc.snr_db);
    let dark = format!("{} nA", camera.detector.dark_current_na);
    let samples = format!("exposure over ADC sample, less {blanked} blanked of {clocks}");
    vec![
        term("LED power", dry.led_power_mw, "mW", "the camera description"),
        term("into the projection lens", dry.projected, "", "1 - cos^(m+1) of the lens's edge"),
        term("rain, way out", pixel.rain_out, "", "exp(-cL) + scattered within the LED's own spot"),
        term("target reflectance", reflectance, "", "given; Lambertian"),
        term("rain, way back", pixel.rain_back, "", "exp(-cL) (1 + bL P(half the field))"),
        term(
            "collector in use",
            pixel.dry.effective_collector_mm,
            "mm",
            "its own, or what the detector's etendue allows",
        ),
        term("collected", dry.collected, "", "A / (pi D^2)"),
        term(
            "LED's light in the filter",
            dry.filtered,
            "",
            "erf(sqrt(ln 2) width / spectrum's width)",
        ),
        term("glass", dry.glass, "", "the camera description"),
        term("photon energy", dry.photon_j, "J", "h c / wavelength"),
        term(
            "quantum efficiency",
            dry.quantum_efficiency,
            "",
            "responsivity times photon energy over e",
        ),
        term("ADC sample", dry.sample_ns, "ns", "125 MS/s"),
        term("signal: one LED", pixel.signal_electrons, e, "the product of the above"),
        term("half of the LEDs", pixel.pattern_electrons, e, "512 LEDs on this reflectance"),
        term("rain extinction", weather.medium().extinction_per_m, "1/m", "sum N Q_ext pi/4 D^2"),
        term(
            "backscatter into one LED",
            pixel.backscatter_electrons,
            e,
            "lidar equation over the path",
        ),
        term("daylight on the target", dry.daylight_w_per_m2, "W/m2", &light_on_target),
        term(
            "daylight from the target",
            pixel.daylight_electrons,
            e,
            "E rho / pi, A W, glass, efficiency",
        ),
        term(
            "daylight from the drops",
            pixel.airlight_electrons,
            e,
            "albedo (1 - exp(-cL)) of white",
        ),
        term("dark current", pixel.dark_electrons, e, &dark),
        term("shot noise", pixel.shot_noise, "e rms", "sqrt of all electrons times pi B t"),
        term("amplifier noise", pixel.amplifier_noise, "e rms", &amplifier),
        term("gain", pixel.electrons_per_count, "e/count", "the finest that fits a white target"),
        term("ADC noise", pixel.adc_noise, "e rms", &adc),
        term("quantisation", pixel.quantisation_noise, "e rms", "a count over sqrt(12)"),
        term("all noise", pixel.noise, "e rms", "root of the sum of squares"),
        term("samples", pixel.samples, "", &samples),
        term(
            "correlation of samples",
            pixel.correlated,
            "",
            "1 + 2 sum (1 - k/W) exp(-2 pi B t k)",
        ),
        term("settled", pixel.settled, "", "own share of the light, less half of the leak"),
        term("signal, one exposure", pixel.exposure_signal, "e", "signal, samples, settled"),
        term("noise, one exposure", pixel.exposure_noise, "e rms", "noise, samples, correlation"),
        term("SNR, one LED, one exposure", pixel.exposure_snr, "", ""),
        term("SNR, one pixel", pixel.pixel_snr, "", "times sqrt(1024 / 2): differential Hadamard"),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings() -> Settings {
        let drops = Drops::monodisperse(5.6, 2.0).unwrap();
        let wavelengths_nm = vec![550.0, 1550.0];
        let camera = CameraModel::default();
        let (distance_m, reflectance, exposure_us) = (1.0, 1.0, 25.0);
        Settings { drops, distance_m, reflectance, exposure_us, wavelengths_nm, camera }
    }

    fn term(report: &Report, name: &str) -> f64 {
        report.terms.iter().find(|term| term.name == name).unwrap().value
    }

    #[test]
    fn the_noise_is_the_root_of_the_sum_of_its_squares() {
        let report = budget(&settings()).unwrap();
        let parts = ["shot noise", "amplifier noise", "ADC noise", "quantisation"];
        let squares: f64 = parts.iter().map(|name| term(&report, name).powi(2)).sum();
        assert!((term(&report, "all noise") / squares.sqrt() - 1.0).abs() < 1e-9, "{report:?}");
        assert_eq!(report.snr_per_pixel, term(&report, "SNR, one pixel"));
    }

    #[test]
    fn a_darker_target_gives_less_signal_in_proportion() {
        let grey = budget(&Settings { reflectance: 0.5, ..settings() }).unwrap();
        let signal = |report: &Report| term(report, "signal: one LED");
        let share = signal(&grey) / signal(&budget(&settings()).unwrap());
        assert!((share - 0.5).abs() < 1e-9, "{share}");
    }

    #[test]
    fn a_photon_of_a_longer_wave_has_less_energy_in_proportion() {
        let report = budget(&settings()).unwrap();
        let per_photon: Vec<f64> = report
            .daylight
            .iter()
            .map(|daylight| daylight.on_detector_nw / daylight.photons_per_sample)
            .collect();
        let share = per_photon[0] / per_photon[1];
        assert!((share / (1550.0 / 550.0) - 1.0).abs() < 1e-9, "{share}");
    }

    #[test]
    fn settings_out_of_range_are_named() {
        let told = |settings: Settings| {
            let error = budget(&settings).unwrap_err();
            assert!(error.is_setting());
            error.to_string()
        };
        let far = told(Settings { distance_m: 100.0, ..settings() });
        assert_eq!(far, "distance_m is 100, expected 0.05 to 65 metres for a budget");
        let infrared = told(Settings { wavelengths_nm: vec![1800.0], ..settings() });
        assert!(infrared.starts_with("wavelengths_nm: "), "{infrared}");
        let bright = told(Settings { reflectance: 2.0, ..settings() });
        assert!(bright.contains("reflectance is 2"), "{bright}");
    }
}

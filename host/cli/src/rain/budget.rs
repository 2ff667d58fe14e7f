//! `nirspi rain --budget`: every term of a pixel's signal and noise, with its formula.

use crate::{Usage, print};
use anyhow::Result;
use nirspi_optics::daylight::irradiance_w_per_m2;
use nirspi_optics::pixel::{Instrument, PixelBudget};
use nirspi_optics::rain::{Drops, Weather};
use nirspi_optics::water::Water;
use nirspi_optics::{Budget, BudgetSettings};
use serde::Serialize;
use std::process::ExitCode;

/// What the budget is of.
pub struct Wanted {
    pub drops: Drops,
    pub distance_m: f64,
    pub reflectance: f64,
    pub exposure_us: f64,
    /// Wavelengths at which daylight is compared.
    pub wavelengths_nm: Vec<f64>,
}

#[derive(Debug, Serialize)]
struct Term {
    name: &'static str,
    value: f64,
    unit: &'static str,
    how: &'static str,
}

#[derive(Debug, Serialize)]
struct Report {
    simulated: bool,
    distance_m: f64,
    reflectance: f64,
    exposure_us: f64,
    terms: Vec<Term>,
    daylight: Vec<DaylightReport>,
    snr_per_pixel: f64,
}

/// Daylight through the same lens and a filter as wide, at another wavelength.
#[derive(Debug, Serialize)]
struct DaylightReport {
    wavelength_nm: f64,
    on_target_w_per_m2: f64,
    on_detector_nw: f64,
    photons_per_sample: f64,
}

pub fn run(wanted: &Wanted, json: bool) -> Result<ExitCode> {
    let instrument = Instrument::default();
    let nm = instrument.budget.wavelength_nm;
    // Before anything that takes time.
    for &nm in &wanted.wavelengths_nm {
        daylight_on_target(&instrument.budget, nm)?;
    }
    let weather = Weather::new(wanted.drops.clone(), nm, Water::Segelstein)
        .map_err(|error| Usage(error.to_string()))?;
    let Wanted { distance_m, reflectance, exposure_us, .. } = *wanted;
    let pixel = PixelBudget::new(&instrument, &weather, distance_m * 1e3, reflectance, exposure_us)
        .map_err(|error| Usage(error.to_string()))?;
    let report = Report {
        simulated: true,
        distance_m,
        reflectance,
        exposure_us,
        terms: terms(&pixel, &weather, reflectance),
        daylight: wanted
            .wavelengths_nm
            .iter()
            .map(|&nm| daylight(&instrument.budget, &pixel.dry, reflectance, nm))
            .collect::<Result<_>>()?,
        snr_per_pixel: pixel.pixel_snr,
    };
    if json {
        print::json(&report)?;
        return Ok(ExitCode::SUCCESS);
    }
    print::line(format_args!(
        "one pixel, target of reflectance {reflectance} at {distance_m} m, {exposure_us} us a pattern (simulated)"
    ))?;
    for Term { name, value, unit, how } in &report.terms {
        print::line(format_args!("{name:<28} {:>12} {unit:<10} {how}", figure(*value)))?;
    }
    print::line(format_args!(
        "{} klx of daylight from such a target, through the lens and a filter of {} nm (ASTM G173-03):",
        instrument.budget.ambient_klx, instrument.budget.filter_width_nm
    ))?;
    for day in &report.daylight {
        print::line(format_args!(
            "{:>8} nm: {:>6} W/m2 on the target, {:>6} nW and {:>6} photons a sample on the detector",
            day.wavelength_nm,
            figure(day.on_target_w_per_m2),
            figure(day.on_detector_nw),
            figure(day.photons_per_sample)
        ))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn daylight_on_target(settings: &BudgetSettings, wavelength_nm: f64) -> Result<f64> {
    irradiance_w_per_m2(settings.ambient_klx, wavelength_nm, settings.filter_width_nm)
        .map_err(|error| Usage(format!("--wavelengths-nm: {error}")).into())
}

fn daylight(
    settings: &BudgetSettings,
    dry: &Budget,
    reflectance: f64,
    wavelength_nm: f64,
) -> Result<DaylightReport> {
    let irradiance = daylight_on_target(settings, wavelength_nm)?;
    let on_detector_w = reflectance * dry.daylight_on_detector_w(irradiance);
    // The instrument's photons, of another wavelength.
    let photon_j = dry.terms.photon_j * settings.wavelength_nm / wavelength_nm;
    Ok(DaylightReport {
        wavelength_nm,
        on_target_w_per_m2: irradiance,
        on_detector_nw: on_detector_w * 1e9,
        photons_per_sample: on_detector_w * settings.sample_ns * 1e-9 / photon_j,
    })
}

/// Four digits, with an exponent where it is shorter.
fn figure(value: f64) -> String {
    if value == 0.0 || (1e-3..1e6).contains(&value.abs()) {
        let digits = (3 - value.abs().max(1e-3).log10().floor() as i32).clamp(0, 6) as usize;
        format!("{value:.digits$}")
    } else {
        format!("{value:.3e}")
    }
}

fn terms(pixel: &PixelBudget, weather: &Weather, reflectance: f64) -> Vec<Term> {
    let dry = &pixel.dry.terms;
    let term = |name, value, unit, how| Term { name, value, unit, how };
    let e = "e/sample";
    vec![
        term(
            "LED power",
            dry.led_power_mw,
            "mW",
            "assumed: what 45 W leaves room for (paper, Fig. 2)",
        ),
        term("into the projection lens", dry.projected, "", "1 - cos^(m+1) of the lens's edge"),
        term("rain, way out", pixel.rain_out, "", "exp(-cL) + scattered within the LED's own spot"),
        term("target reflectance", reflectance, "", "given; Lambertian"),
        term("rain, way back", pixel.rain_back, "", "exp(-cL) (1 + bL P(half the field))"),
        term(
            "collector in use",
            pixel.dry.effective_collector_mm,
            "mm",
            "what the FGA015's etendue allows",
        ),
        term("collected", dry.collected, "", "A / (pi D^2)"),
        term("filter and glass", dry.transmitted, "", "assumed: 0.76 filter, 0.8 glass"),
        term("photon energy", dry.photon_j, "J", "h c / wavelength"),
        term("quantum efficiency", dry.quantum_efficiency, "", "paper, 2.D"),
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
        term(
            "daylight on the target",
            dry.daylight_w_per_m2,
            "W/m2",
            "15 klx of ASTM G173 within the filter",
        ),
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
        term("dark current", pixel.dark_electrons, e, "assumed: 2 nA"),
        term("shot noise", pixel.shot_noise, "e rms", "sqrt of all electrons"),
        term(
            "amplifier noise",
            pixel.amplifier_noise,
            "e rms",
            "1.1 pA/sqrt(Hz) over pi/2 of 60 MHz",
        ),
        term("gain", pixel.electrons_per_count, "e/count", "the finest that fits a white target"),
        term("ADC noise", pixel.adc_noise, "e rms", "assumed: 72 dB of full scale"),
        term("quantisation", pixel.quantisation_noise, "e rms", "a count over sqrt(12)"),
        term("all noise", pixel.noise, "e rms", "root of the sum of squares"),
        term("samples", pixel.samples, "", "exposure over ADC sample"),
        term("signal, one exposure", pixel.signal_electrons * pixel.samples, "e", ""),
        term("noise, one exposure", pixel.noise * pixel.samples.sqrt(), "e rms", ""),
        term("SNR, one LED, one exposure", pixel.exposure_snr, "", ""),
        term("SNR, one pixel", pixel.pixel_snr, "", "times sqrt(1024 / 2): differential Hadamard"),
    ]
}

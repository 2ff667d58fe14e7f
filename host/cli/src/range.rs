//! `nirspi range`: how far the camera sees in rain (the paper's Algorithm 2 and Table 2).

use super::{Usage, print};
use crate::report::to_json;
use anyhow::Result;
use nirspi::files::image::encode_rgb;
use nirspi::files::output::OutputDir;
use nirspi::picture::{Axis, Chart, Line};
use nirspi_optics::pixel::{Instrument, PixelBudget};
use nirspi_optics::rain::blur::DEEPEST_OPTICAL_DEPTH;
use nirspi_optics::rain::{Drops, PaperRain, Weather};
use nirspi_optics::range::{Wanted, as_printed_mm, extinction_needed_per_m, farthest_mm};
use nirspi_optics::water::Water;
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;

/// Say how far the camera sees in rain, beside the paper's Table 2
///
/// The farthest distance at which one pixel of a white target still has the signal-to-noise ratio asked for, from the
/// photon budget and the rain's Mie extinction; Algorithm 2 as printed; and what would have to be assumed to agree
/// with the paper. Writes range.png and range.json with --out.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi range\n\
    \x20 nirspi range --snr 2 --reflectance 0.5 --out range/")]
pub struct Args {
    /// Signal of a pixel over its noise at the farthest distance
    #[arg(long, value_name = "SNR", default_value_t = 1.0, allow_negative_numbers = true)]
    snr: f64,
    /// Reflectance of the target
    #[arg(long, value_name = "0..1", default_value_t = 1.0, allow_negative_numbers = true)]
    reflectance: f64,
    /// Exposures of a pattern, in us
    #[arg(long, value_name = "US,...", value_delimiter = ',', default_values_t = [8.0, 25.0],
          allow_negative_numbers = true)]
    exposures_us: Vec<f64>,
    /// Folder for range.png and range.json
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

/// A row of the paper's Table 2.
struct Row {
    name: &'static str,
    rain: PaperRain,
    range_m: (f64, f64),
}

const TABLE_2: [Row; 2] = [
    Row { name: "light", rain: PaperRain::LIGHT, range_m: (0.1, 2.0) },
    Row { name: "heavy", rain: PaperRain::HEAVY, range_m: (0.2, 1.5) },
];

/// Algorithm 2's Z_max: how far patterns are projected (paper, 2.A).
const Z_MAX_MM: f64 = 3000.0;

#[derive(Debug, Serialize)]
struct Report {
    simulated: bool,
    snr: f64,
    reflectance: f64,
    rows: Vec<RowReport>,
    assumptions: Vec<String>,
    reading: Vec<String>,
}

#[derive(Debug, Serialize)]
struct RowReport {
    rain: &'static str,
    rate_mm_per_h: f64,
    drop_mm: f64,
    extinction_per_m: f64,
    loss_over_2_m_percent: f64,
    exposure_us: f64,
    /// The paper's, of 8 to 25 us together.
    paper_m: (f64, f64),
    /// `null`: nowhere.
    physics_m: Option<f64>,
    dry_air_m: Option<f64>,
    as_printed_m: f64,
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let instrument = Instrument::default();
    let snr = args.snr;
    if !(snr.is_finite() && snr > 0.0) {
        return Err(Usage(format!("--snr is {snr}, expected more than 0")).into());
    }
    let usage = |error: nirspi_optics::pixel::PixelError| Usage(error.to_string());
    let nm = instrument.budget.wavelength_nm;
    let dry = Weather::new(Drops::none(), nm, Water::Segelstein)?;
    let mut weathers = Vec::new();
    let mut rows = Vec::new();
    for row in &TABLE_2 {
        let drops = row.rain.drops()?;
        let weather = Weather::new(drops, nm, Water::Segelstein)?;
        for &exposure_us in &args.exposures_us {
            let wanted = Wanted { reflectance: args.reflectance, exposure_us, snr };
            let metres = |mm: f64| mm * 1e-3;
            rows.push(RowReport {
                rain: row.name,
                rate_mm_per_h: row.rain.rate_mm_per_h,
                drop_mm: row.rain.drop_mm,
                extinction_per_m: weather.medium().extinction_per_m,
                loss_over_2_m_percent: 100.0 * (1.0 - weather.medium().transmission(2.0)),
                exposure_us,
                paper_m: row.range_m,
                physics_m: farthest_mm(&instrument, &weather, &wanted).map_err(usage)?.map(metres),
                dry_air_m: farthest_mm(&instrument, &dry, &wanted).map_err(usage)?.map(metres),
                as_printed_m: as_printed_mm(
                    &instrument,
                    &weather,
                    &wanted,
                    row.rain.drop_mm,
                    Z_MAX_MM,
                )
                .map(metres)
                .map_err(usage)?,
            });
        }
        weathers.push(weather);
    }
    let report = Report {
        simulated: true,
        snr,
        reflectance: args.reflectance,
        assumptions: assumptions(&instrument),
        reading: reading(&instrument, &weathers, args.reflectance).map_err(usage)?,
        rows,
    };
    if let Some(out) = &args.out {
        let mut out = OutputDir::create(out)?;
        let chart = chart(args, &instrument, &weathers, &dry);
        out.write("range.png", &encode_rgb(&chart.render()))?;
        out.write("range.json", to_json(&report)?.as_bytes())?;
        out.commit()?;
    }
    if args.json {
        print::json(&report)?;
    } else {
        say(args, &report)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn assumptions(instrument: &Instrument) -> Vec<String> {
    let b = &instrument.budget;
    vec![
        format!(
            "{} mW of light an LED, half angle {} degrees, of which a lens of {} mm takes what it can",
            b.led_power_mw, b.led_half_angle_deg, instrument.projector.aperture_mm
        ),
        format!(
            "detector of {} mm (FGA015), numerical aperture {}, efficiency {}",
            b.detector_diameter_mm, b.detector_na, b.quantum_efficiency
        ),
        format!(
            "{:.0} electrons rms of amplifier noise a sample, {} klx of daylight behind a {} nm filter",
            instrument.chain.amplifier_noise_electrons, b.ambient_klx, b.filter_width_nm
        ),
        "an exposure is the time that one pattern's light is summed; 1024 patterns and their complements".to_owned(),
        format!(
            "as printed: Z_max of {} m (paper, 2.A), so that its answer is a multiple of {} m",
            Z_MAX_MM * 1e-3,
            Z_MAX_MM * 1e-4
        ),
        "drops of one size, 0.5 mm light and 2 mm heavy, as the paper's Table 2".to_owned(),
    ]
}

/// What must be assumed to agree with the paper, and what physics says instead.
fn reading(
    instrument: &Instrument,
    weathers: &[Weather],
    reflectance: f64,
) -> Result<Vec<String>, nirspi_optics::pixel::PixelError> {
    let [light, heavy] = weathers else { return Ok(Vec::new()) };
    let snr_at = |weather: &Weather, distance_mm, exposure_us| {
        PixelBudget::new(instrument, weather, distance_mm, reflectance, exposure_us)
            .map(|p| p.pixel_snr)
    };
    let at_2_m = snr_at(light, 2000.0, 25.0)?;
    let agreed = |exposure_us| Wanted { reflectance, exposure_us, snr: at_2_m };
    let mut lines = vec![format!(
        "2 m in light rain at 25 us agrees with the paper if a pixel may have an SNR of {at_2_m:.2}"
    )];
    if let Some(mm) = farthest_mm(instrument, heavy, &agreed(25.0))? {
        lines.push(format!(
            "the same SNR in heavy rain at 25 us: {:.3} m, not 1.5: 2 m of this rain take out {:.2} % of the light",
            mm * 1e-3,
            100.0 * (1.0 - heavy.medium().transmission(2.0))
        ));
    }
    if let Some(mm) = farthest_mm(instrument, heavy, &agreed(8.0))? {
        lines.push(format!(
            "the same SNR at 8 us: {:.2} m; the paper's 2 and 1.5 m differ as its two exposures do \
             ((25/8)^(1/4) = 1.33), whatever falls",
            mm * 1e-3
        ));
    }
    if let Some(needed) = extinction_needed_per_m(instrument, heavy, &agreed(25.0), 1500.0)? {
        let factor = needed / heavy.medium().extinction_per_m;
        let at_least = if needed * 1.5 > 0.99 * DEEPEST_OPTICAL_DEPTH { "at least " } else { "" };
        lines.push(format!(
            "for rain to bring 2 m down to 1.5 m its extinction would have to be {at_least}{needed:.2} \
             per metre, {at_least}{factor:.0} times what 5.6 mm/h has"
        ));
    }
    lines.push(format!(
        "light rain takes out {:.1} times more than heavy rain: the same water in drops of a quarter \
         of the size has four times the shadow",
        light.medium().extinction_per_m / heavy.medium().extinction_per_m
    ));
    lines.push(
        "the paper's lower limits (0.1 and 0.2 m) follow from no term here; Algorithm 2's first step, \
         Z_max / 10, is that long for a Z_max of 1 and 2 m"
            .to_owned(),
    );
    Ok(lines)
}

fn chart(args: &Args, instrument: &Instrument, weathers: &[Weather], dry: &Weather) -> Chart {
    let fog = Drops::fog(10.0, 0.1)
        .and_then(|fog| Weather::new(fog, instrument.budget.wavelength_nm, Water::Segelstein));
    let mut kinds: Vec<(&str, &Weather, bool)> = vec![("dry", dry, false)];
    kinds.extend(weathers.last().map(|heavy| ("heavy rain, 2 mm", heavy, true)));
    kinds.extend(fog.iter().map(|fog| ("fog, 0.1 g/m3", fog, false)));
    let mut lines = Vec::new();
    for (name, weather, dashed) in kinds {
        for &exposure_us in &args.exposures_us {
            let points = (0..=200).filter_map(|i| {
                let mm = 100.0 * 100.0_f64.powf(f64::from(i) / 200.0);
                let pixel =
                    PixelBudget::new(instrument, weather, mm, args.reflectance, exposure_us);
                pixel.ok().map(|pixel| (mm * 1e-3, pixel.pixel_snr))
            });
            let name = format!("{name}, {exposure_us} us");
            // A dashed line leaves the one under it visible.
            lines.push(Line { name, colour: lines.len(), dashed, points: points.collect() });
        }
    }
    let along = (0..=100).map(|i| 0.1 * 10_f64.powf(f64::from(i) / 50.0));
    let threshold = along.map(|m| (m, args.snr)).collect();
    let name = format!("SNR {}", args.snr);
    lines.push(Line { name, colour: lines.len(), dashed: true, points: threshold });
    Chart {
        header: "How far one pixel is seen in rain".to_owned(),
        x: Axis {
            name: "distance, m".to_owned(),
            from: 0.1,
            to: 10.0,
            logarithmic: true,
            ticks: vec![0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0],
        },
        y: Axis {
            name: "SNR of one pixel".to_owned(),
            from: 0.01,
            to: 1000.0,
            logarithmic: true,
            ticks: vec![0.01, 0.1, 1.0, 10.0, 100.0, 1000.0],
        },
        lines,
        footer: "simulated; rain of 5.6 mm/h and dry air differ by less than a line's width"
            .to_owned(),
    }
}

fn say(args: &Args, report: &Report) -> Result<()> {
    print::line(format_args!(
        "range for an SNR of {} a pixel, target of reflectance {} (simulated)",
        report.snr, report.reflectance
    ))?;
    print::line(
        "rain    mm/h  drop mm  exposure us   paper m    physics m  dry air m  as printed m",
    )?;
    let metres =
        |range: Option<f64>| range.map_or_else(|| "none".to_owned(), |m| format!("{m:.3}"));
    for row in &report.rows {
        print::line(format_args!(
            "{:<6} {:5.2}  {:7.1}  {:11}   {:>3} to {:<3} {:>9}  {:>9}  {:>12.2}",
            row.rain,
            row.rate_mm_per_h,
            row.drop_mm,
            row.exposure_us,
            row.paper_m.0,
            row.paper_m.1,
            metres(row.physics_m),
            metres(row.dry_air_m),
            row.as_printed_m
        ))?;
    }
    for (title, lines) in [("reading", &report.reading), ("assumed", &report.assumptions)] {
        for line in lines {
            print::line(format_args!("{title}: {line}"))?;
        }
    }
    if let Some(out) = &args.out {
        print::line(format_args!("wrote {} and range.json", out.join("range.png").display()))?;
    }
    Ok(())
}

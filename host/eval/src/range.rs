//! The camera's range in rain by physics and by Algorithm 2 as printed, compared with the paper's
//! Table 2.

use crate::assumptions;
use crate::camera_model::{distance_axis, resolution_chart, snr_chart};
use crate::error::{EvalError, Result};
use nirspi::picture::{Axis, Chart, Figure, Line};
use nirspi_optics::CameraModel;
use nirspi_optics::camera::Instrument;
use nirspi_optics::pixel::{PixelBudget, PixelError};
use nirspi_optics::rain::blur::DEEPEST_SINGLE;
use nirspi_optics::rain::{Drops, PaperRain, Weather};
use nirspi_optics::range::{
    Floor, Wanted, as_printed_mm, exposure_needed_us, extinction_needed_per_m, farthest_mm,
};
use nirspi_optics::water::Water;
use serde::Serialize;

/// Settings of the range.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// Signal of a pixel divided by its noise at the farthest distance.
    pub snr: f64,
    /// Reflectance of the target.
    pub reflectance: f64,
    /// Exposures of a pattern.
    pub exposures_us: Vec<f64>,
    /// The camera.
    pub camera: CameraModel,
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

/// Algorithm 2's Z_max: the distance to which patterns are projected (paper, 2.A).
const Z_MAX_MM: f64 = 3000.0;

/// Ranges, compared with the paper's.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// Always true.
    pub simulated: bool,
    /// The camera description's name.
    pub camera: String,
    /// Signal of a pixel divided by its noise at the farthest distance.
    pub snr: f64,
    /// Reflectance of the target.
    pub reflectance: f64,
    /// The range in each rain with each exposure.
    pub rows: Vec<RowReport>,
    /// The exposure that a pixel needs, by distance.
    pub exposures: Vec<ExposureReport>,
    /// The terms of the budget.
    pub assumptions: Vec<String>,
    /// The assumptions that agree with the paper, and the results of physics.
    pub reading: Vec<String>,
}

/// The range in one rain with one exposure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RowReport {
    /// The rain.
    pub rain: &'static str,
    /// Its rate.
    pub rate_mm_per_h: f64,
    /// Diameter of its drops.
    pub drop_mm: f64,
    /// Extinction of the rain.
    pub extinction_per_m: f64,
    /// Extinction over 2 m.
    pub loss_over_2_m_percent: f64,
    /// Exposure of a pattern.
    pub exposure_us: f64,
    /// The paper's range, for 8 to 25 us together.
    pub paper_m: (f64, f64),
    /// Range by the photon budget; `null` if the signal is too weak at any distance.
    pub physics_m: Option<f64>,
    /// Range by the photon budget without rain.
    pub dry_air_m: Option<f64>,
    /// Range by Algorithm 2 as printed: the photons of one exposure compared with its noise.
    pub as_printed_m: f64,
    /// Range by Algorithm 2 with the gain of a differential Hadamard transform, which the listing
    /// does not have.
    pub as_printed_with_gain_m: f64,
}

/// The exposure of a pattern that a pixel needs at one distance.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ExposureReport {
    /// Distance of the target.
    pub distance_m: f64,
    /// Exposure for the required SNR, in the paper's heavy rain.
    pub needed_us: f64,
    /// For five times that SNR.
    pub needed_for_5_times_us: f64,
    /// The paper's exposure (2.D: 8 to 25 us for 0.3 to 1 m, with the ends assigned to the ends);
    /// `null` at other distances.
    pub paper_us: Option<f64>,
}

/// The paper's exposures: distance in m, time in us.
const PAPER_EXPOSURES: [(f64, f64); 2] = [(0.3, 8.0), (1.0, 25.0)];

/// Distances of the table of exposures, in m.
const EXPOSURE_DISTANCES_M: [f64; 6] = [0.3, 0.45, 0.6, 0.8, 1.0, 2.0];

/// The range in each rain of the paper's Table 2, with each exposure.
///
/// # Errors
/// [`EvalError::is_setting`] for a setting out of range.
pub fn range(settings: &Settings) -> Result<Report> {
    let Settings { snr, reflectance, .. } = *settings;
    if !(snr.is_finite() && snr > 0.0) {
        return Err(EvalError::setting("snr", snr, "more than 0"));
    }
    let Air { instrument, dry, wet } = Air::new(&settings.camera)?;
    let mut rows = Vec::new();
    for (row, weather) in TABLE_2.iter().zip(&wet) {
        for &exposure_us in &settings.exposures_us {
            let wanted = Wanted { reflectance, exposure_us, snr };
            let metres = |mm: f64| mm * 1e-3;
            let end = (row.rain.drop_mm, Z_MAX_MM);
            let printed = |floor| as_printed_mm(&instrument, weather, &wanted, end, floor);
            rows.push(RowReport {
                rain: row.name,
                rate_mm_per_h: row.rain.rate_mm_per_h,
                drop_mm: row.rain.drop_mm,
                extinction_per_m: weather.medium().extinction_per_m,
                loss_over_2_m_percent: 100.0 * (1.0 - weather.medium().transmission(2.0)),
                exposure_us,
                paper_m: row.range_m,
                physics_m: farthest_mm(&instrument, weather, &wanted)?.map(metres),
                dry_air_m: farthest_mm(&instrument, &dry, &wanted)?.map(metres),
                as_printed_m: metres(printed(Floor::OneExposure)?),
                as_printed_with_gain_m: metres(printed(Floor::WholePicture)?),
            });
        }
    }
    Ok(Report {
        simulated: true,
        camera: settings.camera.name.clone(),
        snr,
        reflectance,
        assumptions: assumptions(&instrument),
        reading: reading(&instrument, &wet, reflectance)?,
        exposures: exposures(&instrument, &wet, settings)?,
        rows,
    })
}

/// The exposures needed in heavy rain.
fn exposures(
    instrument: &Instrument,
    wet: &[Weather],
    settings: &Settings,
) -> Result<Vec<ExposureReport>> {
    let Some(heavy) = wet.last() else { return Ok(Vec::new()) };
    let at = |distance_m: f64| {
        let target = (distance_m * 1e3, settings.reflectance);
        let needed = |snr| exposure_needed_us(instrument, heavy, target, snr);
        let paper = PAPER_EXPOSURES.iter().find(|(m, _)| *m == distance_m);
        Ok(ExposureReport {
            distance_m,
            needed_us: needed(settings.snr)?,
            needed_for_5_times_us: needed(5.0 * settings.snr)?,
            paper_us: paper.map(|(_, us)| *us),
        })
    };
    EXPOSURE_DISTANCES_M.into_iter().map(at).collect()
}

/// The instrument, and the air in front of it: dry, and in the order of [`TABLE_2`].
struct Air {
    instrument: Instrument,
    dry: Weather,
    wet: Vec<Weather>,
}

impl Air {
    fn new(camera: &CameraModel) -> Result<Self> {
        let instrument = camera.instrument();
        let nm = instrument.budget.wavelength_nm;
        let weather = |drops| Ok(Weather::new(drops, nm, Water::Segelstein)?);
        let wet = TABLE_2.iter().map(|row| weather(row.rain.drops()?)).collect::<Result<_>>()?;
        Ok(Self { dry: weather(Drops::none())?, wet, instrument })
    }
}

fn assumptions(instrument: &Instrument) -> Vec<String> {
    let b = &instrument.budget;
    vec![
        format!(
            "{} mW of light an LED, half angle {} degrees, of which a lens of {} mm takes what it can",
            b.led_power_mw, b.led_half_angle_deg, instrument.projector.aperture_mm
        ),
        format!(
            "detector of {} mm, numerical aperture {}, efficiency {:.2}",
            b.detector_diameter_mm, b.detector_na, b.quantum_efficiency
        ),
        format!(
            "{:.0} electrons rms of amplifier noise a sample, {} klx ({}) behind a {} nm filter",
            instrument.chain.amplifier_noise_electrons, b.ambient_klx, b.light, b.filter_width_nm
        ),
        format!(
            "an exposure is the time that one pattern is shown, and its complement as long, of 1024 patterns; {} of {} \
             samples are left out while the LEDs settle",
            instrument.readout.blanked, instrument.readout.clocks_per_pattern
        ),
        format!(
            "as printed: Z_max of {} m (paper, 2.A), so that its answer is a multiple of {} m",
            Z_MAX_MM * 1e-3,
            Z_MAX_MM * 1e-4
        ),
        "drops of one size, 0.5 mm light and 2 mm heavy, as the paper's Table 2".to_owned(),
        "range is where a pixel of a uniform sheet has this SNR: defocus, which decides what can be read, has no part in it"
            .to_owned(),
    ]
}

/// The assumptions that agree with the paper, and the results of physics.
fn reading(
    instrument: &Instrument,
    weathers: &[Weather],
    reflectance: f64,
) -> Result<Vec<String>, PixelError> {
    let [light, heavy] = weathers else { return Ok(Vec::new()) };
    let snr_at = |weather: &Weather, distance_mm, exposure_us| {
        PixelBudget::new(instrument, weather, distance_mm, reflectance, exposure_us)
            .map(|p| p.pixel_snr)
    };
    let at_2_m = snr_at(light, 2000.0, 25.0)?;
    let agreed = |exposure_us| Wanted { reflectance, exposure_us, snr: at_2_m };
    let mut lines = vec![format!(
        "2 m in light rain at 25 µs agrees with the paper if a pixel may have an SNR of {at_2_m:.2}"
    )];
    if let Some(mm) = farthest_mm(instrument, heavy, &agreed(25.0))? {
        lines.push(format!(
            "the same SNR in heavy rain at 25 µs: {:.3} m, not 1.5: 2 m of this rain take out {:.2} % of the light",
            mm * 1e-3,
            100.0 * (1.0 - heavy.medium().transmission(2.0))
        ));
    }
    if let Some(mm) = farthest_mm(instrument, heavy, &agreed(8.0))? {
        lines.push(format!(
            "the same SNR at 8 µs: {:.2} m; the paper's 2 and 1.5 m differ as its two exposures do \
             ((25/8)^(1/4) = 1.33), whatever falls",
            mm * 1e-3
        ));
    }
    if let Some(needed) = extinction_needed_per_m(instrument, heavy, &agreed(25.0), 1500.0)? {
        let factor = needed / heavy.medium().extinction_per_m;
        let at_least = if needed * 1.5 > 0.99 * DEEPEST_SINGLE { "at least " } else { "" };
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
    let [near, far] = PAPER_EXPOSURES
        .map(|(m, _)| exposure_needed_us(instrument, heavy, (m * 1e3, reflectance), 1.0));
    let (near, far) = (near?, far?);
    lines.push(format!(
        "the exposure needed grows as the fourth power of the distance: {:.0} times from 0.3 to 1 m; the paper's \
         8 and 25 µs grow by 3.1",
        far / near
    ));
    lines.push(
        "as printed: the photons of one exposure of one LED against the noise of one exposure; a picture is made of 2048 \
         exposures, which gains sqrt(512) in SNR (with gain). delta_th, how near is near enough, is free in the listing"
            .to_owned(),
    );
    lines.push(
        "the paper's lower limits (0.1 and 0.2 m) follow from no term here; Algorithm 2's first step, \
         Z_max / 10, is that long for a Z_max of 1 and 2 m"
            .to_owned(),
    );
    Ok(lines)
}

/// The figures and their names: `range` (the [`charts`]), `exposure`, `resolution` and `snr` of this camera beside
/// the shipped ones, and `assumptions` of the paper's.
///
/// # Errors
/// [`EvalError::is_setting`] for a reflectance out of range.
pub fn figures(settings: &Settings) -> Result<[(&'static str, Figure); 5]> {
    let camera = &settings.camera;
    Ok([
        ("range", Figure::column(charts(settings)?)),
        ("exposure", exposure_chart(settings)?.into()),
        ("resolution", resolution_chart(camera)?.into()),
        ("snr", snr_chart(camera)?.into()),
        ("assumptions", assumptions::chart()?.into()),
    ])
}

/// Distances of the lines, in m: 0.1 to 10.
fn distances_m() -> impl Iterator<Item = f64> {
    (0..=200).map(|i| 0.1 * 100.0_f64.powf(f64::from(i) / 200.0))
}

/// Two charts against the distance: signal divided by noise of a pixel in dry air, with each
/// exposure, and the part of the SNR that light rain, heavy rain and fog take.
///
/// # Errors
/// Does not occur: the air is the paper's.
pub fn charts(settings: &Settings) -> Result<[Chart; 2]> {
    let Air { instrument, dry, wet } = &Air::new(&settings.camera)?;
    let snr = |weather: &Weather, m: f64, exposure_us| {
        PixelBudget::new(instrument, weather, m * 1e3, settings.reflectance, exposure_us)
            .map(|pixel| pixel.pixel_snr)
    };
    let x = || Axis::of("distance, m", vec![0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0], true);
    let mut lines = Vec::new();
    for &exposure_us in &settings.exposures_us {
        let points = distances_m().filter_map(|m| Some((m, snr(dry, m, exposure_us).ok()?)));
        let (name, points) = (format!("{exposure_us} µs"), points.collect());
        lines.push(Line { name, colour: lines.len(), dashed: false, points });
    }
    let name = format!("SNR {}", settings.snr);
    let points = distances_m().map(|m| (m, settings.snr)).collect();
    lines.push(Line { name, colour: lines.len(), dashed: true, points });
    let far = Chart {
        header: "How far one pixel is seen in dry air".to_owned(),
        x: x(),
        y: Axis::of("SNR of one pixel", vec![0.01, 0.1, 1.0, 10.0, 100.0, 1000.0], true),
        lines,
        footer:
            "simulated: photon budget of a uniform sheet; each line is an exposure of a pattern"
                .to_owned(),
    };

    let longest = settings.exposures_us.iter().copied().fold(0.0, f64::max);
    let fog = Drops::fog(10.0, 0.1)
        .and_then(|fog| Weather::new(fog, instrument.budget.wavelength_nm, Water::Segelstein));
    let rains = TABLE_2.iter().zip(wet).map(|(row, weather)| {
        (format!("{} rain, {} mm drops", row.name, row.rain.drop_mm), weather)
    });
    let fogs = fog.iter().map(|fog| ("fog, 0.1 g/m3".to_owned(), fog));
    let mut lines = Vec::new();
    for (name, weather) in rains.chain(fogs) {
        let lost = |m| {
            let dry = snr(dry, m, longest).ok()?;
            Some((m, 100.0 * (1.0 - snr(weather, m, longest).ok()? / dry)))
        };
        let points = distances_m().filter_map(lost).collect();
        lines.push(Line { name, colour: lines.len(), dashed: false, points });
    }
    let values = lines.iter().flat_map(|line| &line.points).map(|point| point.1);
    let lost = Chart {
        header: "What rain and fog take of that".to_owned(),
        x: x(),
        y: Axis::decades("loss of SNR, %", values, 6),
        lines,
        footer: format!(
            "simulated: light rain of {} mm/h, heavy rain of {} mm/h, {longest} µs",
            PaperRain::LIGHT.rate_mm_per_h,
            PaperRain::HEAVY.rate_mm_per_h
        ),
    };
    Ok([far, lost])
}

/// The exposure of a pattern that a pixel needs, against distance, in heavy rain, with the paper's
/// exposures for comparison.
///
/// # Errors
/// [`EvalError::is_setting`] for a reflectance out of range.
pub fn exposure_chart(settings: &Settings) -> Result<Chart> {
    let Air { instrument, wet, .. } = &Air::new(&settings.camera)?;
    let Some(heavy) = wet.last() else { return Ok(exposures_against_distance(Vec::new())) };
    let along = || (0..=60).map(|i| 0.2 * 10_f64.powf(f64::from(i) / 60.0));
    let line = |times: f64, colour| -> Result<Line> {
        let snr = times * settings.snr;
        let point = |m: f64| {
            let target = (m * 1e3, settings.reflectance);
            Ok((m, exposure_needed_us(instrument, heavy, target, snr)?))
        };
        let points = along().map(point).collect::<Result<Vec<_>, PixelError>>()?;
        Ok(Line { name: format!("SNR {snr}"), colour, dashed: false, points })
    };
    let mut lines = vec![line(1.0, 0)?, line(5.0, 1)?];
    lines.push(Line {
        name: "paper, 2.D".to_owned(),
        colour: 2,
        dashed: true,
        points: PAPER_EXPOSURES.to_vec(),
    });
    Ok(exposures_against_distance(lines))
}

fn exposures_against_distance(lines: Vec<Line>) -> Chart {
    Chart {
        header: "Exposure of a pattern that a pixel needs".to_owned(),
        x: distance_axis(),
        y: Axis {
            name: "exposure, µs".to_owned(),
            from: 0.001,
            to: 1000.0,
            logarithmic: true,
            ticks: vec![0.001, 0.01, 0.1, 1.0, 10.0, 100.0, 1000.0],
        },
        lines,
        footer: "simulated; white target unless --reflectance says otherwise, rain of 5.6 mm/h, noise of the amplifier"
            .to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(exposures_us: &[f64]) -> Settings {
        let camera = CameraModel::default();
        Settings { snr: 1.0, reflectance: 1.0, exposures_us: exposures_us.to_vec(), camera }
    }

    #[test]
    fn rain_shortens_the_range_a_little_and_a_longer_exposure_lengthens_it() {
        let report = range(&settings(&[8.0, 25.0])).unwrap();
        assert_eq!(
            report.rows.iter().map(|row| row.rain).collect::<Vec<_>>(),
            ["light", "light", "heavy", "heavy"]
        );
        for pair in report.rows.chunks_exact(2) {
            let (short, long) = (pair[0].physics_m.unwrap(), pair[1].physics_m.unwrap());
            // The signal falls as the fourth power of the distance, the noise with the root of the
            // exposure's length.
            assert!((long / short / (25.0_f64 / 8.0).powf(0.25) - 1.0).abs() < 0.12, "{report:?}");
            assert!(long < pair[1].dry_air_m.unwrap());
            // The gain of all patterns together lengthens the range.
            assert!(
                pair.iter().all(|row| row.as_printed_m < row.as_printed_with_gain_m),
                "{report:?}"
            );
        }
        assert!(report.reading.iter().any(|line| line.contains("not 1.5")), "{report:?}");
    }

    #[test]
    fn the_exposure_needed_stands_beside_the_papers_at_both_ends() {
        let report = range(&settings(&[8.0])).unwrap();
        let paper: Vec<(f64, Option<f64>)> =
            report.exposures.iter().map(|row| (row.distance_m, row.paper_us)).collect();
        assert_eq!((paper[0], paper[4]), ((0.3, Some(8.0)), (1.0, Some(25.0))));
        for row in &report.exposures {
            assert!((row.needed_for_5_times_us / row.needed_us - 25.0).abs() < 1e-9, "{row:?}");
        }
        assert_eq!(exposure_chart(&settings(&[8.0])).unwrap().lines.len(), 3);
    }

    #[test]
    fn the_charts_have_a_line_for_each_exposure_and_for_each_weather() {
        let [far, lost] = charts(&settings(&[8.0, 25.0])).unwrap();
        assert_eq!((crate::looks(&far), crate::looks(&lost)), (2 + 1, 3));
        // No two lines coincide: at 2 m the losses differ by a tenth of themselves and more.
        let at_2_m = |line: &Line| line.points.iter().find(|point| point.0 > 2.0).unwrap().1;
        let mut losses: Vec<f64> = lost.lines.iter().map(at_2_m).collect();
        losses.sort_unstable_by(f64::total_cmp);
        assert!(losses.windows(2).all(|pair| pair[1] > 1.1 * pair[0]), "{losses:?}");
    }

    #[test]
    fn settings_out_of_range_are_named() {
        let told = |settings: &Settings| {
            let error = range(settings).unwrap_err();
            assert!(error.is_setting());
            error.to_string()
        };
        let blind = Settings { snr: 0.0, ..settings(&[8.0]) };
        assert_eq!(told(&blind), "snr is 0, expected more than 0");
        assert!(told(&settings(&[-8.0])).contains("exposure_us is -8"));
    }
}

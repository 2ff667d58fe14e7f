//! `nirspi rain`: what rain, fog and single drops do to light; the photon budget; the rain simulator's uniformity.

mod budget;
mod rig;

use super::{Usage, print};
use anyhow::{Context, Result};
use nirspi_optics::mie::{Index, Mie};
use nirspi_optics::rain::fall::{beta, fall_speed_m_per_s, fall_time_constant_s};
use nirspi_optics::rain::radar::drops_reflectivity_db;
use nirspi_optics::rain::{DropClass, Drops, Medium, PaperRain};
use nirspi_optics::water::Water;
use serde::Serialize;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::str::FromStr;

/// Say what rain does to light: extinction, scattering, photon budget; one sphere; a rain simulator's uniformity
///
/// Without --mie, --budget, --uniformity or --rig: extinction, scattering and absorption of the rain or fog at each
/// wavelength. Water's index is Segelstein's, 400 to 2000 nm.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi rain --rate-mm-h 5.6\n\
    \x20 nirspi rain --drops mono:2 --budget --distance-m 1\n\
    \x20 nirspi rain --mie --x 100 --m-re 1.33 --m-im 1e-4 --json\n\
    \x20 nirspi rain --uniformity volumes.csv")]
pub struct Args {
    #[command(flatten)]
    drops: DropArgs,
    /// Wavelengths, in nm
    #[arg(long, value_name = "NM,...", value_delimiter = ',', default_values_t = [550.0, 850.0, 1550.0],
          allow_negative_numbers = true)]
    wavelengths_nm: Vec<f64>,
    /// Length of the path that a share of light is given for (there and back), or distance of the target, in metres
    #[arg(long, value_name = "M", default_value_t = 1.0, allow_negative_numbers = true)]
    distance_m: f64,
    /// One sphere: efficiencies for --x, --m-re and --m-im
    #[arg(long, requires_all = ["x", "m_re"], group = "what")]
    mie: bool,
    /// Size parameter, pi times diameter over wavelength
    #[arg(long, value_name = "X", requires = "mie", allow_negative_numbers = true)]
    x: Option<f64>,
    /// Real part of the refractive index
    #[arg(long, value_name = "N", requires = "mie", allow_negative_numbers = true)]
    m_re: Option<f64>,
    /// Imaginary part of the refractive index, positive for a sphere that absorbs
    #[arg(
        long,
        value_name = "K",
        requires = "mie",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    m_im: f64,
    /// The photon budget of one pixel, term by term
    #[arg(long, group = "what")]
    budget: bool,
    /// Reflectance of the target, for --budget
    #[arg(
        long,
        value_name = "0..1",
        requires = "budget",
        default_value_t = 1.0,
        allow_negative_numbers = true
    )]
    reflectance: f64,
    /// Exposure of each pattern in us, for --budget
    #[arg(
        long,
        value_name = "US",
        requires = "budget",
        default_value_t = 25.0,
        allow_negative_numbers = true
    )]
    exposure_us: f64,
    /// Christiansen's uniformity coefficient of collected volumes: a CSV file whose last column holds them
    #[arg(long, value_name = "FILE", group = "what")]
    uniformity: Option<PathBuf>,
    /// The same for a simulated rain simulator of six nozzles, 1.2 x 0.6 x 0.5 m
    #[arg(long, group = "what")]
    rig: bool,
    /// Tilt of the simulated rig's floor, in degrees
    #[arg(
        long,
        value_name = "DEG",
        requires = "rig",
        default_value_t = 0.0,
        allow_negative_numbers = true
    )]
    tilt_deg: f64,
    /// Seed of the simulated rig
    #[arg(long, value_name = "N", requires = "rig", default_value_t = 1)]
    seed: u64,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

/// Targets of which a budget says anything, in metres: nearer than a quarter of the lens's focal length light fills the
/// ADC whatever the gain, and the depth sensor's readings end at 65 m.
const BUDGET_DISTANCES_M: RangeInclusive<f64> = 0.05..=65.0;

/// What falls.
#[derive(Debug, Clone, clap::Args)]
pub struct DropArgs {
    /// Rain rate, in mm/h
    #[arg(long, value_name = "R", default_value_t = PaperRain::HEAVY.rate_mm_per_h, allow_negative_numbers = true)]
    pub rate_mm_h: f64,
    /// Drop sizes: marshall-palmer, mono:MM, gamma:SHAPE,SLOPE (slope per mm), fog:UM,G (mode in um, water in g/m3),
    /// or a CSV file of diameters in mm and drops per m3
    #[arg(long, value_name = "LAW", default_value = "marshall-palmer")]
    pub drops: String,
}

impl DropArgs {
    /// The drops asked for.
    pub fn drops(&self) -> Result<Drops> {
        let law: Law = self.drops.parse().map_err(|e: String| Usage(format!("--drops: {e}")))?;
        let rate = self.rate_mm_h;
        let drops = match law {
            Law::MarshallPalmer => Drops::marshall_palmer(rate),
            Law::Mono(mm) => Drops::monodisperse(rate, mm),
            Law::Gamma(shape, slope) => Drops::gamma(rate, shape, slope),
            Law::Fog(um, water) => Drops::fog(um, water),
            Law::File(path) => Drops::measured(read_classes(&path)?),
        };
        drops.map_err(|error| Usage(error.to_string()).into())
    }
}

/// A law of drop sizes.
#[derive(Debug, Clone, PartialEq)]
enum Law {
    MarshallPalmer,
    Mono(f64),
    Gamma(f64, f64),
    Fog(f64, f64),
    File(PathBuf),
}

impl FromStr for Law {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = |numbers: &str, count: usize| {
            let found: Result<Vec<f64>, _> =
                numbers.split(',').map(|n| n.trim().parse::<f64>()).collect();
            found
                .ok()
                .filter(|found| found.len() == count)
                .ok_or_else(|| format!("found {text}, expected {count} number(s) after the colon"))
        };
        Ok(match text.split_once(':') {
            None if text == "marshall-palmer" => Self::MarshallPalmer,
            Some(("mono", rest)) => Self::Mono(numbers(rest, 1)?[0]),
            Some(("gamma", rest)) => {
                let numbers = numbers(rest, 2)?;
                Self::Gamma(numbers[0], numbers[1])
            }
            Some(("fog", rest)) => {
                let numbers = numbers(rest, 2)?;
                Self::Fog(numbers[0], numbers[1])
            }
            None if text.to_ascii_lowercase().ends_with(".csv") => Self::File(text.into()),
            _ => {
                return Err(format!(
                    "found {text}, expected marshall-palmer, mono:MM, gamma:SHAPE,SLOPE, fog:UM,G or a .csv file"
                ));
            }
        })
    }
}

/// Fields of a CSV file, line by line; a first line with no number in it is a heading, lines with # are comments.
struct Table {
    path: PathBuf,
    rows: Vec<(usize, Vec<String>)>,
}

impl Table {
    fn read(path: &Path) -> Result<Self> {
        let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
        let lines = text.lines().enumerate().map(|(at, line)| (at + 1, line.trim()));
        let mut rows: Vec<(usize, Vec<String>)> = lines
            .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
            .map(|(at, line)| {
                (at, line.split([',', ';', '\t']).map(|f| f.trim().to_owned()).collect())
            })
            .collect();
        let is_heading = |(_, fields): &(usize, Vec<String>)| {
            fields.iter().all(|field| field.parse::<f64>().is_err())
        };
        if rows.first().is_some_and(is_heading) {
            rows.remove(0);
        }
        Ok(Self { path: path.to_owned(), rows })
    }

    fn number(&self, line: usize, field: &str) -> Result<f64> {
        field.parse().ok().with_context(|| {
            format!("{}: line {line}: found {field:?}, expected a number", self.path.display())
        })
    }

    /// The last field of each row.
    fn last_column(&self) -> Result<Vec<f64>> {
        let last = |(line, fields): &(usize, Vec<String>)| {
            self.number(*line, fields.last().map_or("", String::as_str))
        };
        self.rows.iter().map(last).collect()
    }

    /// Rows of two numbers.
    fn pairs(&self, what: &str) -> Result<Vec<[f64; 2]>> {
        let pair = |(line, fields): &(usize, Vec<String>)| match &fields[..] {
            [a, b] => Ok([self.number(*line, a)?, self.number(*line, b)?]),
            _ => anyhow::bail!(
                "{}: line {line}: found {} numbers, expected 2: {what}",
                self.path.display(),
                fields.len()
            ),
        };
        self.rows.iter().map(pair).collect()
    }
}

fn read_classes(path: &Path) -> Result<Vec<DropClass>> {
    let pairs = Table::read(path)?.pairs("diameter in mm, drops per m3")?;
    let class = |[diameter_mm, per_m3]: [f64; 2]| DropClass { diameter_mm, per_m3 };
    Ok(pairs.into_iter().map(class).collect())
}

pub fn run(args: &Args) -> Result<ExitCode> {
    if args.mie {
        return sphere(args);
    }
    if let Some(path) = &args.uniformity {
        return rig::measured(path, args.json);
    }
    if args.rig {
        return rig::simulated(args.tilt_deg, args.seed, args.json);
    }
    let distance = args.distance_m;
    if !(distance.is_finite() && distance > 0.0) {
        return Err(Usage(format!(
            "--distance-m is {distance}, expected a positive number of metres"
        ))
        .into());
    }
    if args.budget {
        if !BUDGET_DISTANCES_M.contains(&distance) {
            let (near, far) = (BUDGET_DISTANCES_M.start(), BUDGET_DISTANCES_M.end());
            return Err(Usage(format!(
                "--distance-m is {distance}, expected {near} to {far} metres for --budget"
            ))
            .into());
        }
        let wanted = budget::Wanted {
            drops: args.drops.drops()?,
            distance_m: distance,
            reflectance: args.reflectance,
            exposure_us: args.exposure_us,
            wavelengths_nm: args.wavelengths_nm.clone(),
        };
        return budget::run(&wanted, args.json);
    }
    rain(args)
}

#[derive(Debug, Serialize)]
struct SphereReport {
    x: f64,
    m_re: f64,
    m_im: f64,
    qext: f64,
    qsca: f64,
    qabs: f64,
    qback: f64,
    g: f64,
}

fn sphere(args: &Args) -> Result<ExitCode> {
    let (Some(x), Some(m_re)) = (args.x, args.m_re) else {
        return Err(Usage("--mie needs --x and --m-re".to_owned()).into());
    };
    let index = Index { real: m_re, imaginary: args.m_im };
    let mut mie = Mie::new();
    let q = mie.sphere(x, index).map_err(|error| Usage(error.to_string()))?.efficiencies();
    let report = SphereReport {
        x,
        m_re,
        m_im: args.m_im,
        qext: q.extinction,
        qsca: q.scattering,
        qabs: q.absorption,
        qback: q.backscatter,
        g: q.asymmetry,
    };
    if args.json {
        print::json(&report)?;
    } else {
        print::line(format_args!("x = {x}, m = {m_re} + {}i", args.m_im))?;
        print::line(format_args!("Q_ext  {:.9e}", report.qext))?;
        print::line(format_args!("Q_sca  {:.9e}", report.qsca))?;
        print::line(format_args!("Q_abs  {:.9e}", report.qabs))?;
        print::line(format_args!("Q_back {:.9e}", report.qback))?;
        print::line(format_args!("g      {:.9}", report.g))?;
    }
    Ok(ExitCode::SUCCESS)
}

#[derive(Debug, Serialize)]
struct RainReport {
    drops: String,
    rate_mm_per_h: f64,
    drops_per_m3: f64,
    water_g_per_m3: f64,
    z_dr_db: Option<f64>,
    path_m: f64,
    wavelengths: Vec<WavelengthReport>,
    /// Of a single drop size only.
    fall: Option<FallReport>,
    note: &'static str,
}

#[derive(Debug, Serialize)]
struct WavelengthReport {
    wavelength_nm: f64,
    extinction_per_m: f64,
    scattering_per_m: f64,
    absorption_per_m: f64,
    extinction_db_per_km: f64,
    albedo: f64,
    asymmetry: f64,
    /// Lost over the path and back; none of it comes back here by forward scattering.
    loss_there_and_back: f64,
    /// `null` in dry air.
    visibility_m: Option<f64>,
}

#[derive(Debug, Serialize)]
struct FallReport {
    diameter_mm: f64,
    speed_m_per_s: f64,
    time_constant_ms: f64,
    /// For exposures of 25 us (one pattern) and 20 ms (an image).
    beta_25_us: f64,
    beta_20_ms: f64,
}

const NOTE: &str = "extinction counts light diffracted by under a milliradian, half of it, as lost; \
                    a camera of this resolution does not lose it (docs/physics.md)";

fn rain(args: &Args) -> Result<ExitCode> {
    let drops = args.drops.drops()?;
    let mut wavelengths = Vec::new();
    for &nm in &args.wavelengths_nm {
        let medium = Medium::new(&drops, nm, Water::Segelstein)
            .map_err(|error| Usage(format!("--wavelengths-nm: {error}")))?;
        wavelengths.push(WavelengthReport {
            wavelength_nm: nm,
            extinction_per_m: medium.extinction_per_m,
            scattering_per_m: medium.scattering_per_m,
            absorption_per_m: medium.absorption_per_m,
            extinction_db_per_km: medium.extinction_db_per_km(),
            albedo: medium.albedo(),
            asymmetry: medium.asymmetry,
            loss_there_and_back: 1.0 - medium.transmission(2.0 * args.distance_m),
            visibility_m: Some(medium.visibility_m()).filter(|v| v.is_finite()),
        });
    }
    let fall = match drops.classes() {
        [one] => Some(FallReport {
            diameter_mm: one.diameter_mm,
            speed_m_per_s: fall_speed_m_per_s(one.diameter_mm),
            time_constant_ms: fall_time_constant_s(one.diameter_mm) * 1e3,
            beta_25_us: beta(one.diameter_mm, 25e-6),
            beta_20_ms: beta(one.diameter_mm, 20e-3),
        }),
        _ => None,
    };
    let report = RainReport {
        drops: args.drops.drops.clone(),
        rate_mm_per_h: drops.rate_mm_per_h(),
        drops_per_m3: drops.concentration_per_m3(),
        water_g_per_m3: drops.liquid_water_g_per_m3(),
        z_dr_db: drops_reflectivity_db(&drops).filter(|_| !args.drops.drops.starts_with("fog")),
        path_m: args.distance_m,
        wavelengths,
        fall,
        note: NOTE,
    };
    if args.json {
        print::json(&report)?;
    } else {
        say(&report)?;
    }
    Ok(ExitCode::SUCCESS)
}

fn say(report: &RainReport) -> Result<()> {
    print::line(format_args!(
        "{}: {:.2} mm/h, {:.4} g/m3 of water in {:.0} drops a cubic metre{}",
        report.drops,
        report.rate_mm_per_h,
        report.water_g_per_m3,
        report.drops_per_m3,
        report.z_dr_db.map_or_else(String::new, |db| format!(", Z_dr {db:.2} dB"))
    ))?;
    print::line("      nm   extinction   scattering   absorption    dB/km  albedo       g   lost")?;
    for w in &report.wavelengths {
        print::line(format_args!(
            "{:8.0}  {:.4e}/m  {:.4e}/m  {:.4e}/m  {:7.3}  {:.4}  {:.4}  {:.3} %",
            w.wavelength_nm,
            w.extinction_per_m,
            w.scattering_per_m,
            w.absorption_per_m,
            w.extinction_db_per_km,
            w.albedo,
            w.asymmetry,
            100.0 * w.loss_there_and_back
        ))?;
    }
    print::line(format_args!("lost: over {} m and back. {}", report.path_m, report.note))?;
    if let Some(fall) = &report.fall {
        print::line(format_args!(
            "a drop of {} mm falls at {:.2} m/s, twice its diameter in {:.3} ms; \
             beta is {:.2} for 25 us, {:.4} for 20 ms",
            fall.diameter_mm,
            fall.speed_m_per_s,
            fall.time_constant_ms,
            fall.beta_25_us,
            fall.beta_20_ms
        ))?;
    }
    Ok(())
}

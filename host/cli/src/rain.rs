//! `nirspi physics rain`, `budget`, `sphere` and `rig`: the effects of rain, fog and single drops on light, the photon
//! budget, the rain simulator's uniformity.

use super::camera::ModelArgs;
use super::{Usage, print, provenance, refused};
use crate::report::{FigureArgs, ReportArgs};
use anyhow::{Context, Result};
use nirspi::files::output::OutputDir;
use nirspi::files::table::Table;
use nirspi::picture::Figure;
use nirspi_eval::rain::budget::{self, Settings, Term};
use nirspi_eval::rain::{self, RainReport, curves, rig};
use nirspi_optics::mie::Index;
use nirspi_optics::rain::{DropLaw, Drops, PaperRain};
use nirspi_virtual::weather::{is_drop_file, read_drops};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Say what rain or fog does to light: extinction, scattering and absorption at each wavelength
///
/// The refractive index of water is Segelstein's, 400 to 2000 nm. --out writes curves of these against wavelength and drop
/// size, of drop sizes and fall speeds, and of extinction against rain rate beside laws of measured optical links, and
/// rain.json.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi physics rain --rate-mm-h 5.6\n\
    \x20 nirspi physics rain --drops mono:2 --out rain/")]
pub struct Args {
    #[command(flatten)]
    weather: WeatherArgs,
    /// Folder for figures of rain, each with its points as CSV, and rain.json
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    figure: FigureArgs,
    #[command(flatten)]
    report: ReportArgs,
}

/// Say where the light of one pixel goes, term by term: the photon budget in rain
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  nirspi physics budget --drops mono:2 --distance-m 1")]
pub struct BudgetArgs {
    #[command(flatten)]
    weather: WeatherArgs,
    /// Reflectance of the target
    #[arg(long, value_name = "0..1", default_value_t = 1.0)]
    reflectance: f64,
    /// Exposure of each pattern in µs
    #[arg(long, value_name = "US", default_value_t = 25.0)]
    exposure_us: f64,
    #[command(flatten)]
    model: ModelArgs,
    #[command(flatten)]
    report: ReportArgs,
}

/// Say what one sphere does to light, by Mie's theory: efficiencies and asymmetry
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  nirspi physics sphere --x 100 --m-re 1.33 --m-im 1e-4")]
pub struct SphereArgs {
    /// Size parameter, pi times diameter over wavelength
    #[arg(long, value_name = "X")]
    x: f64,
    /// Real part of the refractive index
    #[arg(long, value_name = "N")]
    m_re: f64,
    /// Imaginary part of the refractive index, positive for a sphere that absorbs
    #[arg(long, value_name = "K", default_value_t = 0.0)]
    m_im: f64,
    #[command(flatten)]
    report: ReportArgs,
}

/// Say how even a rain simulator's rain is: Christiansen's uniformity coefficient
///
/// Without --volumes it is that of a simulated rain simulator of six nozzles, 1.2 x 0.6 x 0.5 m.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n\
    \x20 nirspi physics rig --tilt-deg 5\n\
    \x20 nirspi physics rig --volumes volumes.csv")]
pub struct RigArgs {
    /// Volumes that were collected: a CSV file whose last column holds them
    #[arg(long, value_name = "FILE", conflicts_with_all = ["tilt_deg", "seed"])]
    volumes: Option<PathBuf>,
    /// Tilt of the simulated rig's floor, in degrees
    #[arg(long, value_name = "DEG", default_value_t = 0.0)]
    tilt_deg: f64,
    /// Seed of the simulated rig
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    report: ReportArgs,
}

/// Rain or fog on the way, and the light that passes it.
#[derive(Debug, clap::Args)]
struct WeatherArgs {
    #[command(flatten)]
    drops: DropArgs,
    /// Wavelengths, in nm
    #[arg(long, value_name = "NM,...", value_delimiter = ',', default_values_t = [550.0, 850.0, 1550.0])]
    wavelengths_nm: Vec<f64>,
    /// Distance of the target in metres; light passes it there and back
    #[arg(long, value_name = "M", default_value_t = 1.0)]
    distance_m: f64,
}

/// What falls.
#[derive(Debug, Clone, clap::Args)]
pub struct DropArgs {
    /// Rain rate, in mm/h
    #[arg(long, value_name = "R", default_value_t = PaperRain::HEAVY.rate_mm_per_h)]
    pub rate_mm_h: f64,
    /// Drop sizes: marshall-palmer, mono:MM, gamma:SHAPE,SLOPE (slope per mm), fog:UM,G (most frequent diameter in µm, water in g/m3),
    /// or a CSV file of diameters in mm and drops per m3
    #[arg(long, value_name = "LAW", default_value = "marshall-palmer")]
    pub drops: String,
}

impl DropArgs {
    /// The drops asked for.
    fn drops(&self) -> Result<Drops> {
        if self.is_file() {
            return Ok(read_drops(Path::new(&self.drops))?);
        }
        let law = self.drops.parse::<DropLaw>();
        let law = law.map_err(|e| Usage(format!("--drops: {e}, or a .csv file")))?;
        law.drops(self.rate_mm_h).map_err(|error| Usage(error.to_string()).into())
    }

    /// The rate asked for, where the drops of the law carry another one.
    fn asked_mm_per_h(&self) -> Option<f64> {
        let law = self.drops.parse::<DropLaw>().ok()?;
        law.is_fitted().then_some(self.rate_mm_h)
    }

    fn is_file(&self) -> bool {
        is_drop_file(&self.drops)
    }
}

pub fn run(args: &Args) -> Result<ExitCode> {
    let WeatherArgs { drops: asked, wavelengths_nm, distance_m } = &args.weather;
    let (name, drops) = (&asked.drops, asked.drops()?);
    let radar = !name.starts_with("fog");
    let report = rain::rain(name, &drops, wavelengths_nm, *distance_m, radar).map_err(refused)?;
    let report = RainReport { asked_mm_per_h: asked.asked_mm_per_h(), ..report };
    if let Some(path) = &args.out {
        let curves = curves::curves(name, &drops, wavelengths_nm).map_err(refused)?;
        let provenance = provenance::simulated();
        let mut out = OutputDir::create(path)?;
        for curves in &curves {
            let figure = Figure::from(curves.chart.clone());
            figure.write(&mut out, curves.name, args.figure.figure, &provenance)?;
        }
        out.write("rain.json", provenance.sign(&report)?.as_bytes())?;
        out.commit()?;
    }
    args.report.print(&report, &provenance::simulated(), |report| {
        say(report)?;
        args.out.as_ref().map_or(Ok(()), |path| {
            let path = path.display();
            print::line(format_args!("wrote figures and rain.json to {path}"))
        })
    })
}

pub fn budget(args: &BudgetArgs) -> Result<ExitCode> {
    let settings = Settings {
        drops: args.weather.drops.drops()?,
        distance_m: args.weather.distance_m,
        reflectance: args.reflectance,
        exposure_us: args.exposure_us,
        wavelengths_nm: args.weather.wavelengths_nm.clone(),
        camera: args.model.read()?,
    };
    let report = budget::budget(&settings).map_err(refused)?;
    args.report.print(&report, &provenance::simulated(), say_budget)
}

pub fn sphere(args: &SphereArgs) -> Result<ExitCode> {
    let SphereArgs { x, m_re, m_im, report: printer } = args;
    let report = rain::sphere(*x, Index { real: *m_re, imaginary: *m_im }).map_err(refused)?;
    printer.print(&report, &provenance::simulated(), |report| {
        print::line(format_args!("x = {x}, m = {m_re} + {m_im}i"))?;
        print::line(format_args!("Q_ext  {:.9e}", report.qext))?;
        print::line(format_args!("Q_sca  {:.9e}", report.qsca))?;
        print::line(format_args!("Q_abs  {:.9e}", report.qabs))?;
        print::line(format_args!("Q_back {:.9e}", report.qback))?;
        print::line(format_args!("g      {:.9}", report.g))
    })
}

pub fn rig(args: &RigArgs) -> Result<ExitCode> {
    let report = match &args.volumes {
        Some(path) => {
            let volumes = Table::read(path)?.last_column()?;
            rig::measured(&volumes).with_context(|| path.display().to_string())?
        }
        None => rig::simulated(args.tilt_deg, args.seed).map_err(refused)?,
    };
    args.report.print(&report, &provenance::simulated(), say_uniformity)
}

fn say(report: &RainReport) -> Result<()> {
    print::line(format_args!(
        "{}: {:.2} mm/h{}, {:.4} g/m3 of water in {:.0} drops a cubic metre{}",
        report.drops,
        report.rate_mm_per_h,
        report.asked_mm_per_h.map_or_else(String::new, |asked| format!(
            " by the drops that the law gives for {asked} mm/h"
        )),
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
             beta is {:.2} for 25 µs, {:.4} for 20 ms",
            fall.diameter_mm,
            fall.speed_m_per_s,
            fall.time_constant_ms,
            fall.beta_25_us,
            fall.beta_20_ms
        ))?;
        let rig = &fall.rig;
        print::line(format_args!(
            "in a rig, {} m below nozzles that let drops go at rest: {:.2} m/s, {:.0} drops a cubic metre, {:.2} times the \
             extinction",
            rig.height_m, rig.speed_m_per_s, rig.drops_per_m3, rig.times_as_many
        ))?;
    }
    Ok(())
}

fn say_budget(report: &budget::Report) -> Result<()> {
    let budget::Report { reflectance, distance_m, exposure_us, .. } = report;
    print::line(format_args!(
        "one pixel, target of reflectance {reflectance} at {distance_m} m, {exposure_us} µs a pattern (simulated)"
    ))?;
    for Term { name, value, unit, how } in &report.terms {
        print::line(format_args!("{name:<28} {:>12} {unit:<10} {how}", figure(*value)))?;
    }
    print::line(format_args!(
        "{} klx of daylight from such a target, through the lens and a filter of {} nm (ASTM G173-03):",
        report.ambient_klx, report.filter_width_nm
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
    Ok(())
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

fn say_uniformity(report: &rig::Report) -> Result<()> {
    let from = match report.tilt_deg {
        Some(tilt) => {
            format!("simulated: six nozzles in two rows, floor tilted by {tilt} degrees")
        }
        None => "measured".to_owned(),
    };
    print::line(format_args!(
        "uniformity (Christiansen) {:.2} % of {} volumes, mean {:.4}, {:.4} to {:.4} ({from})",
        report.uniformity_percent, report.containers, report.mean, report.least, report.most
    ))
}

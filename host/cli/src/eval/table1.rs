//! `nirspi eval table1`: how long each stage takes, on the machine at hand.

use super::shot::{Conditions, record, white_level};
use crate::Usage;
use crate::camera::Rain;
use crate::print;
use crate::report::to_json;
use anyhow::Result;
use indicatif::ProgressBar;
use nirspi::files::image::encode_rgb;
use nirspi::files::output::OutputDir;
use nirspi::picture::{Axis, Chart, Line};
use nirspi::scene::SceneSource;
use nirspi::setup::MeasurementSetup;
use nirspi::virtual_camera::VirtualOptics;
use nirspi_nets::{Device, Enhancer, Images, Networks, Options};
use nirspi_optics::{Projector, Scene};
use nirspi_recon::Order;
use nirspi_recon::reconstruct::{self, OmpSettings};
use serde::Serialize;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

/// Time of every stage of one picture beside the paper's Table 1
///
/// Acquisition is computed from the sequence: patterns, complements, dwell and sweeps. The others are timed on this
/// machine's CPU, one picture at a time, from a frame of the virtual camera to 64 x 64 pixels. Build with --release.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n\
    \x20 nirspi eval table1 --repeats 200 --out table1/")]
pub struct Args {
    /// Pictures to time
    #[arg(long, value_name = "N", default_value_t = 100,
          value_parser = clap::value_parser!(u32).range(2..=100_000))]
    repeats: u32,
    /// Share of the patterns, in zig-zag order
    #[arg(long, value_name = "0..1", default_value_t = 0.5, allow_negative_numbers = true)]
    sampling: f64,
    /// Seed of the picture
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Folder for table1.json and table1.png
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print the report as JSON
    #[arg(long)]
    json: bool,
}

/// Time that light is collected, as in the paper's row.
const ACQUISITION_NS: f64 = 20e6;

const DISTANCE_M: f64 = 0.3;

/// Pictures before the clock counts.
const WARM_UP: u32 = 3;

/// The paper's times on a Jetson Xavier NX, in ms: from, to.
const PAPER_MS: [(f64, f64); 5] =
    [(18.0, 24.0), (20.0, 25.0), (9.0, 9.0), (15.0, 15.0), (62.0, 76.0)];

#[derive(Debug, Serialize)]
struct Report {
    /// The acquisition is the sequence's, the picture the virtual camera's; the other times are this machine's.
    simulated_acquisition: bool,
    cores: usize,
    optimised: bool,
    patterns: usize,
    sampling: f64,
    sweeps: u32,
    repeats: u32,
    rows: Vec<Row>,
    reading: Vec<String>,
}

#[derive(Debug, Serialize)]
struct Row {
    symbol: &'static str,
    stage: &'static str,
    p50_ms: f64,
    p99_ms: f64,
    paper_ms: (f64, f64),
    #[serde(skip)]
    sorted_ms: Vec<f64>,
}

impl Row {
    fn new(k: usize, mut ms: Vec<f64>) -> Self {
        const STAGES: [(&str, &str); 5] = [
            ("T_pre", "light and its sampling, computed from the sequence"),
            ("T_OMP", "sums to a 32 x 32 image: leak undone, OMP with cross-validation"),
            ("T_DL", "FSRCNN to 64 x 64"),
            ("T_dm", "blur and noise estimated, bridge of one step, held against the readings"),
            ("T_2D", "all"),
        ];
        ms.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| ms[((ms.len() - 1) as f64 * share).ceil() as usize];
        Self {
            symbol: STAGES[k].0,
            stage: STAGES[k].1,
            p50_ms: at(0.5),
            p99_ms: at(0.99),
            paper_ms: PAPER_MS[k],
            sorted_ms: ms,
        }
    }
}

pub fn run(args: &Args) -> Result<ExitCode> {
    if !(args.sampling > 0.0 && args.sampling <= 1.0) {
        let text = format!("--sampling is {}, expected more than 0, at most 1", args.sampling);
        return Err(Usage(text).into());
    }
    let setup = MeasurementSetup::new(&Order::ZigZag, args.sampling)?;
    let sweeps = (ACQUISITION_NS / setup.frame_ns()).round().max(1.0) as u32;
    let acquisition_ms = setup.frame_ns() * f64::from(sweeps) * 1e-6;
    let patterns = setup.rows.len();
    let letter = SceneSource::Letter('R').load(256)?;
    let side_mm = letter.side_mm.unwrap_or_else(|| Projector::default().field_mm(DISTANCE_M * 1e3));
    let scene = Scene::new(letter.reflectance, letter.size_px, side_mm)?;
    let optics = VirtualOptics::new(scene, DISTANCE_M * 1e3)?;
    let captured = record(&optics, setup, sweeps, args.seed)?;
    let conditions = Conditions { distance_m: DISTANCE_M, rain: Rain::None, frames: sweeps };
    let white = white_level(conditions, args.seed)?;
    let chain = Enhancer::built_in(&Device::cpu())?;
    let fusion_alone = Networks::built_in(Device::cpu()).fusion()?;

    let bar = ProgressBar::new(u64::from(args.repeats));
    let mut times: [Vec<f64>; 5] = Default::default();
    for repeat in 0..WARM_UP + args.repeats {
        let start = Instant::now();
        let measurements =
            captured.integrated.measurements(&captured.setup, captured.settling.as_ref(), false)?;
        let image = reconstruct::omp(&measurements, &OmpSettings::default())?.image;
        let omp = start.elapsed();
        let readings: Vec<f32> =
            image.pixels().iter().map(|counts| (counts / white).clamp(0.0, 1.0)).collect();
        let enhanced =
            chain.enhance(Images::new(&readings)?, None, &Options::default(), &mut |_| {})?;
        let all = start.elapsed();
        // The chain does both in one; each again by itself.
        let start = Instant::now();
        let upscaled = fusion_alone.upscale(Images::new(&readings)?, None);
        let fusion = start.elapsed();
        drop((enhanced, upscaled));
        if repeat >= WARM_UP {
            let ms = |time: std::time::Duration| time.as_secs_f64() * 1e3;
            let all = ms(all);
            let [omp, fusion] = [omp, fusion].map(ms);
            let row = [acquisition_ms, omp, fusion, all - omp - fusion, acquisition_ms + all];
            times.iter_mut().zip(row).for_each(|(times, ms)| times.push(ms));
            bar.inc(1);
        }
    }
    bar.finish_and_clear();

    let report = Report {
        simulated_acquisition: true,
        cores: std::thread::available_parallelism().map_or(1, usize::from),
        optimised: !cfg!(debug_assertions),
        patterns,
        sampling: args.sampling,
        sweeps,
        repeats: args.repeats,
        rows: times.into_iter().enumerate().map(|(k, ms)| Row::new(k, ms)).collect(),
        reading: vec![
            "the paper's are of a Jetson Xavier NX's GPU, ours of this machine's CPU".to_owned(),
            "T_dm is what the chain takes beyond OMP and FSRCNN".to_owned(),
            "stages run one after another here; with frames in a row each can work on its own"
                .to_owned(),
        ],
    };
    if let Some(path) = &args.out {
        let mut out = OutputDir::create(path)?;
        let json = to_json(&report)?;
        out.write("table1.json", json.as_bytes())?;
        out.write("table1.png", &encode_rgb(&chart(&report).render()))?;
        out.commit()?;
    }
    if args.json {
        print::json(&report)?;
    } else {
        say(&report)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// Times in rising order, and the paper's as dashed lines.
fn chart(report: &Report) -> Chart {
    let mut lines = Vec::new();
    for (colour, row) in report.rows.iter().enumerate() {
        let last = (row.sorted_ms.len() - 1).max(1) as f64;
        let share = |k: usize| 100.0 * k as f64 / last;
        let points = row.sorted_ms.iter().enumerate().map(|(k, &ms)| (share(k), ms)).collect();
        lines.push(Line { name: row.symbol.to_owned(), colour, dashed: false, points });
        let (from, to) = row.paper_ms;
        let middle = (from + to) / 2.0;
        lines.push(Line {
            name: format!("{}, paper", row.symbol),
            colour,
            dashed: true,
            points: vec![(0.0, middle), (100.0, middle)],
        });
    }
    let values = || lines.iter().flat_map(|line| line.points.iter().map(|point| point.1));
    let low = values().fold(1.0, f64::min);
    let high = values().fold(100.0, f64::max);
    let ends = [10_f64.powf(low.log10().floor()), 10_f64.powf(high.log10().ceil())];
    let decades = (ends[1] / ends[0]).log10().round() as i32;
    Chart {
        header: format!("Time of each stage of one picture, {} CPU cores", report.cores),
        x: Axis {
            name: "share of the pictures that took no longer, %".to_owned(),
            from: 0.0,
            to: 100.0,
            logarithmic: false,
            ticks: vec![0.0, 25.0, 50.0, 75.0, 99.0],
        },
        y: Axis {
            name: "ms".to_owned(),
            from: ends[0],
            to: ends[1],
            logarithmic: true,
            ticks: (0..=decades).map(|k| ends[0] * 10_f64.powi(k)).collect(),
        },
        lines,
        footer: format!(
            "{} pictures; acquisition computed: {} patterns and complements, {} sweeps",
            report.repeats, report.patterns, report.sweeps
        ),
    }
}

fn say(report: &Report) -> Result<()> {
    print::line(format_args!(
        "Table 1, {} pictures, {} CPU cores{}",
        report.repeats,
        report.cores,
        if report.optimised { "" } else { ", NOT OPTIMISED: build with --release" }
    ))?;
    print::line("         p50 ms    p99 ms    paper ms")?;
    for row in &report.rows {
        let (from, to) = row.paper_ms;
        let paper = if from == to { format!("{from}") } else { format!("{from} to {to}") };
        let (p50, p99) = (row.p50_ms, row.p99_ms);
        print::line(format_args!(
            "{:<6} {p50:8.2}  {p99:8.2}    {paper:<9} {}",
            row.symbol, row.stage
        ))?;
    }
    for line in &report.reading {
        print::line(format_args!("reading: {line}"))?;
    }
    Ok(())
}

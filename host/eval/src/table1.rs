//! Times each stage of one picture on this machine, compared with the paper's Table 1.
//!
//! The acquisition is an input: the number of sweeps of the sequence (patterns, complements, dwell)
//! that fills 20 ms, the middle of the paper's 18 to 24. The other stages are timed on the CPU, one
//! picture at a time, from a frame of the virtual camera to 64 x 64 pixels.

use crate::error::{EvalError, Result};
use crate::shot::{CalibratedCamera, Conditions};
use nirspi::exposure::{Exposure, Length, Light};
use nirspi::picture::{Axis, Chart, Line};
use nirspi::scene::SceneSource;
use nirspi::setup::MeasurementSetup;
use nirspi_nets::{Device, Enhancer, Images, Networks, Options};
use nirspi_optics::rain::Air;
use nirspi_optics::{Projector, Scene};
use nirspi_recon::Order;
use nirspi_recon::reconstruct::{self, OmpSettings};
use nirspi_virtual::VirtualOptics;
use serde::Serialize;
use std::time::Instant;

/// What to time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Number of pictures, at least one.
    pub repeats: u32,
    /// Share of the patterns, in zig-zag order.
    pub sampling: f64,
    /// Seed of the picture.
    pub seed: u64,
}

/// Time of collecting light: chosen like the paper's, not measured.
const ACQUISITION_NS: f64 = 20e6;

const DISTANCE_M: f64 = 0.3;

/// Number of pictures before timing starts.
const WARM_UP: u32 = 3;

/// The paper's times on a Jetson Xavier NX, in ms: from, to.
const PAPER_MS: [(f64, f64); 6] =
    [(18.0, 24.0), (20.0, 25.0), (9.0, 9.0), (45.0, 58.0), (15.0, 15.0), (62.0, 76.0)];

/// The time of each stage.
#[derive(Debug, Clone, Serialize)]
pub struct Report {
    /// Always true: the acquisition is chosen and the picture is simulated. The other times are
    /// this machine's.
    pub simulated_acquisition: bool,
    /// Number of CPU cores of this machine.
    pub cores: usize,
    /// Whether the program was built with optimisation.
    pub optimised: bool,
    /// Number of patterns shown, each with its complement.
    pub patterns: usize,
    /// Their share of all patterns.
    pub sampling: f64,
    /// Number of sweeps summed into a picture.
    pub sweeps: u32,
    /// Number of timed pictures.
    pub repeats: u32,
    /// Times stage by stage.
    pub rows: Vec<Row>,
    /// How to interpret the numbers.
    pub reading: Vec<String>,
}

/// The time of one stage.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// The paper's symbol.
    pub symbol: &'static str,
    /// The stage in this program.
    pub stage: &'static str,
    /// Median time.
    pub p50_ms: f64,
    /// The time that 99 % of the pictures did not exceed.
    pub p99_ms: f64,
    /// The paper's time: from, to.
    pub paper_ms: (f64, f64),
    /// Every picture's time, in ascending order.
    #[serde(skip)]
    pub sorted_ms: Vec<f64>,
}

impl Row {
    fn new(k: usize, mut ms: Vec<f64>) -> Self {
        const STAGES: [(&str, &str); 6] = [
            ("T_pre", "input: sweeps of the sequence that fill 20 ms, as the paper's"),
            ("T_OMP", "sums to a 32 x 32 image: leak undone, OMP with cross-validation"),
            ("T_DL", "FSRCNN to 64 x 64"),
            ("T_2D", "all without diffusion (the paper's first row)"),
            ("T_dm", "blur and noise estimated, bridge of one step, held against the readings"),
            ("T_2D", "all with diffusion (the paper's second row)"),
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

/// Times every stage; `done` is called after each picture.
///
/// # Errors
/// [`EvalError::Setting`] for a share of patterns out of range, or another error for a capture that
/// fails.
pub fn table1(settings: &Settings, done: &dyn Fn()) -> Result<Report> {
    let Settings { repeats, sampling, seed } = *settings;
    if !(sampling > 0.0 && sampling <= 1.0) {
        return Err(EvalError::setting("sampling", sampling, "more than 0, at most 1"));
    }
    let setup = MeasurementSetup::new(&Order::ZigZag, sampling)?;
    // Frames that are long enough for the port, so that none is lost.
    let light = Light::from_ms(ACQUISITION_NS * 1e-6);
    let exposure = light.and_then(|light| Exposure::of(Length::Light(light, None), &setup));
    let exposure = exposure.map_err(|error| EvalError::Content(error.to_string()))?;
    let acquisition_ms = exposure.light_ms(&setup);
    let setup = MeasurementSetup { sweeps: exposure.sweeps, ..setup };
    let sweeps = exposure.frames * exposure.sweeps;
    let patterns = setup.rows.len();
    let letter = SceneSource::Letter('R').load(256)?;
    let side_mm = letter.side_mm.unwrap_or_else(|| Projector::default().field_mm(DISTANCE_M * 1e3));
    let scene = Scene::new(letter.reflectance, letter.size_px, side_mm)?;
    let optics = VirtualOptics::new(scene, DISTANCE_M * 1e3)?;
    let camera = CalibratedCamera::new(optics.camera_model(), seed)?;
    let captured = camera.record(&optics, setup, exposure.frames, seed)?;
    let air = &Air::dry();
    let conditions = Conditions { distance_m: DISTANCE_M, air, frames: sweeps };
    let white = camera.white_level(conditions, seed)?;
    let chain = Enhancer::built_in(&Device::cpu())?;
    let fusion_alone = Networks::built_in(Device::cpu()).fusion()?;

    let mut times: [Vec<f64>; 6] = Default::default();
    for repeat in 0..WARM_UP + repeats {
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
        // The chain does both stages in one call, so each is timed again separately.
        let start = Instant::now();
        let upscaled = fusion_alone.upscale(Images::new(&readings)?, None);
        let fusion = start.elapsed();
        drop((enhanced, upscaled));
        if repeat >= WARM_UP {
            let ms = |time: std::time::Duration| time.as_secs_f64() * 1e3;
            let all = ms(all);
            let [omp, fusion] = [omp, fusion].map(ms);
            let plain = acquisition_ms + omp + fusion;
            let row =
                [acquisition_ms, omp, fusion, plain, all - omp - fusion, acquisition_ms + all];
            times.iter_mut().zip(row).for_each(|(times, ms)| times.push(ms));
            done();
        }
    }
    Ok(Report {
        simulated_acquisition: true,
        cores: std::thread::available_parallelism().map_or(1, usize::from),
        optimised: !cfg!(debug_assertions),
        patterns,
        sampling,
        sweeps,
        repeats,
        rows: times.into_iter().enumerate().map(|(k, ms)| Row::new(k, ms)).collect(),
        reading: vec![
            "the paper's are of a Jetson Xavier NX's GPU, ours of this machine's CPU".to_owned(),
            "T_pre is chosen, not measured: both T_2D hold 20 ms of it".to_owned(),
            "the paper's sums do not come out: 18 + 20 + 9 = 47, its T_2D begins at 45; 24 + 25 + 9 + 15 = 73, it ends at 76".to_owned(),
            "T_dm is what the chain takes beyond OMP and FSRCNN".to_owned(),
            "stages run one after another here; with frames in a row each can work on its own"
                .to_owned(),
        ],
    })
}

/// Times in ascending order, with the paper's times as dashed lines.
#[must_use]
pub fn chart(report: &Report) -> Chart {
    // The symbol T_2D occurs twice.
    let name = |k: usize, row: &Row| match (row.symbol, k) {
        ("T_2D", 3) => "T_2D, no diffusion".to_owned(),
        _ => row.symbol.to_owned(),
    };
    let mut lines = Vec::new();
    for (colour, row) in report.rows.iter().enumerate() {
        let last = (row.sorted_ms.len() - 1).max(1) as f64;
        let share = |k: usize| 100.0 * k as f64 / last;
        let points = row.sorted_ms.iter().enumerate().map(|(k, &ms)| (share(k), ms)).collect();
        lines.push(Line { name: name(colour, row), colour, dashed: false, points });
        let (from, to) = row.paper_ms;
        let middle = (from + to) / 2.0;
        lines.push(Line {
            name: format!("{}, paper", name(colour, row)),
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
            "{} pictures; acquisition is an input: {} patterns and complements, {} sweeps",
            report.repeats, report.patterns, report.sweeps
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_times_that_were_measured() {
        let row = Row::new(5, (0..200).rev().map(f64::from).collect());
        assert_eq!((row.p50_ms, row.p99_ms, row.symbol), (100.0, 198.0, "T_2D"));
        assert_eq!(Row::new(0, vec![7.0]).p99_ms, 7.0);
    }

    #[test]
    fn every_stage_is_timed_and_the_whole_takes_the_sum_of_its_parts() {
        let settings = Settings { repeats: 2, sampling: 0.05, seed: 1 };
        let done = std::cell::Cell::new(0);
        let report = table1(&settings, &|| done.set(done.get() + 1)).unwrap();
        assert_eq!((done.get(), report.rows.len(), report.patterns), (2, 6, 51));
        let [pre, omp, fusion, plain, diffusion, all] = &report.rows[..] else {
            panic!("{report:?}")
        };
        assert!((pre.p50_ms - 20.0).abs() < 0.1, "sweeps of 4.1 us fill 20 ms: {pre:?}");
        let sum = |row: &Row| row.sorted_ms.iter().sum::<f64>();
        let without = sum(pre) + sum(omp) + sum(fusion);
        assert!((sum(plain) - without).abs() < 1e-6, "{report:?}");
        assert!((sum(all) - without - sum(diffusion)).abs() < 1e-6, "{report:?}");
        // A line for each stage and a line for the paper's time.
        assert_eq!(chart(&report).lines.len(), 12);
        let all_of_nothing = table1(&Settings { sampling: 0.0, ..settings }, &|| {}).unwrap_err();
        assert_eq!(all_of_nothing.to_string(), "sampling is 0, expected more than 0, at most 1");
    }
}

//! The calibration of intervals and readings, and the coverage curve of `docs/log/quality.md`.
//!
//! `cargo run --release -p nirspi-eval --example trust -- calibrate DATA FILE [WEIGHTS]` makes the
//! calibration: FILE is `host/nets/weights/intervals.json` for the shipped weights. WEIGHTS is a
//! folder of other weights, `<network>.safetensors`.
//!
//! `cargo run --release -p nirspi-eval --example trust -- judge DATA FILE OUT [WEIGHTS]` judges a
//! calibration on images that neither training nor calibration has used. OUT gets `coverage.png`,
//! `intervals.png` and `trust.json`.
//!
//! DATA has `chars74k/*_train.npz` and `natural/bsds_train.npz`.

mod natural;

use natural::Scenes;
use nirspi::files::image::{Filter, resample};
use nirspi::picture::FigureStyle;
use nirspi::provenance::{Made, Origin, Provenance, Taken};
use nirspi_eval::characters;
use nirspi_eval::trust::{NATURAL, Report, Settings, calibrate, judge};
use nirspi_nets::Intervals;
use nirspi_nets::data::{Kind, Stack};
use std::cell::Cell;
use std::error::Error;
use std::ffi::OsString;
use std::path::PathBuf;
use std::time::Instant;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

const EXPECTED: &str = "expected calibrate DATA FILE [WEIGHTS] or judge DATA FILE OUT [WEIGHTS]";
const SEED: u64 = 1;
/// The most images of each stack of characters, for calibrating and for judging.
const COUNTS: [usize; 2] = [55, 30];
/// Side of a part of a scene.
const SIDE: usize = 64;

/// The provenance of the pictures: scenes are simulated.
fn provenance() -> Provenance {
    let made = Made::now("trust", None, std::env::args());
    Taken::without_camera(Origin::Simulated).made(&made)
}

fn main() -> Result<()> {
    let arguments: Vec<OsString> = std::env::args_os().skip(1).collect();
    let at = |k: usize| arguments.get(k).map(PathBuf::from);
    let (Some(what), Some(data), Some(file)) = (arguments.first(), at(1), at(2)) else {
        return Err(EXPECTED.into());
    };
    let mut stacks = characters::read(&data.join("chars74k"))?;
    stacks.push(natural(&Scenes::read(&data)?)?);
    let mut settings = Settings { stacks, weights: None, count: COUNTS[0], seed: SEED };
    let (started, done) = (Instant::now(), Cell::new(0));
    let progress = |images: usize| {
        done.set(done.get() + images);
        eprint!("\r{} images", done.get());
    };
    match what.to_string_lossy().as_ref() {
        "calibrate" => {
            settings.weights = at(3);
            let made_by =
                "cargo run --release -p nirspi-eval --example trust -- calibrate DATA FILE";
            let calibration = calibrate(&settings, made_by, &progress)?;
            std::fs::write(&file, serde_json::to_string(&calibration)? + "\n")?;
        }
        "judge" => {
            let out = at(3).ok_or(EXPECTED)?;
            (settings.weights, settings.count) = (at(4), COUNTS[1]);
            let intervals = Intervals::parse(&std::fs::read_to_string(&file)?)?;
            let judged = judge(&settings, &intervals, &progress)?;
            std::fs::create_dir_all(&out)?;
            for (name, figure) in &judged.pictures {
                let picture = figure.png(&FigureStyle::Paper.look(), &provenance());
                std::fs::write(out.join(format!("{name}.png")), picture)?;
            }
            std::fs::write(out.join("trust.json"), serde_json::to_string_pretty(&judged.report)?)?;
            say(&judged.report);
        }
        _ => return Err(EXPECTED.into()),
    }
    let per_image = 1e3 * started.elapsed().as_secs_f64() / done.get().max(1) as f64;
    eprintln!("\r{} images, {per_image:.1} ms each", done.get());
    Ok(())
}

/// Six parts of each scene, which is a group of its own: three of 64 x 64 pixels at full size, two of
/// 96 x 96 and one of 160 x 160 made smaller.
fn natural(scenes: &Scenes) -> Result<Stack> {
    let (mut levels, mut groups) = (Vec::new(), Vec::new());
    let (height, width) = (scenes.height, scenes.width);
    let parts = [
        (8, 8, 64),
        ((height - 64) / 2, (width - 64) / 2, 64),
        (height - 72, width - 72, 64),
        (4, width - 100, 96),
        (height - 100, 4, 96),
        (0, (width - 160) / 2, 160.min(height)),
    ];
    for (group, scene) in scenes.iter().enumerate() {
        for (top, left, side) in parts {
            let rows = scene.chunks_exact(width).skip(top).take(side);
            let part = rows.flat_map(|row| &row[left..left + side]).map(|level| f32::from(*level));
            let part: Vec<f32> = part.collect();
            let [side, small] = [side as u32, SIDE as u32];
            let small = resample(&part, (side, side), (small, small), Filter::Triangle);
            levels.extend(small.into_iter().map(|level| level.round() as u8));
            groups.push(group as u32);
        }
    }
    Ok(Stack::new(NATURAL, Kind::Photograph, levels, None, groups)?)
}

fn say(report: &Report) {
    println!(
        "method, images, condition: within 95 % (edges), half-width, least, rms error, images below 85 %"
    );
    for c in &report.coverage {
        println!(
            "{:<8} {:<10} {:<28} {:.1} ({:.1} to {:.1}) %  edges {:.1} %  {:.4}  {:.4}  {:.4}  {:.1} %  ({} images)",
            c.method,
            c.images_of,
            c.condition,
            100.0 * c.at_95.value,
            100.0 * c.at_95.low,
            100.0 * c.at_95.high,
            100.0 * c.edges_at_95,
            c.half_width,
            c.least_half_width,
            c.rms_error,
            100.0 * c.images_below_85,
            c.images
        );
    }
    println!(
        "kind: right, legible (before), sure (before), wrong and sure, no character, right if legible"
    );
    for l in &report.letters {
        let share =
            |share: Option<f64>| share.map_or("-".to_owned(), |s| format!("{:.1} %", 100.0 * s));
        println!(
            "{:<10} {}  {:.1} ({:.1}) %  {:.1} ({:.1}) %  {:.2} %  {:.1} %  {}  ({} images)",
            l.kind,
            share(l.right),
            100.0 * l.legible,
            100.0 * l.legible_before,
            100.0 * l.sure,
            100.0 * l.sure_before,
            100.0 * l.wrong_and_sure,
            100.0 * l.no_character,
            share(l.right_if_legible),
            l.images
        );
    }
}

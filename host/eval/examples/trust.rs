//! The calibration of intervals and readings, and the coverage curve of `docs/quality.md`.
//!
//! `cargo run --release -p nirspi-eval --example trust -- calibrate DATA FILE [WEIGHTS]` makes the
//! calibration: FILE is `host/nets/weights/intervals.json` for the shipped weights. WEIGHTS is a
//! folder of other weights, `<network>.safetensors`.
//!
//! `cargo run --release -p nirspi-eval --example trust -- judge DATA FILE OUT [WEIGHTS]` judges a
//! calibration on images that neither training nor calibration has used. OUT gets `coverage.png`,
//! `intervals.png` and `trust.json`.
//!
//! DATA has `chars74k/*_train.npz` and, for scenes that are no characters, `natural/bsds_train.npz`.

mod natural;

use natural::Scenes;
use nirspi::files::characters;
use nirspi::picture::signed_png;
use nirspi::provenance::{Made, Origin, Provenance, Taken};
use nirspi_eval::trust::{Report, Settings, calibrate, judge};
use nirspi_nets::Intervals;
use nirspi_nets::data::{Kind, Stack};
use std::cell::Cell;
use std::error::Error;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Instant;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

const EXPECTED: &str = "expected calibrate DATA FILE [WEIGHTS] or judge DATA FILE OUT [WEIGHTS]";
const SEED: u64 = 1;
/// The most images of each stack of a calibration.
const COUNT: usize = 200;

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
    let mut settings = Settings { stacks: stacks(&data)?, weights: None, count: COUNT, seed: SEED };
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
            (settings.weights, settings.count) = (at(4), usize::MAX);
            let intervals = Intervals::parse(&std::fs::read_to_string(&file)?)?;
            let judged = judge(&settings, &intervals, &progress)?;
            std::fs::create_dir_all(&out)?;
            for (name, picture) in &judged.pictures {
                std::fs::write(out.join(name), signed_png(picture, &provenance()))?;
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

fn stacks(data: &Path) -> Result<Vec<Stack>> {
    let mut stacks = characters::read(&data.join("chars74k"))?;
    if Scenes::file(data).is_file() {
        stacks.push(natural(&Scenes::read(data)?)?);
    }
    Ok(stacks)
}

/// The middle 64 x 64 pixels of each scene, which is a group of its own.
fn natural(scenes: &Scenes) -> Result<Stack> {
    let (top, left) = ((scenes.height - 64) / 2, (scenes.width - 64) / 2);
    let middle = |scene: &[u8]| {
        let rows = scene.chunks_exact(scenes.width).skip(top).take(64);
        rows.flat_map(|row| row[left..left + 64].to_vec()).collect::<Vec<u8>>()
    };
    let levels = scenes.iter().flat_map(middle).collect();
    let groups = (0..scenes.iter().count() as u32).collect();
    Ok(Stack::new("natural", Kind::Photograph, levels, None, groups)?)
}

fn say(report: &Report) {
    println!("blur noise stack: within 95 %, half-width, prior's, rms error, images below 85 %");
    for c in &report.coverage {
        println!(
            "{:.1} {:.2} {:<10} {:.1} ({:.1} to {:.1}) %  {:.4}  {:.1} %  {:.4}  {:.1} %  ({} images)",
            c.condition.sigma_px,
            c.condition.noise,
            c.stack,
            100.0 * c.at_95.value,
            100.0 * c.at_95.low,
            100.0 * c.at_95.high,
            c.half_width,
            100.0 * c.prior_share,
            c.rms_error,
            100.0 * c.images_below_85,
            c.images
        );
    }
    println!("blur noise stack: right, sure, wrong and sure, not legible, right if legible");
    for l in &report.letters {
        let share =
            |share: Option<f64>| share.map_or("-".to_owned(), |s| format!("{:.1} %", 100.0 * s));
        println!(
            "{:.1} {:.2} {:<10} {}  {:.1} %  {:.2} %  {:.1} %  {}  ({} images)",
            l.condition.sigma_px,
            l.condition.noise,
            l.stack,
            share(l.right),
            100.0 * l.sure,
            100.0 * l.wrong_and_sure,
            100.0 * l.not_legible,
            share(l.right_if_legible),
            l.images
        );
    }
}

//! The recursive estimate of moving scenes beside frame-by-frame methods at equal light: the table
//! and the pictures of `docs/log/reconstruction.md`.
//!
//! `cargo run --release -p nirspi-eval --example video -- OUT [FRAMES [NOISE]]`
//!
//! OUT gets `video.json` (every way on every scene), `video_curves.png` (PSNR against the speed of
//! a letter), `video.png` (one frame of some scenes), and `image.apng` with its contact sheet
//! `image.png` (a moving letter: scene and best single frames above, recursive estimates below).

use nirspi::picture::{
    Axis, Chart, Figure, FigureStyle, Line, Panel, Pictures, Range, Sheet, SideBySide, Unit,
};
use nirspi::provenance::{Made, Origin, Provenance, Taken};
use nirspi_eval::video::{Compared, Motion, VideoRow, compare};
use nirspi_recon::{Image, Side};
use std::error::Error;
use std::path::{Path, PathBuf};

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Noise of a pixel in the image of all patterns in a frame's time, unless NOISE says another; white is 1.
const NOISE: f64 = 0.1;
const FRAMES: usize = 16;
const SEED: u64 = 1;
/// The scenes of the picture.
const SHOWN: [Motion; 4] =
    [Motion::Letter(0.25), Motion::Letter(2.0), Motion::Turning(10.0), Motion::Passing(1.0)];

/// The provenance of the pictures: scenes are simulated.
fn provenance() -> Provenance {
    let made = Made::now("video", None, std::env::args());
    Taken::without_camera(Origin::Simulated).made(&made)
}

fn main() -> Result<()> {
    let mut arguments = std::env::args_os().skip(1);
    let out = arguments.next().map(PathBuf::from).ok_or("OUT is missing, expected a folder")?;
    let frames = arguments.next().map_or(Ok(FRAMES), |count| count.to_string_lossy().parse())?;
    let noise = arguments.next().map_or(Ok(NOISE), |noise| noise.to_string_lossy().parse())?;
    std::fs::create_dir_all(&out)?;
    let mut all = Vec::new();
    let mut pictures = Vec::new();
    for motion in Motion::ALL {
        let made = compare(motion, noise, frames, SEED)?;
        print(&made.rows);
        if SHOWN.contains(&motion) {
            pictures.push(picture(&made, frames * 3 / 4));
        }
        if motion == Motion::Letter(0.25) {
            animate(&out, &made)?;
        }
        all.extend(made.rows);
    }
    std::fs::write(out.join("video.json"), serde_json::to_string_pretty(&all)?)?;
    let draw = |name: &str, figure: Figure| {
        std::fs::write(out.join(name), figure.png(&FigureStyle::Paper.look(), &provenance()))
    };
    draw("video.png", Figure::column(pictures))?;
    draw("video_curves.png", chart(&all, noise).into())?;
    Ok(())
}

fn print(rows: &[VideoRow]) {
    println!("{}, noise {}: PSNR dB / SSIM / worst frame", rows[0].motion, rows[0].noise);
    for row in rows {
        let (made, shown) = (&row.made, row.shown);
        println!(
            "  {made:<22} {:<10} {:6.2} / {:.3} / {:6.2}",
            format!("{shown:?}"),
            row.psnr_db,
            row.ssim,
            row.worst_db
        );
    }
}

/// The best way with or without a past.
fn best(rows: &[VideoRow], recursive: bool) -> usize {
    let of = (0..rows.len()).filter(|&at| rows[at].recursive == recursive);
    of.max_by(|&a, &b| rows[a].psnr_db.total_cmp(&rows[b].psnr_db)).unwrap_or(0)
}

/// One frame: the scene, the best way of each kind, and the patterns in turn.
fn picture(made: &Compared, frame: usize) -> SideBySide {
    let side = Side::INSTRUMENT.pixels();
    let panel = |title: String, values: &[f32], caption: String| Panel {
        title,
        width: side,
        height: side,
        values: values.to_vec(),
        range: Range::Unit,
        unit: Unit::Reflectance,
        caption: vec![caption],
        warnings: Vec::new(),
        field_mm: None,
    };
    let mut panels = vec![panel("scene".to_owned(), &made.truths[frame].pixels, String::new())];
    let turns = made.rows.len() - 1;
    let mut chosen = vec![best(&made.rows, false), best(&made.rows, true), turns];
    chosen.dedup();
    for at in chosen {
        let row = &made.rows[at];
        let title = format!("{}, {}", row.made, row.shown);
        let caption = format!("{:.2} dB on average", row.psnr_db);
        panels.push(panel(title, made.images[at][frame].pixels(), caption));
    }
    SideBySide {
        header: format!("{}, noise {}", made.rows[0].motion, made.rows[0].noise),
        panels,
        footer:
            "simulated: best way frame by frame, best recursive way, patterns in turn; equal light"
                .to_owned(),
    }
}

/// Four videos in one: scene, best frame by frame; best recursive, patterns in turn.
fn animate(out: &Path, made: &Compared) -> Result<()> {
    let n = Side::INSTRUMENT.pixels();
    let ways = [best(&made.rows, false), best(&made.rows, true), made.rows.len() - 1];
    let frame = |k: usize| {
        let scene = made.truths[k].pixels.as_slice();
        let of = |way: usize| made.images[ways[way]][k].pixels();
        let four = [scene, of(0), of(1), of(2)];
        let pixel = |at: usize| {
            let (r, c) = (at / (2 * n), at % (2 * n));
            four[2 * (r / n) + c / n][r % n * n + c % n].clamp(0.0, 1.0)
        };
        Image::new(Side::new(64).unwrap_or(Side::INSTRUMENT), (0..4 * n * n).map(pixel).collect())
    };
    let images: Vec<Image> = (0..made.truths.len()).map(frame).collect();
    let (motion, frames) = (&made.rows[0].motion, images.len());
    let header = format!("{motion}: scene, frame by frame; recursive, in turn, {frames} frames");
    let values = images.iter().map(Image::pixels).collect();
    let sheet = Sheet::new(header, (64, 64), values, Unit::Reflectance);
    let pictures = Pictures::of_stack(&sheet, None, FigureStyle::Paper, &provenance());
    let mut folder = nirspi::files::output::OutputDir::create(out)?;
    pictures.write(&mut folder)?;
    folder.commit()?;
    Ok(())
}

/// PSNR of the best way of each kind, and of the patterns in turn, against the speed of a letter.
fn chart(all: &[VideoRow], noise: f64) -> Chart {
    let speeds = [0.0, 0.1, 0.25, 0.5, 1.0, 2.0];
    let of = |speed: f64, chosen: &dyn Fn(&VideoRow) -> bool| {
        let motion = Motion::Letter(speed).to_string();
        let rows = all.iter().filter(|row| row.motion == motion);
        rows.filter(|row| chosen(row)).map(|row| row.psnr_db).fold(f64::MIN, f64::max)
    };
    let line = |name: &str, colour, dashed, chosen: &dyn Fn(&VideoRow) -> bool| Line {
        name: name.to_owned(),
        colour,
        dashed,
        points: speeds.map(|speed| (speed, of(speed, chosen))).to_vec(),
    };
    let named = |made: &'static str, shown: &'static str| {
        move |row: &VideoRow| row.made == made && format!("{:?}", row.shown) == shown
    };
    let lines = vec![
        line("best frame by frame", 0, false, &|row| !row.recursive),
        line("frame by frame, tikhonov, lowest 30 %", 2, true, &named("tikhonov", "Lowest(30)")),
        line("recursive, all patterns", 1, false, &named("recursive", "All")),
        line("recursive, lowest 30 %", 2, false, &named("recursive", "Lowest(30)")),
        line("recursive, 30 % in turn", 3, false, &named("recursive", "Turns")),
        line("the same, not moved", 3, true, &named("recursive, not moved", "Turns")),
        line("recursive, prior, lowest 30 %", 4, false, &named("recursive, prior", "Lowest(30)")),
    ];
    let values = lines.iter().flat_map(|line| line.points.iter().map(|point| point.1));
    Chart {
        header: format!("Moving letter, noise {noise}, equal light (simulated)"),
        x: Axis::around("speed in pixels a frame", speeds),
        y: Axis::around("PSNR in dB", values.collect::<Vec<f64>>()),
        lines,
        footer: "32 x 32 pixels, mean over the frames from the fifth on".to_owned(),
    }
}

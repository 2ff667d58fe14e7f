//! The learned prior beside the classical methods: the tables, curves and pictures of
//! `docs/log/reconstruction.md`.
//!
//! `cargo run --release -p nirspi-eval --example learned_prior -- DATA OUT TABLE...`
//!
//! DATA has `natural/bsds_train.npz`, `chars74k/*_train.npz` and `spi/*.npz`; OUT gets PNG files.
//! TABLE is `natural`, `large`, `orders`, `characters`, `real`, `speed` or `pictures`. Natural
//! scenes are every tenth of the file, characters are those of `held_out.json`: training has seen
//! neither. `scenes=N` before a table takes the first N scenes, and `only=WORD,WORD` some of the
//! methods: 128 x 128 pixels take minutes otherwise.

mod natural;

use natural::Scenes;
use nirspi::files::archive::Archive;
use nirspi::picture::{Axis, Chart, Figure, FigureStyle, Line, Panel, Range, SideBySide, Unit};
use nirspi::provenance::{Made, Origin, Provenance, Taken};
use nirspi_eval::completion::{Part, Row, Scene, compare, image, methods, quality};
use nirspi_recon::reconstruct::Reconstruct;
use nirspi_recon::{Measurements, Order, Rows, Side, metrics};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

type Result<T> = std::result::Result<T, Box<dyn Error>>;
type Methods = Vec<(&'static str, Box<dyn Reconstruct>)>;

const SHARES: [f64; 5] = [0.05, 0.1, 0.2, 0.3, 0.5];

/// The provenance of the pictures: scenes are simulated.
fn provenance() -> Provenance {
    let made = Made::now("learned_prior", None, std::env::args());
    Taken::without_camera(Origin::Simulated).made(&made)
}

fn main() -> Result<()> {
    let mut arguments = std::env::args_os().skip(1);
    let mut folder = |name: &str| {
        arguments.next().map(PathBuf::from).ok_or(format!("{name} is missing, expected a folder"))
    };
    let (data, out) = (folder("DATA")?, folder("OUT")?);
    std::fs::create_dir_all(&out)?;
    let mut methods = methods()?;
    let mut most = usize::MAX;
    for table in arguments {
        let table = table.to_string_lossy().into_owned();
        match table.as_ref() {
            only if only.starts_with("only=") => {
                let words: Vec<&str> = only["only=".len()..].split(',').collect();
                methods.retain(|(word, _)| words.contains(word));
            }
            scenes if scenes.starts_with("scenes=") => most = scenes["scenes=".len()..].parse()?,
            "natural" => natural_tables(&data, &out, &methods, most)?,
            "large" => {
                let scenes = natural(&data, 128, most)?;
                print_table(
                    "natural scenes, 128 x 128",
                    &scenes,
                    &parts(&[0.1, 0.2, 0.3], 0.0),
                    &methods,
                )?;
            }
            "orders" => orders(&data, &methods, most)?,
            "characters" => characters_tables(&data, &methods)?,
            "real" => real(&data, &methods)?,
            "speed" => speed(&data, &methods)?,
            "pictures" => pictures(&data, &out, &methods)?,
            other => {
                return Err(
                    format!("no table {other:?}: the program's first lines list them").into()
                );
            }
        }
    }
    Ok(())
}

fn parts(shares: &[f64], noise: f64) -> Vec<Part> {
    shares.iter().map(|&share| Part { order: Order::ZigZag, share, noise }).collect()
}

/// One array of an `.npz` file.
fn array(file: &Path, name: &str) -> Result<Vec<f32>> {
    Ok(Archive::open(file)?.numbers_of(name, |_| Ok(()))?.values)
}

/// The rows of a real recording.
fn rows(file: &Path, side: u64) -> Result<Rows> {
    Ok(Rows::new(Side::new(side)?, array(file, "h_row")?.into_iter().map(|row| row as i32))?)
}

/// The natural scenes that training has not seen.
fn natural(data: &Path, n: u64, most: usize) -> Result<Vec<Scene>> {
    let scenes = Scenes::read(data)?;
    let side = Side::new(n)?;
    let unseen = scenes.iter().enumerate().filter(|(k, _)| k % 10 == 4).take(most);
    let scene = |(k, levels): (usize, &[u8])| {
        Scene::centre_of(&format!("natural {k}"), levels, scenes.height, side)
    };
    Ok(unseen.map(scene).collect())
}

/// Characters of groups that training has not seen, `count` of each stack.
fn characters(data: &Path, stack: &str, group: Option<&str>, count: usize) -> Result<Vec<Scene>> {
    let file = data.join(format!("chars74k/{stack}_train.npz"));
    let levels: Vec<u8> = array(&file, "x")?.into_iter().map(|level| level as u8).collect();
    let groups: Vec<i64> = match group {
        Some(group) => array(&file, group)?.into_iter().map(|number| number as i64).collect(),
        None => (0..levels.len() as i64 / 4096).collect(),
    };
    let held_out: serde_json::Value = serde_json::from_str(nirspi_nets::HELD_OUT)?;
    let list = held_out[format!("{stack}_train")].as_array().cloned().unwrap_or_default();
    let unseen: Vec<(usize, &[u8])> = levels
        .chunks_exact(4096)
        .enumerate()
        .filter(|(k, _)| list.iter().any(|held| held.as_i64() == Some(groups[*k])))
        .collect();
    let every = (unseen.len() / count).max(1);
    let side = Side::new(64)?;
    let some = unseen.into_iter().step_by(every).take(count);
    Ok(some
        .map(|(k, levels)| Scene::centre_of(&format!("{stack} {k}"), levels, 64, side))
        .collect())
}

/// Prints mean PSNR and SSIM of every method, and what the prior gains on the best classical one.
fn print_table(
    title: &str,
    scenes: &[Scene],
    parts: &[Part],
    methods: &Methods,
) -> Result<Vec<Row>> {
    let rows = compare(scenes, parts, methods, || ())?;
    println!("\n{title}: {} scenes, PSNR in dB / SSIM", scenes.len());
    print!("| method |");
    parts.iter().for_each(|part| {
        print!(" {} %, {}, noise {} |", 100.0 * part.share, part.order, part.noise);
    });
    println!();
    for (at, (word, _)) in methods.iter().enumerate() {
        print!("| {word} |");
        for of_part in rows.chunks_exact(methods.len()) {
            print!(" {:.2} / {:.3} |", of_part[at].psnr_db, of_part[at].ssim);
        }
        println!();
    }
    print!("| gain |");
    for of_part in rows.chunks_exact(methods.len()) {
        let best = |of: fn(&Row) -> f64| {
            of_part.iter().filter(|row| row.is_classical()).map(of).fold(f64::MIN, f64::max)
        };
        let Some(prior) = of_part.iter().find(|row| !row.is_classical()) else { continue };
        let classical: Vec<&Row> = of_part.iter().filter(|row| row.is_classical()).collect();
        let beaten = |k: &usize| classical.iter().all(|row| row.each_db[*k] <= prior.each_db[*k]);
        print!(
            " {:+.2} / {:+.3}, best of all for {} of {} |",
            prior.psnr_db - best(|row| row.psnr_db),
            prior.ssim - best(|row| row.ssim),
            (0..scenes.len()).filter(beaten).count(),
            scenes.len()
        );
    }
    println!();
    Ok(rows)
}

fn natural_tables(data: &Path, out: &Path, methods: &Methods, most: usize) -> Result<()> {
    let scenes = natural(data, 64, most)?;
    let mut charts = Vec::new();
    for noise in [0.0, 0.02] {
        let title = format!("natural scenes, 64 x 64, noise {noise}");
        let rows = print_table(&title, &scenes, &parts(&SHARES, noise), methods)?;
        for (name, of) in
            [("PSNR, dB", (|row| row.psnr_db) as fn(&Row) -> f64), ("SSIM", |row| row.ssim)]
        {
            charts.push(chart(&title, name, of, &rows, methods, scenes.len()));
        }
    }
    draw(&out.join("prior_curves.png"), &Figure::grid(2, charts))
}

/// Writes a figure.
fn draw(path: &Path, figure: &Figure) -> Result<()> {
    std::fs::write(path, figure.png(&FigureStyle::Paper.look(), &provenance()))?;
    Ok(())
}

fn chart(
    title: &str,
    name: &str,
    of: fn(&Row) -> f64,
    rows: &[Row],
    methods: &Methods,
    count: usize,
) -> Chart {
    let lines = methods.iter().enumerate().map(|(colour, (word, _))| Line {
        name: (*word).to_owned(),
        colour,
        dashed: false,
        points: rows
            .iter()
            .filter(|row| row.method == *word)
            .map(|row| (row.share, of(row)))
            .collect(),
    });
    Chart {
        header: title.to_owned(),
        x: Axis::of("share of the patterns, zig-zag", vec![0.0, 0.1, 0.2, 0.3, 0.4, 0.5], false),
        y: Axis::around(name, rows.iter().map(of)),
        lines: lines.collect(),
        footer: format!("simulated readings of {count} photographs that training has not seen"),
    }
}

fn orders(data: &Path, methods: &Methods, most: usize) -> Result<()> {
    let scenes = natural(data, 64, most)?;
    let orders = [Order::CakeCutting, Order::RussianDolls, Order::Sequency, Order::Random(1)];
    let part = |order| Part { order, share: 0.2, noise: 0.01 };
    let parts: Vec<Part> = orders.into_iter().map(part).collect();
    print_table("other orders, natural scenes, 64 x 64", &scenes, &parts, methods).map(drop)
}

fn characters_tables(data: &Path, methods: &Methods) -> Result<()> {
    for (stack, group) in [("fnt", Some("family")), ("hnd", Some("writer")), ("img", None)] {
        let scenes = characters(data, stack, group, 20)?;
        let title = format!("characters, {stack}, 64 x 64");
        print_table(&title, &scenes, &parts(&[0.1, 0.2, 0.3], 0.02), methods)?;
    }
    Ok(())
}

/// The wing, and detectors of the car: name and measurements.
fn instruments(data: &Path) -> Result<Vec<(String, Vec<Measurements>)>> {
    let wing = data.join("spi/opar_ala1.npz");
    let shown = rows(&wing, 64)?;
    let y: Vec<f64> = array(&wing, "y")?.into_iter().map(f64::from).collect();
    let wing = Measurements::from_pairs(&shown, &y)?.measurements;
    let car = data.join("spi/scheidt_car.npz");
    let shown = rows(&car, 32)?;
    let d: Vec<f64> = array(&car, "d")?.into_iter().map(f64::from).collect();
    let cars = d.chunks_exact(1024).map(|d| Measurements::from_differential(&shown, d));
    let cars: Vec<Measurements> = cars.collect::<std::result::Result<_, _>>()?;
    Ok(vec![
        ("wing".to_owned(), vec![wing]),
        ("car, detector 0".to_owned(), cars[..1].to_vec()),
        ("car, mean of the detectors".to_owned(), cars),
    ])
}

/// Correlation with the image of all patterns, PSNR as `eval sampling` has it, and the least gain of a
/// measurement on zero filling.
fn real(data: &Path, methods: &Methods) -> Result<()> {
    let zero_filling = &methods[0].1;
    for (name, all) in instruments(data)? {
        println!(
            "\n{name}: correlation with the image of all patterns, dB, least gain on {} in dB; 10, 20, 30, 50 %",
            methods[0].0
        );
        for (word, method) in methods {
            print!("| {word} |");
            for share in [0.1, 0.2, 0.3, 0.5] {
                let (mut sum, mut sum_db, mut least_db) = (0.0, 0.0, f64::MAX);
                for measured in &all {
                    let n = measured.side().pixels();
                    let full = zero_filling.reconstruct(measured)?.image;
                    let part = measured.take(Some(&Order::ZigZag), share)?;
                    let full = full.pixels();
                    let high = full.iter().copied().fold(f32::MIN, f32::max);
                    let low = full.iter().copied().fold(f32::MAX, f32::min);
                    let psnr_db =
                        |found: &[f32]| metrics::psnr(full, found, n, n, f64::from(high - low));
                    let found = method.reconstruct(&part)?.image;
                    let filled = zero_filling.reconstruct(&part)?.image;
                    let found_db = psnr_db(found.pixels())?;
                    sum += metrics::correlation(full, found.pixels(), n, n)?;
                    sum_db += found_db;
                    least_db = least_db.min(found_db - psnr_db(filled.pixels())?);
                }
                let count = all.len() as f64;
                print!(" {:.4}, {:.2}, {least_db:+.2} |", sum / count, sum_db / count);
            }
            println!();
        }
    }
    Ok(())
}

/// Median time of one image.
fn speed(data: &Path, methods: &Methods) -> Result<()> {
    println!(
        "\nmilliseconds an image from 30 %, median of 15, {} threads",
        rayon::current_num_threads()
    );
    for n in [32, 64, 128] {
        let scene = natural(data, n, 1)?.swap_remove(0);
        let part = scene.measured(0.01, 0)?.take(Some(&Order::ZigZag), 0.3)?;
        print!("| {n} x {n} |");
        for (word, method) in methods {
            let mut times: Vec<f64> = Vec::new();
            for _ in 0..15 {
                let start = Instant::now();
                method.reconstruct(&part)?;
                times.push(1e3 * start.elapsed().as_secs_f64());
            }
            times.sort_by(f64::total_cmp);
            print!(" {word} {:.1} |", times[times.len() / 2]);
        }
        println!();
    }
    Ok(())
}

/// Scenes with their images: the largest, the middle and the least gain of the natural scenes, and
/// a wing.
fn pictures(data: &Path, out: &Path, methods: &Methods) -> Result<()> {
    let part = Part { order: Order::ZigZag, share: 0.1, noise: 0.0 };
    let scenes = natural(data, 64, usize::MAX)?;
    let rows = compare(&scenes, std::slice::from_ref(&part), methods, || ())?;
    let gain = |k: usize| {
        let best = rows.iter().filter(|row| row.is_classical()).map(|row| row.each_db[k]);
        let prior = rows.iter().filter(|row| !row.is_classical()).map(|row| row.each_db[k]);
        prior.fold(f64::MIN, f64::max) - best.fold(f64::MIN, f64::max)
    };
    let mut by_gain: Vec<usize> = (0..scenes.len()).collect();
    by_gain.sort_by(|&a, &b| gain(b).total_cmp(&gain(a)));
    let last = by_gain.len() - 1;
    let mut shown = Vec::new();
    for (what, k) in
        [("largest gain", by_gain[0]), ("middle", by_gain[last / 2]), ("least", by_gain[last])]
    {
        let scene = &scenes[k];
        let panel = |title: &str, pixels: &[f32], caption: String| Panel {
            range: Range::Unit,
            caption: vec![caption],
            ..Panel::square(title, 64, pixels, Unit::Reflectance)
        };
        let mut panels = vec![panel("scene", &scene.pixels, String::new())];
        for (word, method) in methods.iter().filter(|(word, _)| !matches!(*word, "omp" | "fista")) {
            let found = image(scene, &part, &**method, k as u64)?;
            let (psnr_db, ssim) = quality(scene, &found)?;
            panels.push(panel(word, found.pixels(), format!("{psnr_db:.2} dB, SSIM {ssim:.3}")));
        }
        let header = format!("{what}: {:+.2} dB on the best classical method", gain(k));
        let footer = "10 % of the patterns, zig-zag; simulated readings of a photograph".to_owned();
        shown.push(SideBySide { header, panels, footer });
    }
    draw(&out.join("prior_pictures.png"), &Figure::column(shown))
}

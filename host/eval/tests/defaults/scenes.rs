//! The scenes of the table, how each is measured, and what judges it.

use super::natural::Scenes;
use nirspi::files::npy;
use nirspi::scene::SceneSource;
use nirspi::source::{Index, Source, SourceOptions};
use nirspi_eval::completion::Scene;
use nirspi_recon::reconstruct::{Method, MethodSettings};
use nirspi_recon::{Image, Measurements, Rows, Side, fwht, metrics};
use nirspi_virtual::example::Example;
use std::fmt;
use std::io::Write as _;
use std::path::{Path, PathBuf};

const SIDE: usize = 32;
/// Edge of the drawings, of which a pixel of the image is the mean of 8 x 8.
const DRAWN_PX: usize = 256;

/// What a figure is.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// Peak signal to noise, in dB.
    Psnr,
    Correlation,
}

impl Unit {
    /// The most that another method may be better than the default.
    pub fn most_lost(self) -> f64 {
        match self {
            Self::Psnr => 1.0,
            Self::Correlation => 0.01,
        }
    }

    /// The difference that other processors' rounding, and the two digits of the table, may make.
    pub fn rounding(self) -> f64 {
        match self {
            Self::Psnr => 0.2,
            Self::Correlation => 0.002,
        }
    }

    pub fn written(self, figure: f64) -> String {
        match self {
            Self::Psnr => format!("{figure:.1}"),
            Self::Correlation => format!("{figure:.3}"),
        }
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Psnr => "PSNR",
            Self::Correlation => "correlation",
        })
    }
}

/// Scenes whose figures have one mean.
pub struct Kind {
    pub name: String,
    pub unit: Unit,
    pub scenes: Vec<Measured>,
}

impl Kind {
    fn new(name: &str, unit: Unit, scenes: Vec<Measured>) -> Self {
        Self { name: name.to_owned(), unit, scenes }
    }

    /// Whether this share leaves something to judge by.
    pub fn judges(&self, share: f64) -> bool {
        share < 1.0 || !matches!(self.scenes[0].judge, Judge::LeftOut(_))
    }
}

/// All patterns of one scene.
pub struct Measured {
    pub measured: Measurements,
    pub judge: Judge,
}

/// What an image is compared with.
pub enum Judge {
    /// The scene's pixels, 1 is white.
    Truth(Vec<f32>),
    /// The image of all patterns of another exposure.
    OtherExposure(Image),
    /// All readings, of which those count that the methods were not given.
    LeftOut(Measurements),
}

impl Judge {
    /// The figure of an image from `given`.
    pub fn figure(&self, image: &Image, given: &Measurements) -> f64 {
        let n = image.side().pixels();
        match self {
            Self::Truth(truth) => metrics::psnr(truth, image.pixels(), n, n, 1.0).unwrap(),
            Self::OtherExposure(other) => {
                metrics::correlation(other.pixels(), image.pixels(), n, n).unwrap()
            }
            Self::LeftOut(all) => left_out_psnr(all, image, given),
        }
    }
}

/// PSNR in dB that the image would have if the given rows had no error.
fn left_out_psnr(all: &Measurements, image: &Image, given: &Measurements) -> f64 {
    let area = image.side().area() as f64;
    let mut predicted: Vec<f64> = image.pixels().iter().map(|&v| v.into()).collect();
    fwht(&mut predicted).unwrap();
    let readings = all.rows().iter().zip(all.values());
    let missed = readings.filter(|(row, _)| !given.rows().contains(row));
    let squares: f64 = missed.map(|(&row, value)| (value - predicted[row as usize]).powi(2)).sum();
    let full = full_image(all);
    let least = full.pixels().iter().copied().fold(f32::MAX, f32::min);
    let most = full.pixels().iter().copied().fold(f32::MIN, f32::max);
    // Parseval: the squares of all rows are `area` times those of the pixels.
    20.0 * (f64::from(most - least) * area).log10() - 10.0 * squares.log10()
}

fn full_image(all: &Measurements) -> Image {
    let transform = Method::HADAMARD.prepare(&MethodSettings::default()).unwrap();
    transform.reconstruct(all).unwrap().image
}

/// The kinds of the table; those that need data of others are left out, with a line, where this machine has none.
pub fn of_the_table() -> Vec<Kind> {
    let mut kinds = vec![
        sources("letters", &["letter:R", "letter:a", "letter:8"]),
        sources("words", &["word:STOP", "word:IR", "word:Nacht"]),
        Kind::new("leaf", Unit::Psnr, vec![drawing(leaf, SIDE)]),
        Kind::new("leaf, 64 x 64", Unit::Psnr, vec![drawing(leaf, 64)]),
        Kind::new("star", Unit::Psnr, vec![drawing(|x, y| star(9.0, x, y), SIDE)]),
        Kind::new("hills", Unit::Psnr, vec![drawing(hills, SIDE)]),
        Kind::new("points", Unit::Psnr, vec![drawing(points, SIDE)]),
        Kind::new("drawn wing, virtual camera", Unit::Correlation, vec![drawn_wing()]),
        Kind::new("no light", Unit::Psnr, (0..24).map(no_light).collect()),
    ];
    if let Some(data) = data() {
        kinds.extend([
            Kind::new("natural scenes", Unit::Psnr, natural(&data, NOISE, 0)),
            Kind::new("natural scenes, 5 % noise", Unit::Psnr, natural(&data, 0.05, 0)),
            Kind::new("photon counts", Unit::Correlation, photon_counts(&data)),
            Kind::new("car", Unit::Psnr, car(&data)),
            Kind::new("insect's wing", Unit::Psnr, insect_wing(&data)),
        ]);
    }
    kinds
}

/// Two exposures of one scene, each judged by the other; `None` where this machine has none.
pub fn exposures() -> Option<Vec<Measured>> {
    Some(photon_counts(&data()?))
}

/// Kinds that the default's rule was not made with.
pub fn others() -> Vec<Kind> {
    let mut kinds = vec![
        sources("letters", &["letter:B", "letter:k", "letter:3", "letter:W"]),
        sources("words", &["word:FOG", "word:mcu", "word:42", "word:Regen"]),
        Kind::new("star", Unit::Psnr, vec![drawing(|x, y| star(6.0, x, y), SIDE)]),
        Kind::new("no light", Unit::Psnr, (10..13).map(no_light).collect()),
    ];
    if let Some(data) = data() {
        kinds.push(Kind::new("natural scenes", Unit::Psnr, natural(&data, NOISE, 1)));
        kinds.push(Kind::new("natural scenes, 5 % noise", Unit::Psnr, natural(&data, 0.05, 1)));
    }
    kinds
}

fn data() -> Option<PathBuf> {
    let data = std::env::var_os("NIRSPI_DATA").map(PathBuf::from).filter(|data| data.is_dir());
    if data.is_none() {
        // Past libtest, which keeps what a passing test prints to itself.
        let _ = writeln!(
            std::io::stderr(),
            "skipped: no data (NIRSPI_DATA): recordings and natural scenes"
        );
    }
    data
}

/// A scene of known pixels, with white noise that the measurement states, as a camera's does. 1 is white.
fn simulated(n: usize, pixels: Vec<f32>, noise: f64, seed: u64) -> Measured {
    let side = Side::new(n as u64).unwrap();
    let scene = Scene { name: String::new(), side, pixels };
    let measured = scene.measured(noise, seed).unwrap();
    let measured = measured.with_noise(noise * n as f64).unwrap();
    Measured { measured, judge: Judge::Truth(scene.pixels) }
}

const NOISE: f64 = 0.01;

/// The means of squares of a drawing, n x n of them.
fn shrunk(drawn: &[f32], n: usize) -> Vec<f32> {
    let step = DRAWN_PX / n;
    let mean = |p: usize| {
        let (top, left) = (p / n * step, p % n * step);
        let rows = (top..top + step).flat_map(|y| &drawn[y * DRAWN_PX + left..][..step]);
        rows.sum::<f32>() / (step * step) as f32
    };
    (0..n * n).map(mean).collect()
}

fn sources(name: &str, words: &[&str]) -> Kind {
    let scene = |(seed, word): (usize, &&str)| {
        let map = word.parse::<SceneSource>().unwrap().load(DRAWN_PX).unwrap();
        simulated(SIDE, shrunk(&map.reflectance, SIDE), NOISE, seed as u64)
    };
    Kind::new(name, Unit::Psnr, words.iter().enumerate().map(scene).collect())
}

/// A drawing of n x n pixels by its brightness at `x` and `y` from -1 to 1.
fn drawing(of: impl Fn(f64, f64) -> f64, n: usize) -> Measured {
    let at = |p: usize| 2.0 * p as f64 / (DRAWN_PX - 1) as f64 - 1.0;
    let drawn = (0..DRAWN_PX * DRAWN_PX).map(|p| of(at(p % DRAWN_PX), at(p / DRAWN_PX)) as f32);
    simulated(n, shrunk(&drawn.collect::<Vec<_>>(), n), NOISE, 1)
}

/// A leaf with veins, as in the notebook of orders.
fn leaf(x: f64, y: f64) -> f64 {
    let (along, across) = ((x - y) / 1.7, (x + y) / 1.5);
    let clipped = along.clamp(-1.0, 1.0);
    let width = 0.6 * (std::f64::consts::FRAC_PI_2 * clipped).cos() * (1.0 - 0.4 * along);
    let vein = across.abs() < 0.04 || (3.5 * (along - 0.8 * across.abs())).rem_euclid(1.0) < 0.22;
    match across.abs() < width - 0.01 {
        true if vein => 0.9,
        true => 0.45,
        false => 0.05,
    }
}

/// Bright spokes.
fn star(spokes: f64, x: f64, y: f64) -> f64 {
    if x.hypot(y) < 0.9 && (spokes * y.atan2(x)).sin() > 0.0 { 0.9 } else { 0.1 }
}

/// Nine bright points of one or two pixels on black.
fn points(x: f64, y: f64) -> f64 {
    const POINTS: [(f64, f64); 9] = [
        (-0.81, -0.70),
        (-0.42, 0.13),
        (-0.10, -0.35),
        (0.05, 0.62),
        (0.21, -0.88),
        (0.47, 0.33),
        (0.58, -0.21),
        (0.83, 0.79),
        (-0.66, 0.71),
    ];
    let lit = POINTS.into_iter().any(|(a, b)| (x - a).hypot(y - b) < 0.045);
    if lit { 0.9 } else { 0.0 }
}

/// Smooth hills without an edge.
fn hills(x: f64, y: f64) -> f64 {
    const HILLS: [(f64, f64, f64); 6] = [
        (-0.6, -0.5, 0.3),
        (0.2, -0.7, 0.12),
        (0.6, -0.1, 0.2),
        (-0.2, 0.1, 0.08),
        (-0.7, 0.6, 0.15),
        (0.4, 0.6, 0.25),
    ];
    let hill =
        |(a, b, s): (f64, f64, f64)| (-((x - a).powi(2) + (y - b).powi(2)) / (2.0 * s * s)).exp();
    0.1 + 0.8 * HILLS.into_iter().map(hill).sum::<f64>().min(1.0)
}

/// The example of the program, judged by a second simulated exposure.
fn drawn_wing() -> Measured {
    let other = full_image(&Example::Wing.measure(2).unwrap());
    let measured = Example::Wing.measure(1).unwrap();
    Measured { measured, judge: Judge::OtherExposure(other) }
}

/// Noise alone.
fn no_light(seed: u64) -> Measured {
    simulated(SIDE, vec![0.0; SIDE * SIDE], 0.05, seed)
}

/// The middle of six natural scenes, from the `first`. Training has every scene but those whose number ends in 4.
fn natural(data: &Path, noise: f64, first: usize) -> Vec<Measured> {
    let scenes = Scenes::read(data).unwrap();
    let side = Side::new(SIDE as u64).unwrap();
    let unseen = scenes.iter().enumerate().filter(|(k, _)| k % 10 == 4);
    let measured = |(k, levels): (usize, &[u8])| {
        let scene = Scene::centre_of("natural", levels, scenes.height, side);
        simulated(SIDE, scene.pixels, noise, k as u64)
    };
    unseen.skip(first).step_by(3).take(6).map(measured).collect()
}

/// Two exposures of one scene, each judged by the other: a pattern and its complement in each row.
fn photon_counts(data: &Path) -> Vec<Measured> {
    let rows = Rows::natural(Side::new(SIDE as u64).unwrap());
    let [short, long] = ["photon_40ms.npy", "photon_80ms.npy"].map(|name| {
        let counts = npy::read_stack(&data.join("spi").join(name)).unwrap();
        let counts: Vec<f64> = counts.values.into_iter().map(f64::from).collect();
        Measurements::from_pairs(&rows, &counts).unwrap().measurements
    });
    let (by_long, by_short) = (full_image(&long), full_image(&short));
    vec![
        Measured { measured: short, judge: Judge::OtherExposure(by_long) },
        Measured { measured: long, judge: Judge::OtherExposure(by_short) },
    ]
}

/// Four of the 33 sizes of the detector.
fn car(data: &Path) -> Vec<Measured> {
    let file = data.join("spi/scheidt_car.npz");
    (0..33).step_by(10).map(|size| left_out(read(&file, Some(Index::One(size))))).collect()
}

/// 64 x 64 pixels.
fn insect_wing(data: &Path) -> Vec<Measured> {
    vec![left_out(read(&data.join("spi/opar_ala1.npz"), None))]
}

fn left_out(measured: Measurements) -> Measured {
    Measured { judge: Judge::LeftOut(measured.clone()), measured }
}

fn read(path: &Path, index: Option<Index>) -> Measurements {
    Source::read(path, &SourceOptions { index, ..SourceOptions::default() }).unwrap().measurements
}

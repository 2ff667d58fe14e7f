//! Videos of moving scenes: the recursive estimate against frame-by-frame methods at equal light.
//!
//! Each frame takes the same time and the same light, whatever patterns it shows: with a share `s`
//! of all patterns, each pattern is shown `1 / s` times as long, and its reading has `sqrt(s)`
//! times the noise. A scene stands still while a frame is read. Readings are computed from the
//! scene (`d = H x`), with white noise.
//!
//! # Invariant
//! All methods get the same readings (`tests::equal_light_is_equal_light`).

use crate::completion::{Scene, quality};
use crate::error::{EvalError, Result};
use nirspi::picture::Typeface;
use nirspi::scene::SceneMap;
use nirspi_recon::reconstruct::{Method, Reconstruct, Recursive, RecursiveSettings};
use nirspi_recon::{Image, Measurements, Order, Rows, Side};
use rayon::prelude::*;
use serde::Serialize;
use std::fmt;

/// Pixels of a drawn letter along one side.
const GLYPH_PX: usize = 256;
/// Points of a pixel along one side, over which the scene is averaged.
const POINTS: usize = 4;
/// Per cent of the patterns that a frame of the table shows, if not all.
const PER_CENT: u8 = 30;
/// Share of the patterns that each frame of [`Shown::Turns`] shows; the others are shown in turn.
const ALWAYS: f64 = 0.1;
/// The lowest sequencies of the table.
const LOWEST: Shown = Shown::Lowest(PER_CENT);
/// Frames that do not count: the estimate has no past yet.
const WARM_UP: usize = 4;

/// A scene in motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motion {
    /// A letter that goes to and fro over 12 pixels, at this speed in pixels a frame.
    Letter(f64),
    /// A letter that turns, in degrees a frame.
    Turning(f64),
    /// A still letter behind a bar that passes at this speed in pixels a frame.
    Passing(f64),
    /// A still letter that another one replaces in the middle of the video.
    Cut,
}

impl fmt::Display for Motion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Letter(speed) => write!(f, "letter, {speed} px a frame"),
            Self::Turning(degrees) => write!(f, "letter, {degrees} degrees a frame"),
            Self::Passing(speed) => write!(f, "bar before a letter, {speed} px a frame"),
            Self::Cut => write!(f, "still letter, then another"),
        }
    }
}

impl Motion {
    /// The scenes of the table.
    pub const ALL: [Self; 10] = [
        Self::Letter(0.0),
        Self::Letter(0.1),
        Self::Letter(0.25),
        Self::Letter(0.5),
        Self::Letter(1.0),
        Self::Letter(2.0),
        Self::Turning(2.0),
        Self::Turning(10.0),
        Self::Passing(1.0),
        Self::Cut,
    ];

    /// Frame `frame` of `frames`.
    #[must_use]
    pub fn frame(self, letters: &Letters, frame: usize, frames: usize) -> Scene {
        let side = Side::INSTRUMENT;
        let n = side.pixels();
        let t = frame as f64;
        let value = |x: f64, y: f64| match self {
            Self::Letter(speed) => letters.at(0, x - to_and_fro(speed * t, 6.0), y),
            Self::Turning(degrees) => {
                let (sin, cos) = (degrees * t).to_radians().sin_cos();
                letters.at(0, cos * x + sin * y, cos * y - sin * x)
            }
            Self::Passing(speed) => {
                let bar = x - (speed * t + 20.0).rem_euclid(40.0) + 20.0;
                if bar.abs() < 2.5 { 0.6 } else { letters.at(0, x, y) }
            }
            Self::Cut => letters.at(usize::from(frame >= frames / 2), x, y),
        };
        let middle = n as f64 / 2.0;
        let point = |i: usize| (i as f64 + 0.5) / POINTS as f64 - middle;
        let pixel = |at: usize| {
            let (row, column) = (at / n * POINTS, at % n * POINTS);
            let points = (0..POINTS * POINTS)
                .map(|k| value(point(column + k % POINTS), point(row + k / POINTS)));
            points.sum::<f32>() / (POINTS * POINTS) as f32
        };
        Scene { name: self.to_string(), side, pixels: (0..side.area()).map(pixel).collect() }
    }
}

/// A triangle wave of this amplitude that begins at 0.
fn to_and_fro(way: f64, amplitude: f64) -> f64 {
    let along = (way + amplitude).rem_euclid(4.0 * amplitude);
    if along < 2.0 * amplitude { along - amplitude } else { 3.0 * amplitude - along }
}

/// The letters of the scenes, bright on a dark ground.
pub struct Letters(Vec<SceneMap>);

impl Letters {
    /// An R and a K.
    ///
    /// # Errors
    /// [`EvalError::Library`] if a letter cannot be drawn.
    pub fn new() -> Result<Self> {
        let draw = |letter| SceneMap::letter(&Typeface::ubuntu_light(), letter, GLYPH_PX);
        Ok(Self(['R', 'K'].into_iter().map(draw).collect::<Result<_, _>>()?))
    }

    /// Reflectance at a place in pixels from the middle. A letter takes 20 x 20 pixels.
    fn at(&self, letter: usize, x: f64, y: f64) -> f32 {
        let map = &self.0[letter];
        let place = |v: f64| (v / 20.0 + 0.5) * map.size_px as f64;
        let inside = 0.0..map.size_px as f64;
        let (x, y) = (place(x), place(y));
        let ink = if inside.contains(&x) && inside.contains(&y) {
            map.reflectance[y as usize * map.size_px + x as usize]
        } else {
            0.0
        };
        0.1 + 0.8 * ink
    }
}

/// The patterns of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Shown {
    /// All patterns.
    All,
    /// The lowest sequencies: so many per cent of the patterns.
    Lowest(u8),
    /// The 10 % of the lowest sequencies, and 20 % of the patterns from the others in turn.
    Turns,
}

impl fmt::Display for Shown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::All => f.write_str("all patterns"),
            Self::Lowest(per_cent) => write!(f, "lowest {per_cent} %"),
            Self::Turns => write!(f, "{PER_CENT} % in turn"),
        }
    }
}

impl Shown {
    /// What part of the patterns a frame shows.
    #[must_use]
    pub fn share(self) -> f64 {
        match self {
            Self::All => 1.0,
            Self::Lowest(per_cent) => f64::from(per_cent) / 100.0,
            Self::Turns => f64::from(PER_CENT) / 100.0,
        }
    }

    /// The rows of frame `frame`.
    ///
    /// # Errors
    /// [`EvalError::Library`] does not occur for a built-in order.
    pub fn rows(self, side: Side, frame: usize) -> Result<Rows> {
        let order = Order::ZigZag.rows(side)?;
        let count = |share: f64| (share * side.area() as f64).round() as usize;
        let rows: Vec<u32> = match self {
            Self::All => order.to_vec(),
            Self::Lowest(_) => order[..count(self.share())].to_vec(),
            Self::Turns => {
                let (always, others) = order.split_at(count(ALWAYS));
                let turns = others.len().div_ceil(count(self.share() - ALWAYS));
                let turn = others.iter().skip(frame % turns).step_by(turns);
                always.iter().chain(turn).copied().collect()
            }
        };
        Ok(Rows::new(side, rows)?)
    }

    /// Readings of a scene by this frame's patterns, with their noise, which a camera knows by what
    /// differs between its frames. `noise` is that of a pixel in the image of all patterns in the same
    /// time; white is 1.
    ///
    /// # Errors
    /// [`EvalError::Library`] does not occur for a scene of its own side.
    pub fn read(self, scene: &Scene, frame: usize, noise: f64, seed: u64) -> Result<Measurements> {
        let all = scene.measured(noise * self.share().sqrt(), seed)?;
        let rows = self.rows(scene.side, frame)?;
        let values: Vec<f64> = rows.iter().map(|&row| all.values()[row as usize]).collect();
        let of_a_value = noise * self.share().sqrt() * scene.side.pixels() as f64;
        Ok(Measurements::from_differential(&rows, &values)?.with_noise(of_a_value)?)
    }
}

/// How the images of a video are made.
pub enum Maker {
    /// Each frame alone.
    Alone(Method),
    /// The recursive estimate.
    Recursive {
        /// Whether the estimate is moved with the scene.
        follow: bool,
    },
    /// A method that gets the rows of the recursive estimate.
    Fused(Method),
}

impl Maker {
    fn name(&self) -> String {
        match self {
            Self::Alone(method) => method.argument().to_owned(),
            Self::Recursive { follow: true } => "recursive".to_owned(),
            Self::Recursive { follow: false } => "recursive, not moved".to_owned(),
            Self::Fused(method) => format!("recursive, {method}"),
        }
    }

    fn images(&self, frames: &[Measurements]) -> Result<Vec<Image>> {
        match self {
            Self::Alone(method) => {
                let ready = prepared(*method)?;
                let one = |frame| Ok(ready.reconstruct(frame)?.image);
                frames.par_iter().map(one).collect()
            }
            Self::Fused(method) => {
                let made = prepared(*method)?.reconstruct_video(frames)?;
                Ok(made.into_iter().map(|made| made.image).collect())
            }
            Self::Recursive { follow } => {
                let settings =
                    RecursiveSettings { follow: *follow, ..RecursiveSettings::default() };
                let mut estimate = Recursive::new(settings)?;
                frames.iter().map(|frame| Ok(estimate.add(frame)?.image)).collect()
            }
        }
    }
}

/// A method with its defaults.
fn prepared(method: Method) -> Result<Box<dyn Reconstruct>> {
    Ok(method.prepare(&nirspi_nets::prior::settings())?)
}

/// One way of making one video.
#[derive(Debug, Clone, Serialize)]
pub struct VideoRow {
    /// The scene.
    pub motion: String,
    /// Noise of a pixel in the image of all patterns in a frame's time; white is 1.
    pub noise: f64,
    /// The patterns of a frame.
    pub shown: Shown,
    /// How images are made.
    pub made: String,
    /// Whether the frames before have a part in a frame.
    pub recursive: bool,
    /// Mean PSNR against the scene over the frames from the fifth on, in dB.
    pub psnr_db: f64,
    /// Mean SSIM against the scene over the same frames.
    pub ssim: f64,
    /// PSNR of the worst of these frames.
    pub worst_db: f64,
}

/// A video as the scene was, and as each way has made it.
pub struct Compared {
    /// One row for each way, in the order of [`ways`].
    pub rows: Vec<VideoRow>,
    /// The scene.
    pub truths: Vec<Scene>,
    /// The images of each way.
    pub images: Vec<Vec<Image>>,
}

/// The compared ways: patterns of a frame, and what makes images of them.
#[must_use]
pub fn ways() -> Vec<(Shown, Maker)> {
    let alone = Method::ALL.iter().filter(|m| ["tikhonov", "tv", "prior"].contains(&m.argument()));
    let mut ways: Vec<(Shown, Maker)> = alone
        .flat_map(|&method| [Shown::All, LOWEST].map(|shown| (shown, Maker::Alone(method))))
        .collect();
    let recursive = |shown, follow| (shown, Maker::Recursive { follow });
    ways.push(recursive(Shown::All, true));
    ways.push(recursive(LOWEST, true));
    ways.push(recursive(Shown::Turns, false));
    ways.push(recursive(Shown::Turns, true));
    for shown in [Shown::All, LOWEST, Shown::Turns] {
        ways.push((shown, Maker::Fused(Method::PRIOR)));
    }
    ways
}

/// Compares all [`ways`] on one video. Frame `k` has the noise of seed `seed + k` in each way.
///
/// # Errors
/// [`EvalError`] if there are no frames to count, or a method fails.
pub fn compare(motion: Motion, noise: f64, frames: usize, seed: u64) -> Result<Compared> {
    let truths = scenes(motion, frames)?;
    let (mut rows, mut images) = (Vec::new(), Vec::new());
    for (shown, maker) in ways() {
        let made = maker.images(&readings(&truths, shown, noise, seed)?)?;
        let Qualities { psnr_db, ssim, worst_db } = Qualities::of(&truths, &made)?;
        rows.push(VideoRow {
            motion: motion.to_string(),
            noise,
            shown,
            made: maker.name(),
            recursive: !matches!(maker, Maker::Alone(_)),
            psnr_db,
            ssim,
            worst_db,
        });
        images.push(made);
    }
    Ok(Compared { rows, truths, images })
}

/// The frames of a video.
fn scenes(motion: Motion, frames: usize) -> Result<Vec<Scene>> {
    if frames <= WARM_UP {
        return Err(EvalError::setting("frames", frames, format!("more than {WARM_UP}")));
    }
    let letters = Letters::new()?;
    Ok((0..frames).map(|k| motion.frame(&letters, k, frames)).collect())
}

/// Readings of each frame; frame `k` has the noise of seed `seed + k`.
fn readings(truths: &[Scene], shown: Shown, noise: f64, seed: u64) -> Result<Vec<Measurements>> {
    let read = |(k, truth)| shown.read(truth, k, noise, seed + k as u64);
    truths.iter().enumerate().map(read).collect()
}

/// Figures of the images from the fifth on, against the scenes.
struct Qualities {
    psnr_db: f64,
    ssim: f64,
    worst_db: f64,
}

impl Qualities {
    fn of(truths: &[Scene], images: &[Image]) -> Result<Self> {
        let counted = truths.iter().zip(images).skip(WARM_UP);
        let figures: Vec<(f64, f64)> =
            counted.map(|(truth, image)| quality(truth, image)).collect::<Result<_>>()?;
        let mean =
            |of: fn(&(f64, f64)) -> f64| figures.iter().map(of).sum::<f64>() / figures.len() as f64;
        Ok(Self {
            psnr_db: mean(|figure| figure.0),
            ssim: mean(|figure| figure.1),
            worst_db: figures.iter().map(|figure| figure.0).fold(f64::INFINITY, f64::min),
        })
    }
}

/// What the frames before add to one method, with the same readings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Gain {
    /// Mean PSNR frame by frame over the frames from the fifth on, in dB.
    pub alone_db: f64,
    /// Mean PSNR over the same frames, each of which starts from the frames before.
    pub past_db: f64,
}

impl Gain {
    /// What the past adds, in dB; below 0 where the past costs.
    #[must_use]
    pub fn db(self) -> f64 {
        self.past_db - self.alone_db
    }
}

/// What the past adds to `method` on one video.
///
/// # Errors
/// [`EvalError`] if there are no frames to count, or the method fails.
pub fn gain(
    method: Method,
    motion: Motion,
    shown: Shown,
    noise: f64,
    frames: usize,
    seed: u64,
) -> Result<Gain> {
    let truths = scenes(motion, frames)?;
    let readings = readings(&truths, shown, noise, seed)?;
    let psnr_db = |maker: Maker| -> Result<f64> {
        Ok(Qualities::of(&truths, &maker.images(&readings)?)?.psnr_db)
    };
    Ok(Gain { alone_db: psnr_db(Maker::Alone(method))?, past_db: psnr_db(Maker::Fused(method))? })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_light_is_equal_light() {
        let scene = Motion::Letter(0.0).frame(&Letters::new().unwrap(), 0, 8);
        let clean = scene.measured(0.0, 0).unwrap();
        for shown in [Shown::All, LOWEST, Shown::Turns] {
            let (mut squares, mut count) = (0.0, 0);
            for frame in 0..20 {
                let read = shown.read(&scene, frame, 0.1, 7 + frame as u64).unwrap();
                for (&row, value) in read.rows().iter().zip(read.values()) {
                    squares += ((value - clean.values()[row as usize]) / 32.0).powi(2);
                    count += 1;
                }
            }
            let variance = squares / f64::from(count) / (0.01 * shown.share());
            assert!((variance - 1.0).abs() < 0.1, "{shown:?}: {variance}");
        }
    }

    #[test]
    fn turns_show_every_pattern_and_the_lowest_each_time() {
        let side = Side::INSTRUMENT;
        let mut seen = [0; 1024];
        for frame in 0..5 {
            let rows = Shown::Turns.rows(side, frame).unwrap();
            assert!((rows.len() as f64 / 1024.0 - 0.3).abs() < 0.03, "{}", rows.len());
            rows.iter().for_each(|&row| seen[row as usize] += 1);
        }
        let always = Order::ZigZag.rows(side).unwrap().first(102);
        assert!(always.iter().all(|&row| seen[row as usize] == 5));
        assert!(seen.iter().all(|&times| times == 1 || times == 5));
    }

    #[test]
    #[ignore = "long: .ci/run test"]
    fn a_still_letter_gains_by_its_past_and_the_report_says_how_much() {
        let made = compare(Motion::Letter(0.0), 0.1, 8, 1).unwrap();
        assert_eq!((made.rows.len(), made.images.len()), (13, 13));
        let best = |recursive: bool| {
            let rows = made.rows.iter().filter(|row| row.recursive == recursive);
            rows.map(|row| row.psnr_db).fold(f64::MIN, f64::max)
        };
        assert!(best(true) > best(false) + 2.0, "{} {}", best(true), best(false));
        assert!(compare(Motion::Cut, 0.1, 4, 1).is_err());
    }

    /// The gain of each motion by its past, in dB, over 12 frames that count.
    fn gains(method: Method, shown: Shown, noise: f64) -> Vec<(Motion, f64)> {
        let gain = |&motion| (motion, gain(method, motion, shown, noise, 16, 1).unwrap().db());
        Motion::ALL.par_iter().map(gain).collect()
    }

    #[test]
    #[ignore = "long: .ci/run test"]
    fn the_past_costs_no_scene_half_a_decibel_with_much_light_and_with_little() {
        for (shown, noise) in [(Shown::Lowest(10), 0.1), (LOWEST, 0.001), (Shown::All, 0.1)] {
            let gains = gains(Method::TIKHONOV, shown, noise);
            for (motion, db) in &gains {
                assert!(*db > -0.5, "{motion}, {shown:?}, noise {noise}: {db:.2} dB");
            }
            let still = gains[0].1;
            let least = if shown == Shown::All { 5.0 } else { 0.5 };
            assert!(still > least, "{shown:?}, noise {noise}: {still:.2} dB of a still scene");
        }
    }

    #[test]
    #[ignore = "long: .ci/run test"]
    fn the_past_costs_the_learned_prior_no_scene_half_a_decibel_and_adds_to_slow_motion() {
        let half = Shown::Lowest(50);
        for (shown, noise) in [(LOWEST, 0.1), (half, 0.03)] {
            let gains = gains(Method::PRIOR, shown, noise);
            for (motion, db) in &gains {
                assert!(*db > -0.5, "{motion}, {shown:?}, noise {noise}: {db:.2} dB");
            }
            let slow = gains[1].1;
            assert!(noise < 0.1 || slow > 0.5, "{shown:?}: {slow:.2} dB at 0.1 px a frame");
        }
    }

    #[test]
    fn a_letter_goes_to_and_fro_at_its_speed() {
        let places: Vec<f64> = (0..30).map(|k| to_and_fro(f64::from(k), 6.0)).collect();
        assert!(places.windows(2).all(|w| ((w[1] - w[0]).abs() - 1.0).abs() < 1e-12));
        assert_eq!((places[6], places[18], places[24]), (6.0, -6.0, 0.0));
    }
}

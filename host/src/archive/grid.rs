//! A set of measurements by the virtual camera: every combination of scenes, weathers, distances,
//! orders, shares and seeds.
//!
//! # Invariant
//! A measurement follows from its own settings alone: in a set of more, or made on another machine,
//! it has the same numbers (`tests::a_point_does_not_depend_on_the_others`).

use super::rows::meta;
use super::{ArchiveReport, Work};
use crate::calibration::{FlatField, Settling};
use crate::causes::in_one_line;
use crate::dataset::Row;
use crate::exposure::{Exposure, Length};
use crate::imaging::score;
use crate::reconstruct::Solver;
use crate::scene::{SceneError, SceneMap, SceneSource};
use crate::setup::MeasurementSetup;
use crate::source::Source;
use crate::virtual_camera::{
    CameraModel, ShotError, VirtualOptics, calibrate_against_white, flat_field_against_white, shoot,
};
use crate::weather::{WeatherError, read_weather};
use nirspi_optics::rain::Air;
use nirspi_recon::words::count;
use nirspi_recon::{Order, Sampling};
use serde_json::{Map, Value, json};
use std::ops::ControlFlow;
use std::path::Path;
use std::str::FromStr;
use thiserror::Error;

/// Edge of a drawn scene's map of reflectance.
const SCENE_PX: usize = 256;
/// Seed of the calibration, which belongs to the camera and not to a measurement.
const CALIBRATION_SEED: u64 = 1;

/// The values of every axis.
#[derive(Debug, Clone)]
pub struct GridAxes {
    /// `letter:R`, `word:STOP`, `white`, or the path of a PNG or JPEG.
    pub scenes: Vec<String>,
    /// `none`, `light`, `heavy`, `rain:20`, `fog:5m`, ...
    pub weathers: Vec<String>,
    /// Distances to the target in metres.
    pub distances_m: Vec<f64>,
    /// Orders of the patterns.
    pub orders: Vec<Order>,
    /// Shares of the patterns.
    pub samplings: Vec<Sampling>,
    /// Seeds of the simulated noise.
    pub seeds: Vec<u64>,
    /// How long each measurement goes on.
    pub length: Length,
}

/// Why there is no set.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum GridError {
    /// An axis has no value.
    #[error("no {0}, expected at least one")]
    Empty(&'static str),
    /// A number is out of range.
    #[error("{name} {found}, expected {expected}")]
    Range {
        /// The axis.
        name: &'static str,
        /// The number.
        found: f64,
        /// The numbers that are accepted.
        expected: &'static str,
    },
    /// A value stands twice.
    #[error("{axis} {value} stands twice, expected each value once")]
    Twice {
        /// The axis.
        axis: &'static str,
        /// The value.
        value: String,
    },
    /// A scene cannot be made.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A weather cannot be read.
    #[error("weather")]
    Weather(#[from] WeatherError),
    /// The virtual camera cannot be calibrated.
    #[error(transparent)]
    Shot(#[from] ShotError),
}

impl GridError {
    /// Whether a value is wrong in itself, without a file or the camera.
    #[must_use]
    pub fn is_setting(&self) -> bool {
        matches!(self, Self::Empty(_) | Self::Range { .. } | Self::Twice { .. })
    }
}

/// The set. The camera is calibrated once.
pub struct Grid {
    axes: GridAxes,
    scenes: Vec<SceneMap>,
    airs: Vec<Air>,
    model: CameraModel,
    settling: Settling,
    flat_field: Option<FlatField>,
    solver: Solver,
    names: Vec<String>,
}

/// The indices of an item's values.
struct Point {
    scene: usize,
    weather: usize,
    distance: usize,
    order: usize,
    sampling: usize,
    seed: usize,
}

fn unlike<T: ToString>(axis: &'static str, values: &[T]) -> Result<Vec<String>, GridError> {
    let texts: Vec<String> = values.iter().map(T::to_string).collect();
    if texts.is_empty() {
        return Err(GridError::Empty(axis));
    }
    match texts.iter().enumerate().find(|(at, text)| texts[..*at].contains(text)) {
        Some((_, value)) => Err(GridError::Twice { axis, value: value.clone() }),
        None => Ok(texts),
    }
}

impl Grid {
    /// Checks every value, draws the scenes, and calibrates the camera against a white sheet.
    ///
    /// # Errors
    /// [`GridError`] names the axis and the value.
    pub fn new(axes: GridAxes, model: CameraModel, solver: Solver) -> Result<Self, GridError> {
        for &found in &axes.distances_m {
            if !(found.is_finite() && found > 0.0) {
                let expected = "a positive number of metres";
                return Err(GridError::Range { name: "distance", found, expected });
            }
        }
        if let Length::Frames(frames, _) = axes.length
            && !(1..=100_000).contains(&frames)
        {
            let (found, expected) = (f64::from(frames), "1 to 100000");
            return Err(GridError::Range { name: "frames", found, expected });
        }
        let texts = [
            unlike("scene", &axes.scenes)?,
            unlike("weather", &axes.weathers)?,
            unlike("distance", &axes.distances_m)?.into_iter().map(|m| m + "m").collect(),
            unlike("order", &axes.orders)?,
            unlike("sampling", &axes.samplings)?,
            unlike("seed", &axes.seeds)?,
        ];
        let names = texts.iter().fold(vec![String::new()], |names, axis| {
            let join = |name: &String, value: &String| match name.as_str() {
                "" => value.clone(),
                name => format!("{name} {value}"),
            };
            names.iter().flat_map(|name| axis.iter().map(move |value| join(name, value))).collect()
        });
        let load = |scene: &String| SceneSource::from_str(scene)?.load(SCENE_PX);
        let scenes = axes.scenes.iter().map(load).collect::<Result<Vec<_>, _>>()?;
        let airs = axes.weathers.iter().map(|text| read_weather(text));
        let airs = airs.collect::<Result<Vec<_>, _>>()?;
        // The scene does not matter, because a white sheet replaces it.
        let optics = VirtualOptics::of(
            &model,
            nirspi_optics::Scene::white(),
            model.projector().focus_distance_mm,
        )
        .map_err(ShotError::from)?;
        let settling = calibrate_against_white(&optics, CALIBRATION_SEED)?;
        let flat_field = flat_field_against_white(&optics, &settling, CALIBRATION_SEED)?;
        Ok(Self { axes, scenes, airs, model, settling, flat_field, solver, names })
    }

    fn point(&self, item: usize) -> Point {
        let GridAxes { weathers, distances_m, orders, samplings, seeds, .. } = &self.axes;
        let mut rest = item;
        let mut axis = |length: usize| {
            let index = rest % length;
            rest /= length;
            index
        };
        // The last axis of a name changes fastest.
        let (seed, sampling, order) =
            (axis(seeds.len()), axis(samplings.len()), axis(orders.len()));
        let (distance, weather) = (axis(distances_m.len()), axis(weathers.len()));
        Point { scene: rest, weather, distance, order, sampling, seed }
    }

    fn row(&self, item: usize) -> Result<Row, String> {
        let at = self.point(item);
        let axes = &self.axes;
        let (map, air) = (&self.scenes[at.scene], &self.airs[at.weather]);
        let (distance_m, seed) = (axes.distances_m[at.distance], axes.seeds[at.seed]);
        let (order, sampling) = (&axes.orders[at.order], axes.samplings[at.sampling]);
        let told = |error: &(dyn std::error::Error + 'static)| {
            format!("{}: {}", self.names[item], in_one_line(error))
        };
        let optics = VirtualOptics::before(&self.model, map, 1e3 * distance_m)
            .and_then(|optics| optics.in_air(air))
            .map_err(|error| told(&error))?;
        let setup = optics.setup(order, sampling.share()).map_err(|error| told(&error))?;
        let Exposure { frames, sweeps } =
            Exposure::of(axes.length, &setup).map_err(|error| told(&error))?;
        let setup = MeasurementSetup { sweeps, ..setup };
        let light_ms = setup.frame_ns() * f64::from(frames) * 1e-6;
        let setup_id = setup.id();
        let mut go_on = |_: &crate::capture::Progress| ControlFlow::Continue(());
        let shot = shoot(&optics, setup, &self.settling, frames, seed, &mut go_on)
            .map_err(|error| told(&error))?;
        let truth = optics.focused_footprint().map_err(|error| told(&error))?.weights().to_vec();
        let source = Source::of_capture(&shot.capture).map_err(|error| told(&error))?;
        let source = Source { flat_field: self.flat_field.clone(), ..source };
        let solved = self
            .solver
            .solve(Path::new(&self.names[item]), &source)
            .map_err(|error| in_one_line(&error))?;
        let truth: Vec<f32> = truth;
        let quality = score(&solved.image, &truth).map_err(|error| told(&error))?;
        let identity = shot.session.identity();
        let known = json!({
            "camera": identity,
            "model": self.model.name,
            "weather": axes.weathers[at.weather],
            "order": order.to_string(),
            "sampling": sampling.share(),
            "seed": seed,
            "frames": frames,
            "light_ms": light_ms,
            "quality": quality,
        });
        Ok(Row {
            image_id: self.names[item].clone(),
            n: solved.image.side().pixels() as u32,
            rows: source.measurements.rows().as_slice().to_vec(),
            d: source.measurements.values().to_vec(),
            sweeps: Some(i64::from(frames) * i64::from(sweeps)),
            serial: Some(identity.serial.clone()),
            board: Some(identity.board.clone()),
            simulated: Some(true),
            setup_id: Some(setup_id),
            scene: Some(axes.scenes[at.scene].clone()),
            distance_m: Some(distance_m),
            image: Some(solved.image.pixels().to_vec()),
            meta: meta(&known.to_string(), &source, &solved),
            truth: Some(truth),
            ..Row::default()
        })
    }

    /// The data card of the set, in Markdown.
    #[must_use]
    pub fn card(&self, report: &ArchiveReport) -> String {
        let list = |values: &[String]| values.join(", ");
        let axes = &self.axes;
        let texts = |values: &[f64]| values.iter().map(f64::to_string).collect::<Vec<_>>();
        let seeds: Vec<String> = axes.seeds.iter().map(u64::to_string).collect();
        let orders: Vec<String> = axes.orders.iter().map(Order::to_string).collect();
        let samplings: Vec<String> = axes.samplings.iter().map(Sampling::to_string).collect();
        let name = report.out.file_name().map(|name| name.to_string_lossy()).unwrap_or_default();
        let skipped: String =
            report.skipped.iter().map(|skipped| format!("- {}\n", skipped.reason)).collect();
        let (skipped, shard) = match skipped.as_str() {
            "" => ("none\n".to_owned(), report.shard),
            _ => (skipped, report.shard),
        };
        let method = self.solver.recipe().method;
        format!(
            "# {name}\n\n\
             Measurements of the virtual camera of nirspi {version}: **simulated**, no light was measured.\n\
             One row is one measurement; the columns are those of nirspi's docs/recordings.md and\n\
             docs/clusters.md.\n\n\
             | axis | values |\n| -- | -- |\n\
             | scene | {scenes} |\n| weather | {weathers} |\n| distance in m | {distances} |\n\
             | order | {orders} |\n| share of the patterns | {samplings} |\n| seed | {seeds} |\n\n\
             - **Rows**: {rows}, share {shard} of {items}.\n\
             - **Measurement**: {length}, summed, differential, the camera calibrated once against a white sheet,\n\
             \x20 the leak from pattern to pattern corrected. `d` is in ADC counts.\n\
             - **image**: by the method {method}, of all patterns of the row, in ADC counts. `meta` has its report,\n\
             \x20 and under `quality` how alike it is to `truth` after a fit of gain and offset.\n\
             - **truth**: what a perfect camera of 32 x 32 pixels would see of the scene, 0 to 1.\n\
             - **Not in it**: raw readings of pattern and complement; depth; networks' images.\n\
             - **Left out**: {skipped}\n\
             The camera's description:\n\n```toml\n{model}```\n",
            version = env!("CARGO_PKG_VERSION"),
            scenes = list(&axes.scenes),
            weathers = list(&axes.weathers),
            distances = list(&texts(&axes.distances_m)),
            orders = list(&orders),
            samplings = list(&samplings),
            seeds = list(&seeds),
            rows = report.rows,
            items = count(self.names.len() as u64, "measurement"),
            length = axes.length,
            model = self.model.to_toml(),
        )
    }
}

impl Work for Grid {
    fn names(&self) -> &[String] {
        &self.names
    }

    fn noun(&self) -> &'static str {
        "measurement"
    }

    fn settings(&self) -> Map<String, Value> {
        let mut settings = self.solver.settings();
        settings.insert("camera".to_owned(), self.model.to_toml().into());
        settings.insert("length".to_owned(), self.axes.length.to_string().into());
        // The names hold every other value.
        let names = self.names.join("\n");
        let names = format!("{:08x}", nirspi_wire::crc32(names.as_bytes()));
        settings.insert("measurements".to_owned(), names.into());
        settings
    }

    fn rows(&self, item: usize) -> Result<Vec<Row>, String> {
        Ok(vec![self.row(item)?])
    }
}

#[cfg(test)]
mod tests {
    use super::super::{ArchiveOptions, Shard, archive};
    use super::*;
    use crate::reconstruct::Recipe;
    use crate::source::FirstPatterns;
    use nirspi_recon::reconstruct::{Method, MethodSettings};
    use std::sync::atomic::AtomicBool;

    fn axes() -> GridAxes {
        GridAxes {
            scenes: vec!["letter:R".to_owned(), "white".to_owned()],
            weathers: vec!["none".to_owned(), "heavy".to_owned()],
            distances_m: vec![0.3, 0.6],
            orders: vec![Order::ZigZag, Order::CakeCutting],
            samplings: vec![Sampling::new(0.1).unwrap()],
            seeds: vec![1, 2],
            length: Length::Frames(4, None),
        }
    }

    fn grid(axes: GridAxes) -> Result<Grid, GridError> {
        let recipe = Recipe {
            method: Method::default(),
            settings: MethodSettings::default(),
            dictionary: None,
            first: FirstPatterns::Recorded,
            sampling: Sampling::ALL,
        };
        Grid::new(axes, CameraModel::paper().clone(), Solver::new(recipe).unwrap())
    }

    #[test]
    fn a_point_does_not_depend_on_the_others() {
        let all = grid(axes()).unwrap();
        assert_eq!(all.names().len(), 32);
        assert_eq!(all.names()[31], "white heavy 0.6m cake-cutting 0.1 2");
        let item = all.names().iter().position(|n| n == "letter:R heavy 0.6m cake-cutting 0.1 2");
        let [row] = &all.rows(item.unwrap()).unwrap()[..] else { panic!("one row") };
        let alone = grid(GridAxes {
            scenes: vec!["letter:R".to_owned()],
            weathers: vec!["heavy".to_owned()],
            distances_m: vec![0.6],
            orders: vec![Order::CakeCutting],
            seeds: vec![2],
            ..axes()
        });
        assert_eq!(alone.unwrap().rows(0).unwrap(), std::slice::from_ref(row));
        assert_eq!((row.rows.len(), row.n, row.simulated), (102, 32, Some(true)));
        assert_eq!((row.scene.as_deref(), row.distance_m), (Some("letter:R"), Some(0.6)));
        let meta: Value = serde_json::from_str(&row.meta).unwrap();
        assert_eq!((&meta["weather"], &meta["seed"]), (&json!("heavy"), &json!(2)));
        assert!(meta["quality"]["correlation"].as_f64().unwrap() > 0.3, "{meta}");
    }

    #[test]
    fn a_wrong_axis_is_named() {
        for (axes, told) in [
            (GridAxes { scenes: Vec::new(), ..axes() }, "no scene, expected at least one"),
            (GridAxes { seeds: vec![3, 3], ..axes() }, "seed 3 stands twice"),
            (
                GridAxes { distances_m: vec![0.3, -1.0], ..axes() },
                "distance -1, expected a positive",
            ),
            (
                GridAxes { length: Length::Frames(0, None), ..axes() },
                "frames 0, expected 1 to 100000",
            ),
            (GridAxes { weathers: vec!["snow".to_owned()], ..axes() }, "weather: "),
        ] {
            let Err(error) = grid(axes) else { panic!("{told}") };
            assert!(in_one_line(&error).contains(told), "{error}");
        }
    }

    #[test]
    fn the_card_names_every_value_and_every_gap() {
        let root = tempfile::tempdir().unwrap();
        let axes = GridAxes { scenes: vec!["letter:R".to_owned()], seeds: vec![1], ..axes() };
        // Nothing is in focus or lit 1 km away.
        let axes =
            GridAxes { distances_m: vec![0.3, 1e6], weathers: vec!["none".to_owned()], ..axes };
        let grid = grid(axes).unwrap();
        let out = root.path().join("set.parquet");
        let options = ArchiveOptions { out, jobs: None, resume: false, shard: Shard::WHOLE };
        let report = archive(&grid, &options, &AtomicBool::new(false), &mut |_| {}).unwrap();
        assert_eq!((report.rows, report.skipped.len()), (2, 2));
        let card = grid.card(&report);
        for told in [
            "**simulated**",
            "zig-zag, cake-cutting",
            "0.3, 1000000",
            "letter:R none 1000000m",
            "[leds]",
        ] {
            assert!(card.contains(told), "{told}: {card}");
        }
    }
}

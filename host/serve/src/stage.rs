//! The scene before a virtual camera, and the message by which a page changes the scene.
//!
//! # Invariant
//! A page names no file: its scenes are letters, words, sheets and drawings
//! (`tests::a_page_names_no_file`).

use super::lock;
use data_encoding::BASE64;
use nirspi::files::image::Grey;
use nirspi::scene::{SceneError, SceneMap, SceneSource};
use nirspi_optics::rain::Air;
use serde::{Deserialize, Serialize};
use std::sync::{Arc, Mutex};
use thiserror::Error;

/// Edge in pixels of a letter, word or sheet.
const DRAWN_PX: usize = 256;
/// Edge in pixels of the drawing that a page shows.
const SHOWN_PX: u32 = 64;
/// Edges in pixels that a page's drawing can have.
const DRAWING_PX: std::ops::RangeInclusive<usize> = 8..=128;
/// Distances in metres that a page can ask for. The optics may refuse more.
const DISTANCE_M: std::ops::RangeInclusive<f64> = 0.01..=100.0;

/// A scene, its distance and the air before it.
#[derive(Debug, Clone, PartialEq)]
pub struct StagedScene {
    /// The scene.
    pub map: SceneMap,
    /// Distance from the camera, in metres.
    pub distance_m: f64,
    /// The air between camera and scene.
    pub air: Air,
}

impl StagedScene {
    /// A virtual camera before this scene.
    ///
    /// # Errors
    /// [`VirtualOpticsError`](nirspi_virtual::VirtualOpticsError) if the camera cannot see a
    /// scene at this distance, or there are too many drops to compute.
    pub fn camera(
        &self,
        model: &nirspi_optics::CameraModel,
        seed: u64,
    ) -> Result<
        nirspi_virtual::VirtualCamera<nirspi_virtual::OpticalFpga>,
        nirspi_virtual::VirtualOpticsError,
    > {
        let distance_mm = self.distance_m * 1e3;
        let optics = nirspi_virtual::VirtualOptics::before(model, &self.map, distance_mm)?;
        optics.in_air(&self.air)?.camera(seed)
    }
}

/// A change that a page asks for. Fields that are left out keep their values.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneChange {
    scene: Option<SceneWish>,
    distance_m: Option<f64>,
    weather: Option<String>,
}

/// A scene in a message.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged)]
enum SceneWish {
    /// A scene by name.
    Named(String),
    /// A drawing: 8-bit reflectances in base64, row by row.
    Drawn { side: usize, levels: String },
}

/// Why a change of the scene is refused.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StageError {
    /// The camera is not a virtual one.
    #[error("scene: only a virtual camera's scene can be changed")]
    Real,
    /// The scene is a file or nothing.
    #[error("scene is {0:?}, expected letter:R, word:STOP, white, black or a drawing")]
    Named(String),
    /// The letter or the word cannot be drawn.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The drawing has another size.
    #[error(
        "the drawing has a side of {side} and {found} levels, expected a side of {least} to {most} and its square",
        least = DRAWING_PX.start(), most = DRAWING_PX.end()
    )]
    Size {
        /// The side in the message.
        side: usize,
        /// The number of levels in the message.
        found: usize,
    },
    /// The levels are not base64.
    #[error("the drawing's levels are not base64: {0}")]
    Base64(#[from] data_encoding::DecodeError),
    /// The distance is out of range.
    #[error(
        "distance_m is {0}, expected {least} to {most}", least = DISTANCE_M.start(), most = DISTANCE_M.end()
    )]
    Distance(f64),
    /// The weather cannot be read.
    #[error("weather: {0}")]
    Weather(#[from] nirspi_optics::rain::AirError),
    /// The message does not have the form of a change.
    #[error(
        "{0}, expected for example {{\"scene\": \"letter:R\", \"distance_m\": 0.3, \"weather\": \"none\"}}"
    )]
    Form(#[from] serde_json::Error),
}

impl SceneWish {
    fn map(&self) -> Result<SceneMap, StageError> {
        match self {
            Self::Named(name) => {
                let is_file = !["letter:", "word:"].iter().any(|kind| name.starts_with(kind))
                    && !["white", "black"].contains(&name.as_str());
                if is_file {
                    return Err(StageError::Named(name.chars().take(100).collect()));
                }
                Ok(name.parse::<SceneSource>()?.load(DRAWN_PX)?)
            }
            Self::Drawn { side, levels } => {
                let levels = BASE64.decode(levels.as_bytes())?;
                let (side, found) = (*side, levels.len());
                if !DRAWING_PX.contains(&side) || found != side * side {
                    return Err(StageError::Size { side, found });
                }
                let reflectance = levels.iter().map(|&level| f32::from(level) / 255.0).collect();
                let name = "drawing".to_owned();
                Ok(SceneMap { name, size_px: side, reflectance, side_mm: None })
            }
        }
    }
}

impl StagedScene {
    /// The scene after the change in this message.
    ///
    /// # Errors
    /// [`StageError`] that names the field.
    fn with(&self, json: &[u8]) -> Result<Self, StageError> {
        let change: SceneChange = serde_json::from_slice(json)?;
        let mut new = self.clone();
        if let Some(scene) = &change.scene {
            new.map = scene.map()?;
        }
        if let Some(distance_m) = change.distance_m {
            if !DISTANCE_M.contains(&distance_m) {
                return Err(StageError::Distance(distance_m));
            }
            new.distance_m = distance_m;
        }
        if let Some(weather) = &change.weather {
            new.air = weather.parse()?;
        }
        Ok(new)
    }
}

/// The scene in words, for pages.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SceneState {
    name: String,
    distance_m: f64,
    weather: String,
    /// Whether another scene was asked for, and is not shown yet.
    changing: bool,
    /// Why the scene that was asked for last is not shown.
    problem: Option<String>,
}

#[derive(Debug, Default)]
struct Scenes {
    wanted: Option<Arc<StagedScene>>,
    shown: Option<Arc<StagedScene>>,
    /// The drawing of the scene that is shown.
    drawing: Option<Arc<str>>,
    problem: Option<String>,
}

impl Scenes {
    fn show(&mut self, scene: Option<Arc<StagedScene>>) {
        self.drawing = scene.as_ref().map(|scene| drawing(&scene.map));
        self.shown = scene;
    }
}

/// A scene as a page shows it: (64, 64) 8-bit reflectances in base64, row by row.
fn drawing(map: &SceneMap) -> Arc<str> {
    let edge = u32::try_from(map.size_px).unwrap_or(u32::MAX);
    let values = map.reflectance.clone();
    let small = Grey { width: edge, height: edge, values }.resized(SHOWN_PX);
    let levels: Vec<u8> = small.values.iter().map(|value| (255.0 * value).round() as u8).collect();
    BASE64.encode(&levels).into()
}

/// The scene that is shown, and the scene that a page wants. Both are nothing for a real camera.
#[derive(Debug, Default)]
pub struct Stage(Mutex<Scenes>);

impl Stage {
    /// A stage with this scene.
    pub fn of(scene: Option<StagedScene>) -> Self {
        let mut scenes = Scenes { wanted: scene.map(Arc::new), ..Scenes::default() };
        scenes.show(scenes.wanted.clone());
        Self(Mutex::new(scenes))
    }

    /// Records the scene that a page wants.
    ///
    /// # Errors
    /// [`StageError`] that names the field.
    pub fn change(&self, json: &[u8]) -> Result<(), StageError> {
        let mut scenes = lock(&self.0);
        let new = scenes.wanted.as_ref().ok_or(StageError::Real)?.with(json)?;
        scenes.wanted = Some(Arc::new(new));
        scenes.problem = None;
        Ok(())
    }

    /// The scene that is wanted.
    pub fn wanted(&self) -> Option<Arc<StagedScene>> {
        lock(&self.0).wanted.clone()
    }

    /// Whether another scene is wanted than the one shown.
    pub fn has_changed(&self) -> bool {
        let scenes = lock(&self.0);
        !same(scenes.wanted.as_ref(), scenes.shown.as_ref())
    }

    /// Records that this scene is shown.
    pub fn show(&self, scene: Option<Arc<StagedScene>>) {
        lock(&self.0).show(scene);
    }

    /// Goes back from this scene, which cannot be shown, to the one before. Returns `false` if there
    /// is no other.
    pub fn refuse(&self, scene: Option<&Arc<StagedScene>>, problem: &str) -> bool {
        let mut scenes = lock(&self.0);
        if same(scenes.shown.as_ref(), scene) {
            return false;
        }
        if same(scenes.wanted.as_ref(), scene) {
            scenes.wanted = scenes.shown.clone();
            scenes.problem = Some(problem.to_owned());
        }
        true
    }

    /// The scene in words; `None` for a real camera.
    pub fn state(&self) -> Option<SceneState> {
        let scenes = lock(&self.0);
        let shown = scenes.shown.as_ref()?;
        Some(SceneState {
            name: shown.map.name.clone(),
            distance_m: shown.distance_m,
            weather: shown.air.name().to_owned(),
            changing: !same(scenes.wanted.as_ref(), Some(shown)),
            problem: scenes.problem.clone(),
        })
    }

    /// The drawing of the scene that is shown: (64, 64) 8-bit reflectances in base64; `None` for a real camera.
    pub fn drawing(&self) -> Option<Arc<str>> {
        lock(&self.0).drawing.clone()
    }
}

fn same(a: Option<&Arc<StagedScene>>, b: Option<&Arc<StagedScene>>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => Arc::ptr_eq(a, b),
        (None, None) => true,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stage() -> Stage {
        let map = SceneWish::Named("letter:R".to_owned()).map().unwrap();
        Stage::of(Some(StagedScene { map, distance_m: 0.3, air: "none".parse().unwrap() }))
    }

    fn refused(json: &str) -> String {
        let line = stage().change(json.as_bytes()).unwrap_err().to_string();
        assert_eq!(line.lines().count(), 1, "{line}");
        line
    }

    #[test]
    fn a_page_names_no_file() {
        for name in ["/etc/passwd", "Cargo.toml", "R", "", "letters.png", "../x"] {
            let json = serde_json::json!({ "scene": name }).to_string();
            assert!(refused(&json).contains("expected letter:R"), "{name}");
        }
        assert!(refused(r#"{"weather": "drops.csv"}"#).starts_with("weather: found drops.csv"));
        assert!(refused(r#"{"scene": "letter:AB"}"#).contains("2 characters"));
        assert!(refused(r#"{"distance_m": 0}"#).contains("distance_m is 0, expected 0.01 to 100"));
        assert!(refused(r#"{"distance": 1}"#).contains("distance"));
        assert!(refused(r#"{"scene": {"side": 8, "levels": "AAAA"}}"#).contains("3 levels"));
        assert!(
            refused(r#"{"scene": {"side": 9999999999, "levels": ""}}"#).contains("side of 999")
        );
        let real = Stage::of(None).change(b"{}").unwrap_err().to_string();
        assert!(real.contains("virtual camera"), "{real}");
    }

    #[test]
    fn a_scene_that_cannot_be_shown_gives_way_to_the_one_before() {
        let stage = stage();
        let levels = BASE64.encode(&[255; 64]);
        let drawing = serde_json::json!({ "scene": { "side": 8, "levels": levels } }).to_string();
        assert!(!stage.has_changed());
        let drawn = || BASE64.decode(stage.drawing().unwrap().as_bytes()).unwrap();
        let letter = drawn();
        assert!(letter.len() == 64 * 64 && letter.contains(&255) && letter[0] == 0);
        stage.change(drawing.as_bytes()).unwrap();
        stage.change(br#"{"weather": "fog:5m", "distance_m": 0.5}"#).unwrap();
        let wanted = stage.wanted();
        assert!(stage.has_changed());
        assert_eq!(wanted.as_ref().unwrap().map.reflectance, [1.0; 64]);
        // What is only asked for is not drawn.
        assert!(drawn() == letter && stage.state().unwrap().changing);
        stage.show(wanted.clone());
        assert_eq!(drawn(), [255; 64 * 64]);
        let state = stage.state().unwrap();
        assert!(!state.changing);
        assert_eq!((state.name.as_str(), state.weather.as_str()), ("drawing", "fog:5m"));

        stage.change(br#"{"distance_m": 90}"#).unwrap();
        assert!(stage.refuse(stage.wanted().as_ref(), "too far"));
        assert!(!stage.has_changed() && stage.state().unwrap().problem.is_some());
        assert!(!stage.state().unwrap().changing && drawn() == [255; 64 * 64]);
        assert!(!stage.refuse(stage.wanted().as_ref(), "nothing else is left"));
    }
}

//! The scenes of the virtual camera: a letter target, a white sheet, or a picture.
//!
//! # Invariant
//! A scene is a square map of reflectance in `[0, 1]`, with 1 as bright, row-major, top row first
//! (`tests::a_letter_is_a_43_mm_target_bright_on_dark`).

use crate::files::FileError;
use crate::files::image::{Filter, Reflectance, read_reflectance, resample};
use crate::picture::Typeface;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use thiserror::Error;

/// Edge of the paper's letter target: 43 mm x 43 mm (Fig. 6 and Section 5).
pub const LETTER_SIDE_MM: f64 = 43.0;
/// Part of the target's edge that the glyph's longer side takes.
const GLYPH_FILL: f32 = 0.9;
/// The prefix of a letter scene.
const LETTER_PREFIX: &str = "letter:";
/// The prefix of a word scene.
const WORD_PREFIX: &str = "word:";
/// The most characters of a word. Each character then has 4 of the camera's 32 pixels.
const MAX_WORD: usize = 8;
/// The name of a white sheet.
const WHITE: &str = "white";
/// The name of a covered lens.
const BLACK: &str = "black";
/// Approximate reflectance of white paper at 1550 nm.
const WHITE_REFLECTANCE: f32 = 0.9;

/// The source of a scene: `letter:R`, `word:STOP`, `white`, `black`, or the path of a PNG or JPEG.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum SceneSource {
    /// One bright character on a dark target.
    Letter(char),
    /// Bright characters side by side on a dark target that fills the field of view.
    Word(String),
    /// A sheet that fills the field of view, for self-tests.
    White,
    /// A covered lens without any light, for dark frames.
    Black,
    /// A PNG or JPEG. Its grey levels are reflectances.
    File(PathBuf),
}

/// A scene for the camera.
#[derive(Debug, Clone, PartialEq)]
pub struct SceneMap {
    /// The scene's name for titles and reports: `letter R`, or the file's name.
    pub name: String,
    /// Edge in pixels, at least 1.
    pub size_px: usize,
    /// `size_px * size_px` reflectances in `[0, 1]`, row-major.
    pub reflectance: Vec<f32>,
    /// Edge of the target in millimetres; `None` for a sheet or picture, which fills the field of
    /// view.
    pub side_mm: Option<f64>,
}

/// Why a scene cannot be made. `Display` is one line.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The name of the scene is empty.
    #[error(
        "scene: found nothing, expected letter:R, word:STOP, white, black or the path of a PNG or JPEG image"
    )]
    Empty,
    /// The number of characters after `letter:` is not 1.
    #[error(
        "scene {scene:?}: found {found} characters after `letter:`, expected one, as in letter:R"
    )]
    NotOneCharacter {
        /// The requested scene.
        scene: String,
        /// Its number of characters.
        found: usize,
    },
    /// The word after `word:` is empty, or too long for 32 pixels.
    #[error(
        "scene {scene:?}: found {found} characters after `word:`, expected 1 to {MAX_WORD}, as in word:STOP"
    )]
    WordLength {
        /// The requested scene.
        scene: String,
        /// Its number of characters.
        found: usize,
    },
    /// The scene has neither a prefix nor a file, and is probably a letter or word without its
    /// prefix.
    #[error("scene {scene:?}: no such file; a letter is letter:{first}, a word is word:{scene}")]
    NoFile {
        /// The requested scene.
        scene: String,
        /// Its first character.
        first: char,
    },
    /// The embedded font has no shape for this character.
    #[error(
        "scene letter:{}: the font has no shape for it, expected a letter, digit or sign",
        character.escape_debug()
    )]
    NoShape {
        /// The character.
        character: char,
    },
    /// The picture could not be read.
    #[error(transparent)]
    File(#[from] FileError),
}

impl FromStr for SceneSource {
    type Err = SceneError;

    fn from_str(scene: &str) -> Result<Self, SceneError> {
        if scene.is_empty() {
            return Err(SceneError::Empty);
        }
        if scene == WHITE {
            return Ok(Self::White);
        }
        if scene == BLACK {
            return Ok(Self::Black);
        }
        if let Some(word) = scene.strip_prefix(WORD_PREFIX) {
            let found = word.chars().count();
            if !(1..=MAX_WORD).contains(&found) {
                return Err(SceneError::WordLength { scene: scene.to_owned(), found });
            }
            let typeface = Typeface::ubuntu_light();
            return match word.chars().find(|&character| !typeface.has_shape(character)) {
                None => Ok(Self::Word(word.to_owned())),
                Some(character) => Err(SceneError::NoShape { character }),
            };
        }
        let Some(text) = scene.strip_prefix(LETTER_PREFIX) else {
            let is_word = scene.len() <= MAX_WORD && scene.chars().all(char::is_alphanumeric);
            return match scene.chars().next() {
                Some(first) if is_word && !Path::new(scene).exists() => {
                    Err(SceneError::NoFile { scene: scene.to_owned(), first })
                }
                _ => Ok(Self::File(scene.into())),
            };
        };
        let mut characters = text.chars();
        match (characters.next(), characters.next()) {
            (Some(character), None) if Typeface::ubuntu_light().has_shape(character) => {
                Ok(Self::Letter(character))
            }
            (Some(character), None) => Err(SceneError::NoShape { character }),
            _ => Err(SceneError::NotOneCharacter {
                scene: scene.to_owned(),
                found: text.chars().count(),
            }),
        }
    }
}

impl fmt::Display for SceneSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Letter(character) => write!(f, "{LETTER_PREFIX}{character}"),
            Self::Word(word) => write!(f, "{WORD_PREFIX}{word}"),
            Self::White => f.write_str(WHITE),
            Self::Black => f.write_str(BLACK),
            Self::File(path) => write!(f, "{}", path.display()),
        }
    }
}

impl SceneSource {
    /// Draws or reads the scene. A letter has `size_px` pixels an edge. A larger picture is
    /// averaged down to `size_px`; a smaller picture keeps its size.
    ///
    /// # Errors
    /// [`SceneError`] if the font lacks the character or the file cannot be read.
    pub fn load(&self, size_px: usize) -> Result<SceneMap, SceneError> {
        match self {
            Self::Letter(character) => {
                SceneMap::letter(&Typeface::ubuntu_light(), *character, size_px)
            }
            Self::Word(word) => {
                let name = format!("word {word}");
                Ok(SceneMap { name, size_px, reflectance: drawn(word, size_px)?, side_mm: None })
            }
            Self::White | Self::Black => {
                let level = if *self == Self::White { WHITE_REFLECTANCE } else { 0.0 };
                let reflectance = vec![level; size_px * size_px];
                Ok(SceneMap { name: self.to_string(), size_px, reflectance, side_mm: None })
            }
            Self::File(path) => {
                let Reflectance { size_px, values: reflectance } =
                    shrink(read_reflectance(path)?, size_px);
                let name =
                    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
                Ok(SceneMap { name, size_px, reflectance, side_mm: None })
            }
        }
    }
}

/// Characters side by side, each in its own square, at half height.
fn drawn(word: &str, size_px: usize) -> Result<Vec<f32>, SceneError> {
    let typeface = Typeface::ubuntu_light();
    let cell_px = size_px / word.chars().count().max(1);
    let top = (size_px - cell_px) / 2;
    let mut map = vec![0.0; size_px * size_px];
    for (at, character) in word.chars().enumerate() {
        let glyph = typeface
            .draw(character, cell_px, GLYPH_FILL)
            .ok_or(SceneError::NoShape { character })?;
        for (row, pixels) in glyph.chunks_exact(cell_px).enumerate() {
            let start = (top + row) * size_px + at * cell_px;
            map[start..start + cell_px].copy_from_slice(pixels);
        }
    }
    Ok(map)
}

impl SceneMap {
    /// The name with a capital letter at its start.
    #[must_use]
    pub fn title(&self) -> String {
        let mut letters = self.name.chars();
        let first = letters.next().into_iter().flat_map(char::to_uppercase);
        first.chain(letters).collect()
    }

    /// One bright character of a typeface on the dark target of [`LETTER_SIDE_MM`]. The character's
    /// longer side takes 0.9 of the target's edge.
    ///
    /// # Errors
    /// [`SceneError::NoShape`] if the typeface lacks the character.
    pub fn letter(
        typeface: &Typeface,
        character: char,
        size_px: usize,
    ) -> Result<Self, SceneError> {
        let reflectance = typeface
            .draw(character, size_px, GLYPH_FILL)
            .ok_or(SceneError::NoShape { character })?;
        let name = format!("letter {character}");
        Ok(Self { name, size_px, reflectance, side_mm: Some(LETTER_SIDE_MM) })
    }
}

/// Averages a picture down to `size_px`.
fn shrink(map: Reflectance, size_px: usize) -> Reflectance {
    if map.size_px <= size_px {
        return map;
    }
    let [edge, size] = [map.size_px as u32, size_px as u32];
    let values = resample(&map.values, (edge, edge), (size, size), Filter::Triangle);
    Reflectance { size_px, values: values.into_iter().map(|v| v.clamp(0.0, 1.0)).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::image::encode_grey;
    use crate::testing::provenance;

    fn line(scene: &str) -> String {
        let line = scene.parse::<SceneSource>().unwrap_err().to_string();
        assert!(!line.contains('\n'), "{line:?}");
        line
    }

    #[test]
    fn a_letter_is_a_43_mm_target_bright_on_dark() {
        let scene = "letter:R".parse::<SceneSource>().unwrap();
        assert_eq!((&scene, scene.to_string().as_str()), (&SceneSource::Letter('R'), "letter:R"));
        let sheet = "white".parse::<SceneSource>().unwrap();
        assert_eq!((&sheet, sheet.to_string().as_str()), (&SceneSource::White, "white"));
        let map = scene.load(64).unwrap();
        assert_eq!((map.name.as_str(), map.size_px, map.side_mm), ("letter R", 64, Some(43.0)));
        assert_eq!(map.reflectance.len(), 64 * 64);
        // R has a stem on the left, open ground on the right below the bowl, and dark corners.
        let at = |x: usize, y: usize| map.reflectance[y * 64 + x];
        assert!(at(20, 32) == 1.0 && at(60, 40) == 0.0);
        assert!([at(0, 0), at(63, 0), at(0, 63), at(63, 63)] == [0.0; 4]);
    }

    #[test]
    fn a_word_is_its_letters_side_by_side() {
        let scene = "word:IO".parse::<SceneSource>().unwrap();
        assert_eq!(scene.to_string(), "word:IO");
        let map = scene.load(64).unwrap();
        let at = |x: usize, y: usize| map.reflectance[y * 64 + x];
        // I has its stem in the middle of the left half; O is open in the middle of the right half.
        assert!(at(15, 32) == 1.0 && at(48, 32) == 0.0 && at(37, 32) > 0.0);
        assert!((0..64).all(|x| at(x, 10) == 0.0 && at(x, 54) == 0.0));
        assert!(line("word:").contains("found 0 characters after `word:`, expected 1 to 8"));
        assert!(line("word:NINELETTR").contains("found 9 characters"));
        assert!(line("word:A B").contains("no shape"));
        assert_eq!(line("R"), "scene \"R\": no such file; a letter is letter:R, a word is word:R");
    }

    #[test]
    fn scenes_that_do_not_exist_get_a_line() {
        assert_eq!(
            line(""),
            "scene: found nothing, expected letter:R, word:STOP, white, black or the path of a PNG or JPEG image"
        );
        assert_eq!(
            line("letter:"),
            "scene \"letter:\": found 0 characters after `letter:`, expected one, as in letter:R"
        );
        assert_eq!(
            line("letter:A\nB"),
            "scene \"letter:A\\nB\": \
             found 3 characters after `letter:`, expected one, as in letter:R"
        );
        assert_eq!(
            line("letter:漢"),
            "scene letter:漢: the font has no shape for it, expected a letter, digit or sign"
        );
        assert!(line("letter: ").contains("no shape"));
        let error = "none.png".parse::<SceneSource>().unwrap().load(64).unwrap_err();
        assert_eq!(error.to_string(), "none.png: cannot read it: no such file or folder");
    }

    #[test]
    fn a_large_picture_is_averaged_down_and_a_small_one_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("stripes.png");
        // Stripes of one pixel are too fine for 8 pixels, so they must become grey instead of false
        // bands.
        let stripes: Vec<f32> = (0..64 * 64).map(|at| (at % 2) as f32).collect();
        std::fs::write(&path, encode_grey(64, 64, &stripes, &provenance())).unwrap();
        let scene = path.to_str().unwrap().parse::<SceneSource>().unwrap();
        let small = scene.load(8).unwrap();
        assert_eq!((small.name.as_str(), small.size_px, small.side_mm), ("stripes.png", 8, None));
        assert!(
            small.reflectance.iter().all(|value| (value - 0.5).abs() < 0.07),
            "{:?}",
            small.reflectance
        );
        let kept = scene.load(256).unwrap();
        assert_eq!((kept.size_px, kept.reflectance), (64, stripes));
    }
}

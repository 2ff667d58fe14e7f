//! Reads a camera description by the name of a shipped camera, or from a TOML file.

use nirspi::files::read_small_text;
use nirspi_optics::{CameraModel, CameraModelError};
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a camera description cannot be read. `Display` is one line.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CameraFileError {
    /// The name is neither the name of a shipped camera nor the path of a file.
    #[error("camera description {0}: found no such file, expected {expected} or a TOML file", expected = names())]
    Unknown(String),
    /// The file cannot be read.
    #[error("{path}: cannot be read as a camera description")]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The file is not a valid camera description.
    #[error("{path}: {problem}")]
    Content {
        /// The file.
        path: PathBuf,
        /// The problem of its content.
        problem: CameraModelError,
    },
}

fn names() -> String {
    CameraModel::names().collect::<Vec<_>>().join(", ")
}

/// The shipped camera of this name; without one, the camera of the file at this path.
///
/// # Errors
/// [`CameraFileError`] if neither exists, or the file is not a valid camera description.
pub fn read_camera_model(name_or_file: &str) -> Result<CameraModel, CameraFileError> {
    if let Some(camera) = CameraModel::named(name_or_file) {
        return Ok(camera);
    }
    let path = Path::new(name_or_file);
    let text = read_small_text(path).map_err(|source| match source.kind() {
        io::ErrorKind::NotFound => CameraFileError::Unknown(name_or_file.to_owned()),
        _ => CameraFileError::Read { path: path.to_owned(), source },
    })?;
    let content = |problem| CameraFileError::Content { path: path.to_owned(), problem };
    CameraModel::parse(&text).map_err(content)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_a_file_and_neither() {
        assert_eq!(read_camera_model("fga015").unwrap().name, "fga015");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lab.toml");
        std::fs::write(&path, "name = \"lab\"\n[leds]\npower_mw = 2").unwrap();
        let lab = read_camera_model(path.to_str().unwrap()).unwrap();
        assert_eq!((lab.name.as_str(), lab.leds.power_mw), ("lab", 2.0));
        std::fs::write(&path, "[leds]\npower_mw = -2").unwrap();
        let error = read_camera_model(path.to_str().unwrap()).unwrap_err().to_string();
        assert!(
            error
                .ends_with("lab.toml: leds.power_mw is -2.0, expected a number from 0.001 to 1000"),
            "{error}"
        );
        let error = read_camera_model("one-meter").unwrap_err().to_string();
        assert!(error.contains(
            "one-meter: found no such file, expected paper, fga015, one-metre or a TOML file"
        ));
        let folder = folder.path().to_str().unwrap();
        assert!(matches!(read_camera_model(folder), Err(CameraFileError::Read { .. })));
    }
}

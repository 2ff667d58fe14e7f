//! Reads weather by name, or from a file of counted drops.

use nirspi::files::FileError;
use nirspi::files::table::Table;
use nirspi_optics::rain::{Air, AirError, DropClass, Drops, RainError};
use std::path::Path;
use thiserror::Error;

/// Why the weather cannot be read. `Display` is one line.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum WeatherError {
    /// The text does not name a weather.
    #[error("{0}{file}", file = or_a_file(.0))]
    Text(#[from] AirError),
    /// The file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The drops of the file are not physical.
    #[error("{file}: {problem}")]
    Drops {
        /// The file.
        file: String,
        /// The problem.
        problem: RainError,
    },
}

fn or_a_file(error: &AirError) -> &'static str {
    if matches!(error, AirError::Unknown { .. }) { ", or a .csv file" } else { "" }
}

/// Counted drops: a CSV file of diameters in mm and drops per cubic metre.
///
/// # Errors
/// [`WeatherError`] for a file that cannot be read or is not a file of drops.
pub fn read_drops(path: &Path) -> Result<Drops, WeatherError> {
    let pairs = Table::read(path)?.pairs("diameter in mm, drops per m3")?;
    let class = |[diameter_mm, per_m3]: [f64; 2]| DropClass { diameter_mm, per_m3 };
    Drops::measured(pairs.into_iter().map(class).collect())
        .map_err(|problem| WeatherError::Drops { file: path.display().to_string(), problem })
}

/// Whether a text names a file of drops.
#[must_use]
pub fn is_drop_file(text: &str) -> bool {
    !text.contains(':') && text.to_ascii_lowercase().ends_with(".csv")
}

/// The weather that a user names: a text for [`Air`], or a CSV file of drops. `+window:...` may
/// follow either.
///
/// # Errors
/// [`WeatherError`] for text that does not name a weather.
pub fn read_weather(text: &str) -> Result<Air, WeatherError> {
    let (first, window) = match text.rsplit_once('+') {
        Some((first, window)) => (first, Some(window)),
        None => (text, None),
    };
    if !is_drop_file(first) {
        return Ok(text.parse()?);
    }
    let air = Air::of_drops(first.to_owned(), read_drops(Path::new(first))?);
    match window {
        Some(window) => Ok(air.and_window(window)?),
        None => Ok(air),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weather_comes_by_name_or_from_a_file_with_drops_on_the_window_or_without() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rain.csv");
        std::fs::write(&path, "1,100\n2,10\n").unwrap();
        let name = path.to_str().unwrap();
        let air = read_weather(name).unwrap();
        assert_eq!((air.name(), air.drops().classes().len()), (name, 2));
        let behind = read_weather(&format!("{name}+window:0.2")).unwrap();
        assert_eq!(behind.drops(), air.drops());
        assert_ne!(behind, air);
        assert_eq!(read_weather("fog:5m+window:0.2").unwrap().name(), "fog:5m+window:0.2");

        std::fs::write(&path, "1,-3\n").unwrap();
        let error = read_weather(name).unwrap_err().to_string();
        assert!(error.contains("rain.csv: rain: drops per m3 is -3"), "{error}");
        let error = read_weather("hail").unwrap_err().to_string();
        assert!(error.ends_with(", or a .csv file") && error.starts_with("found hail"), "{error}");
        assert!(read_weather("none.csv").is_err());
    }
}

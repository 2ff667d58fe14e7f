//! A recording in several files: when the next one begins, and how the files are called.
//!
//! # Invariant
//! Each file of a run is a whole recording, which begins directly after a frame that arrived in
//! order, with the next frame or a damaged packet. So a gap in the frames, and the damaged packets in
//! the gap, are in the same file, and the files together have each frame once (`host/tests/split.rs`).

use serde::{Deserialize, Serialize};
use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;
use thiserror::Error;

/// The smallest file: smaller ones would hold little but the setup of the measurement.
const LEAST_BYTES: u64 = 1_000_000;
/// The largest size, a thousand terabytes.
const MOST_BYTES: u64 = 1_000_000_000_000_000;
/// The shortest time.
const LEAST_TIME: Duration = Duration::from_secs(1);
/// The longest time, about three years.
const MOST_TIME: Duration = Duration::from_secs(100_000_000);
/// Room in a file for its end, and for what arrives while the next file is made: an eighth of the file,
/// but not more than this.
const MOST_RESERVED: u64 = 8_000_000;
/// The highest first frame that is read. The camera makes fewer frames in its life.
const MOST_FRAMES: u64 = 1 << 62;

/// When a recording goes on in the next file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Split {
    /// Before the file is larger than this number of bytes.
    Size(u64),
    /// After this time of the computer's clock.
    Time(Duration),
}

/// Why a text is not a size or a time for a split.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum SplitError {
    /// Another form.
    #[error("expected a size such as 500MB or 2GB, or a time such as 90s, 10min or 1h")]
    Form,
    /// The size is too small or too large.
    #[error("expected a size from 1MB to 1000TB")]
    Size,
    /// The time is too short or too long.
    #[error("expected a time from 1s to 27777h")]
    Time,
}

impl FromStr for Split {
    type Err = SplitError;

    fn from_str(text: &str) -> Result<Self, SplitError> {
        let text = text.trim();
        let unit = text.find(|c: char| c.is_ascii_alphabetic()).ok_or(SplitError::Form)?;
        let (number, unit) = text.split_at(unit);
        let number: f64 = number.trim_end().parse().map_err(|_| SplitError::Form)?;
        let bytes = match unit.to_ascii_lowercase().as_str() {
            "kb" => 1e3,
            "mb" => 1e6,
            "gb" => 1e9,
            "tb" => 1e12,
            "kib" => 1024.0,
            "mib" => 1024.0 * 1024.0,
            "gib" => 1024.0 * 1024.0 * 1024.0,
            "tib" => 1024.0 * 1024.0 * 1024.0 * 1024.0,
            _ => 0.0,
        };
        if bytes > 0.0 {
            let size = number * bytes;
            let fits = (LEAST_BYTES as f64..=MOST_BYTES as f64).contains(&size);
            return fits.then_some(Self::Size(size as u64)).ok_or(SplitError::Size);
        }
        let seconds = match unit {
            "s" => number,
            "min" => number * 60.0,
            "h" => number * 3600.0,
            _ => return Err(SplitError::Form),
        };
        let fits = (LEAST_TIME.as_secs_f64()..=MOST_TIME.as_secs_f64()).contains(&seconds);
        if !fits {
            return Err(SplitError::Time);
        }
        Ok(Self::Time(Duration::from_secs_f64(seconds)))
    }
}

impl Split {
    /// Whether a file of this size and age is to be followed by the next one.
    pub(crate) fn is_due(self, bytes: u64, age: Duration) -> bool {
        match self {
            Self::Size(most) => bytes >= most - (most / 8).min(MOST_RESERVED),
            Self::Time(most) => age >= most,
        }
    }
}

/// The place of a file in a run that was recorded into several files.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Part {
    /// Number of the file, from 1 on.
    pub number: u32,
    /// Number of the file's first frame in the run.
    pub first_frame: u64,
    /// Name of the file with the frames before; `null` for the first file.
    pub follows: Option<String>,
}

impl Part {
    /// Checks a part of a file that may be damaged.
    pub(super) fn check(&self) -> Result<(), String> {
        match self {
            Self { number: 0, .. } => Err("it is file 0, expected 1 or more".to_owned()),
            Self { first_frame: MOST_FRAMES.., .. } => {
                Err("its first frame is too high".to_owned())
            }
            _ => Ok(()),
        }
    }
}

/// The name of a file for people and for other files.
pub(crate) fn name_of(path: &Path) -> String {
    path.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// `NAME-0003.mcap` of `NAME.mcap`.
pub(crate) fn part_path(whole: &Path, number: u32) -> PathBuf {
    let mut name = OsString::from(whole.file_stem().unwrap_or_default());
    name.push(format!("-{number:04}"));
    if let Some(extension) = whole.extension() {
        name.push(".");
        name.push(extension);
    }
    whole.with_file_name(name)
}

/// A file that has the name of any part of `whole`.
///
/// # Errors
/// If the folder cannot be read.
pub(super) fn taken_part(whole: &Path) -> io::Result<Option<PathBuf>> {
    let folder = match whole.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let before = whole.file_stem().unwrap_or_default().to_string_lossy().into_owned() + "-";
    let mut taken = Vec::new();
    for entry in fs::read_dir(folder)? {
        let path = whole.with_file_name(entry?.file_name());
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let number = stem.strip_prefix(&before).unwrap_or_default();
        let is_number = number.len() >= 4 && number.bytes().all(|byte| byte.is_ascii_digit());
        if is_number && path.extension() == whole.extension() {
            taken.push(path);
        }
    }
    Ok(taken.into_iter().min())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_size_or_a_time_is_read_with_its_unit() {
        let size = |text: &str| text.parse::<Split>();
        assert_eq!(size("1GB"), Ok(Split::Size(1_000_000_000)));
        assert_eq!(size(" 1.5 gb "), Ok(Split::Size(1_500_000_000)));
        assert_eq!(size("4GiB"), Ok(Split::Size(4 << 30)));
        assert_eq!(size("1000kB"), Ok(Split::Size(1_000_000)));
        assert_eq!(size("90s"), Ok(Split::Time(Duration::from_secs(90))));
        assert_eq!(size("10min"), Ok(Split::Time(Duration::from_secs(600))));
        assert_eq!(size("0.5h"), Ok(Split::Time(Duration::from_secs(1800))));
    }

    #[test]
    fn anything_else_is_one_line_with_what_is_expected() {
        let problem = |text: &str| text.parse::<Split>().unwrap_err();
        for text in [
            "",
            "GB",
            "10",
            "1e9",
            "10m",
            "10M",
            "1G",
            "10 minutes",
            "x10s",
            "1GBs",
            "1,5GB",
            "10S",
        ] {
            assert_eq!(problem(text), SplitError::Form, "{text}");
        }
        for text in ["999kB", "-1GB", "0MB", "1001TB", "NaN MB", "infGB"] {
            assert!(matches!(problem(text), SplitError::Size | SplitError::Form), "{text}");
        }
        for text in ["0.9s", "-10min", "0h", "28000h"] {
            assert_eq!(problem(text), SplitError::Time, "{text}");
        }
        for problem in [SplitError::Form, SplitError::Size, SplitError::Time] {
            assert!(problem.to_string().starts_with("expected "), "{problem}");
        }
    }

    #[test]
    fn a_file_is_followed_before_it_is_larger_and_not_before_its_time_is_over() {
        let now = Duration::ZERO;
        let size = Split::Size(4_000_000_000);
        assert!(!size.is_due(3_991_999_999, now) && size.is_due(3_992_000_000, now));
        let size = Split::Size(1_000_000);
        assert!(!size.is_due(874_999, now) && size.is_due(875_000, now));
        let time = Split::Time(Duration::from_secs(60));
        assert!(!time.is_due(u64::MAX, Duration::from_millis(59_999)));
        assert!(time.is_due(0, Duration::from_secs(60)));
    }

    #[test]
    fn the_names_of_a_run_are_numbered_and_any_of_them_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let whole = folder.path().join("rec.v2.mcap");
        assert_eq!(part_path(&whole, 12), folder.path().join("rec.v2-0012.mcap"));
        assert_eq!(part_path(Path::new("rec"), 12_345), Path::new("rec-12345"));
        let others = [
            "rec.v2.mcap",
            "rec.v2-1.mcap",
            "rec.v2-0001.npz",
            "rec.v2-000x.mcap",
            "arec.v2-0001.mcap",
        ];
        others.iter().for_each(|name| fs::write(folder.path().join(name), b"").unwrap());
        assert_eq!(taken_part(&whole).unwrap(), None);
        for name in ["rec.v2-0107.mcap", "rec.v2-0007.mcap"] {
            fs::write(folder.path().join(name), b"").unwrap();
            assert_eq!(taken_part(&whole).unwrap(), Some(folder.path().join(name)));
        }
        assert!(taken_part(&folder.path().join("gone/rec.mcap")).is_err());
    }

    #[test]
    fn a_damaged_part_is_refused() {
        let part = |number, first_frame| Part { number, first_frame, follows: None };
        assert_eq!(part(1, 0).check(), Ok(()));
        assert_eq!(part(7, MOST_FRAMES - 1).check(), Ok(()));
        assert!(part(0, 0).check().is_err() && part(7, MOST_FRAMES).check().is_err());
    }
}

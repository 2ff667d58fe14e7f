//! How much light a measurement takes: a time of light, and the frames and sweeps that make it up.
//!
//! # Invariant
//! The time of light does not depend on the share of the patterns, and frames come no faster than
//! the boards' port carries them (`tests::light_is_the_same_at_every_share_and_no_frame_is_too_fast`).

use crate::setup::MeasurementSetup;
use nirspi_recon::words::{count, count_of};
use nirspi_wire::{ADC_HZ, PATTERNS};
use serde::Serialize;
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// The longest time of light: one hour.
const MOST_MS: f64 = 3.6e6;
/// The shortest time of a frame that the boards' port carries, in microseconds. The slowest packet,
/// of 1024 patterns, takes 206 us (`docs/log/firmware.md`, Throughput).
const SHORTEST_FRAME_US: u64 = 220;

/// A time of light: how long the patterns of a measurement are shown in all.
///
/// People write a time of light with its unit: `20ms`, `20 ms`, `0.5s`.
///
/// ```
/// use nirspi_camera::exposure::Light;
///
/// assert_eq!("0.02 s".parse::<Light>()?.ms(), "20ms".parse::<Light>()?.ms());
/// # Ok::<(), nirspi_camera::exposure::LightError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, PartialOrd, Serialize)]
pub struct Light(f64);

/// Why there is no measurement with this light.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum LightError {
    /// The text is no time.
    #[error("expected a time of light with its unit, such as 20ms or 0.5s")]
    Form,
    /// The number has no unit.
    #[error("the unit is missing: write {found}ms or {found}s")]
    NoUnit {
        /// The number.
        found: String,
    },
    /// The time is not positive, or longer than an hour.
    #[error("expected more than 0 and at most 3600s")]
    Range,
    /// The time is shorter than half of a sweep.
    #[error("{light} of light is less than one sweep of {}, which takes {sweep_ms:.3} ms", count_of(*patterns, "pattern"))]
    Short {
        /// The time.
        light: Light,
        /// The number of patterns of a sweep.
        patterns: usize,
        /// The time of a sweep in milliseconds.
        sweep_ms: f64,
    },
    /// More frames than a run can have.
    #[error(
        "{light} of light is {frames} frames, expected at most {}: sum more sweeps into a frame",
        u32::MAX
    )]
    Long {
        /// The time.
        light: Light,
        /// The number of frames.
        frames: u64,
    },
}

impl Light {
    /// This time of light in milliseconds.
    ///
    /// # Errors
    /// [`LightError::Range`] for a time that is not positive, or longer than an hour.
    pub fn from_ms(ms: f64) -> Result<Self, LightError> {
        if ms > 0.0 && ms <= MOST_MS { Ok(Self(ms)) } else { Err(LightError::Range) }
    }

    /// The time in milliseconds.
    #[must_use]
    pub fn ms(self) -> f64 {
        self.0
    }

    /// The light of so many differential sweeps of all patterns, each of which is shown for so many
    /// ADC clocks.
    ///
    /// # Errors
    /// [`LightError::Range`] for no light, and for more than an hour.
    pub fn of_full_sweeps(sweeps: u32, clocks_per_pattern: u16) -> Result<Self, LightError> {
        let clocks = 2.0 * f64::from(PATTERNS) * f64::from(clocks_per_pattern);
        Self::from_ms(f64::from(sweeps) * clocks * 1e3 / f64::from(ADC_HZ))
    }
}

impl FromStr for Light {
    type Err = LightError;

    fn from_str(text: &str) -> Result<Self, LightError> {
        let text = text.trim();
        let (number, unit_ms) = match text.strip_suffix("ms") {
            Some(number) => (number, Some(1.0)),
            None => match text.strip_suffix('s') {
                Some(number) => (number, Some(1e3)),
                None => (text, None),
            },
        };
        let number = number.trim_end();
        let value: f64 = number.parse().map_err(|_| LightError::Form)?;
        if !(value > 0.0 && value.is_finite()) {
            return Err(LightError::Range);
        }
        let unit_ms = unit_ms.ok_or_else(|| LightError::NoUnit { found: number.to_owned() })?;
        Self::from_ms(value * unit_ms)
    }
}

impl fmt::Display for Light {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            ms if ms < 1e3 => write!(f, "{ms}ms"),
            ms => write!(f, "{}s", ms / 1e3),
        }
    }
}

/// How long a measurement goes on, as a user says it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Length {
    /// This time of light, in frames of so many sweeps; without a number of sweeps, in frames that
    /// the boards' port carries.
    Light(Light, Option<u32>),
    /// This number of frames of so many sweeps; without a number of sweeps, a frame is about as long
    /// as a sweep of all patterns.
    Frames(u32, Option<u32>),
}

impl fmt::Display for Length {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let sweeps = match self {
            Self::Light(light, sweeps) => {
                write!(f, "{light} of light")?;
                sweeps
            }
            Self::Frames(frames, sweeps) => {
                write!(f, "{}", count(*frames, "frame"))?;
                sweeps
            }
        };
        match sweeps {
            Some(sweeps) => write!(f, " in frames of {}", count(*sweeps, "sweep")),
            None => Ok(()),
        }
    }
}

/// The frames and sweeps of a measurement.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Exposure {
    /// Number of frames.
    pub frames: u32,
    /// Number of sweeps summed into each frame.
    pub sweeps: u32,
}

impl Exposure {
    /// The frames and sweeps of a measurement with this setup, whose own sweeps are ignored.
    ///
    /// # Errors
    /// [`LightError`] for light of less than one sweep, or of too many frames.
    pub fn of(length: Length, setup: &MeasurementSetup) -> Result<Self, LightError> {
        match length {
            Length::Frames(frames, sweeps) => {
                let sweeps = sweeps.unwrap_or_else(|| setup.sweeps_as_long_as_all());
                Ok(Self { frames, sweeps })
            }
            Length::Light(light, sweeps) => Self::of_light(light, sweeps, setup),
        }
    }

    fn of_light(
        light: Light,
        sweeps: Option<u32>,
        setup: &MeasurementSetup,
    ) -> Result<Self, LightError> {
        let sweep_ms = sweep_ms(setup);
        let all = (light.ms() / sweep_ms).round() as u64;
        if all == 0 {
            let patterns = setup.rows.len();
            return Err(LightError::Short { light, patterns, sweep_ms });
        }
        let long = |frames: u64| LightError::Long { light, frames };
        let (frames, sweeps) = match sweeps {
            Some(sweeps) => ((all as f64 / f64::from(sweeps)).round().max(1.0) as u64, sweeps),
            None => {
                let shortest = SHORTEST_FRAME_US * u64::from(ADC_HZ / 1_000_000);
                let least = shortest.div_ceil(setup.sweep_clocks()).max(1);
                let (frames, sweeps) = split(all, (all / least).max(1));
                // A frame is no longer than the light, which is at most an hour.
                (frames, u32::try_from(sweeps).map_err(|_| long(frames))?)
            }
        };
        Ok(Self { frames: u32::try_from(frames).map_err(|_| long(frames))?, sweeps })
    }

    /// The time of light with this setup, whose own sweeps are ignored, in milliseconds.
    #[must_use]
    pub fn light_ms(&self, setup: &MeasurementSetup) -> f64 {
        sweep_ms(setup) * f64::from(self.sweeps) * f64::from(self.frames)
    }
}

/// The time of one sweep in milliseconds.
fn sweep_ms(setup: &MeasurementSetup) -> f64 {
    setup.sweep_clocks() as f64 * 1e3 / f64::from(ADC_HZ)
}

/// Frames of equal length that make up `all` sweeps: at most `most` frames and at least half as
/// many, as near to `all` as possible. Returns their number and the sweeps of each.
fn split(all: u64, most: u64) -> (u64, u64) {
    let each = |frames: u64| (all as f64 / frames as f64).round() as u64;
    let off = |frames: &u64| (frames * each(*frames)).abs_diff(all);
    // Of equally good numbers the largest comes first.
    let frames = (most.div_ceil(2)..=most).rev().min_by_key(off).unwrap_or(1);
    (frames, each(frames))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_recon::Order;

    fn setup(sampling: f64) -> MeasurementSetup {
        MeasurementSetup::new(&Order::CakeCutting, sampling).unwrap()
    }

    #[test]
    fn a_time_of_light_has_a_unit() {
        for (text, ms) in [("20ms", 20.0), ("20 ms", 20.0), ("0.02s", 20.0), (" 1e-1 s ", 100.0)] {
            assert!((text.parse::<Light>().unwrap().ms() - ms).abs() < 1e-9, "{text}");
        }
        assert_eq!("2000ms".parse::<Light>().unwrap().to_string(), "2s");
        for (text, words) in [
            ("20", "write 20ms or 20s"),
            ("0", "more than 0"),
            ("0ms", "more than 0"),
            ("-5ms", "more than 0"),
            ("-5", "more than 0"),
            ("nan", "more than 0"),
            ("inf s", "more than 0"),
            ("2h", "such as 20ms or 0.5s"),
            ("", "such as 20ms or 0.5s"),
            ("ms", "such as 20ms or 0.5s"),
            ("3601s", "at most 3600s"),
        ] {
            let error = text.parse::<Light>().unwrap_err().to_string();
            assert!(error.contains(words) && error.lines().count() == 1, "{text}: {error}");
        }
    }

    #[test]
    fn light_is_the_same_at_every_share_and_no_frame_is_too_fast() {
        for percent in [1, 2, 5, 7, 10, 25, 30, 50, 99, 100] {
            let setup = setup(f64::from(percent) / 100.0);
            for ms in [1.0, 20.0, 98.0, 1000.0] {
                let light = Light::from_ms(ms).unwrap();
                let found = Exposure::of(Length::Light(light, None), &setup).unwrap();
                let off = found.light_ms(&setup) / ms - 1.0;
                assert!(off.abs() < 0.005 || ms < 2.0 && off.abs() < 0.05, "{percent} %: {off}");
                let frame_us =
                    MeasurementSetup { sweeps: found.sweeps, ..setup.clone() }.frame_ns() / 1e3;
                assert!((220.0..700.0).contains(&frame_us), "{percent} %, {ms} ms: {frame_us} us");
            }
        }
        let paper = Light::of_full_sweeps(244, 5).unwrap();
        assert!((paper.ms() - 19.98848).abs() < 1e-9);
        for (share, sweeps) in [(1.0, 4), (0.5, 8)] {
            let found = Exposure::of(Length::Light(paper, None), &setup(share)).unwrap();
            assert_eq!(found, Exposure { frames: 61, sweeps });
        }
    }

    #[test]
    fn a_frame_of_few_patterns_lasts_as_long_as_one_of_all() {
        for (percent, sweeps) in [(100, 1), (50, 2), (10, 10), (2, 51), (0, 1024)] {
            let setup = setup(f64::from(percent) / 100.0);
            assert_eq!(setup.sweeps_as_long_as_all(), sweeps, "{percent} %");
            let found = Exposure::of(Length::Frames(244, None), &setup).unwrap();
            assert_eq!(found, Exposure { frames: 244, sweeps });
            assert!((19.9..20.1).contains(&found.light_ms(&setup)), "{percent} %");
        }
        let named = Exposure::of(Length::Frames(7, Some(3)), &setup(0.02)).unwrap();
        assert_eq!(named, Exposure { frames: 7, sweeps: 3 });
    }

    #[test]
    fn a_named_number_of_sweeps_stays_and_light_of_no_sweep_is_refused() {
        let light = Light::from_ms(20.0).unwrap();
        let found = Exposure::of(Length::Light(light, Some(10)), &setup(0.5)).unwrap();
        assert_eq!(found, Exposure { frames: 49, sweeps: 10 });
        let short = Length::Light(Light::from_ms(0.01).unwrap(), None);
        let error = Exposure::of(short, &setup(0.5)).unwrap_err().to_string();
        assert!(error.contains("0.01ms of light") && error.contains("0.041 ms"), "{error}");
    }
}

//! The settings that a page can change while the camera runs, and the message that changes them.
//!
//! # Invariant
//! A change is applied whole, or refused whole with a one-line reason
//! (`tests::what_cannot_be_is_refused_in_one_line_that_names_it`).

use nirspi::setup::MeasurementSetup;
use nirspi_nets::deblur::Model;
use nirspi_recon::reconstruct::Method;
use nirspi_recon::words::count;
use nirspi_recon::{Order, RowsError, Sampling, Side};
use serde::{Deserialize, Serialize};
use std::fmt;
use thiserror::Error;

/// The most frames that one image can sum.
pub const MAX_FRAMES: u32 = 1024;
/// The most sweeps that a page can ask for in one frame: 0.3 s of light with all patterns.
pub const MAX_SWEEPS: u32 = 4096;
/// The word for the strength that predicts held-back measurements best.
const AUTO: &str = "auto";

/// How images are measured and made.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Settings {
    /// Name of the method of reconstruction.
    pub method: &'static str,
    /// Strength of the method's penalty; `None` is the strength that predicts held-back
    /// measurements best. Methods without a penalty ignore it.
    pub strength: Option<f64>,
    /// Whether each image starts from the images before: the recursive estimate. Methods without
    /// one ignore it.
    pub warm_start: bool,
    /// Whether the learned stages run.
    pub enhance: bool,
    /// Name of the network that deblurs.
    pub model: &'static str,
    /// Number of newest frames that are summed into one image.
    pub frames: u32,
    /// What the camera measures.
    #[serde(flatten)]
    pub measuring: Measuring,
    /// Whether the packets are recorded.
    pub record: bool,
}

/// The part of a measurement's setup that pages change.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Measuring {
    /// Name of the order of patterns.
    pub order: String,
    /// Share of the 1024 patterns that is shown, above 0 and at most 1.
    pub sampling: f64,
    /// Sweeps summed into one frame.
    pub sweeps: u32,
}

impl Measuring {
    /// What this setup measures.
    #[must_use]
    pub fn of(setup: &MeasurementSetup) -> Self {
        let sampling = setup.rows.len() as f64 / Side::INSTRUMENT.area() as f64;
        Self { order: setup.order.clone(), sampling, sweeps: setup.sweeps }
    }

    /// The setup for this measurement, with the timing of `base`.
    ///
    /// # Errors
    /// [`ChangeError::Order`] if no order has this name. The order of `base` needs no name.
    pub fn setup(&self, base: &MeasurementSetup) -> Result<MeasurementSetup, ChangeError> {
        let of_base = Self::of(base);
        if of_base.order == self.order && of_base.sampling == self.sampling {
            return Ok(MeasurementSetup { sweeps: self.sweeps, ..base.clone() });
        }
        let order: Order = self.order.parse().map_err(|_| self.unknown_order())?;
        let named = MeasurementSetup::new(&order, self.sampling);
        let MeasurementSetup { order, rows, .. } =
            named.map_err(|_: RowsError| self.unknown_order())?;
        Ok(MeasurementSetup { order, rows, sweeps: self.sweeps, ..base.clone() })
    }

    fn unknown_order(&self) -> ChangeError {
        ChangeError::Order { found: self.order.clone() }
    }
}

/// The values that settings can have.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Offer {
    /// Names of the methods.
    pub methods: Vec<&'static str>,
    /// What each method does, in one line; empty for a method that is not built in.
    pub about: Vec<&'static str>,
    /// The methods that have a strength.
    pub with_strength: Vec<&'static str>,
    /// The methods whose images can start from the images before.
    pub with_warm_start: Vec<&'static str>,
    /// Names of the networks that deblur.
    pub models: Vec<&'static str>,
    /// Whether the server was given a folder for recordings.
    pub records: bool,
    /// Whether the patterns are fixed: those of a feed.
    pub fixed: bool,
    /// The setup of the command line, whose order can always be shown.
    #[serde(skip)]
    pub base: Option<MeasurementSetup>,
}

/// A change that a page asks for. Fields that are left out keep their values.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Change {
    /// Another method of reconstruction.
    pub method: Option<String>,
    /// Another strength: a number above 0, or `auto`.
    pub strength: Option<StrengthWish>,
    /// Whether each image starts from the images before.
    pub warm_start: Option<bool>,
    /// Switches the learned stages on or off.
    pub enhance: Option<bool>,
    /// Another network that deblurs.
    pub model: Option<String>,
    /// Another number of frames.
    pub frames: Option<u32>,
    /// Another order of patterns. The run starts again.
    pub order: Option<String>,
    /// Another share of the patterns. The run starts again. Without `sweeps`, the light of a frame
    /// stays the same.
    pub sampling: Option<f64>,
    /// Another number of sweeps in one frame. The run starts again.
    pub sweeps: Option<u32>,
    /// Begins or ends a recording. The run starts again.
    pub record: Option<bool>,
    /// Switches the LEDs on (and measures) or off. Of two changes the later one counts.
    #[serde(alias = "resume")]
    pub run: Option<bool>,
}

/// A strength in a message.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum StrengthWish {
    /// This strength.
    Number(f64),
    /// The word `auto`.
    Word(String),
}

/// Why a change is refused.
#[derive(Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum ChangeError {
    /// The method does not exist.
    #[error("method is {found:?}, expected {}", alternatives(.offered))]
    Method {
        /// The requested method.
        found: String,
        /// The methods that exist.
        offered: Vec<&'static str>,
    },
    /// The strength is not a positive number.
    #[error("strength is {found}, expected a number above 0, or \"auto\"")]
    Strength {
        /// The requested strength.
        found: String,
    },
    /// The network does not exist.
    #[error("model is {found:?}, expected {}", alternatives(.offered))]
    Model {
        /// The requested network.
        found: String,
        /// The networks that exist.
        offered: Vec<&'static str>,
    },
    /// The number of frames is 0 or too large.
    #[error("frames is {found}, expected 1 to {MAX_FRAMES}")]
    Frames {
        /// The requested number.
        found: u32,
    },
    /// No order has this name.
    #[error("order is {found:?}, expected {}", Order::expected())]
    Order {
        /// The requested order.
        found: String,
    },
    /// The share of patterns is out of range.
    #[error("sampling is {found}, expected a number above 0 and at most 1")]
    Sampling {
        /// The requested share.
        found: f64,
    },
    /// The number of sweeps is 0 or too large.
    #[error("sweeps is {found}, expected 1 to {MAX_SWEEPS}")]
    Sweeps {
        /// The requested number.
        found: u32,
    },
    /// The patterns are those of a feed.
    #[error("{0}: the patterns are those of the feed, expected no order, sampling or sweeps")]
    Fixed(&'static str),
    /// The server was given no folder for recordings.
    #[error(
        "record: this server was given no folder for recordings; start nirspi serve with --record-to FOLDER"
    )]
    NoFolder,
    /// The message does not have the form of a change.
    #[error("{0}, expected for example {{\"method\": \"tv\", \"enhance\": true, \"frames\": 64}}")]
    Form(String),
}

/// A list for an error message: `a, b or c`.
pub(super) fn alternatives(words: &[&str]) -> String {
    match words {
        [others @ .., last] if !others.is_empty() => format!("{} or {last}", others.join(", ")),
        words => words.concat(),
    }
}

/// The offered word that equals `found`.
fn known(offered: &[&'static str], found: &str) -> Option<&'static str> {
    offered.iter().find(|name| **name == found).copied()
}

impl Change {
    /// Parses a message.
    ///
    /// # Errors
    /// [`ChangeError::Form`] if the message is not JSON of a change.
    pub fn parse(json: &[u8]) -> Result<Self, ChangeError> {
        serde_json::from_slice(json).map_err(|error| ChangeError::Form(error.to_string()))
    }
}

impl StrengthWish {
    fn strength(&self) -> Result<Option<f64>, ChangeError> {
        match self {
            Self::Word(word) if word == AUTO => Ok(None),
            Self::Number(strength) if *strength > 0.0 && strength.is_finite() => {
                Ok(Some(*strength))
            }
            Self::Number(found) => Err(ChangeError::Strength { found: found.to_string() }),
            Self::Word(found) => Err(ChangeError::Strength { found: format!("{found:?}") }),
        }
    }
}

impl Settings {
    /// Sums of so many frames of this setup, each by itself, enhanced and not recorded.
    #[must_use]
    pub fn new(method: Method, frames: u32, setup: &MeasurementSetup) -> Self {
        Self::measuring(method, frames, Measuring::of(setup))
    }

    /// As [`new`](Self::new), of what is measured.
    pub(super) fn measuring(method: Method, frames: u32, measuring: Measuring) -> Self {
        Self {
            method: method.argument(),
            strength: None,
            warm_start: false,
            enhance: true,
            model: Model::DIFFUSION.name(),
            frames,
            measuring,
            record: false,
        }
    }

    /// The settings after this change.
    ///
    /// # Errors
    /// [`ChangeError`] that names the field.
    pub fn with(&self, change: &Change, offer: &Offer) -> Result<Self, ChangeError> {
        let mut new = self.clone();
        if let Some(found) = &change.method {
            let unknown =
                || ChangeError::Method { found: found.clone(), offered: offer.methods.clone() };
            new.method = known(&offer.methods, found).ok_or_else(unknown)?;
        }
        if let Some(wish) = &change.strength {
            new.strength = wish.strength()?;
        }
        if let Some(found) = &change.model {
            let unknown =
                || ChangeError::Model { found: found.clone(), offered: offer.models.clone() };
            new.model = known(&offer.models, found).ok_or_else(unknown)?;
        }
        new.warm_start = change.warm_start.unwrap_or(self.warm_start);
        new.enhance = change.enhance.unwrap_or(self.enhance);
        new.frames = change.frames.unwrap_or(self.frames);
        if !(1..=MAX_FRAMES).contains(&new.frames) {
            return Err(ChangeError::Frames { found: new.frames });
        }
        new.measuring = self.measuring.with(change, offer)?;
        new.record = change.record.unwrap_or(self.record);
        if new.record && !offer.records {
            return Err(ChangeError::NoFolder);
        }
        Ok(new)
    }
}

impl Measuring {
    fn with(&self, change: &Change, offer: &Offer) -> Result<Self, ChangeError> {
        let Change { order, sampling, sweeps, .. } = change;
        let asked = [
            ("order", order.is_some()),
            ("sampling", sampling.is_some()),
            ("sweeps", sweeps.is_some()),
        ];
        if let Some((name, _)) = asked.into_iter().find(|(_, is_asked)| offer.fixed && *is_asked) {
            return Err(ChangeError::Fixed(name));
        }
        let sampling = change.sampling.unwrap_or(self.sampling);
        if Sampling::new(sampling).is_err() {
            return Err(ChangeError::Sampling { found: sampling });
        }
        // Another share of the patterns gets the same light: its sweeps are shorter or longer.
        let patterns = |share: f64| (share * Side::INSTRUMENT.area() as f64).round().max(1.0);
        let as_long = f64::from(self.sweeps) * patterns(self.sampling) / patterns(sampling);
        let as_long = (as_long.round() as u32).clamp(1, MAX_SWEEPS);
        let sweeps =
            change.sweeps.unwrap_or(if sampling == self.sampling { self.sweeps } else { as_long });
        // A command line may ask for more.
        if sweeps != self.sweeps && !(1..=MAX_SWEEPS).contains(&sweeps) {
            return Err(ChangeError::Sweeps { found: sweeps });
        }
        let order = change.order.clone().unwrap_or_else(|| self.order.clone());
        let wanted = Self { order, sampling, sweeps };
        match &offer.base {
            // The number of patterns is whole, and the order's name as the library writes it.
            Some(base) => Ok(Self::of(&wanted.setup(base)?)),
            None => Ok(wanted),
        }
    }
}

impl fmt::Display for Settings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let enhanced = if self.enhance { "enhanced" } else { "not enhanced" };
        write!(f, "{}, sum of {}, {enhanced}", self.method, count(self.frames, "frame"))
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// What these tests offer.
    pub fn offer() -> Offer {
        Offer {
            methods: vec!["hadamard", "omp"],
            models: vec!["diffusion", "gan"],
            records: true,
            base: Some(MeasurementSetup::new(&Order::CakeCutting, 0.5).unwrap()),
            ..Offer::default()
        }
    }

    /// The settings with which these tests begin.
    pub fn settings() -> Settings {
        Settings {
            method: "omp",
            strength: None,
            warm_start: false,
            enhance: true,
            model: "diffusion",
            frames: 64,
            measuring: Measuring::of(offer().base.as_ref().unwrap()),
            record: false,
        }
    }

    fn asked(json: &str) -> Result<Settings, ChangeError> {
        settings().with(&Change::parse(json.as_bytes())?, &offer())
    }

    #[test]
    fn what_is_left_out_stays() {
        assert_eq!(asked("{}"), Ok(settings()));
        assert_eq!(asked(r#"{"enhance": false}"#), Ok(Settings { enhance: false, ..settings() }));
        let all = asked(
            r#"{"method": "hadamard", "frames": 1024, "run": true, "strength": 0.5, "model": "gan", "record": true, "warm_start": true,
                "order": "zig-zag", "sampling": 0.3, "sweeps": 4}"#,
        );
        let measuring = Measuring { order: "zig-zag".into(), sampling: 307.0 / 1024.0, sweeps: 4 };
        let expected = Settings {
            method: "hadamard",
            strength: Some(0.5),
            warm_start: true,
            enhance: true,
            model: "gan",
            frames: 1024,
            measuring,
            record: true,
        };
        assert_eq!(all, Ok(expected.clone()));
        let auto = Change::parse(br#"{"strength": "auto"}"#).unwrap();
        assert_eq!(expected.with(&auto, &offer()).unwrap().strength, None);
    }

    #[test]
    fn another_share_of_the_patterns_keeps_the_light_of_a_frame() {
        let sweeps = |from: &Settings, json: &str| {
            from.with(&Change::parse(json.as_bytes()).unwrap(), &offer()).unwrap()
        };
        let all = sweeps(&settings(), r#"{"sampling": 1, "sweeps": 1}"#);
        let few = sweeps(&all, r#"{"sampling": 0.02}"#);
        assert_eq!(few.measuring.sweeps, 51, "51 sweeps of 20 patterns");
        assert_eq!(sweeps(&few, r#"{"sampling": 1}"#).measuring.sweeps, 1);
        let half = sweeps(&all, r#"{"sampling": 0.5}"#);
        assert_eq!(half.measuring.sweeps, 2);
        assert_eq!(sweeps(&half, r#"{"sampling": 1}"#).measuring.sweeps, 1);
        assert_eq!(sweeps(&half, r#"{"sampling": 0.25, "sweeps": 3}"#).measuring.sweeps, 3);
        assert_eq!(sweeps(&half, r#"{"order": "zig-zag"}"#).measuring.sweeps, 2);
    }

    #[test]
    fn what_cannot_be_is_refused_in_one_line_that_names_it() {
        for (json, words) in [
            (r#"{"method": "magic"}"#, "method is \"magic\", expected hadamard or omp"),
            (r#"{"model": "magic"}"#, "model is \"magic\", expected diffusion or gan"),
            (r#"{"strength": 0}"#, "strength is 0, expected a number above 0"),
            (r#"{"strength": "much"}"#, "strength is \"much\", expected"),
            (r#"{"frames": 0}"#, "frames is 0, expected 1 to 1024"),
            (r#"{"frames": 1025}"#, "frames is 1025"),
            (r#"{"frames": -1}"#, "-1"),
            (r#"{"order": "table:secret.csv"}"#, "order is \"table:secret.csv\", expected natural"),
            (r#"{"sampling": 0}"#, "sampling is 0, expected a number above 0 and at most 1"),
            (r#"{"sampling": 30}"#, "sampling is 30"),
            (r#"{"sweeps": 0}"#, "sweeps is 0, expected 1 to 4096"),
            (r#"{"laser": true}"#, "laser"),
            ("[1", "expected for example"),
            ("", "expected for example"),
        ] {
            let line = asked(json).unwrap_err().to_string();
            assert!(line.contains(words) && line.lines().count() == 1, "{json}: {line}");
        }
        let no_folder = Offer { records: false, ..offer() };
        let record = Change { record: Some(true), ..Change::default() };
        let line = settings().with(&record, &no_folder).unwrap_err().to_string();
        assert!(line.contains("--record-to"), "{line}");
    }

    #[test]
    fn an_order_from_a_file_stays_until_another_is_asked_for() {
        let base = MeasurementSetup { order: "table".to_owned(), ..offer().base.unwrap() };
        let of_file = Measuring::of(&base);
        assert_eq!(of_file.setup(&base).unwrap(), base);
        let more = Measuring { sweeps: 7, ..of_file.clone() };
        assert_eq!(more.setup(&base).unwrap(), MeasurementSetup { sweeps: 7, ..base.clone() });
        let fewer = Measuring { sampling: 0.1, ..of_file };
        assert!(matches!(fewer.setup(&base), Err(ChangeError::Order { .. })));
    }
}

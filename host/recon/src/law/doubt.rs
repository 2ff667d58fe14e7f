//! What is wrong with many readings, in words.

use super::Form;
use crate::words::count_of;
use std::fmt;

/// How many readings break the law.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Broken {
    /// Number of readings.
    pub readings: usize,
    /// Number of readings above that of the all-on pattern; of differences, those that are larger.
    pub above: usize,
    /// Number of readings below that of the all-off pattern.
    pub below: usize,
}

/// What would explain readings that break the law.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Explanation {
    /// The readings keep the law in this form.
    Form(Form),
    /// The readings keep the law in this form, if each complement comes before its pattern.
    ComplementsFirst(Form),
    /// The readings keep the law with the other sign: more light gives a lower reading.
    Inverted,
    /// The first reading of the sweep is missing.
    OneEarly,
    /// One reading came before the sweep, or the first reading was taken twice.
    OneLate,
    /// Each reading was taken several times.
    Samples {
        /// Number of samples of a reading.
        each: usize,
    },
    /// Each pattern and its complement came several times in a row.
    Repeats {
        /// Number of times.
        each: usize,
    },
    /// Several sweeps came one after another.
    Sweeps {
        /// Number of sweeps.
        count: usize,
    },
    /// The patterns were shown in another order: the all-on pattern seems to be this one.
    Order {
        /// Position in the order shown, from 0.
        all_on: usize,
    },
    /// Nothing that is known here.
    Unknown,
}

/// One end of the range of readings.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extreme {
    /// The greatest value.
    Greatest,
    /// The least value.
    Least,
}

/// What contradicts the claim about readings, or is wrong with many of them. `Display` gives one line.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Doubt {
    /// All readings are the same number.
    AllEqual {
        /// Number of readings.
        readings: usize,
        /// The number.
        value: f64,
    },
    /// Many readings break the law.
    Form {
        /// The form that the readings are said to have.
        claimed: Form,
        /// How many readings break the law.
        broken: Broken,
        /// What would explain that.
        explanation: Explanation,
    },
    /// Readings repeat themselves, and the side of the image was taken from their number.
    Repeated {
        /// Number of readings.
        readings: usize,
        /// What explains the repetition.
        explanation: Explanation,
    },
    /// Many readings are equal to the greatest or least one.
    Clipped {
        /// Number of readings.
        readings: usize,
        /// How many of them are equal to the extreme.
        equal: usize,
        /// The extreme.
        value: f64,
        /// Which one.
        extreme: Extreme,
    },
    /// The reading of the all-on pattern is too low for the light that the other pairs have.
    Saturated {
        /// The reading.
        found: f64,
        /// The reading that the sums of the other pairs call for.
        expected: f64,
    },
    /// Many pairs have far more light than the pairs beside them.
    Bursts {
        /// Number of such pairs.
        pairs: usize,
        /// Number of pairs.
        of: usize,
    },
    /// A constant in readings of single patterns that is no dark level.
    NoDarkLevel {
        /// The constant.
        level: f64,
        /// The least reading.
        least: f64,
    },
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::AllEqual { readings, value } => write!(
                f,
                "all {readings} readings are {}: the detector is saturated or not connected, and the image shows nothing",
                Short(value)
            ),
            Self::Form { claimed, broken, explanation } => {
                write!(f, "{}; {}", Said(claimed, broken), Because(explanation, claimed))
            }
            Self::Repeated { readings, explanation } => write!(
                f,
                "{readings} readings repeat themselves; {}",
                Because(explanation, Form::Pairs)
            ),
            Self::Clipped { readings, equal, value, extreme } => {
                let (which, beyond) = match extreme {
                    Extreme::Greatest => ("greatest", "brighter"),
                    Extreme::Least => ("least", "darker"),
                };
                write!(
                    f,
                    "clipped: {equal} of {readings} readings are {}, the {which} value: the detector or the converter does not show {beyond} light",
                    Short(value)
                )
            }
            Self::Saturated { found, expected } => write!(
                f,
                "saturated: the all-on pattern reads {}, the sums of the other pairs call for {}; the image's mean is taken from these sums",
                Short(found),
                Short(expected)
            ),
            Self::Bursts { pairs, of } => write!(
                f,
                "{pairs} of {of} pairs have far more light than the pairs beside them: the lamp or the ambient light flickers; no pattern is left out"
            ),
            Self::NoDarkLevel { level, least } => write!(
                f,
                "the readings call for a dark level of {}, and the least reading is {}: no dark level is removed; the all-on reading may be saturated, or the readings are not of patterns that light the +1",
                Short(level),
                Short(least)
            ),
        }
    }
}

/// How many readings break which law.
struct Said(Form, Broken);

impl fmt::Display for Said {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(claimed, Broken { readings, above, below }) = *self;
        let are = |number: usize| match number {
            1 => "1 is".to_owned(),
            number => format!("{number} are"),
        };
        if claimed == Form::Differences {
            let differences = count_of(readings, "difference");
            return write!(
                f,
                "{differences}: {} larger than that of the all-on pattern",
                are(above)
            );
        }
        write!(f, "{}: ", count_of(readings, "reading"))?;
        match (above, below) {
            (0, 0) => f.write_str("patterns and complements do not share the light of one scene"),
            (above, 0) => write!(f, "{} above the all-on reading", are(above)),
            (0, below) => write!(f, "{} below the all-off reading", are(below)),
            (above, below) => {
                write!(
                    f,
                    "{} above the all-on reading, {} below the all-off reading",
                    are(above),
                    are(below)
                )
            }
        }
    }
}

/// What would explain it, and what to do.
struct Because(Explanation, Form);

impl fmt::Display for Because {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self(explanation, claimed) = self;
        match *explanation {
            Explanation::Form(form) => {
                write!(f, "the readings fit the form `{0}`: try --readings {0}", form.name())
            }
            Explanation::ComplementsFirst(form) if form == *claimed => f.write_str(
                "the readings fit complement first, then pattern; or an inverting amplifier with an offset: try --complements-first",
            ),
            Explanation::ComplementsFirst(form) => write!(
                f,
                "the readings fit the form `{0}` with the complements first: try --readings {0} --complements-first",
                form.name()
            ),
            Explanation::Inverted if *claimed == Form::Single => f.write_str(
                "the readings fit patterns that light the -1 instead of the +1, or an inverting amplifier: try --inverted",
            ),
            Explanation::Inverted => f.write_str(
                "the readings fit the other sign (an inverting amplifier; or complement less pattern): try --inverted",
            ),
            Explanation::OneEarly => f.write_str(
                "the readings fit pairs that are one reading early: the first reading of the sweep is missing: try --shift 1",
            ),
            Explanation::OneLate => f.write_str(
                "the readings fit pairs that are one reading late: the first reading was taken twice or came before the sweep: try --shift -1",
            ),
            Explanation::Samples { each } => write!(
                f,
                "the readings fit {each} samples of each reading: nirspi readings --samples {each} averages them"
            ),
            Explanation::Repeats { each } => write!(
                f,
                "the readings fit each pattern and its complement {each} times in a row: save them with `h_row`, each row {each} times; if this is one sweep of a larger image, say so with --side"
            ),
            Explanation::Sweeps { count } => write!(
                f,
                "the readings fit {count} sweeps one after another: try --sweeps {count}; if this is one sweep of a larger image, say so with --side"
            ),
            Explanation::Order { all_on } => write!(
                f,
                "pattern {all_on} of those shown has the most light: the patterns fit another order; check --shown or `h_row`"
            ),
            Explanation::Unknown => f.write_str(
                "the readings fit none of the forms that are known: the image is not to be trusted; check --readings, --shown and the wiring",
            ),
        }
    }
}

/// A number with five digits.
pub(super) struct Short(pub(super) f64);

impl fmt::Display for Short {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let value = self.0;
        if value != 0.0 && !(1e-4..1e7).contains(&value.abs()) {
            return write!(f, "{value:.4e}");
        }
        let digits = 4 - value.abs().max(1.0).log10().floor() as i32;
        let text = format!("{value:.0$}", digits.max(0) as usize);
        let text = match text.contains('.') {
            true => text.trim_end_matches('0').trim_end_matches('.'),
            false => &text,
        };
        f.write_str(text)
    }
}

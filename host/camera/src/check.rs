//! One check of a self-test: the measured value, its limit, and the verdict.

use serde::{Deserialize, Serialize};
use std::fmt;

/// The limit of a measured value.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Limit {
    /// This value or more.
    AtLeast(f64),
    /// This value or less.
    AtMost(f64),
    /// Exactly this whole number.
    Exactly(f64),
}

impl Limit {
    /// Whether `value` is within the limit. NaN never is.
    #[must_use]
    pub fn holds(self, value: f64) -> bool {
        match self {
            Self::AtLeast(limit) => value >= limit,
            Self::AtMost(limit) => value <= limit,
            Self::Exactly(limit) => value == limit,
        }
    }
}

impl fmt::Display for Limit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::AtLeast(limit) => write!(f, "at least {}", number(*limit)),
            Self::AtMost(limit) => write!(f, "at most {}", number(*limit)),
            Self::Exactly(limit) => write!(f, "exactly {}", number(*limit)),
        }
    }
}

/// The result of a check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// The value is within its limit.
    Passed,
    /// The value is outside its limit.
    Failed,
    /// The check was not made. The note gives the reason.
    Skipped,
}

/// One check.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Check {
    name: String,
    verdict: Verdict,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    measured: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    limit: Option<Limit>,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    unit: String,
    #[serde(default, skip_serializing_if = "String::is_empty")]
    note: String,
}

impl Check {
    /// A check of a value against its limit, in `unit`.
    #[must_use]
    pub fn measured(name: &str, value: f64, unit: &str, limit: Limit) -> Self {
        let verdict = if limit.holds(value) { Verdict::Passed } else { Verdict::Failed };
        Self {
            measured: Some(value),
            limit: Some(limit),
            unit: unit.to_owned(),
            ..Self::new(name, verdict, "")
        }
    }

    /// A check whose result comes from another part, or whose value could not be measured. `note`
    /// gives the reason.
    #[must_use]
    pub fn told(name: &str, passed: bool, note: &str) -> Self {
        Self::new(name, if passed { Verdict::Passed } else { Verdict::Failed }, note)
    }

    /// A check that was not made, for this reason.
    #[must_use]
    pub fn skipped(name: &str, reason: &str) -> Self {
        Self::new(name, Verdict::Skipped, reason)
    }

    fn new(name: &str, verdict: Verdict, note: &str) -> Self {
        let (measured, limit, unit) = (None, None, String::new());
        Self { name: name.to_owned(), verdict, measured, limit, unit, note: note.to_owned() }
    }

    /// The same check with a note.
    #[must_use]
    pub fn noting(self, note: &str) -> Self {
        Self { note: note.to_owned(), ..self }
    }

    /// The name of the check.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The result of the check.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        self.verdict
    }

    /// The measured value, in its unit.
    #[must_use]
    pub fn value(&self) -> Option<f64> {
        self.measured
    }

    /// The note.
    #[must_use]
    pub fn note(&self) -> &str {
        &self.note
    }

    /// Value and unit in words; empty without a value.
    #[must_use]
    pub fn value_in_words(&self) -> String {
        self.measured.map_or_else(String::new, |value| format!("{} {}", number(value), self.unit))
    }

    /// The limit in words; empty without a limit.
    #[must_use]
    pub fn limit_in_words(&self) -> String {
        self.limit.map_or_else(String::new, |limit| limit.to_string())
    }
}

/// A number in words: whole numbers unchanged, others with their significant digits.
fn number(value: f64) -> String {
    if value.fract() == 0.0 {
        format!("{value:.0}")
    } else if value.abs() < 10.0 {
        format!("{value:.2}")
    } else {
        format!("{value:.1}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_verdict_follows_from_value_and_limit() {
        let verdict = |value, limit| Check::measured("x", value, "", limit).verdict();
        assert_eq!(verdict(2.0, Limit::AtLeast(2.0)), Verdict::Passed);
        assert_eq!(verdict(1.9, Limit::AtLeast(2.0)), Verdict::Failed);
        assert_eq!(verdict(2.1, Limit::AtMost(2.0)), Verdict::Failed);
        assert_eq!(verdict(3.0, Limit::Exactly(2.0)), Verdict::Failed);
        for limit in [Limit::AtLeast(0.0), Limit::AtMost(0.0), Limit::Exactly(0.0)] {
            assert_eq!(verdict(f64::NAN, limit), Verdict::Failed);
        }
    }
}

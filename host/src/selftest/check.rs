//! One line of a self-test: what was measured, what it had to be, and so the verdict.

use serde::{Deserialize, Serialize};
use std::fmt;

/// What a measured value has to be.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Limit {
    /// This or more.
    AtLeast(f64),
    /// This or less.
    AtMost(f64),
    /// This, a whole number.
    Exactly(f64),
}

impl Limit {
    /// Whether `value` keeps to it. NaN does not.
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

/// What came of a check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// As it must be.
    Passed,
    /// Not as it must be.
    Failed,
    /// Not looked at; the note says why.
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
    /// A value against its limit, in `unit`.
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

    /// What someone else has judged, or what could not be measured; `note` says why.
    #[must_use]
    pub fn told(name: &str, passed: bool, note: &str) -> Self {
        Self::new(name, if passed { Verdict::Passed } else { Verdict::Failed }, note)
    }

    /// Not looked at, for this reason.
    #[must_use]
    pub fn skipped(name: &str, reason: &str) -> Self {
        Self::new(name, Verdict::Skipped, reason)
    }

    fn new(name: &str, verdict: Verdict, note: &str) -> Self {
        let (measured, limit, unit) = (None, None, String::new());
        Self { name: name.to_owned(), verdict, measured, limit, unit, note: note.to_owned() }
    }

    /// The same check with something said about it.
    #[must_use]
    pub fn noting(self, note: &str) -> Self {
        Self { note: note.to_owned(), ..self }
    }

    /// What is checked.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What came of it.
    #[must_use]
    pub fn verdict(&self) -> Verdict {
        self.verdict
    }

    /// The value found, in its unit.
    #[must_use]
    pub fn value(&self) -> Option<f64> {
        self.measured
    }

    /// What is said about it.
    #[must_use]
    pub fn note(&self) -> &str {
        &self.note
    }

    /// Value and unit for people; empty where there is none.
    #[must_use]
    pub fn value_in_words(&self) -> String {
        self.measured.map_or_else(String::new, |value| format!("{} {}", number(value), self.unit))
    }

    /// The limit for people; empty where there is none.
    #[must_use]
    pub fn limit_in_words(&self) -> String {
        self.limit.map_or_else(String::new, |limit| limit.to_string())
    }
}

/// Whole numbers as they are, others with as many digits as mean something.
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

//! The forms of readings: how readings belong to patterns.

use std::str::FromStr;

/// How readings belong to patterns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// Pattern, complement, pattern, complement, in time order.
    Pairs,
    /// All patterns, then all complements.
    Halves,
    /// Patterns alone, without complements.
    Single,
    /// Differences already formed, or any signed measurement of a pattern.
    Differences,
}

impl Form {
    /// Every form.
    pub const ALL: [Self; 4] = [Self::Pairs, Self::Halves, Self::Single, Self::Differences];

    /// The form's name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Pairs => "pairs",
            Self::Halves => "halves",
            Self::Single => "single",
            Self::Differences => "differences",
        }
    }

    /// The form's description in one line, for a list of forms.
    #[must_use]
    pub fn about(self) -> &'static str {
        match self {
            Self::Pairs => "pattern, complement, pattern, complement: +, -, +, -",
            Self::Halves => "all patterns, then all complements: +, +, ..., -, -, ...",
            Self::Single => "patterns alone, without complements",
            Self::Differences => "one signed value a pattern, already pattern less complement",
        }
    }

    /// Number of readings of one pattern.
    #[must_use]
    pub fn readings(self) -> usize {
        match self {
            Self::Pairs | Self::Halves => 2,
            Self::Single | Self::Differences => 1,
        }
    }
}

impl FromStr for Form {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        Self::ALL
            .into_iter()
            .find(|form| form.name() == name)
            .ok_or_else(|| format!("expected {}", Self::ALL.map(Self::name).join(", ")))
    }
}

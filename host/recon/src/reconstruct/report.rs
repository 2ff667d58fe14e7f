//! What a method says of an image: numbers, and the same in words.

use super::Completion;
use crate::{Backend, Image};
use std::fmt;

/// An image and how it was made.
#[derive(Debug, Clone, PartialEq)]
pub struct Reconstruction {
    /// The image, in the measurements' units.
    pub image: Image,
    /// How it was made.
    pub report: Report,
}

/// How an image was made. Each method fills in what means something to it; `Display` gives one line of it.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// The method, in a few words.
    pub name: String,
    /// The basis, or what atoms of the user's own are called.
    pub basis: Option<String>,
    /// What computed, where the method has a choice.
    pub backend: Option<Backend>,
    /// The GPU that computed, if one did.
    pub device: Option<String>,
    /// Strength of a penalty, relative to what noise and prior call for.
    pub strength: Option<f64>,
    /// Atoms in the representation.
    pub sparsity: Option<usize>,
    /// What became of rows that were measured.
    pub completion: Option<Completion>,
    /// Why there are no more atoms.
    pub stop: Option<&'static str>,
    /// Norm of what the prediction leaves of the measurements, relative to theirs.
    pub residual: Option<f64>,
    /// Atoms that the measured rows do not see.
    pub unseen_atoms: Option<usize>,
    /// Share of the prediction that was used for rows not measured, 0 (zero filling) to 1.
    pub trust: Option<f64>,
    /// Noise of a measurement, in the measurements' units.
    pub noise: Option<f64>,
    /// Whether the frame of a video started from the one before.
    pub warm: bool,
}

impl Report {
    /// A report that says the method's name, and nothing else yet.
    pub fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            basis: None,
            backend: None,
            device: None,
            strength: None,
            sparsity: None,
            completion: None,
            stop: None,
            residual: None,
            unseen_atoms: None,
            trust: None,
            noise: None,
            warm: false,
        }
    }

    /// In a few words, for a caption.
    #[must_use]
    pub fn short(&self) -> String {
        let name = &self.name;
        match (self.sparsity, &self.basis) {
            (Some(atoms), Some(basis)) => format!("{name}, {atoms} atoms of the {basis} basis"),
            (Some(atoms), None) => format!("{name}, {atoms} atoms"),
            (None, Some(basis)) => format!("{name}, {basis} basis"),
            (None, None) => name.clone(),
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = vec![self.short()];
        parts.extend(self.strength.map(|strength| format!("strength {strength}")));
        parts.extend(self.residual.map(|residual| format!("relative residual {residual:.3}")));
        parts.extend(self.unseen_atoms.map(|atoms| format!("{atoms} atoms not seen")));
        parts.extend(
            self.trust.map(|trust| format!("{:.0} % of the prediction used", 100.0 * trust)),
        );
        parts.extend(self.stop.map(|stop| format!("stopped: {stop}")));
        f.write_str(&parts.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_report_names_its_own_method_whatever_that_is() {
        let mut report = Report::new("an invention");
        assert_eq!(
            (report.short(), report.to_string()),
            ("an invention".into(), "an invention".into())
        );
        (report.basis, report.strength) = (Some("haar".into()), Some(3.0));
        (report.residual, report.trust) = (Some(0.25), Some(0.5));
        assert_eq!(report.short(), "an invention, haar basis");
        assert_eq!(
            report.to_string(),
            "an invention, haar basis, strength 3, relative residual 0.250, 50 % of the prediction used"
        );
    }
}

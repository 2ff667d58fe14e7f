//! The report of a reconstruction method, for JSON reports and captions.

use nirspi_recon::omp::Backend;
use nirspi_recon::reconstruct::{Method, Report};
use serde::Serialize;
use serde::ser::{SerializeMap, Serializer};
use std::fmt;

/// A method and its report.
#[derive(Debug)]
pub struct MethodReport {
    /// The method.
    pub method: Method,
    /// The method's report.
    pub made: Report,
}

impl MethodReport {
    /// A few words for a caption.
    #[must_use]
    pub fn short(&self) -> String {
        self.made.short()
    }
}

impl fmt::Display for MethodReport {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.made.fmt(f)
    }
}

impl Serialize for MethodReport {
    /// Writes the method's name, and its report under the same name. The report of a method with a
    /// strength is under `penalty`.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let made = &self.made;
        let details = Details {
            basis: made.basis.as_deref(),
            backend: made.backend.map(Backend::name),
            device: made.device.as_deref(),
            strength: made.strength,
            sparsity: made.sparsity,
            weight_of_readings: made.reading_weight,
            stop: made.stop,
            relative_residual: made.residual,
            unseen_atoms: made.unseen_atoms,
            trust_in_prediction: made.trust,
            noise_of_a_measurement: made.noise,
            note: made.note.as_deref(),
        };
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("method", self.method.argument())?;
        if details != Details::default() {
            let section = if made.strength.is_some() { "penalty" } else { self.method.argument() };
            map.serialize_entry(section, &details)?;
        }
        map.end()
    }
}

#[derive(Default, PartialEq, Serialize)]
struct Details<'r> {
    #[serde(skip_serializing_if = "Option::is_none")]
    basis: Option<&'r str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    backend: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    device: Option<&'r str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    strength: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    sparsity: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    weight_of_readings: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    stop: Option<&'static str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    relative_residual: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    unseen_atoms: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    trust_in_prediction: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    noise_of_a_measurement: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    note: Option<&'r str>,
}

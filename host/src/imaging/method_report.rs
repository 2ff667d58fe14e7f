//! The report of a reconstruction method, for JSON reports and captions.

use nirspi_recon::Measurements;
use nirspi_recon::omp::Backend;
use nirspi_recon::reconstruct::{
    HeldBack, Method, Report, better_shift, explanation, few_patterns_see,
};
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
    /// The method that made the image: the chosen one, if it was chosen among several.
    #[must_use]
    pub fn used(&self) -> Method {
        self.made.chosen.and_then(|word| word.parse().ok()).unwrap_or(self.method)
    }

    /// Whether held-back readings can say that readings are no better than chance. An even scene, as a white sheet, has nothing
    /// to predict, and one that few patterns see nothing to predict it by.
    pub(crate) fn can_be_judged(measurements: &Measurements) -> bool {
        let is_even = measurements
            .noise()
            .is_some_and(|noise| deviation(measurements) < HeldBack::EVEN * noise);
        !is_even && !few_patterns_see(measurements)
    }

    /// A warning if held-back readings say that the readings do not belong to their patterns, with
    /// what would explain the readings. `measurements` are all that were read, in the order shown.
    #[must_use]
    pub fn doubt(&self, measurements: &Measurements) -> Option<String> {
        let held_back = self.made.held_back.filter(HeldBack::is_by_chance)?;
        if !Self::can_be_judged(measurements) {
            return None;
        }
        let cause = match explanation(measurements) {
            Some(cause) => format!("they fit {cause}"),
            None => "they are noise, or belong to patterns of another order".to_owned(),
        };
        Some(by_chance(held_back, cause))
    }

    /// A warning if the readings predict each other far better as those of other patterns, a few places away.
    #[must_use]
    pub fn better_shift(&self, measurements: &Measurements) -> Option<String> {
        let found = self.made.held_back?;
        let (shift, better) = better_shift(measurements, found)?;
        let [confirmed, better] = [found, better].map(|found| 100.0 * found.confirmed);
        Some(format!(
            "{better:.0} % of the readings' variation is confirmed if they are {shift}, and {confirmed:.0} % as they are: --shift \
             moves them"
        ))
    }

    /// A few words for a caption.
    #[must_use]
    pub fn short(&self) -> String {
        self.made.short()
    }
}

/// The warning that readings predict each other by chance alone, and why.
pub(crate) fn by_chance(held_back: HeldBack, cause: impl fmt::Display) -> String {
    format!(
        "readings predict each other no better than chance ({:.0} % of their variation is confirmed): {cause}",
        100.0 * held_back.confirmed
    )
}

/// Standard deviation of the measurements around 0, without that of the all-ones pattern.
fn deviation(measurements: &Measurements) -> f64 {
    let values = measurements.rows().iter().zip(measurements.values());
    let (mut sum, mut count) = (0.0, 0.0_f64);
    for (_, value) in values.filter(|(row, _)| **row != 0) {
        sum += value * value;
        count += 1.0;
    }
    (sum / count.max(1.0)).sqrt()
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
            computed: made.computed.as_deref(),
            strength: made.strength,
            sparsity: made.sparsity,
            weight_of_readings: made.reading_weight,
            chosen: made.chosen,
            held_back: made.held_back.map(Into::into),
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

/// What held-back readings say of the image.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HeldBackReport {
    /// Sum of the absolute and of the squared error of the predictions, each as a share of that of zeros: 2 is no better
    /// than zeros.
    error: f64,
    /// Share of the readings' variation that the predictions explain.
    confirmed_share: f64,
    /// Agreement in sign, in standard errors.
    agreement: f64,
}

impl From<HeldBack> for HeldBackReport {
    fn from(found: HeldBack) -> Self {
        Self { error: found.miss, confirmed_share: found.confirmed, agreement: found.score }
    }
}

/// How the method made the image, as far as it says.
#[derive(Default, PartialEq, Serialize)]
struct Details<'r> {
    /// The basis of the image's coefficients, or the file of a user's own atoms.
    #[serde(skip_serializing_if = "Option::is_none")]
    basis: Option<&'r str>,
    /// What computed: `cpu`, or a GPU.
    #[serde(skip_serializing_if = "Option::is_none")]
    backend: Option<&'static str>,
    /// The GPU's name.
    #[serde(skip_serializing_if = "Option::is_none")]
    device: Option<&'r str>,
    /// Why this device computed, in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    computed: Option<&'r str>,
    /// Strength of the penalty.
    #[serde(skip_serializing_if = "Option::is_none")]
    strength: Option<f64>,
    /// Number of atoms.
    #[serde(skip_serializing_if = "Option::is_none")]
    sparsity: Option<usize>,
    /// Mean weight of the readings against the method's predictions of them: 1 where there is no noise.
    #[serde(skip_serializing_if = "Option::is_none")]
    weight_of_readings: Option<f64>,
    /// The method that was chosen by held-back readings.
    #[serde(skip_serializing_if = "Option::is_none")]
    chosen: Option<&'static str>,
    /// What held-back readings say.
    #[serde(skip_serializing_if = "Option::is_none")]
    held_back: Option<HeldBackReport>,
    /// Why the pursuit stopped.
    #[serde(skip_serializing_if = "Option::is_none")]
    stop: Option<&'static str>,
    /// Norm of the residual of the image, relative to the norm of the readings.
    #[serde(skip_serializing_if = "Option::is_none")]
    relative_residual: Option<f64>,
    /// Atoms that no pattern sees.
    #[serde(skip_serializing_if = "Option::is_none")]
    unseen_atoms: Option<usize>,
    /// Weight of the network's prediction, from 0 to 1.
    #[serde(skip_serializing_if = "Option::is_none")]
    trust_in_prediction: Option<f64>,
    /// Standard deviation of the noise of a measurement, in the readings' units.
    #[serde(skip_serializing_if = "Option::is_none")]
    noise_of_a_measurement: Option<f64>,
    /// What else there is to say, in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    note: Option<&'r str>,
}

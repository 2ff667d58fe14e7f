//! One way to read readings, and how much of the held-back readings it explains.

use super::{command, rounded};
use crate::files::measurement::MeasurementFile;
use crate::recording::RecordingInfo;
use crate::source::{Part, Source, by_law};
use nirspi_recon::law::{Doubt, Explanation, Form};
use nirspi_recon::reconstruct::{HeldBack, Method, MethodSettings, Reconstruct, few_patterns_see};
use nirspi_recon::{Image, Measurements, Side};
use serde::Serialize;
use std::path::Path;

/// The largest side at which ways are compared, and that of their pictures. Larger images are judged and shown
/// by the patterns of squares of pixels.
const JUDGED: u64 = 32;
const SHOWN: u64 = 64;

/// Single readings whose dark level is that share of the all-on reading from its negative are differences.
const SYMMETRICAL: f64 = 0.1;

/// A way to read the readings of a file.
#[derive(Debug, Clone, Serialize)]
pub struct Guess {
    /// The field of the readings, if the file has names.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// How readings belong to patterns, in a few words.
    pub form: String,
    /// The order in which patterns were shown, in a few words.
    pub order: String,
    /// Side of the image.
    pub n: usize,
    /// Number of patterns that were read.
    pub patterns: usize,
    /// Number of readings of them.
    pub readings: usize,
    /// Share of the variation of held-back readings that the others explain.
    #[serde(serialize_with = "rounded")]
    pub explained: f64,
    /// Agreement in sign of held-back readings and their predictions, in standard errors.
    #[serde(serialize_with = "rounded")]
    pub agreement: f64,
    /// Whether this is no better than chance, of so many tries.
    pub by_chance: bool,
    /// Whether the readings break the law of readings in this form.
    pub contradicted: bool,
    /// What contradicts the readings.
    pub warnings: Vec<String>,
    /// Number of measurements in the file, if there are several: this is the first.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measurements_in_file: Option<usize>,
    /// Another name of the order, under which the image is mirrored along its diagonal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mirrored: Option<String>,
    /// The commands that reconstruct the file so.
    pub commands: Vec<String>,
    /// The image; of images with sides beyond 64, the means of squares of pixels.
    #[serde(skip)]
    pub image: Image,
    /// Whether the readings are the means of several.
    #[serde(skip)]
    pub(super) takes_repeats: bool,
    #[serde(skip)]
    pub(super) measurements: Measurements,
}

impl Guess {
    /// Readings that were read in this form and order, and what they say. `has_rows`: the patterns are
    /// named, not one order of many.
    pub(super) fn of(
        read: &MeasurementFile,
        verdict: Verdict,
        has_rows: bool,
        (form, order): (String, String),
    ) -> Self {
        Self {
            field: None,
            form,
            order,
            n: verdict.measurements.side().pixels(),
            patterns: verdict.measurements.rows().len(),
            readings: read.readings.values().len(),
            explained: verdict.held_back.confirmed,
            agreement: verdict.held_back.score,
            by_chance: verdict.by_chance(has_rows),
            contradicted: verdict.is_contradicted(),
            warnings: verdict.warnings(),
            measurements_in_file: None,
            mirrored: None,
            takes_repeats: false,
            commands: Vec::new(),
            image: verdict.image,
            measurements: verdict.measurements,
        }
    }

    /// Whether the readings fit: they explain each other better than chance and keep the law.
    #[must_use]
    pub fn fits(&self) -> bool {
        !self.by_chance && !self.contradicted
    }

    /// Ways that fit come first, then those that take more of the `most` readings, then those that explain more.
    /// Ways that are alike in full numbers and percent stay in the order in which they were tried.
    pub(super) fn rank(&self, most: usize) -> (bool, bool, usize, i64) {
        let part = (most + self.readings / 2) / self.readings.max(1);
        (self.contradicted, self.by_chance, part, -(100.0 * self.explained).round() as i64)
    }
}

/// What readings say when they are read so.
pub(super) struct Verdict {
    pub(super) held_back: HeldBack,
    pub(super) image: Image,
    pub(super) doubts: Vec<Doubt>,
    pub(super) measurements: Measurements,
    /// Why readings of one number a pattern are rather of the other such form.
    implausible: Option<String>,
}

impl Verdict {
    /// Whether this is no better than chance, where the file names the patterns or where many orders are tried.
    pub(super) fn by_chance(&self, has_rows: bool) -> bool {
        match has_rows {
            true => self.held_back.is_by_chance() && !few_patterns_see(&self.measurements),
            false => self.held_back.score < HeldBack::AMONG_MANY,
        }
    }

    /// What would explain readings that break the law.
    pub(super) fn explanations(&self) -> impl Iterator<Item = Explanation> {
        self.doubts.iter().filter_map(|doubt| match doubt {
            Doubt::Form { explanation, .. } | Doubt::Repeated { explanation, .. } => {
                Some(*explanation)
            }
            _ => None,
        })
    }

    /// What speaks against the readings, one line each.
    pub(super) fn warnings(&self) -> Vec<String> {
        self.doubts.iter().map(Doubt::to_string).chain(self.implausible.clone()).collect()
    }

    /// Whether the readings are not what they are said to be; a saturated detector or a flickering lamp is so
    /// in every form.
    pub(super) fn is_contradicted(&self) -> bool {
        self.implausible.is_some()
            || self.explanations().next().is_some()
            || self
                .doubts
                .iter()
                .any(|doubt| matches!(doubt, Doubt::NoDarkLevel { .. } | Doubt::AllEqual { .. }))
    }
}

/// Judges ways to read readings.
pub(super) struct Judge {
    methods: Vec<Box<dyn Reconstruct>>,
}

impl Judge {
    pub(super) fn new() -> Self {
        // What one of them explains, such as edges, the other may not.
        let methods = [Method::TIKHONOV, Method::TOTAL_VARIATION];
        let prepared = methods.map(|method| method.prepare(&MethodSettings::default()).ok());
        Self { methods: prepared.into_iter().flatten().collect() }
    }

    /// What these readings say; `None` if they say nothing.
    pub(super) fn of(&self, path: &Path, file: &MeasurementFile) -> Option<Verdict> {
        let (reading, _) = by_law(path, file, Part::Magnitude).ok()?;
        let mut measurements = reading.measurements;
        let implausible = match file.claim.form {
            Form::Differences => constant(&mut measurements),
            Form::Single => symmetrical(file, reading.dark_level),
            Form::Pairs | Form::Halves => None,
        };
        let verdict = self.judged(measurements)?;
        Some(Verdict { doubts: reading.doubts, implausible, ..verdict })
    }

    fn judged(&self, measurements: Measurements) -> Option<Verdict> {
        let (image, held_back) = self.seen(&measurements, JUDGED)?;
        Some(Verdict { held_back, image, doubts: Vec::new(), measurements, implausible: None })
    }

    /// The image of these measurements, of at most this side, by the method that explains more of them.
    fn seen(&self, measurements: &Measurements, side: u64) -> Option<(Image, HeldBack)> {
        let small = Side::new(side).ok().and_then(|small| measurements.binned(small));
        let measurements = small.as_ref().unwrap_or(measurements);
        let made = self.methods.iter().filter_map(|method| {
            let made = method.reconstruct(measurements).ok()?;
            Some((made.image, made.report.held_back?))
        });
        let above_chance = |of: &HeldBack| of.score >= HeldBack::AMONG_MANY;
        made.max_by(|(_, a), (_, b)| {
            let chance = above_chance(a).cmp(&above_chance(b));
            chance.then(a.confirmed.total_cmp(&b.confirmed)).then(a.score.total_cmp(&b.score))
        })
    }

    /// The guess with an image in the size of pictures.
    pub(super) fn shown(&self, guess: &mut Guess) {
        if let Some((image, _)) = self.seen(&guess.measurements, SHOWN) {
            guess.image = image;
        }
    }

    /// The only way to read a recording, which says itself how it was made.
    pub(super) fn of_recording(
        &self,
        path: &Path,
        info: &RecordingInfo,
        source: &Source,
    ) -> Option<Guess> {
        let verdict = self.judged(source.measurements.clone())?;
        let form = if info.differential { "pairs" } else { "single" };
        Some(Guess {
            field: None,
            form: form.to_owned(),
            order: info.order.clone(),
            n: verdict.measurements.side().pixels(),
            patterns: verdict.measurements.rows().len(),
            readings: verdict.measurements.rows().len(),
            explained: verdict.held_back.confirmed,
            agreement: verdict.held_back.score,
            by_chance: verdict.by_chance(true),
            contradicted: !source.warnings.is_empty(),
            warnings: source.all_warnings(),
            measurements_in_file: None,
            mirrored: None,
            takes_repeats: false,
            commands: vec![command::reconstruct(path, &Default::default()).line()],
            image: verdict.image,
            measurements: verdict.measurements,
        })
    }
}

/// Why differences are readings of patterns alone: all of them have the same large constant, which is then
/// removed.
fn constant(measurements: &mut Measurements) -> Option<String> {
    let mut without = measurements.clone();
    let level = without.remove_dark_level()?;
    let others = without.rows().iter().zip(without.values()).filter(|(row, _)| **row != 0);
    let (count, squares) = others.fold((0.0_f64, 0.0), |(n, sum), (_, v)| (n + 1.0, sum + v * v));
    (level * level > squares / count.max(1.0)).then(|| {
        *measurements = without;
        format!("all differences have {level:.4} in common, as readings of patterns alone have")
    })
}

/// Why readings of patterns alone are differences: their middle is zero.
fn symmetrical(file: &MeasurementFile, dark_level: Option<f64>) -> Option<String> {
    let first = file.h_row.iter().position(|&row| row == 0)?;
    let (on, level) = (file.readings.values()[first], dark_level?);
    ((on + level).abs() < SYMMETRICAL * on.abs())
        .then(|| "the middle of the readings is zero, as that of differences is".to_owned())
}

//! A method's report on its image, in numbers and in words.

use super::HeldBack;
use crate::words::count_of;
use crate::{Backend, Image, Measurements, fwht};
use std::fmt;
use std::sync::Arc;

/// An image and how it was made.
#[derive(Debug, Clone, PartialEq)]
pub struct Reconstruction {
    /// The image, in the measurements' units.
    pub image: Image,
    /// How the image was made.
    pub report: Report,
}

impl Reconstruction {
    /// The image with its measured rows as they were read, noise and all: what the networks were
    /// trained on, which judge the noise themselves. A video's frame that has a past, and the image of
    /// a method without weights, stay as they are.
    #[must_use]
    pub fn with_readings(&self, measurements: &Measurements) -> Image {
        match self.report.with_readings(self.image.pixels(), measurements) {
            Some(pixels) => Image::new(self.image.side(), pixels),
            None => self.image.clone(),
        }
    }
}

/// How an image was made. Each method fills in the fields that apply to it; `Display` gives one
/// line.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// The method, in a few words.
    pub name: String,
    /// The basis, or the name of a user's own atoms.
    pub basis: Option<String>,
    /// The backend, for a method with a choice.
    pub backend: Option<Backend>,
    /// Name of the GPU, if a GPU computed.
    pub device: Option<String>,
    /// Why the processor or a GPU computed, in one line, where that was not the user's choice.
    pub computed: Option<Arc<str>>,
    /// Strength of a penalty, relative to what noise and prior call for.
    pub strength: Option<f64>,
    /// Number of atoms in the representation.
    pub sparsity: Option<usize>,
    /// Mean weight of the readings in the measured rows: 1 where noise does not matter, 0 where the
    /// image is the prediction.
    pub reading_weight: Option<f64>,
    /// How well readings were predicted without them; `None` if none was held back.
    pub held_back: Option<HeldBack>,
    /// The method's word, if it was chosen among several.
    pub chosen: Option<&'static str>,
    /// Why the pursuit stopped.
    pub stop: Option<&'static str>,
    /// Norm of the difference between the measurements and the image, relative to the measurements'
    /// norm.
    pub residual: Option<f64>,
    /// Number of atoms that the measured rows do not see.
    pub unseen_atoms: Option<usize>,
    /// Trust: factor on the prediction for rows that were not measured, 0 (zero filling) to 1.
    pub trust: Option<f64>,
    /// Noise of a measurement, in the measurements' units.
    pub noise: Option<f64>,
    /// Whether a video's frame started from the previous one.
    pub warm: bool,
    /// What else the reader should know, in a few words: why a method fell back on another one.
    pub note: Option<String>,
}

impl Report {
    /// A report with the method's name only.
    pub fn new(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            basis: None,
            backend: None,
            device: None,
            computed: None,
            strength: None,
            sparsity: None,
            reading_weight: None,
            held_back: None,
            chosen: None,
            stop: None,
            residual: None,
            unseen_atoms: None,
            trust: None,
            noise: None,
            warm: false,
            note: None,
        }
    }

    /// The pixels of the image of this report with its measured rows as they were read
    /// ([`Reconstruction::with_readings`]); `None` where that is the image itself.
    #[must_use]
    pub fn with_readings(&self, pixels: &[f32], measurements: &Measurements) -> Option<Vec<f32>> {
        let weighted = self.reading_weight.is_some_and(|weight| weight < 1.0);
        if self.warm || !weighted || pixels.len() != measurements.side().area() {
            return None;
        }
        let mut rows: Vec<f64> = pixels.iter().map(|&pixel| pixel.into()).collect();
        let area = rows.len() as f64;
        fwht::transform(&mut rows);
        for (&row, &value) in measurements.rows().iter().zip(measurements.values()) {
            rows[row as usize] = value;
        }
        fwht::transform(&mut rows);
        Some(rows.into_iter().map(|value| (value / area) as f32).collect())
    }

    /// The report in a few words, for a caption.
    #[must_use]
    pub fn short(&self) -> String {
        let name = &self.name;
        match (self.sparsity, &self.basis) {
            (Some(atoms), Some(basis)) => {
                format!("{name}, {} of the {basis} basis", count_of(atoms, "atom"))
            }
            (Some(atoms), None) => format!("{name}, {}", count_of(atoms, "atom")),
            (None, Some(basis)) => format!("{name}, {basis} basis"),
            (None, None) => name.clone(),
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = vec![self.short()];
        parts.extend(self.chosen.map(|word| format!("chosen by held-back readings: {word}")));
        parts.extend(self.strength.map(|strength| format!("strength {strength}")));
        parts.extend(self.residual.map(|residual| format!("relative residual {residual:.3}")));
        parts
            .extend(self.unseen_atoms.map(|atoms| format!("{} not seen", count_of(atoms, "atom"))));
        parts
            .extend(self.reading_weight.map(|weight| {
                format!("measured patterns: readings count {:.0} %", 100.0 * weight)
            }));
        parts.extend(self.trust.map(|trust| {
            format!("patterns that were not measured: prediction counts {:.0} %", 100.0 * trust)
        }));
        parts.extend(self.stop.map(|stop| format!("stopped: {stop}")));
        parts.extend(self.note.clone());
        f.write_str(&parts.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_networks_get_the_readings_as_they_are() {
        use crate::reconstruct::{Method, MethodSettings};
        use crate::testing::{noisy, scene, side};
        let rows = crate::Order::ZigZag.rows(side(32)).unwrap();
        let all = noisy(&rows, &scene(side(32), 1), 8.0, 1).with_noise(8.0).unwrap();
        let made = |method: Method, part: &Measurements| {
            let ready = method.prepare(&MethodSettings::default()).unwrap();
            ready.reconstruct(part).unwrap()
        };
        let smooth = made(Method::TIKHONOV, &all);
        let plain = made(Method::HADAMARD, &all).image;
        assert!(smooth.report.reading_weight.unwrap() < 0.9);
        let close = |a: &Image, b: &Image| {
            a.pixels().iter().zip(b.pixels()).all(|(a, b)| (a - b).abs() < 1e-4)
        };
        assert!(close(&smooth.with_readings(&all), &plain) && !close(&smooth.image, &plain));
        // Rows that were not measured stay as predicted.
        let part = all.take(None, 0.5).unwrap();
        let smooth = made(Method::TIKHONOV, &part);
        let kept = made(Method::TIKHONOV, &part.clone().with_noise(0.0).unwrap()).image;
        assert!(close(&smooth.with_readings(&part), &kept));
    }

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
            "an invention, haar basis, strength 3, relative residual 0.250, patterns that were not measured: prediction counts 50 %"
        );
    }
}

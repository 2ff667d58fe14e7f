//! Some of the measurements in normalised units, with the expected sizes of the coefficients.
//!
//! # Invariant
//! The parts of `A` and `y` that are equal in all measurements are removed: they are those of the dark
//! level, which has no penalty. Let `u` be the measurements of an even image. The parts along `u` are
//! removed too, because the mean has no penalty. Neither removal changes a minimum
//! (`super::tests::all_hadamard_rows_as_a_matrix_give_the_image_by_every_method`), and the second one
//! eliminates the by far largest singular value. Mean and dark level are those that then fit the
//! measurements best.
//!
//! More measurements than pixels are replaced by as many as there are pixels, with the same sums of
//! squares for every image ([`Condensed`]), so the time of a method does not grow with them.

use super::solvers::{self, Chosen, Condensed};
use super::{DarkLevel, MatrixError, MatrixMethod, MatrixSettings, OwnMatrix, Penalty};
use nalgebra::{DMatrix, DVector};
use nirspi_recon::Size;
use nirspi_recon::basis::{Basis, Transform};
use nirspi_recon::omp::{DenseDictionary, Stop};
use std::sync::OnceLock;

/// What the patterns at some positions say, before any measurement.
pub(super) struct Prepared {
    size: Size,
    at: Vec<usize>,
    /// Patterns without the mean, with norm 1.
    patterns: DMatrix<f64>,
    atoms: Atoms,
    norm: f64,
    raw: DMatrix<f64>,
    mean: Mean,
    condensed: Option<Condensed>,
    fits_dark: bool,
    expected: OnceLock<Expected>,
    gram: OnceLock<DMatrix<f64>>,
}

/// The measurements at some positions.
pub(super) struct Problem<'p> {
    of: &'p Prepared,
    /// Measurements without the mean, with variance 1.
    y: DVector<f64>,
    /// A pixel of 1 in the measurements' units.
    unit: f64,
    raw_y: DVector<f64>,
}

/// Measurements of each atom, and the expected sizes of the coefficients.
struct Expected {
    seen: DMatrix<f64>,
    scale: DVector<f64>,
}

/// The atoms of the coefficients.
enum Atoms {
    Basis(Transform<Size>),
    /// Images of norm 1, one in each column.
    Own(DMatrix<f64>),
}

/// How the mean of the image is found afterwards.
enum Mean {
    /// The mean is part of the coefficients, or no pattern sees it.
    Kept,
    /// By least squares: the measurements of an even image of 1, without a dark level.
    Fitted(DVector<f64>),
    /// All patterns see the mean with this weight, so that the mean cannot be told from a dark level. The
    /// dark level counts as 0.
    Shared(f64),
}

/// An image and the dark level of its measurements.
pub(super) struct Fit {
    pub pixels: DVector<f64>,
    pub dark: DarkLevel,
}

/// Rounding of sums, relative to the numbers.
const ROUNDING: f64 = 1e-12;

impl Prepared {
    pub(super) fn new(
        own: &OwnMatrix,
        settings: &MatrixSettings,
        at: Vec<usize>,
    ) -> Result<Self, MatrixError> {
        let raw = own.patterns.select_rows(&at);
        let area = own.size.area();
        let mut patterns = raw.clone();
        if settings.dark {
            let means = raw.row_mean();
            patterns.row_iter_mut().for_each(|mut row| row -= &means);
            // What rounding leaves of equal numbers is no contrast.
            if patterns.norm() <= ROUNDING * raw.norm() {
                patterns.fill(0.0);
            }
        }
        let even = patterns.column_sum();
        // The mean has no penalty only in a basis with the mean as an atom.
        let free = settings.atoms.is_none()
            && (settings.basis != Basis::Pixel
                || settings.method == MatrixMethod::Penalty(Penalty::TotalVariation));
        let seen = |even: &DVector<f64>| even.norm() > 1e-9 * raw.norm();
        let shared = raw.column_sum();
        let mean = match free {
            true if seen(&even) => {
                let u = &even / even.norm();
                patterns -= &u * (u.transpose() * &patterns);
                Mean::Fitted(even)
            }
            true if settings.dark && seen(&shared) => Mean::Shared(shared.mean()),
            _ => Mean::Kept,
        };
        let condensed = Condensed::of(&patterns);
        let mut patterns = condensed.as_ref().map_or(patterns, Condensed::rows);
        let norm = solvers::norm(&patterns).max(f64::MIN_POSITIVE);
        patterns /= norm;
        let atoms = match &settings.atoms {
            None => Atoms::Basis(own.transform(settings.basis)?),
            Some(images) => {
                let images: Vec<f64> = images.iter().map(|&v| v.into()).collect();
                let mut images = DMatrix::from_column_slice(area, images.len() / area, &images);
                for mut image in images.column_iter_mut() {
                    image.try_normalize_mut(0.0);
                }
                Atoms::Own(images)
            }
        };
        Ok(Self {
            size: own.size,
            at,
            patterns,
            atoms,
            norm,
            raw,
            mean,
            condensed,
            fits_dark: settings.dark,
            expected: OnceLock::new(),
            gram: OnceLock::new(),
        })
    }

    /// The problem of these measurements, of which those at the positions are used.
    pub(super) fn problem(&self, y: &[f64]) -> Problem<'_> {
        let raw_y = DVector::from_iterator(self.at.len(), self.at.iter().map(|&k| y[k]));
        let mut values = raw_y.clone();
        if self.fits_dark {
            values.add_scalar_mut(-raw_y.mean());
            // What rounding leaves of equal numbers is no contrast.
            if values.norm() <= ROUNDING * raw_y.norm() {
                values.fill(0.0);
            }
        }
        if let Mean::Fitted(even) = &self.mean {
            let u = even / even.norm();
            values -= &u * u.dot(&values);
        }
        let spread = (values.norm_squared() / values.len().max(1) as f64).sqrt();
        let spread = if spread > 0.0 { spread } else { 1.0 };
        values /= spread;
        let y = match &self.condensed {
            Some(condensed) => condensed.values(&values),
            None => values,
        };
        Problem { of: self, y, unit: spread / self.norm, raw_y }
    }

    /// The expected energy is the measured energy, which is 1 for each measurement.
    fn expected(&self) -> &Expected {
        self.expected.get_or_init(|| {
            let (seen, mut scale) = match &self.atoms {
                Atoms::Own(images) => {
                    (&self.patterns * images, DVector::from_element(images.ncols(), 1.0))
                }
                Atoms::Basis(transform) => {
                    let mut seen = self.patterns.clone();
                    for mut row in seen.row_iter_mut() {
                        let mut image: Vec<f32> = row.iter().map(|&w| w as f32).collect();
                        transform.analyse(&mut image);
                        row.iter_mut().zip(&image).for_each(|(w, &c)| *w = c.into());
                    }
                    let frequencies = transform.basis().frequencies(self.size);
                    let scale = frequencies.iter().map(|f| 1.0 / f64::from(f.max(1.0)));
                    (seen, DVector::from_iterator(frequencies.len(), scale))
                }
            };
            let energies =
                seen.column_iter().zip(scale.iter()).map(|(atom, s)| atom.norm_squared() * s * s);
            let expected: f64 = energies.sum();
            if expected > 0.0 {
                scale *= (self.at.len() as f64 / expected).sqrt();
            }
            Expected { seen, scale }
        })
    }

    /// Algorithm 1 with noise of this strength, for any number of problems.
    pub(super) fn pursuit(&self, noise: f64) -> Pursuit<'_> {
        let Expected { seen, scale } = self.expected();
        Pursuit { scale, dictionary: solvers::ridged(seen, scale, noise) }
    }

    fn pixels(&self, coefficients: &DVector<f64>) -> DVector<f64> {
        match &self.atoms {
            Atoms::Own(images) => images * coefficients,
            Atoms::Basis(transform) => {
                let mut image: Vec<f32> = coefficients.iter().map(|&c| c as f32).collect();
                transform.synthesise(&mut image);
                DVector::from_iterator(image.len(), image.iter().map(|&v| v.into()))
            }
        }
    }
}

/// A dictionary for OMP, ready for problems of one [`Prepared`].
pub(super) struct Pursuit<'p> {
    scale: &'p DVector<f64>,
    dictionary: DenseDictionary<f64>,
}

impl Problem<'_> {
    /// The image at each strength.
    pub(super) fn penalised(&self, penalty: Penalty, strengths: &[f64]) -> Vec<Fit> {
        let of = self.of;
        if penalty == Penalty::TotalVariation {
            let images = solvers::total_variation(of.size, &of.patterns, &self.y, strengths);
            return images.into_iter().map(|x| self.image(x)).collect();
        }
        let Expected { seen, scale } = of.expected();
        let found = match penalty {
            Penalty::Tikhonov => {
                let gram = of.gram.get_or_init(|| solvers::scaled_gram(seen, scale));
                solvers::tikhonov(seen, gram, &self.y, scale, strengths)
            }
            _ => {
                let free = usize::from(matches!(of.mean, Mean::Fitted(_)));
                solvers::sparse(seen, &self.y, scale, free, strengths)
            }
        };
        found.into_iter().map(|c| self.image(of.pixels(&c))).collect()
    }

    /// The image, number of atoms and reason to stop for each of these numbers; the last number is
    /// the largest.
    pub(super) fn omp(
        &self,
        Pursuit { scale, dictionary }: &Pursuit<'_>,
        sparsities: &[usize],
        non_negative: bool,
    ) -> Result<Vec<(Fit, usize, Stop)>, MatrixError> {
        let found = solvers::omp(dictionary, &self.y, scale, sparsities, non_negative)?;
        Ok(found
            .into_iter()
            .map(|Chosen { coefficients, size, stop }| {
                (self.image(self.of.pixels(&coefficients)), size, stop)
            })
            .collect())
    }

    /// The image in the measurements' units, with the mean and the dark level that fit the measurements
    /// best.
    fn image(&self, pixels: DVector<f64>) -> Fit {
        let mut pixels = pixels * self.unit;
        let left = &self.raw_y - &self.of.raw * &pixels;
        let offset = left.mean();
        match &self.of.mean {
            Mean::Kept if self.of.fits_dark => Fit { pixels, dark: DarkLevel::Fitted(offset) },
            Mean::Kept => Fit { pixels, dark: DarkLevel::LeftOut },
            Mean::Shared(weight) => {
                pixels.add_scalar_mut(offset / weight);
                Fit { pixels, dark: DarkLevel::Unknown }
            }
            Mean::Fitted(even) => {
                // Without a dark level in the fit, `even` is not centred, and neither is what is left.
                let mean = even.dot(&left) / even.norm_squared();
                pixels.add_scalar_mut(mean);
                let dark = match self.of.fits_dark {
                    true => DarkLevel::Fitted((&self.raw_y - &self.of.raw * &pixels).mean()),
                    false => DarkLevel::LeftOut,
                };
                Fit { pixels, dark }
            }
        }
    }
}

//! Methods of reconstruction behind one trait, and the list of the built-in ones.
//!
//! [`Reconstruct`] is what a method is: a name, and measurements to an image. A method of somebody else's implements the
//! trait and stands beside the built-in ones wherever a `dyn Reconstruct` is taken. [`Method`] is a built-in method by
//! name; [`Method::prepare`] checks the [settings](MethodSettings) once and gives a `dyn Reconstruct`.
//!
//! A new built-in method is a file in `methods/` that defines its `METHOD`, and an entry in `methods.rs`. Argument
//! parsers, help texts, comparisons, reports and the live page take their lists from [`Method::ALL`].

use super::report::Reconstruction;
use super::{Completion, MatrixMethod, OmpSettings, ReconstructError, Sparsity, Strength, methods};
use crate::{Backend, Basis, Measurements};
use std::fmt;
use std::str::FromStr;
use std::sync::Arc;
use thiserror::Error;

/// Makes an image from measurements, for one measurement after another.
///
/// ```
/// use nirspi_recon::reconstruct::{Method, MethodSettings, Reconstruct};
/// use nirspi_recon::{Measurements, Order, Rows, Side};
///
/// let side = Side::new(16)?;
/// let mut scene: Vec<f64> = (0..256).map(|p| f64::from(p / 16 > 7)).collect();
/// nirspi_recon::fwht(&mut scene)?;
/// let all = Measurements::from_differential(&Rows::natural(side), &scene)?;
/// let part = all.take(Some(&Order::ZigZag), 0.3)?;
/// for method in Method::ALL {
///     let found = method.prepare(&MethodSettings::default())?.reconstruct(&part)?;
///     println!("{}", found.report);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Reconstruct: Send + Sync {
    /// The method in a few words, as tables and captions show it.
    fn name(&self) -> &str;

    /// The image of one measurement, in the measurements' units.
    ///
    /// # Errors
    /// [`ReconstructError`] if there is no image; a method of one's own says why by [`ReconstructError::Failed`].
    fn reconstruct(&self, measurements: &Measurements) -> Result<Reconstruction, ReconstructError>;

    /// The images of a video's frames. A method that can start a frame from the one before overrides this, and marks
    /// such frames as [`warm`](super::Report::warm).
    ///
    /// # Errors
    /// As [`Reconstruct::reconstruct`].
    fn reconstruct_video(
        &self,
        frames: &[Measurements],
    ) -> Result<Vec<Reconstruction>, ReconstructError> {
        frames.iter().map(|frame| self.reconstruct(frame)).collect()
    }
}

/// A built-in method.
#[derive(Clone, Copy)]
pub struct Method(pub(super) &'static Entry);

/// All that a built-in method is known by.
pub(super) struct Entry {
    /// As it is written on the command line.
    pub argument: &'static str,
    /// In a few words.
    pub name: &'static str,
    /// In one line, for help texts.
    pub about: &'static str,
    /// The settings that the method takes.
    pub takes: &'static [Setting],
    /// The method for patterns of the user's own, if there is one.
    pub with_matrix: Option<MatrixMethod>,
    /// Makes the method ready.
    pub prepare: fn(&MethodSettings) -> Result<Box<dyn Reconstruct>, ReconstructError>,
}

impl Method {
    /// Every built-in method, the simplest first.
    pub const ALL: &'static [Self] = methods::ALL;

    /// Orthogonal matching pursuit, the default.
    pub const OMP: Self = methods::OMP;

    /// In a few words: `total variation`.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.0.name
    }

    /// The word that [`Method::from_str`] reads: `tv`.
    #[must_use]
    pub fn argument(self) -> &'static str {
        self.0.argument
    }

    /// What the method does, in one line.
    #[must_use]
    pub fn about(self) -> &'static str {
        self.0.about
    }

    /// Whether a setting means anything to the method.
    #[must_use]
    pub fn takes(self, setting: Setting) -> bool {
        self.0.takes.contains(&setting)
    }

    /// The method for patterns of the user's own instead of Hadamard rows ([`OwnMatrix`](super::OwnMatrix)), if there
    /// is one.
    #[must_use]
    pub fn with_matrix(self) -> Option<MatrixMethod> {
        self.0.with_matrix
    }

    /// Checks the settings and makes the method ready.
    ///
    /// # Errors
    /// [`ReconstructError`] if a setting is out of range, belongs to another method, or names a GPU that is not there.
    pub fn prepare(
        self,
        settings: &MethodSettings,
    ) -> Result<Box<dyn Reconstruct>, ReconstructError> {
        settings.check(self)?;
        (self.0.prepare)(settings)
    }

    /// The words of the methods for which `holds`, as a list for messages: `tikhonov, fista or tv`.
    #[must_use]
    pub fn listed(holds: impl Fn(Self) -> bool) -> String {
        let words: Vec<&str> =
            Self::ALL.iter().filter(|method| holds(**method)).map(|m| m.argument()).collect();
        match words.split_last() {
            Some((last, [])) => (*last).to_owned(),
            Some((last, others)) => format!("{} or {last}", others.join(", ")),
            None => String::new(),
        }
    }
}

impl Default for Method {
    fn default() -> Self {
        Self::OMP
    }
}

impl PartialEq for Method {
    fn eq(&self, other: &Self) -> bool {
        self.argument() == other.argument()
    }
}

impl Eq for Method {}

impl fmt::Debug for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Method({})", self.argument())
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.argument())
    }
}

/// The name of no method.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("unknown method {found:?}, expected {}", Method::listed(|_| true))]
pub struct ParseMethodError {
    /// What was given.
    pub found: String,
}

impl FromStr for Method {
    type Err = ParseMethodError;

    fn from_str(word: &str) -> Result<Self, ParseMethodError> {
        let named = Self::ALL.iter().find(|method| method.argument() == word);
        named.copied().ok_or_else(|| ParseMethodError { found: word.to_owned() })
    }
}

/// A setting that means something to some methods only.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Setting {
    /// [`MethodSettings::basis`]. A method without one ignores it.
    Basis,
    /// [`MethodSettings::dictionary`].
    Dictionary,
    /// [`MethodSettings::strength`], where it is fixed.
    Strength,
    /// [`MethodSettings::non_negative`].
    NonNegative,
    /// [`MethodSettings::backend`], where it is a GPU.
    Backend,
    /// [`Reconstruct::reconstruct_video`] starts frames from the ones before.
    WarmStart,
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Basis => "basis",
            Self::Dictionary => "dictionary",
            Self::Strength => "strength",
            Self::NonNegative => "non-negative",
            Self::Backend => "backend",
            Self::WarmStart => "warm-start",
        })
    }
}

/// Images of the user's own as atoms.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnAtoms {
    /// What reports call them.
    pub name: String,
    /// Row-major images of the measurements' side, one after another.
    pub values: Arc<[f32]>,
}

/// What to ask of a [`Method`]. The defaults are those of every method's own settings.
#[derive(Debug, Clone, PartialEq)]
pub struct MethodSettings {
    /// Basis in which the image is sparse.
    pub basis: Basis,
    /// OMP: atoms of the user's own instead of a basis.
    pub dictionary: Option<OwnAtoms>,
    /// OMP: how many atoms.
    pub sparsity: Sparsity,
    /// OMP: norm of the residual, relative to the measurements', at which no more atoms are chosen.
    pub residual: f64,
    /// OMP: Algorithm 1 as printed, without prior and completion ([`OmpSettings::as_printed`]).
    pub as_printed: bool,
    /// OMP: coefficients of 0 or more.
    pub non_negative: bool,
    /// How strong a penalty is.
    pub strength: Strength,
    /// Whether measured rows keep their values or take those of the fit. `None`: [`Completion::Measured`], but [`Completion::Sparse`] for
    /// Algorithm 1 as printed and with coefficients of 0 or more, because noise of the measured rows would make pixels
    /// negative.
    pub completion: Option<Completion>,
    /// What computes.
    pub backend: Backend,
}

impl Default for MethodSettings {
    fn default() -> Self {
        let OmpSettings { basis, sparsity, residual, backend, .. } = OmpSettings::default();
        Self {
            basis,
            dictionary: None,
            sparsity,
            residual,
            as_printed: false,
            non_negative: false,
            strength: Strength::default(),
            completion: None,
            backend,
        }
    }
}

impl MethodSettings {
    /// Finds mistakes before any work is done.
    ///
    /// # Errors
    /// [`ReconstructError`] if a setting is out of range or belongs to another method.
    pub fn check(&self, method: Method) -> Result<(), ReconstructError> {
        let refuse =
            |setting, found, expected| Err(ReconstructError::Setting { setting, found, expected });
        if !(0.0..1.0).contains(&self.residual) {
            return refuse("residual", self.residual, "0 or more, below 1");
        }
        if self.sparsity == Sparsity::Fixed(0) {
            return refuse("sparsity", 0.0, "at least 1");
        }
        if let Some(&setting) = self.asked().iter().find(|setting| !method.takes(**setting)) {
            return Err(ReconstructError::NotTaken { setting, method });
        }
        if self.non_negative && self.dictionary.is_none() && self.basis != Basis::Pixel {
            return Err(ReconstructError::Signed { basis: self.basis });
        }
        self.strength.check()
    }

    /// Settings that only some methods take and that are not at their defaults.
    fn asked(&self) -> Vec<Setting> {
        let gpu = matches!(self.backend, Backend::Wgpu | Backend::Cuda);
        [
            (self.dictionary.is_some(), Setting::Dictionary),
            (gpu, Setting::Backend),
            (self.non_negative, Setting::NonNegative),
            (matches!(self.strength, Strength::Fixed(_)), Setting::Strength),
        ]
        .into_iter()
        .filter_map(|(asked, setting)| asked.then_some(setting))
        .collect()
    }

    /// These settings with those at their defaults that `method` does not take: what is meant where several methods are
    /// made ready from one list of arguments.
    #[must_use]
    pub fn taken_by(&self, method: Method) -> Self {
        let default = Self::default();
        let mut taken = self.clone();
        for setting in self.asked().into_iter().filter(|setting| !method.takes(*setting)) {
            match setting {
                Setting::Dictionary => taken.dictionary = None,
                Setting::Strength => taken.strength = default.strength,
                Setting::NonNegative => taken.non_negative = false,
                Setting::Backend => taken.backend = default.backend,
                Setting::Basis | Setting::WarmStart => {}
            }
        }
        taken
    }

    /// Whether measured rows keep their values or take those of the fit.
    #[must_use]
    pub fn completion(&self) -> Completion {
        let sparse = self.as_printed || self.non_negative;
        let default = if sparse { Completion::Sparse } else { Completion::Measured };
        self.completion.unwrap_or(default)
    }
}

#[cfg(test)]
mod tests;

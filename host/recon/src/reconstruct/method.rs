//! Methods of reconstruction behind one trait, and the list of the built-in ones.
//!
//! [`Reconstruct`] is the interface of a method: a name, and an image from measurements. A user's
//! own method implements the trait and works wherever a `dyn Reconstruct` is accepted. [`Method`]
//! is a built-in method by name; [`Method::prepare`] checks the [settings](MethodSettings) once and
//! gives a `dyn Reconstruct`.
//!
//! A new built-in method is a file in `methods/` that defines its `METHOD`, and an entry in
//! `methods.rs`. Argument parsers, help texts, comparisons, reports and the live page take their
//! lists from [`Method::ALL`].

use super::kind::GoingOn;
use super::prior::SharedNetwork;
use super::report::{Reconstruction, Report};
use super::{
    MatrixMethod, MatrixSettings, OmpSettings, ReconstructError, Recursive, Sparsity, Strength,
};
use crate::{Backend, Basis, Measurements};
use rayon::prelude::*;
use std::fmt;
use std::str::FromStr;
use std::sync::Arc;
use thiserror::Error;

/// Makes images from measurements, one measurement after another.
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
/// for method in Method::ALL.iter().filter(|method| !method.needs_network()) {
///     let found = method.prepare(&MethodSettings::default())?.reconstruct(&part)?;
///     println!("{}", found.report);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Reconstruct: Send + Sync {
    /// The method's name in a few words, for tables and captions.
    fn name(&self) -> &str;

    /// The image of one measurement, in the measurements' units.
    ///
    /// # Errors
    /// [`ReconstructError`] if there is no image. A user's own method gives its reason in
    /// [`ReconstructError::Failed`].
    fn reconstruct(&self, measurements: &Measurements) -> Result<Reconstruction, ReconstructError>;

    /// As [`reconstruct`](Self::reconstruct), with the pixels written to `pixels`. A fast method
    /// overrides this function: for a stack of thousands of images, memory of its own for each image
    /// takes a large part of the time.
    ///
    /// # Errors
    /// As [`Reconstruct::reconstruct`].
    ///
    /// # Panics
    /// If `pixels` has not one place for each pixel.
    fn reconstruct_into(
        &self,
        measurements: &Measurements,
        pixels: &mut [f32],
    ) -> Result<Report, ReconstructError> {
        let made = self.reconstruct(measurements)?;
        pixels.copy_from_slice(made.image.pixels());
        Ok(made.report)
    }

    /// The images of measurements of one kind, in their order; [`stack`](super::stack) says what a kind
    /// is. A method overrides this function if it chooses something for each measurement that is the
    /// same for all of a kind, or makes many images at once faster than one by one. It calls `going_on`
    /// before each.
    ///
    /// # Errors
    /// As [`Reconstruct::reconstruct`], of one of the measurements that have no image; or that of `going_on`.
    fn reconstruct_kind(
        &self,
        measurements: &[Measurements],
        going_on: GoingOn<'_>,
    ) -> Result<Vec<Reconstruction>, ReconstructError> {
        let one = |measured| going_on().and_then(|()| self.reconstruct(measured));
        measurements.par_iter().map(one).collect()
    }

    /// Whether the image of a measurement is the same alone and among others of its kind.
    fn is_of_each(&self) -> bool {
        false
    }

    /// For a method that chooses among others: the choice for measurements like `first`, for a stack
    /// of such measurements, which it would be slow to judge one by one. `None`: every other method
    /// is its own choice.
    ///
    /// # Errors
    /// As [`Reconstruct::reconstruct`].
    fn settled(
        &self,
        _first: &Measurements,
    ) -> Result<Option<Arc<dyn Reconstruct>>, ReconstructError> {
        Ok(None)
    }

    /// What the frames of a video have shown before the first frame, for
    /// [`next_frame`](Self::next_frame); `None` for a method that makes each frame by itself, or
    /// that needs all frames at once.
    ///
    /// # Errors
    /// [`ReconstructError`] if the method's settings allow no video.
    fn begin_video(&self) -> Result<Option<Recursive>, ReconstructError> {
        Ok(None)
    }

    /// The image of the next frame of a video, which may start from the frames before. Such a frame
    /// is marked as [`warm`](super::Report::warm).
    ///
    /// # Errors
    /// As [`Reconstruct::reconstruct`].
    fn next_frame(
        &self,
        _past: &mut Recursive,
        frame: &Measurements,
    ) -> Result<Reconstruction, ReconstructError> {
        self.reconstruct(frame)
    }

    /// The images of a video's frames: each the [next](Self::next_frame) after
    /// [the beginning](Self::begin_video). A method that can start a frame from the previous one in
    /// another way overrides this function.
    ///
    /// # Errors
    /// As [`Reconstruct::reconstruct`].
    fn reconstruct_video(
        &self,
        frames: &[Measurements],
    ) -> Result<Vec<Reconstruction>, ReconstructError> {
        match self.begin_video()? {
            Some(mut past) => {
                frames.iter().map(|frame| self.next_frame(&mut past, frame)).collect()
            }
            None => frames.iter().map(|frame| self.reconstruct(frame)).collect(),
        }
    }
}

/// A built-in method.
#[derive(Clone, Copy)]
pub struct Method(pub(super) &'static Entry);

/// The facts of a built-in method.
pub(super) struct Entry {
    /// The method's name on the command line.
    pub argument: &'static str,
    /// The method's name in a few words.
    pub name: &'static str,
    /// What the method does, in one line for help texts.
    pub about: &'static str,
    /// The settings that the method takes.
    pub takes: &'static [Setting],
    /// The method for a user's own patterns, if there is one.
    pub with_matrix: Option<MatrixMethod>,
    /// Checks the settings and prepares the method.
    pub prepare: fn(&MethodSettings) -> Result<Box<dyn Reconstruct>, ReconstructError>,
}

impl Method {
    /// The method's name in a few words, for example `total variation`.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.0.name
    }

    /// The word that [`Method::from_str`] reads, for example `tv`.
    #[must_use]
    pub fn argument(self) -> &'static str {
        self.0.argument
    }

    /// What the method does, in one line.
    #[must_use]
    pub fn about(self) -> &'static str {
        self.0.about
    }

    /// Whether the method needs [`MethodSettings::network`], without which
    /// [`prepare`](Self::prepare) is an error.
    #[must_use]
    pub fn needs_network(self) -> bool {
        self == Self::PRIOR
    }

    /// Whether the method uses a setting.
    #[must_use]
    pub fn takes(self, setting: Setting) -> bool {
        self.0.takes.contains(&setting)
    }

    /// The method for a user's own patterns instead of Hadamard rows (`nirspi-own`), if there is one.
    #[must_use]
    pub fn with_matrix(self) -> Option<MatrixMethod> {
        self.0.with_matrix
    }

    /// The settings of the method for a user's own patterns.
    ///
    /// # Errors
    /// [`ReconstructError::NeedsRows`] if the method needs Hadamard rows.
    pub fn matrix_settings(
        self,
        settings: &MethodSettings,
    ) -> Result<MatrixSettings, ReconstructError> {
        let method = self.with_matrix().ok_or(ReconstructError::NeedsRows { method: self })?;
        Ok(MatrixSettings {
            basis: settings.basis,
            atoms: settings.dictionary.as_ref().map(|atoms| atoms.values.to_vec()),
            strength: match settings.strength {
                Strength::Fixed(strength) => Some(strength),
                Strength::CrossValidated { .. } => None,
            },
            sparsity: match settings.sparsity {
                Sparsity::Fixed(atoms) => Some(atoms),
                Sparsity::CrossValidated { .. } | Sparsity::Noise => None,
            },
            non_negative: settings.non_negative,
            ..MatrixSettings::new(method)
        })
    }

    /// The method that has this one for a user's own patterns.
    #[must_use]
    pub fn of_matrix(matrix: MatrixMethod) -> Option<Self> {
        Self::ALL.iter().copied().find(|method| method.with_matrix() == Some(matrix))
    }

    /// Checks the settings and prepares the method.
    ///
    /// # Errors
    /// [`ReconstructError`] if a setting is out of range, belongs to another method, or names a GPU
    /// that is missing, and if the method needs a network and the settings hold none.
    pub fn prepare(
        self,
        settings: &MethodSettings,
    ) -> Result<Box<dyn Reconstruct>, ReconstructError> {
        settings.check(self)?;
        (self.0.prepare)(settings)
    }

    /// The command-line words of the methods for which `holds`, as a list for messages:
    /// `tikhonov, fista or tv`.
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
        Self::AUTO
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

/// Error: no method has this name.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("unknown method {found:?}, expected {}", Method::listed(|_| true))]
pub struct ParseMethodError {
    /// The name that was given.
    pub found: String,
}

impl FromStr for Method {
    type Err = ParseMethodError;

    fn from_str(word: &str) -> Result<Self, ParseMethodError> {
        let named = Self::ALL.iter().find(|method| method.argument() == word);
        named.copied().ok_or_else(|| ParseMethodError { found: word.to_owned() })
    }
}

/// A setting that only some methods use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Setting {
    /// [`MethodSettings::basis`]. A method without one ignores it.
    Basis,
    /// [`MethodSettings::dictionary`].
    Dictionary,
    /// [`MethodSettings::sparsity`], if it is not cross-validated.
    Sparsity,
    /// [`MethodSettings::residual`], if it is not 0.
    Residual,
    /// [`MethodSettings::as_printed`].
    AsPrinted,
    /// [`MethodSettings::strength`], if it is fixed.
    Strength,
    /// [`MethodSettings::non_negative`].
    NonNegative,
    /// [`MethodSettings::backend`], if it is a GPU.
    Backend,
    /// [`Reconstruct::reconstruct_video`] starts a frame from the previous one.
    WarmStart,
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Basis => "basis",
            Self::Dictionary => "dictionary",
            Self::Sparsity => "sparsity",
            Self::Residual => "residual",
            Self::AsPrinted => "as-printed",
            Self::Strength => "strength",
            Self::NonNegative => "non-negative",
            Self::Backend => "backend",
            Self::WarmStart => "warm-start",
        })
    }
}

/// A user's own images as atoms.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnAtoms {
    /// The atoms' name in reports.
    pub name: String,
    /// Row-major images of the measurements' side, one after another.
    pub values: Arc<[f32]>,
}

/// Settings of a [`Method`]. The defaults are those of every method's own settings.
#[derive(Debug, Clone, PartialEq)]
pub struct MethodSettings {
    /// Basis in which the image is sparse.
    pub basis: Basis,
    /// OMP: a user's own atoms instead of a basis.
    pub dictionary: Option<OwnAtoms>,
    /// OMP: how many atoms.
    pub sparsity: Sparsity,
    /// OMP: norm of the residual, relative to the measurements' norm, at which the pursuit stops.
    pub residual: f64,
    /// OMP: Algorithm 1 as printed, without prior and completion ([`OmpSettings::as_printed`]).
    pub as_printed: bool,
    /// OMP: non-negative coefficients.
    pub non_negative: bool,
    /// How strong a penalty is.
    pub strength: Strength,
    /// The backend.
    pub backend: Backend,
    /// The learned prior's network. Other methods ignore it. `nirspi_nets::prior::settings` gives
    /// settings that hold the shipped one; without any, [`Method::PRIOR`] cannot be prepared.
    pub network: Option<SharedNetwork>,
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
            backend,
            network: None,
        }
    }
}

impl MethodSettings {
    /// Checks the settings before any work is done.
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

    /// Settings that only some methods use and that differ from their defaults.
    fn asked(&self) -> Vec<Setting> {
        let gpu = matches!(self.backend, Backend::Wgpu | Backend::Cuda);
        [
            (self.dictionary.is_some(), Setting::Dictionary),
            (self.as_printed, Setting::AsPrinted),
            (self.sparsity != Self::default().sparsity, Setting::Sparsity),
            (self.residual != 0.0, Setting::Residual),
            (gpu, Setting::Backend),
            (self.non_negative, Setting::NonNegative),
            (matches!(self.strength, Strength::Fixed(_)), Setting::Strength),
        ]
        .into_iter()
        .filter_map(|(asked, setting)| asked.then_some(setting))
        .collect()
    }

    /// These settings, with the settings that `method` does not use at their defaults. With this
    /// function, one list of arguments prepares several methods.
    #[must_use]
    pub fn taken_by(&self, method: Method) -> Self {
        let default = Self::default();
        let mut taken = self.clone();
        for setting in self.asked().into_iter().filter(|setting| !method.takes(*setting)) {
            match setting {
                Setting::Dictionary => taken.dictionary = None,
                Setting::Sparsity => taken.sparsity = default.sparsity,
                Setting::Residual => taken.residual = default.residual,
                Setting::AsPrinted => taken.as_printed = false,
                Setting::Strength => taken.strength = default.strength,
                Setting::NonNegative => taken.non_negative = false,
                Setting::Backend => taken.backend = default.backend,
                Setting::Basis | Setting::WarmStart => {}
            }
        }
        taken
    }
}

#[cfg(test)]
mod tests;

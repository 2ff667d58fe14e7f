//! Arguments that say how to make an image from measurements, and what the report says of it.

use super::{Usage, backend};
use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use nirspi::files::npy::read_stack;
use nirspi_recon::omp::{Backend, Stop};
use nirspi_recon::reconstruct::{
    self, Completion, OmpReconstruction, OmpSettings, Penalty, RegularisedSettings, Sparsity,
    Strength,
};
use nirspi_recon::{Basis, Image, Measurements};
use serde::Serialize;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// How to invert.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Inverse Walsh-Hadamard transform; patterns that were not measured count as zero
    Hadamard,
    /// Orthogonal matching pursuit (the paper's Algorithm 1) in a sparsifying basis
    Omp,
    /// Least image that agrees with the measurements: as Hadamard rows are orthogonal, the same as hadamard
    PseudoInverse,
    /// Most likely image if coefficients fall as one over frequency (Tikhonov, a covariance prior)
    Tikhonov,
    /// Small sum of magnitudes of the coefficients (FISTA)
    Fista,
    /// Small total variation (Chambolle and Pock)
    Tv,
}

impl Method {
    /// In a few words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Hadamard => "inverse Hadamard transform",
            Self::Omp => "OMP",
            Self::PseudoInverse => "pseudo-inverse",
            Self::Tikhonov => "Tikhonov",
            Self::Fista => "FISTA",
            Self::Tv => "total variation",
        }
    }

    /// As it is written on the command line.
    pub fn argument(self) -> &'static str {
        match self {
            Self::Hadamard => "hadamard",
            Self::Omp => "omp",
            Self::PseudoInverse => "pseudo-inverse",
            Self::Tikhonov => "tikhonov",
            Self::Fista => "fista",
            Self::Tv => "tv",
        }
    }

    fn penalty(self) -> Option<Penalty> {
        match self {
            Self::Hadamard | Self::PseudoInverse | Self::Omp => None,
            Self::Tikhonov => Some(Penalty::Tikhonov),
            Self::Fista => Some(Penalty::Sparse),
            Self::Tv => Some(Penalty::TotalVariation),
        }
    }
}

/// What becomes of patterns that were measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Keep {
    /// They keep their values, the others are predicted
    Measured,
    /// All are the sparse representation's
    Sparse,
}

/// How to make the image.
#[derive(Debug, Clone, Args)]
pub struct MethodArgs {
    /// How to make the image
    #[arg(long, value_enum, default_value_t = Method::Omp)]
    pub method: Method,
    /// Basis in which the image is sparse: dct, haar, daubechies4, pixel
    #[arg(long, value_name = "BASIS", default_value = "dct")]
    pub basis: String,
    /// OMP: images of your own (N, n, n) as atoms, instead of a basis
    #[arg(long, value_name = "NPY", conflicts_with = "basis")]
    pub dictionary: Option<PathBuf>,
    /// Atoms to choose; without it, the number that predicts held-back measurements best
    #[arg(long, value_name = "K")]
    pub sparsity: Option<usize>,
    /// Stop when the residual's norm is this share of the measurements'
    #[arg(long, value_name = "0..1", default_value_t = 0.0, allow_negative_numbers = true)]
    pub residual: f64,
    /// OMP: choose atoms until no more than the estimated noise is left of the measurements
    #[arg(long, conflicts_with_all = ["sparsity", "as_printed"])]
    pub stop_at_noise: bool,
    /// Strength of the penalty of tikhonov, fista and tv, relative to what noise and prior call for; without it, the one
    /// that predicts held-back measurements best
    #[arg(long, value_name = "S", allow_negative_numbers = true)]
    pub strength: Option<f64>,
    /// The paper's Algorithm 1 as printed: no prior, no cross-validation, an exactly sparse image
    #[arg(long, requires = "sparsity", conflicts_with = "keep")]
    pub as_printed: bool,
    /// OMP: no negative light, in single pixels (--basis pixel) or images of your own (--dictionary)
    #[arg(long, conflicts_with = "as_printed")]
    pub non_negative: bool,
    /// What becomes of patterns that were measured; without it, they are kept, but with --non-negative, whose light they
    /// would take below 0
    #[arg(long, value_enum)]
    pub keep: Option<Keep>,
    /// OMP: what computes: auto, cpu, wgpu, cuda; one image is too little for a GPU, so auto is the cpu
    #[arg(long, value_name = "BACKEND", default_value_t = Backend::Auto)]
    pub backend: Backend,
}

impl Default for MethodArgs {
    /// As if nothing had been said.
    fn default() -> Self {
        Self {
            method: Method::Omp,
            basis: "dct".to_owned(),
            dictionary: None,
            sparsity: None,
            residual: 0.0,
            stop_at_noise: false,
            strength: None,
            as_printed: false,
            non_negative: false,
            keep: None,
            backend: Backend::Auto,
        }
    }
}

impl MethodArgs {
    /// Finds mistakes before any file is opened.
    pub fn check(&self) -> Result<()> {
        self.basis()?;
        if !(0.0..1.0).contains(&self.residual) {
            let found = self.residual;
            return Err(Usage(format!("--residual is {found}, expected 0 or more, below 1")).into());
        }
        if self.sparsity == Some(0) {
            return Err(Usage("--sparsity is 0, expected at least 1".to_owned()).into());
        }
        if self.dictionary.is_some() && self.method != Method::Omp {
            return Err(Usage("--dictionary belongs to --method omp".to_owned()).into());
        }
        if !matches!(self.backend, Backend::Auto | Backend::Cpu) && self.method != Method::Omp {
            let text = format!("--backend {} belongs to --method omp", self.backend);
            return Err(Usage(text).into());
        }
        if self.non_negative && self.method != Method::Omp {
            return Err(Usage("--non-negative belongs to --method omp".to_owned()).into());
        }
        if self.non_negative && self.dictionary.is_none() && self.basis()? != Basis::Pixel {
            let text = format!(
                "--non-negative in the {} basis, whose atoms are negative themselves, expected --basis pixel or --dictionary",
                self.basis
            );
            return Err(Usage(text).into());
        }
        if let Some(found) = self.strength {
            if !(found > 0.0 && found <= 1e6) {
                let text = format!("--strength is {found}, expected more than 0, at most 1e6");
                return Err(Usage(text).into());
            }
            if self.method.penalty().is_none() {
                let text = "--strength belongs to --method tikhonov, fista or tv";
                return Err(Usage(text.to_owned()).into());
            }
        }
        Ok(())
    }

    /// The basis asked for.
    pub fn basis(&self) -> Result<Basis> {
        Basis::from_str(&self.basis).map_err(|error| Usage(format!("--basis: {error}")).into())
    }

    fn kept(&self) -> Keep {
        let sparse = self.as_printed || self.non_negative;
        self.keep.unwrap_or(if sparse { Keep::Sparse } else { Keep::Measured })
    }

    /// What to ask of OMP, and the name of the GPU that computes one image, if one does.
    pub fn omp_settings(&self) -> Result<(OmpSettings, Option<String>)> {
        let device = backend::choose(self.backend, 1)?.as_ref().map(backend::name);
        let backend = if device.is_some() { self.backend } else { Backend::Cpu };
        let mut settings = OmpSettings {
            basis: self.basis()?,
            backend,
            residual: self.residual,
            completion: self.kept().completion(),
            non_negative: self.non_negative,
            ..OmpSettings::default()
        };
        if let Some(atoms) = self.sparsity {
            settings.sparsity = Sparsity::Fixed(atoms);
            if self.as_printed {
                let printed = OmpSettings::as_printed(settings.basis, atoms);
                settings = OmpSettings { residual: self.residual, backend, ..printed };
            }
        }
        if self.stop_at_noise {
            settings.sparsity = Sparsity::Noise;
        }
        Ok((settings, device))
    }

    /// What OMP found with these settings, on this GPU.
    pub fn solved(
        &self,
        found: OmpReconstruction,
        settings: &OmpSettings,
        device: Option<String>,
    ) -> Solved {
        let omp = OmpReport {
            basis: match &self.dictionary {
                None => self.basis.clone(),
                Some(path) => path.display().to_string(),
            },
            backend: settings.backend.name(),
            device,
            sparsity: found.sparsity,
            keep: self.kept(),
            stop: self.reason(found.stop),
            relative_residual: found.residual,
            unseen_atoms: found.unseen_atoms,
            trust_in_prediction: found.trust,
            noise_of_a_measurement: found.noise,
        };
        let report = Report { method: self.method, omp: Some(omp), penalty: None };
        Solved { image: found.image, report }
    }

    /// Why there are no more atoms.
    pub fn reason(&self, stop: Stop) -> &'static str {
        match stop {
            Stop::Sparsity if self.sparsity.is_some() => "as many atoms as asked for",
            Stop::Sparsity => "more atoms predict no better",
            Stop::Residual if self.stop_at_noise => "no more than noise is left",
            Stop::Residual => "residual reached",
            Stop::NoAtomLeft => "no atom left that explains more",
            Stop::Dependent => "atoms left are combinations of those chosen",
        }
    }
}

/// Images of one's own as atoms, of the side that was measured.
pub fn read_atoms(path: &Path, side: usize) -> Result<Vec<f32>> {
    let atoms = read_stack(path)?;
    let shape = (atoms.height, atoms.width);
    if shape != (side, side) {
        bail!("{}: images of {shape:?}, expected {:?}", path.display(), (side, side));
    }
    Ok(atoms.values)
}

/// What was done and found.
#[derive(Debug, Serialize)]
pub struct Report {
    method: Method,
    #[serde(skip_serializing_if = "Option::is_none")]
    omp: Option<OmpReport>,
    #[serde(skip_serializing_if = "Option::is_none")]
    penalty: Option<PenaltyReport>,
}

#[derive(Debug, Serialize)]
struct PenaltyReport {
    #[serde(skip_serializing_if = "Option::is_none")]
    basis: Option<String>,
    strength: f64,
    keep: Keep,
    relative_residual: f64,
    trust_in_prediction: f64,
    noise_of_a_measurement: f64,
}

#[derive(Debug, Serialize)]
struct OmpReport {
    basis: String,
    backend: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    device: Option<String>,
    sparsity: usize,
    keep: Keep,
    stop: &'static str,
    relative_residual: f64,
    unseen_atoms: usize,
    trust_in_prediction: f64,
    noise_of_a_measurement: f64,
}

impl Report {
    /// In a few words, for a caption.
    pub fn short(&self) -> String {
        match (&self.omp, &self.penalty) {
            (Some(omp), _) => format!("OMP, {} atoms of the {} basis", omp.sparsity, omp.basis),
            (None, Some(penalty)) => self.penalty_name(penalty),
            (None, None) => "inverse Hadamard transform".to_owned(),
        }
    }

    fn penalty_name(&self, penalty: &PenaltyReport) -> String {
        match (&penalty.basis, self.method) {
            (Some(basis), Method::Tikhonov) => format!("Tikhonov, {basis} basis"),
            (Some(basis), _) => format!("FISTA, {basis} basis"),
            (None, _) => "total variation".to_owned(),
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(penalty) = &self.penalty {
            let PenaltyReport { strength, relative_residual, trust_in_prediction, .. } = penalty;
            let name = self.penalty_name(penalty);
            return write!(
                f,
                "{name}: strength {strength}, relative residual {relative_residual:.3}, {:.0} % of \
                 the prediction used",
                100.0 * trust_in_prediction
            );
        }
        let Some(omp) = &self.omp else { return f.write_str("inverse Hadamard transform") };
        let OmpReport { basis, sparsity, stop, relative_residual, unseen_atoms, .. } = omp;
        write!(
            f,
            "OMP: {sparsity} atoms of the {basis} basis, relative residual {relative_residual:.3}, {unseen_atoms} \
             atoms not seen, stopped: {stop}"
        )
    }
}

/// An image and how it came about.
pub struct Solved {
    /// In the measurements' units.
    pub image: Image,
    /// What was done.
    pub report: Report,
}

/// Makes the image.
pub fn solve(args: &MethodArgs, measurements: &Measurements) -> Result<Solved> {
    Solver::new(args, measurements.side().pixels())?.solve(measurements)
}

/// A method with all that it needs, for one measurement after another.
pub struct Solver {
    args: MethodArgs,
    omp: Option<PreparedOmp>,
}

/// What OMP needs.
struct PreparedOmp {
    settings: OmpSettings,
    /// The GPU, if one computes.
    device: Option<String>,
    /// Images of one's own, and where they are from.
    atoms: Option<(Vec<f32>, PathBuf)>,
}

impl Solver {
    /// Reads what there is to read, for images of this side.
    pub fn new(args: &MethodArgs, side: usize) -> Result<Self> {
        let mut omp = None;
        if args.method == Method::Omp {
            let (settings, device) = args.omp_settings()?;
            let read = |path: &PathBuf| anyhow::Ok((read_atoms(path, side)?, path.clone()));
            let atoms = args.dictionary.as_ref().map(read).transpose()?;
            omp = Some(PreparedOmp { settings, device, atoms });
        }
        Ok(Self { args: args.clone(), omp })
    }

    /// Makes an image.
    pub fn solve(&self, measurements: &Measurements) -> Result<Solved> {
        let args = &self.args;
        if let Some(PreparedOmp { settings, device, atoms }) = &self.omp {
            let found = match atoms {
                None => reconstruct::omp(measurements, settings)?,
                Some((atoms, path)) => reconstruct::omp_over(measurements, atoms, settings)
                    .with_context(|| path.display().to_string())?,
            };
            return Ok(args.solved(found, settings, device.clone()));
        }
        if let Some(penalty) = args.method.penalty() {
            return penalised(args, penalty, measurements);
        }
        let image = reconstruct::hadamard(measurements);
        let report = Report { method: args.method, omp: None, penalty: None };
        Ok(Solved { image, report })
    }
}

fn penalised(args: &MethodArgs, penalty: Penalty, measurements: &Measurements) -> Result<Solved> {
    let mut settings = RegularisedSettings {
        basis: args.basis()?,
        completion: args.kept().completion(),
        ..RegularisedSettings::new(penalty)
    };
    if let Some(strength) = args.strength {
        settings.strength = Strength::Fixed(strength);
    }
    let found = reconstruct::regularised(measurements, &settings)?;
    let basis = (penalty != Penalty::TotalVariation).then(|| settings.basis.to_string());
    let penalty = PenaltyReport {
        basis,
        strength: found.strength,
        keep: args.kept(),
        relative_residual: found.residual,
        trust_in_prediction: found.trust,
        noise_of_a_measurement: found.noise,
    };
    let report = Report { method: args.method, omp: None, penalty: Some(penalty) };
    Ok(Solved { image: found.image, report })
}

impl Keep {
    fn completion(self) -> Completion {
        match self {
            Self::Measured => Completion::Measured,
            Self::Sparse => Completion::Sparse,
        }
    }
}

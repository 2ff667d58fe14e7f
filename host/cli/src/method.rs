//! Arguments for the reconstruction, and its part of the report.

use super::Usage;
use super::report::words;
use anyhow::Result;
use clap::{Args, FromArgMatches};
use nirspi::reconstruct::{Pipeline, Recipe, Solver, own_atoms, read_atoms};
use nirspi::source::FirstPatterns;
use nirspi_nets::Device;
use nirspi_recon::omp::Backend;
use nirspi_recon::reconstruct::{
    self, Method, MethodSettings, ReconstructError, Sparsity, Strength,
};
use nirspi_recon::{Basis, Sampling, Size};
use std::path::PathBuf;

/// How to make the image.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Picture")]
pub struct MethodArgs {
    /// The method that makes the image
    #[arg(long, default_value = Method::default().argument(),
          value_parser = words(Method::ALL, |method| (method.argument(), method.about())))]
    pub method: Method,
    #[arg(long, value_name = "BASIS", default_value = "dct",
          help = format!("Basis of the image for omp, tikhonov and fista: {}", Basis::expected()))]
    pub basis: String,
    /// OMP: images of your own, (N, n, n), as atoms instead of a basis
    #[arg(long, value_name = "NPY", conflicts_with = "basis")]
    pub dictionary: Option<PathBuf>,
    /// OMP: number of atoms [default: the number that predicts held-back measurements best]
    #[arg(long, value_name = "K")]
    pub sparsity: Option<usize>,
    /// OMP: stop when the norm of the residual is this share of the norm of the measurements
    #[arg(long, value_name = "0..1", default_value_t = 0.0)]
    pub residual: f64,
    /// OMP: choose atoms until the residual is no larger than the estimated noise
    #[arg(long, conflicts_with_all = ["sparsity", "as_printed"])]
    pub stop_at_noise: bool,
    /// Strength of the penalty of tikhonov, fista and tv. 1 is the strength that follows from the estimated noise [default:
    /// the strength that predicts held-back measurements best]
    #[arg(long, value_name = "S")]
    pub strength: Option<f64>,
    /// OMP: the paper's Algorithm 1 as printed, with no prior and no cross-validation; the image is exactly sparse
    #[arg(long, requires = "sparsity")]
    pub as_printed: bool,
    /// OMP: no negative light. This needs --basis pixel or --dictionary
    #[arg(long, conflicts_with = "as_printed")]
    pub non_negative: bool,
    /// Where OMP, and networks that enhance its images, compute: auto, cpu, wgpu or cuda. auto takes a GPU for a stack of
    /// images if it is faster; one image is too little work for a GPU
    #[arg(long, value_name = "BACKEND", default_value_t = Backend::Auto)]
    pub backend: Backend,
}

impl Default for MethodArgs {
    /// The arguments of a command line without any.
    fn default() -> Self {
        let mut matches = Self::augment_args(clap::Command::new("")).get_matches_from([""]);
        Self::from_arg_matches_mut(&mut matches).unwrap_or_else(|error| error.exit())
    }
}

impl MethodArgs {
    /// Checks the arguments before any file is opened. With networks after the method, the backend may be theirs alone.
    pub fn check(&self, networks: bool) -> Result<()> {
        let mut settings = self.settings_before(networks)?;
        // The file is read later; the check only needs to know that there is one.
        settings.dictionary = self.dictionary.as_ref().map(|path| own_atoms(path, Vec::new()));
        settings.check(self.method).map_err(|error| Usage(self.words(&error)).into())
    }

    /// A refusal in the words of the command line.
    fn words(&self, error: &ReconstructError) -> String {
        match error {
            ReconstructError::NotTaken { setting, .. } => {
                let asked = match setting {
                    reconstruct::Setting::Backend => format!("backend {}", self.backend),
                    setting => setting.to_string(),
                };
                let methods = Method::listed(|method| method.takes(*setting));
                format!("--{asked} belongs to --method {methods}")
            }
            ReconstructError::Signed { basis } => format!(
                "--non-negative in the {basis} basis, whose atoms are negative themselves, expected --basis pixel or \
                 --dictionary"
            ),
            other => format!("--{other}"),
        }
    }

    /// The requested basis.
    pub fn basis(&self) -> Result<Basis> {
        self.basis.parse().map_err(|error| Usage(format!("--basis: {error}")).into())
    }

    /// The requested number of atoms.
    pub fn atoms(&self) -> Sparsity {
        match self.sparsity {
            Some(atoms) => Sparsity::Fixed(atoms),
            None if self.stop_at_noise => Sparsity::Noise,
            None => MethodSettings::default().sparsity,
        }
    }

    /// The requested settings, without a user's own atoms.
    pub fn settings(&self) -> Result<MethodSettings> {
        Ok(MethodSettings {
            basis: self.basis()?,
            dictionary: None,
            sparsity: self.atoms(),
            residual: self.residual,
            as_printed: self.as_printed,
            non_negative: self.non_negative,
            strength: self.strength.map_or_else(Strength::default, Strength::Fixed),
            backend: self.backend,
            network: Some(nirspi_nets::prior::shipped()),
        })
    }

    /// The requested settings of a method that has networks after it or not.
    fn settings_before(&self, networks: bool) -> Result<MethodSettings> {
        let settings = self.settings()?;
        match networks && !self.method.takes(reconstruct::Setting::Backend) {
            true => Ok(MethodSettings { backend: Backend::Auto, ..settings }),
            false => Ok(settings),
        }
    }

    /// The requested settings for images of this size. Reads the user's files.
    pub fn settings_for(&self, size: Size) -> Result<MethodSettings> {
        let size = (size.height(), size.width());
        let read = |path: &PathBuf| anyhow::Ok(own_atoms(path, read_atoms(path, size)?));
        let dictionary = self.dictionary.as_ref().map(read).transpose()?;
        Ok(MethodSettings { dictionary, ..self.settings()? })
    }

    /// The method, ready for measurements of any side, with networks after it, if these are wanted.
    pub fn pipeline(
        &self,
        first: FirstPatterns,
        sampling: Sampling,
        enhance: bool,
    ) -> Result<Pipeline> {
        let (method, settings, dictionary) =
            (self.method, self.settings_before(enhance)?, self.dictionary.clone());
        let solver = Solver::new(Recipe { method, settings, dictionary, first, sampling })?;
        Ok(match enhance {
            true => Pipeline::new(solver).with_networks(self.backend)?,
            false => Pipeline::new(solver),
        })
    }

    /// The device of a live page's networks: the backend of OMP. `auto` is the processor, as one image at a time is too
    /// little work for a GPU that was not requested.
    pub fn device(&self) -> Result<Device> {
        let backend = if self.backend == Backend::Auto { Backend::Cpu } else { self.backend };
        Ok(Device::open(backend)?)
    }
}

//! What a build is: version, commit, protocol, features, weights.

#[cfg(feature = "enhance")]
use nirspi_nets::embedded::ShippedWeights;
use nirspi_wire::version;
use std::fmt;

/// Features of this library, and whether this build has each one.
const FEATURES: [(&str, bool); 5] = [
    ("baselines", cfg!(feature = "baselines")),
    ("flash", cfg!(feature = "flash")),
    ("gpu", cfg!(feature = "gpu")),
    ("hdf5", cfg!(feature = "hdf5")),
    ("wgpu", cfg!(feature = "wgpu")),
];

/// A build of this library, and of the program around it.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct About {
    /// The version of this library.
    pub version: &'static str,
    /// The commit of the sources; `None` if the program's build did not know the commit.
    pub commit: Option<&'static str>,
    /// The oldest and the newest protocol version that this build speaks.
    pub protocol: [u16; 2],
    /// Those of the features `baselines`, `flash`, `gpu`, `hdf5` and `wgpu` that this build has.
    pub features: Vec<&'static str>,
    /// The weights that this build contains; empty if the embedded files are damaged.
    #[cfg(feature = "enhance")]
    pub weights: Vec<ShippedWeights>,
}

impl About {
    /// This build. `commit` is that of the sources, if the program's build knows the commit.
    #[must_use]
    pub fn this_build(commit: Option<&'static str>) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION"),
            commit,
            protocol: [version::MIN, version::CURRENT],
            features: FEATURES.iter().filter(|(_, has)| *has).map(|(name, _)| *name).collect(),
            #[cfg(feature = "enhance")]
            weights: ShippedWeights::all().unwrap_or_default(),
        }
    }
}

/// The version, and then one fact a line.
impl fmt::Display for About {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.version)?;
        let unknown = "not known: a debug build, or built without git";
        writeln!(f, "commit: {}", self.commit.unwrap_or(unknown))?;
        writeln!(f, "protocol: {}", version::Spoken)?;
        match self.features.is_empty() {
            true => write!(f, "features: none of {}", FEATURES.map(|(name, _)| name).join(", "))?,
            false => write!(f, "features: {}", self.features.join(", "))?,
        }
        #[cfg(feature = "enhance")]
        {
            write!(f, "\nweights, with the SHA-256 of their tensors:")?;
            for ShippedWeights { model, version, sha256 } in &self.weights {
                write!(f, "\n  {model:<10} version {version}  {sha256}")?;
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_build_says_its_version_commit_protocol_and_features() {
        let text = About::this_build(Some("0123456789ab")).to_string();
        let protocol = format!("\nprotocol: {}\n", version::Spoken);
        assert!(text.starts_with(concat!(env!("CARGO_PKG_VERSION"), "\ncommit: 0123456789ab\n")));
        assert!(text.contains(&protocol) && text.contains("\nfeatures: "), "{text}");
        assert!(About::this_build(None).to_string().contains("built without git"));
    }

    #[test]
    #[cfg(feature = "enhance")]
    fn every_network_of_the_chain_is_listed_with_a_checksum() {
        let about = About::this_build(None);
        let listed = |model| about.weights.iter().any(|w| w.model == model && w.sha256.len() == 64);
        assert!(
            ["estimator", "fsrcnn", "diffusion", "prior", "classifier"].into_iter().all(listed)
        );
    }
}

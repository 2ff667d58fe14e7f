//! What a build is: version, commit, protocol, features, weights.

#[cfg(feature = "enhance")]
use nirspi_nets::embedded::ShippedWeights;
use nirspi_wire::version;
use std::fmt;

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
    /// The features of the program, and whether this build has each one.
    pub features: &'static [(&'static str, bool)],
    /// The weights that this build contains; empty if the embedded files are damaged.
    #[cfg(feature = "enhance")]
    pub weights: Vec<ShippedWeights>,
}

impl About {
    /// This build. `commit` is that of the sources, if the program's build knows the commit; `features` are the
    /// program's, and whether it has each one.
    #[must_use]
    pub fn this_build(
        commit: Option<&'static str>,
        features: &'static [(&'static str, bool)],
    ) -> Self {
        Self {
            version: env!("CARGO_PKG_VERSION"),
            commit,
            protocol: [version::MIN, version::CURRENT],
            features,
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
        let names = |wanted: &dyn Fn(bool) -> bool| {
            let wanted = self.features.iter().filter(|(_, has)| wanted(*has));
            wanted.map(|(name, _)| *name).collect::<Vec<_>>().join(", ")
        };
        match names(&|has| has) {
            none if none.is_empty() => write!(f, "features: none of {}", names(&|_| true))?,
            these => write!(f, "features: {these}")?,
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
        const FEATURES: [(&str, bool); 2] = [("flash", false), ("gpu", true)];
        let text = About::this_build(Some("0123456789ab"), &FEATURES).to_string();
        let protocol = format!("\nprotocol: {}\n", version::Spoken);
        assert!(text.starts_with(concat!(env!("CARGO_PKG_VERSION"), "\ncommit: 0123456789ab\n")));
        assert!(text.contains(&protocol) && text.contains("\nfeatures: gpu\n"), "{text}");
        let without = About::this_build(None, &[("flash", false)]).to_string();
        assert!(without.contains("\nfeatures: none of flash\n"), "{without}");
        assert!(without.contains("built without git"));
    }

    #[test]
    #[cfg(feature = "enhance")]
    fn every_network_of_the_chain_is_listed_with_a_checksum() {
        let about = About::this_build(None, &[]);
        let listed = |model| about.weights.iter().any(|w| w.model == model && w.sha256.len() == 64);
        assert!(
            ["estimator", "fsrcnn", "diffusion", "prior", "classifier"].into_iter().all(listed)
        );
    }
}

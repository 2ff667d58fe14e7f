//! The embedded weights (`host/nets/weights`, made as `docs/training.md` describes).

use crate::weights::{Weights, WeightsError};

/// Name of each network, and the file of its weights.
const FILES: [(&str, &[u8]); 6] = [
    ("estimator", include_bytes!("../weights/estimator.safetensors")),
    ("fsrcnn", include_bytes!("../weights/fsrcnn.safetensors")),
    ("diffusion", include_bytes!("../weights/diffusion.safetensors")),
    ("gan", include_bytes!("../weights/gan.safetensors")),
    ("ancestral", include_bytes!("../weights/ancestral.safetensors")),
    ("classifier", include_bytes!("../weights/classifier.safetensors")),
];

impl Weights {
    /// The embedded weights of a network: `estimator`, `fsrcnn`, `diffusion`, `gan`, `ancestral` or
    /// `classifier`.
    ///
    /// # Errors
    /// [`WeightsError::NotEmbedded`] for any other name; [`WeightsError::Checksum`] if the embedded
    /// file is damaged.
    pub fn embedded(model: &str) -> Result<Self, WeightsError> {
        let named = FILES.iter().find(|(name, _)| *name == model);
        let (_, bytes) =
            named.ok_or_else(|| WeightsError::NotEmbedded { model: model.to_owned() })?;
        Self::parse(&format!("embedded weights of {model}"), bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::weights::{MODEL, RECIPE, VERSION};

    #[test]
    fn each_file_says_whose_it_is_and_how_it_was_made_and_is_under_10_mb() {
        for (model, bytes) in FILES {
            let weights = Weights::embedded(model).unwrap();
            assert_eq!(weights.metadata(MODEL), Some(model));
            for key in [VERSION, RECIPE] {
                assert!(
                    weights.metadata(key).is_some_and(|text| !text.is_empty()),
                    "{model} {key}"
                );
            }
            assert!(bytes.len() < 10_000_000, "{model}: {}", bytes.len());
        }
        assert!(Weights::embedded("oracle").is_err());
    }
}

//! The list of the networks that deblur. The command line, its help and the choice of weights follow
//! from it.

use std::fmt;
use std::num::NonZeroU32;
use std::str::FromStr;
use thiserror::Error;

/// A network that deblurs, known by the name of its weights.
#[derive(Clone, Copy)]
pub struct Model(&'static Entry);

/// What the list says of a network.
struct Entry {
    name: &'static str,
    about: &'static str,
    path: PathKind,
    default_steps: NonZeroU32,
    most_steps: NonZeroU32,
}

/// The path that leads a network from the readings to the sharp image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum PathKind {
    /// From the degraded image. The network estimates the difference of the sharp image to the start.
    Bridge,
    /// From noise. The network estimates the noise, and the weights hold the noise schedule.
    Ancestral,
}

const fn count(steps: u32) -> NonZeroU32 {
    NonZeroU32::new(steps).expect("the steps of an entry are at least 1")
}

impl Model {
    /// Every network that deblurs. The first is the recommended one.
    pub const ALL: [Self; 4] = [Self::DIFFUSION, Self::ANCESTRAL, Self::GAN, Self::REGRESSION];

    /// The bridge from the degraded image to the sharp one; 1 to 4 steps are useful.
    pub const DIFFUSION: Self = Self(&Entry {
        name: "diffusion",
        about: "A diffusion network that goes from the blurred image to the sharp one in few steps",
        path: PathKind::Bridge,
        default_steps: count(1),
        most_steps: count(500),
    });

    /// The paper's diffusion, sampled backwards.
    pub const ANCESTRAL: Self = Self(&Entry {
        name: "ancestral",
        about: "The paper's diffusion network of 500 steps",
        path: PathKind::Ancestral,
        default_steps: count(500),
        most_steps: count(500),
    });

    /// The generator of a GAN.
    pub const GAN: Self = Self(&Entry {
        name: "gan",
        about: "The generator of a generative adversarial network",
        path: PathKind::Bridge,
        default_steps: count(1),
        most_steps: count(1),
    });

    /// A network that minimises the error, trained as long as the GAN and the paper's diffusion, so
    /// that the three can be compared.
    pub const REGRESSION: Self = Self(&Entry {
        name: "regression",
        about: "A network that minimises the error, trained as long as gan and ancestral",
        path: PathKind::Bridge,
        default_steps: count(1),
        most_steps: count(1),
    });

    /// The name of the network and of its weights.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.0.name
    }

    /// One line about the network.
    #[must_use]
    pub fn about(self) -> &'static str {
        self.0.about
    }

    /// Number of steps where the caller names none.
    #[must_use]
    pub fn default_steps(self) -> NonZeroU32 {
        self.0.default_steps
    }

    /// Largest number of steps.
    #[must_use]
    pub fn most_steps(self) -> NonZeroU32 {
        self.0.most_steps
    }

    pub(super) fn path(self) -> PathKind {
        self.0.path
    }
}

impl PartialEq for Model {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl Eq for Model {}

impl fmt::Debug for Model {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Model({})", self.name())
    }
}

impl fmt::Display for Model {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Model {
    type Err = MethodError;

    fn from_str(found: &str) -> Result<Self, MethodError> {
        let named = Self::ALL.into_iter().find(|model| model.name() == found);
        named.ok_or_else(|| MethodError::Model { found: found.to_owned() })
    }
}

/// A network for deblurring, and its number of steps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Method {
    model: Model,
    steps: NonZeroU32,
}

impl Method {
    /// The network with this number of steps; `None` for the network's default.
    ///
    /// # Errors
    /// [`MethodError::Steps`] if the network takes fewer steps.
    pub fn new(model: Model, steps: Option<NonZeroU32>) -> Result<Self, MethodError> {
        let Some(steps) = steps else { return Ok(model.into()) };
        match steps > model.most_steps() {
            true => Err(MethodError::Steps { model, found: steps }),
            false => Ok(Self { model, steps }),
        }
    }

    /// The network.
    #[must_use]
    pub fn model(self) -> Model {
        self.model
    }

    /// Number of calls of the network for one image.
    #[must_use]
    pub fn steps(self) -> NonZeroU32 {
        self.steps
    }
}

/// The network with its own number of steps.
impl From<Model> for Method {
    fn from(model: Model) -> Self {
        Self { model, steps: model.default_steps() }
    }
}

/// The recommended network: the bridge in one step.
impl Default for Method {
    fn default() -> Self {
        Model::ALL[0].into()
    }
}

/// Why a network and its steps are refused.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum MethodError {
    /// No network has this name.
    #[error("no network is called {found:?}, expected {}", names())]
    Model {
        /// The name found.
        found: String,
    },
    /// The network takes fewer steps.
    #[error("{model} in {found} steps, expected {}", range(model.most_steps()))]
    Steps {
        /// The network.
        model: Model,
        /// The number of steps found.
        found: NonZeroU32,
    },
}

fn names() -> String {
    Model::ALL.map(Model::name).join(", ")
}

fn range(most: NonZeroU32) -> String {
    if most == NonZeroU32::MIN { "1".to_owned() } else { format!("1 to {most}") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::weights::Weights;

    #[test]
    fn every_network_of_the_list_has_weights_a_name_of_its_own_and_possible_steps() {
        for model in Model::ALL {
            Weights::embedded(model.name()).unwrap().expect_model(model.name()).unwrap();
            assert_eq!(model.name().parse(), Ok(model));
            assert_eq!(Method::new(model, None).unwrap().steps(), model.default_steps());
        }
    }

    #[test]
    fn unknown_names_and_too_many_steps_are_refused_with_what_is_there() {
        let error = "pixelise".parse::<Model>().unwrap_err().to_string();
        let expected =
            r#"no network is called "pixelise", expected diffusion, ancestral, gan, regression"#;
        assert_eq!(error, expected);
        let steps = NonZeroU32::new(501).unwrap();
        let refused = |model| Method::new(model, Some(steps)).unwrap_err().to_string();
        assert_eq!(refused(Model::GAN), "gan in 501 steps, expected 1");
        assert_eq!(refused(Model::ANCESTRAL), "ancestral in 501 steps, expected 1 to 500");
    }
}

//! A learned prior: a network that completes the measurements.

use crate::Measurements;
use crate::reconstruct::method::{Entry, Setting};
use crate::reconstruct::prior::{SharedNetwork, network_kind, with_network};
use crate::reconstruct::stack::{each, with_common_noise};
use crate::reconstruct::{
    GoingOn, Method, Reconstruct, ReconstructError, Reconstruction, Recursive, RecursiveSettings,
    believed_frame,
};

const NAME: &str = "learned prior";

/// The method of the network in [`MethodSettings::network`](crate::reconstruct::MethodSettings).
pub(in super::super) const METHOD: Method = Method(&Entry {
    argument: "prior",
    name: NAME,
    about: "Completed by a small network, as far as held-back measurements support the network; measured rows are weighted means of reading and network",
    takes: &[Setting::WarmStart],
    with_matrix: None,
    prepare: |settings| {
        let Some(network) = settings.network.clone() else {
            return Err(ReconstructError::NeedsNetwork { method: Method::PRIOR });
        };
        Ok(Box::new(Prior { network }))
    },
});

struct Prior {
    network: SharedNetwork,
}

impl Reconstruct for Prior {
    fn name(&self) -> &str {
        NAME
    }

    fn reconstruct(&self, measurements: &Measurements) -> Result<Reconstruction, ReconstructError> {
        with_network(measurements, self.network.get(), NAME)
    }

    fn reconstruct_kind(
        &self,
        measurements: &[Measurements],
        going_on: GoingOn<'_>,
    ) -> Result<Vec<Reconstruction>, ReconstructError> {
        let measurements = &with_common_noise(measurements);
        match network_kind(measurements, &self.network, NAME, going_on)? {
            Some(made) => Ok(made),
            None => each(self, measurements, going_on),
        }
    }

    fn begin_video(&self) -> Result<Option<Recursive>, ReconstructError> {
        Recursive::new(RecursiveSettings::default()).map(Some)
    }

    fn next_frame(
        &self,
        past: &mut Recursive,
        frame: &Measurements,
    ) -> Result<Reconstruction, ReconstructError> {
        believed_frame(self, past, frame)
    }
}

//! The training loop's interface to a network, and what all learners share: optimiser, running
//! average, states as bytes.

use super::TrainError;
use super::examples::Batch;
use crate::weights::Weights;
use burn::module::{AutodiffModule, Module, ModuleMapper, ModuleVisitor, Param, ParamId};
use burn::optim::adaptor::OptimizerAdaptor;
use burn::optim::{AdamW, AdamWConfig, GradientsParams, Optimizer};
use burn::record::{FullPrecisionSettings, NamedMpkBytesRecorder, Record, Recorder};
use burn::tensor::backend::{AutodiffBackend, Backend};
use burn::tensor::{ElementConversion, Tensor, TensorPrimitive};
use std::collections::HashMap;

/// A network with its optimiser and the running average of its weights.
pub(super) trait Learner {
    /// Learns from a batch; returns the loss.
    fn step(&mut self, batch: &Batch, step: u64, rate: f64) -> Result<f64, TrainError>;
    /// Sum of the scores of these examples, with the averaged weights.
    fn judge(&self, batch: &Batch) -> f64;
    /// The averaged weights.
    fn weights(&self) -> Weights;
    /// The learner's whole state after `step` steps.
    fn states(&self, step: u64) -> Result<Vec<Vec<u8>>, TrainError>;
    /// Restores a state from `states`.
    fn restore(&mut self, states: &[Vec<u8>]) -> Result<(), TrainError>;
}

/// A network with its optimiser.
pub(super) struct Trained<B: AutodiffBackend, M: AutodiffModule<B>> {
    pub(super) network: M,
    optimiser: OptimizerAdaptor<AdamW, M, B>,
    pub(super) device: B::Device,
}

impl<B: AutodiffBackend, M: AutodiffModule<B>> Trained<B, M> {
    pub(super) fn new(network: M, device: B::Device) -> Self {
        let optimiser = AdamWConfig::new().with_epsilon(1e-8).init();
        Self { network, optimiser, device }
    }

    /// Takes a step down the gradient of `loss`; returns the loss.
    pub(super) fn descend(&mut self, loss: &Tensor<B, 1>, rate: f64) -> f64 {
        let gradients = GradientsParams::from_grads(loss.backward(), &self.network);
        self.network = self.optimiser.step(rate, self.network.clone(), gradients);
        loss.clone().into_scalar().elem::<f64>()
    }

    /// State of the network and of its optimiser.
    pub(super) fn states(&self) -> Result<[Vec<u8>; 2], TrainError> {
        Ok([
            written::<B, _>(self.network.clone().into_record())?,
            written::<B, _>(self.optimiser.to_record())?,
        ])
    }

    pub(super) fn restore(
        &mut self,
        [network, optimiser]: [&Vec<u8>; 2],
    ) -> Result<(), TrainError> {
        self.network = self.network.clone().load_record(read::<B, _>(network, &self.device)?);
        self.optimiser = self.optimiser.clone().load_record(read::<B, _>(optimiser, &self.device)?);
        Ok(())
    }
}

/// The bytes of a record.
pub(super) fn written<B: Backend, R: Record<B>>(record: R) -> Result<Vec<u8>, TrainError> {
    recorder().record(record, ()).map_err(|error| unreadable(&error))
}

/// The record in these bytes.
pub(super) fn read<B: Backend, R: Record<B>>(
    bytes: &[u8],
    device: &B::Device,
) -> Result<R, TrainError> {
    Recorder::<B>::load(&recorder(), bytes.to_vec(), device).map_err(|error| unreadable(&error))
}

fn recorder() -> NamedMpkBytesRecorder<FullPrecisionSettings> {
    NamedMpkBytesRecorder::default()
}

fn unreadable(error: &impl std::fmt::Display) -> TrainError {
    TrainError::Checkpoint { found: error.to_string(), expected: "states of this network" }
}

/// States of a checkpoint, as many as there must be.
pub(super) fn expect_states<const N: usize>(
    states: &[Vec<u8>],
) -> Result<[&Vec<u8>; N], TrainError> {
    let all: Vec<&Vec<u8>> = states.iter().collect();
    all.try_into().map_err(|_| TrainError::Checkpoint {
        found: format!("{} states", states.len()),
        expected: "states of this network",
    })
}

/// Factor of the running average at a step: small at first, so that the initial weights lose their
/// share quickly.
pub(super) fn decay(slowest: f64, step: u64) -> f64 {
    slowest.min((1.0 + step as f64) / (10.0 + step as f64))
}

/// Checks the weights before a checkpoint, because a checkpoint with a NaN would be useless.
pub(super) fn expect_finite(weights: &Weights, step: u64) -> Result<(), TrainError> {
    for name in weights.names() {
        if let Some(loss) = weights.get(name)?.values.iter().find(|v| !v.is_finite()) {
            return Err(TrainError::NotFinite { step, loss: f64::from(*loss) });
        }
    }
    Ok(())
}

/// `average` moved towards `network`, which has the same parameters.
pub(super) fn averaged<B: Backend, M: Module<B>>(average: M, network: &M, decay: f64) -> M {
    let mut current = Current { tensors: HashMap::new() };
    network.visit(&mut current);
    average.map(&mut Follow { tensors: current.tensors, decay })
}

struct Current<B: Backend> {
    tensors: HashMap<ParamId, TensorPrimitive<B>>,
}

impl<B: Backend> ModuleVisitor<B> for Current<B> {
    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<B, D>>) {
        self.tensors.insert(param.id, param.val().into_primitive());
    }
}

struct Follow<B: Backend> {
    tensors: HashMap<ParamId, TensorPrimitive<B>>,
    decay: f64,
}

impl<B: Backend> ModuleMapper<B> for Follow<B> {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<B, D>>) -> Param<Tensor<B, D>> {
        let (id, average, mapper) = param.consume();
        let moved = match self.tensors.remove(&id) {
            Some(current) => {
                let current = Tensor::<B, D>::from_primitive(current);
                average * self.decay + current * (1.0 - self.decay)
            }
            None => average,
        };
        Param::from_mapped_value(id, moved, mapper)
    }
}

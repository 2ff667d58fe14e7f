//! A network that learns from examples alone.

use super::examples::Batch;
use super::initial::seeded;
use super::tasks::Task;
use super::trained::{
    Learner, Trained, averaged, decay, expect_finite, expect_states, read, written,
};
use super::{Settings, TrainError};
use crate::data::{Purpose, stream};
use crate::model::weights_of;
use crate::weights::Weights;
use burn::module::{AutodiffModule, Module};
use burn::tensor::backend::AutodiffBackend;

/// The network of a task, its optimiser, and the average of its weights.
pub(super) struct Solo<B: AutodiffBackend, T: Task<B>> {
    task: T,
    trained: Trained<B, T::Network>,
    average: <T::Network as AutodiffModule<B>>::InnerModule,
    decay: f64,
    seed: u64,
}

impl<B: AutodiffBackend, T: Task<B>> Solo<B, T> {
    pub(super) fn new(settings: &Settings, device: B::Device) -> Result<Self, TrainError> {
        let task = T::new(settings);
        let network = seeded(task.network(&device), T::GAINS, settings.seed)?;
        let average = network.valid();
        let trained = Trained::new(network, device);
        Ok(Self { task, trained, average, decay: settings.average, seed: settings.seed })
    }
}

impl<B: AutodiffBackend, T: Task<B>> Learner for Solo<B, T> {
    fn step(&mut self, batch: &Batch, step: u64, rate: f64) -> Result<f64, TrainError> {
        let rng = &mut stream(self.seed, Purpose::Step, step);
        let loss = self.task.loss(&self.trained.network, batch, rng, &self.trained.device);
        let loss = self.trained.descend(&loss, rate);
        self.average = averaged::<B::InnerBackend, _>(
            self.average.clone(),
            &self.trained.network.valid(),
            decay(self.decay, step),
        );
        Ok(loss)
    }

    fn judge(&self, batch: &Batch) -> f64 {
        self.task.score(&self.average, batch, &self.trained.device)
    }

    fn weights(&self) -> Weights {
        let mut weights = weights_of("trained weights", &self.average);
        self.task.describe(&mut weights);
        weights
    }

    fn states(&self, step: u64) -> Result<Vec<Vec<u8>>, TrainError> {
        expect_finite(&self.weights(), step)?;
        let [network, optimiser] = self.trained.states()?;
        let average = written::<B::InnerBackend, _>(self.average.clone().into_record())?;
        Ok(vec![network, optimiser, average])
    }

    fn restore(&mut self, states: &[Vec<u8>]) -> Result<(), TrainError> {
        let [network, optimiser, average] = expect_states(states)?;
        self.trained.restore([network, optimiser])?;
        let record = read::<B::InnerBackend, _>(average, &self.trained.device)?;
        self.average = self.average.clone().load_record(record);
        Ok(())
    }
}

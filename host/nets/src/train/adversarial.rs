//! The GAN: a generator against a discriminator of patches (pix2pix; Isola et al., CVPR 2017), with
//! least squares instead of logarithms (Mao et al., ICCV 2017). The code calls the discriminator
//! the judge.

use super::examples::Batch;
use super::initial::seeded;
use super::tasks::{UNET_GAINS, generated, one_step, unet};
use super::tensors::scenes;
use super::trained::{
    Learner, Trained, averaged, decay, expect_finite, expect_states, read, written,
};
use super::{Settings, TrainError};
use crate::model::{Discriminator, DiscriminatorConfig, UNet, weights_of};
use crate::weights::Weights;
use burn::module::{AutodiffModule, Module};
use burn::tensor::backend::AutodiffBackend;

/// Weight of the absolute error relative to the judge's loss (pix2pix).
const ABSOLUTE: f64 = 100.0;
/// The judge's learning rate relative to the generator's. A faster judge would win at once.
const JUDGE_RATE: f64 = 0.5;

/// Generator and judge, each with its optimiser, and the running average of the generator.
pub(super) struct Adversarial<B: AutodiffBackend> {
    generator: Trained<B, UNet<B>>,
    judge: Trained<B, Discriminator<B>>,
    average: UNet<B::InnerBackend>,
    decay: f64,
    device: B::Device,
}

impl<B: AutodiffBackend> Adversarial<B> {
    pub(super) fn new(settings: &Settings, device: B::Device) -> Result<Self, TrainError> {
        let generator = seeded(unet(settings).init::<B>(&device), UNET_GAINS, settings.seed)?;
        let judge = DiscriminatorConfig::default().init::<B>(&device);
        let judge = seeded(judge, &[], settings.seed.wrapping_add(1))?;
        Ok(Self {
            average: generator.valid(),
            generator: Trained::new(generator, device.clone()),
            judge: Trained::new(judge, device.clone()),
            decay: settings.average,
            device,
        })
    }
}

impl<B: AutodiffBackend> Learner for Adversarial<B> {
    fn step(&mut self, batch: &Batch, step: u64, rate: f64) -> Result<f64, TrainError> {
        let truth = scenes::<B>(&batch.truth, &self.device);
        let degraded = scenes::<B>(&batch.degraded, &self.device);
        let made = generated(&self.generator.network, batch, &self.device);

        // The judge learns to give 1 for sharp images and 0 for generated ones.
        let judge = &self.judge.network;
        let real = judge.forward(degraded.clone(), truth.clone());
        let false_one = judge.forward(degraded.clone(), made.clone().detach());
        let loss = ((real - 1.0).square().mean() + false_one.square().mean()) * 0.5;
        let judged = self.judge.descend(&loss, JUDGE_RATE * rate);

        let opinion = self.judge.network.forward(degraded, made.clone());
        let loss = (made - truth).abs().mean() * ABSOLUTE + (opinion - 1.0).square().mean();
        let loss = self.generator.descend(&loss, rate);
        let network = self.generator.network.valid();
        self.average =
            averaged::<B::InnerBackend, _>(self.average.clone(), &network, decay(self.decay, step));
        // If either loss is not finite, the run ends.
        Ok(if judged.is_finite() { loss } else { judged })
    }

    fn judge(&self, batch: &Batch) -> f64 {
        one_step(&self.average, batch, &self.device)
    }

    fn weights(&self) -> Weights {
        weights_of("trained weights", &self.average)
    }

    fn states(&self, step: u64) -> Result<Vec<Vec<u8>>, TrainError> {
        expect_finite(&self.weights(), step)?;
        let average = written::<B::InnerBackend, _>(self.average.clone().into_record())?;
        let ([generator, its], [judge, theirs]) = (self.generator.states()?, self.judge.states()?);
        Ok(vec![generator, its, judge, theirs, average])
    }

    fn restore(&mut self, states: &[Vec<u8>]) -> Result<(), TrainError> {
        let [generator, its, judge, theirs, average] = expect_states(states)?;
        self.generator.restore([generator, its])?;
        self.judge.restore([judge, theirs])?;
        let record = read::<B::InnerBackend, _>(average, &self.device)?;
        self.average = self.average.clone().load_record(record);
        Ok(())
    }
}

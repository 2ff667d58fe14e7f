//! The task of each network: its loss, and its score on held-out examples.

use super::examples::{Batch, READING_AREA};
use super::initial::Gains;
use super::tensors::{columns, each, images, scenes};
use super::{Model, Settings};
use crate::data::{AREA_PX, SIDE_PX};
use crate::deblur::Schedule;
use crate::degrade::READING_PX;
use crate::estimate::{Estimate, NOISE_SCALE, SIGMA_SCALE_PX};
use crate::model::{
    CONDITIONS, Classifier, ClassifierConfig, Estimator, EstimatorConfig, Fsrcnn, FsrcnnConfig,
    UNet, UNetConfig,
};
use crate::weights::Weights;
use burn::module::AutodiffModule;
use burn::tensor::activation::log_softmax;
use burn::tensor::backend::{AutodiffBackend, Backend};
use burn::tensor::{Int, Tensor, TensorData};
use rand::RngExt;
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

/// Share of the bridge's examples at the start of the path, the degraded image, because one step
/// from there is the usual case.
const AT_START: f32 = 0.6;
/// Size of the error below which Charbonnier's loss differs from the absolute value.
const CHARBONNIER: f64 = 1e-3;
/// Gains of the UNet's layers: blocks start near the identity, the output near zero.
pub(super) const UNET_GAINS: &Gains = &[("conv2", 0.3), ("output_conv", 0.1)];

/// A task for a network.
pub(super) trait Task<B: AutodiffBackend>: Sized + 'static {
    /// The network.
    type Network: AutodiffModule<B>;
    /// Gains of the initial weights.
    const GAINS: &'static Gains;

    fn new(settings: &Settings) -> Self;

    fn network(&self, device: &B::Device) -> Self::Network;

    /// Mean loss of a batch.
    fn loss(
        &self,
        network: &Self::Network,
        batch: &Batch,
        rng: &mut Pcg64Mcg,
        device: &B::Device,
    ) -> Tensor<B, 1>;

    /// Sum of the examples' scores.
    fn score(
        &self,
        network: &<Self::Network as AutodiffModule<B>>::InnerModule,
        batch: &Batch,
        device: &B::Device,
    ) -> f64;

    /// Adds to the metadata what users of the weights need.
    fn describe(&self, _weights: &mut Weights) {}
}

/// Charbonnier's loss: absolute error, smooth at 0.
pub(super) fn charbonnier<B: Backend>(error: Tensor<B, 4>) -> Tensor<B, 1> {
    (error.square() + CHARBONNIER * CHARBONNIER).sqrt().mean()
}

/// Sum of the PSNR of images in `[0, 1]`, in dB.
pub(super) fn psnr_db<B: Backend>(image: Tensor<B, 4>, truth: Tensor<B, 4>) -> f64 {
    let [count, ..] = truth.dims();
    let squared = (image.clamp(0.0, 1.0) - truth).square().reshape([count, AREA_PX]).mean_dim(1);
    let errors: Vec<f64> = squared.into_data().convert::<f64>().iter::<f64>().collect();
    // The error is bounded at a thousandth of an 8-bit grey level, so that no image's PSNR is
    // infinite.
    errors.into_iter().map(|error| -10.0 * error.max(1e-11).log10()).sum()
}

/// The UNet's conditions: two numbers of the path, then blur and noise.
fn conditions(batch: &Batch, path: impl Fn(usize) -> [f32; 2]) -> Vec<[f32; CONDITIONS]> {
    let known = |at: usize| Estimate { sigma_px: batch.sigma_px[at], noise: batch.noise_std[at] };
    (0..batch.count).map(|at| known(at).conditions(path(at))).collect()
}

/// The path's numbers at time t of the bridge.
fn bridge_time(t: f32) -> [f32; 2] {
    [t, t * t]
}

pub(super) fn unet(settings: &Settings) -> UNetConfig {
    let channels = match (settings.width.as_slice(), settings.model) {
        ([], Model::Gan | Model::Ancestral) => &UNetConfig::BASELINE_CHANNELS[..],
        ([], _) => &UNetConfig::SHIPPED_CHANNELS,
        (width, _) => width,
    };
    UNetConfig { channels: channels.to_vec(), ..UNetConfig::default() }
}

/// FSRCNN's task: the scene after the optics, from readings and depth.
pub(super) struct Fuse(FsrcnnConfig);

impl<B: AutodiffBackend> Task<B> for Fuse {
    type Network = Fsrcnn<B>;
    const GAINS: &'static Gains = &[("deconv", 0.05)];

    fn new(settings: &Settings) -> Self {
        let standard = FsrcnnConfig::default();
        Self(match settings.width[..] {
            [features, shrunk] => FsrcnnConfig { features, shrunk, ..standard },
            _ => standard,
        })
    }

    fn network(&self, device: &B::Device) -> Fsrcnn<B> {
        self.0.init(device)
    }

    fn loss(
        &self,
        network: &Fsrcnn<B>,
        batch: &Batch,
        _rng: &mut Pcg64Mcg,
        device: &B::Device,
    ) -> Tensor<B, 1> {
        let input = images(&batch.fusion_input(), 3, READING_PX, device);
        charbonnier(network.forward(input) - scenes(&batch.optical, device))
    }

    fn score(&self, network: &Fsrcnn<B::InnerBackend>, batch: &Batch, device: &B::Device) -> f64 {
        let input = images(&batch.fusion_input(), 3, READING_PX, device);
        psnr_db(network.forward(input), scenes(&batch.optical, device))
    }
}

/// The deblurrer's task on its bridge x_t = (1 - t) x0 + t y (InDI; Delbracio and Milanfar, TMLR
/// 2023).
pub(super) struct Bridge(UNetConfig);

impl<B: AutodiffBackend> Task<B> for Bridge {
    type Network = UNet<B>;
    const GAINS: &'static Gains = UNET_GAINS;

    fn new(settings: &Settings) -> Self {
        Self(unet(settings))
    }

    fn network(&self, device: &B::Device) -> UNet<B> {
        self.0.init(device)
    }

    fn loss(
        &self,
        network: &UNet<B>,
        batch: &Batch,
        rng: &mut Pcg64Mcg,
        device: &B::Device,
    ) -> Tensor<B, 1> {
        let mut time =
            || if rng.random::<f32>() < AT_START { 1.0 } else { rng.random_range(0.02..1.0) };
        let times: Vec<f32> = (0..batch.count).map(|_| time()).collect();
        let (x0, y) = (scenes::<B>(&batch.truth, device), scenes::<B>(&batch.degraded, device));
        let t = each::<B>(&times, device);
        let current = x0.clone() + (y.clone() - x0.clone()) * t;
        let told = columns(&conditions(batch, |at| bridge_time(times[at])), device);
        let raw = scenes(&batch.raw(), device);
        charbonnier(y + network.forward(current, raw, told) - x0)
    }

    fn score(&self, network: &UNet<B::InnerBackend>, batch: &Batch, device: &B::Device) -> f64 {
        one_step(network, batch, device)
    }
}

/// The image that a UNet gives in one step from the degraded one.
pub(super) fn generated<B: Backend>(
    network: &UNet<B>,
    batch: &Batch,
    device: &B::Device,
) -> Tensor<B, 4> {
    let y = scenes::<B>(&batch.degraded, device);
    let told = columns(&conditions(batch, |_| bridge_time(1.0)), device);
    y.clone() + network.forward(y, scenes(&batch.raw(), device), told)
}

/// Sum of the PSNR of that image, in dB.
pub(super) fn one_step<B: Backend>(network: &UNet<B>, batch: &Batch, device: &B::Device) -> f64 {
    psnr_db(generated(network, batch, device), scenes(&batch.truth, device))
}

/// The task of the paper's diffusion: 500 steps, the network estimates the noise (Eq. 8).
pub(super) struct Ancestral {
    config: UNetConfig,
    schedule: Schedule,
}

impl Ancestral {
    /// x_t and its noise, at one step for each example; images are 2 x - 1 here.
    fn noised(&self, batch: &Batch, steps: &[usize], rng: &mut Pcg64Mcg) -> (Vec<f32>, Vec<f32>) {
        let noise: Vec<f32> =
            batch.truth.iter().map(|_| rng.sample::<f32, _>(StandardNormal)).collect();
        let current = batch
            .truth
            .iter()
            .zip(&noise)
            .enumerate()
            .map(|(at, (x, e))| {
                let kept = self.schedule.left(steps[at / AREA_PX]);
                (2.0 * x - 1.0) * kept.sqrt() as f32 + e * (1.0 - kept).sqrt() as f32
            })
            .collect();
        (current, noise)
    }

    fn tell<B: Backend>(
        &self,
        network: &UNet<B>,
        batch: &Batch,
        steps: &[usize],
        current: &[f32],
        device: &B::Device,
    ) -> Tensor<B, 4> {
        let raw = scenes::<B>(&batch.raw(), device) * 2.0 - 1.0;
        let path = |at: usize| {
            let kept = self.schedule.left(steps[at]);
            [kept.sqrt() as f32, (1.0 - kept).sqrt() as f32]
        };
        let told = columns(&conditions(batch, path), device);
        network.forward(scenes(current, device), raw, told)
    }
}

impl<B: AutodiffBackend> Task<B> for Ancestral {
    type Network = UNet<B>;
    const GAINS: &'static Gains = UNET_GAINS;

    fn new(settings: &Settings) -> Self {
        Self { config: unet(settings), schedule: Schedule::shipped() }
    }

    fn network(&self, device: &B::Device) -> UNet<B> {
        self.config.init(device)
    }

    fn loss(
        &self,
        network: &UNet<B>,
        batch: &Batch,
        rng: &mut Pcg64Mcg,
        device: &B::Device,
    ) -> Tensor<B, 1> {
        let steps: Vec<usize> =
            (0..batch.count).map(|_| rng.random_range(0..self.schedule.steps())).collect();
        let (current, noise) = self.noised(batch, &steps, rng);
        let told = self.tell(network, batch, &steps, &current, device);
        (told - scenes(&noise, device)).square().mean()
    }

    /// The network's estimate of the image half way along the path, in one step, because 500 steps
    /// would take minutes.
    fn score(&self, network: &UNet<B::InnerBackend>, batch: &Batch, device: &B::Device) -> f64 {
        let half_way = self.schedule.steps() / 2;
        let steps = vec![half_way; batch.count];
        let rng = &mut crate::data::stream(0, crate::data::Purpose::HeldOut, u64::MAX);
        let (current, _) = self.noised(batch, &steps, rng);
        let noise = self.tell(network, batch, &steps, &current, device);
        let kept = self.schedule.left(half_way);
        let current = scenes::<B::InnerBackend>(&current, device);
        let image = (current - noise * (1.0 - kept).sqrt()) / kept.sqrt();
        psnr_db((image + 1.0) / 2.0, scenes(&batch.truth, device))
    }

    fn describe(&self, weights: &mut Weights) {
        Schedule::describe_shipped(weights);
    }
}

/// The estimator's task: blur and noise of readings and of images of 64 x 64.
pub(super) struct Measure(EstimatorConfig);

impl Measure {
    /// The estimator's outputs for the readings and for the `fine` degraded images, and the
    /// expected outputs: blur in pixels of the image's own grid.
    fn outputs<B: Backend>(
        network: &Estimator<B>,
        batch: &Batch,
        device: &B::Device,
    ) -> (Tensor<B, 2>, Tensor<B, 2>) {
        let wanted = |at: usize, grid: f32| {
            [batch.sigma_px[at] * grid / SIGMA_SCALE_PX, batch.noise_std[at] * NOISE_SCALE]
        };
        let coarse: Vec<usize> = (0..batch.count).filter(|&at| !batch.fine[at]).collect();
        let fine: Vec<usize> = (0..batch.count).filter(|&at| batch.fine[at]).collect();
        let picked = |all: &[f32], area: usize, which: &[usize]| -> Vec<f32> {
            which.iter().flat_map(|&at| all[at * area..(at + 1) * area].to_vec()).collect()
        };
        let (mut said, mut should) = (Vec::new(), Vec::new());
        if !coarse.is_empty() {
            let readings = picked(&batch.readings, READING_AREA, &coarse);
            said.push(network.forward(images(&readings, 1, READING_PX, device)));
            should.extend(coarse.iter().map(|&at| wanted(at, 0.5)));
        }
        if !fine.is_empty() {
            let degraded = picked(&batch.degraded, AREA_PX, &fine);
            said.push(network.forward(images(&degraded, 1, SIDE_PX, device)));
            should.extend(fine.iter().map(|&at| wanted(at, 1.0)));
        }
        let shape = [batch.count, 2];
        let should = TensorData::new(should.as_flattened().to_vec(), shape);
        (Tensor::cat(said, 0), Tensor::from_data(should, device))
    }
}

impl<B: AutodiffBackend> Task<B> for Measure {
    type Network = Estimator<B>;
    const GAINS: &'static Gains = &[];

    fn new(settings: &Settings) -> Self {
        let standard = EstimatorConfig::default();
        Self(match settings.width[..] {
            [a, b, c, d] => EstimatorConfig { channels: [a, b, c, d], ..standard },
            _ => standard,
        })
    }

    fn network(&self, device: &B::Device) -> Estimator<B> {
        self.0.init(device)
    }

    fn loss(
        &self,
        network: &Estimator<B>,
        batch: &Batch,
        _rng: &mut Pcg64Mcg,
        device: &B::Device,
    ) -> Tensor<B, 1> {
        let (said, should) = Self::outputs(network, batch, device);
        (said - should).abs().mean()
    }

    fn score(
        &self,
        network: &Estimator<B::InnerBackend>,
        batch: &Batch,
        device: &B::Device,
    ) -> f64 {
        let (said, should) = Self::outputs(network, batch, device);
        let errors = (said - should).square().mean_dim(1).into_data().convert::<f64>();
        errors.iter::<f64>().map(|error| -10.0 * error.max(1e-11).log10()).sum()
    }
}

/// The classifier's task: the class of a nearly sharp character.
pub(super) struct Classify(ClassifierConfig);

impl<B: AutodiffBackend> Task<B> for Classify {
    type Network = Classifier<B>;
    const GAINS: &'static Gains = &[];

    fn new(settings: &Settings) -> Self {
        let standard = ClassifierConfig::default();
        Self(match settings.width[..] {
            [a, b, c] => ClassifierConfig { channels: [a, b, c], ..standard },
            _ => standard,
        })
    }

    fn network(&self, device: &B::Device) -> Classifier<B> {
        self.0.init(device)
    }

    /// Cross-entropy. The run has checked before that labels exist.
    fn loss(
        &self,
        network: &Classifier<B>,
        batch: &Batch,
        _rng: &mut Pcg64Mcg,
        device: &B::Device,
    ) -> Tensor<B, 1> {
        let labels: Vec<i64> = batch.label.iter().map(|l| i64::from(l.unwrap_or(0))).collect();
        let labels = TensorData::new(labels, [batch.count, 1]);
        let labels = Tensor::<B, 2, Int>::from_data(labels, device);
        let logits = network.forward(scenes(&batch.degraded, device));
        -log_softmax(logits, 1).gather(1, labels).mean()
    }

    fn score(
        &self,
        network: &Classifier<B::InnerBackend>,
        batch: &Batch,
        device: &B::Device,
    ) -> f64 {
        let logits = network.forward(scenes(&batch.degraded, device));
        let named = logits.argmax(1).into_data().convert::<i64>();
        let right = named.iter::<i64>().zip(&batch.label);
        let right = right.filter(|(named, label)| label.is_some_and(|l| i64::from(l) == *named));
        100.0 * right.count() as f64
    }
}

//! Estimator, FSRCNN and UNet one after another on a GPU, for images that are there already.
//!
//! Law: between the images and the guess nothing comes to the host but blur and noise, two numbers an image.

use std::ops::Range;

use nirspi_recon::omp::gpu::DeviceImages;

use crate::device::{Device, Kind};
use crate::enhance::KnownEstimate;
use crate::estimate::Estimate;
use crate::weights::{Weights, WeightsError};
#[cfg(feature = "train")]
use on_burn::Chain;

/// What the networks make of images, on the host.
pub(crate) struct Guess {
    /// (N, 32, 32) in [0, 1].
    pub(crate) readings: Vec<f32>,
    pub(crate) estimates: Vec<Estimate>,
    /// (N, 64, 64) in [0, 1]: FSRCNN's.
    pub(crate) start: Vec<f32>,
    /// (N, 64, 64): the bridge's, in one step from there; not clamped.
    pub(crate) sharp: Vec<f32>,
}

/// The three networks on one GPU.
pub(crate) trait RunChain: Send {
    /// What they make of some of the images, `white` being 1. `depth`: (N, 2, 32, 32), see
    /// [`push_planes`](fusion::push_planes).
    fn run(
        &self,
        images: &DeviceImages,
        part: Range<usize>,
        white: f32,
        depth: &[f32],
        known: KnownEstimate,
    ) -> Guess;
}

impl Device {
    /// Networks of these weights on this device's GPU; none on the processor.
    pub(crate) fn chain(
        &self,
        fsrcnn: &Weights,
        estimator: &Weights,
        bridge: &Weights,
    ) -> Result<Option<Box<dyn RunChain>>, WeightsError> {
        Ok(match &self.kind {
            Kind::Cpu => None,
            #[cfg(feature = "train")]
            Kind::Wgpu(device) => {
                Some(Box::new(Chain::<Wgpu>::new(fsrcnn, estimator, bridge, device)?))
            }
            #[cfg(feature = "train")]
            Kind::Cuda(device) => {
                Some(Box::new(Chain::<Cuda>::new(fsrcnn, estimator, bridge, device)?))
            }
        })
    }
}

#[cfg(feature = "train")]
mod on_burn {
    use super::{Guess, RunChain};
    use std::ops::Range;

    use burn::backend::cuda::CudaDevice;
    use burn::backend::wgpu::{CubeTensor, WgpuDevice};
    use burn::backend::{Cuda, Wgpu};
    use burn::tensor::backend::{Backend, DeviceOps};
    use burn::tensor::{DType, Shape, Tensor, TensorPrimitive};
    use cubecl::Runtime;
    use cubecl::cuda::CudaRuntime;
    use cubecl::wgpu::WgpuRuntime;
    use nirspi_recon::omp::gpu::DeviceImages;

    use super::super::on_burn::{place, values};
    use super::super::{Conditions, OnBurn};
    use crate::deblur::SIDE;
    use crate::enhance::KnownEstimate;
    use crate::estimate::Estimate;
    use crate::fusion;
    use crate::model::{
        CONDITIONS, Estimator, EstimatorConfig, Fsrcnn, FsrcnnConfig, UNet, UNetConfig, nearest,
    };
    use crate::weights::{Weights, WeightsError};

    /// A backend whose memory is CubeCL's, as that of OMP's kernels is.
    trait Neighbour: Backend {
        /// The images as a tensor (N, 1, 32, 32), where they are.
        fn images(device: &Self::Device, images: &DeviceImages) -> Tensor<Self, 4>;
    }

    impl Neighbour for Wgpu {
        fn images(device: &WgpuDevice, images: &DeviceImages) -> Tensor<Self, 4> {
            Tensor::from_primitive(TensorPrimitive::Float(tensor::<WgpuRuntime>(device, images)))
        }
    }

    impl Neighbour for Cuda {
        fn images(device: &CudaDevice, images: &DeviceImages) -> Tensor<Self, 4> {
            Tensor::from_primitive(TensorPrimitive::Float(tensor::<CudaRuntime>(device, images)))
        }
    }

    fn tensor<R: Runtime<Device: DeviceOps>>(
        device: &R::Device,
        images: &DeviceImages,
    ) -> CubeTensor<R> {
        let shape = Shape::new([images.frames(), 1, fusion::SIDE, fusion::SIDE]);
        let (client, handle) = (R::client(device), images.handle().clone());
        CubeTensor::new_contiguous(client, device.clone(), shape, handle, DType::F32)
    }

    pub(super) struct Chain<B: Backend> {
        fsrcnn: OnBurn<B, Fsrcnn<B>>,
        estimator: OnBurn<B, Estimator<B>>,
        unet: OnBurn<B, UNet<B>>,
    }

    impl<B: Backend> Chain<B> {
        pub(super) fn new(
            fsrcnn: &Weights,
            estimator: &Weights,
            bridge: &Weights,
            device: &B::Device,
        ) -> Result<Self, WeightsError> {
            Ok(Self {
                fsrcnn: place(FsrcnnConfig::of(fsrcnn)?.init(device), fsrcnn, device)?,
                estimator: place(EstimatorConfig::of(estimator)?.init(device), estimator, device)?,
                unet: place(UNetConfig::of(bridge)?.init(device), bridge, device)?,
            })
        }
    }

    impl<B: Neighbour> RunChain for Chain<B> {
        fn run(
            &self,
            images: &DeviceImages,
            part: Range<usize>,
            white: f32,
            depth: &[f32],
            known: KnownEstimate,
        ) -> Guess {
            let Self { fsrcnn, estimator, unet } = self;
            let all = B::images(&unet.device, images);
            let readings = (all.narrow(0, part.start, part.len()) / white).clamp(0.0, 1.0);
            let outputs = values(estimator.module.forward(readings.clone()));
            let estimates: Vec<Estimate> = outputs
                .as_chunks()
                .0
                .iter()
                .map(|&outputs| known.over(Estimate::of_outputs(outputs, fusion::SIDE)))
                .collect();
            let depth = fsrcnn.images(2, fusion::SIDE, depth);
            let input = Tensor::cat(vec![readings.clone(), depth], 1);
            let start = fsrcnn.module.forward(input).clamp(0.0, 1.0);
            // The bridge from its beginning, t = 1, to its end.
            let conditions: Vec<Conditions> =
                estimates.iter().map(|estimate| estimate.conditions([1.0, 1.0])).collect();
            let conditions = unet.tensor([part.len(), CONDITIONS], conditions.as_flattened());
            let seen = nearest(readings.clone());
            let sharp = unet.module.forward(start.clone(), seen, conditions) + start.clone();
            debug_assert_eq!(sharp.dims(), [part.len(), 1, SIDE, SIDE]);
            Guess {
                readings: values(readings),
                estimates,
                start: values(start),
                sharp: values(sharp),
            }
        }
    }
}

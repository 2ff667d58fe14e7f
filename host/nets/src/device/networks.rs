//! The networks on a device: those of [`cpu`], or those of `gpu`.
//!
//! # Invariant
//! Every device gives the same numbers to within 1e-4
//! (`tests::every_device_of_this_machine_gives_what_pytorch_gives`), and no module above this one
//! depends on the device.

use super::Device;
use crate::cpu::{self, OnCpu};
#[cfg(feature = "gpu")]
use crate::gpu;
use crate::network::{RunEstimator, RunFsrcnn, RunUNet};
use crate::weights::{Weights, WeightsError};

impl Device {
    pub(crate) fn unet(&self, weights: &Weights) -> Result<Box<dyn RunUNet>, WeightsError> {
        #[cfg(feature = "gpu")]
        if let Some(engine) = self.engine() {
            let multiplier = self.multiplier(engine.as_ref());
            return Ok(Box::new(gpu::UNet::new(&engine, weights, multiplier)?.compared()));
        }
        Ok(Box::new(OnCpu(cpu::UNet::new(weights)?)))
    }

    pub(crate) fn estimator(
        &self,
        weights: &Weights,
    ) -> Result<Box<dyn RunEstimator>, WeightsError> {
        #[cfg(feature = "gpu")]
        if let Some(engine) = self.engine() {
            return Ok(Box::new(gpu::Estimator::new(&engine, weights)?));
        }
        Ok(Box::new(OnCpu(cpu::Estimator::new(weights)?)))
    }

    pub(crate) fn fsrcnn(&self, weights: &Weights) -> Result<Box<dyn RunFsrcnn>, WeightsError> {
        #[cfg(feature = "gpu")]
        if let Some(engine) = self.engine() {
            return Ok(Box::new(gpu::Fsrcnn::new(&engine, weights)?));
        }
        Ok(Box::new(OnCpu(cpu::Fsrcnn::new(weights)?)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::Backend;
    use crate::weights::Array;

    macro_rules! fixture {
        ($name:literal) => {
            Weights::parse(
                $name,
                include_bytes!(concat!("../../tests/pytorch/", $name, ".safetensors")),
            )
            .unwrap()
        };
    }

    fn values<const AXES: usize>(reference: &Weights, name: &str) -> Vec<f32> {
        let shape = reference.shape::<AXES>(name).unwrap();
        reference.tensor(name, &shape).unwrap().values.clone()
    }

    fn assert_close(ours: &[f32], theirs: &[f32], what: &str) {
        assert_eq!(ours.len(), theirs.len(), "{what}");
        for (at, (ours, theirs)) in ours.iter().zip(theirs).enumerate() {
            assert!((ours - theirs).abs() < 1e-4, "{what}: [{at}] {ours}, PyTorch {theirs}");
        }
    }

    #[test]
    fn every_device_of_this_machine_gives_what_pytorch_gives() {
        for backend in [Backend::Cpu, Backend::Wgpu, Backend::Cuda] {
            let device = match Device::open(backend) {
                Ok(device) => device,
                Err(absent) => {
                    eprintln!("skipped: {absent}");
                    continue;
                }
            };
            let reference = fixture!("unet_reference");
            let conditions = values::<2>(&reference, "in2").as_chunks().0.to_vec();
            let [current, degraded] = ["in0", "in1"].map(|name| values::<4>(&reference, name));
            let unet = device.unet(&fixture!("unet")).unwrap();
            let ours = unet.run(16, &current, &degraded, &conditions);
            assert_close(&ours, &values::<4>(&reference, "out0"), &format!("UNet, {backend}"));

            let reference = fixture!("estimator_reference");
            let estimator = device.estimator(&fixture!("estimator")).unwrap();
            let ours = estimator.run(16, &values::<4>(&reference, "in0"));
            let theirs = values::<2>(&reference, "out0");
            assert_close(ours.as_flattened(), &theirs, &format!("estimator, {backend}"));

            let reference = fixture!("fsrcnn_reference");
            let fsrcnn = device.fsrcnn(&fixture!("fsrcnn")).unwrap();
            let ours = fsrcnn.run(8, &values::<4>(&reference, "in0"));
            assert_close(&ours, &values::<4>(&reference, "out0"), &format!("FSRCNN, {backend}"));
        }
    }

    /// The weights without the tensors that `keep` does not keep.
    fn only(weights: &Weights, keep: impl Fn(&str) -> bool) -> Weights {
        let mut kept = Weights::new("altered");
        for name in weights.names().filter(|name| keep(name)) {
            kept.insert(name.to_owned(), weights.get(name).unwrap().clone());
        }
        kept
    }

    fn with(weights: &Weights, name: &str, shape: &[usize], value: f32) -> Weights {
        let mut altered = only(weights, |_| true);
        let values = vec![value; shape.iter().product()];
        altered.insert(name.to_owned(), Array { shape: shape.to_vec(), values });
        altered
    }

    #[test]
    fn every_device_refuses_the_same_weights_in_the_same_words() {
        let [unet, estimator, fsrcnn] =
            [fixture!("unet"), fixture!("estimator"), fixture!("fsrcnn")];
        let mut deep = only(&unet, |_| true);
        for (name, level) in unet.names().flat_map(|name| (3..8).map(move |level| (name, level))) {
            if let Some(rest) = name.strip_prefix("encoder.2.") {
                deep.insert(format!("encoder.{level}.{rest}"), unet.get(name).unwrap().clone());
            }
        }
        let unets = [
            (
                only(&unet, |name| !name.starts_with("decoder.")),
                "no tensor decoder.0.0.conv1.weight, expected 8 x 8 x 3 x 3",
            ),
            (
                with(&unet, "input_conv.weight", &[8, 1, 3, 3], 0.1),
                "input_conv.weight is 8 x 1 x 3 x 3, expected 8 x 8 x 3 x 3",
            ),
            (
                with(&unet, "output_conv.bias", &[4], f32::NAN),
                "output_conv.bias, 4, holds NaN at 0",
            ),
            (
                with(&unet, "output_conv.weight", &[3, 8, 3, 3], 0.1),
                "output_conv.weight is 3 x 8 x 3 x 3, expected 4 x 8 x 3 x 3",
            ),
            (
                with(&unet, "expand.0.weight", &[5, 12, 1, 1], 0.1),
                "expand.0.weight is 5 x 12 x 1 x 1, expected 32 x 12 x 1 x 1",
            ),
            (with(&unet, "extra.weight", &[1], 0.1), "no tensor extra.weight"),
            (deep, "tensor encoder.6.0.conv1.bias is in a list of more than 6"),
        ];
        let estimators = [
            (
                with(&estimator, "conv1.weight", &[4, 1, 9, 1], 0.1),
                "conv1.weight is 4 x 1 x 9 x 1, expected 4 x 1 x 3 x 3",
            ),
            (
                with(&estimator, "conv1.weight", &[4, 1, 5, 5], 0.1),
                "conv1.weight is 4 x 1 x 5 x 5, expected 4 x 1 x 3 x 3",
            ),
            (with(&estimator, "fc2.weight", &[1, 7], 0.1), "fc2.weight is 1 x 7, expected 2 x 7"),
            (
                with(&estimator, "fc2.weight", &[2, 7], f32::INFINITY),
                "fc2.weight, 2 x 7, holds inf at 0",
            ),
        ];
        let fsrcnns = [
            (only(&fsrcnn, |name| name != "map.1.bias"), "no tensor map.1.bias, expected 5"),
            (with(&fsrcnn, "deconv.bias", &[], 0.1), "deconv.bias is a single number, expected 1"),
            (
                with(&fsrcnn, "shrink_act.weight", &[5], f32::NAN),
                "shrink_act.weight, 5, holds NaN at 0",
            ),
        ];
        for backend in [Backend::Cpu, Backend::Wgpu, Backend::Cuda] {
            let device = match Device::open(backend) {
                Ok(device) => device,
                Err(absent) => {
                    eprintln!("skipped: {absent}");
                    continue;
                }
            };
            let refused = |error: WeightsError, words: &str| {
                let error = error.to_string();
                assert!(error.contains(words), "{backend}: {error}, expected {words}");
            };
            for (weights, words) in &unets {
                refused(device.unet(weights).err().unwrap(), words);
            }
            for (weights, words) in &estimators {
                refused(device.estimator(weights).err().unwrap(), words);
            }
            for (weights, words) in &fsrcnns {
                refused(device.fsrcnn(weights).err().unwrap(), words);
            }
        }
    }
}

//! Tests against PyTorch: `host/nets/tests/pytorch/make.py` made the weights, the inputs and the
//! outputs.

use burn::backend::Flex;
use burn::tensor::{Tensor, TensorData};

use super::*;
use crate::weights::{Array, Precision, Weights, WeightsError};

type Device = <Flex as burn::tensor::backend::BackendTypes>::Device;

macro_rules! fixture {
    ($name:literal) => {
        (
            Weights::parse(
                $name,
                include_bytes!(concat!("../../tests/pytorch/", $name, ".safetensors")),
            )
            .unwrap(),
            Weights::parse(
                $name,
                include_bytes!(concat!("../../tests/pytorch/", $name, "_reference.safetensors")),
            )
            .unwrap(),
        )
    };
}

fn tensor<const D: usize>(reference: &Weights, name: &str) -> Tensor<Flex, D> {
    let shape = reference.shape::<D>(name).unwrap();
    let array = reference.tensor(name, &shape).unwrap();
    Tensor::from_data(
        TensorData::new(array.values.clone(), array.shape.clone()),
        &Device::default(),
    )
}

fn assert_as_pytorch<const D: usize>(ours: Tensor<Flex, D>, reference: &Weights, name: &str) {
    let expected = reference.tensor(name, &ours.dims()).unwrap();
    let ours = ours.into_data().to_vec::<f32>().unwrap();
    for (i, (ours, theirs)) in ours.iter().zip(&expected.values).enumerate() {
        assert!((ours - theirs).abs() < 1e-4, "{name}[{i}]: {ours}, PyTorch {theirs}");
    }
}

#[test]
fn the_unet_gives_what_pytorch_gives() {
    let (weights, reference) = fixture!("unet");
    let config = UNetConfig::of(&weights).unwrap();
    assert_eq!(config, UNetConfig { channels: vec![8, 12, 16], blocks: 2, embedding: 8 });
    let unet = fill(config.init::<Flex>(&Device::default()), &weights).unwrap();
    let out = unet.forward(
        tensor(&reference, "in0"),
        tensor(&reference, "in1"),
        tensor(&reference, "in2"),
    );
    assert_as_pytorch(out, &reference, "out0");
}

#[test]
fn the_estimator_gives_what_pytorch_gives() {
    let (weights, reference) = fixture!("estimator");
    let config = EstimatorConfig::of(&weights).unwrap();
    let estimator = fill(config.init::<Flex>(&Device::default()), &weights).unwrap();
    assert_as_pytorch(estimator.forward(tensor(&reference, "in0")), &reference, "out0");
}

#[test]
fn fsrcnn_gives_what_pytorch_gives() {
    let (weights, reference) = fixture!("fsrcnn");
    let config = FsrcnnConfig::of(&weights).unwrap();
    let fsrcnn = fill(config.init::<Flex>(&Device::default()), &weights).unwrap();
    assert_as_pytorch(fsrcnn.forward(tensor(&reference, "in0")), &reference, "out0");
}

#[test]
fn the_classifier_gives_what_pytorch_gives() {
    let (weights, reference) = fixture!("classifier");
    let config = ClassifierConfig::of(&weights).unwrap();
    let classifier = fill(config.init::<Flex>(&Device::default()), &weights).unwrap();
    let images = tensor(&reference, "in0");
    assert_as_pytorch(classifier.features(images.clone()), &reference, "out0");
    assert_as_pytorch(classifier.forward(images), &reference, "out1");
}

#[test]
fn the_discriminator_gives_what_pytorch_gives() {
    let (weights, reference) = fixture!("discriminator");
    let config = DiscriminatorConfig::of(&weights).unwrap();
    let discriminator = fill(config.init::<Flex>(&Device::default()), &weights).unwrap();
    let out = discriminator.forward(tensor(&reference, "in0"), tensor(&reference, "in1"));
    assert_as_pytorch(out, &reference, "out0");
}

#[test]
fn weights_survive_a_module_and_a_file() {
    let (mut weights, _) = fixture!("fsrcnn");
    let device = Device::default();
    let module = fill(FsrcnnConfig::of(&weights).unwrap().init::<Flex>(&device), &weights).unwrap();
    let mut kept = weights_of("fsrcnn", &module);
    for key in ["model", "version", "recipe"] {
        kept.set_metadata(key, weights.metadata(key).unwrap());
    }
    weights.set_metadata("format", "pt");
    kept.set_metadata("format", "pt");
    assert_eq!(kept, weights);
    let read = Weights::parse("fsrcnn", &kept.to_bytes(Precision::Single).unwrap()).unwrap();
    assert_eq!(read, weights);
}

#[test]
fn weights_of_another_network_are_refused_by_the_name_of_a_tensor() {
    let (mut weights, _) = fixture!("estimator");
    let device = Device::default();
    assert!(matches!(
        UNetConfig::of(&weights),
        Err(WeightsError::Missing { tensor, .. }) if tensor == "embed1.weight"
    ));
    let error = fill(EstimatorConfig::default().init::<Flex>(&device), &weights).unwrap_err();
    assert_eq!(
        error.to_string(),
        "estimator: tensor conv1.weight is 4 x 1 x 3 x 3, expected 16 x 1 x 3 x 3"
    );
    weights.insert("fc3.weight".to_owned(), Array { shape: vec![1], values: vec![0.0] });
    let error = EstimatorConfig::of(&weights).unwrap_err().to_string();
    assert!(error.contains("no tensor fc3.weight"), "{error}");
    let (weights, _) = fixture!("estimator");
    let config = EstimatorConfig::of(&weights).unwrap();
    let mut more = weights.clone();
    more.insert("fc3.weight".to_owned(), Array { shape: vec![1], values: vec![0.0] });
    let error = fill(config.init::<Flex>(&device), &more).unwrap_err();
    assert!(error.to_string().contains("no tensor fc3.weight"), "{error}");
    let mut poisoned = weights;
    let nan = Array { shape: vec![2], values: vec![0.0, f32::NAN] };
    poisoned.insert("fc2.bias".to_owned(), nan);
    let error = fill(config.init::<Flex>(&device), &poisoned).unwrap_err().to_string();
    assert!(error.contains("fc2.bias") && error.contains("NaN at 1"), "{error}");
}

//! Tests against PyTorch (`host/nets/tests/pytorch/make.py`), and against the definition of a
//! convolution.

use proptest::prelude::*;
use pulp::Arch;

use super::conv::Conv;
use super::planes::Planes;
use super::*;
use crate::weights::Weights;

fn weights(bytes: &[u8]) -> Weights {
    Weights::parse("fixture", bytes).unwrap()
}

macro_rules! fixture {
    ($name:literal) => {
        (
            weights(include_bytes!(concat!("../../tests/pytorch/", $name, ".safetensors"))),
            weights(include_bytes!(concat!(
                "../../tests/pytorch/",
                $name,
                "_reference.safetensors"
            ))),
        )
    };
}

/// Image `index` of a tensor, and its shape without the first axis.
fn image<const AXES: usize>(of: &Weights, name: &str, index: usize) -> (Vec<f32>, [usize; AXES]) {
    let shape = of.shape::<AXES>(name).unwrap();
    let size: usize = shape[1..].iter().product();
    (of.tensor(name, &shape).unwrap().values[index * size..][..size].to_vec(), shape)
}

fn assert_close(ours: &[f32], theirs: &[f32]) {
    assert_eq!(ours.len(), theirs.len());
    for (i, (ours, theirs)) in ours.iter().zip(theirs).enumerate() {
        assert!((ours - theirs).abs() < 2e-6, "{i}: {ours}, PyTorch {theirs}");
    }
}

#[test]
fn the_unet_gives_what_pytorch_gives() {
    let (weights, reference) = fixture!("unet");
    let unet = UNet::new(&weights).unwrap();
    for index in 0..2 {
        let (current, [_, _, height, width]) = image::<4>(&reference, "in0", index);
        let (raw, _) = image::<4>(&reference, "in1", index);
        let (conditions, _) = image::<2>(&reference, "in2", index);
        let out = unet.forward(&current, &raw, (height, width), &conditions);
        assert_close(&out, &image::<4>(&reference, "out0", index).0);
    }
}

#[test]
fn the_prior_gives_what_pytorch_gives_from_the_measurements_on() {
    use nirspi_recon::reconstruct::prior::Seen;
    use nirspi_recon::{Measurements, Rows, Side};
    let (weights, reference) = fixture!("prior");
    let network = Prior::new(&weights).unwrap();
    let within = |ours: &[f32], theirs: &[f32], most: f32| {
        assert_eq!(ours.len(), theirs.len());
        let off = ours.iter().zip(theirs).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < most, "{off}");
    };
    for case in 0..3 {
        let values = |name: &str| reference.get(&format!("{name}{case}")).unwrap().values.clone();
        let side = Side::new(values("side")[0] as u64).unwrap();
        let rows = Rows::new(side, values("rows").into_iter().map(|row| row as u32)).unwrap();
        let d: Vec<f64> = values("d").into_iter().map(f64::from).collect();
        let seen = Seen::new(&Measurements::from_differential(&rows, &d).unwrap()).unwrap();
        within(seen.conditions(), &values("told"), 1e-5);
        within(&[seen.noise()], &values("noise"), 1e-5);
        within(&seen.image(seen.start()), &values("start"), 2e-3);
        within(&seen.image(&network.forward(&seen)), &values("out"), 5e-3);
    }
}

#[test]
fn fsrcnn_gives_what_pytorch_gives() {
    let (weights, reference) = fixture!("fsrcnn");
    let fsrcnn = Fsrcnn::new(&weights).unwrap();
    for index in 0..2 {
        let (input, [_, _, height, width]) = image::<4>(&reference, "in0", index);
        let out = fsrcnn.forward(&input, (height, width));
        assert_close(&out, &image::<4>(&reference, "out0", index).0);
    }
}

#[test]
fn the_estimator_gives_what_pytorch_gives() {
    let (weights, reference) = fixture!("estimator");
    let estimator = Estimator::new(&weights).unwrap();
    for index in 0..2 {
        let (input, [_, _, height, width]) = image::<4>(&reference, "in0", index);
        let out = estimator.forward(&input, (height, width));
        assert_close(&out, &image::<2>(&reference, "out0", index).0);
    }
}

#[test]
fn the_classifier_gives_what_pytorch_gives() {
    let (weights, reference) = fixture!("classifier");
    let classifier = Classifier::new(&weights).unwrap();
    for index in 0..2 {
        let (input, [_, _, height, width]) = image::<4>(&reference, "in0", index);
        let features = classifier.features(&input, (height, width));
        assert_eq!(features.len(), classifier.feature_count());
        assert_close(&features, &image::<2>(&reference, "out0", index).0);
        let logits = classifier.logits(&features);
        assert_close(&logits, &image::<2>(&reference, "out1", index).0);
    }
}

#[test]
fn weights_of_another_network_are_refused_by_the_name_of_a_tensor() {
    let (weights, _) = fixture!("fsrcnn");
    let error = UNet::new(&weights).unwrap_err();
    assert!(error.to_string().contains("no tensor embed1.weight"), "{error}");
}

/// A reproducible number in [-1, 1).
fn number(seed: &mut u64) -> f32 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 40) as f32 / (1 << 23) as f32 - 1.0
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(40))]

    /// Every image size, number of channels and kernel gives the result of the definition on every
    /// vector width, and margins are zero again.
    #[test]
    fn a_convolution_is_the_sum_over_channels_and_taps(
        (inputs, outputs, height, width) in (1_usize..6, 1_usize..11, 1_usize..12, 1_usize..40),
        kernel in prop::sample::select(vec![1_usize, 3, 5]),
        mut seed in any::<u64>(),
    ) {
        let reach = kernel / 2;
        let mut input = Planes::new(inputs, height, width, 2);
        for (channel, row) in (0..inputs).flat_map(|c| (0..height).map(move |r| (c, r))) {
            input.row_mut(channel, row).iter_mut().for_each(|x| *x = number(&mut seed));
        }
        let taps = kernel * kernel;
        let weights: Vec<f32> = (0..outputs * inputs * taps).map(|_| number(&mut seed)).collect();
        let weight = |o: usize, i: usize, ky: usize, kx: usize| {
            weights[(o * inputs + i) * taps + ky * kernel + kx]
        };
        let conv = Conv::new((outputs, inputs, kernel, reach), weight, |o| o as f32);
        let out = conv.apply(Arch::new(), &input);
        prop_assert_eq!(&conv.apply(Arch::Scalar, &input).pixels().len(), &out.pixels().len());
        for (o, row, column) in (0..outputs)
            .flat_map(|o| (0..height).map(move |r| (o, r)))
            .flat_map(|(o, r)| (0..width).map(move |c| (o, r, c)))
        {
            let mut sum = o as f64;
            for (i, ky, kx) in (0..inputs)
                .flat_map(|i| (0..kernel).map(move |ky| (i, ky)))
                .flat_map(|(i, ky)| (0..kernel).map(move |kx| (i, ky, kx)))
            {
                let (y, x) = ((row + ky).wrapping_sub(reach), (column + kx).wrapping_sub(reach));
                if y < height && x < width {
                    sum += f64::from(weight(o, i, ky, kx)) * f64::from(input.row(i, y)[x]);
                }
            }
            prop_assert!((f64::from(out.row(o, row)[column]) - sum).abs() < 1e-4);
        }
        let inside: f64 = out.pixels().iter().map(|&x| f64::from(x).abs()).sum();
        let all: f64 = out.values().iter().map(|&x| f64::from(x).abs()).sum();
        prop_assert!((inside - all).abs() < 1e-9 * (1.0 + all), "margins hold {}", all - inside);
    }

    /// Shuffling an unshuffled image gives the image.
    #[test]
    fn a_shuffle_undoes_an_unshuffle((height, width) in (1_usize..9, 1_usize..9), mut seed in any::<u64>()) {
        let image: Vec<f32> = (0..4 * height * width).map(|_| number(&mut seed)).collect();
        let mut planes = Planes::new(4, height, width, 1);
        planes.unshuffle(0, &image);
        prop_assert_eq!(planes.shuffle(3).pixels(), image);
    }
}

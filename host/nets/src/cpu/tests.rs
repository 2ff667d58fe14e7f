//! Tests against PyTorch (`host/nets/tests/pytorch/make.py`), and against the definition of a
//! convolution.

use proptest::prelude::*;
use pulp::Arch;

use super::conv::Conv;
use super::pixels::Pixels;
use super::planes::Planes;
use super::pointwise::Pointwise;
use super::winograd::Winograd;
use super::*;
use crate::filter::Filter;
use crate::weights::{Array, Weights};

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

/// Pixels of reproducible numbers.
fn random_pixels((channels, height, width): (usize, usize, usize), seed: &mut u64) -> Pixels {
    let mut pixels = Pixels::new(channels, height, width);
    let pitch = pixels.pitch();
    for row in 0..height {
        for pixel in pixels.row_mut(row).chunks_exact_mut(pitch) {
            pixel[..channels].iter_mut().for_each(|x| *x = number(seed));
        }
    }
    pixels
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

    /// Every image size, odd ones too, and every number of channels gives the result of the
    /// definition, added to what is there, on every vector width; margins and padding stay zero.
    #[test]
    fn winograds_convolution_is_the_sum_over_channels_and_taps(
        (inputs, outputs, height, width) in (1_usize..20, 1_usize..70, 1_usize..14, 1_usize..40),
        mut seed in any::<u64>(),
    ) {
        let input = random_pixels((inputs, height, width), &mut seed);
        let filter = Filter {
            inputs,
            outputs,
            side: 3,
            weights: (0..outputs * inputs * 9).map(|_| number(&mut seed)).collect(),
            bias: (0..outputs).map(|_| number(&mut seed)).collect(),
        };
        let before = random_pixels((outputs, height, width), &mut seed);
        let conv = Winograd::new(&filter);
        for arch in [Arch::new(), Arch::Scalar] {
            let mut out = before.like(outputs);
            out.values_mut().copy_from_slice(before.values());
            conv.add_to(arch, &input, &mut out);
            let mut inside = 0.0;
            for (row, column) in (0..height).flat_map(|r| (0..width).map(move |c| (r, c))) {
                let at = |of: &Pixels| of.row(row)[column * of.pitch()..][..outputs].to_vec();
                for (o, (found, start)) in at(&out).into_iter().zip(at(&before)).enumerate() {
                    let mut sum = f64::from(start) + f64::from(filter.bias[o]);
                    for (ky, kx) in (0..3).flat_map(|ky| (0..3).map(move |kx| (ky, kx))) {
                        let (y, x) = ((row + ky).wrapping_sub(1), (column + kx).wrapping_sub(1));
                        if y < height && x < width {
                            let pixel = &input.row(y)[x * input.pitch()..][..inputs];
                            sum += pixel.iter().enumerate().map(|(i, value)| {
                                f64::from(filter.at(o, i, ky, kx)) * f64::from(*value)
                            }).sum::<f64>();
                        }
                    }
                    prop_assert!((f64::from(found) - sum).abs() < 2e-5, "{found}, expected {sum}");
                    inside += f64::from(found).abs();
                }
            }
            let all: f64 = out.values().iter().map(|&x| f64::from(x).abs()).sum();
            prop_assert!((inside - all).abs() < 1e-9 * (1.0 + all), "margins hold {}", all - inside);
        }
    }

    /// Convolutions to half the size and to twice the size give the result of their definitions,
    /// added to what is there.
    #[test]
    fn windows_are_reduced_and_pixels_expanded_as_defined(
        (inputs, outputs, height, width) in (1_usize..20, 1_usize..20, 1_usize..12, 1_usize..24),
        side in 2_usize..4,
        mut seed in any::<u64>(),
    ) {
        // Only a kernel of 3 x 3 has a margin, which an odd side needs.
        let even = |pixels: usize| if side == 2 { 2 * pixels } else { pixels };
        let (height, width) = (even(height), even(width));
        let mut weights = Weights::new("levels");
        let mut insert = |name: &str, shape: &[usize]| -> Vec<f32> {
            let values: Vec<f32> =
                (0..shape.iter().product()).map(|_| number(&mut seed)).collect();
            let array = Array { shape: shape.to_vec(), values: values.clone() };
            weights.insert(name.to_owned(), array);
            values
        };
        let reduce = insert("reduce.weight", &[outputs, inputs, side, side]);
        let reduce_bias = insert("reduce.bias", &[outputs]);
        let expand = insert("expand.weight", &[4 * outputs, inputs, 1, 1]);
        let expand_bias = insert("expand.bias", &[4 * outputs]);
        let input = random_pixels((inputs, height, width), &mut seed);
        let value = |of: &Pixels, row: usize, column: usize, channel: usize| {
            f64::from(of.row(row)[column * of.pitch() + channel])
        };
        let arch = Arch::new();
        let conv = Pointwise::reducing(&weights, "reduce").unwrap();
        let mut reduced = conv.output(&input);
        reduced.row_mut(0)[0] = 1.0;
        conv.add_to(arch, &input, &mut reduced);
        prop_assert_eq!(reduced.size(), (height.div_ceil(2), width.div_ceil(2)));
        let conv = Pointwise::expanding(&weights, "expand").unwrap();
        let mut expanded = conv.output(&input);
        expanded.row_mut(0)[0] = 1.0;
        conv.add_to(arch, &input, &mut expanded);
        prop_assert_eq!(expanded.size(), (2 * height, 2 * width));
        for (y, x) in (0..2 * height).flat_map(|y| (0..2 * width).map(move |x| (y, x))) {
            for o in 0..outputs {
                let row = 4 * o + y % 2 * 2 + x % 2;
                let sum = (0..inputs).map(|i| {
                    f64::from(expand[row * inputs + i]) * value(&input, y / 2, x / 2, i)
                });
                let there = if (y, x, o) == (0, 0, 0) { 1.0 } else { 0.0 };
                let sum = sum.sum::<f64>() + f64::from(expand_bias[row]) + there;
                prop_assert!((value(&expanded, y, x, o) - sum).abs() < 1e-5);
            }
        }
        let (rows, columns) = reduced.size();
        for (row, column) in (0..rows).flat_map(|r| (0..columns).map(move |c| (r, c))) {
            for o in 0..outputs {
                let mut sum = f64::from(reduce_bias[o]);
                for (dy, dx) in (0..side).flat_map(|dy| (0..side).map(move |dx| (dy, dx))) {
                    let (y, x) = (2 * row + dy + 2, 2 * column + dx + 2);
                    let (y, x) = (y.wrapping_sub(side), x.wrapping_sub(side));
                    if y < height && x < width {
                        sum += (0..inputs).map(|i| {
                            let weight = reduce[((o * inputs + i) * side + dy) * side + dx];
                            f64::from(weight) * value(&input, y, x, i)
                        }).sum::<f64>();
                    }
                }
                let there = if (row, column, o) == (0, 0, 0) { 1.0 } else { 0.0 };
                prop_assert!((value(&reduced, row, column, o) - sum - there).abs() < 2e-5);
            }
        }
    }

    /// Shuffling an unshuffled image gives the image.
    #[test]
    fn a_shuffle_undoes_an_unshuffle((height, width) in (1_usize..9, 1_usize..9), mut seed in any::<u64>()) {
        let image: Vec<f32> = (0..4 * height * width).map(|_| number(&mut seed)).collect();
        let mut pixels = Pixels::new(4, height, width);
        pixels.unshuffle(0, &image);
        prop_assert_eq!(pixels.shuffled(), &image[..]);
        let mut planes = Planes::new(4, height, width, 1);
        for (row, column) in (0..height).flat_map(|r| (0..width).map(move |c| (r, c))) {
            for channel in 0..4 {
                planes.row_mut(channel, row)[column] =
                    pixels.row(row)[column * pixels.pitch() + channel];
            }
        }
        prop_assert_eq!(planes.shuffle(3).pixels(), image);
    }
}

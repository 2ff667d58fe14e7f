//! Convolutions by products of small matrices. [`Product::Imitated`] does what tensor cores do, from
//! the same places in shared memory, on devices without them; where a device has tensor cores, the
//! same tests use these.

use nirspi_gpu::network::tiles::Columns;
use nirspi_gpu::network::{Layer, Product, Products, Way, is_f16};

use super::*;
use crate::arithmetic::Arithmetic;
use crate::gpu::multiplier::Multiplier;
use crate::gpu::{UNet, pack};
use crate::note::{Note, Notes};

/// The tensor cores of a device, or else their imitation.
fn product_of(engine: &dyn Kernels) -> Option<Product> {
    let product = [Product::TensorCores, Product::Imitated].into_iter().find(|&p| engine.has(p));
    if product.is_none() {
        eprintln!("skipped: this device has no f16");
    }
    product
}

/// The nearest number of f16, by its definition: 11 bits, and none finer than 2^-24.
fn nearest_f16(x: f32) -> f32 {
    let exponent = x.abs().log2().floor().max(-14.0);
    let unit = (exponent - 10.0).exp2();
    (x / unit).round_ties_even() * unit
}

/// A filter whose weights are exact in f16.
fn narrow_filter(inputs: usize, outputs: usize, side: usize, seed: u64) -> Filter {
    let filter = random_filter(inputs, outputs, side, seed);
    let weights = filter.weights.iter().map(|&w| nearest_f16(w)).collect();
    Filter { weights, ..filter }
}

fn layer_of(
    on: &dyn Kernels,
    filter: &Filter,
    reach: (usize, usize),
    order: Order,
    (product, planes): (Product, usize),
) -> (Layer, Buffer) {
    let columns = Columns::of(filter.outputs).unwrap();
    let beyond = on.upload(&[0.0]);
    let weights = on.narrow(&pack::products(filter, columns, order));
    let products = Products { product, planes, columns, weights, beyond: beyond.clone() };
    (layer::layer(on, filter, reach, None, order).with_products(products), beyond)
}

/// Inputs, outputs, kernel, stride, zeros around the image, side: the layers of the shipped UNet
/// that go by products, small, and those of narrower networks.
const LAYERS: [(usize, usize, usize, usize, usize, usize); 8] = [
    (8, 48, 3, 1, 1, 32),
    (48, 48, 3, 1, 1, 32),
    (96, 96, 3, 1, 1, 16),
    (192, 192, 3, 1, 1, 8),
    (48, 96, 2, 2, 0, 32),
    (96, 192, 1, 1, 0, 16),
    (40, 32, 3, 1, 1, 16),
    (16, 16, 3, 1, 1, 4),
];

#[test]
fn every_layer_by_products_is_its_definition() {
    for (backend, engine) in engines() {
        let on = engine.as_ref();
        for (inputs, outputs, kernel, stride, centre, side) in LAYERS {
            // Fewer frames than a workgroup has for small sides, and more.
            let frames = if side > 16 { 1 } else { 3 };
            let filter = narrow_filter(inputs, outputs, kernel, 11);
            let images = numbers(frames * side * side * inputs, 13);
            let of = |images: &[f32]| -> Vec<f32> {
                let each = images.chunks_exact(side * side * inputs);
                each.flat_map(|image| definition(&filter, (stride, centre), image, side)).collect()
            };
            let narrow: Vec<f32> = images.iter().map(|&v| nearest_f16(v)).collect();
            let expected = [of(&narrow), of(&images)];
            let input = on.upload(&images);
            if let Some(product) = product_of(on) {
                // Both numbers of products below each other, for the sizes that have both.
                let many = (side > 8 && inputs == outputs).then_some((2, Way::Products(4)));
                for (planes, way) in [(1, Way::Products(2)), (2, Way::Best)].into_iter().chain(many)
                {
                    let how = (product, planes);
                    let (layer, beyond) =
                        layer_of(on, &filter, (stride, centre), Order::AsStored, how);
                    let finish = Finish { way, ..Finish::default() };
                    let made = on.convolve(&layer, &input, frames, side, finish);
                    let what = format!(
                        "{backend}: {inputs} to {outputs}, {kernel} x {kernel}, {how:?}, {way:?}"
                    );
                    assert_close(&read(on, &made.out), &expected[planes - 1], &what);
                    assert_eq!(read(on, &beyond), [0.0], "{what}");
                }
            }
        }
    }
}

#[test]
fn what_follows_a_product_is_done_to_its_own_pixel_and_channel() {
    let (frames, side, outputs) = (3, 8, 32);
    let filter = narrow_filter(16, outputs, 3, 17);
    let images = numbers(frames * side * side * 16, 19);
    let film = numbers(frames * (2 * outputs + 3), 29);
    let addend = numbers(frames * side * side * outputs, 41);
    for (backend, engine) in engines() {
        let on = engine.as_ref();
        let [input, film, addend] = [&images, &film, &addend].map(|v| on.upload(v));
        let finishes = [
            Finish {
                activation: Activation::FilmSilu,
                film: Some((&film, 2)),
                ..Finish::default()
            },
            Finish { add: Some((Add::Alike, &addend)), activated: true, ..Finish::default() },
            Finish {
                add: Some((Add::Alike, &addend)),
                shuffle: true,
                activated: true,
                clamp: true,
                ..Finish::default()
            },
        ];
        for (product, finish) in
            product_of(on).into_iter().flat_map(|p| finishes.iter().map(move |f| (p, f)))
        {
            let order = if finish.shuffle { Order::Shuffled } else { Order::AsStored };
            let (layer, _) = layer_of(on, &filter, (1, 1), order, (product, 2));
            let fast = on.convolve(&layer, &input, frames, side, *finish);
            let plain = Finish { way: Way::Plain, ..*finish };
            let plain = on.convolve(&layer, &input, frames, side, plain);
            let what = format!("{backend}: {product:?}, {:?}", finish.activation);
            assert_close(&read(on, &fast.out), &read(on, &plain.out), &what);
            let activated = |made: &nirspi_gpu::network::Made| {
                made.activated.as_ref().map(|there| read(on, there))
            };
            if let (Some(fast), Some(plain)) = (activated(&fast), activated(&plain)) {
                assert_close(&fast, &plain, &what);
            }
        }
    }
}

#[test]
fn numbers_are_rounded_as_f16_rounds_them() {
    for x in [0.0, 1.0, -0.333, 1e-7, 3e-8, 2.9e-8, 6.1e-5, 6.0e-5, 65_504.0, 2049.0, 2051.0] {
        assert!(is_f16(nearest_f16(x)), "{x}");
        assert!((nearest_f16(x) - x).abs() <= (x.abs() / 2048.0).max(2f32.powi(-25)), "{x}");
    }
    assert!(!is_f16(0.333) && !is_f16(65_505.0) && !is_f16(f32::NAN));
}

/// A kernel that copies channel 0, so that each number can be seen as it was multiplied.
#[test]
fn an_activation_is_a_number_of_f16_or_the_sum_of_two() {
    let mut filter =
        Filter { inputs: 8, outputs: 16, side: 1, weights: vec![0.0; 8 * 16], bias: vec![0.0; 16] };
    filter.weights[0] = 1.0;
    let tricky = [1.0, 1.0 / 3.0, 2049.0, 2051.0, -4097.5, 1e-6, 6.0e-5, 5.97e-8, 2e-8, 60_001.0];
    let mut images = vec![0.0; 16 * 8];
    for (image, x) in images.chunks_exact_mut(8).zip(tricky) {
        image[0] = x;
    }
    for (backend, engine) in engines() {
        let on = engine.as_ref();
        if let Some(product) = product_of(on) {
            let seen = |planes| -> Vec<f32> {
                let how = (product, planes);
                let (layer, _) = layer_of(on, &filter, (1, 0), Order::AsStored, how);
                let made = on.convolve(&layer, &on.upload(&images), 1, 4, Finish::default());
                read(on, &made.out).chunks_exact(16).map(|pixel| pixel[0]).collect()
            };
            let (one, two) = (seen(1), seen(2));
            for (at, x) in tricky.into_iter().enumerate() {
                let near = nearest_f16(x);
                assert_eq!(one[at], near, "{backend}: {product:?}: {x}");
                assert_eq!(two[at], near + nearest_f16(x - near), "{backend}: {product:?}: {x}");
            }
        }
    }
}

fn unet(engine: &Arc<dyn Kernels>, arithmetic: Option<(Product, Arithmetic)>) -> (UNet, Notes) {
    let notes = Notes::default();
    let multiplier = arithmetic.map(|(product, arithmetic)| {
        Multiplier::new(engine.as_ref(), product, arithmetic, notes.clone())
    });
    let weights = Weights::embedded("diffusion").unwrap();
    (UNet::new(engine, &weights, multiplier).unwrap(), notes)
}

/// A letter-like scene, and the same scene blurred: what the network is for.
fn scene() -> [Vec<f32>; 2] {
    let at = |x: usize, y: usize| f32::from((20..28).contains(&x) || (30..38).contains(&y));
    let sharp: Vec<f32> = (0..64 * 64).map(|i| at(i % 64, i / 64)).collect();
    let soft = |i: usize| {
        let (x, y) = (i % 64, i / 64);
        let near = |v: usize| v.saturating_sub(2)..(v + 3).min(64);
        let sum: f32 =
            near(y).flat_map(|y| near(x).map(move |x| (x, y))).map(|(x, y)| at(x, y)).sum();
        sum / 25.0
    };
    [sharp, (0..64 * 64).map(soft).collect()]
}

#[test]
fn the_unet_by_products_is_the_unet_in_both_precisions() {
    let [sharp, soft] = scene();
    let told = [1.0, 1.0, 0.5, 0.25, 0.1, 0.01];
    let theirs = cpu::UNet::new(&Weights::embedded("diffusion").unwrap()).unwrap();
    let theirs = theirs.forward(&sharp, &soft, (64, 64), &told);
    for (backend, engine) in engines() {
        if let Some(product) = product_of(engine.as_ref()) {
            for (arithmetic, largest, rms) in
                [(Arithmetic::F32, 1e-4, 1e-5), (Arithmetic::F16, 5e-3, 2e-4)]
            {
                let (unet, notes) = unet(&engine, Some((product, arithmetic)));
                let ours = unet.run(64, &sharp, &soft, &[told]);
                let apart: Vec<f32> =
                    ours.iter().zip(&theirs).map(|(a, b)| (a - b).abs()).collect();
                let most = apart.iter().copied().fold(0.0, f32::max);
                let mean = apart.iter().map(|v| v * v).sum::<f32>() / apart.len() as f32;
                eprintln!(
                    "{backend}, {product:?}, {arithmetic}: {most:.1e} at most, {:.1e} rms",
                    mean.sqrt()
                );
                // NaN fails these comparisons too.
                assert!(
                    apart.iter().all(|v| v.is_finite()) && most <= largest && mean.sqrt() <= rms
                );
                assert_eq!(notes.take(), []);
            }
        }
    }
}

#[test]
fn a_number_beyond_f16_is_computed_without_tensor_cores_and_the_user_is_told() {
    let told = [1.0, 1.0, 0.5, 0.25, 0.1, 0.01];
    let mut bright = scene()[1].clone();
    bright[2080] = 1e5;
    for (backend, engine) in engines() {
        let (plain, _) = unet(&engine, None);
        let expected = plain.run(64, &bright, &bright, &[told]);
        let Some(product) = product_of(engine.as_ref()) else { continue };
        let (unet, notes) = unet(&engine, Some((product, Arithmetic::F32)));
        for _ in 0..2 {
            assert_eq!(unet.run(64, &bright, &bright, &[told]), expected, "{backend}");
        }
        assert_eq!(notes.take(), [Note::BeyondF16], "{backend}");
    }
}

#[test]
fn tensor_cores_that_fail_the_comparison_are_not_used_and_the_user_is_told() {
    let told = [1.0, 1.0, 0.5, 0.25, 0.1, 0.01];
    let [sharp, soft] = scene();
    let weights = Weights::embedded("diffusion").unwrap();
    for (backend, engine) in engines() {
        let Some(product) = product_of(engine.as_ref()) else { continue };
        let (plain, _) = unet(&engine, None);
        let expected = plain.run(64, &sharp, &soft, &[told]);
        for (fault, note) in [(1.0, None), (1.01, Some(Note::TensorCoresDiffer))] {
            let notes = Notes::default();
            let on = engine.as_ref();
            let mut multiplier = Multiplier::new(on, product, Arithmetic::F32, notes.clone());
            multiplier.fault = fault;
            let unet = UNet::new(&engine, &weights, Some(multiplier)).unwrap().compared();
            assert_eq!(notes.take(), note.into_iter().collect::<Vec<_>>(), "{backend}: {fault}");
            if fault > 1.0 {
                assert_eq!(unet.run(64, &sharp, &soft, &[told]), expected, "{backend}");
            }
        }
    }
}

#[test]
fn weights_that_are_not_exact_in_f16_are_not_rounded_in_single_precision() {
    let Some((_, engine)) = engines().into_iter().next() else { return };
    let on = engine.as_ref();
    let mut filter = narrow_filter(16, 16, 3, 5);
    let notes = Notes::default();
    let of = |arithmetic| Multiplier::new(on, Product::Imitated, arithmetic, notes.clone());
    let equip = |filter: &Filter, arithmetic| {
        let plain = layer::layer(on, filter, (1, 1), None, Order::AsStored);
        of(arithmetic).equip(on, plain, filter, Order::AsStored).has_products()
    };
    assert!(equip(&filter, Arithmetic::F32));
    filter.weights[7] = 1.0 / 3.0;
    assert!(!equip(&filter, Arithmetic::F32));
    assert_eq!(notes.take(), [Note::WeightsNotF16]);
    assert!(equip(&filter, Arithmetic::F16));
    filter.weights[7] = 1e5;
    assert!(!equip(&filter, Arithmetic::F16));
    assert_eq!(notes.take(), [Note::WeightsBeyondF16]);
    let other = narrow_filter(16, 12, 3, 5);
    assert!(!equip(&other, Arithmetic::F32), "12 channels do not fit");
    assert_eq!(notes.take(), []);
}

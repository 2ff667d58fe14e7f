//! Tests of every kernel against its definition in double precision, on each GPU of this machine
//! and on software Vulkan. A machine without either prints that the tests are skipped. With debug assertions,
//! buffers are full of NaN before a kernel writes them, so a test notices each number that the kernel left
//! unwritten.

mod agreement;
mod products;

use std::sync::Arc;

use nirspi_gpu::network::{Activation, Add, Degraded, Finish};
use nirspi_gpu::{Buffer, Kernels};

use super::layer::{self, Maker};
use super::pack::Order;
use crate::Known;
use crate::cpu;
use crate::device::{Backend, Device};
use crate::filter::Filter;
use crate::network::{RunEstimator, RunFsrcnn, RunUNet};
use crate::weights::Weights;

/// Reproducible numbers in [-1, 1).
fn numbers(count: usize, seed: u64) -> Vec<f32> {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let next = || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1 << 23) as f32 - 1.0
    };
    std::iter::repeat_with(next).take(count).collect()
}

pub(super) fn random_filter(inputs: usize, outputs: usize, side: usize, seed: u64) -> Filter {
    let gain = 1.0 / ((inputs * side * side) as f32).sqrt();
    let weights = numbers(outputs * inputs * side * side, seed).into_iter().map(|w| 2.0 * gain * w);
    Filter { inputs, outputs, side, weights: weights.collect(), bias: numbers(outputs, seed + 1) }
}

/// A convolution of one image (side, side, inputs) by its definition, with zeros around the image.
pub(super) fn definition(
    filter: &Filter,
    (stride, centre): (usize, usize),
    image: &[f32],
    side: usize,
) -> Vec<f32> {
    let out = (side + 2 * centre - filter.side) / stride + 1;
    let mut made = Vec::new();
    for (pixel, output) in (0..out * out).flat_map(|p| (0..filter.outputs).map(move |o| (p, o))) {
        let mut sum = f64::from(filter.bias[output]);
        for (ky, kx) in (0..filter.side).flat_map(|ky| (0..filter.side).map(move |kx| (ky, kx))) {
            let y = (pixel / out * stride + ky).wrapping_sub(centre);
            let x = (pixel % out * stride + kx).wrapping_sub(centre);
            if y < side && x < side {
                let seen = &image[(y * side + x) * filter.inputs..][..filter.inputs];
                let products = seen.iter().enumerate().map(|(input, &value)| {
                    f64::from(filter.at(output, input, ky, kx)) * f64::from(value)
                });
                sum += products.sum::<f64>();
            }
        }
        made.push(sum as f32);
    }
    made
}

fn engines() -> Vec<(Backend, Arc<dyn Kernels>)> {
    let open = |backend| match Device::open(backend) {
        Ok(device) => device.engine().map(|engine| (backend, engine)),
        Err(absent) => {
            eprintln!("skipped: {absent}");
            None
        }
    };
    [Backend::Wgpu, Backend::Cuda].into_iter().filter_map(open).collect()
}

fn assert_close(ours: &[f32], expected: &[f32], what: &str) {
    assert_eq!(ours.len(), expected.len(), "{what}");
    for (at, (ours, expected)) in ours.iter().zip(expected).enumerate() {
        let apart = (ours - expected).abs();
        // NaN fails this comparison too.
        assert!(
            apart <= 2e-5 * (1.0 + expected.abs()),
            "{what}: [{at}] {ours}, expected {expected}"
        );
    }
}

fn read(engine: &dyn Kernels, buffer: &Buffer) -> Vec<f32> {
    super::read(engine, &[buffer]).swap_remove(0)
}

fn silu(x: f32) -> f32 {
    x / (1.0 + (-x).exp())
}

/// Inputs, outputs, kernel, stride, zeros around the image, side: each kind of layer of the shipped
/// networks, and unusual ones.
const LAYERS: [(usize, usize, usize, usize, usize, usize); 16] = [
    (8, 48, 3, 1, 1, 32),
    (48, 48, 3, 1, 1, 9),
    (96, 96, 3, 1, 1, 5),
    (192, 192, 3, 1, 1, 3),
    (48, 96, 2, 2, 0, 8),
    (96, 192, 1, 1, 0, 4),
    (48, 4, 3, 1, 1, 8),
    (3, 48, 5, 1, 2, 7),
    (48, 12, 1, 1, 0, 7),
    (12, 12, 3, 1, 1, 7),
    (48, 4, 5, 1, 2, 7),
    (1, 16, 3, 1, 1, 8),
    (16, 32, 3, 2, 1, 8),
    (48, 64, 3, 2, 1, 7),
    (6, 64, 1, 1, 0, 1),
    (64, 333, 1, 1, 0, 1),
];

#[test]
fn every_shape_of_layer_is_its_definition_for_few_and_many_pixels_a_unit() {
    for (backend, engine) in engines() {
        for (inputs, outputs, kernel, stride, centre, side) in LAYERS {
            // More pixels than one workgroup has, and not a multiple of that number.
            let frames = if side == 1 { 67 } else { 3 };
            let filter = random_filter(inputs, outputs, kernel, 11);
            let images = numbers(frames * side * side * inputs, 13);
            let expected: Vec<f32> = images
                .chunks_exact(side * side * inputs)
                .flat_map(|image| definition(&filter, (stride, centre), image, side))
                .collect();
            let input = engine.upload(&images);
            for pixels in [Some(2), Some(8), None] {
                let on = engine.as_ref();
                let layer = layer::layer(on, &filter, (stride, centre), None, Order::AsStored);
                let layer = match pixels {
                    Some(pixels) => layer.with_pixels(pixels),
                    None => layer,
                };
                let made = engine.convolve(&layer, &input, frames, side, Finish::default());
                let what =
                    format!("{backend}: {inputs} to {outputs}, {kernel} x {kernel}, {pixels:?}");
                assert_close(&read(engine.as_ref(), &made.out), &expected, &what);
            }
        }
    }
}

#[test]
fn activations_are_what_they_are_called() {
    let (frames, side, outputs) = (3, 5, 20);
    let filter = random_filter(4, outputs, 3, 17);
    let images = numbers(frames * side * side * 4, 19);
    let slopes = numbers(outputs, 23);
    // Two additional rows before and one after.
    let film = numbers(frames * (2 * outputs + 3), 29);
    let sums: Vec<f32> = images
        .chunks_exact(side * side * 4)
        .flat_map(|image| definition(&filter, (1, 1), image, side))
        .collect();
    let told = |at: usize| {
        let (frame, channel) = (at / (side * side * outputs), at % outputs);
        let first = frame * (2 * outputs + 3) + 2 + channel;
        (film[first], film[first + outputs])
    };
    for (backend, engine) in engines() {
        let on = engine.as_ref();
        let layer = layer::layer(on, &filter, (1, 1), Some(&slopes), Order::AsStored);
        let (input, film) = (on.upload(&images), on.upload(&film));
        let expect = |activation, film, of: &dyn Fn(usize, f32) -> f32| {
            let finish = Finish { activation, film, ..Finish::default() };
            let made = on.convolve(&layer, &input, frames, side, finish);
            let expected: Vec<f32> = sums.iter().enumerate().map(|(at, &x)| of(at, x)).collect();
            assert_close(&read(on, &made.out), &expected, &format!("{backend}: {activation:?}"));
        };
        expect(Activation::Silu, None, &|_, x| silu(x));
        expect(Activation::Prelu, None, &|at, x| x.max(0.0) + slopes[at % outputs] * x.min(0.0));
        expect(Activation::Softplus, None, &|_, x| x.max(0.0) + (-x.abs()).exp().ln_1p());
        expect(Activation::FilmSilu, Some((&film, 2)), &|at, x| {
            let (scale, shift) = told(at);
            silu(x * (1.0 + scale) + shift)
        });
    }
}

#[test]
fn sums_shuffles_and_clamps_go_where_they_belong() {
    let (frames, side, outputs) = (2, 6, 12);
    let filter = random_filter(5, outputs, 1, 31);
    let images = numbers(frames * side * side * 5, 37);
    let sums: Vec<f32> = images
        .chunks_exact(side * side * 5)
        .flat_map(|image| definition(&filter, (1, 0), image, side))
        .collect();
    let alike = numbers(frames * side * side * outputs, 41);
    let pixel = numbers(frames * side * side, 43);
    // Pixel (y, x), channel 4 c + 2 dy + dx goes to pixel (2 y + dy, 2 x + dx), channel c.
    let shuffled = |values: &[f32]| {
        let mut out = vec![f32::NAN; values.len()];
        for (at, value) in values.iter().enumerate() {
            let (channel, pixel) = (at % outputs, at / outputs);
            let (frame, y, x) = (pixel / side / side, pixel / side % side, pixel % side);
            let (c, dy, dx) = (channel / 4, channel / 2 % 2, channel % 2);
            let to = (frame * 2 * side + 2 * y + dy) * 2 * side + 2 * x + dx;
            out[to * outputs / 4 + c] = *value;
        }
        out
    };
    let plus = |a: &[f32], b: &[f32]| a.iter().zip(b).map(|(a, b)| a + b).collect::<Vec<_>>();
    let spread: Vec<f32> = pixel.iter().flat_map(|&v| [v; 12]).collect();
    for (backend, engine) in engines() {
        let on = engine.as_ref();
        let [input, alike_there, pixel_there] = [&images, &alike, &pixel].map(|v| on.upload(v));
        let make = |finish: Finish<'_>| {
            let order = if finish.shuffle { Order::Shuffled } else { Order::AsStored };
            let layer = layer::layer(on, &filter, (1, 0), None, order);
            on.convolve(&layer, &input, frames, side, finish)
        };
        let added = Finish { add: Some((Add::Alike, &alike_there)), ..Finish::default() };
        let both = make(Finish { activated: true, ..added });
        let expected = plus(&sums, &alike);
        assert_close(&read(on, &both.out), &expected, &format!("{backend}: residual"));
        let activated: Vec<f32> = expected.iter().map(|&x| silu(x)).collect();
        let silu_of_it = read(on, &both.activated.unwrap());
        assert_close(&silu_of_it, &activated, &format!("{backend}: SiLU of it"));

        let skip = make(Finish { shuffle: true, ..added });
        let expected = plus(&shuffled(&sums), &alike);
        assert_close(&read(on, &skip.out), &expected, &format!("{backend}: shuffle and skip"));

        let pixel = Some((Add::Pixel, &pixel_there));
        let start = make(Finish { add: pixel, shuffle: true, clamp: true, ..Finish::default() });
        let expected: Vec<f32> =
            shuffled(&plus(&sums, &spread)).iter().map(|v| v.clamp(0.0, 1.0)).collect();
        assert_close(&read(on, &start.out), &expected, &format!("{backend}: clamped"));
    }
}

#[test]
fn the_small_kernels_put_each_number_where_it_belongs() {
    for (backend, engine) in engines() {
        let on = engine.as_ref();
        let close = |ours: &Buffer, expected: &[f32], what: &str| {
            assert_close(&read(on, ours), expected, &format!("{backend}: {what}"));
        };
        // 300 numbers need more than one workgroup.
        let images = numbers(400, 47);
        let expected: Vec<f32> = images[100..].iter().map(|v| (v / 0.75).clamp(0.0, 1.0)).collect();
        let readings = on.readings(&on.upload(&images), 100, 0.75, 300);
        close(&readings, &expected, "readings");

        let (frames, side) = (3, 10);
        let area = side * side;
        let depth = numbers(2 * frames * area, 53);
        let stack = |has_depth: bool| -> Vec<f32> {
            let of = |plane: usize, pixel: usize| {
                let at = (pixel / area * 2 + plane) * area + pixel % area;
                if has_depth { depth[at] } else { 0.0 }
            };
            (0..frames * area).flat_map(|p| [expected[p], of(0, p), of(1, p)]).collect()
        };
        close(&on.stacked(&readings, Some(&on.upload(&depth)), area), &stack(true), "stacked");
        close(&on.stacked(&readings, None, area), &stack(false), "stacked, no depth");

        let fine = [numbers(4 * frames * area, 59), numbers(4 * frames * area, 61)];
        let block = |image: &[f32], at: usize, place: usize| {
            let (frame, y, x) = (at / area, at / side % side, at % side);
            image[(frame * 2 * side + 2 * y + place / 2) * 2 * side + 2 * x + place % 2]
        };
        let pair = |coarse: bool| -> Vec<f32> {
            let of = |at: usize| {
                let degraded = |q| if coarse { expected[at] } else { block(&fine[1], at, q) };
                let places = [0, 1, 2, 3];
                [places.map(|q| block(&fine[0], at, q)), places.map(degraded)]
            };
            (0..frames * area).flat_map(|at| of(at).as_flattened().to_vec()).collect()
        };
        let [current, degraded] = [&fine[0], &fine[1]].map(|image| on.upload(image));
        let out = on.paired(&current, Degraded::Fine(&degraded), side);
        close(&out, &pair(false), "paired");
        close(&on.paired(&current, Degraded::Coarse(&readings), side), &pair(true), "coarse");

        let features: Vec<f32> = numbers(2 * 9 * 150, 67).iter().map(|v| v + 1.0).collect();
        let mean = |frame: usize, channel: usize| {
            let pixels = (0..9).map(|pixel| features[(frame * 9 + pixel) * 150 + channel]);
            (pixels.sum::<f32>() / 9.0 + 0.5).ln() + 3.0
        };
        let expected: Vec<f32> =
            (0..2).flat_map(|f| (0..150).map(move |c| (f, c))).map(|(f, c)| mean(f, c)).collect();
        close(&on.pooled(&on.upload(&features), 9, 150, (0.5, 3.0)), &expected, "pooled");
    }
}

#[test]
fn conditions_are_those_that_the_host_would_tell() {
    let outputs = [[0.2, 0.3], [0.9, 0.01], [0.0, 4.0]];
    for (backend, engine) in engines() {
        let on = engine.as_ref();
        let there = on.upload(outputs.as_flattened());
        let known = [Known::Nothing, Known::AtLeast(0.05), Known::Exactly(0.07)];
        for (blur, noise) in known.into_iter().flat_map(|blur| known.map(|noise| (blur, noise))) {
            let pixels = |known| match known {
                Known::Nothing => Known::Nothing,
                Known::AtLeast(share) => Known::AtLeast(40.0 * share),
                Known::Exactly(share) => Known::Exactly(40.0 * share),
            };
            let known = crate::KnownEstimate { sigma_px: pixels(blur), noise };
            let of = |outputs| known.over(crate::Estimate::of_outputs(outputs, 32));
            let expected = outputs.map(|outputs| of(outputs).conditions([0.5, 0.25]));
            let ours = on.conditions(&there, &known.condition_bounds([0.5, 0.25]), 2.0);
            assert_close(&read(on, &ours), expected.as_flattened(), &format!("{backend}"));
        }
    }
}

/// The shipped networks, at the sizes at which they are used.
#[test]
fn the_shipped_networks_give_what_the_processor_gives() {
    let weights = |model| Weights::embedded(model).unwrap();
    let positive =
        |count, seed| -> Vec<f32> { numbers(count, seed).iter().map(|v| 0.5 + 0.5 * v).collect() };
    for (backend, engine) in engines() {
        let close = |ours: &[f32], theirs: &[f32], what: &str| {
            assert_eq!(ours.len(), theirs.len());
            for (at, (ours, theirs)) in ours.iter().zip(theirs).enumerate() {
                let apart = (ours - theirs).abs();
                assert!(
                    apart < 1e-4,
                    "{backend}: {what}: [{at}] {ours}, {theirs} on the processor"
                );
            }
        };
        let unet = super::UNet::new(&engine, &weights("diffusion"), None).unwrap();
        let [current, degraded] = [71, 73].map(|seed| positive(64 * 64, seed));
        let told = [0.5, 0.25, 0.4, 0.16, 0.3, 0.09];
        let theirs = cpu::UNet::new(&weights("diffusion")).unwrap();
        let theirs = theirs.forward(&current, &degraded, (64, 64), &told);
        close(&unet.run(64, &current, &degraded, &[told]), &theirs, "UNet");

        let input = positive(3 * 32 * 32, 79);
        let ours = super::Fsrcnn::new(&engine, &weights("fsrcnn")).unwrap().run(32, &input);
        let theirs = cpu::Fsrcnn::new(&weights("fsrcnn")).unwrap().forward(&input, (32, 32));
        close(&ours, &theirs, "FSRCNN");

        for side in [32, 64] {
            let image = positive(side * side, 83);
            let estimator = super::Estimator::new(&engine, &weights("estimator")).unwrap();
            let theirs = cpu::Estimator::new(&weights("estimator")).unwrap();
            let theirs = theirs.forward(&image, (side, side));
            close(&estimator.run(side, &image)[0], &theirs, "estimator");
        }
    }
}

#[test]
fn a_layer_that_is_too_wide_is_refused_by_name() {
    let Some((_, engine)) = engines().into_iter().next() else { return };
    let mut weights = Weights::new("wide");
    let array = |shape: &[usize]| crate::weights::Array {
        shape: shape.to_vec(),
        values: vec![0.0; shape.iter().product()],
    };
    weights.insert("conv.weight".to_owned(), array(&[1, 6000, 3, 3]));
    weights.insert("conv.bias".to_owned(), array(&[1]));
    let make = Maker { engine: engine.as_ref(), weights: &weights, multiplier: None };
    let error = make.same("conv", Order::AsStored).err().unwrap();
    assert_eq!(
        error.to_string(),
        "wide: layer conv has 6000 input channels, expected at most 5920 on a GPU; use the processor (--backend cpu)"
    );
}

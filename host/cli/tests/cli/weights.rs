//! Weights that are not a whole network: one line that names the tensor, on every backend of this machine.

use crate::bench::Bench;
use nirspi::files::npy;
use nirspi_nets::Weights;
use nirspi_nets::weights::{Array, MODEL, Precision};

/// The embedded weights of a network as a file, after `alter` has been at each tensor: `None` leaves it out.
fn file(model: &str, alter: impl Fn(&str, Array) -> Option<Array>) -> Vec<u8> {
    let sound = Weights::embedded(model).unwrap();
    let mut altered = Weights::new("altered");
    altered.set_metadata(MODEL, model);
    for key in ["steps", "beta_start", "beta_end"] {
        if let Some(text) = sound.metadata(key) {
            altered.set_metadata(key, text);
        }
    }
    let names: Vec<&str> = sound.names().collect();
    for name in names {
        let array = sound.get(name).unwrap().clone();
        if let Some(array) = alter(name, array) {
            altered.insert(name.to_owned(), array);
        }
    }
    altered.to_bytes(Precision::Single).unwrap()
}

/// The file with another array in the place of one tensor.
fn with(model: &str, tensor: &str, shape: &[usize], value: f32) -> Vec<u8> {
    file(model, |name, array| {
        let values = vec![value; shape.iter().product()];
        Some(if name == tensor { Array { shape: shape.to_vec(), values } } else { array })
    })
}

#[test]
fn weights_that_are_no_whole_network_are_refused_on_every_backend() {
    let bench = Bench::new();
    for (name, side) in [("coarse.npy", 32), ("fine.npy", 64)] {
        let pixels: Vec<f32> =
            (0..side * side).map(|at| (at % side) as f32 / side as f32).collect();
        bench.write(name, &npy::encode(&[side, side], &pixels));
    }
    let no_decoder =
        |model: &str| file(model, |name, array| (!name.starts_with("decoder.")).then_some(array));
    let cases: [(&str, Vec<u8>, &[&str]); 10] = [
        (
            "diffusion",
            no_decoder("diffusion"),
            &["no tensor decoder.0.0.conv1.weight, expected 48 x 48 x 3 x 3"],
        ),
        ("gan", no_decoder("gan"), &["no tensor decoder.0.0.conv1.weight"]),
        ("ancestral", no_decoder("ancestral"), &["no tensor decoder.0.0.conv1.weight"]),
        (
            "diffusion",
            with("diffusion", "input_conv.weight", &[48, 1, 3, 3], 0.1),
            &["input_conv.weight is 48 x 1 x 3 x 3, expected 48 x 8 x 3 x 3"],
        ),
        (
            "diffusion",
            with("diffusion", "output_conv.bias", &[4], f32::NAN),
            &["output_conv.bias, 4, holds NaN at 0"],
        ),
        (
            "estimator",
            with("estimator", "conv1.weight", &[16, 1, 9, 1], 0.1),
            &["conv1.weight is 16 x 1 x 9 x 1, expected 16 x 1 x 3 x 3"],
        ),
        (
            "estimator",
            with("estimator", "conv1.weight", &[16, 1, 5, 5], 0.1),
            &["conv1.weight is 16 x 1 x 5 x 5"],
        ),
        (
            "estimator",
            with("estimator", "fc2.weight", &[1, 64], 0.1),
            &["fc2.weight is 1 x 64, expected 2 x 64"],
        ),
        (
            "fsrcnn",
            with("fsrcnn", "deconv.bias", &[1], f32::INFINITY),
            &["deconv.bias, 1, holds inf at 0"],
        ),
        (
            "fsrcnn",
            file("fsrcnn", |name, array| (name != "map.1.bias").then_some(array)),
            &["no tensor map.1.bias, expected 12"],
        ),
    ];
    for backend in ["cpu", "wgpu", "cuda"] {
        for (at, (model, bytes, words)) in cases.iter().enumerate() {
            bench.write("w.safetensors", bytes);
            let networks = ["--weights", "w.safetensors", "--backend", backend, "--out", "out.npy"];
            // The estimator is run by every command, the deblurrers by their own, FSRCNN where an image is enlarged.
            let command: &[&str] = match *model {
                "fsrcnn" | "estimator" | "diffusion" => &["enhance", "coarse.npy"],
                other => &["deblur", "fine.npy", "--model", other],
            };
            let outcome = bench.run(&[command, &networks].concat());
            if outcome.stderr.contains(&format!("backend {backend}: ")) {
                assert_ne!(backend, "cpu");
                eprintln!("skipped: {}", outcome.stderr.trim());
                break;
            }
            outcome.failed(1, &[&["w.safetensors"], *words].concat());
            assert!(!bench.path("out.npy").exists(), "{model}, case {at}");
        }
    }
}

#[test]
fn a_schedule_of_no_steps_is_refused() {
    let bench = Bench::new();
    let pixels: Vec<f32> = (0..64 * 64).map(|at| (at % 64) as f32 / 63.0).collect();
    bench.write("in.npy", &npy::encode(&[64, 64], &pixels));
    let mut weights = Weights::parse("sound", &file("ancestral", |_, array| Some(array))).unwrap();
    for (key, text, words) in [
        ("steps", "NaN", "steps is NaN, expected a whole number from 1 to 10000"),
        ("steps", "0", "steps is 0, expected a whole number"),
        ("steps", "500", ""),
        ("beta_end", "1.5", "beta_end is 1.5, expected a number between 0 and 1"),
    ] {
        weights.set_metadata(key, text);
        if words.is_empty() {
            continue;
        }
        bench.write("w.safetensors", &weights.to_bytes(Precision::Single).unwrap());
        let deblur =
            ["deblur", "in.npy", "--model", "ancestral", "--steps", "2", "--backend", "cpu"];
        let more = ["--weights", "w.safetensors", "--out", "out.npy"];
        bench.run(&[&deblur[..], &more].concat()).failed(1, &[words]);
    }
}

//! Weights that are not a whole network: one line that names the file and the tensor, and nothing is written. That each device
//! refuses them in the same words is tested in `nirspi-nets`.

use crate::bench::Bench;
use nirspi::files::npy;
use nirspi_nets::Weights;
use nirspi_nets::weights::{MODEL, Precision};

/// The embedded weights of a network as a file, without the tensors whose names begin like this.
fn without(model: &str, lost: &str) -> Vec<u8> {
    let sound = Weights::embedded(model).unwrap();
    let mut altered = Weights::new("altered");
    altered.set_metadata(MODEL, model);
    for name in sound.names().filter(|name| !name.starts_with(lost)) {
        altered.insert(name.to_owned(), sound.get(name).unwrap().clone());
    }
    altered.to_bytes(Precision::Single).unwrap()
}

#[test]
fn weights_that_are_no_whole_network_are_refused() {
    let bench = Bench::new();
    for (name, side) in [("coarse.npy", 32), ("fine.npy", 64)] {
        let pixels: Vec<f32> =
            (0..side * side).map(|at| (at % side) as f32 / side as f32).collect();
        bench.write(name, &npy::encode(&[side, side], &pixels));
    }
    // The estimator is run by every command, the deblurrers by their own, FSRCNN where an image is enlarged.
    for (command, model, lost, words) in [
        ("enhance coarse.npy", "diffusion", "decoder.", "no tensor decoder.0.0.conv1.weight"),
        ("enhance coarse.npy", "estimator", "fc2.weight", "no tensor fc2.weight, expected 2 x 64"),
        ("enhance coarse.npy", "fsrcnn", "map.1.bias", "no tensor map.1.bias, expected 12"),
        ("deblur fine.npy --model gan", "gan", "decoder.", "no tensor decoder.0.0.conv1.weight"),
        ("deblur fine.npy --model ancestral", "ancestral", "decoder.", "no tensor decoder.0.0"),
    ] {
        bench.write("w.safetensors", &without(model, lost));
        let mut arguments: Vec<&str> = command.split(' ').collect();
        arguments.extend(["--weights", "w.safetensors", "--backend", "cpu", "--out", "out.npy"]);
        bench.run(&arguments).failed(1, &["w.safetensors", words]);
        assert!(!bench.path("out.npy").exists(), "{command}");
    }
}

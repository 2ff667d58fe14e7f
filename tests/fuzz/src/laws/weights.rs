//! Weights of networks.

use crate::{Law, MIB, read};
use nirspi_nets::cpu::{Classifier, Estimator, Fsrcnn, UNet};
use nirspi_nets::weights::{Array, Precision, Weights};

pub const LAWS: &[Law] = &[Law {
    name: "weights",
    reads: "a safetensors file of a network's weights",
    readers: &["host/nets/src/weights.rs", "host/nets/src/schema.rs"],
    holds: weights,
    seeds: weight_seeds,
    longest: 8192,
    most_memory: 64 * MIB,
}];

const IMAGE: [f32; 3 * 64 * 64] = [0.5; 3 * 64 * 64];

fn weights(bytes: &[u8]) {
    let Some(weights) = read(Weights::parse("any", bytes)) else { return };
    read(weights.expect_model("small"));
    read(weights.tensor("a.weight", &[4, 3]));
    if let Some(once) = read(weights.to_bytes(Precision::Single)) {
        let again = Weights::parse("any", &once).expect("our own file");
        // Bits and not numbers, because NaN differs from itself.
        assert_eq!(again.fingerprint(), weights.fingerprint(), "other numbers");
        assert_eq!(format!("{again:?}"), format!("{weights:?}"), "other weights");
    }
    let (one, side) = (&IMAGE[..64 * 64], (64, 64));
    read(UNet::new(&weights).map(|net| net.forward(one, one, side, &[0.5; 6])));
    read(Fsrcnn::new(&weights).map(|net| net.forward(&IMAGE, side)));
    read(Estimator::new(&weights).map(|net| net.forward(one, side)));
    read(Classifier::new(&weights).map(|net| net.features(one, side)));
}

fn weight_seeds() -> Vec<Vec<u8>> {
    let mut weights = Weights::new("small");
    for (name, shape) in
        [("a.weight", vec![4, 3]), ("a.bias", vec![4]), ("head.weight", vec![2, 4])]
    {
        let count: usize = shape.iter().product();
        let values = (0..count).map(|k| k as f32 / 8.0).collect();
        weights.insert(name.to_owned(), Array { shape, values });
    }
    weights.set_metadata("model", "small");
    let single = weights.to_bytes(Precision::Single).expect("a file");
    let half = weights.to_bytes(Precision::Half).expect("a file");
    // Without the checksum, whose value no search finds.
    let plain = br#"{"__metadata__":{"model":"small"},"a.weight":{"dtype":"F32","shape":[4,3],"data_offsets":[0,48]}}  "#;
    let length = (plain.len() as u64).to_le_bytes();
    let bare = [&length[..], plain, &[0x3F; 48]].concat();
    vec![single, half, bare]
}

#![doc = include_str!("../README.md")]
#![no_std]

/// Each network's name and the bytes of its safetensors file.
pub const FILES: [(&str, &[u8]); 3] = [
    ("gan", include_bytes!("../gan.safetensors")),
    ("ancestral", include_bytes!("../ancestral.safetensors")),
    ("regression", include_bytes!("../regression.safetensors")),
];

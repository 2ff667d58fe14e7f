#![doc = include_str!("../README.md")]
#![no_std]

/// Each network's name and the bytes of its safetensors file.
pub const FILES: [(&str, &[u8]); 2] = [
    ("gan", include_bytes!("../gan.safetensors")),
    ("ancestral", include_bytes!("../ancestral.safetensors")),
];

#![doc = include_str!("../README.md")]
#![no_std]

/// Each network's name and the bytes of its safetensors file.
pub const FILES: [(&str, &[u8]); 5] = [
    ("estimator", include_bytes!("../estimator.safetensors")),
    ("fsrcnn", include_bytes!("../fsrcnn.safetensors")),
    ("diffusion", include_bytes!("../diffusion.safetensors")),
    ("prior", include_bytes!("../prior.safetensors")),
    ("classifier", include_bytes!("../classifier.safetensors")),
];

/// JSON lists of the font families, writers and photographs that no training has seen.
pub const HELD_OUT: &str = include_str!("../held_out.json");

/// The calibration of intervals and of readings of characters, as JSON.
pub const INTERVALS: &str = include_str!("../intervals.json");

//! A sharpening network of your own in place of the built-in one. Here the network is unsharp
//! masking, as strong as the blur is wide.
//!
//! `cargo run -p nirspi-nets --example own_network`

use nirspi_nets::{Blurred, Device, Enhancer, Images, Options, Sharpen};
use std::num::NonZeroU32;

struct UnsharpMask;

impl Sharpen for UnsharpMask {
    fn guess(&self, batch: Blurred<'_>) -> Vec<f32> {
        let images = batch.current.chunks(64 * 64).zip(batch.estimates);
        let sharpened = images.flat_map(|(image, estimate)| {
            (0..64 * 64).map(move |at: usize| {
                // Beyond the edge the pixel's own value is used.
                let at_step = |step| image.get(at.wrapping_add_signed(step)).unwrap_or(&image[at]);
                let around: f32 = [-64, -1, 1, 64].map(at_step).into_iter().sum();
                image[at] + estimate.sigma_px * (image[at] - 0.25 * around)
            })
        });
        sharpened.collect()
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // A white square, slightly out of focus.
    let side = |at: usize| ((11.0 - (at as f32 - 15.5).abs()) / 5.0).clamp(0.1, 0.9);
    let reading: Vec<f32> = (0..1024).map(|at| side(at % 32).min(side(at / 32))).collect();
    let (device, options) = (Device::cpu(), Options::default());
    let own = Enhancer::built_in(&device)?.with_network(Box::new(UnsharpMask), NonZeroU32::MIN);
    for (name, enhancer) in [("built-in", Enhancer::built_in(&device)?), ("unsharp mask", own)] {
        let made = enhancer.enhance(Images::new(&reading)?, None, &options, &mut |_| {})?;
        let middle = made.images[32 * 64..33 * 64].iter();
        let row: String = middle.map(|v| b" .:-=+*#%@"[(9.0 * v) as usize] as char).collect();
        println!("{name:>12} |{row}| inconsistency {:.2}", made.inconsistency[0]);
    }
    Ok(())
}

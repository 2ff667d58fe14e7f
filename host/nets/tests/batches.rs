//! A stack is worked through in batches, and no image may notice.

#![expect(clippy::unwrap_used, reason = "what a test cannot set up, it cannot pass")]

use nirspi_nets::{Blurred, DepthMaps, Device, Enhancer, Images, Options, Sharpen};
use std::num::NonZeroU32;

/// More images than a batch of the processor holds.
const COUNT: usize = 34;
const AREA: usize = 64 * 64;

/// A network that is content with what it gets: the batches are tried, not the network.
struct Content;

impl Sharpen for Content {
    fn guess(&self, batch: Blurred<'_>) -> Vec<f32> {
        batch.current.to_vec()
    }
}

fn enhancer() -> Enhancer {
    Enhancer::built_in(&Device::cpu()).unwrap().with_network(Box::new(Content), NonZeroU32::MIN)
}

/// A square out of focus.
fn square() -> Vec<f32> {
    let side = |at: usize| ((11.0 - (at as f32 - 15.5).abs()) / 5.0).clamp(0.1, 0.9);
    (0..1024).map(|at| side(at % 32).min(side(at / 32))).collect()
}

#[test]
fn each_image_of_a_long_stack_is_upscaled_with_its_own_depth_map() {
    let (enhancer, options) = (enhancer(), Options::default());
    let metres = |image: usize| 0.1 + 0.08 * image as f32;
    let maps = DepthMaps::new((0..COUNT).map(metres).collect(), [COUNT, 1, 1], COUNT).unwrap();
    let stack = square().repeat(COUNT);
    let images = Images::new(&stack).unwrap();
    let all = enhancer.enhance(images, Some(&maps), &options, &mut |_| {}).unwrap();
    let all = all.upscaled.unwrap();
    let mut before = None;
    for image in [0, 1, 31, 32, 33] {
        let map = DepthMaps::new(vec![metres(image)], [1, 1, 1], 1).unwrap();
        let alone = square();
        let alone = Images::new(&alone).unwrap();
        let alone = enhancer.enhance(alone, Some(&map), &options, &mut |_| {}).unwrap();
        assert_eq!(all[image * AREA..][..AREA], alone.upscaled.unwrap(), "image {image}");
        // Depth is seen at all.
        assert_ne!(
            before.replace(&all[image * AREA..][..AREA]),
            Some(&all[image * AREA..][..AREA])
        );
    }
}

/// The spread comes from noise that is drawn for each image. Two images with the same draws would have
/// the same spread, and an average over a stack would not average the noise away.
#[test]
fn equal_images_of_a_long_stack_get_noise_of_their_own() {
    let stack = square().repeat(COUNT);
    let options = Options { copies: 2, ..Options::default() };
    let images = Images::new(&stack).unwrap();
    let spread = enhancer().enhance(images, None, &options, &mut |_| {}).unwrap().spread.unwrap();
    for (image, one) in spread.chunks_exact(AREA).enumerate() {
        let same = spread.chunks_exact(AREA).position(|other| other == one);
        assert_eq!(same, Some(image), "the same draws");
    }
}

//! How the work on a stack is watched, and ended.

/// What is done to a stack.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// An image is made of measurements; of many files, it comes once for each file.
    Reconstruct,
    /// Networks enlarge and deblur an image.
    Enhance,
}

/// Is called before each step of each image, from any thread. `false` ends the work, and the images that are there are written.
pub type Watch<'w> = &'w (dyn Fn(Step) -> bool + Sync);

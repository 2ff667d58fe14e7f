//! What networks are trained on: labelled characters, split by who drew them, and scenes that are no letters.
//!
//! The one law: an example is a pure function of the seed and its number. Nothing here keeps a random state, so a run
//! that was stopped goes on with the very examples that it would have seen, and a held-out group is never drawn for
//! training.
//!
//! | module | holds |
//! |---|---|
//! | [`stack`] | images of 64 x 64 with label and group (font family, writer, photograph) |
//! | [`split`] | which groups training never sees |
//! | [`augment`] | one image seen otherwise: moved, bent, on another ground |
//! | [`shapes`] | procedural scenes that are no letters |
//! | [`scenes`] | all of these as one seeded source |

pub mod augment;
mod canvas;
pub mod scenes;
pub mod shapes;
pub mod split;
pub mod stack;
mod stream;

pub use scenes::{Origin, Part, Scene, Scenes};
pub use split::Split;
pub use stack::{DataError, Kind, Stack};
pub use stream::{Purpose, stream};

/// Side of a scene, in pixels: the output grid (paper, 2.C).
pub const SIDE_PX: usize = 64;
/// Pixels of a scene.
pub const AREA_PX: usize = SIDE_PX * SIDE_PX;
/// Classes of Chars74K: 0-9, A-Z, a-z.
pub const CLASSES: usize = 62;
/// The character of each class.
pub const CHARACTERS: &str = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz";

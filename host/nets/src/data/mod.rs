//! Training data: labelled characters, split by who drew them, and scenes without letters.
//!
//! # Invariant
//! A scene depends only on its generator, and a generator on seed, purpose and number
//! (`stream::tests::seed_purpose_and_number_each_make_another_stream`). Scenes for training never
//! come from a held-out group
//! (`scenes::tests::training_draws_from_no_held_out_image_and_the_other_way_round`).
//!
//! | module | contents |
//! |---|---|
//! | [`stack`] | images of 64 x 64 with label and group (font family, writer, photograph) |
//! | [`families`] | groups that share an image, which no split takes apart |
//! | [`split`] | the groups that training never uses |
//! | [`augment`] | changed views of an image: moved, bent, on another ground |
//! | [`shapes`] | procedural scenes without letters |
//! | [`scenes`] | all of these as one seeded source |

pub mod augment;
mod canvas;
pub mod families;
pub mod scenes;
pub mod shapes;
pub mod split;
pub mod stack;
mod stream;

pub use families::Families;
pub use scenes::{Origin, Part, Scene, Scenes};
pub use split::Split;
pub use stack::{DataError, Kind, Stack};
pub use stream::{Purpose, stream};

/// Side of a scene in pixels, which is that of the output grid (paper, 2.C).
pub const SIDE_PX: usize = crate::grid::FINE;
/// Number of pixels of a scene.
pub const AREA_PX: usize = SIDE_PX * SIDE_PX;
/// Number of classes of Chars74K: 0-9, A-Z, a-z.
pub const CLASSES: usize = 62;
/// The character of each class.
pub const CHARACTERS: &str = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz";

//! Makes images of measurements as they were read: one image for a folder of results, or any
//! number of images by one prepared method.

mod many;
#[cfg(all(feature = "enhance", feature = "pictures"))]
mod one;
#[cfg(all(feature = "enhance", feature = "pictures"))]
mod own;
mod solver;
#[cfg(all(feature = "enhance", feature = "pictures"))]
mod stack;

pub use many::{FileImage, ManyImages, Skipped, file_images, many_images};
#[cfg(all(feature = "enhance", feature = "pictures"))]
pub use one::{DropoutReport, OneError, OneImage, OneReport, one_image, write_image};
#[cfg(all(feature = "enhance", feature = "pictures"))]
pub use own::{OwnError, OwnFrames, OwnImage, OwnInput, OwnMade, OwnReport, own_image};
pub use solver::{
    Recipe, Solved, Solver, SolverError, check_finite, not_read_words, own_atoms, read_atoms,
};
#[cfg(all(feature = "enhance", feature = "pictures"))]
pub use stack::{ImageReport, StackFolder, StackFolderError, StackReport, write_stack};

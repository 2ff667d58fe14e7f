//! The lesson: single-pixel imaging one step at a time, for the page `lesson.html`.
//!
//! This crate computes nothing that the libraries do not: patterns, transforms, methods and pursuits
//! are those of `nirspi-recon`, scenes those of `nirspi`, lens and weather those of `nirspi-optics`.
//! It keeps what the steps of one lesson share, and hands numbers to the page.
//!
//! | module | contents |
//! |---|---|
//! | [`lesson`] | a scene, an order, the readings, images from part of them |
//! | [`pursuit`] | orthogonal matching pursuit, one atom after another |
//! | [`sight`] | the scene through the lens and the weather |
//! | `exports` | the functions that the page calls, in a browser alone |

#[cfg(target_family = "wasm")]
mod exports;
pub mod lesson;
pub mod pursuit;
pub mod sight;

pub use lesson::Lesson;
pub use pursuit::Pursuit;

/// Why a step of the lesson cannot be taken, in one line.
pub type Problem = String;

/// An error in one line.
pub(crate) fn in_one_line(error: impl std::error::Error + 'static) -> Problem {
    nirspi::causes::in_one_line(&error)
}

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! Every report is a plain struct that serialises to JSON, and the library prints nothing. Long
//! functions call `done` after each unit of work, so that a caller can show progress.
//!
//! | module | question |
//! |---|---|
//! | [`table1`] | how long does each stage of one picture take (the paper's Table 1)? |
//! | [`range`] | how far does the camera see in rain (Table 2)? |
//! | [`table3`] | how good are images in rain (Table 3)? |
//! | [`table4`] | how fine is the spatial resolution in rain (Table 4)? |
//! | [`quality`] | how good are enhanced images, against blur, noise and number of steps? |
//! | [`trust`] | how far can a pixel of an enhanced image be from the truth, and which character does the image show? |
//! | [`sampling`] | how good are images of a part of the patterns, by order, basis and method? |
//! | [`completion`] | how well does each method complete known scenes? |
//! | [`video`] | what do the frames before add to a frame of a moving scene? |
//! | [`sets`] | how alike are two stacks of images, one by one and as sets? |
//! | [`mod@bench`] | how many frames a second does this machine reconstruct and enhance? |
//! | [`camera_model`] | what follows from a camera description? |
//! | [`rain`] | what does rain do to light, and to the photon budget of a pixel? |
//! | [`safety_case`] | what do eye and skin receive, and what does each fault leave lit? |
//!
//! [`shot`] takes the pictures of the tables through the virtual camera, of targets in several
//! [`typefaces`]. [`pictures`] enhances the pictures. [`bootstrap`] and [`estimate`] give the
//! uncertainty of a figure, [`legibility`] reads characters and [`resolution`] measures the finest detail.
//! [`training`] makes pairs for training networks, of [`characters`] and typefaces.

pub mod assumptions;
pub mod bench;
pub mod bootstrap;
pub mod camera_model;
pub mod characters;
pub mod completion;
pub mod estimate;
pub mod legibility;
pub mod pictures;
pub mod quality;
pub mod rain;
pub mod range;
pub mod resolution;
pub mod safety_case;
pub mod sampling;
pub mod sets;
pub mod shot;
pub mod table1;
pub mod table3;
pub mod table4;
pub mod training;
pub mod trust;
pub mod typefaces;
pub mod video;

mod error;
#[cfg(test)]
mod testing;

pub use error::{EvalError, Result};

/// The number of lines of a chart that can be told apart by colour and dashes.
#[cfg(test)]
fn looks(chart: &nirspi::picture::Chart) -> usize {
    let looks = chart.lines.iter().map(nirspi::picture::Line::look);
    looks.collect::<std::collections::BTreeSet<_>>().len()
}

/// The paper's distances, in m (section 5).
pub const DISTANCES_M: [f64; 3] = [0.3, 0.6, 1.0];

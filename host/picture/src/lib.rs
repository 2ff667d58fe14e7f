#![cfg_attr(not(test), deny(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! A [`Figure`] is what is shown. A [`FigureStyle`] is what it is made for: paper by default, with a
//! white ground and text of 8 points. A [`Drawing`] is the figure laid out, and is written as PNG,
//! SVG and PDF. Images are stretched between [`PERCENTILES`] unless they share one scale, and the
//! range is on the picture and in the report ([`Pictures`]). A flat image is drawn in its own grey.
//!
//! # Invariant
//! All text stays inside its panel, whatever its length
//! (`layout::tests::text_of_any_length_stays_inside_its_panel`), its chart
//! (`chart::tests::text_of_any_length_stays_inside_the_chart`) and its sheet
//! (`sheet::tests::text_of_any_length_stays_inside_the_sheet`). Fonts and libraries are part of the
//! program, not of the system.

mod bar;
mod chart;
mod drawing;
mod figure;
mod glyph;
mod layout;
mod look;
mod pdf;
mod raster;
mod report;
mod scale;
mod sheet;
mod signature;
mod svg;
mod terminal;
mod text;
mod ticks;
#[cfg(not(target_family = "wasm"))]
mod trace;
mod video;

pub use chart::{Axis, Chart, Line};
pub use drawing::Drawing;
pub use figure::Figure;
pub use glyph::Typeface;
pub use layout::{Panel, SideBySide};
pub use look::{FigureStyle, Look};
pub use report::Pictures;
pub use scale::{PERCENTILES, Range, Scale, Unit};
pub use sheet::{Sheet, chosen};
pub use terminal::{Tones, half_blocks};
#[cfg(not(target_family = "wasm"))]
pub use trace::of_trace;
pub use video::of_images as video;

#[cfg(test)]
mod checks;
#[cfg(test)]
mod testing;
#[cfg(test)]
mod tests;

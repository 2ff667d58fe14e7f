//! Pictures for users: images side by side with titles, figures, a grey bar and a note of the
//! source; contact sheets and videos of many images; charts.
//!
//! All of them have one look: light text on an opaque dark ground, which is readable on a white and
//! on a black page. Images are stretched between [`PERCENTILES`] unless they share one scale, and the
//! range is on the picture and in the report ([`Pictures`]). A flat image is drawn in its own grey.
//!
//! # Invariant
//! All text stays inside its panel, whatever its length
//! (`layout::tests::text_of_any_length_stays_inside_its_panel`), its chart
//! (`chart::tests::text_of_any_length_stays_inside_the_chart`) and its sheet
//! (`sheet::tests::text_of_any_length_stays_inside_the_sheet`). Fonts and libraries are part of the
//! program, not of the system.

pub(crate) mod glyph;

mod bar;
mod chart;
mod layout;
mod report;
mod scale;
mod scale_bar;
mod sheet;
mod signature;
mod terminal;
mod text;
mod ticks;
#[cfg(not(target_family = "wasm"))]
mod trace;
mod video;

pub use chart::{Axis, Chart, Line};
pub use glyph::Typeface;
pub use layout::{Panel, SideBySide, below, beside, blank, stacked};
pub use report::Pictures;
pub use scale::{PERCENTILES, Range, Scale, Unit};
pub use sheet::Sheet;
pub use signature::signed_png;
pub use terminal::{Tones, half_blocks};
#[cfg(not(target_family = "wasm"))]
pub use trace::of_trace;
pub use video::of_images as video;

pub use image::RgbImage;

use image::Rgb;

const GROUND: Rgb<u8> = Rgb([19, 21, 26]);
const GRID: Rgb<u8> = Rgb([44, 48, 57]);
const FRAME: Rgb<u8> = Rgb([52, 56, 66]);
const BRIGHT: Rgb<u8> = Rgb([236, 238, 242]);
const MIDDLE: Rgb<u8> = Rgb([176, 181, 191]);
const DIM: Rgb<u8> = Rgb([146, 152, 164]);
const AMBER: Rgb<u8> = Rgb([255, 184, 77]);

#[cfg(test)]
mod tests;

//! Pictures for people: images side by side with titles, figures and a note of where they come
//! from.
//!
//! The law: all text stays inside its panel, whatever its length, and nothing (font or library) is
//! asked of the system.

pub(crate) mod glyph;

mod chart;
mod layout;
mod sheet;
mod text;

pub use chart::{Axis, Chart, Line};
pub use glyph::Typeface;
pub use layout::{Panel, Range, SideBySide, stacked};
pub use sheet::contact_sheet;

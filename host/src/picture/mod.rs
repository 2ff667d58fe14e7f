//! Pictures for users: images side by side with titles, figures and a note of the source.
//!
//! # Invariant
//! All text stays inside its panel, whatever its length
//! (`layout::tests::text_of_any_length_stays_inside_its_panel`). Fonts and libraries are part of
//! the program, not of the system.

pub(crate) mod glyph;

mod chart;
mod layout;
mod sheet;
mod text;

pub use chart::{Axis, Chart, Line};
pub use glyph::Typeface;
pub use layout::{Panel, Range, SideBySide, stacked};
pub use sheet::contact_sheet;

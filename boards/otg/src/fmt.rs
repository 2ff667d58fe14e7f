//! What the driver uses of the release's module of this name: the macros of `defmt` where a board has that feature.

#[cfg(not(feature = "defmt"))]
pub(crate) use core::{assert, assert_eq, panic};
#[cfg(feature = "defmt")]
pub(crate) use defmt::{assert, assert_eq, error, panic, trace};
#[cfg(not(feature = "defmt"))]
pub(crate) use {nothing as error, nothing as trace};

#[cfg(not(feature = "defmt"))]
macro_rules! nothing {
    ($text:literal $(, $value:expr)* $(,)?) => {{
        let _ = ($(&$value,)*);
    }};
}
#[cfg(not(feature = "defmt"))]
pub(crate) use nothing;

/// Bytes in hexadecimal digits.
#[cfg_attr(not(feature = "defmt"), expect(dead_code, reason = "no message shows them"))]
pub(crate) struct Bytes<'a>(pub &'a [u8]);

#[cfg(feature = "defmt")]
impl defmt::Format for Bytes<'_> {
    fn format(&self, formatter: defmt::Formatter) {
        defmt::write!(formatter, "{:02x}", self.0)
    }
}

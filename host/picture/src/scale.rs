//! Which values of an image are black and white in its picture, and in which unit they are.
//!
//! # Invariant
//! A brighter pixel is never drawn darker, and every grey level is in `[0, 1]`
//! (`tests::levels_are_bounded_and_in_the_order_of_the_values`). Half a per cent of the pixels at
//! each end cannot take the contrast from the others (`tests::a_bright_speck_leaves_the_contrast`).
//! An image whose values hardly differ is drawn in its own grey, not stretched to black and white
//! (`tests::a_flat_image_is_drawn_in_its_own_grey`).

use super::ticks::number;
use serde::{Serialize, Serializer};
use std::fmt;

/// The percentiles that are black and white in a stretched picture.
pub const PERCENTILES: [f64; 2] = [0.5, 99.5];

/// A stretched image whose values differ by less than this share of white is shown on the whole
/// scale from black to white.
const FLAT: f32 = 0.1;

/// The unit of an image's values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Unit {
    /// 1 is a white target.
    OfWhite,
    /// The reflectance of the scene, 0 to 1.
    Reflectance,
    /// Counts of the camera's ADC.
    AdcCounts,
    /// The unit of the readings in a measurement file, which the file does not state.
    Readings,
}

impl Unit {
    /// The unit of an image from a camera's frames, or from a measurement file.
    #[must_use]
    pub fn of_readings(are_frames: bool) -> Self {
        if are_frames { Self::AdcCounts } else { Self::Readings }
    }

    /// The unit's name on a picture and in a report.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::OfWhite => "of white",
            Self::Reflectance => "reflectance",
            Self::AdcCounts => "ADC counts",
            Self::Readings => "units of the readings",
        }
    }

    /// Whether values are in `[0, 1]`, apart from noise.
    pub(super) fn is_fraction(self) -> bool {
        matches!(self, Self::OfWhite | Self::Reflectance)
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Serialize for Unit {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// How the values of an image become grey levels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Range {
    /// 0 is black and 1 is white, so that images of one picture can be compared.
    Unit,
    /// The [`PERCENTILES`] of the image's own values are black and white. An image in shares of
    /// white that is nearly flat has 0 as black and 1 as white.
    Stretched,
    /// These values are black and white.
    Fixed(f32, f32),
}

/// The values that are black and white in a picture, and those that the image has.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Scale {
    /// The unit of all four values.
    pub unit: Unit,
    /// This value and all below are black.
    pub black: f32,
    /// This value and all above are white.
    pub white: f32,
    /// The image's smallest value.
    pub least: f32,
    /// The image's largest value.
    pub most: f32,
}

impl Scale {
    /// The scale of these values. Values that are not finite have no part in it.
    #[must_use]
    pub fn of(range: Range, unit: Unit, values: impl IntoIterator<Item = f32>) -> Self {
        let mut finite: Vec<f32> = values.into_iter().filter(|value| value.is_finite()).collect();
        let ends = finite.iter().copied().map(|value| (value, value));
        let both = |a: (f32, f32), b: (f32, f32)| (a.0.min(b.0), a.1.max(b.1));
        let (least, most) = ends.reduce(both).unwrap_or_default();
        let (black, white) = match range {
            Range::Unit => (0.0, 1.0),
            Range::Fixed(black, white) => (black, white),
            Range::Stretched => {
                let last = finite.len().saturating_sub(1);
                let [low, high] = PERCENTILES.map(|percent| {
                    let at = (last as f64 * percent / 100.0).round() as usize;
                    match finite.is_empty() {
                        true => 0.0,
                        false => *finite.select_nth_unstable_by(at, f32::total_cmp).1,
                    }
                });
                // An image of a few specks alone is shown by its ends.
                let (low, high) = if high > low { (low, high) } else { (least, most) };
                let is_flat = unit.is_fraction() && high - low < FLAT && !finite.is_empty();
                if is_flat { (low.min(0.0), high.max(1.0)) } else { (low, high) }
            }
        };
        Self { unit, black, white, least, most }
    }

    /// The grey level of a value, 0 to 1. NaN is black. An image of one value in a unit without a
    /// white level is half grey, and black if the value is 0.
    #[must_use]
    pub fn level(&self, value: f32) -> f32 {
        let span = f64::from(self.white) - f64::from(self.black);
        let above = f64::from(value) - f64::from(self.black);
        if span == 0.0 && above == 0.0 && value != 0.0 {
            return 0.5;
        }
        if span > 0.0 && above > 0.0 { (above / span).min(1.0) as f32 } else { 0.0 }
    }

    /// Whether both scales have the same grey for each value.
    pub(super) fn is_drawn_as(&self, other: &Self) -> bool {
        let of_one_kind =
            self.unit == other.unit || (self.unit.is_fraction() && other.unit.is_fraction());
        of_one_kind && (self.black, self.white) == (other.black, other.white)
    }

    /// The values of the image in words, where they are not those from black to white.
    pub(super) fn found(&self) -> String {
        let Self { black, white, least, most, .. } = *self;
        match (black, white) == (least, most) {
            true => String::new(),
            false => format!("{} to {} found", number(least), number(most)),
        }
    }

    /// The range in words: the unit, what is shown, and what the image has beyond it.
    pub(super) fn line(&self) -> String {
        let Self { unit, black, white, least, most } = *self;
        let shown = format!("{unit}: {} to {}", number(black), number(white));
        if (black, white) == (least, most) {
            return shown;
        }
        format!("{shown} shown, {} to {} found", number(least), number(most))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn stretched(values: &[f32]) -> Scale {
        Scale::of(Range::Stretched, Unit::AdcCounts, values.iter().copied())
    }

    proptest! {
        #[test]
        fn levels_are_bounded_and_in_the_order_of_the_values(
            values in prop::collection::vec(
                prop_oneof![8 => -1e6f32..1e6, 1 => any::<f32>(), 1 => Just(0.0f32)], 1..300),
        ) {
            let scale = stretched(&values);
            prop_assert!(scale.black <= scale.white, "{:?}", scale);
            prop_assert!(scale.least <= scale.black && scale.white <= scale.most, "{:?}", scale);
            let mut sorted: Vec<f32> = values.into_iter().filter(|v| !v.is_nan()).collect();
            sorted.sort_unstable_by(f32::total_cmp);
            let levels: Vec<f32> = sorted.iter().map(|&value| scale.level(value)).collect();
            prop_assert!(levels.iter().all(|level| (0.0..=1.0).contains(level)), "{:?}", levels);
            prop_assert!(levels.is_sorted(), "{:?}", levels);
        }
    }

    #[test]
    fn a_bright_speck_leaves_the_contrast() {
        let mut values: Vec<f32> = (0..1024).map(|p| (p % 32) as f32).collect();
        values[0] = 1e6;
        let scale = stretched(&values);
        assert_eq!((scale.black, scale.white), (0.0, 31.0));
        assert_eq!((scale.level(31.0), scale.level(1e6)), (1.0, 1.0));
        assert_eq!(scale.line(), "ADC counts: 0 to 31 shown, 0 to 1e6 found");
    }

    #[test]
    fn a_flat_image_is_drawn_in_its_own_grey() {
        for unit in [Unit::OfWhite, Unit::Reflectance] {
            for (value, noise) in [(0.0, 0.0), (0.4, 0.0), (0.9, 0.0), (0.9, 0.04), (1.2, 0.0)] {
                let values = (0..1024).map(|p| value + if p % 2 == 0 { noise } else { -noise });
                let scale = Scale::of(Range::Stretched, unit, values);
                let expected = (value / value.max(1.0)).min(1.0);
                assert!((scale.level(value) - expected).abs() < 0.04, "{value}: {scale:?}");
            }
        }
    }

    #[test]
    fn an_image_of_one_value_without_a_white_is_grey_and_a_few_specks_show() {
        let flat = stretched(&[3.0; 1024]);
        assert_eq!((flat.level(3.0), flat.line()), (0.5, "ADC counts: 3 to 3".to_owned()));
        assert_eq!(stretched(&[0.0; 1024]).level(0.0), 0.0);
        let mut specks = vec![0.0; 1024];
        specks[17] = 5.0;
        assert_eq!(stretched(&specks).level(5.0), 1.0);
        let nothing = stretched(&[f32::NAN, f32::INFINITY]);
        assert_eq!((nothing.level(f32::NAN), nothing.level(f32::INFINITY)), (0.0, 0.0));
    }
}

//! Temperature from the converter's reading of a thermistor.
//!
//! The thermistor lies between the converter's input and ground, and a resistor between the input
//! and the converter's own reference, so the reading is a ratio and does not depend on the supply.
//! The resistance follows `R = R25 exp(B (1/T - 1/298.15 K))` from the thermistor's data sheet.
//!
//! # Invariant
//! A reading outside the range from -40 to 125 degrees Celsius, as a broken or shorted line gives,
//! is not a temperature (`tests::a_broken_or_shorted_line_is_no_temperature`).

use crate::float;

/// The thermistor at a board's LED array, and the resistor in series.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Thermistor {
    /// Resistance at 25 degrees Celsius, R25.
    pub ohm_at_25: u32,
    /// The data sheet's B(25/85) in kelvin.
    pub b_kelvin: u16,
    /// Resistor from the converter's reference to the input.
    pub series_ohm: u32,
}

/// Readings outside are no temperature.
const CENTI_CELSIUS: core::ops::RangeInclusive<f32> = -4_000.0..=12_500.0;

impl Thermistor {
    /// An NTC of 10 kilohm with B = 3434 K (for example Murata NCP15XH103), and 10 kilohm in
    /// series.
    pub const REFERENCE: Self = Self { ohm_at_25: 10_000, b_kelvin: 3_434, series_ohm: 10_000 };

    /// Temperature in hundredths of a degree Celsius, right to 3 of them. `ratio` is the
    /// converter's reading, of which 65536 is full scale: the caller shifts a reading of `n` bits
    /// left by `16 - n`.
    ///
    /// Never inlined, so that a check of the machine code finds the floating point in this function
    /// alone.
    #[must_use]
    #[inline(never)]
    pub fn centi_celsius(&self, ratio: u16) -> Option<i16> {
        if ratio == 0 {
            return None;
        }
        let share = f32::from(ratio) / 65_536.0;
        let ohm = self.series_ohm as f32 * share / (1.0 - share);
        let inverse_kelvin =
            1.0 / 298.15 + float::ln(ohm / self.ohm_at_25 as f32) / f32::from(self.b_kelvin);
        let centi_celsius = 100.0 / inverse_kelvin - 27_315.0;
        CENTI_CELSIUS.contains(&centi_celsius).then_some(centi_celsius as i16)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const NTC: Thermistor = Thermistor::REFERENCE;

    /// The converter's reading at this temperature, by the data sheet's formula.
    fn reading(ntc: &Thermistor, celsius: f64) -> u16 {
        let inverse = 1.0 / (celsius + 273.15) - 1.0 / 298.15;
        let ohm = f64::from(ntc.ohm_at_25) * (f64::from(ntc.b_kelvin) * inverse).exp();
        (65_536.0 * ohm / (ohm + f64::from(ntc.series_ohm))).round() as u16
    }

    /// What the formula makes of a reading.
    fn celsius(ntc: &Thermistor, reading: u16) -> f64 {
        let share = f64::from(reading) / 65_536.0;
        let ohm = f64::from(ntc.series_ohm) * share / (1.0 - share);
        let inverse = (ohm / f64::from(ntc.ohm_at_25)).ln() / f64::from(ntc.b_kelvin);
        1.0 / (1.0 / 298.15 + inverse) - 273.15
    }

    #[test]
    fn every_reading_within_the_range_is_right_to_three_hundredths_of_a_degree() {
        for ratio in reading(&NTC, 124.9)..=reading(&NTC, -39.9) {
            let found = f64::from(NTC.centi_celsius(ratio).unwrap()) / 100.0;
            assert!((found - celsius(&NTC, ratio)).abs() < 0.03, "{ratio}: {found}");
        }
    }

    proptest! {
        #[test]
        fn another_thermistor_reads_as_right(
            ohm_at_25 in 1_000_u32..100_000, b_kelvin in 2_500_u16..4_500, degrees in -20.0..100.0,
        ) {
            let ntc = Thermistor { ohm_at_25, b_kelvin, series_ohm: ohm_at_25 };
            let ratio = reading(&ntc, degrees);
            let found = f64::from(ntc.centi_celsius(ratio).unwrap()) / 100.0;
            prop_assert!((found - celsius(&ntc, ratio)).abs() < 0.03, "{ratio}: {found}");
        }
    }

    #[test]
    fn twenty_five_degrees_is_half_of_the_reference() {
        assert_eq!(NTC.centi_celsius(32_768), Some(2_500));
    }

    #[test]
    fn a_broken_or_shorted_line_is_no_temperature() {
        let (hottest, coldest) = (reading(&NTC, 125.0), reading(&NTC, -40.0));
        for ratio in [0, 1, 1_000, hottest - 20, coldest + 20, 65_000, u16::MAX] {
            assert_eq!(NTC.centi_celsius(ratio), None, "{ratio}");
        }
    }

    #[test]
    fn warmer_never_reads_colder_by_more_than_the_error() {
        let ratios = (reading(&NTC, 124.9)..=reading(&NTC, -39.9)).rev();
        let temperatures: std::vec::Vec<_> =
            ratios.map(|ratio| NTC.centi_celsius(ratio).unwrap()).collect();
        assert!(temperatures.windows(2).all(|pair| pair[1] >= pair[0] - 3));
    }
}

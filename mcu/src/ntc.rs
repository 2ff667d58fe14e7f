//! Temperature from the converter's reading of a thermistor, in integers.
//!
//! The thermistor is a 10 kilohm NTC with B(25/85) = 3434 K (for example Murata NCP15XH103),
//! between the converter's input and ground. [`SERIES_OHM`] lie between the input and the
//! converter's own reference, so the reading is a ratio and does not depend on the supply. The
//! table is the data sheet's formula `R = 10 kilohm exp(B (1/T - 1/298.15 K))`
//! (`tests::the_table_is_the_formula`).
//!
//! # Invariant
//! A reading outside the range from -40 to 125 degrees Celsius, as a broken or shorted line gives,
//! is not a temperature (`tests::a_broken_or_shorted_line_is_no_temperature`).

/// Resistor from the converter's reference to the input.
pub const SERIES_OHM: u32 = 10_000;

const FIRST_CENTI_CELSIUS: i32 = -4_000;
const STEP_CENTI_CELSIUS: i32 = 500;

/// `65536 R / (R + SERIES_OHM)` at -40, -35, ... 125 degrees Celsius; falling.
const RATIOS: [u16; 34] = [
    62996, 62124, 61027, 59676, 58044, 56117, 53889, 51374, 48600, 45611, 42466, 39231, 35976,
    32768, 29665, 26714, 23951, 21398, 19064, 16951, 15053, 13359, 11854, 10522, 9346, 8310, 7398,
    6596, 5891, 5270, 4724, 4242, 3817, 3441,
];

/// Temperature in hundredths of a degree Celsius; 65536 is the converter's full scale. The caller
/// shifts a reading of `n` bits left by `16 - n`. Interpolation agrees with the formula to 0.2
/// degrees.
#[must_use]
pub fn centi_celsius(ratio: u16) -> Option<i16> {
    let colder = RATIOS.iter();
    let warmer = RATIOS.iter().skip(1);
    let steps = (FIRST_CENTI_CELSIUS..).step_by(STEP_CENTI_CELSIUS.unsigned_abs() as usize);
    let found = colder
        .zip(warmer)
        .zip(steps)
        .find(|((colder, warmer), _)| (**warmer..=**colder).contains(&ratio));
    let ((&colder, &warmer), base) = found?;
    let fallen = i32::from(colder.saturating_sub(ratio));
    let step = i32::from(colder.saturating_sub(warmer));
    let part = fallen.saturating_mul(STEP_CENTI_CELSIUS).checked_div(step)?;
    i16::try_from(base.saturating_add(part)).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    const B_KELVIN: f64 = 3434.0;
    const OHM_AT_25: f64 = 10_000.0;

    fn kelvin(centi_celsius: f64) -> f64 {
        centi_celsius / 100.0 + 273.15
    }

    /// The data sheet's formula.
    fn ohm(centi_celsius: f64) -> f64 {
        OHM_AT_25 * (B_KELVIN * (1.0 / kelvin(centi_celsius) - 1.0 / 298.15)).exp()
    }

    fn ratio(ohm: f64) -> f64 {
        65_536.0 * ohm / (ohm + f64::from(SERIES_OHM))
    }

    #[test]
    fn the_table_is_the_formula() {
        for (index, &entry) in RATIOS.iter().enumerate() {
            let at = f64::from(FIRST_CENTI_CELSIUS) + index as f64 * f64::from(STEP_CENTI_CELSIUS);
            assert_eq!(f64::from(entry), ratio(ohm(at)).round(), "{at}");
        }
    }

    #[test]
    fn every_reading_within_the_range_is_right_to_a_fifth_of_a_degree() {
        for reading in RATIOS[33]..=RATIOS[0] {
            let share = f64::from(reading) / 65_536.0;
            let ohm = f64::from(SERIES_OHM) * share / (1.0 - share);
            let inverse = 1.0 / 298.15 + (ohm / OHM_AT_25).ln() / B_KELVIN;
            let found = f64::from(centi_celsius(reading).unwrap());
            assert!((found - (100.0 / inverse - 27_315.0)).abs() < 20.0, "{reading}: {found}");
        }
    }

    #[test]
    fn twenty_five_degrees_is_half_of_the_reference() {
        assert_eq!(centi_celsius(32_768), Some(2_500));
    }

    #[test]
    fn a_broken_or_shorted_line_is_no_temperature() {
        for reading in [0, 1_000, RATIOS[33] - 1, RATIOS[0] + 1, 65_000, u16::MAX] {
            assert_eq!(centi_celsius(reading), None, "{reading}");
        }
    }

    #[test]
    fn warmer_never_reads_colder() {
        let readings = (RATIOS[33]..=RATIOS[0]).rev();
        let temperatures: std::vec::Vec<_> = readings.map(centi_celsius).collect();
        assert!(temperatures.is_sorted());
    }
}

//! Rules for the board's own sensors: interlock and temperature.
//!
//! # Invariant
//! A sensor that does not answer, or whose reading is not plausible, forbids light
//! (`tests::safety::a_sensor_that_does_not_answer`,
//! `tests::safety::a_sensor_that_reads_what_cannot_be`).

use crate::{Inputs, Limits};
use nirspi_wire::Fault;

/// Whether a working sensor can give this reading.
pub(crate) fn plausible(centi_celsius: i16, limits: &Limits) -> bool {
    (limits.plausible_min_centi_celsius..=limits.plausible_max_centi_celsius)
        .contains(&centi_celsius)
}

/// The fault for which the sensors forbid light. `standing` is the latched fault: an
/// over-temperature lasts until the array has cooled down to the release point, so the LEDs do not
/// go on and off at the limit.
pub(crate) fn objection(
    inputs: &Inputs,
    limits: &Limits,
    standing: Option<Fault>,
) -> Option<Fault> {
    if !inputs.interlock_closed {
        return Some(Fault::Interlock);
    }
    let reading = inputs.temperature_centi_celsius.filter(|&reading| plausible(reading, limits));
    let Some(centi_celsius) = reading else {
        return Some(Fault::TemperatureSensor);
    };
    let hot = if matches!(standing, Some(Fault::OverTemperature { .. })) {
        centi_celsius > limits.release_centi_celsius
    } else {
        centi_celsius >= limits.trip_centi_celsius
    };
    hot.then_some(Fault::OverTemperature { centi_celsius })
}

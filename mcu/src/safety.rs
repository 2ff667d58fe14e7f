//! Rules on the board's own sensors: interlock and temperature.
//!
//! The one law: a sensor that cannot be believed is as bad as one that says no.

use crate::{Inputs, Limits};
use nirspi_wire::Fault;

/// Whether the reading can be one of a sensor that is well.
pub(crate) fn plausible(centi_celsius: i16, limits: &Limits) -> bool {
    (limits.plausible_min_centi_celsius..=limits.plausible_max_centi_celsius)
        .contains(&centi_celsius)
}

/// What the sensors say against light. `standing` is the fault that stands: an over-temperature lasts
/// until the array has cooled down to the release point, so that LEDs do not go on and off at the limit.
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

//! The answers of a replayed camera to its host.

use nirspi_camera::session::Recorded;
use nirspi_camera::setup::MeasurementSetup;
use nirspi_files::identity::CameraIdentity;
use nirspi_wire::{
    Capabilities, ConfigField, ConfigProblem, Configuration, Identity, SIDE, State, Status, Version,
};

/// The identity of the recorded camera in the wire's form.
pub(super) fn identity(camera: &CameraIdentity) -> Identity<'_> {
    let has = |name: &str| camera.capabilities.iter().any(|word| word == name);
    let known = Capabilities::NAMES.iter().filter(|(_, name)| has(name)).map(|&(known, _)| known);
    let capabilities = known.fold(Capabilities::default(), Capabilities::with);
    Identity {
        protocol: camera.protocol,
        firmware: version(&camera.firmware),
        gateware: version(&camera.gateware),
        board: &camera.board,
        serial: &camera.serial,
        side: SIDE,
        adc_hz: camera.adc_hz,
        adc_bits: camera.adc_bits,
        wavelength_nm: camera.wavelength_nm,
        capabilities,
    }
}

/// A version as the recording words it; 0 for a part that is no number.
fn version(text: &str) -> Version {
    let mut parts = text.split('.').map(|part| part.parse().unwrap_or(0));
    let mut next = || parts.next().unwrap_or(0);
    Version(next(), next(), next())
}

/// The status of a camera that has not measured yet. `run` is the number of the run before.
pub(super) fn status(run: u16) -> Status {
    Status {
        state: State::Idle,
        fault: None,
        uptime_us: 0,
        run,
        frames_made: 0,
        frames_sent: 0,
        frames_dropped: 0,
        fpga_frames_lost: 0,
        fpga_frames_corrupt: 0,
        commands_damaged: 0,
        temperature_centi_celsius: i16::MIN,
        duty_permille: 0,
        leds_on: false,
        interlock_closed: true,
        signal: None,
    }
}

/// How a configuration differs from the recorded one. `None` means that they are the same.
pub(super) fn misfit(asked: &Configuration<'_>, recorded: &Recorded) -> Option<ConfigProblem> {
    let MeasurementSetup { rows, clocks_per_pattern, blanked, adc_latency, sweeps, .. } =
        &recorded.setup;
    let numbers = [
        (ConfigField::Patterns, asked.patterns.into(), rows.len() as u32),
        (
            ConfigField::ClocksPerPattern,
            asked.clocks_per_pattern.into(),
            (*clocks_per_pattern).into(),
        ),
        (ConfigField::Blanked, asked.blanked.into(), (*blanked).into()),
        (ConfigField::AdcLatency, asked.adc_latency.into(), (*adc_latency).into()),
        (ConfigField::Sweeps, asked.sweeps, *sweeps),
    ];
    let other = numbers.into_iter().find(|(_, found, recorded)| found != recorded);
    if let Some((field, found, recorded)) = other {
        return Some(ConfigProblem::OutOfRange { field, found, min: recorded, max: recorded });
    }
    let same = recorded.setup.with_configuration(|mine| mine == *asked);
    (!same).then_some(ConfigProblem::OrderEntry { index: 0, found: 0 })
}

//! The camera description: every optical, electronic and geometric constant of a camera in one
//! type, read from TOML.
//!
//! # Invariant
//! Every constant of a camera is in `host/optics/cameras/*.toml` and not in the code. Photon
//! budget, range, virtual camera and training take their settings from a [`CameraModel`]:
//! [`CameraModel::projector`], [`CameraModel::budget_settings`], [`CameraModel::chain_settings`]
//! and [`CameraModel::instrument`]. The test `the_budget_is_that_of_the_camera_simulated`
//! (`host/virtual/tests/budget.rs`) compares the budget with the virtual camera.

mod file;
mod views;

pub use file::CameraModelError;
pub use views::Instrument;

use crate::Projector;
use crate::lamp::LightSource;
use crate::rain::Air;
use serde::{Deserialize, Serialize};
use std::sync::LazyLock;

/// The shipped cameras: name and description.
const SHIPPED: [(&str, &str); 3] = [
    ("paper", include_str!("../../cameras/paper.toml")),
    ("fga015", include_str!("../../cameras/fga015.toml")),
    ("one-metre", include_str!("../../cameras/one-metre.toml")),
];

/// A camera: LEDs, optics, receiver, light and weather.
///
/// The default is the paper's camera (`paper.toml`), with which the networks were trained and the
/// published tables were made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraModel {
    /// The name in reports.
    pub name: String,
    /// Wavelength of the LEDs.
    pub wavelength_nm: f64,
    /// The LED array.
    pub leds: Leds,
    /// The lens before the array.
    pub projector: Projector,
    /// The optics before the detector.
    pub collector: Collector,
    /// The photodiode.
    pub detector: Detector,
    /// The amplifier.
    pub amplifier: Amplifier,
    /// The ADC.
    pub adc: Adc,
    /// How long patterns are shown, and which samples are used.
    pub readout: Readout,
    /// The light on the target besides the LEDs.
    pub light: Light,
    /// The weather between camera and target.
    pub weather: WeatherSection,
    /// The time-of-flight sensor.
    pub tof: TofSensor,
}

/// The LEDs of the array, 32 x 32.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Leds {
    /// Optical power of one lit LED.
    pub power_mw: f64,
    /// Width of the spectrum at half height; the spectrum is taken as Gaussian.
    pub spectrum_fwhm_nm: f64,
    /// Angle off the LED's axis at which its radiant intensity has halved.
    pub half_angle_deg: f64,
    /// Rise time of the light from 10 to 90 %. A file may say `edge_ns` for rise and fall together.
    pub rise_ns: f64,
    /// Fall time of the light from 90 to 10 %.
    pub fall_ns: f64,
    /// Time from a line's change until the light begins to rise: at most one ADC clock.
    pub turn_on_delay_ns: f64,
    /// Time from a line's change until the light begins to fall: at most one ADC clock.
    pub turn_off_delay_ns: f64,
    /// Share of its light that a tile of 8 x 8 LEDs loses by the sag of its supply if all 64 are lit.
    pub tile_sag: f64,
    /// Capacitance from each row and column line to the amplifier's input. A changing line injects
    /// capacitance times swing.
    pub line_crosstalk_ff: f64,
    /// Voltage by which a line changes.
    pub line_swing_v: f64,
    /// Standard deviation of the power between LEDs, as a share of the mean.
    pub power_spread: f64,
    /// Standard deviation of the pointing along each axis.
    pub pointing_spread_deg: f64,
    /// Seed of the array's spread.
    pub spread_seed: u32,
    /// Dead LEDs: row and column, 0 to 31.
    pub dead: Vec<[u32; 2]>,
}

/// The optics before the detector.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Collector {
    /// Diameter of the lens.
    pub aperture_mm: f64,
    /// Distance between projector and collector.
    pub baseline_mm: f64,
    /// Share of the light that all glass from LED to detector transmits.
    pub glass_transmission: f64,
    /// Light that a cover glass before projector and collector throws back into the collector, as a share of that of a
    /// white target in the lens's focus.
    pub cover_veil: f64,
    /// Width of the band-pass filter around the wavelength.
    pub filter_width_nm: f64,
}

/// The photodiode.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Detector {
    /// Diameter of the active area.
    pub diameter_mm: f64,
    /// Numerical aperture of the light on the detector.
    pub numerical_aperture: f64,
    /// Photocurrent divided by light at the wavelength of the LEDs.
    pub responsivity_a_per_w: f64,
    /// Capacitance at its working voltage.
    pub capacitance_pf: f64,
    /// Dark current at its working voltage.
    pub dark_current_na: f64,
}

/// The transimpedance amplifier: one pole.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Amplifier {
    /// Bandwidth at -3 dB.
    pub bandwidth_mhz: f64,
    /// Feedback resistor.
    pub feedback_kohm: f64,
    /// Voltage noise of the operational amplifier.
    pub voltage_noise_nv_per_sqrt_hz: f64,
    /// Capacitance at its input without the photodiode's.
    pub input_capacitance_pf: f64,
}

/// The ADC, of 14 bit at 125 MS/s.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Adc {
    /// Signal-to-noise ratio of a full-scale sine.
    pub snr_db: f64,
    /// Reading in the dark.
    pub offset_counts: u32,
    /// Clocks from the end of a sample to its code.
    pub latency_clocks: u32,
}

/// How patterns are shown and samples are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Readout {
    /// ADC clocks of 8 ns for which each pattern is shown.
    pub clocks_per_pattern: u16,
    /// Samples excluded at the start of each pattern.
    pub blanked: u16,
    /// Differential sweeps summed into one picture.
    pub sweeps_per_picture: u32,
}

/// Light on the target besides the LEDs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Light {
    /// The source of the light.
    pub source: LightSource,
    /// The illuminance.
    pub illuminance_klx: f64,
}

/// The weather between camera and target.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WeatherSection {
    /// Dry air, rain, fog, smoke, dust, drops on the window.
    pub air: Air,
}

/// The time-of-flight sensor of 8 x 8 zones.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TofSensor {
    /// Wavelength of its light.
    pub wavelength_nm: f64,
    /// Angle that the 8 zones of a row cover.
    pub fov_deg: f64,
    /// Position of the sensor to the right of the projector's axis, seen from the camera.
    pub offset_x_mm: f64,
    /// Position of the sensor below the projector's axis.
    pub offset_y_mm: f64,
    /// Noise of a zone, rms.
    pub noise_mm: f64,
}

static PAPER: LazyLock<CameraModel> = LazyLock::new(|| {
    CameraModel::named("paper").expect("the shipped cameras are read by a test of this module")
});

impl Default for CameraModel {
    fn default() -> Self {
        Self::paper().clone()
    }
}

impl CameraModel {
    /// The paper's camera.
    #[must_use]
    pub fn paper() -> &'static Self {
        &PAPER
    }

    /// The names of the shipped cameras.
    pub fn names() -> impl Iterator<Item = &'static str> {
        SHIPPED.iter().map(|(name, _)| *name)
    }

    /// The shipped camera of this name; `None` for an unknown name.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        // A test reads each shipped description.
        file::read(Self::shipped_text(name)?).ok()
    }

    /// The TOML text of the shipped camera of this name.
    #[must_use]
    pub fn shipped_text(name: &str) -> Option<&'static str> {
        SHIPPED.iter().find(|(shipped, _)| *shipped == name).map(|(_, text)| *text)
    }

    /// Reads a description. Values that the description does not have are those of the shipped
    /// camera that it names as `basis`; without `basis`, of the paper's camera.
    ///
    /// # Errors
    /// [`CameraModelError`], one line with the key, what was found and what was expected.
    pub fn parse(toml: &str) -> Result<Self, CameraModelError> {
        file::read(toml)
    }

    /// The whole description as TOML, without comments.
    #[must_use]
    pub fn to_toml(&self) -> String {
        file::write(self)
    }

    /// A short name of the whole description, from its [text](Self::key_text): FNV-1a, 32 bit,
    /// not a checksum (Fowler, Noll and Vo).
    #[must_use]
    pub fn digest(&self) -> u32 {
        fnv1a(self.key_text().as_bytes())
    }

    /// The [canonical] text of the whole description. Keys that came after the first networks were
    /// trained are in it only where they are used: a description keeps its name.
    #[must_use]
    pub fn key_text(&self) -> String {
        let mut table = file::table_of(self);
        file::fold_new_keys(&mut table);
        canonical(&table)
    }

    /// Checks all ranges, for a description that was changed after reading.
    ///
    /// # Errors
    /// [`CameraModelError::Value`] naming the key.
    pub fn validate(&self) -> Result<(), CameraModelError> {
        file::check(self)
    }
}

/// Data as text from which keys are made: a line `section.key = value` in TOML for each value, sorted
/// by key. The text depends on the names and values of the data alone, not on the order of its fields
/// (`tests::a_key_depends_on_names_and_values_alone`).
///
/// # Panics
/// If the data are not a table of values, which no type of this crate is.
#[must_use]
pub fn canonical(data: &impl Serialize) -> String {
    let table = toml::Table::try_from(data).expect("the data are a table of values");
    let mut lines = Vec::new();
    add_lines(&mut lines, "", table);
    lines.sort();
    lines.concat()
}

fn add_lines(lines: &mut Vec<String>, section: &str, table: toml::Table) {
    for (key, value) in table {
        match value {
            toml::Value::Table(inner) => add_lines(lines, &format!("{section}{key}."), inner),
            value => lines.push(format!("{section}{key} = {value}\n")),
        }
    }
}

/// FNV-1a, 32 bit.
#[must_use]
pub fn fnv1a(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0x811c_9dc5, |hash, &byte| (hash ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}

#[cfg(test)]
mod tests;

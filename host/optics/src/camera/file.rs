//! Reads a camera description from a TOML file, on top of a shipped description, and checks the
//! range of every number.
//!
//! The paper's description has every key and thereby defines all keys and their kinds.

use super::{CameraModel, SHIPPED};
use crate::SIDE;
use crate::edges::time_constant_ns;
use crate::instrument::{FULL_SCALE_COUNTS, MAX_ADC_LATENCY_CLOCKS, SAMPLE_NS};
use crate::lamp::LightSource;
use crate::rain::{Air, AirError};
use std::str::FromStr;
use thiserror::Error;
use toml::{Table, Value};

/// The key that names the shipped camera on which a file is based.
const BASIS: &str = "basis";

/// A key for rise and fall of the LEDs together, if they are alike.
const EDGE: &str = "edge_ns";

/// Keys that came after the first networks were trained, with their sections. They do nothing where they are 0.
const NEW_KEYS: [(&str, &str); 5] = [
    ("leds", "turn_on_delay_ns"),
    ("leds", "turn_off_delay_ns"),
    ("leds", "tile_sag"),
    ("leds", "line_crosstalk_ff"),
    ("collector", "cover_veil"),
];

/// Time constants of the slower edge that a pattern must last if rise and fall differ
/// ([`crate::edges`], accuracy).
const SETTLED_CONSTANTS: f64 = 4.0;

/// The range of each number: key, minimum, maximum. Units are in the keys.
pub(super) const RANGES: &[(&str, f64, f64)] = &[
    ("wavelength_nm", 400.0, 1700.0),
    ("leds.power_mw", 0.001, 1000.0),
    ("leds.spectrum_fwhm_nm", 0.1, 1000.0),
    ("leds.half_angle_deg", 0.1, 60.0),
    ("leds.rise_ns", 0.0, 10_000.0),
    ("leds.fall_ns", 0.0, 10_000.0),
    ("leds.turn_on_delay_ns", 0.0, SAMPLE_NS),
    ("leds.turn_off_delay_ns", 0.0, SAMPLE_NS),
    ("leds.tile_sag", 0.0, 0.5),
    ("leds.line_crosstalk_ff", 0.0, 100_000.0),
    ("leds.line_swing_v", 0.1, 100.0),
    ("leds.power_spread", 0.0, 0.5),
    ("leds.pointing_spread_deg", 0.0, 45.0),
    ("leds.spread_seed", 0.0, 4_294_967_295.0),
    ("projector.led_pitch_mm", 0.001, 1000.0),
    ("projector.emitter_mm", 0.001, 1000.0),
    ("projector.focal_length_mm", 1.0, 100_000.0),
    ("projector.focus_distance_mm", 1.0, 1_000_000.0),
    ("projector.aperture_mm", 0.01, 10_000.0),
    ("projector.corner_vignetting", 0.0, 0.95),
    ("collector.aperture_mm", 0.01, 10_000.0),
    ("collector.baseline_mm", 0.001, 10_000.0),
    ("collector.glass_transmission", 0.001, 1.0),
    ("collector.cover_veil", 0.0, 100.0),
    ("collector.filter_width_nm", 0.1, 1300.0),
    ("detector.diameter_mm", 0.001, 100.0),
    ("detector.numerical_aperture", 0.001, 1.0),
    ("detector.responsivity_a_per_w", 0.001, 1.3),
    ("detector.capacitance_pf", 0.0, 100_000.0),
    ("detector.dark_current_na", 0.0, 1_000_000.0),
    ("amplifier.bandwidth_mhz", 0.01, 10_000.0),
    ("amplifier.feedback_kohm", 0.01, 1_000_000.0),
    ("amplifier.voltage_noise_nv_per_sqrt_hz", 0.0, 1000.0),
    ("amplifier.input_capacitance_pf", 0.0, 10_000.0),
    ("adc.snr_db", 20.0, 200.0),
    ("adc.offset_counts", 0.0, FULL_SCALE_COUNTS as f64),
    ("adc.latency_clocks", 0.0, MAX_ADC_LATENCY_CLOCKS as f64),
    ("readout.clocks_per_pattern", 1.0, 65_535.0),
    ("readout.blanked", 0.0, 65_534.0),
    ("readout.sweeps_per_picture", 1.0, 100_000.0),
    ("light.illuminance_klx", 0.0, 200.0),
    ("tof.wavelength_nm", 400.0, 1700.0),
    ("tof.fov_deg", 1.0, 170.0),
    ("tof.offset_x_mm", -1000.0, 1000.0),
    ("tof.offset_y_mm", -1000.0, 1000.0),
    ("tof.noise_mm", 0.0, 1000.0),
];

/// Why a text is not a camera description. `Display` is one line.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum CameraModelError {
    /// The text is not TOML.
    #[error("line {line}: {reason}, expected TOML such as `power_mw = 4.0`")]
    Syntax {
        /// Line, from 1.
        line: usize,
        /// The parser's message.
        reason: String,
    },
    /// The key does not exist.
    #[error("found {key}, expected one of {expected}")]
    Key {
        /// The key, with its section.
        key: String,
        /// The keys of that section.
        expected: String,
    },
    /// The value has the wrong kind or is out of range.
    #[error("{key} is {found}, expected {expected}")]
    Value {
        /// The key, with its section.
        key: String,
        /// The value.
        found: String,
        /// The allowed values.
        expected: String,
    },
}

fn value(key: &str, found: &Value, expected: impl Into<String>) -> CameraModelError {
    // A table or list over several lines becomes one line.
    let found = found.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
    CameraModelError::Value { key: key.to_owned(), found, expected: expected.into() }
}

/// A description on top of its basis.
pub fn read(text: &str) -> Result<CameraModel, CameraModelError> {
    let mut given = parse(text)?;
    let names: Vec<&str> = CameraModel::names().collect();
    let basis = match given.remove(BASIS) {
        None => None,
        Some(Value::String(name)) if names.contains(&name.as_str()) => Some(name),
        Some(other) => return Err(value(BASIS, &other, names.join(", "))),
    };
    let mut table = match basis.as_deref().and_then(CameraModel::shipped_text) {
        Some(text) if basis.as_deref() != Some(SHIPPED[0].0) => table_of(&read(text)?),
        _ => parse(SHIPPED[0].1)?,
    };
    if let Some(Value::Table(leds)) = given.get_mut("leds") {
        both_edges(leds)?;
    }
    put(&mut table, given, "")?;
    check_table(&table)?;
    let model: CameraModel = Value::Table(table).try_into().map_err(|error: toml::de::Error| {
        let found = error.message().split_whitespace().collect::<Vec<_>>().join(" ");
        CameraModelError::Value {
            key: "the description".to_owned(),
            found,
            expected: "the paper's keys".to_owned(),
        }
    })?;
    check_together(&model)?;
    Ok(model)
}

/// The description as TOML.
pub fn write(model: &CameraModel) -> String {
    table_of(model).to_string()
}

/// Checks every range of a description that a program made.
pub fn check(model: &CameraModel) -> Result<(), CameraModelError> {
    check_table(&table_of(model))?;
    check_together(model)
}

pub(super) fn table_of(model: &CameraModel) -> Table {
    // The type holds only numbers, words and lists of numbers, so the conversion does not fail.
    Table::try_from(model).unwrap_or_default()
}

/// Replaces [`EDGE`] by rise and fall.
fn both_edges(leds: &mut Table) -> Result<(), CameraModelError> {
    let Some(edge) = leds.remove(EDGE) else { return Ok(()) };
    let key = format!("leds.{EDGE}");
    if leds.contains_key("rise_ns") || leds.contains_key("fall_ns") {
        let expected = "either edge_ns or rise_ns and fall_ns, because edge_ns is both";
        return Err(value(&key, &edge, expected));
    }
    let edge = match edge {
        Value::Integer(whole) => Value::Float(whole as f64),
        edge => edge,
    };
    let fits = |range: (f64, f64), found: f64| (range.0..=range.1).contains(&found);
    match (range("leds.rise_ns"), edge.as_float()) {
        (Some(range), Some(found)) if fits(range, found) => {}
        _ => return Err(value(&key, &edge, kind("leds.rise_ns", &Value::Float(0.0)))),
    }
    leds.insert("rise_ns".to_owned(), edge.clone());
    leds.insert("fall_ns".to_owned(), edge);
    Ok(())
}

/// Makes the description as it was before there were [`NEW_KEYS`], and before rise and fall could differ, where it says
/// nothing else.
pub(super) fn fold_new_keys(model: &mut Table) {
    for (section, key) in NEW_KEYS {
        let Some(Value::Table(section)) = model.get_mut(section) else { continue };
        if section.get(key).and_then(Value::as_float) == Some(0.0) {
            section.remove(key);
        }
    }
    let Some(Value::Table(leds)) = model.get_mut("leds") else { return };
    if leds.get("rise_ns") == leds.get("fall_ns") && leds.remove("fall_ns").is_some() {
        let edge = leds.remove("rise_ns");
        leds.extend(edge.map(|edge| (EDGE.to_owned(), edge)));
    }
    if !leds.contains_key("line_crosstalk_ff") {
        leds.remove("line_swing_v");
    }
}

fn parse(text: &str) -> Result<Table, CameraModelError> {
    text.parse::<Table>().map_err(|error| {
        let at = error.span().map_or(0, |span| span.start.min(text.len()));
        let line = text.get(..at).map_or(1, |before| before.matches('\n').count() + 1);
        let reason = error.message().split_whitespace().collect::<Vec<_>>().join(" ");
        CameraModelError::Syntax { line, reason }
    })
}

/// Replaces values of `table`, which has every key, by the values `given`.
fn put(table: &mut Table, given: Table, section: &str) -> Result<(), CameraModelError> {
    for (name, new) in given {
        let key = if section.is_empty() { name.clone() } else { format!("{section}.{name}") };
        let expected = table.keys().map(String::as_str).collect::<Vec<_>>().join(", ");
        let Some(old) = table.get_mut(&name) else {
            return Err(CameraModelError::Key { key, expected });
        };
        match (old, new) {
            (Value::Table(old), Value::Table(new)) => put(old, new, &key)?,
            (old @ Value::Float(_), Value::Integer(new)) => *old = Value::Float(new as f64),
            (old @ Value::Float(_), new @ Value::Float(_))
            | (old @ Value::Integer(_), new @ Value::Integer(_))
            | (old @ Value::String(_), new @ Value::String(_))
            | (old @ Value::Array(_), new @ Value::Array(_)) => *old = new,
            (old, new) => return Err(value(&key, &new, kind(&key, old))),
        }
    }
    Ok(())
}

/// The allowed values of a key, in words.
fn kind(key: &str, value: &Value) -> String {
    let whole = if matches!(value, Value::Integer(_)) { "a whole number" } else { "a number" };
    match (range(key), value) {
        (Some((least, most)), _) => format!("{whole} from {least} to {most}"),
        (None, Value::Table(_)) => format!("a section [{key}]"),
        (None, Value::Array(_)) => "a list such as [[0, 5], [31, 2]]".to_owned(),
        _ => "text in quotes".to_owned(),
    }
}

fn range(key: &str) -> Option<(f64, f64)> {
    RANGES.iter().find(|(name, ..)| *name == key).map(|&(_, least, most)| (least, most))
}

/// Checks each value by itself.
fn check_table(table: &Table) -> Result<(), CameraModelError> {
    for (section, content) in table {
        match content {
            Value::Table(content) => {
                for (name, found) in content {
                    check_value(&format!("{section}.{name}"), found)?;
                }
            }
            found => check_value(section, found)?,
        }
    }
    Ok(())
}

fn check_value(key: &str, found: &Value) -> Result<(), CameraModelError> {
    let number = found.as_float().or_else(|| found.as_integer().map(|whole| whole as f64));
    let fits = match (key, number, range(key)) {
        (_, Some(number), Some((least, most))) => (least..=most).contains(&number),
        ("light.source", ..) => {
            let name = found.as_str().unwrap_or_default();
            if LightSource::ALL.iter().all(|source| source.name() != name) {
                return Err(value(key, found, LightSource::ALL.map(LightSource::name).join(", ")));
            }
            true
        }
        ("weather.air", ..) => match Air::from_str(found.as_str().unwrap_or_default()) {
            Ok(_) => true,
            Err(AirError::Unknown { .. }) => return Err(value(key, found, Air::EXPECTED)),
            Err(AirError::Numbers(error)) => return Err(value(key, found, error.expected)),
            Err(error) => return Err(value(key, found, format!("possible weather ({error})"))),
        },
        ("leds.dead", ..) => found.as_array().is_some_and(|leds| leds.iter().all(is_place)),
        _ => true,
    };
    if fits {
        return Ok(());
    }
    let expected = match key {
        "leds.dead" => format!("a list of [row, column], each 0 to {}", SIDE - 1),
        _ => kind(key, found),
    };
    Err(value(key, found, expected))
}

/// Whether the value is the row and column of an LED.
fn is_place(led: &Value) -> bool {
    let inside = |at: &Value| at.as_integer().is_some_and(|at| (0..SIDE as i64).contains(&at));
    led.as_array().is_some_and(|place| place.len() == 2 && place.iter().all(inside))
}

/// Checks conditions on two values.
fn check_together(model: &CameraModel) -> Result<(), CameraModelError> {
    let expect = |holds: bool, key: &str, found: f64, expected: String| {
        if holds {
            return Ok(());
        }
        Err(CameraModelError::Value { key: key.to_owned(), found: found.to_string(), expected })
    };
    let lens = &model.projector;
    let pitch = lens.led_pitch_mm;
    let wide = format!("at most the {pitch} of projector.led_pitch_mm");
    expect(lens.emitter_mm <= pitch, "projector.emitter_mm", lens.emitter_mm, wide)?;
    let (focus, focal) = (lens.focus_distance_mm, lens.focal_length_mm);
    let far = format!("more than the {focal} of projector.focal_length_mm");
    expect(focus > focal, "projector.focus_distance_mm", focus, far)?;
    let (blanked, clocks) = (model.readout.blanked, model.readout.clocks_per_pattern);
    let fewer = format!("less than the {clocks} of readout.clocks_per_pattern");
    expect(blanked < clocks, "readout.blanked", blanked.into(), fewer)?;
    let leds = &model.leds;
    if leds.rise_ns != leds.fall_ns || leds.turn_on_delay_ns != leds.turn_off_delay_ns {
        let slot_ns = f64::from(clocks) * SAMPLE_NS;
        let most = slot_ns / SETTLED_CONSTANTS * 9.0_f64.ln();
        let (key, slower) = if leds.rise_ns > leds.fall_ns {
            ("leds.rise_ns", leds.rise_ns)
        } else {
            ("leds.fall_ns", leds.fall_ns)
        };
        let expected = format!(
            "at most {most:.1} for patterns of {slot_ns} ns, because rise and fall differ and LEDs \
             must settle within a pattern"
        );
        expect(time_constant_ns(slower) * SETTLED_CONSTANTS <= slot_ns, key, slower, expected)?;
    }
    let efficiency = model.quantum_efficiency();
    let most = model.detector.responsivity_a_per_w / efficiency;
    let at = model.wavelength_nm;
    let possible = format!("at most {most:.3}, an electron for each photon of {at} nm");
    let responsivity = model.detector.responsivity_a_per_w;
    expect(efficiency <= 1.0, "detector.responsivity_a_per_w", responsivity, possible)
}

//! Checks whether a camera and this program fit together, and says what to update.

use nirspi_files::boards::Board;
use nirspi_files::identity::CameraIdentity;
use nirspi_wire::{Version, register::Register, version};
use serde::Serialize;
use std::cmp::Ordering;

/// How the camera's part compares with the part of this program's build.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Match {
    /// The versions are the same.
    Same,
    /// The camera's part is older.
    Older,
    /// The camera's part is newer.
    Newer,
    /// The camera has no such part that answers.
    Absent,
}

/// One part of the camera and of the program.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Part {
    /// The name of the part.
    pub name: &'static str,
    /// The camera's version.
    pub camera: String,
    /// The version of this program's build.
    pub expected: String,
    /// How the two versions compare.
    pub compared: Match,
    /// What to do; `None` if the versions fit.
    pub advice: Option<String>,
}

/// The version numbers in `text`, for comparing.
fn numbers(text: &str) -> Vec<u32> {
    text.split('.').map(|part| part.parse().unwrap_or(0)).collect()
}

fn part(
    name: &'static str,
    camera: &str,
    expected: &str,
    advise: impl Fn(Match) -> String,
) -> Part {
    let compared = match numbers(camera).cmp(&numbers(expected)) {
        _ if camera == "0.0.0" => Match::Absent,
        Ordering::Equal => Match::Same,
        Ordering::Less => Match::Older,
        Ordering::Greater => Match::Newer,
    };
    let advice = (compared != Match::Same).then(|| advise(compared));
    Part { name, camera: camera.to_owned(), expected: expected.to_owned(), compared, advice }
}

/// Compares all parts. `map` is the value of the FPGA's version register, if it was read.
#[must_use]
pub fn compare(camera: &CameraIdentity, map: Option<u32>) -> Vec<Part> {
    let program = env!("CARGO_PKG_VERSION");
    let gateware = Version::of_register(Register::Version.reset()).to_string();
    let update_program = |version: &str| format!("update this program to {version} or newer");
    let firmware = |compared| match compared {
        Match::Newer => update_program(&camera.firmware),
        _ => update_firmware(&camera.board),
    };
    let bitstream = |compared| match compared {
        Match::Newer => update_program(&camera.gateware),
        Match::Absent => format!("no gateware answers: {LOAD_GATEWARE}"),
        _ => LOAD_GATEWARE.to_owned(),
    };
    let mut parts = vec![
        part("protocol", &camera.protocol.to_string(), &version::CURRENT.to_string(), firmware),
        part("firmware", &camera.firmware, program, firmware),
        part("gateware", &camera.gateware, &gateware, bitstream),
    ];
    parts.extend(map.map(|map| {
        part("register map", &Version::of_register(map).to_string(), &gateware, bitstream)
    }));
    parts
}

const LOAD_GATEWARE: &str = "load this version's bitstream: nirspi camera gateware target/gateware/ecp5-evn/nirspi.bit --camera ... \
     (python3 hdl/build.py makes it)";

/// How to update a board's firmware to this program's version.
fn update_firmware(board: &str) -> String {
    match Board::named(board) {
        Some(Board { name, chip: Some(_), .. }) => {
            format!("flash the firmware: nirspi camera flash --board {name}")
        }
        _ => format!("build the firmware of {board} again, with this program's version"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera(change: impl FnOnce(&mut CameraIdentity)) -> CameraIdentity {
        let mut camera = CameraIdentity::current("nucleo-u5a5zj-q", "A1");
        change(&mut camera);
        camera
    }

    /// Name and advice of all parts that differ.
    fn advice(camera: &CameraIdentity, map: u32) -> Vec<(&'static str, String)> {
        let parts = compare(camera, Some(map));
        parts.into_iter().filter_map(|part| Some((part.name, part.advice?))).collect()
    }

    #[test]
    fn a_camera_of_this_version_needs_nothing() {
        assert_eq!(advice(&camera(|_| {}), Register::Version.reset()), []);
    }

    #[test]
    fn old_firmware_names_the_command_that_updates_it() {
        let old = camera(|camera| camera.firmware = "0.0.9".into());
        let found = advice(&old, Register::Version.reset());
        assert_eq!(found.len(), 1);
        assert!(found[0].1.contains("nirspi camera flash --board nucleo-u5a5zj-q"), "{found:?}");
    }

    #[test]
    fn newer_firmware_asks_for_a_newer_program_whatever_the_digits() {
        let new = camera(|camera| camera.firmware = "0.10.0".into());
        let found = advice(&new, Register::Version.reset());
        assert!(found[0].1.contains("update this program to 0.10.0"), "{found:?}");
    }

    #[test]
    fn absent_gateware_and_an_old_register_map_name_the_bitstream() {
        let none = camera(|camera| camera.gateware = "0.0.0".into());
        let found = advice(&none, 0x0000_0005);
        assert_eq!(
            found.iter().map(|(name, _)| *name).collect::<Vec<_>>(),
            ["gateware", "register map"]
        );
        assert!(found[0].1.starts_with("no gateware answers"), "{found:?}");
        assert!(found[1].1.contains("nirspi.bit"), "{found:?}");
    }
}

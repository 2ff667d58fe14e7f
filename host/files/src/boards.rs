//! The boards for which firmware is built: every `boards/NAME/board.toml` of the repository.
//!
//! # Invariant
//! The list is that of the files (`the_list_of_the_host_program_is_that_of_the_files` in
//! `tests/tests/boards.rs`, which writes it). So this crate builds without the repository around
//! it.

mod board;

pub use board::{Board, Pins};
use std::path::PathBuf;

/// All boards, by name.
pub static BOARDS: &[Board] = include!("boards/list.in");

/// Names and titles of the boards that can be flashed, for messages and help.
#[must_use]
pub fn flashable() -> String {
    let boards = BOARDS.iter().filter(|board| board.chip.is_some());
    boards.map(|board| format!("{} ({})", board.name, board.title)).collect::<Vec<_>>().join(", ")
}

impl Board {
    /// The board of this name.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        BOARDS.iter().find(|board| board.name == name)
    }

    /// The path of the firmware that `cargo build --release` makes in the board's folder, from the
    /// repository's root.
    #[must_use]
    pub fn elf(&self) -> PathBuf {
        ["boards", "target", self.target, "release", self.name].iter().collect()
    }
}

/// Whether the camera with this board name has no light of its own: the virtual camera, or a camera
/// in an emulator.
#[must_use]
pub fn is_simulated(board: &str) -> bool {
    board == "virtual" || Board::named(board).is_some_and(|board| board.chip.is_none())
}

#[cfg(test)]
mod tests {
    use super::*;

    const HARDWARE: &str = "title = \"Toy\"\nkind = \"hardware\"\nprocessor = \"P1\"\ntarget = \"thumb\"\n\
        host_link = \"USB\"\nfpga_link = \"SPI\"\nstate = \"built\"\nflash_bytes = 65_536\nstatic_bytes = 20\n\
        stack_bytes = 10\nchip = \"C1\"\nstaging_bytes = 7\nfpga_wires = 4\npin_name = \"P{number}\"\nled_enable_low = \"off({number})\"\n";

    #[test]
    fn a_board_is_what_its_board_toml_says() {
        let board = Board::parse("toy", HARDWARE).unwrap();
        assert_eq!((board.name, board.title, board.chip), ("toy", "Toy", Some("C1")));
        assert_eq!((board.flash_bytes, board.static_bytes, board.stack_bytes), (65_536, 20, 10));
        assert_eq!((board.staging_bytes, board.pins.unwrap().fpga_wires), (Some(7), 4));
        assert_eq!(board.elf(), PathBuf::from("boards/target/thumb/release/toy"));
    }

    #[test]
    fn a_wrong_board_toml_is_one_line_that_names_file_and_key() {
        let without = |key: &str| {
            let lines = HARDWARE.lines().filter(|line| !line.starts_with(key));
            lines.map(|line| format!("{line}\n")).collect::<String>()
        };
        let emulated = HARDWARE.replace("hardware", "emulated");
        let wrong = [
            (
                format!("{HARDWARE}colour = \"red\"\n"),
                "unknown key colour, expected one of title, kind",
            ),
            (format!("{HARDWARE}chip = \"C2\"\n"), "key chip is there twice"),
            (format!("{HARDWARE}[section]\n"), "line 16 is \"[section]\", expected key = \"text\""),
            (HARDWARE.replace("\"USB\"", "\"USB\" # fast"), "comments on lines of their own"),
            (HARDWARE.replace("\"Toy\"", "5"), "title must be a \"text\""),
            (HARDWARE.replace("65_536", "\"64 KB\""), "flash_bytes must be a whole number"),
            (HARDWARE.replace("hardware", "toaster"), "kind is \"toaster\", expected \"hardware\""),
            (emulated, "an emulated board has no chip: leave that key out"),
        ];
        let keys = HARDWARE.lines().map(|line| line.split(' ').next().unwrap());
        let missing = keys.map(|key| (without(key), format!("missing key {key}")));
        let wrong = wrong.map(|(text, words)| (text, words.to_owned()));
        for (text, words) in wrong.into_iter().chain(missing) {
            let error = Board::parse("toy", text.leak()).unwrap_err();
            assert!(error.starts_with("boards/toy/board.toml: "), "{error}");
            assert!(error.contains(&words), "{error:?}, expected {words:?}");
            assert!(!error.contains('\n'), "{error}");
        }
    }

    #[test]
    fn only_the_virtual_camera_and_emulated_boards_are_simulated() {
        assert!(is_simulated("virtual"));
        assert!(is_simulated("mps2-an505"));
        assert!(!is_simulated("nucleo-u5a5zj-q"));
        assert!(!is_simulated("a board of somebody else"));
    }
}

//! The boards that firmware is built for, each once: what to call it, which chip it carries, where its build ends up.

use std::path::PathBuf;

/// A board under `boards/`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Board {
    /// Its folder, its package, and what it calls itself on the wire.
    pub name: &'static str,
    /// Its chip as probe-rs spells it; `None` where there is nothing to program.
    pub chip: Option<&'static str>,
    /// The Rust target of its firmware.
    pub target: &'static str,
}

/// All boards, the reference first.
pub const BOARDS: [Board; 3] = [
    Board {
        name: "nucleo-u5a5zj-q",
        chip: Some("STM32U5A5ZJTxQ"),
        target: "thumbv8m.main-none-eabihf",
    },
    Board { name: "nucleo-h7s3l8", chip: Some("STM32H7S3L8Hx"), target: "thumbv7em-none-eabihf" },
    // Runs in QEMU.
    Board { name: "mps2-an505", chip: None, target: "thumbv8m.main-none-eabihf" },
];

impl Board {
    /// The board of this name.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        BOARDS.iter().find(|board| board.name == name)
    }

    /// Where `cargo build --release` in its folder puts the firmware, from the repository's root.
    #[must_use]
    pub fn elf(&self) -> PathBuf {
        ["boards", "target", self.target, "release", self.name].iter().collect()
    }
}

/// Whether the camera that calls its board this has no light of its own: the virtual one, or one in an emulator.
#[must_use]
pub fn is_simulated(board: &str) -> bool {
    board == "virtual" || Board::named(board).is_some_and(|board| board.chip.is_none())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;
    use std::path::Path;

    /// `boards/NAME/.cargo/config.toml` runs firmware with `probe-rs run --chip CHIP`: the same chip as here.
    #[test]
    fn every_chip_is_the_one_that_the_boards_folder_names() {
        let boards = Path::new(env!("CARGO_MANIFEST_DIR")).join("../boards");
        for board in BOARDS {
            let Some(chip) = board.chip else { continue };
            let path = boards.join(board.name).join(".cargo/config.toml");
            let Ok(text) = std::fs::read_to_string(&path) else {
                // Past the test harness's capture, so that a skipped test is seen.
                let _ = writeln!(std::io::stderr(), "skipped: no {}", path.display());
                continue;
            };
            let words: Vec<&str> =
                text.split(|c: char| c.is_whitespace() || "\"',[]".contains(c)).collect();
            let named = words.windows(2).find(|pair| pair[0] == "--chip").map(|pair| pair[1]);
            assert_eq!(named, Some(chip), "{}", path.display());
        }
    }

    /// With the feature only: `cargo test -p nirspi --features flash boards`.
    #[cfg(feature = "flash")]
    #[test]
    fn every_chip_is_one_that_probe_rs_knows() {
        let registry = probe_rs::config::Registry::from_builtin_families();
        for board in BOARDS {
            let Some(chip) = board.chip else {
                let _ = writeln!(std::io::stderr(), "skipped: {} has no chip", board.name);
                continue;
            };
            let target = registry.get_target_by_name(chip).unwrap();
            assert_eq!(target.name, chip, "probe-rs spells it so");
        }
    }
}

//! Finds or builds the firmware's ELF and the emulator.
//!
//! If a part is missing, the test is skipped with a message. If a part is there and does not work,
//! the test fails.
#![expect(clippy::unwrap_used, reason = "a failed unwrap here fails the test that uses it")]

use crate::root;
use nirspi::boards::Board;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

/// The emulated board.
///
/// # Panics
/// If it has no `board.toml`.
#[must_use]
pub fn board() -> &'static Board {
    Board::named("mps2-an505").unwrap()
}

/// Prints past the test harness's capture, so that a skipped test is visible.
fn skipped(reason: &str) {
    let _ = writeln!(std::io::stderr(), "skipped: {reason}");
}

/// QEMU: `$NIRSPI_QEMU`, or `qemu-system-arm` on the `PATH`, or what `install-qemu.sh` has unpacked.
#[must_use]
pub fn qemu() -> Option<PathBuf> {
    let unpacked = root().join("target/qemu/qemu-system-arm");
    let candidates = [
        std::env::var_os("NIRSPI_QEMU").map(PathBuf::from),
        Some("qemu-system-arm".into()),
        Some(unpacked),
    ];
    let found = candidates.into_iter().flatten().find(|program| {
        let version = Command::new(program).arg("--version").output();
        version.is_ok_and(|output| output.status.success())
    });
    if found.is_none() {
        skipped("no qemu");
    }
    found
}

/// The firmware: `$NIRSPI_FIRMWARE_ELF`, or built here, which takes 15 s and is left out where no emulator can run it.
///
/// # Panics
/// If it does not build.
#[must_use]
pub fn elf() -> Option<&'static Path> {
    static ELF: OnceLock<Option<PathBuf>> = OnceLock::new();
    ELF.get_or_init(|| {
        if let Some(given) = std::env::var_os("NIRSPI_FIRMWARE_ELF") {
            return Some(given.into());
        }
        qemu()?;
        if !has_target() {
            skipped(&format!("no {} target", board().target));
            return None;
        }
        Some(build())
    })
    .as_deref()
}

/// Whether the compiler has the target's core library. Fetching that library would need a network.
fn has_target() -> bool {
    let output = Command::new("rustc")
        .args(["--print", "target-libdir", "--target", board().target])
        .output();
    let Ok(output) = output else { return false };
    let folder = String::from_utf8_lossy(&output.stdout);
    output.status.success() && Path::new(folder.trim()).is_dir()
}

fn build() -> PathBuf {
    let name = board().name;
    let status = Command::new("cargo")
        .args(["build", "--release", "--locked", "--quiet", "--target-dir", "../target"])
        .current_dir(root().join("boards").join(name))
        .env_remove("CARGO_TARGET_DIR")
        .status()
        .unwrap();
    assert!(status.success(), "boards/{name} does not build");
    root().join(board().elf())
}

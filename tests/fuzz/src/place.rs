//! A file for readers that take a path.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// The folder of this process: `FUZZ_PLACE`, which `search.py` makes in memory and removes.
fn folder() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let own = || std::env::temp_dir().join(format!("nirspi-fuzz-{}", std::process::id()));
        let folder = std::env::var_os("FUZZ_PLACE").map_or_else(own, PathBuf::from);
        std::fs::create_dir_all(&folder).expect("a folder for inputs");
        folder
    })
}

/// A path in that folder.
pub fn path(name: &str) -> PathBuf {
    folder().join(name)
}

/// Writes the bytes as a file of this name.
pub fn file(name: &str, bytes: &[u8]) -> PathBuf {
    let path = path(name);
    std::fs::write(&path, bytes).expect("an input's file");
    path
}

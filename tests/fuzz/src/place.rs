//! A file for readers that take a path, in memory where the system has a file system there.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// The folder of this process.
fn folder() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let memory = Path::new("/dev/shm");
        let temporary = std::env::temp_dir();
        let base = if memory.is_dir() { memory } else { &temporary };
        let folder = base.join(format!("nirspi-fuzz-{}", std::process::id()));
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

/// Removes the folder, at the end of the process.
pub fn remove() {
    let _ = std::fs::remove_dir_all(folder());
}

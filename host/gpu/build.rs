//! Gives the crate a number that changes with its sources: `cache.rs` keeps compiled kernels by it.

use std::fs;
use std::path::{Path, PathBuf};

fn main() {
    println!("cargo::rerun-if-changed=src");
    let mut files = Vec::new();
    below(Path::new("src"), &mut files);
    files.sort();
    // FNV-1a, of 64 bits.
    let mut number = 0xcbf2_9ce4_8422_2325_u64;
    for file in files {
        // Not the path, which has other separators on Windows.
        for byte in fs::read(&file).expect("a source file is read") {
            number = (number ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
    println!("cargo::rustc-env=NIRSPI_GPU_SOURCES={number:016x}");
}

/// Adds the files of a folder and of the folders in it.
fn below(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("the folder of sources is read") {
        let path = entry.expect("the folder of sources is read").path();
        if path.is_dir() {
            below(&path, files);
        } else {
            files.push(path);
        }
    }
}

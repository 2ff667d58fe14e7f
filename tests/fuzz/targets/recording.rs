//! Fuzzes the reader of recordings. The reader must read as far as the file is sound, or refuse it
//! in one line.
#![no_main]

use libfuzzer_sys::fuzz_target;
use nirspi::causes::in_one_line;
use nirspi::source::{Source, SourceOptions};
use std::io::Write;

fuzz_target!(|bytes: &[u8]| {
    let mut file = tempfile::Builder::new().suffix(".mcap").tempfile().expect("a temporary file");
    file.write_all(bytes).expect("written");
    for keep_leak in [false, true] {
        let options = SourceOptions { keep_leak, ..SourceOptions::default() };
        match Source::read(file.path(), options) {
            Ok(source) => {
                let image = nirspi_recon::reconstruct::hadamard(&source.measurements);
                assert!(image.pixels().iter().all(|pixel| pixel.is_finite()));
            }
            Err(error) => assert_eq!(in_one_line(&error).lines().count(), 1),
        }
    }
});

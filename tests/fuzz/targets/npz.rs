//! Fuzzes the reader of measurement files. The reader must read the file, or refuse it in one line.
#![no_main]

use libfuzzer_sys::fuzz_target;
use nirspi::files::npz::{Selection, read};
use std::io::Write;

fuzz_target!(|bytes: &[u8]| {
    let mut file = tempfile::NamedTempFile::new().expect("a temporary file");
    file.write_all(bytes).expect("written");
    if let Err(error) = read(file.path(), Selection::default()) {
        assert_eq!(error.to_string().lines().count(), 1);
    }
});

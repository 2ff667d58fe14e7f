//! Fuzzes the reader of recordings. The reader must read as far as the file is sound, or refuse it
//! in one line.
//!
//! Run with `-- -malloc_limit_mb=8192`: the mcap crate reserves, and never touches, the length that
//! a string in a record claims.
#![no_main]

use libfuzzer_sys::fuzz_target;
use std::io::Write;

fuzz_target!(|bytes: &[u8]| {
    let mut file = tempfile::NamedTempFile::new().expect("a temporary file");
    file.write_all(bytes).expect("written");
    let read = nirspi::recording::Recording::open(file.path())
        .and_then(|mut recording| recording.try_for_each(|packet| packet.map(drop)));
    if let Err(error) = read {
        assert_eq!(error.to_string().lines().count(), 1);
    }
});

//! Bitstreams, the FPGA that is loaded with them, and release folders.

use crate::{Law, MIB, place, read};
use nirspi_mcu::ecp5::SlaveSpi;
use nirspi_mcu::staging::{StagingLoader, stored};
use nirspi_mcu::{BusError, GatewareLoader, Micros};
use nirspi_update::{Component, MANIFEST, Release};
use std::path::Path;

pub const LAWS: &[Law] = &[
    Law {
        name: "bitstreams",
        reads: "a bitstream in pieces, and what the FPGA answers while it is loaded",
        readers: &["mcu/src/staging.rs", "mcu/src/ecp5.rs"],
        holds: bitstreams,
        seeds: bitstream_seeds,
        longest: 1024,
        most_memory: MIB,
    },
    Law {
        name: "releases",
        reads: "the manifest of a release folder (JSON), and the files that it lists",
        readers: &["host/update/src/release.rs"],
        holds: releases,
        seeds: release_seeds,
        longest: 4096,
        most_memory: 16 * MIB,
    },
];

/// A chip that answers with the bytes of the input.
struct AnyChip<'b> {
    answers: &'b [u8],
    sent: usize,
}

impl AnyChip<'_> {
    fn byte(&mut self) -> u8 {
        let Some((&byte, rest)) = self.answers.split_first() else { return 0 };
        self.answers = rest;
        byte
    }
}

impl SlaveSpi for AnyChip<'_> {
    fn program(&mut self, _: bool) {}

    fn done(&mut self) -> bool {
        self.byte() & 1 == 1
    }

    fn select(&mut self, _: bool) {}

    fn write(&mut self, bytes: &[u8]) -> Result<(), BusError> {
        self.sent += bytes.len();
        if self.byte() == 0xEE { Err(BusError::Timeout) } else { Ok(()) }
    }

    fn read(&mut self, into: &mut [u8]) -> Result<(), BusError> {
        into.fill_with(|| self.byte());
        Ok(())
    }
}

/// Memory of the loader.
const ROOM: usize = 256;

fn bitstreams(bytes: &[u8]) {
    if let Some(found) = stored(bytes) {
        assert!(bytes.starts_with(found));
        // What was found is found again, and the rest is erased memory.
        assert_eq!(stored(found), Some(found));
        assert!(bytes[found.len()..].iter().all(|byte| *byte == 0xFF));
    }
    let Some((&[length, total, piece], rest)) = bytes.split_first_chunk() else { return };
    let (bitstream, answers) = rest.split_at(rest.len().min(length.into()));
    let mut memory = [0; ROOM];
    let mut loader = StagingLoader::new(AnyChip { answers, sent: 0 }, &mut memory, None);
    let total = 2 * u32::from(total);
    assert_eq!(loader.begin(total).is_ok(), total as usize <= ROOM);
    let taken =
        bitstream.chunks(usize::from(piece).max(1)).all(|piece| loader.write(piece).is_ok());
    assert_eq!(taken, bitstream.len() <= ROOM, "{} bytes in {ROOM}", bitstream.len());
    if !taken {
        return;
    }
    assert!(loader.finish().is_ok());
    // The chip is busy for a second at most, eight times in all.
    let mut steps = 0;
    while loader.step(Micros(steps * 10_000)) {
        steps += 1;
        assert!(steps < 5000, "a load without end");
    }
    let failed = loader.take_failure().is_some();
    assert!(!failed || loader.running().is_none(), "a bitstream that failed runs");
}

fn bitstream_seeds() -> Vec<Vec<u8>> {
    let bitstream: Vec<u8> = [0xFF, 0x00].into_iter().chain(0..60).chain([0xFF; 40]).collect();
    let preamble = [0xFF, 0xFF, 0xBD, 0xB3, 1, 2, 3];
    // The identity of the chip, then a status that is done.
    let answers = [0, 0x81, 0x11, 0x30, 0x43, 0, 0, 0, 1, 0].repeat(8);
    let load = [&[preamble.len() as u8, 100, 3][..], &preamble, &answers].concat();
    vec![bitstream, load]
}

fn releases(bytes: &[u8]) {
    let folder = place::path("release");
    std::fs::create_dir_all(&folder).expect("a folder");
    std::fs::write(folder.join(MANIFEST), bytes).expect("the manifest");
    std::fs::write(folder.join("a.bit"), BIT).expect("a bitstream");
    let Some(release) = read(Release::open(&folder)) else { return };
    for asset in &release.manifest().files {
        let path = release.path(asset);
        assert_eq!(path.parent(), Some(&*folder), "a file outside the folder: {path:?}");
        assert_eq!(path.file_name(), Some(Path::new(&asset.file).as_os_str()));
        let Some(bytes) = read(release.bytes(asset)) else { continue };
        assert_eq!(bytes.len() as u64, asset.bytes);
        if asset.component == Component::Gateware {
            assert!(stored(&bytes).is_some());
        }
    }
}

const BIT: &[u8] = &[0xFF, 0x00, 1, 2, 3];

fn release_seeds() -> Vec<Vec<u8>> {
    let of_the_bytes = "cd4f22bf0ccfe0f6a7a2c4c6ed5b5f7e6a2a7e0a43d8df9cf0bbd2aa8dcd2fd1";
    let asset = |file: &str, component: &str| {
        format!(
            r#"{{"file":"{file}","component":"{component}","board":"b","version":"0.1.0","bytes":5,"sha256":"{of_the_bytes}"}}"#
        )
    };
    let all = [asset("a.bit", "gateware"), asset("a.bit", "firmware"), asset("b.elf", "firmware")];
    let manifest = |files: &str| format!(r#"{{"version":"0.1.0","protocol":4,"files":[{files}]}}"#);
    vec![manifest(&all.join(",")).into_bytes(), manifest("").into_bytes()]
}

//! Makes files byte by byte for tests, so that each file is wrong in one chosen way.

use std::path::PathBuf;
use tempfile::TempDir;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// A `.npy` file (format 1.0) with the header's three values as Python text.
pub(super) fn npy(descr: &str, fortran: bool, shape: &str, data: &[u8]) -> Vec<u8> {
    let order = if fortran { "True" } else { "False" };
    npy_with_header(
        &format!("{{'descr': {descr}, 'fortran_order': {order}, 'shape': {shape}, }}"),
        data,
    )
}

pub(super) fn npy_with_header(header: &str, data: &[u8]) -> Vec<u8> {
    let length = u16::try_from(header.len() + 1).unwrap();
    [b"\x93NUMPY\x01\x00".as_slice(), &length.to_le_bytes(), header.as_bytes(), b"\n", data]
        .concat()
}

pub(super) fn npy_f64(shape: &str, values: &[f64]) -> Vec<u8> {
    let data: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    npy("'<f8'", false, shape, &data)
}

pub(super) fn npy_i32(shape: &str, values: &[i32]) -> Vec<u8> {
    let data: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    npy("'<i4'", false, shape, &data)
}

/// How the members of an archive are stored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Zip {
    Stored,
    /// Sizes in a zip64 extra field, as `numpy.savez` of large arrays and streaming writers store
    /// them.
    Zip64,
    Deflated,
}

/// A zip archive of `(name, bytes)` members.
pub(super) fn zip(how: Zip, members: &[(&str, Vec<u8>)]) -> Vec<u8> {
    if how == Zip::Deflated {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let mut writer = ZipWriter::new(&mut bytes);
        for (name, data) in members {
            writer.start_file(*name, SimpleFileOptions::default()).unwrap();
            std::io::Write::write_all(&mut writer, data).unwrap();
        }
        writer.finish().unwrap();
        return bytes.into_inner();
    }
    let (mut bytes, mut directory) = (Vec::new(), Vec::new());
    for (name, data) in members {
        let offset = bytes.len() as u32;
        let (size, extra) = match how {
            Zip::Zip64 => {
                let size = (data.len() as u64).to_le_bytes();
                (u32::MAX, [&[1, 0, 16, 0], size.as_slice(), &size].concat())
            }
            _ => (data.len() as u32, Vec::new()),
        };
        let common = [
            [45, 0, 0, 0, 0, 0, 0, 0, 0x21, 0].as_slice(),
            &crc32(data).to_le_bytes(),
            &size.to_le_bytes(),
            &size.to_le_bytes(),
            &(name.len() as u16).to_le_bytes(),
            &(extra.len() as u16).to_le_bytes(),
        ]
        .concat();
        bytes.extend([b"PK\x03\x04".as_slice(), &common, name.as_bytes(), &extra, data].concat());
        let place = [[0; 10].as_slice(), &offset.to_le_bytes()].concat();
        directory.extend(
            [b"PK\x01\x02\x2d\x00".as_slice(), &common, &place, name.as_bytes(), &extra].concat(),
        );
    }
    let start = bytes.len() as u32;
    let count = (members.len() as u16).to_le_bytes();
    bytes.extend(&directory);
    bytes.extend(
        [
            b"PK\x05\x06\0\0\0\0".as_slice(),
            &count,
            &count,
            &(directory.len() as u32).to_le_bytes(),
            &start.to_le_bytes(),
            &[0, 0],
        ]
        .concat(),
    );
    bytes
}

fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(u32::MAX, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
            (crc >> 1) ^ (0xedb8_8320 & 0u32.wrapping_sub(crc & 1))
        })
    })
}

/// Writes a file of these bytes in a folder. Dropping the returned guard removes the folder.
pub(super) fn file(name: &str, bytes: &[u8]) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

/// The message of an error. Asserts that the message is one line and names the file.
pub(super) fn line(error: &super::FileError, name: &str) -> String {
    let line = error.to_string();
    assert!(!line.contains(['\n', '\r']), "{line:?}");
    assert!(line.contains(name), "{line:?}");
    line
}

/// Noise from -1/2 to 1/2, the same at the same place (splitmix64).
pub fn noise(at: usize) -> f64 {
    let mut z = (at as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
}

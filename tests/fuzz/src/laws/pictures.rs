//! PNG and JPEG.

use crate::{Law, MIB, place, read};
use nirspi::files::image::{encode_grey, is_picture, read_grey, read_reflectance, to_level};
use nirspi_wire::crc32;
use png::{BitDepth, ColorType};

pub const LAWS: &[Law] = &[
    Law {
        name: "png",
        reads: "a PNG, the checksums of its chunks right or as they come",
        readers: &[
            "host/files/src/image.rs",
            "host/files/src/image/encoded.rs",
            "host/files/src/image/labelled.rs",
        ],
        holds: png,
        seeds: png_seeds,
        longest: 2048,
        most_memory: MEMORY,
    },
    Law {
        name: "jpeg",
        reads: "a JPEG, with its note which side is up",
        readers: &["host/files/src/image.rs", "host/files/src/image/encoded.rs"],
        holds: picture,
        seeds: jpeg_seeds,
        longest: 2048,
        most_memory: MEMORY,
    },
];

/// Decoded bytes are 512 MiB at most; turning and greying copy them.
const MEMORY: usize = 2048 * MIB;

fn png(bytes: &[u8]) {
    picture(bytes);
    picture(&with_checksums(bytes));
}

/// The same PNG with right checksums.
fn with_checksums(bytes: &[u8]) -> Vec<u8> {
    let (mut made, mut at) = (bytes.to_vec(), 8);
    while let Some(length) = made.get(at..).and_then(|rest| rest.first_chunk()) {
        let end = at + 8 + u32::from_be_bytes(*length) as usize;
        let Some(covered) = made.get(at + 4..end) else { break };
        let crc = crc32(covered).to_be_bytes();
        let Some(place) = made.get_mut(end..end + 4) else { break };
        place.copy_from_slice(&crc);
        at = end + 4;
    }
    made
}

fn picture(bytes: &[u8]) {
    let path = place::file("input.png", bytes);
    assert!(is_picture(&path));
    let grey = read(read_grey(&path));
    let reflectance = read(read_reflectance(&path));
    assert_eq!(grey.is_some(), reflectance.is_some(), "read in one way and not in the other");
    let (Some(grey), Some(reflectance)) = (grey, reflectance) else { return };
    let (width, height) = (grey.width as usize, grey.height as usize);
    assert!(width > 0 && height > 0);
    assert_eq!(grey.values.len(), width * height);
    assert!(grey.values.iter().all(|value| (0.0..=1.0).contains(value)), "outside 0 to 1");
    assert_eq!(reflectance.size_px, width.min(height));
    assert_eq!(reflectance.values.len(), reflectance.size_px * reflectance.size_px);
    if width * height > 1 << 16 {
        return;
    }
    let small = grey.resized(3);
    assert!(
        small.values.len() == 9 && small.values.iter().all(|value| (0.0..=1.0).contains(value))
    );
    let again = place::file("again.png", &encode_grey(width, height, &grey.values, &provenance()));
    let back = read_grey(&again).expect("our own file");
    assert_eq!((back.width, back.height), (grey.width, grey.height));
    for (a, b) in grey.values.iter().zip(&back.values) {
        assert_eq!(to_level(*a), to_level(*b), "another level");
    }
}

fn png_seeds() -> Vec<Vec<u8>> {
    let encoded = |(colour, depth, width, row): (ColorType, BitDepth, u32, usize)| {
        let mut bytes = Vec::new();
        let samples: Vec<u8> = (0..4 * row).map(|at| (at * 23) as u8).collect();
        let mut encoder = png::Encoder::new(&mut bytes, width, 4);
        encoder.set_color(colour);
        encoder.set_depth(depth);
        let writer = encoder.write_header();
        writer.and_then(|mut writer| writer.write_image_data(&samples)).expect("memory");
        bytes
    };
    // Columns, and bytes of a row.
    let kinds = [
        (ColorType::Grayscale, BitDepth::Eight, 5, 5),
        (ColorType::Rgb, BitDepth::Eight, 4, 12),
        (ColorType::GrayscaleAlpha, BitDepth::Eight, 3, 6),
        (ColorType::Grayscale, BitDepth::Sixteen, 5, 10),
    ];
    let ours = encode_grey(8, 8, &[0.25; 64], &provenance());
    kinds.into_iter().map(encoded).chain([ours]).collect()
}

fn jpeg_seeds() -> Vec<Vec<u8>> {
    let grey = include_bytes!("../../../../host/files/src/small/nine.jpg").as_slice();
    let passes = include_bytes!("../../../../host/files/src/small/progressive.jpg").as_slice();
    let inks = include_bytes!("../../../../host/files/src/small/cmyk.jpg").as_slice();
    // Exif with one entry: the picture lies on its side.
    let exif = b"\xff\xe1\x00\x22Exif\0\0MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
    let turned = [&grey[..2], exif, &grey[2..]].concat();
    vec![grey.to_vec(), turned, passes.to_vec(), inks.to_vec()]
}

/// A provenance for files of tests.
fn provenance() -> nirspi::provenance::Provenance {
    use nirspi::provenance::{Made, Origin, Taken};
    Taken::without_camera(Origin::Simulated).made(&Made::by("test", None, ["test"], 0))
}

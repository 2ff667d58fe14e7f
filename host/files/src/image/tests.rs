use super::super::testing::{file, line};
use super::*;
use crate::provenance::tests::provenance;
use ::png::{BitDepth, ColorType};

/// A PNG of so many columns. 16-bit samples come with the high byte first.
fn png(width: u32, (colour, depth): (ColorType, BitDepth), samples: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let row = colour.samples() * if depth == BitDepth::Sixteen { 2 } else { 1 } * width as usize;
    let mut encoder = ::png::Encoder::new(&mut bytes, width, (samples.len() / row) as u32);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    encoder.write_header().unwrap().write_image_data(samples).unwrap();
    bytes
}

fn grey_png(width: u32, levels: &[u8]) -> Vec<u8> {
    png(width, (ColorType::Grayscale, BitDepth::Eight), levels)
}

/// JPEG files that Pillow 13.0 has written: baseline grey, colour in several passes, four inks.
const SMALL_JPEG: &[u8] = include_bytes!("../small/nine.jpg");
const PROGRESSIVE_JPEG: &[u8] = include_bytes!("../small/progressive.jpg");
const FOUR_INKS_JPEG: &[u8] = include_bytes!("../small/cmyk.jpg");

fn read(bytes: &[u8]) -> Result<Reflectance, FileError> {
    let (_guard, path) = file("scene.png", bytes);
    read_reflectance(&path)
}

#[test]
fn all_256_grey_levels_survive_a_round_trip() {
    let values: Vec<f32> = (0..256).map(|level| level as f32 / 255.0).collect();
    let bytes = encode_grey(16, 16, &values, &provenance());
    let map = read(&bytes).unwrap();
    assert_eq!(map.size_px, 16);
    for (found, wanted) in map.values.iter().zip(&values) {
        assert!((found - wanted).abs() < 1e-6, "{found} {wanted}");
    }
    assert_eq!(encode_grey(16, 16, &map.values, &provenance()), bytes);
}

#[test]
fn values_outside_0_to_1_are_clipped() {
    assert_eq!(
        [-1.0, 0.0, 1.0, 2.0, f32::NAN, f32::INFINITY].map(to_level),
        [0, 0, 255, 255, 0, 255]
    );
}

#[test]
fn colour_becomes_rec_709_luma() {
    let colours = [255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255];
    let map = read(&png(2, (ColorType::Rgb, BitDepth::Eight), &colours)).unwrap();
    for (found, wanted) in map.values.iter().zip([0.2126, 0.7152, 0.0722, 1.0]) {
        assert!((found - wanted).abs() < 1e-6, "{found} {wanted}");
    }
}

#[test]
fn every_kind_of_png_reads_alike() {
    let half = 128.0 / 255.0;
    let kinds: [(ColorType, BitDepth, &[u8]); 6] = [
        (ColorType::Grayscale, BitDepth::Eight, &[128]),
        (ColorType::Grayscale, BitDepth::Sixteen, &[128; 2]),
        (ColorType::GrayscaleAlpha, BitDepth::Eight, &[128, 255]),
        (ColorType::Rgb, BitDepth::Sixteen, &[128; 6]),
        (ColorType::Rgba, BitDepth::Eight, &[128, 128, 128, 255]),
        // A white pixel at half opacity before a black ground.
        (ColorType::Rgba, BitDepth::Eight, &[255, 255, 255, 128]),
    ];
    for (colour, depth, pixel) in kinds {
        let map = read(&png(2, (colour, depth), &pixel.repeat(4))).unwrap();
        let found = &map.values;
        assert!(found.iter().all(|v| (v - half).abs() < 1e-5), "{colour:?} {depth:?}: {found:?}");
    }
}

#[test]
fn a_wide_or_tall_picture_is_cropped_to_its_centre() {
    let levels = |bytes: &[u8]| -> Vec<f32> {
        read(bytes).unwrap().values.iter().map(|v| (v * 255.0).round()).collect()
    };
    let wide = grey_png(7, &[0, 1, 2, 3, 4, 5, 6].repeat(3));
    assert_eq!(levels(&wide), [2.0, 3.0, 4.0].repeat(3));
    let tall = grey_png(2, &[0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5]);
    assert_eq!(levels(&tall), [2.0, 2.0, 3.0, 3.0]);
}

#[test]
fn jpegs_of_every_kind_are_read() {
    // Red, green, blue, nearly white, 12 x 10 pixels each.
    for bytes in [PROGRESSIVE_JPEG, FOUR_INKS_JPEG] {
        let (_guard, path) = file("scene.jpg", bytes);
        let grey = read_grey(&path).unwrap();
        assert_eq!((grey.width, grey.height), (24, 20));
        let found = [(5, 4), (18, 4), (5, 15), (18, 15)].map(|(x, y)| grey.value(x, y));
        // As Pillow reads them.
        for (found, expected) in found.iter().zip([0.276, 0.596, 0.202, 0.941]) {
            assert!((found - expected).abs() < 0.01, "{found} {expected}");
        }
    }
}

/// The number of the side that is up, as a camera writes it: Exif, in either order of bytes.
fn turned(jpeg: &[u8], number: u8, is_big: bool) -> Vec<u8> {
    let exif: Vec<u8> = match is_big {
        true => [
            b"Exif\0\0MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0".as_slice(),
            &[number, 0, 0, 0, 0, 0, 0],
        ]
        .concat(),
        false => [
            b"Exif\0\0II\x2a\0\x08\0\0\0\x01\0\x12\x01\x03\0\x01\0\0\0".as_slice(),
            &[number, 0, 0, 0, 0, 0, 0, 0],
        ]
        .concat(),
    };
    let length = u16::try_from(exif.len() + 2).unwrap().to_be_bytes();
    [&jpeg[..2], &[0xff, 0xe1], &length, &exif, &jpeg[2..]].concat()
}

#[test]
fn a_picture_is_read_the_way_up_that_it_says() {
    let corners = |bytes: &[u8]| {
        let (_guard, path) = file("scene.jpg", bytes);
        let grey = read_grey(&path).unwrap();
        let (right, bottom) = (grey.width - 1, grey.height - 1);
        let corners = [(0, 0), (right, 0), (0, bottom), (right, bottom)];
        let level = |(x, y)| {
            ['b', 'r', 'g', 'w']
                [[0.24, 0.44, 0.77].partition_point(|limit| grey.value(x, y) > *limit)]
        };
        (grey.width, corners.map(level).into_iter().collect::<String>())
    };
    // Stored: red and green above blue and white, 24 columns.
    let upright = ["rgbw", "rgbw", "grwb", "wbgr", "bwrg", "rbgw", "brwg", "wgbr", "gwrb"];
    for (number, expected) in (0..).zip(upright) {
        for is_big in [true, false] {
            let (width, found) = corners(&turned(PROGRESSIVE_JPEG, number, is_big));
            assert_eq!(found, expected, "Exif orientation {number}");
            assert_eq!(width, if number > 4 { 20 } else { 24 });
        }
    }
    // A number that Exif does not have, and Exif that ends early.
    assert_eq!(corners(&turned(PROGRESSIVE_JPEG, 9, true)).1, "rgbw");
    let mut short = turned(PROGRESSIVE_JPEG, 6, true);
    short[25] = 200;
    assert_eq!(corners(&short).1, "rgbw");
}

#[test]
fn a_resized_picture_is_the_mean_of_its_central_square() {
    let values = (0..6 * 4).map(|p| if p % 6 < 3 { 0.25 } else { 0.75 }).collect();
    let small = Grey { width: 6, height: 4, values }.resized(2);
    assert_eq!((small.width, small.height), (2, 2));
    assert!(small.values[0] < 0.4 && small.values[1] > 0.6, "{:?}", small.values);
    let mean: f32 = small.values.iter().sum::<f32>() / 4.0;
    assert!((mean - 0.5).abs() < 1e-3, "{:?}", small.values);
}

#[test]
fn each_kind_of_bad_picture_gets_its_line() {
    let whole = grey_png(20, &[0; 400]);
    let mut huge = whole.clone();
    huge[16..20].copy_from_slice(&100_000u32.to_be_bytes());
    let cases: [(&[u8], &str); 6] = [
        (b"", "found an empty file, expected a PNG or JPEG image"),
        (b"\x93NUMPY\x01\x00", "found a single NumPy array (.npy), expected a PNG or JPEG image"),
        (b"\xff\xd8\xff\xe0....", "damaged or cut short"),
        (b"hello there", "found a file of another kind, expected a PNG or JPEG image"),
        (&whole[..whole.len() / 2], "damaged or cut short"),
        (&huge, "expected a"),
    ];
    for (bytes, expected) in cases {
        let line = line(&read(bytes).unwrap_err(), "scene.png");
        assert!(line.contains(expected), "{line}\n{expected}");
    }
}

#[test]
fn no_damage_makes_the_reader_panic() {
    let levels: Vec<u8> = (0..81).map(|at| at / 9 * (at % 9)).collect();
    no_damage_panics(SMALL_JPEG);
    no_damage_panics(&grey_png(9, &levels));
}

fn no_damage_panics(whole: &[u8]) {
    for end in 0..whole.len() {
        if let Err(error) = read(&whole[..end]) {
            line(&error, "scene.png");
        }
    }
    for at in 0..whole.len() {
        let mut damaged = whole.to_vec();
        damaged[at] ^= 0x41;
        if let Err(error) = read(&damaged) {
            line(&error, "scene.png");
        }
    }
}

#[test]
fn damaged_labels_are_never_read_as_an_image() {
    // Another program has resized the picture and kept its text.
    let placed = Placed { left: 0, top: 0, cell: 1, width: 2, height: 2, black: 0.0, white: 1.0 };
    let picture = Canvas::new(4, 4, [0; 3]);
    for damaged in [
        Placed { cell: 0, ..placed },
        Placed { left: 3, ..placed },
        Placed { cell: u32::MAX, ..placed },
        Placed { width: 0, ..placed },
    ] {
        let told = line(
            &read(&encode_labelled(&picture, 1, Some(damaged), &provenance())).unwrap_err(),
            "scene.png",
        );
        assert!(told.contains("damaged labels"), "{told}");
    }
    let bytes = encode_labelled(&picture, 1, Some(placed), &provenance());
    assert_eq!(read(&bytes).unwrap().size_px, 2);
    let mut resized = Vec::new();
    let mut encoder = ::png::Encoder::new(&mut resized, 1, 1);
    encoder
        .add_text_chunk("nirspi-picture".into(), r#"{"size":[4,4],"images":1,"image":null}"#.into())
        .unwrap();
    encoder.write_header().unwrap().write_image_data(&[0]).unwrap();
    let told = line(&read(&resized).unwrap_err(), "scene.png");
    assert!(told.contains("resized"), "{told}");
}

#[test]
fn a_damaged_signature_is_no_other_kind_of_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let mut bytes = encode_grey(2, 2, &[0.5; 4], &provenance());
    bytes[6] ^= 1;
    std::fs::write(&path, bytes).unwrap();
    let error = read_grey(&path).unwrap_err().to_string();
    assert!(error.contains("found a PNG image with a damaged signature"), "{error}");
}

/// One bit a pixel in the file becomes three bytes a pixel: a file of some hundred bytes can ask for 768 MiB.
#[test]
fn a_picture_of_a_palette_that_would_take_too_much_memory_is_refused_before_it_takes_it() {
    let of_edge = |edge| {
        let mut bytes = Vec::new();
        let mut encoder = ::png::Encoder::new(&mut bytes, edge, edge);
        encoder.set_color(::png::ColorType::Indexed);
        encoder.set_depth(::png::BitDepth::One);
        encoder.set_palette(vec![0, 0, 0, 255, 255, 255]);
        let mut writer = encoder.write_header().unwrap();
        // The pixels are missing. A decoder that reports this has already taken the memory for them.
        writer.write_chunk(::png::chunk::IDAT, &[]).unwrap();
        drop(writer);
        line(&read(&bytes).unwrap_err(), "scene.png")
    };
    let told = of_edge(16_384);
    assert!(told.contains("too large (16384 x 16384 pixels)"), "{told}");
    assert!(told.contains("512 MiB in memory, decoded and as grey levels"), "{told}");
    let told = of_edge(16);
    assert!(!told.contains("too large"), "{told}");
}

/// The pixels of the file are missing, which only a decoder notices.
#[test]
fn a_picture_of_a_wrong_size_is_refused_before_a_pixel_is_decoded() {
    let mut bytes = Vec::new();
    let mut encoder = ::png::Encoder::new(&mut bytes, 8000, 8000);
    encoder.set_color(::png::ColorType::Grayscale);
    encoder.write_header().unwrap().write_chunk(::png::chunk::IDAT, &[]).unwrap();
    let (_folder, path) = file("scene.png", &bytes);
    let fits = |(width, height)| match width {
        8000 => Err(FileError::kind(&path, format!("{width} x {height}"), "64 x 64")),
        _ => Ok(()),
    };
    let told = line(&read_grey_if(&path, fits).map(|_| ()).unwrap_err(), "scene.png");
    assert!(told.contains("found 8000 x 8000, expected 64 x 64"), "{told}");
    let told = line(&read_grey(&path).map(|_| ()).unwrap_err(), "scene.png");
    assert!(!told.contains("8000"), "{told}");
}

#[test]
fn a_picture_of_few_colours_is_smaller_and_the_same() {
    let drawn = |colour: fn(u32, u32) -> [u8; 3]| {
        let mut canvas = Canvas::new(300, 200, [0; 3]);
        for (at, pixel) in (0..).zip(canvas.pixels_mut()) {
            *pixel = colour(at % 300, at / 300);
        }
        canvas
    };
    let few = drawn(|x, y| [(x / 3) as u8, 7, (y % 2) as u8]);
    let many = drawn(|x, y| [x as u8, y as u8, (x * y) as u8]);
    for (picture, color) in [(few, ColorType::Indexed), (many, ColorType::Rgb)] {
        let bytes = encode_rgb(&picture, &provenance());
        let mut decoder = ::png::Decoder::new(std::io::Cursor::new(&bytes));
        decoder.set_transformations(::png::Transformations::EXPAND);
        let mut reader = decoder.read_info().unwrap();
        assert_eq!(reader.info().color_type, color);
        let mut read = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut read).unwrap();
        assert_eq!(read, picture.pixels().as_flattened());
    }
}

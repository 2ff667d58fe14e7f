use super::super::testing::{file, line};
use super::*;
use crate::provenance::tests::provenance;
use ::image::{GrayImage, ImageBuffer, Luma, LumaA, Rgb, Rgba};

fn png(picture: impl Into<DynamicImage>) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.into().write_to(&mut bytes, ImageFormat::Png).unwrap();
    bytes.into_inner()
}

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
    let picture = ImageBuffer::from_fn(2, 2, |x, y| match (x, y) {
        (0, 0) => Rgb([255u8, 0, 0]),
        (1, 0) => Rgb([0, 255, 0]),
        (0, 1) => Rgb([0, 0, 255]),
        _ => Rgb([255, 255, 255]),
    });
    let map = read(&png(picture)).unwrap();
    for (found, wanted) in map.values.iter().zip([0.2126, 0.7152, 0.0722, 1.0]) {
        assert!((found - wanted).abs() < 1e-6, "{found} {wanted}");
    }
}

#[test]
fn every_kind_of_png_reads_alike() {
    let half = 128.0 / 255.0;
    let pictures: [DynamicImage; 6] = [
        ImageBuffer::from_pixel(2, 2, Luma([128u8])).into(),
        ImageBuffer::from_pixel(2, 2, Luma([128u16 * 257])).into(),
        ImageBuffer::from_pixel(2, 2, LumaA([128u8, 255])).into(),
        ImageBuffer::from_pixel(2, 2, Rgb([128u16 * 257; 3])).into(),
        ImageBuffer::from_pixel(2, 2, Rgba([128u8, 128, 128, 255])).into(),
        // A white pixel at half opacity before a black ground.
        ImageBuffer::from_pixel(2, 2, Rgba([255u8, 255, 255, 128])).into(),
    ];
    for picture in pictures {
        let map = read(&png(picture.clone())).unwrap();
        assert!(
            map.values.iter().all(|value| (value - half).abs() < 1e-5),
            "{:?}: {:?}",
            picture.color(),
            map.values
        );
    }
}

#[test]
fn a_wide_or_tall_picture_is_cropped_to_its_centre() {
    let wide = GrayImage::from_fn(7, 3, |x, _| Luma([x as u8]));
    let map = read(&png(wide)).unwrap();
    assert_eq!(map.size_px, 3);
    assert_eq!(
        map.values.iter().map(|v| (v * 255.0).round()).collect::<Vec<_>>(),
        [2.0, 3.0, 4.0].repeat(3)
    );
    let tall = GrayImage::from_fn(2, 6, |_, y| Luma([y as u8]));
    let levels: Vec<f32> =
        read(&png(tall)).unwrap().values.iter().map(|v| (v * 255.0).round()).collect();
    assert_eq!(levels, [2.0, 2.0, 3.0, 3.0]);
}

fn jpeg(picture: &GrayImage) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, ImageFormat::Jpeg).unwrap();
    bytes.into_inner()
}

#[test]
fn a_jpeg_is_read_the_way_up_that_it_says() {
    let picture = GrayImage::from_fn(16, 16, |_, y| Luma([if y < 8 { 200 } else { 40 }]));
    let upright = jpeg(&picture);
    let corners = |bytes: &[u8]| {
        let map = read(bytes).unwrap();
        assert_eq!(map.size_px, 16);
        [0, 15, 240, 255].map(|at| (map.values[at] * 255.0).round() as i32)
    };
    let near = |found: [i32; 4], expected: [i32; 4]| {
        assert!(
            found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 12),
            "{found:?} {expected:?}"
        );
    };
    near(corners(&upright), [200, 200, 40, 40]);
    // Exif orientation 6: the top of the scene is the stored picture's left side, turned a quarter
    // clockwise.
    let exif = b"Exif\0\0MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0";
    let length = u16::try_from(exif.len() + 2).unwrap().to_be_bytes();
    let turned = [&upright[..2], &[0xff, 0xe1], &length, exif, &upright[2..]].concat();
    near(corners(&turned), [40, 200, 40, 200]);
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
    let whole = png(GrayImage::new(20, 20));
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
    let picture = GrayImage::from_fn(9, 9, |x, y| Luma([(x * y) as u8]));
    for whole in [jpeg(&picture), png(picture)] {
        no_damage_panics(&whole);
    }
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
    let picture = RgbImage::new(4, 4);
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
    let few = RgbImage::from_fn(300, 200, |x, y| Rgb([(x / 3) as u8, 7, (y % 2) as u8]));
    let many = RgbImage::from_fn(300, 200, |x, y| Rgb([x as u8, y as u8, (x * y) as u8]));
    for (picture, color) in [(few, png::ColorType::Indexed), (many, png::ColorType::Rgb)] {
        let bytes = encode_rgb(&picture, &provenance());
        let header = png::Decoder::new(std::io::Cursor::new(&bytes)).read_info().unwrap();
        assert_eq!(header.info().color_type, color);
        assert_eq!(image::load_from_memory(&bytes).unwrap().to_rgb8(), picture);
    }
}

use super::super::testing::{file, line};
use super::*;
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
    let bytes = encode_grey(16, 16, &values);
    let map = read(&bytes).unwrap();
    assert_eq!(map.size_px, 16);
    for (found, wanted) in map.values.iter().zip(&values) {
        assert!((found - wanted).abs() < 1e-6, "{found} {wanted}");
    }
    assert_eq!(encode_grey(16, 16, &map.values), bytes);
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
        // White at half opacity before black.
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

#[test]
fn each_kind_of_bad_picture_gets_its_line() {
    let whole = png(GrayImage::new(20, 20));
    let mut huge = whole.clone();
    huge[16..20].copy_from_slice(&100_000u32.to_be_bytes());
    let cases: [(&[u8], &str); 5] = [
        (b"", "found an empty file, expected a PNG image"),
        (b"\xff\xd8\xff\xe0....", "found a JPEG image, expected a PNG image"),
        (b"hello there", "found a file of another kind, expected a PNG image"),
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
    let whole = png(GrayImage::from_fn(9, 9, |x, y| Luma([(x * y) as u8])));
    for end in 0..whole.len() {
        if let Err(error) = read(&whole[..end]) {
            line(&error, "scene.png");
        }
    }
    for at in 0..whole.len() {
        let mut damaged = whole.clone();
        damaged[at] ^= 0x41;
        if let Err(error) = read(&damaged) {
            line(&error, "scene.png");
        }
    }
}

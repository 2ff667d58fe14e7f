use super::*;
use crate::testing::provenance;
use nirspi_files::FileError;
use nirspi_files::image::{Reflectance, read_reflectance};

fn read(bytes: &[u8]) -> Result<Reflectance, FileError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.png");
    std::fs::write(&path, bytes).unwrap();
    read_reflectance(&path)
}

#[test]
fn a_picture_with_labels_is_read_as_the_image_in_it() {
    let values: Vec<f32> = (0..1024).map(|p| p as f32 / 1023.0).collect();
    let written = |range, unit| {
        let panel = Panel { range, ..Panel::square("image", 32, &values, unit) };
        read(&Figure::Images(panel.into()).png(&FigureStyle::Paper.look(), &provenance())).unwrap()
    };
    let found = written(Range::Unit, Unit::OfWhite);
    assert_eq!(found.size_px, 32);
    let off = |(a, b): (&f32, &f32)| (a - b).abs();
    assert!(found.values.iter().zip(&values).map(off).all(|off| off < 0.6 / 255.0));
    // Of a stretched image, all but the ends come back.
    let found = written(Range::Stretched, Unit::Reflectance);
    assert!(found.values.iter().zip(&values).map(off).all(|off| off < 0.01));
    // Counts have no white: the levels are read.
    let found = written(Range::Fixed(0.0, 0.5), Unit::AdcCounts);
    assert!((found.values[256] - 0.5).abs() < 0.01 && found.values[1023] == 1.0);
}

#[test]
fn labels_are_never_read_as_an_image() {
    let values = vec![0.5; 1024];
    let one = || Panel::square("image", 32, &values, Unit::OfWhite);
    let (header, footer) = (String::new(), String::new());
    let two = SideBySide { header, panels: vec![one(), one()], footer };
    let told = read(&Figure::Images(two).png(&FigureStyle::Paper.look(), &provenance()))
        .unwrap_err()
        .to_string();
    assert!(told.contains("a picture of 2 images with labels, expected one image"), "{told}");
    let sheet = Sheet::new(String::new(), (32, 32), vec![&values; 3], Unit::OfWhite);
    let told = read(&sheet.png(&FigureStyle::Paper.look(), &provenance())).unwrap_err().to_string();
    assert!(told.contains("a picture of 3 images"), "{told}");
}

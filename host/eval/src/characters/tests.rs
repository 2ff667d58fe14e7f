use super::*;
use crate::testing::provenance;
use nirspi::files::image::encode_grey;
use nirspi::files::{archive, npy};

/// (1, 64, 64) bytes of -1.
fn signed_bytes() -> Vec<u8> {
    let header = "{'descr': '|i1', 'fortran_order': False, 'shape': (1, 64, 64), }\n";
    let length = u16::try_from(header.len()).unwrap();
    [b"\x93NUMPY\x01\x00", &length.to_le_bytes()[..], header.as_bytes(), &[0xff; AREA_PX]].concat()
}

fn members() -> Vec<(&'static str, Vec<u8>)> {
    let mut x = vec![0.0; 3 * AREA_PX];
    x[AREA_PX + 40] = 200.0;
    vec![
        ("x", npy::encode(&[3, 64, 64], &x)),
        ("label", npy::encode(&[3], &[0_i64, 10, 61])),
        ("family", npy::encode(&[3], &[4_i64, 4, 9])),
    ]
}

fn read_members(members: &[(&str, Vec<u8>)]) -> Result<Vec<Stack>, FileError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("letters.npz");
    std::fs::write(&path, archive::encode(&path, members).unwrap()).unwrap();
    read(&path)
}

fn complaint(at: usize, member: (&'static str, Vec<u8>)) -> String {
    let mut members = members();
    members[at] = member;
    let line = read_members(&members).unwrap_err().to_string();
    assert!(line.contains("letters.npz") && !line.contains('\n'), "{line}");
    line
}

#[test]
fn a_stack_is_read_with_classes_and_groups() {
    let stacks = read_members(&members()).unwrap();
    let stack = &stacks[0];
    assert_eq!((stack.name(), stack.len(), stack.kind()), ("letters", 3, Kind::Drawn));
    assert_eq!(stack.groups(), [4, 4, 9]);
    assert_eq!((stack.label(1), stack.label(2)), (Some(10), Some(61)));
    assert_eq!(stack.image(1)[40], 200);
}

#[test]
fn fractions_are_levels_too_and_bright_rims_make_a_photograph() {
    let unit = npy::encode(&[2, 64, 64], &[0.5; 2 * AREA_PX]);
    let stacks = read_members(&[("x", unit)]).unwrap();
    assert_eq!(stacks[0].image(0)[7], 128);
    assert_eq!(stacks[0].kind(), Kind::Photograph);
    assert_eq!((stacks[0].label(0), stacks[0].groups()), (None, [0, 1].as_slice()));
}

#[test]
fn what_does_not_fit_is_named() {
    let text = complaint(0, ("images", npy::encode(&[1], &[0.0])));
    assert!(text.contains("no `x`") && text.contains("(N, 64, 64)"), "{text}");
    let text = complaint(0, ("x", npy::encode(&[1, 32, 32], &[0.0; 1024])));
    assert!(text.contains("`x` has shape (1, 32, 32)"), "{text}");
    let text = complaint(0, ("x", signed_bytes()));
    assert!(text.contains("`x` is -1 in image 0, expected 0 to 255"), "{text}");
    let text = complaint(1, ("label", npy::encode(&[3], &[0_i64, 62, 1])));
    assert!(text.contains("`label` is 62 at [1], expected whole numbers from 0 to 61"), "{text}");
    let text = complaint(2, ("family", npy::encode(&[2], &[0_i64, 1])));
    assert!(text.contains("`family` has shape (2,)"), "{text}");
}

/// A dark bar, 20 wide and 40 high, on a bright page.
fn page() -> Vec<u8> {
    let (width, height) = (120, 90);
    let bar = |at: usize| (30..50).contains(&(at % width)) && (10..50).contains(&(at / width));
    let values: Vec<f32> = (0..width * height).map(|at| if bar(at) { 0.0 } else { 1.0 }).collect();
    encode_grey(width, height, &values, &provenance())
}

#[test]
fn chars74k_is_read_as_its_authors_hand_it_out() {
    let folder = tempfile::tempdir().unwrap();
    for (sample, file) in [
        ("English/Fnt/Sample011", "img011-00005.png"),
        ("English/Fnt/Sample011", "img011-00009.png"),
        ("English/Hnd/Img/Sample001", "img001-033.png"),
        ("English/Img/GoodImg/Bmp/Sample062", "img062-00001.png"),
    ] {
        let sample = folder.path().join(sample);
        std::fs::create_dir_all(&sample).unwrap();
        std::fs::write(sample.join(file), page()).unwrap();
    }
    let stacks = read(folder.path()).unwrap();
    let told: Vec<_> =
        stacks.iter().map(|s| (s.name(), s.kind(), s.label(0), s.groups())).collect();
    assert_eq!(told[0], ("fnt", Kind::Drawn, Some(10), [1, 2].as_slice()));
    assert_eq!(told[1], ("hnd", Kind::Drawn, Some(0), [33].as_slice()));
    assert_eq!(told[2], ("img", Kind::Photograph, Some(61), [0].as_slice()));
    // The character is bright on dark, 24 x 48 pixels in the middle.
    let bright: Vec<usize> = (0..AREA_PX).filter(|&at| stacks[0].image(0)[at] > 128).collect();
    let columns = bright.iter().map(|at| at % SIDE_PX);
    assert_eq!((columns.clone().min(), columns.max()), (Some(20), Some(43)));
    assert_eq!((bright[0] / SIDE_PX, bright[bright.len() - 1] / SIDE_PX), (8, 55));
    // The rim of the photograph is bright, so the image is a negative.
    assert_eq!(stacks[2].image(0)[0], 0);
}

#[test]
fn folders_and_pages_that_hold_nothing_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let text = read(folder.path()).unwrap_err().to_string();
    assert!(text.contains("a folder without either"), "{text}");
    let sample = folder.path().join("Fnt/Sample001");
    std::fs::create_dir_all(&sample).unwrap();
    std::fs::write(sample.join("img001-00001.png"), encode_grey(8, 8, &[1.0; 64], &provenance()))
        .unwrap();
    let text = read(folder.path()).unwrap_err().to_string();
    assert!(text.contains("img001-00001.png: found an empty page"), "{text}");
    std::fs::rename(sample.join("img001-00001.png"), sample.join("a.png")).unwrap();
    assert!(read(folder.path()).unwrap_err().to_string().contains("a name without a number"));
    let missing = read(&folder.path().join("none")).unwrap_err().to_string();
    assert!(missing.ends_with("cannot read it: no such file or folder"), "{missing}");
}

use super::*;
use nirspi_files::identity::CameraIdentity;
use std::time::{Duration, UNIX_EPOCH};

fn image(of: impl Fn(usize) -> f32) -> Image {
    Image::new(Side::INSTRUMENT, (0..PIXELS).map(of).collect())
}

/// Light of an array with unequal LEDs, two of which are dead.
fn gains(at: usize) -> f32 {
    if at == 3 * 32 + 7 || at == 0 { 0.0 } else { 1.0 + 0.2 * (at as f32).sin() }
}

#[test]
fn equal_reflectance_comes_out_equal_and_dead_leds_take_their_neighbours() {
    let flat = FlatField::of_white(&image(|at| 500.0 * gains(at)), 1.0).unwrap();
    assert_eq!(flat.dead_leds(), [[0, 0], [3, 7]]);
    let ramp = |at: usize| (at / 32) as f32 + 10.0;
    let corrected = flat.correct(&image(|at| ramp(at) * gains(at)));
    let scale = corrected.pixels()[40] / ramp(40);
    assert!((scale - 1.0).abs() < 0.02, "white stays about as bright: {scale}");
    for at in 1..PIXELS {
        assert!((corrected.pixels()[at] / scale - ramp(at)).abs() < 1e-3, "{at}");
    }
    // The corner has one neighbour in its own row and two in the next row.
    let corner = corrected.pixels()[0] / scale;
    assert!((corner - (10.0 + 11.0 + 11.0) / 3.0).abs() < 1e-3, "{corner}");
}

#[test]
fn a_dark_frame_is_subtracted_where_it_is_more_than_noise() {
    let stray = |at: usize| if at == 100 { 50.0 } else { 0.0 };
    let white = image(|at| 500.0 * gains(at) + stray(at));
    let dark = image(|at| stray(at) + 0.5 * ((at % 7) as f32 - 3.0));
    let flat = FlatField::of_white(&white, 1.0).unwrap().with_dark(&dark, 1.0).unwrap();
    assert_eq!(flat.dark_pixels(), Some(1));
    let corrected = flat.correct(&image(|at| 100.0 * gains(at) + stray(at)));
    let [with, without] = [100, 101].map(|at| corrected.pixels()[at]);
    assert!((with / without - 1.0).abs() < 0.01, "{with} {without}");
}

#[test]
fn pattern_noise_is_what_two_images_share() {
    let noise = |seed: f32| move |at: usize| 100.0 + 10.0 * (at as f32 * seed).sin();
    let both = pattern_noise(&image(noise(1.0)), &image(noise(1.0)));
    assert!((both - 0.1 / 2.0_f64.sqrt()).abs() < 1e-3, "{both}");
    assert!(pattern_noise(&image(noise(1.0)), &image(noise(1.7))) < 0.01);
}

#[test]
fn what_is_no_white_sheet_is_refused() {
    let half = FlatField::of_white(&image(|at| if at < 512 { 100.0 } else { 0.0 }), 1.0);
    assert!(half.unwrap_err().to_string().contains("fills the field"));
    assert!(FlatField::of_white(&image(|_| 0.0), 1.0).is_err());
    let nan = FlatField::of_white(&image(|at| if at == 5 { f32::NAN } else { 1.0 }), 1.0);
    assert!(nan.unwrap_err().to_string().contains("white_counts[5] is NaN"));
}

#[test]
fn an_image_of_another_size_stays_as_it_is() {
    let flat = FlatField::of_white(&image(gains), 0.1).unwrap();
    let small = Image::new(Side::new(16).unwrap(), vec![3.0; 256]);
    assert_eq!(flat.correct(&small).pixels(), small.pixels());
}

fn camera(serial: &str) -> CameraIdentity {
    CameraIdentity::current("virtual", serial)
}

fn kept() -> KeptFlatField {
    let flat = FlatField::of_white(&image(|at| 500.0 * gains(at)), 1.0).unwrap();
    let measured = Measured { flat, pattern_before: 0.1, pattern_after: 0.005, noise: 0.002 };
    let when = UNIX_EPOCH + Duration::from_secs(1_795_163_400);
    KeptFlatField::new(camera("A 1"), measured, Sweeps::of_map(800), when)
}

#[test]
fn a_flat_field_comes_back_as_it_was_and_names_dead_leds() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("made/a.flat.json");
    kept().keep(Some(&path)).unwrap();
    let back = KeptFlatField::read(&path, &camera("A 1")).unwrap();
    assert_eq!(back, kept());
    let summary = back.summary();
    assert!(summary.contains("2 dead LEDs (row 0 column 0, row 3 column 7)"), "{summary}");
    assert!(summary.contains("10.00 %") && summary.contains("0.50 %"), "{summary}");
    // New firmware or gateware changes neither LEDs nor lens.
    let newer = CameraIdentity { gateware: "9.9.9".into(), ..camera("A 1") };
    KeptFlatField::read(&path, &newer).unwrap();
    // The date comes from the seconds, whatever the file's words for it are.
    let text = std::fs::read_to_string(&path).unwrap();
    let words = text.replacen("\"measured\":\"20", "\"measured\":\"\\u001b[2J", 1);
    assert_ne!(words, text);
    std::fs::write(&path, words).unwrap();
    assert_eq!(KeptFlatField::read(&path, &camera("A 1")).unwrap().summary(), summary);
}

#[test]
fn an_old_or_foreign_flat_field_is_refused_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.flat.json");
    let refused = |camera: &CameraIdentity| {
        let line = KeptFlatField::read(&path, camera).unwrap_err().to_string();
        assert_eq!(line.lines().count(), 1, "{line}");
        line
    };
    kept().keep(Some(&path)).unwrap();
    assert!(refused(&camera("B2")).contains("serial number A 1, this camera has B2"));
    let other = CameraIdentity { board: "nucleo".into(), ..camera("A 1") };
    assert!(refused(&other).contains("board virtual, this camera has nucleo"));
    let text = std::fs::read_to_string(&path).unwrap();
    for (old, new, words) in [
        ("\"version\":1", "\"version\":0", "format 0, expected 1"),
        ("nirspi flat field", "nirspi calibration", "expected a flat field"),
        ("\"white_counts\":[", "\"white_counts\":[1.0,", "holds 1025 pixels, expected 1024"),
    ] {
        std::fs::write(&path, text.replacen(old, new, 1)).unwrap();
        let line = refused(&camera("A 1"));
        assert!(line.contains(words), "{line}");
    }
    std::fs::write(&path, "{}").unwrap();
    assert!(refused(&camera("A 1")).contains("expected a flat field"));
}

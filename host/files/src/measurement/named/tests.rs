use super::*;
use crate::measurement::{PatternSelection, Selection};
use crate::measurement::{Plain, read_plain};
use crate::testing::{Zip, file, noise, npy, npy_f64, zip};
use nirspi_own::OwnMatrix;
use nirspi_recon::reconstruct::{MatrixMethod, MatrixSettings};
use std::f64::consts::TAU;

fn size(height: usize, width: usize) -> Size {
    Size::new(height, width).unwrap()
}

/// A scene without any symmetry.
fn scene(size: Size) -> Vec<f64> {
    (0..size.area()).map(|at| ((at * 37 + at * at * 11) % 23) as f64 + at as f64 / 9.0).collect()
}

fn see(patterns: &Patterns, scene: &[f64], dark: f64) -> Vec<f64> {
    let one = |weights: &[f64]| dark + weights.iter().zip(scene).map(|(w, x)| w * x).sum::<f64>();
    patterns.weights.chunks_exact(patterns.size.area()).map(one).collect()
}

fn image(found: &Plain) -> Vec<f32> {
    let kept = found.patterns.select(&found.places);
    let own = OwnMatrix::new(found.patterns.size, &kept).unwrap();
    let settings =
        MatrixSettings { dark: found.dark, ..MatrixSettings::new(MatrixMethod::PseudoInverse) };
    own.reconstruct(&found.values, &settings).unwrap().image.pixels().to_vec()
}

fn read(
    set: &str,
    shape: &str,
    y: &[f64],
    of: Option<Size>,
    want: &Selection,
) -> Result<Plain, crate::FileError> {
    let (_folder, path) = file("y.npz", &zip(Zip::Stored, &[("y.npy", npy_f64(shape, y))]));
    let patterns = PatternSelection { size: of, ..PatternSelection::default() };
    read_plain(Path::new(set), &patterns, &path, want)
}

fn assert_shows(found: &Plain, scene: &[f64]) {
    let image = image(found);
    let worst = image.iter().zip(scene).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max);
    assert!(worst < 1e-3, "{worst}");
}

#[test]
fn a_scene_behind_a_set_gives_its_image() {
    for (height, width) in [(6, 8), (5, 7), (2, 6)] {
        let size = size(height, width);
        let scene = scene(size);
        for steps in [3, 4] {
            let patterns = NamedPatterns::Fourier { steps }.patterns(Some(size)).unwrap();
            assert!(patterns.weights.iter().all(|weight| (-1e-12..=1.0 + 1e-12).contains(weight)));
            let y = see(&patterns, &scene, 5.0);
            let set = format!("fourier:{steps}");
            let want = Selection::default();
            let whole = format!("({height}, {width}, {steps})");
            let found = read(&set, &whole, &y, None, &want).unwrap();
            assert_shows(&found, &scene);
            assert_eq!((found.values.len(), found.dark), (size.area(), false));
            // One axis in time order, and the steps first.
            let line = format!("({},)", y.len());
            assert_shows(&read(&set, &line, &y, Some(size), &want).unwrap(), &scene);
            let frequencies = size.area();
            let first: Vec<f64> =
                (0..y.len()).map(|at| y[at % frequencies * steps + at / frequencies]).collect();
            let shape = format!("({steps}, {height}, {width})");
            assert_shows(&read(&set, &shape, &first, None, &want).unwrap(), &scene);
            // Half of the plane.
            let half = width / 2 + 1;
            let kept: Vec<f64> =
                (0..y.len()).filter(|at| at / steps % width < half).map(|at| y[at]).collect();
            let shape = format!("({},)", kept.len());
            let found = read(&set, &shape, &kept, Some(size), &want).unwrap();
            assert_shows(&found, &scene);
        }
    }
    for order in [7, 15, 35, 63] {
        let set = NamedPatterns::SMatrix { order };
        let patterns = set.patterns(None).unwrap();
        let scene = scene(patterns.size);
        let y = see(&patterns, &scene, 0.0);
        let found = read(&set.to_string(), &format!("({order},)"), &y, None, &Selection::default())
            .unwrap();
        assert_shows(&Plain { dark: false, ..found }, &scene);
    }
}

#[test]
fn a_spectrum_is_known_by_its_zero_frequency() {
    let size = size(6, 8);
    let scene = scene(size);
    let coefficient = |v: usize, u: usize| {
        let part = |of: fn(f64) -> f64| -> f64 {
            (0..48)
                .map(|at| {
                    scene[at]
                        * of(TAU * ((v * (at / 8)) as f64 / 6.0 + (u * (at % 8)) as f64 / 8.0))
                })
                .sum()
        };
        (part(f64::cos), -part(f64::sin))
    };
    let spectrum: Vec<(f64, f64)> = (0..48).map(|at| coefficient(at / 8, at % 8)).collect();
    let middle: Vec<(f64, f64)> =
        (0..48).map(|at| coefficient((at / 8 + 3) % 6, (at % 8 + 4) % 8)).collect();
    for (values, note) in
        [(&spectrum, None), (&middle, Some("the zero frequency is in the middle"))]
    {
        let (_folder, path) = complex(values);
        let found = read_plain(
            Path::new("fourier:4"),
            &PatternSelection::default(),
            &path,
            &Selection::default(),
        )
        .unwrap();
        assert_shows(&found, &scene);
        assert_eq!(
            found.notes.iter().any(|said| note.is_some_and(|note| said.contains(note))),
            note.is_some()
        );
    }
    // A frequency that was not read is left out, and its opposite takes its place.
    let mut holes = spectrum.clone();
    holes[9] = (f64::NAN, 0.0);
    let (_folder, path) = complex(&holes);
    let found = read_plain(
        Path::new("fourier:3"),
        &PatternSelection::default(),
        &path,
        &Selection::default(),
    )
    .unwrap();
    assert_eq!((found.not_read.as_slice(), found.values.len()), (&[9][..], 48));
    assert_shows(&found, &scene);
    // No light has a frequency larger than the zero frequency.
    let mut wrong = spectrum;
    wrong[9].0 = 1e9;
    let (_folder, path) = complex(&wrong);
    let found = read_plain(
        Path::new("fourier:4"),
        &PatternSelection::default(),
        &path,
        &Selection::default(),
    )
    .unwrap();
    assert!(found.notes[0].contains("frequency [1, 1] is larger"), "{:?}", found.notes);
}

/// A file of a (6, 8) spectrum.
fn complex(values: &[(f64, f64)]) -> (tempfile::TempDir, std::path::PathBuf) {
    let header = "{'descr': '<c16', 'fortran_order': False, 'shape': (6, 8), }";
    let pad = 64 - (10 + header.len() + 1) % 64;
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    let text = format!("{header}{}\n", " ".repeat(pad));
    bytes.extend((text.len() as u16).to_le_bytes());
    bytes.extend(text.as_bytes());
    values.iter().for_each(|(real, imaginary)| {
        bytes.extend(real.to_le_bytes());
        bytes.extend(imaginary.to_le_bytes());
    });
    file("spectrum.npy", &bytes)
}

#[test]
fn what_is_no_set_or_does_not_fit_is_refused_in_one_line() {
    let told = |set: &str, shape: &str, count: usize, of: Option<Size>| {
        let error =
            read(set, shape, &vec![1.0; count], of, &Selection::default()).unwrap_err().to_string();
        assert_eq!(error.lines().count(), 1, "{error}");
        error
    };
    assert!(
        told("fourier:5", "(64,)", 64, None)
            .contains("expected fourier:3, fourier:4, or s-matrix:N")
    );
    assert!(told("s-matrix:9", "(9,)", 9, None).contains("a prime of the form 4 k - 1"));
    let other = told("s-matrix:15", "(15,)", 15, Some(size(4, 4)));
    assert!(other.contains("15 pixels for s-matrix:15, such as 3x5"), "{other}");
    let other = told("s-matrix:15", "(14,)", 14, None);
    assert!(other.contains("expected (15,) or (..., 15)"), "{other}");
    let other = told("fourier:4", "(65,)", 65, None);
    assert!(other.contains("has shape (65), expected (height, width, 4)"), "{other}");
    assert!(told("fourier:4", "(64,)", 64, Some(size(8, 8))).contains("has shape (64)"));
}

/// Readings that were taken several times tell the noise of a row: steps of a frequency, and frequencies that are opposite.
#[test]
fn steps_and_opposite_frequencies_tell_the_noise() {
    let size = size(12, 14);
    // That of numbers between -1/2 and 1/2.
    let spread = 1.0_f64 / 12.0;
    for steps in [3, 4] {
        let patterns = NamedPatterns::Fourier { steps }.patterns(Some(size)).unwrap();
        let clear = see(&patterns, &scene(size), 5.0);
        let noise_of = |y: &[f64], shape: &str| {
            let set = format!("fourier:{steps}");
            read(&set, shape, y, Some(size), &Selection::default()).unwrap().most_noise
        };
        let whole = format!("(12, 14, {steps})");
        assert!(noise_of(&clear, &whole).is_some_and(|noise| noise < 1e-9));
        let y: Vec<f64> = clear.iter().enumerate().map(|(at, y)| y + noise(at)).collect();
        let found = noise_of(&y, &whole).unwrap();
        // A part is the difference of two readings, or of three the weighted sum.
        let expected =
            spread.sqrt() * if steps == 4 { 2.0_f64.sqrt() } else { (8.0_f64 / 3.0).sqrt() };
        assert!((found / expected - 1.0).abs() < 0.2, "{steps}: {found}, {expected}");
        // Half of the plane has opposite frequencies in its first and its last column.
        let half: Vec<f64> =
            (0..y.len()).filter(|at| at / steps % 14 < 8).map(|at| y[at]).collect();
        let found = noise_of(&half, &format!("(12, 8, {steps})")).unwrap();
        assert!((found / expected - 1.0).abs() < 0.5, "{steps}: {found}, {expected}");
    }
    // A complex spectrum of which one half is a copy, and one whose halves were measured.
    let parts = |wobble: f64| -> Vec<u8> {
        let of = |at: usize| {
            let opposite = (12 - at / 14) % 12 * 14 + (14 - at % 14) % 14;
            let (first, sign) = (at.min(opposite), if opposite < at { -1.0 } else { 1.0 });
            let imaginary = if at == opposite { 0.0 } else { sign * (first % 7) as f64 };
            [(first % 11) as f64 + wobble * noise(at), imaginary + wobble * noise(168 + at)]
        };
        (0..168).flat_map(of).flat_map(f64::to_le_bytes).collect()
    };
    for (wobble, is_known) in [(0.0, false), (0.1, true)] {
        let bytes = npy("'<c16'", false, "(12, 14)", &parts(wobble));
        let (_folder, path) = file("y.npy", &bytes);
        let (of, want) = (PatternSelection::default(), Selection::default());
        let found = read_plain(Path::new("fourier:4"), &of, &path, &want).unwrap();
        assert_eq!(found.most_noise.is_some(), is_known, "{wobble}");
    }
}

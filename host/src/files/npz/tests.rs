use super::super::testing::{Zip, file, line, npy, npy_f64, npy_i32, zip};
use super::*;
use proptest::prelude::*;

const PAIRS: Selection = Selection { index: None, non_differential: false };

/// Members of a good 2 x 2 file; each test spoils one.
fn good() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("n.npy", npy_i32("()", &[2])),
        ("h_row.npy", npy_i32("(3,)", &[0, 3, 1])),
        ("y.npy", npy_f64("(6,)", &[5.0, 1.0, 2.0, 3.0, 4.0, 4.5])),
        ("d.npy", npy_f64("(3,)", &[4.0, -1.0, -0.5])),
        ("recon.npy", npy_f64("(2, 2)", &[1.0, 2.0, 3.0, 4.0])),
        // Text and pickled objects, not to be looked at.
        ("meta.npy", npy("'<U3'", false, "()", b"m\0\0\0e\0\0\0t\0\0\0")),
        ("notes.npy", npy("'|O'", false, "(1,)", b"\x80\x04not a pickle")),
        ("torn.npy", b"no array at all".to_vec()),
    ]
}

/// The good file with one member replaced, added, or (empty bytes) removed.
fn with(name: &'static str, bytes: Vec<u8>) -> Vec<(&'static str, Vec<u8>)> {
    let mut members = good();
    members.retain(|(other, _)| *other != name);
    if !bytes.is_empty() {
        members.push((name, bytes));
    }
    members
}

fn read_bytes(bytes: &[u8], want: Selection) -> Result<MeasurementFile, FileError> {
    let (_guard, path) = file("lab.npz", bytes);
    read(&path, want)
}

fn read_members(
    members: &[(&str, Vec<u8>)],
    want: Selection,
) -> Result<MeasurementFile, FileError> {
    read_bytes(&zip(Zip::Stored, members), want)
}

fn refusal(members: &[(&str, Vec<u8>)], want: Selection) -> String {
    line(&read_members(members, want).unwrap_err(), "lab.npz")
}

#[test]
fn a_good_file_reads_however_it_was_zipped() {
    for how in [Zip::Stored, Zip::Zip64, Zip::Deflated] {
        let found = read_bytes(&zip(how, &good()), PAIRS).unwrap();
        assert_eq!(found.h_row.side().pixels(), 2, "{how:?}");
        assert_eq!(*found.h_row, [0, 3, 1]);
        assert_eq!(found.readings, Readings::Pairs(vec![5.0, 1.0, 2.0, 3.0, 4.0, 4.5]));
        assert_eq!(found.reference.unwrap().pixels(), [1.0, 2.0, 3.0, 4.0]);
        assert!(found.notes.is_empty());
    }
}

#[test]
fn differences_are_taken_where_there_are_no_raw_readings() {
    let found = read_members(&with("y.npy", vec![]), PAIRS).unwrap();
    assert_eq!(found.readings, Readings::Differential(vec![4.0, -1.0, -0.5]));
}

#[test]
fn one_of_several_measurements_is_chosen_by_index() {
    let several = npy_i32("(2, 3)", &[1, 2, 3, 4, 5, 6]);
    let mut members = with("y.npy", vec![]);
    members.retain(|(name, _)| *name != "d.npy");
    members.push(("d.npy", several));
    let index = |index| Selection { index: Some(index), ..PAIRS };
    let second = read_members(&members, index(1)).unwrap();
    assert_eq!(second.readings, Readings::Differential(vec![4.0, 5.0, 6.0]));
    let line = refusal(&members, PAIRS);
    assert!(
        line.ends_with("lab.npz: `d` holds 2 measurements: choose one with --index 0..1"),
        "{line}"
    );
    let line = refusal(&members, index(2));
    assert!(line.ends_with("found no index 2 among them: choose one with --index 0..1"), "{line}");
    let line = refusal(&good(), index(1));
    assert!(
        line.ends_with(
            "`y` holds 1 measurement, found no index 1 among them, expected --index 0 or none"
        ),
        "{line}"
    );
    assert!(read_members(&good(), index(0)).is_ok());
}

#[test]
fn raw_readings_of_several_measurements_are_chosen_in_any_memory_order() {
    // Rows 0..6 and 10..16, stored column by column.
    let columns: Vec<u8> = (0..6).flat_map(|k| [k, k + 10]).collect();
    let members = with("y.npy", npy("'|u1'", true, "(2, 6)", &columns));
    let found = read_members(&members, Selection { index: Some(1), ..PAIRS }).unwrap();
    assert_eq!(found.readings, Readings::Pairs(vec![10.0, 11.0, 12.0, 13.0, 14.0, 15.0]));
}

#[test]
fn single_readings_are_taken_only_when_asked_for() {
    let single = Selection { non_differential: true, ..PAIRS };
    let members = with("y.npy", npy_f64("(3,)", &[1.0, 2.0, 3.0]));
    assert_eq!(
        read_members(&members, single).unwrap().readings,
        Readings::Single(vec![1.0, 2.0, 3.0])
    );
    let line = refusal(&members, PAIRS);
    assert!(
        line.contains(
            "`y` has shape (3,), expected (6,) or (measurements, 6): a +, - pair a row; \
             one reading a row is read with --non-differential"
        ),
        "{line}"
    );
    let line = refusal(&good(), single);
    assert!(
        line.contains("`y` has shape (6,)") && line.ends_with("leave out --non-differential"),
        "{line}"
    );
    let line = refusal(&with("y.npy", vec![]), single);
    assert!(line.contains("no `y` in it") && line.contains("--non-differential"), "{line}");
}

#[test]
fn each_bad_field_gets_a_line_that_names_it() {
    let big = npy("'<f8'", false, "(1000000000000,)", &[]);
    let cases: Vec<(&'static str, Vec<u8>, &str)> = vec![
        (
            "n.npy",
            vec![],
            "no `n` in it, found `d`, `h_row`, `meta`, `notes`, `recon`, `torn`, `y`; \
             expected n, h_row, and y or d",
        ),
        ("n.npy", npy_i32("()", &[3]), "`n` is 3, expected a power of two from 2 to 256"),
        ("n.npy", npy_i32("(1,)", &[512]), "`n` is 512, expected a power of two from 2 to 256"),
        ("n.npy", npy_i32("(1,)", &[-2]), "`n` is -2, expected"),
        ("n.npy", npy_f64("()", &[2.5]), "`n` is 2.5, expected"),
        ("n.npy", npy_f64("()", &[f64::NAN]), "`n` is NaN, expected"),
        ("n.npy", npy_i32("(2,)", &[2, 2]), "`n` has shape (2,), expected one number"),
        ("n.npy", npy_i32("(0,)", &[]), "`n` has shape (0,), expected one number"),
        (
            "n.npy",
            npy("'<U1'", false, "()", &[50, 0, 0, 0]),
            "`n` is of type '<U1', expected real numbers",
        ),
        ("h_row.npy", vec![], "no `h_row` in it"),
        (
            "h_row.npy",
            npy_i32("(0,)", &[]),
            "`h_row` has shape (0,), expected (M,) with M from 1 to 4 for n = 2",
        ),
        (
            "h_row.npy",
            npy_i32("(5,)", &[0, 1, 2, 3, 0]),
            "`h_row` has shape (5,), expected (M,) with M from 1 to 4",
        ),
        ("h_row.npy", npy_i32("(3, 1)", &[0, 1, 2]), "`h_row` has shape (3, 1), expected (M,)"),
        (
            "h_row.npy",
            npy_i32("(3,)", &[0, 1, 4]),
            "`h_row` is 4 at [2], expected a whole number from 0 to 3 for n = 2",
        ),
        (
            "h_row.npy",
            npy_i32("(3,)", &[0, -1, 2]),
            "`h_row` is -1 at [1], expected a whole number from 0 to 3",
        ),
        (
            "h_row.npy",
            npy_f64("(3,)", &[0.0, 1.5, 2.0]),
            "`h_row` is 1.5 at [1], expected a whole number",
        ),
        (
            "h_row.npy",
            npy_f64("(3,)", &[0.0, f64::NAN, 2.0]),
            "`h_row` is NaN at [1], expected a whole number",
        ),
        (
            "h_row.npy",
            npy_i32("(3,)", &[2, 1, 2]),
            "`h_row` repeats row 2 at [2], first at [0], expected each row once",
        ),
        (
            "h_row.npy",
            npy("'<c16'", false, "(3,)", &[0; 48]),
            "`h_row` is of type '<c16', expected real numbers",
        ),
        ("h_row.npy", big.clone(), "`h_row` has shape (1000000000000,), expected (M,)"),
        (
            "y.npy",
            npy_f64("(5,)", &[0.0; 5]),
            "`y` has shape (5,), expected (6,) or (measurements, 6): a +, - pair a row",
        ),
        ("y.npy", npy_f64("()", &[0.0]), "`y` has shape (), expected (6,)"),
        ("y.npy", npy_f64("(0, 6)", &[]), "`y` has shape (0, 6), expected (6,)"),
        ("y.npy", npy_f64("(1, 1, 6)", &[0.0; 6]), "`y` has shape (1, 1, 6), expected (6,)"),
        (
            "y.npy",
            npy_f64("(6,)", &[0.0, 1.0, f64::NAN, 3.0, 4.0, 5.0]),
            "`y` is NaN at [2], expected finite numbers",
        ),
        (
            "y.npy",
            npy_f64("(1, 6)", &[0.0, 1.0, f64::NEG_INFINITY, 3.0, 4.0, 5.0]),
            "`y` is -inf at [0, 2], expected finite",
        ),
        (
            "y.npy",
            npy("[('a', '<f8')]", false, "(6,)", &[0; 48]),
            "`y` is a structured array, expected real numbers",
        ),
        (
            "y.npy",
            npy("'<f8'", false, "(100000000000, 6)", &[]),
            "`y` claims shape (100000000000, 6), expected at most 256 MiB",
        ),
        (
            "y.npy",
            npy("'<f8'", false, "(6,)", &[0; 40]),
            "damaged or cut short (`y`: 40 of 48 bytes of data)",
        ),
        (
            "y.npy",
            npy("'<f8'", false, "(6,)", &[0; 56]),
            "damaged or cut short (`y`: more than the 48 bytes of data",
        ),
        ("y.npy", b"hello".to_vec(), "damaged or cut short (`y`: it ends inside its header)"),
        (
            "d.npy",
            npy_f64("(4,)", &[0.0; 4]),
            "`d` has shape (4,), expected (3,) or (measurements, 3): one difference a row",
        ),
        (
            "d.npy",
            npy_f64("(3,)", &[0.0, f64::INFINITY, 0.0]),
            "`d` is inf at [1], expected finite numbers",
        ),
    ];
    for (name, bytes, expected) in cases {
        let line = refusal(&with(name, bytes), PAIRS);
        assert!(line.contains(expected), "{line}\n{expected}");
    }
    let neither: Vec<_> =
        good().into_iter().filter(|(name, _)| !["y.npy", "d.npy"].contains(name)).collect();
    let line = refusal(&neither, PAIRS);
    assert!(
        line.contains("no `d` in it")
            && line.ends_with("expected y (raw readings) or d (differential)"),
        "{line}"
    );
    let pairs_as_d: Vec<_> =
        with("y.npy", vec![]).into_iter().filter(|(name, _)| *name != "d.npy").collect();
    let line = refusal(&[pairs_as_d, vec![("d.npy", npy_f64("(6,)", &[0.0; 6]))]].concat(), PAIRS);
    assert!(line.ends_with("+, - pairs belong in `y`"), "{line}");
}

#[test]
fn a_useless_reconstruction_is_a_note_not_an_error() {
    for bytes in [
        npy_f64("(3,)", &[0.0; 3]),
        npy_f64("(2, 2)", &[0.0, 1.0, f64::NAN, 0.0]),
        b"torn".to_vec(),
    ] {
        let found = read_members(&with("recon.npy", bytes), PAIRS).unwrap();
        assert_eq!((found.reference, found.notes.len()), (None, 1), "{:?}", found.notes);
        assert!(found.notes[0].contains("`recon`"), "{:?}", found.notes);
    }
}

#[test]
fn what_is_no_archive_is_named_for_what_it_is() {
    let cases: [(&[u8], &str); 5] = [
        (b"", "found an empty file, expected a NumPy .npz archive"),
        (b"k,d\n0,1.5\n", "found a file of another kind, expected a NumPy .npz archive"),
        (b"\x93NUMPY\x01\x00", "found a single NumPy array (.npy), expected a NumPy .npz archive"),
        (b"\x89MCAP0\r\n", "found a recording (MCAP), expected a NumPy .npz archive"),
        (b"PK\x03\x04", "damaged or cut short"),
    ];
    for (bytes, expected) in cases {
        let line = line(&read_bytes(bytes, PAIRS).unwrap_err(), "lab.npz");
        assert!(line.contains(expected), "{line}\n{expected}");
    }
    let folder = tempfile::tempdir().unwrap();
    let line_of = |path: &Path| read(path, PAIRS).unwrap_err().to_string();
    assert!(line_of(folder.path()).ends_with("found a folder, expected a NumPy .npz archive"));
    assert!(
        line_of(&folder.path().join("none.npz"))
            .ends_with("none.npz: cannot read it: no such file or folder")
    );
}

#[test]
fn a_file_cut_anywhere_is_refused() {
    for how in [Zip::Stored, Zip::Zip64, Zip::Deflated] {
        let whole = zip(how, &good());
        for end in 0..whole.len() {
            line(&read_bytes(&whole[..end], PAIRS).expect_err("a cut file"), "lab.npz");
        }
    }
}

#[test]
fn a_changed_reading_is_caught_by_the_checksum() {
    let mut bytes = zip(Zip::Stored, &good());
    let five = 5f64.to_le_bytes();
    let at = bytes.windows(8).position(|window| window == five).unwrap();
    bytes[at] ^= 1;
    let line = line(&read_bytes(&bytes, PAIRS).unwrap_err(), "lab.npz");
    assert!(line.contains("damaged or cut short (`y`: Invalid checksum)"), "{line}");
}

proptest! {
    #[test]
    fn damage_is_harmless_or_refused(
        how in prop::sample::select(vec![Zip::Stored, Zip::Zip64, Zip::Deflated]),
        hits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6),
    ) {
        let mut bytes = zip(how, &good());
        for (at, byte) in hits {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        match read_bytes(&bytes, PAIRS) {
            // Checksums leave three ways to differ: `y` or `recon` renamed away, and what they do
            // not cover.
            Ok(found) => {
                prop_assert_eq!(found.h_row.as_slice(), [0, 3, 1]);
                match found.readings {
                    Readings::Pairs(y) => prop_assert_eq!(y, [5.0, 1.0, 2.0, 3.0, 4.0, 4.5]),
                    Readings::Differential(d) => prop_assert_eq!(d, [4.0, -1.0, -0.5]),
                    Readings::Single(_) => prop_assert!(false, "nobody asked for single readings"),
                }
            }
            Err(error) => {
                line(&error, "lab.npz");
            }
        }
    }
}

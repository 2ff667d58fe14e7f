mod shapes;
mod stack;
mod taken;

use super::super::testing::{Zip, file, line, npy, npy_f64, npy_i32, zip};
use super::*;
use proptest::prelude::*;

/// A selection with nothing set: all information comes from the file.
fn as_is() -> Selection {
    Selection::default()
}

fn form(form: Form) -> Selection {
    Selection { form: Some(form), ..as_is() }
}

fn shown(order: Order) -> Selection {
    Selection { shown: Some(order), ..as_is() }
}

/// Members of a good 2 x 2 file; each test spoils one.
fn good() -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("n.npy", npy_i32("()", &[2])),
        ("h_row.npy", npy_i32("(3,)", &[0, 3, 1])),
        ("y.npy", npy_f64("(6,)", &[5.0, 1.0, 2.0, 3.0, 4.0, 4.5])),
        ("d.npy", npy_f64("(3,)", &[4.0, -1.0, -0.5])),
        ("recon.npy", npy_f64("(2, 2)", &[1.0, 2.0, 3.0, 4.0])),
        // Text and pickled objects, which the reader must ignore.
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

fn read_bytes(bytes: &[u8], want: &Selection) -> Result<MeasurementFile, FileError> {
    let (_guard, path) = file("lab.npz", bytes);
    read(&path, want)
}

fn read_members(
    members: &[(&str, Vec<u8>)],
    want: &Selection,
) -> Result<MeasurementFile, FileError> {
    read_bytes(&zip(Zip::Stored, members), want)
}

fn refusal(members: &[(&str, Vec<u8>)], want: &Selection) -> String {
    line(&read_members(members, want).unwrap_err(), "lab.npz")
}

#[test]
fn a_good_file_reads_however_it_was_zipped() {
    for how in [Zip::Stored, Zip::Zip64, Zip::Deflated] {
        let found = read_bytes(&zip(how, &good()), &as_is()).unwrap();
        assert_eq!(found.h_row.side().pixels(), 2, "{how:?}");
        assert_eq!(*found.h_row, [0, 3, 1]);
        assert_eq!(found.readings, Readings::Pairs(vec![5.0, 1.0, 2.0, 3.0, 4.0, 4.5]));
        assert_eq!(found.reference.unwrap().real.pixels(), [1.0, 2.0, 3.0, 4.0]);
        assert!(found.notes.is_empty());
    }
}

#[test]
fn bytes_that_would_become_gigabytes_of_numbers_are_refused_before_they_are_read() {
    // 90 MiB in the file, 720 MiB as numbers; zeros are packed a thousandfold.
    let y = npy("'|u1'", true, "(31457280, 3)", &[]);
    let refused = refusal(&with("d.npy", y), &Selection { field: Some("d".into()), ..as_is() });
    assert!(
        refused.contains("`d` claims shape (31457280, 3), expected at most 512 MiB"),
        "{refused}"
    );
}

#[test]
fn differences_are_taken_where_there_are_no_raw_readings() {
    let found = read_members(&with("y.npy", vec![]), &as_is()).unwrap();
    assert_eq!(found.readings, Readings::Differential(vec![4.0, -1.0, -0.5]));
}

#[test]
fn one_of_several_measurements_is_chosen_by_index() {
    let several = npy_i32("(2, 3)", &[1, 2, 3, 4, 5, 6]);
    let mut members = with("y.npy", vec![]);
    members.retain(|(name, _)| *name != "d.npy");
    members.push(("d.npy", several));
    let index = |index| Selection { index: Some(index), ..as_is() };
    let second = read_members(&members, &index(1)).unwrap();
    assert_eq!(second.readings, Readings::Differential(vec![4.0, 5.0, 6.0]));
    let line = refusal(&members, &as_is());
    assert!(
        line.ends_with("lab.npz: `d` holds 2 measurements: choose one with --index 0..1"),
        "{line}"
    );
    let line = refusal(&members, &index(2));
    assert!(line.ends_with("found no index 2 among them: choose one with --index 0..1"), "{line}");
    let line = refusal(&good(), &index(1));
    assert!(
        line.ends_with(
            "`y` holds 1 measurement, found no index 1 among them, expected --index 0 or none"
        ),
        "{line}"
    );
    assert!(read_members(&good(), &index(0)).is_ok());
}

#[test]
fn raw_readings_of_several_measurements_are_chosen_in_any_memory_order() {
    // Rows 0..6 and 10..16, stored column by column.
    let columns: Vec<u8> = (0..6).flat_map(|k| [k, k + 10]).collect();
    let members = with("y.npy", npy("'|u1'", true, "(2, 6)", &columns));
    let found = read_members(&members, &Selection { index: Some(1), ..as_is() }).unwrap();
    assert_eq!(found.readings, Readings::Pairs(vec![10.0, 11.0, 12.0, 13.0, 14.0, 15.0]));
}

#[test]
fn single_readings_are_taken_only_when_asked_for() {
    let single = &form(Form::Single);
    let members = with("y.npy", npy_f64("(3,)", &[1.0, 2.0, 3.0]));
    assert_eq!(
        read_members(&members, single).unwrap().readings,
        Readings::Single(vec![1.0, 2.0, 3.0])
    );
    let line = refusal(&members, &as_is());
    assert!(
        line.contains(
            "`y` has shape (3,), expected (6,) or (..., 6): a +, - pair a row; one reading a row is \
             read with --readings single, one difference a row with --readings differences"
        ),
        "{line}"
    );
    let line = refusal(&good(), single);
    assert!(
        line.contains("`y` has shape (6,)")
            && line.ends_with("leave out --readings single (--non-differential)"),
        "{line}"
    );
    let line = refusal(&with("y.npy", vec![]), single);
    assert!(line.contains("no `y` in it") && line.contains("`d` holds differences"), "{line}");
}

#[test]
fn each_bad_field_gets_a_line_that_names_it() {
    let big = npy("'<f8'", false, "(1000000000000,)", &[]);
    let cases: Vec<(&'static str, Vec<u8>, &str)> = vec![
        (
            "n.npy",
            vec![],
            "no `n` in it, found `d`, `h_row`, `meta`, `notes`, `recon`, `torn`, `y`; \
             expected n, h_row, and y or d; or --side N",
        ),
        ("n.npy", npy("'<c16'", false, "()", &[0; 16]), "`n` has complex numbers, expected real"),
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
            "`h_row` has shape (0,), expected (M,) or (2, 2) for n = 2",
        ),
        ("h_row.npy", npy_i32("(3, 2)", &[0; 6]), "`h_row` has shape (3, 2), expected (M,)"),
        (
            "h_row.npy",
            npy_i32("(3,)", &[0, 1, 4]),
            "`h_row` is 4 at [2], expected a whole number from 0 to 3 for n = 2",
        ),
        (
            "h_row.npy",
            npy_i32("(3,)", &[-1, -1, -9]),
            "`h_row` has no row that was read, expected a whole number from 0 to 3",
        ),
        (
            "h_row.npy",
            npy_i32("(4,)", &[4, 1, -1, 2]),
            "or negative or NaN if not read; counted from 1, each is one too many",
        ),
        (
            "h_row.npy",
            npy_f64("(3,)", &[0.0, 1.5, 2.0]),
            "`h_row` is 1.5 at [1], expected a whole number",
        ),
        (
            "h_row.npy",
            npy("'<c16'", false, "(3,)", &[0; 48]),
            "`h_row` has complex numbers, expected real numbers",
        ),
        ("h_row.npy", big.clone(), "`h_row` claims shape (1000000000000,), expected at most"),
        (
            "y.npy",
            npy_f64("(5,)", &[0.0; 5]),
            "`y` has shape (5,), expected (6,) or (..., 6): a +, - pair a row",
        ),
        ("y.npy", npy_f64("()", &[0.0]), "`y` has shape (), expected (6,)"),
        ("y.npy", npy_f64("(0, 6)", &[]), "`y` has shape (0, 6), expected (6,)"),
        (
            "y.npy",
            npy_f64("(6, 2)", &[0.0; 12]),
            "`y` has shape (6, 2), expected (6,) or (..., 6): a +, - pair a row; patterns are along its first axis: \
             add --patterns-first",
        ),
        (
            "y.npy",
            npy_f64("(6,)", &[f64::NAN; 6]),
            "`y` has no pattern that was read: all are NaN or too large, expected finite readings",
        ),
        (
            "y.npy",
            npy_f64("(1, 6)", &[0.0, 1.0, f64::NEG_INFINITY, 3.0, 4.0, 5.0]),
            "`y` is -inf at [2], expected finite numbers, or NaN for a pattern that was not read",
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
    ];
    for (name, bytes, expected) in cases {
        let line = refusal(&with(name, bytes), &as_is());
        assert!(line.contains(expected), "{line}\n{expected}");
    }
    let neither: Vec<_> =
        good().into_iter().filter(|(name, _)| !["y.npy", "d.npy"].contains(name)).collect();
    let line = refusal(&neither, &as_is());
    assert!(
        line.contains("no `d` in it")
            && line.ends_with("expected y (raw readings) or d (differential), or --field NAME"),
        "{line}"
    );
    let pairs_as_d: Vec<_> =
        with("y.npy", vec![]).into_iter().filter(|(name, _)| *name != "d.npy").collect();
    let line =
        refusal(&[pairs_as_d, vec![("d.npy", npy_f64("(6,)", &[0.0; 6]))]].concat(), &as_is());
    assert!(line.ends_with("+, - pairs are read with --readings pairs"), "{line}");
}

#[test]
fn a_useless_reconstruction_is_a_note_not_an_error() {
    for bytes in [
        npy_f64("(3,)", &[0.0; 3]),
        npy_f64("(2, 2)", &[0.0, 1.0, f64::NAN, 0.0]),
        b"torn".to_vec(),
    ] {
        let found = read_members(&with("recon.npy", bytes), &as_is()).unwrap();
        assert_eq!((found.reference, found.notes.len()), (None, 1), "{:?}", found.notes);
        assert!(found.notes[0].contains("`recon`"), "{:?}", found.notes);
    }
}

#[test]
fn what_is_no_measurement_file_is_named_for_what_it_is() {
    let cases: [(&[u8], &str); 14] = [
        (b"", "found an empty file, expected measurements: .npz, .npy, .mat"),
        (b"\x00\x01\x02\x03", "found a file of another kind, expected measurements"),
        (
            b"k,d\n0,1.5\n",
            "no `h_row` in it, found `k`, `d`; expected n, h_row, and y or d, or --field h_row=NAME",
        ),
        (b"\x93NUMPY\x01\x00", "damaged or cut short"),
        (b"\x89MCAP0\r\n", "found a recording (MCAP), expected measurements"),
        (b"PK\x03\x04", "damaged or cut short"),
        (b"TDSm\x0e\0\0\0\x69\x12", "found a TDMS file of LabVIEW (two lines of Python"),
        (b"\x0f\x0f:WFM#003", "found a waveform file of Tektronix (.wfm; save it as CSV)"),
        (b"RIFF\x24\0\0\0WAVEfmt ", "found a WAV file that ends before its samples do"),
        (b"\x80\x04\x95\0", "found a pickle of Python (save its array with NumPy)"),
        (b"(lp0\nF1.5\naF2.5\na.", "found a pickle of Python (save its array with NumPy)"),
        (b"{\"y\": [1.5, 2.5]}", "found a JSON text (save its numbers as CSV)"),
        (b"\x1f\x8b\x08\0", "found a gzip file (unpack it)"),
        (b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1", "found an old workbook of Excel (.xls"),
    ];
    for (bytes, expected) in cases {
        let line = line(&read_bytes(bytes, &as_is()).unwrap_err(), "lab.npz");
        assert!(line.contains(expected), "{line}\n{expected}");
    }
    let folder = tempfile::tempdir().unwrap();
    let line_of = |path: &Path| read(path, &as_is()).unwrap_err().to_string();
    assert!(line_of(folder.path()).contains("found a folder, expected measurements: .npz"));
    assert!(
        line_of(&folder.path().join("none.npz"))
            .ends_with("none.npz: cannot read it: no such file or folder")
    );
}

#[test]
fn patterns_that_were_not_read_are_named_and_left_out() {
    let nan = f64::NAN;
    // A pattern is lost if one reading of its pair is missing.
    let members = with("y.npy", npy_f64("(6,)", &[5.0, 1.0, nan, 3.0, 4.0, 4.5]));
    let found = read_members(&members, &as_is()).unwrap();
    assert_eq!(found.h_row.as_slice(), [0, 1]);
    assert_eq!(found.readings, Readings::Pairs(vec![5.0, 1.0, 4.0, 4.5]));
    assert_eq!((found.places, found.not_read), (vec![0, 2], vec![1]));
    for unread in [npy_i32("(3, 1)", &[0, -1, 1]), npy_f64("(1, 3)", &[0.0, nan, 1.0])] {
        let found = read_members(&with("h_row.npy", unread), &as_is()).unwrap();
        assert_eq!(found.h_row.as_slice(), [0, 1]);
        assert_eq!(found.readings, Readings::Pairs(vec![5.0, 1.0, 4.0, 4.5]));
        assert_eq!(found.not_read, [1]);
    }
}

#[test]
fn readings_may_have_any_leading_axes_and_come_in_halves_or_pattern_by_pattern() {
    let six = [5.0, 1.0, 2.0, 3.0, 4.0, 4.5];
    for shape in ["(1, 1, 6)", "(6, 1)", "(1, 6, 1)"] {
        let found = read_members(&with("y.npy", npy_f64(shape, &six)), &as_is()).unwrap();
        assert_eq!(found.readings, Readings::Pairs(six.to_vec()), "{shape}");
    }
    let halves = with("y.npy", npy_f64("(6,)", &[5.0, 2.0, 4.0, 1.0, 3.0, 4.5]));
    let found = read_members(&halves, &form(Form::Halves)).unwrap();
    assert_eq!(found.readings, Readings::Pairs(six.to_vec()));
    let by_pattern: Vec<f64> = six.iter().flat_map(|&v| [v, 10.0 + v]).collect();
    let want = Selection { patterns_first: true, index: Some(1), ..as_is() };
    let found = read_members(&with("y.npy", npy_f64("(6, 2)", &by_pattern)), &want).unwrap();
    assert_eq!(found.readings, Readings::Pairs(six.map(|v| 10.0 + v).to_vec()));
    let line = refusal(&good(), &want);
    assert!(line.contains("`y` holds 1 measurement"), "{line}");
    let all = Selection { patterns_first: true, ..as_is() };
    let members = with("y.npy", npy_f64("(2, 6)", &[0.0; 12]));
    let line = refusal(&members, &all);
    assert!(
        line.ends_with("patterns are along its last axis: leave out --patterns-first"),
        "{line}"
    );
}

#[test]
fn complex_readings_keep_both_parts() {
    let parts: Vec<u8> =
        (0..6).flat_map(|k| [k as f32, -(k as f32)]).flat_map(f32::to_le_bytes).collect();
    let members = with("y.npy", npy("'<c8'", false, "(6,)", &parts));
    let found = read_members(&members, &as_is()).unwrap();
    assert_eq!(found.readings, Readings::Pairs(vec![0.0, 1.0, 2.0, 3.0, 4.0, 5.0]));
    assert_eq!(found.imaginary, Some(Readings::Pairs(vec![-0.0, -1.0, -2.0, -3.0, -4.0, -5.0])));
}

#[test]
fn an_order_gives_the_rows_of_readings_alone_and_is_never_guessed() {
    let alone = |count: usize| npy_f64(&format!("({count},)"), &vec![1.0; count]);
    let read_alone = |count, want: &Selection| {
        let (_guard, path) = file("y.npy", &alone(count));
        read(&path, want).map_err(|error| line(&error, "y.npy"))
    };
    let sequency = shown("walsh-2d".parse().unwrap());
    let found = read_alone(32, &sequency).unwrap();
    assert_eq!(
        (found.h_row.side().pixels(), found.h_row.as_slice()[..4].to_vec()),
        (4, vec![0, 2, 3, 1])
    );
    let part = Selection { side: Some(Side::new(4).unwrap()), ..sequency.clone() };
    assert_eq!(
        read_alone(10, &part).unwrap().h_row.as_slice(),
        found.h_row.as_slice()[..5].to_vec()
    );
    let transposed = Selection { transpose: true, ..sequency.clone() };
    assert_eq!(read_alone(32, &transposed).unwrap().h_row.as_slice()[..4], [0, 8, 12, 4]);
    // The only array of a file is the readings, whatever its name.
    let (_guard, path) = file("y.npz", &zip(Zip::Stored, &[("arr_0.npy", alone(32))]));
    assert_eq!(read(&path, &sequency).unwrap().h_row, found.h_row);
    let refusals = [
        (
            30,
            &sequency,
            "has 30 readings, of 15 patterns (a +, - pair a row), expected those of a full sweep",
        ),
        (31, &sequency, "has 31 readings a measurement, expected an even number"),
        (
            16,
            &sequency,
            "one value a pattern is read with --readings single or --readings differences",
        ),
        (
            34,
            &part,
            "has 34 readings, of 17 patterns (a +, - pair a row), expected at most 16 patterns for n = 4",
        ),
        (32, &shown(Order::Table(vec![0, 1])), "`--shown`"),
        (32, &as_is(), "no `h_row` in it, found `one array without a name`"),
    ];
    for (count, want, expected) in refusals {
        let line = read_alone(count, want).unwrap_err();
        assert!(line.contains(expected), "{line}\n{expected}");
    }
    let line = refusal(&good(), &sequency);
    assert!(line.ends_with("`h_row` is in the file, expected no --shown beside it"), "{line}");
    let line = refusal(&good(), &Selection { side: Side::new(4).ok(), ..as_is() });
    assert!(line.ends_with("`n` is 2, expected 4 as --side says"), "{line}");
    let line = refusal(&good(), &Selection { field: Some("z".to_owned()), ..as_is() });
    assert!(
        line.contains("`z` is not in the file, expected --field with one of d, h_row"),
        "{line}"
    );
}

#[test]
fn a_file_cut_anywhere_is_refused() {
    for how in [Zip::Stored, Zip::Zip64, Zip::Deflated] {
        let whole = zip(how, &good());
        for end in 0..whole.len() {
            line(&read_bytes(&whole[..end], &as_is()).expect_err("a cut file"), "lab.npz");
        }
    }
}

#[test]
fn a_changed_reading_is_caught_by_the_checksum() {
    let mut bytes = zip(Zip::Stored, &good());
    let five = 5f64.to_le_bytes();
    let at = bytes.windows(8).position(|window| window == five).unwrap();
    bytes[at] ^= 1;
    let line = line(&read_bytes(&bytes, &as_is()).unwrap_err(), "lab.npz");
    assert!(line.contains("damaged or cut short (`y`: Invalid checksum)"), "{line}");
}

#[test]
fn a_workbook_is_told_apart_from_an_archive_of_arrays() {
    for (member, kind) in [("xl/workbook.xml", "Excel"), ("content.xml", "OpenDocument")] {
        let bytes = zip(Zip::Stored, &[(member, b"<x/>".to_vec())]);
        let line = line(&read_bytes(&bytes, &as_is()).unwrap_err(), "lab.npz");
        assert!(line.contains(kind) && line.contains("save it as CSV"), "{line}");
    }
    let bytes = zip(Zip::Stored, &[("y\n.csv", b"1".to_vec())]);
    let line = line(&read_bytes(&bytes, &as_is()).unwrap_err(), "lab.npz");
    assert!(line.contains("a zip archive without arrays, with \"y\\n.csv\" in it"), "{line}");
}

#[test]
fn tensors_of_pytorch_are_told_apart_from_an_archive_of_arrays() {
    let bytes = zip(Zip::Stored, &[("sweep/data.pkl", b"\x80\x02".to_vec())]);
    let line = line(&read_bytes(&bytes, &as_is()).unwrap_err(), "lab.npz");
    assert!(line.contains("found tensors of PyTorch (save the array with NumPy)"), "{line}");
}

#[test]
fn a_side_that_is_the_number_of_pixels_is_a_note() {
    let rows: Vec<i32> = (0..16).collect();
    let d: Vec<f64> = rows.iter().map(|&row| 20.0 - f64::from(row)).collect();
    let of = |n| {
        let members = [
            ("n.npy", npy_i32("()", &[n])),
            ("h_row.npy", npy_i32("(16,)", &rows)),
            ("d.npy", npy_f64("(16,)", &d)),
        ];
        read_members(&members, &as_is()).unwrap().notes
    };
    assert_eq!(of(16), ["n is 16 and the 16 rows are those of a sweep of 4 x 4, whose n is 4"]);
    assert!(of(4).is_empty() && of(8).is_empty());
}

#[test]
fn what_is_left_out_of_a_text_is_a_note() {
    let rows = (0..16).map(|row| format!("4,{row},{}.5,ok\n", 20 - row)).collect::<String>();
    let (_guard, path) = file("log.csv", format!("a bench\nn,h_row,d,word\n{rows}").as_bytes());
    let found = read(&path, &as_is()).unwrap();
    let Readings::Differential(d) = &found.readings else { panic!("{:?}", found.readings) };
    assert!(d.iter().eq((0..16).map(|row| f64::from(20 - row) + 0.5).collect::<Vec<_>>().iter()));
    let told = "left out of the text: 1 line before the table; columns that hold words: `word`";
    assert_eq!(found.notes, [told]);
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
        match read_bytes(&bytes, &as_is()) {
            // With checksums, two kinds of difference remain: `y` or `recon` is renamed, or the
            // damage is outside the checksums.
            Ok(found) => {
                prop_assert_eq!(found.h_row.as_slice(), [0, 3, 1]);
                match found.readings {
                    Readings::Pairs(y) => prop_assert_eq!(y, [5.0, 1.0, 2.0, 3.0, 4.0, 4.5]),
                    Readings::Differential(d) => prop_assert_eq!(d, [4.0, -1.0, -0.5]),
                    Readings::Single(_) => prop_assert!(false, "single readings without --readings single"),
                }
            }
            Err(error) => {
                line(&error, "lab.npz");
            }
        }
    }
}

/// Readings of a 2 x 2 sweep of pairs, as lines.
const LINES: [f64; 8] = [10.0, 0.5, 6.0, 4.0, 7.0, 3.0, 5.5, 4.5];

fn of_text(content: &str, field: Option<&str>) -> Result<(Vec<f64>, String), String> {
    let (_folder, path) = file("scope.csv", content.as_bytes());
    let field = field.map(str::to_owned);
    let found = read(&path, &Selection { field, ..shown(Order::Natural) });
    let found = found.map_err(|error| line(&error, "scope.csv"))?;
    Ok((found.readings.values().to_vec(), found.notes.join("; ")))
}

fn lines(of: impl Fn(usize, f64) -> String) -> String {
    LINES.iter().enumerate().map(|(at, &y)| of(at, y) + "\n").collect()
}

#[test]
fn a_column_that_counts_is_no_readings_and_that_is_told() {
    let told = "left out: columns that count in even steps: ";
    let scope = format!("Second,CH1\n{}", lines(|at, y| format!("{:.3},{y}", at as f64 * 1e-3)));
    assert_eq!(of_text(&scope, None), Ok((LINES.to_vec(), format!("{told}`Second`"))));
    // Without a heading, as some oscilloscopes write it: columns have numbers.
    let scope = lines(|at, y| format!("{at},{y}"));
    assert_eq!(of_text(&scope, None), Ok((LINES.to_vec(), format!("{told}`1`"))));
    // Two columns that do not count are not chosen among, and a named one is taken as it is.
    let two = format!("t,CH1,CH2\n{}", lines(|at, y| format!("{at},{y},{}", 9.0 - y)));
    assert!(of_text(&two, None).unwrap_err().contains("found `t`, `CH1`, `CH2`"));
    assert_eq!(of_text(&two, Some("CH1")), Ok((LINES.to_vec(), String::new())));
    // Readings with units are words, and what is left is the number of a line.
    let words = format!("Sample,Mean\n{}", lines(|at, y| format!("{at},{y} mV")));
    let refused = of_text(&words, None).unwrap_err();
    assert!(refused.contains("`Sample` counts in even steps"), "{refused}");
}

#[test]
fn two_columns_of_one_name_are_pattern_and_complement() {
    let pairs: String =
        LINES.as_chunks::<2>().0.iter().map(|[on, off]| format!("{on},{off}\n")).collect();
    let text = format!("y,y\n{pairs}");
    let (readings, notes) = of_text(&text, None).unwrap();
    assert_eq!(readings, LINES);
    assert!(notes.ends_with("the columns `y` are pattern and complement"), "{notes}");
    let volts = format!("volt,volt\n{pairs}");
    assert_eq!(of_text(&volts, Some("volt,volt")).unwrap().0, LINES);
}

#[test]
fn what_stands_beside_the_readings_in_their_group_belongs_to_them() {
    let mut members = with("y.npy", Vec::new());
    for member in &mut members {
        member.0 = match member.0 {
            "n.npy" => "run/n.npy",
            "h_row.npy" => "run/h_row.npy",
            "d.npy" => "run/volts.npy",
            other => other,
        };
    }
    let (_folder, path) = file("lab.npz", &zip(Zip::Stored, &members));
    for field in ["run/volts", "/run/volts"] {
        let want = Selection { field: Some(field.to_owned()), ..form(Form::Differences) };
        let found = read(&path, &want).unwrap();
        assert_eq!((found.h_row.as_slice(), found.h_row.side().pixels()), (&[0, 3, 1][..], 2));
    }
}

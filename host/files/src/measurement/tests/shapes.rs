//! Shapes in which benches keep pattern and complement, spectra and repeated patterns.

use super::super::*;
use super::{Zip, as_is, file, line, npy_f64, npy_i32, read_members, shown, zip};

/// The readings of the four patterns of 2 x 2, and of their complements.
const PAIRS: [f64; 8] = [9.0, 1.0, 6.0, 4.0, 5.0, 5.5, 7.0, 3.0];

fn field(name: &str, want: Selection) -> Selection {
    Selection { field: Some(name.to_owned()), ..want }
}

/// A file of 2 x 2 with these fields and rows.
fn of(
    rows: Vec<u8>,
    fields: Vec<(&'static str, Vec<u8>)>,
    want: &Selection,
) -> Result<MeasurementFile, FileError> {
    let always = vec![("n.npy", npy_i32("()", &[2])), ("h_row.npy", rows)];
    read_members(&[always, fields].concat(), want)
}

fn rows() -> Vec<u8> {
    npy_i32("(4,)", &[0, 1, 2, 3])
}

#[test]
fn pattern_and_complement_side_by_side_are_pairs() {
    let both = of(rows(), vec![("y.npy", npy_f64("(4, 2)", &PAIRS))], &as_is()).unwrap();
    assert_eq!(both.readings, Readings::Pairs(PAIRS.to_vec()));
    let square = npy_i32("(2, 2)", &[0, 1, 2, 3]);
    let spectrum = vec![("y.npy", npy_f64("(2, 2, 2)", &PAIRS))];
    let both = of(square.clone(), spectrum, &as_is()).unwrap();
    assert_eq!(both.readings, Readings::Pairs(PAIRS.to_vec()));
    let d = vec![("d.npy", npy_f64("(2, 2)", &[8.0, 2.0, -0.5, 4.0]))];
    let both = of(square, d, &as_is()).unwrap();
    assert_eq!(both.readings, Readings::Differential(vec![8.0, 2.0, -0.5, 4.0]));
    // Without rows in the file, and several measurements.
    let pairs = [PAIRS.map(|v| v + 1.0), PAIRS].concat();
    let members = vec![("y.npy", npy_f64("(2, 4, 2)", &pairs))];
    let want = Selection { index: Some(1), ..shown(Order::Natural) };
    let second = read_members(&members, &want).unwrap();
    assert_eq!(second.readings, Readings::Pairs(PAIRS.to_vec()));
}

/// A spectrum without rows is one measurement where its side is said, or where its rows are no sweeps.
#[test]
fn a_spectrum_alone_is_known_by_its_side() {
    let alone = |shape: &str, count: u32, form, side: Option<u64>, index| {
        let values: Vec<f64> = (0..count).map(|at| f64::from(at * 7 % 13)).collect();
        let side = side.map(|side| Side::new(side).unwrap());
        let (form, want) = (Some(form), shown(Order::Natural));
        let want = Selection { form, side, index, ..want };
        let found = read_members(&[("spectrum.npy", npy_f64(shape, &values))], &want);
        let found = found.map_err(|error| line(&error, "lab.npz"))?;
        Ok::<_, String>((found.h_row.side().pixels(), found.readings.values() == values))
    };
    for (shape, count, form) in [
        ("(8, 8)", 64, Form::Differences),
        ("(8, 8)", 64, Form::Single),
        ("(8, 8, 2)", 128, Form::Pairs),
        ("(1, 8, 8, 1)", 64, Form::Differences),
    ] {
        for side in [None, Some(8)] {
            assert_eq!(alone(shape, count, form, side, None), Ok((8, true)), "{shape} {side:?}");
        }
    }
    for (shape, count, form) in
        [("(16, 16)", 256, Form::Differences), ("(16, 16, 2)", 512, Form::Pairs)]
    {
        assert_eq!(alone(shape, count, form, Some(16), None), Ok((16, true)), "{shape}");
        // They may be 16 sweeps of 4 x 4, too.
        let told = alone(shape, count, form, None, None).unwrap_err();
        let both = "choose one with --index 0..15, or say --side 16 for one spectrum of 16 x 16";
        assert!(told.contains(both), "{told}");
        assert_eq!(alone(shape, count, form, None, Some(3)), Ok((4, false)), "{shape}");
    }
    // Several spectra are chosen by their index.
    for (shape, count, side) in [("(3, 8, 8)", 192, None), ("(3, 16, 16)", 768, Some(16))] {
        let told = alone(shape, count, Form::Single, side, None).unwrap_err();
        assert!(told.ends_with("choose one with --index 0..2"), "{told}");
        let (n, _) = alone(shape, count, Form::Single, side, Some(2)).unwrap();
        assert_eq!(3 * n * n, count as usize, "{shape}");
    }
    // No spectrum: halves, other sides.
    assert!(alone("(8, 8)", 64, Form::Halves, None, None).is_err());
    assert!(
        alone("(8, 8)", 64, Form::Single, Some(16), None).unwrap_err().contains("--index 0..7")
    );
}

#[test]
fn two_fields_are_named_together() {
    let [plus, minus] = [0, 1].map(|side| PAIRS.iter().skip(side).step_by(2).copied());
    let [plus, minus] = [plus, minus].map(|values| npy_f64("(4,)", &values.collect::<Vec<_>>()));
    let fields = vec![("lit.npy", plus), ("dark.npy", minus)];
    let want = field("lit,dark", as_is());
    let both = of(rows(), fields.clone(), &want).unwrap();
    assert_eq!(both.readings, Readings::Pairs(PAIRS.to_vec()));
    let columns: String =
        PAIRS.chunks(2).map(|pair| format!("{},{}\n", pair[0], pair[1])).collect();
    let (_guard, path) = file("bench.csv", format!("positive,negative\n{columns}").as_bytes());
    let want = field("positive, negative", shown(Order::Natural));
    assert_eq!(read(&path, &want).unwrap().readings, Readings::Pairs(PAIRS.to_vec()));

    let refused = |fields, want| line(&of(rows(), fields, &want).unwrap_err(), "lab.npz");
    let short = vec![fields[0].clone(), ("dark.npy", npy_f64("(3,)", &[0.0; 3]))];
    let found = refused(short, field("lit,dark", as_is()));
    assert!(found.contains("`dark` has shape (3,), expected (4,) as `lit`"), "{found}");
    let found = refused(fields.clone(), field("lit,darkness", as_is()));
    assert!(found.contains("`lit,darkness` is not in the file"), "{found}");
    let single = Selection { form: Some(Form::Single), ..field("lit,dark", as_is()) };
    let found = refused(fields, single);
    assert!(found.contains("names two fields, expected --readings pairs"), "{found}");
}

#[test]
fn readings_with_a_sign_are_pairs() {
    // The complement of row 1 comes before its pattern.
    let readings = npy_f64("(8,)", &[9.0, 1.0, 4.0, 6.0, 5.0, 5.5, 7.0, 3.0]);
    let sign = npy_i32("(8,)", &[1, -1, -1, 1, 1, -1, 1, -1]);
    let both_rows = npy_i32("(8,)", &[0, 0, 1, 1, 2, 2, 3, 3]);
    let fields = vec![("v.npy", readings.clone()), ("sign.npy", sign.clone())];
    let found = of(both_rows.clone(), fields.clone(), &field("v", as_is())).unwrap();
    assert_eq!(
        (&*found.h_row, found.readings),
        (&[0, 1, 2, 3][..], Readings::Pairs(PAIRS.to_vec()))
    );
    assert_eq!(found.notes, ["pairs of pattern and complement by the field `sign`"]);
    // Without rows, the k-th pattern belongs to the k-th complement.
    let found = read_members(&fields, &field("v", shown(Order::Natural))).unwrap();
    assert_eq!(found.readings, Readings::Pairs(PAIRS.to_vec()));

    let lonely = vec![("v.npy", readings), ("sign.npy", npy_i32("(8,)", &[1; 8]))];
    let found = of(both_rows, lonely, &field("v", as_is())).unwrap_err();
    let found = line(&found, "lab.npz");
    assert!(found.contains("`sign` has a pattern at [0] and no complement for it"), "{found}");
    // A field of that name that is no sign of readings.
    let other = vec![("y.npy", npy_f64("(8,)", &PAIRS)), ("sign.npy", npy_i32("()", &[1]))];
    let found = of(rows(), other, &as_is()).unwrap();
    assert_eq!(found.readings, Readings::Pairs(PAIRS.to_vec()));
}

#[test]
fn a_pattern_that_was_shown_several_times_has_the_mean_of_its_readings() {
    let twice = npy_i32("(5,)", &[0, 3, 0, 1, 0]);
    let d = |values: [f64; 5]| vec![("d.npy", npy_f64("(5,)", &values))];
    let found = of(twice.clone(), d([8.0, 4.0, 9.0, 2.0, 10.0]), &as_is()).unwrap();
    assert_eq!(*found.h_row, [0, 3, 1]);
    assert_eq!(found.readings, Readings::Differential(vec![9.0, 4.0, 2.0]));
    assert_eq!((found.places, found.patterns), (vec![0, 1, 3], 5));
    assert_eq!(found.notes, ["one pattern was shown 3 times: the mean of its readings is used"]);
    // What was not read does not count.
    let found = of(twice.clone(), d([f64::NAN, 4.0, 9.0, f64::NAN, 10.0]), &as_is()).unwrap();
    assert_eq!((&*found.h_row, found.places), (&[3, 0][..], vec![1, 2]));
    assert_eq!(found.readings, Readings::Differential(vec![4.0, 9.5]));
    assert_eq!(found.not_read, [0, 3]);
    // Pairs, and halves.
    let y = npy_f64("(10,)", &[9.0, 1.0, 7.0, 3.0, 11.0, 2.0, 6.0, 4.0, 10.0, 3.0]);
    let found = of(twice.clone(), vec![("y.npy", y)], &as_is()).unwrap();
    assert_eq!(found.readings, Readings::Pairs(vec![10.0, 2.0, 7.0, 3.0, 6.0, 4.0]));
    let halves = npy_f64("(10,)", &[9.0, 7.0, 11.0, 6.0, 10.0, 1.0, 3.0, 2.0, 4.0, 3.0]);
    let want = Selection { form: Some(Form::Halves), ..as_is() };
    let found = of(twice.clone(), vec![("y.npy", halves)], &want).unwrap();
    assert_eq!(found.readings, Readings::Pairs(vec![10.0, 2.0, 7.0, 3.0, 6.0, 4.0]));
    // Several measurements are read one by one.
    let frames = npy_f64("(2, 5)", &[8.0, 4.0, 9.0, 2.0, 10.0, 1.0, 1.0, 1.0, 1.0, 4.0]);
    let members = [("n.npy", npy_i32("()", &[2])), ("h_row.npy", twice), ("d.npy", frames)];
    let (_guard, path) = file("lab.npz", &zip(Zip::Stored, &members));
    let mut several = Several::open(&path, &as_is()).unwrap();
    assert!(several.stack().unwrap().is_none());
    let all: Vec<_> = several.each().unwrap();
    assert_eq!(all[1].readings, Readings::Differential(vec![2.0, 1.0, 1.0]));
}

/// White references have no row, and are no patterns: there may be more readings than the image has pixels.
#[test]
fn rows_below_zero_are_left_out_before_patterns_are_counted() {
    let rows = npy_i32("(7,)", &[-1, 0, 1, -1, 2, 3, -1]);
    let d = vec![("d.npy", npy_f64("(7,)", &[99.0, 8.0, 2.0, 99.0, -0.5, 4.0, 99.0]))];
    let found = of(rows, d, &as_is()).unwrap();
    assert_eq!((&*found.h_row, found.not_read), (&[0, 1, 2, 3][..], vec![0, 3, 6]));
    assert_eq!(found.readings, Readings::Differential(vec![8.0, 2.0, -0.5, 4.0]));
}

#[test]
fn one_pattern_is_a_measurement_however_many_axes_it_has() {
    for shape in ["(1,)", "(1, 1)"] {
        let d = vec![("d.npy", npy_f64(shape, &[4.0]))];
        let found = of(npy_i32("(1,)", &[0]), d, &as_is()).unwrap();
        assert_eq!(found.readings, Readings::Differential(vec![4.0]), "{shape}");
    }
}

#[test]
fn fields_of_other_names_are_named() {
    let members = [
        ("volts.npy", npy_f64("(8,)", &PAIRS)),
        ("shown.npy", rows()),
        ("side.npy", npy_i32("()", &[2])),
    ];
    let of_names = |named: &str| read_members(&members, &field(named, as_is()));
    for named in ["volts,h_row=shown,n=side", "n=side, h_row = shown, volts"] {
        assert_eq!(of_names(named).unwrap().readings, Readings::Pairs(PAIRS.to_vec()), "{named}");
    }
    let refused = |named: &str| line(&of_names(named).unwrap_err(), "lab.npz");
    let found = refused("volts,h_row=rows,n=side");
    assert!(
        found.contains("`rows` is not in the file, expected --field h_row= with one of"),
        "{found}"
    );
    let found = refused("volts,rows=shown,n=side");
    assert!(found.contains("no `h_row` in it"), "{found}");
    // A sign of another name, in a text whose column has an equals sign in its own name.
    let text = "U=,polarity\n5,1\n1,-1\n2,1\n3,-1\n4,1\n4,-1\n6,1\n0.5,-1\n";
    let (_guard, path) = file("bench.csv", text.as_bytes());
    let want = field("U=,sign=polarity", shown(Order::Natural));
    let found = read(&path, &want).unwrap();
    assert_eq!(found.readings, Readings::Pairs(vec![5.0, 1.0, 2.0, 3.0, 4.0, 4.0, 6.0, 0.5]));
}

#[test]
fn readings_that_are_no_full_sweep_are_refused_with_what_they_may_be() {
    let natural = shown(Order::Natural);
    for (shape, said) in [
        (
            "(1536,)",
            "3 sweeps of 16 x 16 patterns are read with --sweeps 3, 3 samples of each reading",
        ),
        ("(512, 20)", "add --patterns-first, or, if its last axis has samples of one reading"),
        (
            "(16, 16)",
            "a spectrum of 16 x 16 is read with --side 16 and --readings differences or single",
        ),
        ("(256,)", "one value a pattern is read with --readings single or --readings differences"),
        ("(30,)", "a full sweep of n * n patterns, n a power of two, or --side N"),
    ] {
        let count: usize = shape
            .trim_matches(['(', ')'])
            .split(',')
            .filter_map(|axis| axis.trim().parse::<usize>().ok())
            .product();
        let (_folder, path) = file("y.npy", &npy_f64(shape, &vec![1.0; count]));
        let line = line(&read(&path, &natural).unwrap_err(), "y.npy");
        assert!(line.contains(said), "{shape}: {line}");
    }
}

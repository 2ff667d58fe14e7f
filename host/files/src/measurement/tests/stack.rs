//! All measurements of a file as one block of numbers, beside the same measurements one by one.

use super::*;

/// Rows 0, 3 and 1 of 2 x 2 images, and `d` of this type and shape.
fn members(d: Vec<u8>) -> Vec<(&'static str, Vec<u8>)> {
    vec![("n.npy", npy_i32("()", &[2])), ("h_row.npy", npy_i32("(3,)", &[0, 3, 1])), ("d.npy", d)]
}

/// The block of a file and whether it holds every pattern, or `None` if the file has no block.
fn block(bytes: &[u8]) -> Result<Option<(Vec<f64>, bool)>, FileError> {
    let (_guard, path) = file("lab.npz", bytes);
    let mut several = Several::open(&path, &as_is())?;
    let count = several.len();
    let Some(stack) = several.stack()? else {
        return Ok(None);
    };
    assert_eq!((stack.count(), stack.side().pixels(), stack.rows().len()), (count, 2, 3));
    let mut values = vec![7.0; 3 * count];
    let whole = stack.read_into(&mut values)?;
    Ok(Some((values, whole)))
}

/// The sum of each measurement, and a copy of all.
type SumsAndCopy = (Vec<f64>, Vec<f64>);

/// What [`Stack::map_into`] makes of a file.
fn mapped(bytes: &[u8]) -> Result<Option<SumsAndCopy>, FileError> {
    let (_guard, path) = file("lab.npz", bytes);
    let mut several = Several::open(&path, &as_is())?;
    let mut copy = vec![7.0; 3 * several.len()];
    let Some(stack) = several.stack()? else {
        return Ok(None);
    };
    let sums = stack.map_into(&mut copy, |values, places: &mut [f64]| {
        places.copy_from_slice(values);
        (values[0] < 1e6).then(|| values.iter().sum())
    })?;
    Ok(sums.map(|sums| (sums, copy)))
}

fn one_by_one(bytes: &[u8]) -> Result<Vec<MeasurementFile>, FileError> {
    let (_guard, path) = file("lab.npz", bytes);
    Several::open(&path, &as_is())?.each()
}

fn differences(found: &MeasurementFile) -> &[f64] {
    let Readings::Differential(values) = &found.readings else {
        panic!("{:?}, expected differences", found.readings);
    };
    values
}

/// Numbers of `bytes` bytes each, of which no two parts of a long array are equal, of which every third, that of the all-on pattern, is the
/// greatest.
fn noise(count: usize, bytes: usize) -> Vec<u8> {
    let of = |k: usize| match (k / bytes).is_multiple_of(3) {
        true => 127,
        false => ((k as u32).wrapping_mul(2_654_435_761) >> 13) as u8 & 0x3f,
    };
    (0..count).map(of).collect()
}

#[test]
fn a_block_has_the_numbers_that_the_measurements_have_one_by_one() {
    let many = 400_000; // three parts, the last one short
    let cases = [
        (Zip::Stored, "'|i1'", false, format!("({many}, 3)"), noise(3 * many, 1)),
        (
            Zip::Zip64,
            "'<f8'",
            false,
            "(2, 3)".to_owned(),
            npy_bytes(&[4.0, 2.5, -3.0, 8.0, 5.0, 4.0]),
        ),
        (Zip::Stored, "'>i2'", false, "(2, 1, 3)".to_owned(), noise(12, 2)),
        (
            Zip::Stored,
            "'<f8'",
            true,
            "(2, 3)".to_owned(),
            npy_bytes(&[6.0, 5.0, 4.0, 3.0, 2.0, 1.0]),
        ),
        (
            Zip::Deflated,
            "'<f8'",
            false,
            "(2, 3)".to_owned(),
            npy_bytes(&[3.0, 2.0, 1.0, 6.0, 5.0, 4.0]),
        ),
        (Zip::Stored, "'<f8'", false, "(3,)".to_owned(), npy_bytes(&[3.0, 2.0, 1.0])),
    ];
    for (how, descr, fortran, shape, data) in cases {
        let bytes = zip(how, &members(npy(descr, fortran, &shape, &data)));
        let (values, whole) = block(&bytes).unwrap().unwrap();
        let apart = one_by_one(&bytes).unwrap();
        assert!(whole && apart.iter().all(|one| *one.h_row == [0, 3, 1]), "{descr} {shape}");
        assert_eq!(
            values,
            apart.iter().flat_map(differences).copied().collect::<Vec<_>>(),
            "{descr} {shape}"
        );
        let (sums, copy) = mapped(&bytes).unwrap().unwrap();
        assert_eq!(copy, values, "{descr} {shape}");
        assert!(sums.iter().copied().eq(values.chunks(3).map(|d| d.iter().sum::<f64>())));
    }
}

fn npy_bytes(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

#[test]
fn a_changed_byte_of_a_stack_is_caught_by_the_checksum() {
    let many = 400_000;
    let good = zip(
        Zip::Stored,
        &members(npy("'|i1'", false, &format!("({many}, 3)"), &noise(3 * many, 1))),
    );
    assert!(block(&good).is_ok());
    let header = good.windows(3).rposition(|three| three == b", }").unwrap() + 1;
    for at in [header, header + 1000, header + 600_000, header + 3 * many] {
        let mut bytes = good.clone();
        bytes[at] ^= if at == header { b' ' ^ b'\t' } else { 1 };
        for error in [block(&bytes).unwrap_err(), mapped(&bytes).unwrap_err()] {
            let line = line(&error, "lab.npz");
            assert!(line.contains("damaged or cut short (`d`: Invalid checksum)"), "{at}: {line}");
        }
    }
}

#[test]
fn a_block_is_refused_in_the_words_of_its_measurements_and_keeps_what_was_not_read() {
    const NAN: f64 = f64::NAN;
    let of = |values: &[f64]| zip(Zip::Stored, &members(npy_f64("(2, 3)", values)));
    for wrong in [
        [1.0, 2.0, 3.0, 4.0, f64::INFINITY, 6.0],
        [NAN, NAN, NAN, 4.0, f64::NEG_INFINITY, 6.0],
        [1.0, 2.0, 3.0, NAN, NAN, NAN],
        // An instrument's word for overload, alone and beside NaN.
        [9.0, 2.0, 3.0, 9.9e37, 9.9e37, 9.9e37],
        [9.0, NAN, 3.0, 9.9e37, NAN, -9.9e37],
    ] {
        let bytes = of(&wrong);
        let told = line(&block(&bytes).unwrap_err(), "lab.npz");
        let apart = line(&one_by_one(&bytes).unwrap_err(), "lab.npz");
        // Each file lies in a folder of its own.
        let words = |line: &str| line.split_once("lab.npz").unwrap().1.to_owned();
        assert_eq!(words(&told), words(&apart));
    }
    let (values, whole) = block(&of(&[9.0, NAN, 3.0, 8.0, 5.0, 6.0])).unwrap().unwrap();
    assert!(whole && values[1].is_nan());
    assert_eq!([values[0], values[2], values[3], values[4], values[5]], [9.0, 3.0, 8.0, 5.0, 6.0]);
    let refused = [1.0, 2.0, 3.0, 4e6, 5.0, 6.0];
    for without in
        [[1.0, NAN, 3.0, 4.0, 5.0, 6.0], [1.0, 2.0, 3.0, 4.0, 5.0, f64::INFINITY], refused]
    {
        assert!(mapped(&of(&without)).unwrap().is_none(), "{without:?}");
    }
    // No measurement read row 3.
    assert!(!block(&of(&[9.0, NAN, 3.0, 8.0, NAN, 6.0])).unwrap().unwrap().1);
}

#[test]
fn files_without_a_block_are_read_one_by_one() {
    let d = npy_f64("(2, 3)", &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    let none = |changed: Vec<(&'static str, Vec<u8>)>, want: Selection| {
        let (_guard, path) = file("lab.npz", &zip(Zip::Stored, &changed));
        let mut several = Several::open(&path, &want).unwrap();
        assert!(several.stack().unwrap().is_none());
        assert!(!several.each().unwrap().is_empty());
    };
    let mut rows = members(d.clone());
    rows[1].1 = npy_i32("(3,)", &[0, -1, 1]);
    none(rows, as_is());
    let complex = npy_bytes(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    none(members(npy("'<c16'", false, "(2, 3)", &complex)), as_is());
    none(members(npy_f64("(3, 2)", &[1.0; 6])), Selection { patterns_first: true, ..as_is() });
    let mut pairs = members(d);
    pairs[2] = ("y.npy", npy_f64("(2, 6)", &[1.0; 12]));
    none(pairs, as_is());
}

#[test]
fn what_a_file_says_of_the_noise_is_of_all_or_of_each() {
    let said = |noise: &[f64], most: &[f64]| {
        let shape = |values: &[f64]| match values.len() {
            1 => "()".to_owned(),
            count => format!("({count},)"),
        };
        let bytes = zip(
            Zip::Stored,
            &[
                ("n.npy", npy_i32("()", &[2])),
                ("h_row.npy", npy_i32("(3,)", &[0, 1, 2])),
                ("d.npy", npy_f64("(2, 3)", &[4.0, 1.0, 2.0, 5.0, 1.0, 2.0])),
                ("noise.npy", npy_f64(&shape(noise), noise)),
                ("most_noise.npy", npy_f64(&shape(most), most)),
            ],
        );
        let (_guard, path) = file("lab.npz", &bytes);
        let mut several = Several::open(&path, &as_is()).unwrap();
        let each: Vec<_> =
            several.each().unwrap().iter().map(|one| [one.noise, one.most_noise]).collect();
        let mut several = Several::open(&path, &as_is()).unwrap();
        let stack = several.stack().unwrap().unwrap();
        assert_eq!((0..2).map(|index| stack.noise(index)).collect::<Vec<_>>(), each);
        each
    };
    let (one, two) = (Some(0.5), Some(0.25));
    assert_eq!(said(&[0.5], &[0.25]), [[one, two], [one, two]]);
    assert_eq!(said(&[0.5, 0.25], &[f64::NAN, 0.5]), [[one, None], [two, one]]);
    // A column of a table; nonsense says nothing.
    assert_eq!(said(&[0.5, 0.5, 0.5], &[-1.0]), [[one, None], [one, None]]);
}

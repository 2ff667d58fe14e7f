//! Measurement files of every form, arrays, tables, problems.

use crate::{Law, MIB, place, read};
use nirspi::files::measurement::{
    self, MeasurementFile, PatternSelection, Plain, Readings, Selection, Several, read_images_of,
    read_plain, read_plain_all,
};
use nirspi::files::npy;
use nirspi::files::output::Existing;
use nirspi::files::table::Table;
use nirspi::files::trace::{self, Cut, Raw};
use nirspi::problem;
use nirspi_recon::{Measurements, Order, Rows, Side, Size};
use std::io::{Cursor, Write};
use std::path::Path;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

pub const LAWS: &[Law] = &[
    Law {
        name: "measurements",
        reads: "a measurement file as it comes: `.npz`, `.npy`, `.mat`, HDF5, text, `.wav`",
        readers: &[
            "host/files/src/fields.rs",
            "host/files/src/archive.rs",
            "host/files/src/mat.rs",
            "host/files/src/mat4.rs",
            "host/files/src/hdf5.rs",
            "host/files/src/text.rs",
            "host/files/src/text/export.rs",
            "host/files/src/formats/wav.rs",
        ],
        holds: files,
        seeds: file_seeds,
        longest: 12_288,
        most_memory: MEMORY,
    },
    Law {
        name: "measurement-fields",
        reads: "the arrays of a `.npz` archive, each as it comes",
        readers: &[
            "host/files/src/measurement/opened.rs",
            "host/files/src/measurement/layout.rs",
            "host/files/src/measurement/readings.rs",
            "host/files/src/measurement/reference.rs",
            "host/files/src/measurement/rows.rs",
            "host/files/src/measurement/sides.rs",
            "host/files/src/measurement/stack.rs",
            "host/files/src/array.rs",
            "host/files/src/stored.rs",
            "host/src/problem.rs",
        ],
        holds: fields,
        seeds: field_seeds,
        longest: 4096,
        most_memory: MEMORY,
    },
    Law {
        name: "matlab",
        reads: "a `.mat` file of level 4 or 5",
        readers: &["host/files/src/mat.rs", "host/files/src/mat4.rs"],
        holds: files,
        seeds: || {
            let files = ["level5.mat", "level5_compressed.mat", "level4.mat", "nested.mat"];
            files.map(small).to_vec()
        },
        longest: 4096,
        most_memory: MEMORY,
    },
    Law {
        name: "hdf5",
        reads: "an HDF5 file, MATLAB's `.mat` 7.3 among them",
        readers: &["host/files/src/hdf5.rs", "host/files/src/hdf5/lzf.rs"],
        holds: files,
        seeds: || ["h5py.h5", "level73.mat", "nested.h5", "lzf.h5"].map(small).to_vec(),
        longest: 12_288,
        most_memory: MEMORY,
    },
    Law {
        name: "arrays",
        reads: "an `.npy` array",
        readers: &["host/files/src/npy.rs", "host/files/src/array.rs"],
        holds: arrays,
        seeds: array_seeds,
        longest: 2048,
        most_memory: 8 * MIB,
    },
    Law {
        name: "traces",
        reads: "a trace: samples and a trigger, in a file of any format or without a heading",
        readers: &[
            "host/files/src/trace.rs",
            "host/files/src/trace/series.rs",
            "host/files/src/trace/sums.rs",
            "host/files/src/trace/windows.rs",
        ],
        holds: traces,
        seeds: trace_seeds,
        longest: 4096,
        most_memory: MEMORY,
    },
    Law {
        name: "tables",
        reads: "a table of numbers: text, CSV, with decimal points or commas",
        readers: &["host/files/src/table.rs", "host/files/src/text.rs"],
        holds: tables,
        seeds: table_seeds,
        longest: 2048,
        most_memory: 16 * MIB,
    },
];

/// A field unpacks to 256 MiB at most, and its numbers take twice as much; a copy of one of them is on its way.
const MEMORY: usize = 1536 * MIB;

/// A file of SciPy or h5py, from the tests of the readers.
fn small(name: &str) -> Vec<u8> {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../host/files/src/small");
    std::fs::read(Path::new(folder).join(name)).expect("a file of the readers' tests")
}

/// What a user may say of a file.
fn selections() -> [Selection; 4] {
    let side = Side::new(4).ok();
    let shown = Selection { shown: Some(Order::Natural), side, ..Selection::default() };
    [
        Selection::default(),
        Selection {
            index: Some(1),
            patterns_first: true,
            transpose: true,
            side,
            ..Selection::default()
        },
        shown.clone(),
        Selection { decimal_comma: true, form: Some(measurement::Form::Single), ..shown },
    ]
}

fn files(bytes: &[u8]) {
    let path = place::file("input", bytes);
    for want in selections() {
        one_file(&path, &want);
    }
    own_patterns(&path);
    read(read_images_of(&path));
}

/// The file as readings of three patterns, as the patterns of three readings, and as both.
fn own_patterns(path: &Path) {
    let three = place::file("three.npy", &npy::encode(&[3, 4], &[1.0_f32; 12]));
    let readings = place::file("readings.npy", &npy::encode(&[3], &[1.0_f32; 3]));
    let ways = [(&*three, path), (path, &*readings), (path, path)];
    let forms = [None, Some(measurement::Form::Pairs)];
    for ((matrix, input), form) in ways.into_iter().flat_map(|way| forms.map(|form| (way, form))) {
        let of_patterns = PatternSelection { size: Size::new(2, 2).ok(), ..Default::default() };
        let want = Selection { form, ..Selection::default() };
        let Some(plain) = read(read_plain(matrix, &of_patterns, input, &want)) else { continue };
        let Plain { patterns, values, places, not_read, .. } = plain;
        assert_eq!((values.len(), patterns.weights.len()), (places.len(), 4 * patterns.count));
        assert_eq!(places.len() + not_read.len(), patterns.count);
        assert!(values.iter().chain(&patterns.weights).all(|number| number.is_finite()));
        assert_eq!(patterns.select(&places).len(), 4 * places.len());
        // The file holds this measurement alone, or it is refused without an index.
        let all = read(read_plain_all(matrix, &of_patterns, input, &want)).expect("all of one");
        assert_eq!((all.len(), &all[0].values, &all[0].places), (1, &values, &places));
    }
}

/// What is read is consistent, and the same by every way of reading, or refused in each.
fn one_file(path: &Path, want: &Selection) {
    let file = read(measurement::read(path, want));
    if let Some(file) = &file {
        is_consistent(file);
        written_again(file);
    }
    let Some(mut several) = read(Several::open(path, want)) else {
        assert!(file.is_none(), "one measurement is read of a file that does not open");
        return;
    };
    let (count, patterns) = (several.len(), several.patterns());
    let all = several.each().map_err(|error| crate::refused(&error));
    let index = want.index.or((count == 1).then_some(0)).filter(|index| *index < count);
    assert!(file.is_none() || index.is_some(), "read one of several measurements without an index");
    if let (Ok(all), Some(index)) = (&all, index) {
        assert_eq!(all.len(), count);
        // NaN in the file's own image differs from itself.
        let alone = file.as_ref().map(|file| format!("{file:?}"));
        assert_eq!(alone, Some(format!("{:?}", all[index])), "another measurement");
    }
    let Some(Some(stack)) = read(several.stack()) else { return };
    assert_eq!((stack.count(), stack.rows().len()), (count, patterns));
    let mut block = vec![0.0; count * patterns];
    let whole = read(stack.read_into(&mut block));
    assert_eq!(whole.is_some(), all.is_ok(), "block and parts are not refused alike");
    let mut copy = vec![0.0; count * patterns];
    let mapped = stack.map_into(&mut copy, |values, places| {
        places.copy_from_slice(values);
        Some(())
    });
    if let Some(Some(_)) = read(mapped) {
        assert!(whole.is_some() && copy == block, "another block piece by piece");
    }
    for (one, values) in all.iter().flatten().zip(block.chunks(patterns)) {
        let Readings::Differential(found) = &one.readings else { panic!("{:?}", one.readings) };
        let kept: Vec<f64> = one.places.iter().map(|&place| values[place]).collect();
        assert_eq!(found, &kept, "another block");
    }
}

fn is_consistent(file: &MeasurementFile) {
    let count = file.h_row.len();
    let (values, most) = match &file.readings {
        Readings::Pairs(values) => (values, 2 * count),
        Readings::Single(values) | Readings::Differential(values) => (values, count),
    };
    assert_eq!(values.len(), most);
    assert_eq!(file.places.len(), count);
    assert!(count > 0 && count <= file.h_row.side().area());
    assert!(values.iter().all(|value| value.is_finite()));
    assert!(file.not_read.iter().all(|place| !file.places.contains(place)));
    if let Some(reference) = &file.reference {
        assert_eq!(reference.real.pixels().len(), file.h_row.side().area());
    }
    file.notes.iter().for_each(|note| crate::is_one_line(note));
}

/// Differences come back from a file of ours as they went in.
fn written_again(file: &MeasurementFile) {
    let Readings::Differential(values) = &file.readings else { return };
    let Ok(measurements) = Measurements::from_differential(&file.h_row, values) else { return };
    let path = place::path("again.npz");
    let bytes = measurement::encode(&path, &measurements, &provenance()).expect("an archive");
    std::fs::write(&path, bytes).expect("its file");
    let again = measurement::read(&path, &Selection::default()).expect("our own file");
    assert_eq!((&again.h_row, &again.readings), (&file.h_row, &file.readings));
    assert_eq!(again.taken.simulated(), Some(true));
}

/// Names that fields can have, the first two bytes of each field being its name and its length / 16.
const NAMES: [&str; 9] = ["n", "h_row", "y", "d", "simulated", "recon", "D", "Y", "k"];

/// An archive of the arrays in the input. The first byte says how they are packed.
fn archive_of(bytes: &[u8]) -> Vec<u8> {
    let (&packed, mut rest) = bytes.split_first().unwrap_or((&0, &[]));
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    let method =
        if packed & 1 == 0 { CompressionMethod::Stored } else { CompressionMethod::Deflated };
    let options = SimpleFileOptions::default().compression_method(method);
    while let Some((&[name, l0, l1], after)) = rest.split_first_chunk() {
        let length = usize::from(u16::from_le_bytes([l0, l1]));
        let (array, after) = after.split_at(length.min(after.len()));
        let name = NAMES[usize::from(name) % NAMES.len()];
        // A name that comes twice is refused by the writer.
        if archive.start_file(format!("{name}.npy"), options).is_ok() {
            archive.write_all(array).expect("memory");
        }
        rest = after;
    }
    archive.finish().expect("an archive").into_inner()
}

fn fields(bytes: &[u8]) {
    let path = place::file("input.npz", &archive_of(bytes));
    for want in selections() {
        one_file(&path, &want);
    }
    read(read_images_of(&path));
    if let Some(problem) = read(problem::read(&path)) {
        assert_eq!(problem.dictionary.len(), problem.measurements * problem.atoms);
        assert!(problem.frames.len().is_multiple_of(problem.measurements));
        assert!((1..=problem.atoms).contains(&problem.sparsity));
        let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
        assert!(finite(&problem.dictionary) && finite(&problem.frames));
    }
}

/// Differences of four patterns of an image of 2 x 2.
fn sound() -> Vec<u8> {
    let side = Side::new(2).expect("a side");
    let rows = Rows::new(side, (0..4_u32).collect::<Vec<_>>()).expect("rows");
    let made = Measurements::from_differential(&rows, &[4.0, 1.0, -2.0, 0.5]).expect("numbers");
    measurement::encode(Path::new("m.npz"), &made, &provenance()).expect("an archive")
}

fn file_seeds() -> Vec<Vec<u8>> {
    let readings: Vec<f64> = (0..32).map(|k| f64::from(k * 7 % 11)).collect();
    vec![
        sound(),
        archive_of(&field_seeds()[0]),
        archive_of(&field_seeds()[1]),
        npy::encode(&[32], &readings),
        b"h_row;d\n0;1,5\n3;null\n2;\n1;NaN\n".to_vec(),
        readings.iter().map(|y| format!("{y}\n")).collect::<String>().into_bytes(),
        exported(&readings),
        small("level5.mat"),
        small("level5_compressed.mat"),
    ]
}

/// A table as an instrument exports it, of four patterns.
fn exported(readings: &[f64]) -> Vec<u8> {
    let rows = readings.iter().take(9).enumerate();
    let rows = rows.map(|(k, y)| format!("{};11/20/2026;{y}\n", k % 4)).collect::<String>();
    format!("a meter\nh_row;Date;d\n(s);;(V)\n{rows}end\n").into_bytes()
}

fn field_seeds() -> Vec<Vec<u8>> {
    let field = |name: &str, array: Vec<u8>| {
        let at = NAMES.iter().position(|known| *known == name).expect("a name") as u8;
        [&[at][..], &(array.len() as u16).to_le_bytes(), &array].concat()
    };
    let n = || field("n", npy::encode(&[], &[2_i64]));
    let rows = || field("h_row", npy::encode(&[4], &[0_i64, 3, 1, 2]));
    let d: [f64; 12] = std::array::from_fn(|at| at as f64);
    let differences = [
        vec![0],
        n(),
        rows(),
        field("d", npy::encode(&[3, 4], &d)),
        field("recon", npy::encode(&[3, 2, 2], &d.map(|value| value as f32))),
        field("simulated", npy::encode(&[], &[1_i64])),
    ];
    let one_image = [
        vec![0],
        n(),
        rows(),
        field("d", npy::encode(&[3, 4], &d)),
        field("recon", npy::encode(&[2, 2], &d[..4])),
    ];
    let pairs = [vec![1], n(), rows(), field("y", npy::encode(&[8], &d[..8]))];
    let problem = [
        vec![0],
        field("D", npy::encode(&[3, 4], &d)),
        field("Y", npy::encode(&[2, 3], &d[..6])),
        field("k", npy::encode(&[], &[2_i64])),
    ];
    vec![differences.concat(), pairs.concat(), problem.concat(), one_image.concat()]
}

fn arrays(bytes: &[u8]) {
    let path = place::file("input.npy", bytes);
    let again = place::path("again.npy");
    if let Some(stack) = read(npy::read_with_gaps(&path)) {
        let npy::Stack { count, height, width, values } = &stack;
        assert_eq!(count * height * width, values.len());
        std::fs::write(&again, npy::encode(&[*count, *height, *width], values)).expect("a file");
        let back = npy::read_with_gaps(&again).expect("our own file");
        let bits = |values: &[f32]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
        // A signalling NaN becomes a quiet one on its way through a float64.
        let quiet: Vec<f32> = values.iter().map(|&value| f64::from(value) as f32).collect();
        assert_eq!(bits(&back.values), bits(&quiet));
        let finite = values.iter().all(|value| value.is_finite());
        assert_eq!(read(npy::read_stack(&path)).is_some(), finite);
    }
    if let Some(pictures) = read(npy::read_pictures(&path)) {
        assert!(pictures.stack.values.iter().all(|value| value.is_finite()));
    }
    if let Some(list) = read(npy::read_list(&path)) {
        std::fs::write(&again, npy::encode(&[list.len()], &list)).expect("a file");
        let back = npy::read_list(&again).expect("our own file");
        assert!(list.iter().zip(&back).all(|(a, b)| a.to_bits() == b.to_bits() || a.is_nan()));
    }
}

fn array_seeds() -> Vec<Vec<u8>> {
    let values: [f32; 12] = std::array::from_fn(|at| at as f32 / 12.0);
    let header = |descr: &str, fortran: &str, shape: &str, data: &[u8]| {
        let text =
            format!("{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}\n");
        let length = (text.len() as u16).to_le_bytes();
        [&b"\x93NUMPY\x01\x00"[..], &length, text.as_bytes(), data].concat()
    };
    vec![
        npy::encode(&[3, 2, 2], &values),
        npy::encode(&[12], &values.map(f64::from)),
        header(">f2", "True", "(2, 3)", &[0x3C; 12]),
        header("|u1", "False", "(2, 2, 2)", &[9; 8]),
        header("<c16", "True", "(1, 2L)", &[1; 32]),
        header("|b1", "False", "(4, 1)", &[1, 0, 1, 1]),
    ]
}

/// How a trace may be cut.
fn cuts() -> Vec<Cut> {
    let name = |name: &str| Some(name.to_owned());
    let every =
        |samples, skip, settle| Cut { samples: Some(samples), skip, settle, ..Cut::default() };
    let by_trigger = Cut { field: name("y"), trigger: name("d"), ..Cut::default() };
    let raw = Raw::ALL.map(|raw| Cut { raw: Some(raw), ..every(3, 1, 1) });
    [
        every(1, 0, 0),
        every(3, 2, 1),
        Cut { field: name("y"), count: Some(2), ..every(2, 0, 0) },
        Cut { settle: 2, skip: 1, ..by_trigger.clone() },
        by_trigger,
    ]
    .into_iter()
    .chain(raw)
    .collect()
}

/// A reading is a number, or is named among those that are not there; what was read is written and reads the same.
fn traces(bytes: &[u8]) {
    let path = place::file("input", bytes);
    for cut in cuts() {
        let Some(found) = read(trace::read(&path, &cut)) else { continue };
        let trace::Found { readings, lost, overloads, length, outside, first, .. } = &found;
        assert!(!readings.is_empty() && readings.len() <= *length);
        assert!(cut.count.is_none_or(|count| count == readings.len()));
        assert!(outside.0 <= *length && outside.1 <= *length);
        let missing = (0..readings.len()).filter(|&k| !readings[k].is_finite());
        let mut named: Vec<usize> = lost.iter().chain(overloads).copied().collect();
        named.sort_unstable();
        assert!(missing.eq(named), "readings that are not there: {lost:?} {overloads:?}");
        assert!(first.samples.len() <= 4000 && first.windows.len() <= readings.len());
        assert!(first.windows.iter().all(|window| window.end <= *length));
        assert!(first.samples.windows(2).all(|two| two[0].0 < two[1].0));
        found.words().iter().chain(&found.warnings()).for_each(|line| crate::is_one_line(line));
        let again = place::path("again.npz");
        let existing = Existing::Replaced { made_of: None };
        measurement::write_readings(&again, existing, readings, &provenance()).expect("its file");
        if named_none(&found) {
            let cut = Cut { field: Some("y".to_owned()), samples: Some(1), ..Cut::default() };
            let back = trace::read(&again, &cut).expect("our own file");
            assert_eq!(&back.readings, readings);
        }
    }
}

/// Whether every reading is there.
fn named_none(found: &trace::Found) -> bool {
    found.lost.is_empty() && found.overloads.is_empty()
}

fn trace_seeds() -> Vec<Vec<u8>> {
    let samples: Vec<f64> = (0..60).map(|k| f64::from(k / 5 * 7 % 11)).collect();
    let trigger: Vec<f64> = (0..60).map(|k| f64::from(u32::from(k % 5 == 0 && k != 20))).collect();
    let field = |name: &str, values: &[f64]| {
        let at = NAMES.iter().position(|known| *known == name).expect("a name") as u8;
        let array = npy::encode(&[values.len()], values);
        [&[at][..], &(array.len() as u16).to_le_bytes(), &array].concat()
    };
    let rows = samples.iter().zip(&trigger).map(|(y, d)| format!("{y},{d}\n"));
    vec![
        archive_of(&[vec![0], field("y", &samples), field("d", &trigger)].concat()),
        archive_of(&[vec![1], field("y", &samples), field("d", &trigger)].concat()),
        npy::encode(&[60], &samples),
        npy::encode(&[20, 3], &samples),
        format!("y,d\n{}", rows.collect::<String>()).into_bytes(),
        samples.iter().flat_map(|y| y.to_le_bytes()).collect(),
    ]
}

fn tables(bytes: &[u8]) {
    let path = place::file("input.csv", bytes);
    if let Some(table) = read(Table::read(&path)) {
        let last = read(table.last_column());
        let pairs = read(table.pairs("wavelength and index"));
        if let (Some(last), Some(pairs)) = (last, pairs) {
            let seconds = pairs.iter().map(|[_, second]| second.to_bits());
            assert!(last.iter().map(|value| value.to_bits()).eq(seconds), "another column");
        }
    }
    for want in selections() {
        one_file(&path, &want);
    }
}

fn table_seeds() -> Vec<Vec<u8>> {
    let texts: [&[u8]; 8] = [
        b"place,volume\n1,2.5\n2,2.25\n3,1e1\n",
        b"1,5;2;\n3;4,25;\n",
        b"# log\n1 2 3\n",
        b"0,5\n0,05\n",
        b"1,5\t2\r\n3\t4\r\n",
        b"\xef\xbb\xbfvoltage of the wing\n1\n2\n3 ",
        b"h_row,d\n0,15\n3,-4\n",
        b"1\n2\n3\n4\n5\n6\n7\n8\n9\n10\n11\n12\n13\n14\n15\n16\n",
    ];
    texts.map(<[u8]>::to_vec).to_vec()
}

/// A provenance for files of tests.
fn provenance() -> nirspi::provenance::Provenance {
    use nirspi::provenance::{Made, Origin, Taken};
    Taken::without_camera(Origin::Simulated).made(&Made::by("test", None, ["test"], 0))
}

use super::super::testing::{file, line};
use super::*;

/// Files of `host/scripts/small_files.py`: SciPy's and h5py's own bytes.
const FILES: &[(&str, &[u8])] = &[
    ("level5.mat", include_bytes!("../small/level5.mat")),
    ("level5_compressed.mat", include_bytes!("../small/level5_compressed.mat")),
    ("level4.mat", include_bytes!("../small/level4.mat")),
    ("level73.mat", include_bytes!("../small/level73.mat")),
    ("h5py.h5", include_bytes!("../small/h5py.h5")),
    ("lzf.h5", include_bytes!("../small/lzf.h5")),
];

fn read_all(path: &Path) -> Result<Vec<Field>, FileError> {
    let mut fields = Fields::open(path, false)?;
    ["n", "h_row", "y", "z"].into_iter().map(|name| fields.read(name, |_| Ok(()))).collect()
}

#[test]
fn arrays_come_out_of_each_format_as_they_went_in() {
    for (name, bytes) in FILES {
        let (_folder, path) = file(name, bytes);
        let [n, h_row, y, z] = <[Field; 4]>::try_from(read_all(&path).unwrap()).unwrap();
        assert_eq!((n.real, n.imaginary), (vec![2.0], None), "{name}");
        assert_eq!(h_row.real, [0.0, 3.0, 1.0], "{name}");
        assert_eq!(y.real, [5.0, 1.0, 2.0, 3.0, 4.0, 4.5], "{name}");
        assert_eq!(z.shape, [2, 3], "{name}");
        assert_eq!(z.real, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], "{name}");
        assert_eq!(z.imaginary.unwrap(), [10.0, 20.0, 30.0, 40.0, 50.0, 60.0], "{name}");
    }
}

/// A gigabyte of numbers in a small file: of h5py a chunked array that was never written, and SciPy's
/// array `y` with other sizes of its axes.
#[test]
fn bytes_that_would_become_gigabytes_of_numbers_are_refused_before_they_are_read() {
    let mut mat = include_bytes!("../small/level5.mat").to_vec();
    let axes = [6, 0, 0, 0, 1, 0, 0, 0];
    let at = mat.windows(8).position(|bytes| bytes == axes).unwrap();
    mat[at..at + 8].copy_from_slice(&[0, 0x40, 0, 0, 0, 0x20, 0, 0]);
    for (name, bytes) in
        [("claims.mat", &mat[..]), ("claims.h5", include_bytes!("../small/claims.h5"))]
    {
        let (_folder, path) = file(name, bytes);
        let mut fields = Fields::open(&path, false).unwrap();
        let told = line(&fields.read("y", |_| Ok(())).unwrap_err(), name);
        assert!(told.contains("`y` claims shape ("), "{told}");
        assert!(told.ends_with("expected at most 512 MiB"), "{told}");
    }
}

/// h5py wrote the file, of `np.float16`.
#[test]
fn numbers_of_half_precision_in_hdf5_are_named_with_what_to_save_instead() {
    let (_folder, path) = file("half.h5", include_bytes!("../small/float16.h5"));
    let told =
        line(&Fields::open(&path, false).unwrap().read("y", |_| Ok(())).unwrap_err(), "half.h5");
    assert!(told.contains("`y` is an array of floating-point numbers of 2 bytes"), "{told}");
    assert!(told.ends_with("expected 4 or 8 bytes: save it as float32"), "{told}");
}

#[test]
fn what_is_no_array_of_numbers_is_named_only_when_it_is_asked_for() {
    let without_text = ["level73.mat", "level4.mat"];
    for (name, bytes) in FILES.iter().filter(|(name, _)| !without_text.contains(name)) {
        let (_folder, path) = file(name, bytes);
        let mut fields = Fields::open(&path, false).unwrap();
        let told = line(&fields.read("text", |_| Ok(())).unwrap_err(), name);
        assert!(told.contains("`text` is"), "{told}");
        let told = line(&fields.read("none", |_| Ok(())).unwrap_err(), name);
        assert!(told.contains("`none`"), "{told}");
        let told = line(&fields.read("z", |_| Err("(3,)".to_owned())).unwrap_err(), name);
        assert!(told.ends_with("`z` has shape (2, 3), expected (3,)"), "{told}");
        let told = line(&Fields::open(&path, true).err().unwrap(), name);
        assert!(told.ends_with("expected text for --decimal-comma"), "{told}");
    }
}

#[test]
fn a_cut_file_is_refused_or_gives_what_is_whole() {
    for (name, bytes) in FILES {
        let (folder, path) = file(name, bytes);
        let _kept = folder;
        for end in (0..bytes.len()).step_by(1 + bytes.len() / 400) {
            std::fs::write(&path, &bytes[..end]).unwrap();
            if let Err(error) = read_all(&path) {
                line(&error, name);
            }
        }
    }
}

#[test]
fn damage_is_harmless_or_refused() {
    for (name, bytes) in FILES {
        let (folder, path) = file(name, bytes);
        let _kept = folder;
        for at in 0..bytes.len() {
            // Bytes that mean nothing in these files are mostly zero.
            if bytes[at] == 0 && at % 7 != 0 {
                continue;
            }
            let mut damaged = bytes.to_vec();
            damaged[at] ^= [0xff, 0x01, 0x80][at % 3];
            std::fs::write(&path, &damaged).unwrap();
            if let Err(error) = read_all(&path) {
                line(&error, name);
            }
        }
    }
}

#[test]
fn a_matrix_without_numbers_is_read_whatever_its_shape() {
    for shape in [vec![0, 0], vec![5, 0], vec![0, 5], vec![2, 0, 3]] {
        let field = Field::from_column_major(shape.clone(), &[], Some(&[]));
        assert_eq!(field, Field { shape, real: Vec::new(), imaginary: Some(Vec::new()) });
    }
}

/// h5py refuses such a file too, by the end-of-file address. Arrays before the cut could be read.
#[test]
fn an_hdf5_file_that_was_cut_is_refused_wherever_it_was_cut() {
    for (name, bytes) in [
        ("h5py.h5", &include_bytes!("../small/h5py.h5")[..]),
        ("level73.mat", include_bytes!("../small/level73.mat")),
        ("claims.h5", include_bytes!("../small/claims.h5")),
    ] {
        let whole = bytes.len();
        // After the superblock, which tells the length.
        for length in (whole / 2..whole).step_by(97).chain([whole - 1]) {
            let (_folder, path) = file(name, &bytes[..length]);
            let told = line(&Fields::open(&path, false).err().unwrap(), name);
            let lengths = format!("({length} bytes, {whole} by its superblock)");
            assert!(told.contains("damaged or cut short") && told.contains(&lengths), "{told}");
        }
        // What follows a whole file is no damage.
        let (_folder, path) = file(name, &[bytes, b"more"].concat());
        Fields::open(&path, false).unwrap();
    }
}

#[test]
fn arrays_in_structures_and_groups_are_named_by_their_path() {
    let structure: &[u8] = include_bytes!("../small/nested.mat");
    for (name, bytes, between) in
        [("nested.mat", structure, '.'), ("nested.h5", include_bytes!("../small/nested.h5"), '/')]
    {
        let (folder, path) = file(name, bytes);
        let _kept = folder;
        let of = |path: &str| path.replace('.', &between.to_string());
        let mut fields = Fields::open(&path, false).unwrap();
        assert!(fields.holds(&of("run.n")) && fields.holds(&of("run.adc.y")), "{name}");
        assert_eq!(fields.read(&of("run.h_row"), |_| Ok(())).unwrap().real, [0.0, 3.0, 1.0]);
        let y = fields.read(&of("run.adc.y"), |_| Ok(())).unwrap();
        assert_eq!(y.real, [5.0, 1.0, 2.0, 3.0, 4.0, 4.5], "{name}");
        for absent in ["run.none", "run.h_row.y", "none.y", "run.adc"] {
            line(&fields.read(&of(absent), |_| Ok(())).unwrap_err(), name);
        }
        for (at, bit) in (0..bytes.len()).map(|at| (at, at % 8)) {
            let mut changed = bytes.to_vec();
            changed[at] ^= 1 << bit;
            std::fs::write(&path, &changed).unwrap();
            if let Ok(mut fields) = Fields::open(&path, false)
                && let Err(error) = fields.read(&of("run.adc.y"), |_| Ok(()))
            {
                line(&error, name);
            }
        }
    }
}

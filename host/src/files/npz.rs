//! Single-pixel measurements from a NumPy `.npz` file, ours or another lab's.
//!
//! The law: what [`read`] returns is consistent (every row known, within range and shown once, one
//! finite reading or pair for each), so nothing after it has to look again.
//!
//! | field | content |
//! |---|---|
//! | `n` | side of the image, a power of two from 2 to 256 |
//! | `h_row` | `(M,)`: row of the natural-order Hadamard matrix of order n^2 that was shown k-th |
//! | `y` | `(2 M,)` raw readings in time order +, -, +, -, or `(measurements, 2 M)`; M if single |
//! | `d` | `(M,)` differential readings, or `(measurements, M)` |
//! | `recon` | optional `(n, n)`: someone's reconstruction, to compare with |
//!
//! Any real dtype, byte order and memory order; other fields are not looked at.

use super::FileError;
use super::archive::{Archive, Numbers};
use super::array::shape_text;
use nirspi_recon::{Image, Rows, RowsError, Side};
use std::path::Path;

/// What of a file is wanted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Selection {
    /// Which measurement of a file that holds several.
    pub index: Option<usize>,
    /// Take `y` as one reading a pattern, taken without complement patterns.
    pub non_differential: bool,
}

/// The numbers that a detector gave, in volts, counts or whatever it was logged in.
#[derive(Debug, Clone, PartialEq)]
pub enum Readings {
    /// `2 M` readings: pattern, complement, pattern, complement.
    Pairs(Vec<f64>),
    /// `M` differences, pattern minus complement.
    Differential(Vec<f64>),
    /// `M` readings of patterns alone.
    Single(Vec<f64>),
}

/// One measurement, checked: `h_row` has 1 to n^2 different rows of the n^2, readings are finite
/// and fit it.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasurementFile {
    /// Hadamard rows in the order shown; their side is that of the image.
    pub h_row: Rows,
    /// What the detector saw.
    pub readings: Readings,
    /// The file's own reconstruction, if it holds one.
    pub reference: Option<Image>,
    /// What was odd about the file without making it useless, a line each.
    pub notes: Vec<String>,
}

/// Reads and checks a measurement file. `y` is taken before `d`; where both are there, `d` is
/// checked as well.
///
/// # Errors
/// [`FileError`], one line that names file, field, what was found and what was expected.
pub fn read(path: &Path, want: Selection) -> Result<MeasurementFile, FileError> {
    let wanted = Wanted { which: Which::One(want.index), non_differential: want.non_differential };
    read_wanted(path, wanted).map(|mut all| all.remove(0))
}

/// Reads and checks every measurement of a file, in their order: a video.
///
/// # Errors
/// As [`read`].
pub fn read_all(path: &Path, non_differential: bool) -> Result<Vec<MeasurementFile>, FileError> {
    read_wanted(path, Wanted { which: Which::Every, non_differential })
}

/// Reads `length` readings, `y` or else `d`, of patterns that the file does not name.
///
/// # Errors
/// As [`read`].
pub fn read_plain(path: &Path, index: Option<usize>, length: usize) -> Result<Vec<f64>, FileError> {
    let mut archive = Archive::open(path)?;
    let field = if archive.holds("d") && !archive.holds("y") { "d" } else { "y" };
    require(&archive, field, "y, one reading a pattern")?;
    let hint = (2 * length, "; of +, - pairs give the differences");
    let which = Which::One(index);
    let series = read_series(&mut archive, field, length, hint, "one reading a pattern", which);
    series.map(|mut series| series.remove(0))
}

/// Which measurements of a file.
#[derive(Debug, Clone, Copy)]
enum Which {
    One(Option<usize>),
    Every,
}

#[derive(Debug, Clone, Copy)]
struct Wanted {
    which: Which,
    non_differential: bool,
}

fn read_wanted(path: &Path, want: Wanted) -> Result<Vec<MeasurementFile>, FileError> {
    let mut archive = Archive::open(path)?;
    for field in ["n", "h_row"] {
        require(&archive, field, "n, h_row, and y or d")?;
    }
    let side = read_side(&mut archive)?;
    let h_row = read_rows(&mut archive, side)?;
    let readings = read_readings(&mut archive, h_row.len(), want)?;
    let mut notes = Vec::new();
    let reference = read_reference(&mut archive, side).unwrap_or_else(|error| {
        notes.push(format!("not compared with the reconstruction in the file: {error}"));
        None
    });
    let file = |readings| MeasurementFile {
        h_row: h_row.clone(),
        readings,
        reference: reference.clone(),
        notes: notes.clone(),
    };
    Ok(readings.into_iter().map(file).collect())
}

fn require(
    archive: &Archive,
    field: &'static str,
    expected: &'static str,
) -> Result<(), FileError> {
    if archive.holds(field) {
        return Ok(());
    }
    let (path, found) = (archive.path().to_owned(), archive.names().to_vec());
    Err(FileError::Missing { path, field, found, expected })
}

fn refuse(
    archive: &Archive,
    field: &'static str,
    found: String,
    expected: impl Into<String>,
) -> FileError {
    FileError::Field { path: archive.path().to_owned(), field, found, expected: expected.into() }
}

fn read_side(archive: &mut Archive) -> Result<Side, FileError> {
    const EXPECTED: &str = "a power of two from 2 to 256";
    let n = archive.numbers("n", |shape| match shape.iter().all(|&axis| axis == 1) {
        true => Ok(()),
        false => Err("one number".to_owned()),
    })?;
    let value = n.values[0];
    as_integer(value)
        .and_then(|n| u64::try_from(n).ok())
        .and_then(|n| Side::new(n).ok())
        .ok_or_else(|| refuse(archive, "n", format!("is {value}"), EXPECTED))
}

fn read_rows(archive: &mut Archive, side: Side) -> Result<Rows, FileError> {
    const FIELD: &str = "h_row";
    let (n, area) = (side.pixels(), side.area());
    let numbers = archive.numbers(FIELD, |shape| match shape {
        [rows] if (1..=area as u64).contains(rows) => Ok(()),
        _ => Err(format!("(M,) with M from 1 to {area} for n = {n}")),
    })?;
    let expected = || format!("a whole number from 0 to {} for n = {n}", area - 1);
    let whole = |(k, &value): (usize, &f64)| {
        as_integer(value)
            .ok_or_else(|| refuse(archive, FIELD, format!("is {value} at [{k}]"), expected()))
    };
    let rows: Vec<i64> = numbers.values.iter().enumerate().map(whole).collect::<Result<_, _>>()?;
    Rows::new(side, rows).map_err(|error| match error {
        RowsError::OutOfRange { index, found, .. } => {
            refuse(archive, FIELD, format!("is {found} at [{index}]"), expected())
        }
        RowsError::Repeated { index, first, row } => {
            let found = format!("repeats row {row} at [{index}], first at [{first}]");
            refuse(archive, FIELD, found, "each row once")
        }
        other => refuse(archive, FIELD, other.to_string(), expected()),
    })
}

fn read_readings(
    archive: &mut Archive,
    rows: usize,
    want: Wanted,
) -> Result<Vec<Readings>, FileError> {
    let all = |series: Vec<Vec<f64>>, kind: fn(Vec<f64>) -> Readings| -> Vec<Readings> {
        series.into_iter().map(kind).collect()
    };
    if want.non_differential {
        require(archive, "y", "y, the readings, for --non-differential")?;
        let hint = (2 * rows, "; these look like +, - pairs: leave out --non-differential");
        return read_series(archive, "y", rows, hint, "one reading a row", want.which)
            .map(|series| all(series, Readings::Single));
    }
    if !archive.holds("y") {
        require(archive, "d", "y (raw readings) or d (differential)")?;
        let hint = (2 * rows, "; +, - pairs belong in `y`");
        return read_series(archive, "d", rows, hint, "one difference a row", want.which)
            .map(|series| all(series, Readings::Differential));
    }
    if archive.holds("d") {
        let differences = archive.numbers("d", |shape| match is_series(shape, rows) {
            true => Ok(()),
            false => Err(format!("({rows},) or (measurements, {rows}): one difference a row")),
        })?;
        check_finite(archive, "d", &differences, 0)?;
    }
    let hint = (rows, "; one reading a row is read with --non-differential");
    read_series(archive, "y", 2 * rows, hint, "a +, - pair a row", want.which)
        .map(|series| all(series, Readings::Pairs))
}

/// Reads `length` numbers from a field that holds one series or, chosen by index, a row of several; or all of these.
fn read_series(
    archive: &mut Archive,
    field: &'static str,
    length: usize,
    (mistaken_length, hint): (usize, &str),
    meaning: &str,
    which: Which,
) -> Result<Vec<Vec<f64>>, FileError> {
    let numbers = archive.numbers(field, |shape| match is_series(shape, length) {
        true => Ok(()),
        false => {
            let hint = if is_series(shape, mistaken_length) { hint } else { "" };
            Err(format!("({length},) or (measurements, {length}): {meaning}{hint}"))
        }
    })?;
    let count = numbers.values.len() / length;
    let Which::One(asked) = which else {
        check_finite(archive, field, &numbers, 0)?;
        return Ok(numbers.values.chunks_exact(length).map(<[f64]>::to_vec).collect());
    };
    // A single measurement needs no choice, however many axes it is stored with.
    let chosen = asked.or((count == 1).then_some(0)).filter(|&index| index < count);
    let Some(index) = chosen else {
        return Err(FileError::Choice { path: archive.path().to_owned(), field, count, asked });
    };
    let start = index * length;
    let series = Numbers { values: numbers.values[start..start + length].to_vec(), ..numbers };
    check_finite(archive, field, &series, start)?;
    Ok(vec![series.values])
}

/// Whether an array of this shape holds one series of `length` numbers, or several as rows.
fn is_series(shape: &[u64], length: usize) -> bool {
    match *shape {
        [count] => count == length as u64,
        [series, count] => series > 0 && count == length as u64,
        _ => false,
    }
}

/// `start` is the place of the first of these numbers in the whole field.
fn check_finite(
    archive: &Archive,
    field: &'static str,
    numbers: &Numbers,
    start: usize,
) -> Result<(), FileError> {
    let Some(offset) = numbers.values.iter().position(|value| !value.is_finite()) else {
        return Ok(());
    };
    let value = numbers.values[offset];
    let place = match (numbers.shape.as_slice(), start + offset) {
        ([_, columns], flat) => format!("[{}, {}]", flat / columns, flat % columns),
        (_, flat) => format!("[{flat}]"),
    };
    Err(refuse(archive, field, format!("is {value} at {place}"), "finite numbers"))
}

fn read_reference(archive: &mut Archive, side: Side) -> Result<Option<Image>, FileError> {
    const FIELD: &str = "recon";
    if !archive.holds(FIELD) {
        return Ok(None);
    }
    let n = side.pixels() as u64;
    let numbers = archive.numbers(FIELD, |shape| match shape {
        [height, width] if (*height, *width) == (n, n) => Ok(()),
        _ => Err(shape_text(&[n, n])),
    })?;
    check_finite(archive, FIELD, &numbers, 0)?;
    Ok(Some(Image::new(side, numbers.values.iter().map(|&value| value as f32).collect())))
}

/// The whole number that a float stands for; every row number and side is exact in float64.
fn as_integer(value: f64) -> Option<i64> {
    (value.fract() == 0.0 && value.abs() < 2f64.powi(53)).then_some(value as i64)
}

#[cfg(test)]
mod tests;

//! The side of the image and the row shown k-th, from the file or from the order that the user
//! names.

use super::axes::joined;
use super::form::meaning;
use super::layout::Layout;
use super::readings::NamedReadings;
use super::{FileError, Form, Selection};
use crate::array::has_shape;
use crate::fields::{Fields, UNNAMED};
use nirspi_recon::{Order, Side};

/// Side, rows and readings of a file that states neither side nor rows and was shown in this order.
pub(super) fn shown(
    fields: &mut Fields,
    name: String,
    want: &Selection,
    form: Form,
    side: Option<Side>,
    order: &Order,
) -> Result<(Side, Vec<Option<u32>>, NamedReadings), FileError> {
    let path = fields.path().to_owned();
    let each = form.readings();
    let label = if fields.is_unnamed() { UNNAMED.to_owned() } else { name.clone() };
    let refuse =
        |found: String, expected: String| FileError::field(&path, label.clone(), found, expected);
    let (shape, numbers) = fields.open_field(&name, |shape| match shape.contains(&0) {
        true => Err("readings".to_owned()),
        false => Ok(()),
    })?;
    let spectrum = spectrum(&shape, side, form, want.index).map(|n| [n, n]);
    let shape = match want.patterns_first {
        true => shape,
        false => joined(&shape, spectrum.as_ref().map(|axes| &axes[..]), form),
    };
    let mut axes = shape.iter().copied().filter(|&axis| axis != 1);
    let along = if want.patterns_first { axes.next() } else { axes.next_back() };
    let length = along.unwrap_or(1) as usize;
    if !length.is_multiple_of(each) {
        let expected = format!("an even number: {}", meaning(form));
        return Err(refuse(format!("has {length} readings a measurement"), expected));
    }
    let sweeps = want.remedy.sweeps();
    if !(length / each).is_multiple_of(sweeps) {
        let found = format!("has {length} readings a measurement");
        return Err(refuse(found, format!("those of {sweeps} sweeps, as --sweeps says")));
    }
    let count = length / each / sweeps;
    let side = match side {
        Some(side) => side,
        None => side_of_sweep(count).ok_or_else(|| {
            let axes: Vec<usize> =
                shape.iter().filter(|&&axis| axis != 1).map(|&axis| axis as usize).collect();
            let hint = hint(&axes, length, form, want.patterns_first).unwrap_or_default();
            refuse(
                format!("has {length} readings, of {count} patterns ({})", meaning(form)),
                format!(
                    "those of a full sweep of n * n patterns, n a power of two, or --side N{hint}"
                ),
            )
        })?,
    };
    let (n, area) = (side.pixels(), side.area());
    if count > area {
        let found = format!("has {length} readings, of {count} patterns ({})", meaning(form));
        return Err(refuse(found, format!("at most {area} patterns for n = {n}")));
    }
    let rows = order.rows(side).map_err(|error| {
        let found = format!("({error})");
        FileError::field(
            &path,
            "--shown",
            found,
            format!("an order of the {area} patterns for n = {n}"),
        )
    })?;
    let layout = Layout::of(&shape, length, want.patterns_first)
        .ok_or_else(|| refuse(has_shape(&shape), "readings".to_owned()))?;
    let sweep: Vec<Option<u32>> = rows.iter().take(count).map(|&row| Some(row)).collect();
    let rows = sweep.repeat(sweeps);
    Ok((side, rows, NamedReadings::new(label.clone(), layout, numbers)))
}

/// The side of a sweep of this many patterns.
fn side_of_sweep(patterns: usize) -> Option<Side> {
    Side::new(patterns.isqrt() as u64).ok().filter(|side| side.area() == patterns)
}

/// What may be meant by readings whose number is no full sweep, and how they are then read. `axes` are those longer than 1.
fn hint(axes: &[usize], length: usize, form: Form, patterns_first: bool) -> Option<String> {
    let each = form.readings();
    if let [height, width] = *axes
        && !patterns_first
    {
        if height == width && Side::new(width as u64).is_ok() && each == 2 {
            return Some(format!(
                "; a spectrum of {height} x {width} is read with --side {width} and --readings differences or single"
            ));
        }
        if height.is_multiple_of(each) && side_of_sweep(height / each).is_some() {
            return Some(format!(
                "; patterns are along its first axis: add --patterns-first, or, if its last axis has samples of one reading, \
                 nirspi readings --samples {width}"
            ));
        }
    }
    if each == 2 && side_of_sweep(length).is_some() {
        let single =
            "; one value a pattern is read with --readings single or --readings differences";
        return Some(single.to_owned());
    }
    let several = |times: &usize| {
        let patterns = (length / each).checked_div(*times)?;
        let side = side_of_sweep(patterns).filter(|side| side.pixels() >= LEAST_OF_SEVERAL)?;
        (patterns * times * each == length).then(|| side.pixels())
    };
    let times = (2..=MOST_TIMES).find(|times| several(times).is_some())?;
    let n = several(&times)?;
    Some(format!(
        "; {times} sweeps of {n} x {n} patterns are read with --sweeps {times}, {times} samples of each reading with \
         nirspi readings --samples {times}"
    ))
}

/// The most sweeps, or samples of a reading, that a refusal names, and the smallest side of their images.
const MOST_TIMES: usize = 64;
const LEAST_OF_SEVERAL: usize = 8;

/// The side of a spectrum, `(..., n, n)` readings or `(..., n, n, 2)` pairs: the side that the user states, or a side
/// of whose square no measurement of n patterns is a full sweep. One of (n, n) by its index is no spectrum.
fn spectrum(shape: &[u64], side: Option<Side>, form: Form, index: Option<usize>) -> Option<u64> {
    let axes: Vec<u64> = shape.iter().copied().filter(|&axis| axis != 1).collect();
    let axes = match form {
        Form::Pairs => axes.strip_suffix(&[2])?,
        Form::Single | Form::Differences => &axes,
        Form::Halves => return None,
    };
    let [before @ .., height, width] = axes else { return None };
    let n = Side::new(*width).ok().filter(|_| height == width)?;
    let is_sweep = Side::new(width.isqrt()).is_ok_and(|side| side.area() == n.pixels());
    let is_said = |side| side == n && (index.is_none() || !before.is_empty());
    side.map_or(!is_sweep, is_said).then_some(*width)
}

pub(super) fn read_side(fields: &mut Fields, want: &Selection) -> Result<Option<Side>, FileError> {
    const EXPECTED: &str = "a power of two from 2 to 256";
    if !fields.holds("n") {
        return Ok(want.side);
    }
    let is_columns = fields.is_columns();
    let n = fields.read_real("n", |shape| match shape.iter().all(|&axis| axis == 1) {
        false if !is_columns => Err("one number".to_owned()),
        _ => Ok(()),
    })?;
    // A column of a text repeats the number in every line.
    if let Some(line) = n.iter().position(|value| value.to_bits() != n[0].to_bits()) {
        let found = format!("is {} in row {} of the column, {} before", n[line], line + 1, n[0]);
        return Err(FileError::field(fields.path(), "n", found, "one number"));
    }
    let refuse =
        |found: String, expected: String| FileError::field(fields.path(), "n", found, expected);
    let value = n[0];
    let side = as_integer(value)
        .and_then(|n| u64::try_from(n).ok())
        .and_then(|n| Side::new(n).ok())
        .ok_or_else(|| refuse(format!("is {value}"), EXPECTED.to_owned()))?;
    match want.side {
        Some(asked) if asked != side => {
            Err(refuse(format!("is {value}"), format!("{} as --side says", asked.pixels())))
        }
        _ => Ok(Some(side)),
    }
}

/// The rows of a file, in the order shown.
pub(super) struct Shown {
    /// The row shown k-th; `None` for a row that was not read.
    pub(super) rows: Vec<Option<u32>>,
    /// The shape in which the file has them.
    pub(super) shape: Vec<u64>,
}

/// The rows shown. A row may be shown several times.
pub(super) fn read_rows(fields: &mut Fields, side: Side) -> Result<Shown, FileError> {
    const FIELD: &str = "h_row";
    let (n, area) = (side.pixels(), side.area());
    let field = fields.read(FIELD, |shape| {
        let axes: Vec<u64> = shape.iter().copied().filter(|&axis| axis != 1).collect();
        match axes[..] {
            [] if !shape.is_empty() => Ok(()),
            [rows] if rows > 0 => Ok(()),
            [height, width] if [height, width] == [n as u64; 2] => Ok(()),
            _ => Err(format!("(M,) or ({n}, {n}) for n = {n}")),
        }
    })?;
    if field.imaginary.is_some() {
        return Err(FileError::field(fields.path(), FIELD, "has complex numbers", "real numbers"));
    }
    let numbers = field.real;
    let shape = field.shape.iter().map(|&axis| axis as u64).collect();
    let refuse =
        |found: String, expected: String| FileError::field(fields.path(), FIELD, found, expected);
    let expected = || {
        format!("a whole number from 0 to {} for n = {n}, or negative or NaN if not read", area - 1)
    };
    let mut rows: Vec<Option<u32>> = Vec::with_capacity(numbers.len());
    let within = |row: i64| u32::try_from(row).ok().filter(|&row| (row as usize) < area);
    for (k, &value) in numbers.iter().enumerate() {
        if value.is_nan() || value < 0.0 {
            rows.push(None);
            continue;
        }
        let row = as_integer(value).and_then(within).ok_or_else(|| {
            let from_one = value == area as f64 && numbers.iter().all(|&row| row != 0.0);
            let hint = if from_one { "; counted from 1, each is one too many" } else { "" };
            refuse(format!("is {value} at [{k}]"), format!("{}{hint}", expected()))
        })?;
        rows.push(Some(row));
    }
    match rows.iter().any(Option::is_some) {
        true => Ok(Shown { rows, shape }),
        false => Err(refuse("has no row that was read".to_owned(), expected())),
    }
}

/// A note on rows that were shown several times, if there are any.
pub(super) fn repeats(rows: &[Option<u32>]) -> Option<String> {
    let last = rows.iter().flatten().max()?;
    let mut counts = vec![0_usize; *last as usize + 1];
    rows.iter().flatten().for_each(|&row| counts[row as usize] += 1);
    let of_several = || counts.iter().copied().filter(|&count| count > 1);
    let (least, most) = (of_several().min()?, of_several().max()?);
    let times = if least == most { most.to_string() } else { format!("{least} to {most}") };
    let shown = counts.iter().filter(|&&count| count > 0).count();
    let which = match of_several().count() {
        several if several == shown => "each pattern was".to_owned(),
        1 => "one pattern was".to_owned(),
        several => format!("{several} of {shown} patterns were"),
    };
    Some(format!("{which} shown {times} times: the mean of its readings is used"))
}

/// A note on a side that is the number of pixels of a whole sweep, if it is.
pub(super) fn side_of_pixels(side: Side, rows: &[Option<u32>]) -> Option<String> {
    let n = side.pixels();
    let inner = Side::new(n.isqrt() as u64).ok().filter(|inner| inner.area() == n)?.pixels();
    let mut seen = vec![false; n];
    rows.iter().flatten().for_each(|&row| {
        seen.get_mut(row as usize).into_iter().for_each(|seen| *seen = true);
    });
    let is_sweep = rows.len() == n && seen.iter().all(|&seen| seen);
    is_sweep.then(|| {
        format!("n is {n} and the {n} rows are those of a sweep of {inner} x {inner}, whose n is {inner}")
    })
}

/// The whole number that a float represents. Every row number and side is exact in float64.
fn as_integer(value: f64) -> Option<i64> {
    (value.fract() == 0.0 && value.abs() < 2f64.powi(53)).then_some(value as i64)
}

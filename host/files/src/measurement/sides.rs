//! Pattern and complement that a file keeps apart: in two fields, or as readings with a sign.

use super::{FileError, Form, Selection};
use crate::array::{has_shape, shape_text};
use crate::field::Field;
use crate::fields::Fields;
use std::collections::HashMap;

/// The field that says whether a reading is of a pattern or of its complement.
const SIGN: &str = "sign";

/// The two names of `--field positive,negative`, if the file has such fields and none of the whole
/// name.
pub(super) fn two_fields<'n>(fields: &Fields, name: &'n str) -> Option<(&'n str, &'n str)> {
    let (positive, negative) = name.split_once(',')?;
    let (positive, negative) = (positive.trim(), negative.trim());
    let both = fields.holds(positive) && fields.holds(negative);
    (both && !fields.holds(name)).then_some((positive, negative))
}

/// Makes pairs of readings that the file keeps apart: the field `name` then holds them on a last
/// axis of two. A note, if there were any.
pub(super) fn make_pairs(
    fields: &mut Fields,
    name: &str,
    want: &Selection,
) -> Result<Option<String>, FileError> {
    if let Some((positive, negative)) = two_fields(fields, name) {
        if !matches!(want.form, None | Some(Form::Pairs)) {
            let expected = "--readings pairs, which is the default";
            return Err(FileError::field(fields.path(), name, "names two fields", expected));
        }
        let [first, second] =
            [fields.read(positive, |_| Ok(()))?, fields.read(negative, |_| Ok(()))?];
        let pairs = side_by_side(&first, &second).ok_or_else(|| {
            let [first, second] = [&first, &second].map(shape_of);
            let expected = format!("{} as `{positive}`, real or complex alike", shape_text(&first));
            FileError::field(fields.path(), negative, has_shape(&second), expected)
        })?;
        fields.set(name, pairs);
        return Ok(None);
    }
    if fields.is_unnamed() || !fields.holds(SIGN) || !matches!(want.form, None | Some(Form::Pairs))
    {
        return Ok(None);
    }
    by_sign(fields, name)
}

/// Makes pairs of readings with a sign. Nothing is done if the field `sign` has another length than
/// the readings: then it does not belong to them.
fn by_sign(fields: &mut Fields, name: &str) -> Result<Option<String>, FileError> {
    let any = |_: &[u64]| Ok(());
    let (sign, readings) = (fields.read(SIGN, any)?, fields.read(name, any)?);
    if sign.real.len() != readings.real.len() || sign.real.len() < 2 {
        return Ok(None);
    }
    let path = fields.path().to_owned();
    if let Some(at) = sign.real.iter().position(|sign| sign.is_nan()) {
        let expected = "1 for a pattern; -1 or 0 for a complement";
        return Err(FileError::field(&path, SIGN, format!("is NaN at [{at}]"), expected));
    }
    let rows = match fields.holds("h_row") {
        true => Some(fields.read("h_row", any)?.real),
        false => None,
    };
    if rows.as_ref().is_some_and(|rows| rows.len() != sign.real.len()) {
        return Ok(None);
    }
    // The k-th reading of a row on one side belongs to the k-th on the other; without rows, all
    // count as one row.
    let row = |at: usize| rows.as_ref().map_or(0, |rows| rows[at].to_bits());
    let mut complements: HashMap<u64, Vec<usize>> = HashMap::new();
    for at in (0..sign.real.len()).rev().filter(|&at| sign.real[at] <= 0.0) {
        complements.entry(row(at)).or_default().push(at);
    }
    let patterns: Vec<usize> = (0..sign.real.len()).filter(|&at| sign.real[at] > 0.0).collect();
    let mut pairs = Vec::with_capacity(patterns.len());
    for &at in &patterns {
        let Some(complement) = complements.get_mut(&row(at)).and_then(Vec::pop) else {
            let found = format!("has a pattern at [{at}] and no complement for it");
            return Err(FileError::field(&path, SIGN, found, "one of each for every row"));
        };
        pairs.push((at, complement));
    }
    if let Some(at) = complements.values().flatten().min() {
        let found = format!("has a complement at [{at}] and no pattern for it");
        return Err(FileError::field(&path, SIGN, found, "one of each for every row"));
    }
    let both =
        |values: &Vec<f64>| pairs.iter().flat_map(|&(a, b)| [values[a], values[b]]).collect();
    let made = Field {
        shape: vec![pairs.len(), 2],
        real: both(&readings.real),
        imaginary: readings.imaginary.as_ref().map(both),
    };
    fields.set(name, made);
    if let Some(rows) = rows {
        let real = patterns.iter().map(|&at| rows[at]).collect();
        fields.set("h_row", Field { shape: vec![pairs.len()], real, imaginary: None });
    }
    Ok(Some(format!("pairs of pattern and complement by the field `{SIGN}`")))
}

/// Two fields of one shape on a last axis of two.
fn side_by_side(first: &Field, second: &Field) -> Option<Field> {
    let alike =
        first.shape == second.shape && first.imaginary.is_some() == second.imaginary.is_some();
    let both = |a: &[f64], b: &[f64]| a.iter().zip(b).flat_map(|(&a, &b)| [a, b]).collect();
    alike.then(|| Field {
        shape: [&first.shape[..], &[2]].concat(),
        real: both(&first.real, &second.real),
        imaginary: first.imaginary.as_ref().zip(second.imaginary.as_ref()).map(|(a, b)| both(a, b)),
    })
}

fn shape_of(field: &Field) -> Vec<u64> {
    field.shape.iter().map(|&axis| axis as u64).collect()
}

//! Fourier patterns: readings under cosines of each frequency in three or four steps, or the spectrum that was made of
//! them.

use crate::FileError;
use crate::field::Field;
use crate::fields::Fields;
use crate::measurement::called::called;
use crate::measurement::patterns::Patterns;
use crate::measurement::readings::is_reading;
use crate::measurement::readings::readings_field;
use crate::measurement::weighed::{Plain, Which};
use crate::measurement::{PatternSelection, Selection};
use crate::plain::MAX_MEMORY_BYTES;
use nirspi_recon::Size;
use nirspi_recon::fourier::{Complex, Spectrum, shown_weights};
use nirspi_recon::words::count_of;
use std::path::Path;
use std::sync::Arc;

/// The patterns as they are shown: of each frequency, row by row, all steps.
pub(super) fn shown(size: Size, steps: usize) -> Result<Patterns, (String, String)> {
    let (area, count) = (size.area(), size.area() * steps);
    if (count * area * size_of::<f64>()) as u64 > MAX_MEMORY_BYTES {
        return Err((format!("{count} patterns of {size} pixels"), "at most 512 MiB".to_owned()));
    }
    Ok(Patterns { size, count, weights: shown_weights(size, steps) })
}

/// Reads the readings of Fourier patterns, or a complex spectrum, from a file: coefficients of frequencies
/// as readings of cosines and sines, without a dark level.
///
/// # Errors
/// As [`read`](crate::measurement::read).
pub(in crate::measurement) fn read_fourier(
    steps: usize,
    of_patterns: &PatternSelection,
    readings: &Path,
    want: &Selection,
    which: Which,
) -> Result<Vec<Plain>, FileError> {
    let mut fields = Fields::open(readings, want.decimal_comma)?;
    let want = &*called(&mut fields, want)?;
    let name = readings_field(&mut fields, want)?;
    let notes: Vec<String> = fields.skipped().map(str::to_owned).into_iter().collect();
    let taken = fields.taken();
    let refused =
        |found: String, expected: String| FileError::field(readings, name.clone(), found, expected);
    let field = match fields.is_unnamed() {
        true => fields.into_field(&name)?,
        false => fields.read(&name, |_| Ok(()))?,
    };
    let is_spectrum = field.imaginary.is_some();
    let spectrum = |field: Field| match is_spectrum {
        true => of_complex(field, of_patterns.size),
        false => of_steps(&field, steps, of_patterns.size),
    };
    let fields = match which {
        Which::One => vec![one_of(field, want.index).map_err(|(f, e)| refused(f, e))?],
        Which::All if spectrum(field.clone()).is_ok() => vec![field],
        Which::All => each_of(field),
    };
    let mut found: Vec<Plain> = Vec::with_capacity(fields.len());
    for field in fields {
        let (mut spectrum, of_steps) =
            spectrum(field).map_err(|(found, expected)| refused(found, expected))?;
        let mut notes = notes.clone();
        notes.extend(spectrum.center());
        // Of a spectrum, half may be a copy of the other half.
        let of_opposites = || spectrum.noise().filter(|noise| !is_spectrum || *noise > 0.0);
        let most_noise = of_steps.or_else(of_opposites);
        let not_read: Vec<usize> =
            (0..spectrum.values.len()).filter(|&at| spectrum.values[at].is_none()).collect();
        let (size, area) = (spectrum.size, spectrum.size.area());
        let (rows, values) = spectrum.rows();
        if values.is_empty() {
            return Err(refused(
                "has no frequency that was read".to_owned(),
                "at least one".to_owned(),
            ));
        }
        if (rows.len() * area * size_of::<f64>()) as u64 > MAX_MEMORY_BYTES {
            let found = format!("has {} of {size} pixels", count_of(rows.len(), "coefficient"));
            let expected = "at most 512 MiB of patterns: about 90 x 90 pixels";
            return Err(refused(found, expected.to_owned()));
        }
        // Measurements of the same frequencies have the same patterns.
        let patterns = match found.last() {
            Some(last) if last.not_read == not_read => Arc::clone(&last.patterns),
            _ => {
                let weights = rows.iter().flat_map(|row| row.weights(size)).collect();
                Arc::new(Patterns { size, count: rows.len(), weights })
            }
        };
        notes.push(match is_spectrum {
            true => format!("a spectrum of {} frequencies", area - not_read.len()),
            false => format!("{steps} steps of each frequency: constant light falls out"),
        });
        let places = (0..values.len()).collect();
        let (taken, noise, dark) = (taken.clone(), None, false);
        found.push(Plain {
            patterns,
            values,
            places,
            not_read,
            taken,
            noise,
            most_noise,
            notes,
            dark,
        });
    }
    Ok(found)
}

/// The measurements along the first axis.
fn each_of(field: Field) -> Vec<Field> {
    let several = field.shape.first().copied().unwrap_or(1).max(1);
    if field.shape.len() < 2 {
        return vec![field];
    }
    let each = field.real.len() / several;
    let part = |values: &[f64], at: usize| values[at * each..(at + 1) * each].to_vec();
    let of = |at: usize| Field {
        shape: field.shape[1..].to_vec(),
        real: part(&field.real, at),
        imaginary: field.imaginary.as_ref().map(|imaginary| part(imaginary, at)),
    };
    (0..several).map(of).collect()
}

/// The measurement of this index, along the first axis.
fn one_of(field: Field, index: Option<usize>) -> Result<Field, (String, String)> {
    let Some(index) = index else { return Ok(field) };
    let shape = field.shape.clone();
    let mut all = each_of(field);
    if shape.len() < 2 || index >= all.len() {
        let found = format!("has shape {shape:?} for --index {index}");
        return Err((found, "several measurements along the first axis".to_owned()));
    }
    Ok(all.swap_remove(index))
}

/// The size of the image and the columns of the spectrum for this many frequencies.
fn layout(
    frequencies: usize,
    shape: Option<(usize, usize)>,
    size: Option<Size>,
) -> Option<(Size, usize)> {
    let half = |size: Size| size.width() / 2 + 1;
    let fits = |size: Size, columns: usize| {
        size.height() * columns == frequencies
            && shape.is_none_or(|shape| shape == (size.height(), columns))
    };
    let of = |size: Size| {
        [size.width(), half(size)]
            .into_iter()
            .find(|&columns| fits(size, columns))
            .map(|c| (size, c))
    };
    if let Some(size) = size {
        return of(size);
    }
    if let Some((height, width)) = shape {
        let square = Size::new(height, height).ok().and_then(of);
        return square.or_else(|| Size::new(height, width).ok().and_then(of));
    }
    (1..=frequencies.isqrt() * 2).filter_map(|side| Size::new(side, side).ok()).find_map(of)
}

fn refusal(shape: &[usize], steps: Option<usize>) -> (String, String) {
    let axes: Vec<String> = shape.iter().map(ToString::to_string).collect();
    let found = format!("has shape ({})", axes.join(", "));
    let each = steps.map_or(String::new(), |steps| format!(", {steps}"));
    let expected = format!(
        "(height, width{each}) or (height, width / 2 + 1{each}) frequencies, or --size HxW beside one axis"
    );
    (found, expected)
}

/// A spectrum, and the noise of its rows by the steps of each frequency.
type Seen = (Spectrum, Option<f64>);

/// The spectrum that a file holds.
fn of_complex(field: Field, size: Option<Size>) -> Result<Seen, (String, String)> {
    let shape: Vec<usize> = field.shape.iter().copied().filter(|&axis| axis != 1).collect();
    let two = match shape[..] {
        [height, width] => Some((height, width)),
        _ => None,
    };
    let (size, columns) =
        layout(field.real.len(), two, size).ok_or_else(|| refusal(&field.shape, None))?;
    let imaginary = field.imaginary.unwrap_or_default();
    let value = |(&real, &imaginary): (&f64, &f64)| {
        (is_reading(real) && is_reading(imaginary)).then_some((real, imaginary))
    };
    let values: Vec<Option<Complex>> = field.real.iter().zip(&imaginary).map(value).collect();
    Ok((Spectrum { size, columns, values }, None))
}

/// The noise of a coefficient's part by four steps of its frequency, of which two opposite ones have the same sum as the other
/// two, without noise.
fn noise_of_steps(of: impl Iterator<Item = [f64; 4]>) -> Option<f64> {
    let misses: Vec<f64> = of
        .filter(|steps| steps.iter().copied().all(is_reading))
        .map(|[one, two, three, four]| (one + three - two - four).powi(2))
        .collect();
    // Four readings miss, two make a part.
    let variance = misses.iter().sum::<f64>() / (2 * misses.len()) as f64;
    (misses.len() >= LEAST_STEPS).then(|| variance.sqrt())
}

/// Fewest frequencies whose steps tell a noise: to a quarter.
const LEAST_STEPS: usize = 8;

/// The coefficients of readings in steps: a last axis of the steps, a first axis, or one after another.
fn of_steps(field: &Field, steps: usize, size: Option<Size>) -> Result<Seen, (String, String)> {
    let shape: Vec<usize> = field.shape.iter().copied().filter(|&axis| axis != 1).collect();
    let refused = || refusal(&field.shape, Some(steps));
    let (is_first, rest) = match shape[..] {
        [ref rest @ .., last] if last == steps && !rest.is_empty() => (false, rest),
        [first, ref rest @ ..] if first == steps && !rest.is_empty() => (true, rest),
        [all] if all % steps == 0 => (false, &[][..]),
        _ => return Err(refused()),
    };
    let frequencies = field.real.len() / steps;
    let two = match *rest {
        [height, width] => Some((height, width)),
        _ => None,
    };
    let (size, columns) = layout(frequencies, two, size).ok_or_else(refused)?;
    let at = |frequency: usize, step: usize| match is_first {
        true => field.real[step * frequencies + frequency],
        false => field.real[frequency * steps + step],
    };
    let value = |frequency: usize| -> Option<Complex> {
        let read = |step| Some(at(frequency, step)).filter(|&value| is_reading(value));
        match steps {
            4 => Some((read(0)? - read(2)?, read(1)? - read(3)?)),
            _ => {
                let (one, two, three) = (read(0)?, read(1)?, read(2)?);
                let real = (2.0 * one - two - three) * 2.0 / 3.0;
                Some((real, (two - three) * 2.0 / 3.0_f64.sqrt()))
            }
        }
    };
    let spectrum = Spectrum { size, columns, values: (0..frequencies).map(value).collect() };
    let most_noise = match steps {
        4 => noise_of_steps(
            (0..frequencies).map(|frequency| [0, 1, 2, 3].map(|step| at(frequency, step))),
        ),
        _ => None,
    };
    Ok((spectrum, most_noise))
}

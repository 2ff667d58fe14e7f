//! An open file whose shapes fit together, and its measurements one by one.

use super::called::called;
use super::noise::{Deviations, MOST_NOISE, NOISE};
use super::readings::{
    NamedReadings, check_infinite, expected_of, found_names, is_reading, readings_field,
};
use super::reference::read_reference;
use super::remedy::all_on;
use super::rows::{Shown, read_rows, read_side, repeats, shown, side_of_pixels};
use super::sides::make_pairs;
use super::{FileError, Form, MeasurementFile, READINGS, Readings, Reference, Remedy, Selection};
use crate::field::Field;
use crate::fields::Fields;
use crate::provenance::Taken;
use nirspi_recon::law::{Claim, LampReadings, OVERLOAD};
use nirspi_recon::{Image, Rows, Side};
use std::path::Path;

/// An open file whose shapes fit together.
pub(super) struct Opened {
    pub(super) fields: Fields,
    pub(super) side: Side,
    /// The row shown k-th; `None` for a row that was not read.
    rows: Vec<Option<u32>>,
    /// All rows, if each was read: the measurements share them.
    pub(super) every_row: Option<Rows>,
    pub(super) form: Form,
    pub(super) remedy: Remedy,
    pub(super) side_guessed: bool,
    pub(super) readings: NamedReadings,
    reference: Option<(Field, usize)>,
    /// Where the numbers come from, without the name of the file.
    pub(super) taken: Taken,
    pub(super) noise: Deviations,
    pub(super) most_noise: Deviations,
    pub(super) notes: Vec<String>,
}

/// An open file whose readings are in memory.
pub(super) struct Loaded<'o> {
    pub(super) opened: &'o Opened,
    pub(super) numbers: Field,
}

impl Opened {
    pub(super) fn open(path: &Path, want: &Selection) -> Result<Self, FileError> {
        Self::of(Fields::open(path, want.decimal_comma)?, want)
    }

    /// The measurements of an open file.
    pub(super) fn of(mut fields: Fields, want: &Selection) -> Result<Self, FileError> {
        let path = &*fields.path().to_owned();
        let want = &*called(&mut fields, want)?;
        let side = read_side(&mut fields, want)?;
        let has_rows = fields.holds("h_row");
        if has_rows && want.shown.is_some() {
            return Err(FileError::field(path, "h_row", "is in the file", "no --shown beside it"));
        }
        if !has_rows && want.shown.is_none() {
            let expected = "n, h_row, and y or d, or --field h_row=NAME for another name; or --shown ORDER for patterns in a known order";
            return Err(FileError::missing(path, "h_row", &found_names(&fields), expected));
        }
        let name = readings_field(&mut fields, want)?;
        let is_d = name == "d";
        let default = if name == "d" { Form::Differences } else { Form::Pairs };
        let stated = if name == "y" { stated_form(&mut fields) } else { None };
        let form = want.form.or(stated).unwrap_or(default);
        let mut notes: Vec<String> = fields.skipped().map(str::to_owned).into_iter().collect();
        notes.extend(make_pairs(&mut fields, &name, want)?);
        let side_guessed = side.is_none();
        let (side, mut rows, readings) = match &want.shown {
            None => {
                let Some(side) = side else {
                    let expected = "n, h_row, and y or d; or --side N";
                    return Err(FileError::missing(path, "n", &found_names(&fields), expected));
                };
                if want.remedy.sweeps() > 1 {
                    let expected =
                        "no --sweeps beside it: it has a row for every pattern of every sweep";
                    return Err(FileError::field(path, "h_row", "is in the file", expected));
                }
                let Shown { rows, shape } = read_rows(&mut fields, side)?;
                notes.extend(repeats(&rows));
                notes.extend(side_of_pixels(side, &rows));
                let expected = expected_of(form, rows.len(), shape);
                (side, rows, NamedReadings::open(&mut fields, name, want, &expected)?)
            }
            Some(order) => {
                let entry = order.entry().filter(|entry| entry.has_undefined_ties);
                notes.extend(entry.map(|entry| format!(
                    "{} leaves the order of equal patterns of {order} to an unstable sort: an h_row or --shown table:FILE \
                     of the patterns as they were shown is exact",
                    entry.package.unwrap_or("its package")
                )));
                let found = shown(&mut fields, name, want, form, side, order)?;
                notes.extend(repeats(&found.1));
                found
            }
        };
        want.remedy.check(path, &readings.name, form, &rows)?;
        if want.transpose {
            let n = side.pixels() as u32;
            for row in rows.iter_mut().flatten() {
                *row = (*row % n) * n + *row / n;
            }
        }
        let reference =
            read_reference(&mut fields, side, readings.layout.count).unwrap_or_else(|error| {
                notes.push(format!("not compared with the reconstruction in the file: {error}"));
                None
            });
        let taken = fields.taken();
        // What is said of the noise is said of differences.
        let mut said = |name| match is_d {
            true => Deviations::read(&mut fields, name, readings.layout.count),
            false => Deviations::default(),
        };
        let (noise, most_noise) = (said(NOISE), said(MOST_NOISE));
        // Rows that were shown several times are no list of rows.
        let every_row: Option<Vec<u32>> = rows.iter().copied().collect();
        let every_row = every_row.and_then(|rows| Rows::new(side, rows).ok());
        Ok(Self {
            fields,
            side,
            rows,
            every_row,
            form,
            remedy: want.remedy,
            side_guessed,
            readings,
            reference,
            taken,
            noise,
            most_noise,
            notes,
        })
    }

    /// Number of patterns, those that were not read included.
    pub(super) fn patterns(&self) -> usize {
        self.rows.len()
    }

    /// The file with its readings in memory.
    pub(super) fn loaded(&mut self) -> Result<Loaded<'_>, FileError> {
        let numbers = self.readings.numbers(&mut self.fields)?;
        Ok(Loaded { opened: self, numbers })
    }

    /// A measurement without any pattern that was read.
    pub(super) fn no_pattern(&self) -> FileError {
        let found = "has no pattern that was read: all are NaN or too large";
        FileError::field(self.fields.path(), self.readings.name.clone(), found, "finite readings")
    }

    /// The file's own reconstruction of the measurement of this index.
    pub(super) fn reference(&self, index: usize) -> Option<Reference> {
        let (field, count) = self.reference.as_ref()?;
        let area = self.side.area();
        let start = if *count == 1 { 0 } else { index * area };
        let image = |values: &Vec<f64>| {
            let pixels = values[start..start + area].iter().map(|&value| value as f32);
            Image::new(self.side, pixels.collect())
        };
        Some(Reference { real: image(&field.real), imaginary: field.imaginary.as_ref().map(image) })
    }
}

impl Loaded<'_> {
    /// The rows at these positions, each once, in the order first shown, and the positions of each.
    fn by_row(&self, positions: &[usize]) -> (Vec<u32>, Vec<Vec<usize>>) {
        let mut at = vec![None; self.opened.side.area()];
        let (mut rows, mut groups) = (Vec::new(), Vec::<Vec<usize>>::new());
        for &k in positions {
            let Some(row) = self.opened.rows[k] else { continue };
            let group = *at[row as usize].get_or_insert_with(|| {
                rows.push(row);
                groups.push(Vec::new());
                groups.len() - 1
            });
            groups[group].push(k);
        }
        (rows, groups)
    }

    /// The readings of the all-on pattern among these, if it was shown again and again without complements.
    fn lamp_readings(&self, y: &[f64]) -> Option<LampReadings> {
        let opened = self.opened;
        // The list of all rows has each row once.
        if opened.form.readings() == 2 || opened.every_row.is_some() {
            return None;
        }
        let places = all_on(&opened.rows).into_iter().filter(|&at| is_reading(y[at]));
        LampReadings::new(places.collect(), y)
    }

    /// The measurement of this index, without the patterns that were not read.
    pub(super) fn measurement(&self, index: usize) -> Result<MeasurementFile, FileError> {
        let Self { opened, numbers } = self;
        let path = opened.fields.path();
        let NamedReadings { name, layout, .. } = &opened.readings;
        let series = |values: &Vec<f64>| layout.series(values, index);
        let (real, imaginary) = (series(&numbers.real), numbers.imaginary.as_ref().map(series));
        for values in [Some(&real), imaginary.as_ref()].into_iter().flatten() {
            check_infinite(path, name, values)?;
        }
        let overloaded = |k: &usize| real[*k].abs() >= OVERLOAD;
        let overloads = (0..real.len()).filter(overloaded).collect();
        let count = opened.rows.len();
        let applied = |values| opened.remedy.applied(opened.form, count, values);
        let (mut real, imaginary) = (applied(real), imaginary.map(applied));
        let mut lamp = None;
        if let (Some(steady), None) = (self.lamp_readings(&real), &imaginary) {
            lamp = steady.lamp(&real, opened.form);
            if opened.remedy.divide_by_lamp {
                real = steady.divided(&real);
            }
        }
        let at = |k: usize| {
            let (first, second) = match opened.form {
                Form::Pairs => (2 * k, Some(2 * k + 1)),
                Form::Halves => (k, Some(count + k)),
                Form::Single | Form::Differences => (k, None),
            };
            std::iter::once(first).chain(second)
        };
        let is_read = |k: usize| {
            let finite = |values: &[f64]| at(k).all(|reading| is_reading(values[reading]));
            opened.rows[k].is_some() && finite(&real) && imaginary.as_deref().is_none_or(finite)
        };
        let (read, not_read): (Vec<usize>, Vec<usize>) = (0..count).partition(|&k| is_read(k));
        if read.is_empty() {
            return Err(opened.no_pattern());
        }
        let (h_row, groups) = match &opened.every_row {
            Some(every) if not_read.is_empty() => (every.clone(), None),
            _ => {
                let (rows, groups) = self.by_row(&read);
                let rows = Rows::new(opened.side, rows).map_err(|error| {
                    FileError::field(path, "h_row", format!("({error})"), "each row once")
                })?;
                (rows, Some(groups))
            }
        };
        let kept = |values: Vec<f64>| -> Readings {
            let values = match &groups {
                None if opened.form != Form::Halves => values,
                None => read.iter().flat_map(|&k| at(k)).map(|at| values[at]).collect(),
                Some(groups) => groups.iter().flat_map(|group| mean(group, at, &values)).collect(),
            };
            match opened.form {
                Form::Pairs | Form::Halves => Readings::Pairs(values),
                Form::Single => Readings::Single(values),
                Form::Differences => Readings::Differential(values),
            }
        };
        let places = match &groups {
            Some(groups) => groups.iter().map(|group| group[0]).collect(),
            None => read.clone(),
        };
        Ok(MeasurementFile {
            h_row,
            readings: kept(real),
            imaginary: imaginary.map(kept),
            places,
            not_read,
            overloads,
            lamp,
            claim: Claim {
                form: opened.form,
                side_guessed: opened.side_guessed,
                divide_by_lamp: opened.remedy.divide_by_lamp,
            },
            remedy: opened.remedy,
            patterns: count,
            reference: opened.reference(index),
            taken: opened.taken.clone(),
            noise: opened.noise.of(index),
            most_noise: opened.most_noise.of(index),
            notes: opened.notes.clone(),
        })
    }
}

/// The mean reading of a pattern over these positions, or the mean readings of pattern and
/// complement; `at` gives the places of the readings of a position.
fn mean<P: Iterator<Item = usize>>(
    positions: &[usize],
    at: impl Fn(usize) -> P,
    values: &[f64],
) -> Vec<f64> {
    let mut sums: Vec<f64> = at(positions[0]).map(|place| values[place]).collect();
    for &k in &positions[1..] {
        sums.iter_mut().zip(at(k)).for_each(|(sum, place)| *sum += values[place]);
    }
    sums.iter_mut().for_each(|sum| *sum /= positions.len() as f64);
    sums
}

/// The form that the file states for `y`. A field of another kind says nothing.
pub(super) fn stated_form(fields: &mut Fields) -> Option<Form> {
    fields.text(READINGS)?.parse().ok()
}

//! Readings of a trace: a detector's samples while patterns were shown, and perhaps those of a
//! trigger.
//!
//! # Invariant
//! Each reading is the mean of the samples of one pattern and of no other one. A pattern whose
//! trigger is missing has NaN for a reading, and those behind it keep their places
//! (`tests::lost_and_extra_edges_are_named_and_move_no_other_reading`).

mod series;
mod sums;
mod windows;
mod words;

use super::FileError;
use super::fields::UNNAMED;
use super::provenance::Taken;
use series::{Series, Shape};
use std::ops::Range;
use std::path::Path;
use sums::Sums;
use windows::{Edge, Edges, Windows};

/// The most readings of a trace: 16 000 sweeps of 32 x 32 patterns and their complements.
const MAX_READINGS: usize = 1 << 25;

/// Readings that [`Found::first`] shows.
const FIRST: usize = 8;

/// Numbers without a heading, little-endian.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Raw {
    /// 32-bit floats.
    F32,
    /// 64-bit floats.
    F64,
    /// Signed 16-bit integers.
    I16,
    /// Signed 32-bit integers.
    I32,
}

impl Raw {
    /// Every kind.
    pub const ALL: [Self; 4] = [Self::F32, Self::F64, Self::I16, Self::I32];

    /// The word for the kind, the kind in a few words, the bytes of a number, and the type as NumPy writes it.
    fn facts(self) -> (&'static str, &'static str, usize, &'static str) {
        match self {
            Self::F32 => ("f32", "32-bit floats", 4, "<f4"),
            Self::F64 => ("f64", "64-bit floats", 8, "<f8"),
            Self::I16 => ("i16", "signed 16-bit integers", 2, "<i2"),
            Self::I32 => ("i32", "signed 32-bit integers", 4, "<i4"),
        }
    }

    /// The word for the kind.
    #[must_use]
    pub fn name(self) -> &'static str {
        self.facts().0
    }

    /// The kind in a few words.
    #[must_use]
    pub fn about(self) -> &'static str {
        self.facts().1
    }

    /// Bytes of a number.
    #[must_use]
    pub fn bytes(self) -> usize {
        self.facts().2
    }

    /// The type as NumPy writes it.
    #[must_use]
    pub fn descr(self) -> &'static str {
        self.facts().3
    }

    /// The number in these bytes, as many as a number of this kind has.
    ///
    /// # Panics
    /// If there are fewer bytes.
    #[must_use]
    pub fn number(self, bytes: &[u8]) -> f64 {
        let mut number = Vec::with_capacity(1);
        self.numbers(bytes, &mut number);
        number[0]
    }

    /// Appends the numbers in these bytes.
    pub fn numbers(self, bytes: &[u8], numbers: &mut Vec<f64>) {
        fn each<const N: usize>(
            bytes: &[u8],
            numbers: &mut Vec<f64>,
            number: impl Fn([u8; N]) -> f64,
        ) {
            numbers.extend(bytes.as_chunks().0.iter().map(|&bytes| number(bytes)));
        }
        match self {
            Self::F32 => each(bytes, numbers, |b| f32::from_le_bytes(b).into()),
            Self::F64 => each(bytes, numbers, f64::from_le_bytes),
            Self::I16 => each(bytes, numbers, |b| i16::from_le_bytes(b).into()),
            Self::I32 => each(bytes, numbers, |b| i32::from_le_bytes(b).into()),
        }
    }

    /// Appends the bytes of a number. A number beyond the kind's range becomes its nearest.
    pub fn append(self, number: f64, bytes: &mut Vec<u8>) {
        match self {
            Self::F32 => bytes.extend_from_slice(&(number as f32).to_le_bytes()),
            Self::F64 => bytes.extend_from_slice(&number.to_le_bytes()),
            Self::I16 => bytes.extend_from_slice(&(number as i16).to_le_bytes()),
            Self::I32 => bytes.extend_from_slice(&(number as i32).to_le_bytes()),
        }
    }
}

impl std::str::FromStr for Raw {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, String> {
        let known = Self::ALL.into_iter().find(|raw| raw.name() == word);
        known.ok_or_else(|| "expected f32, f64, i16 or i32".to_owned())
    }
}

/// Which samples of a file make readings.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Cut {
    /// The field with the detector's samples; not needed where the file has no other one.
    pub field: Option<String>,
    /// The field with the trigger's samples, as many: a pattern begins where it rises through the middle of its range; with
    /// `NAME:fall` where it falls, with `NAME:both` at both.
    pub trigger: Option<String>,
    /// Samples of a pattern. With a trigger, its edges must show this number.
    pub samples: Option<usize>,
    /// Samples to skip before the first pattern.
    pub skip: usize,
    /// Samples at the beginning of each pattern that its reading leaves out, while the light settles.
    pub settle: usize,
    /// Readings to keep. Without a number, all are kept.
    pub count: Option<usize>,
    /// The kind of the numbers of a file without a heading.
    pub raw: Option<Raw>,
    /// Whether every comma of a text file is a decimal comma.
    pub decimal_comma: bool,
}

/// The readings of a trace, and what was found on the way.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// The mean of each pattern's samples; NaN for a pattern without any.
    pub readings: Vec<f64>,
    /// Samples of a pattern: the middle one of all intervals.
    pub samples: usize,
    /// Samples of the trace.
    pub length: usize,
    /// Samples before the first pattern, and after the last reading.
    pub outside: (usize, usize),
    /// Whether a trigger said where patterns begin.
    pub by_trigger: bool,
    /// Readings that are not there: the trigger has no edge, or too few samples follow the edge.
    pub lost: Vec<usize>,
    /// Samples with an edge of the trigger that comes too early to begin a pattern. They are left out.
    pub extra: Vec<usize>,
    /// Readings that are not there because a sample is an instrument's word for overload.
    pub overloads: Vec<usize>,
    /// Samples after the last edge, if the trace ends before the pattern does.
    pub cut_off: Option<usize>,
    /// What a text has beside its table and was left out, in one line.
    pub skipped: Option<String>,
    /// Where the samples come from, by what the file says of it.
    pub taken: Taken,
    /// The first readings.
    pub first: First,
}

/// The beginning of a trace, for a picture.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct First {
    /// Places and values of samples: all of them, or evenly chosen ones.
    pub samples: Vec<(usize, f64)>,
    /// The samples of each of the first readings; an empty range for a reading that is not there.
    pub windows: Vec<Range<usize>>,
    /// The edges of the trigger at the beginning of a pattern.
    pub edges: Vec<usize>,
    /// The edges that come too early.
    pub extra: Vec<usize>,
}

/// Makes readings of the trace in a file: of any format that [`measurement::read`](crate::measurement::read) knows but
/// recordings, or numbers without a heading.
///
/// # Errors
/// [`FileError`], one line that names file, field, what was found and what was expected.
pub fn read(path: &Path, cut: &Cut) -> Result<Found, FileError> {
    let mut series = Series::open(path, cut.raw, cut.decimal_comma)?;
    let (trigger, edge) =
        cut.trigger.as_deref().map(|trigger| Edge::of(trigger, series.names())).unzip();
    let cut = &Cut { trigger: trigger.map(str::to_owned), ..cut.clone() };
    let (field, trigger) = fields(path, &series, cut)?;
    let last = cut.samples.filter(|&k| k > 1 && cut.skip == 0 && trigger.is_none());
    let shape = Shape { last };
    let shown = if series.is_unnamed() { UNNAMED } else { &field };
    let refuse = |of: &str, found: String, expected: String| {
        Err(FileError::field(path, of, found, expected))
    };
    let claimed = series.count(&field, shape)?;
    let Ok(length) = usize::try_from(claimed) else {
        return refuse(shown, format!("has {claimed} samples"), "fewer".to_owned());
    };
    let (windows, extra, cut_off) = match &trigger {
        Some(name) => {
            let found =
                by_trigger(path, &mut series, (name, edge.unwrap_or(Edge::Rise)), length, cut)?;
            (found.windows, found.extra, found.cut_off)
        }
        None => {
            let Some(samples) = cut.samples.filter(|&samples| samples > 0) else {
                let expected = "a trigger, or 1 sample or more of each pattern".to_owned();
                return refuse(shown, "cannot be cut".to_owned(), expected);
            };
            let left = length.saturating_sub(cut.skip);
            if left < samples {
                let found = format!("has {left} samples after the {} skipped", cut.skip);
                return refuse(shown, found, format!("{samples} or more: those of a pattern"));
            }
            (Windows::every(samples, cut.skip, cut.settle, length), Vec::new(), None)
        }
    };
    let samples = windows.samples;
    if cut.settle >= samples {
        let found = format!("has {samples} samples of a pattern");
        return refuse(shown, found, format!("more than the {} to settle", cut.settle));
    }
    let found = match &windows.edges() {
        [] => (length - cut.skip) / samples,
        _ => windows.iter().count(),
    };
    let count = cut.count.unwrap_or(found);
    if found < count || count == 0 {
        return refuse(shown, format!("has {found} readings"), format!("{count}"));
    }
    if count > MAX_READINGS {
        let expected = format!("at most {MAX_READINGS}");
        return refuse(shown, format!("has {found} readings"), expected);
    }
    let mut sums = Sums::new(windows.iter().take(count), First::range(&windows, count));
    series.each_block(&field, shape, &mut |block| sums.take(block))?;
    let sums = sums.finished();
    if let Some((at, value)) = sums.wrong {
        return refuse(shown, format!("is {value} at [{at}]"), "finite numbers".to_owned());
    }
    let empty = windows.iter().take(count).enumerate().filter(|(_, window)| window.is_empty());
    let lost = empty.map(|(k, _)| k).collect();
    let is_first = |edge: &&usize| sums.shown.contains(edge);
    let first = First {
        samples: sums.first,
        windows: windows.iter().take(FIRST.min(count)).collect(),
        edges: windows.edges().iter().filter(is_first).copied().collect(),
        extra: extra.iter().filter(is_first).copied().collect(),
    };
    Ok(Found {
        readings: sums.readings,
        samples,
        length,
        outside: (windows.first(), length.saturating_sub(sums.end)),
        by_trigger: trigger.is_some(),
        lost,
        extra,
        overloads: sums.overloads,
        cut_off: cut_off.filter(|_| cut.count.is_none()),
        skipped: series.skipped().map(str::to_owned),
        taken: series.taken().from_file(path),
        first,
    })
}

impl First {
    /// The samples to show: the first readings, and as much before them as two patterns have.
    fn range(windows: &Windows, count: usize) -> Range<usize> {
        let shown = windows.iter().take(FIRST.min(count));
        let end = shown.map(|window| window.end).max().unwrap_or(0);
        let start = windows.first().saturating_sub(2 * windows.samples);
        start..end.saturating_add(windows.samples / 2).max(start)
    }
}

/// The names of the fields of the samples and of the trigger.
fn fields(path: &Path, series: &Series, cut: &Cut) -> Result<(String, Option<String>), FileError> {
    let list = series.names().join(", ");
    if series.is_unnamed() {
        return match cut.field.is_some() || cut.trigger.is_some() {
            true => {
                let expected = "no names of fields: a file with one array has none";
                Err(FileError::field(path, UNNAMED, "is the only array", expected))
            }
            false => Ok((UNNAMED.to_owned(), None)),
        };
    }
    for name in cut.field.iter().chain(&cut.trigger) {
        if !series.names().contains(name) {
            let expected = format!("one of {list}");
            return Err(FileError::field(path, name, "is not in the file", expected));
        }
    }
    let mut rest = series.names().iter().filter(|name| Some(*name) != cut.trigger.as_ref());
    match (&cut.field, rest.next(), rest.next()) {
        (Some(field), ..) | (None, Some(field), None) => Ok((field.clone(), cut.trigger.clone())),
        _ => {
            let expected = format!("--field with one of {list}");
            Err(FileError::field(path, "--field", "is needed for several fields", expected))
        }
    }
}

fn by_trigger(
    path: &Path,
    series: &mut Series,
    (name, edge): (&str, Edge),
    length: usize,
    cut: &Cut,
) -> Result<windows::Cut, FileError> {
    let refuse = |found: String, expected: &str| Err(FileError::field(path, name, found, expected));
    let shape = Shape { last: None };
    let count = series.count(name, shape)?;
    if count != length as u64 {
        return refuse(format!("has {count} samples"), &format!("{length}, as the readings have"));
    }
    let (mut at, mut wrong) = (0, None);
    let mut range = (f64::INFINITY, f64::NEG_INFINITY);
    series.each_block(name, shape, &mut |block| {
        let skipped = cut.skip.saturating_sub(at).min(block.len());
        for (k, &level) in block.iter().enumerate().skip(skipped) {
            range = (range.0.min(level), range.1.max(level));
            if !level.is_finite() && wrong.is_none() {
                wrong = Some((at + k, level));
            }
        }
        at += block.len();
    })?;
    if let Some((at, level)) = wrong {
        return refuse(format!("is {level} at [{at}]"), "finite numbers");
    }
    let mut edges = Edges::new(edge, range, cut.skip, MAX_READINGS);
    series.each_block(name, shape, &mut |block| edges.take(block))?;
    let found = edges.count();
    if found > MAX_READINGS {
        return refuse(format!("{} more than {MAX_READINGS} times", edge.verb()), "fewer edges");
    }
    let Some(found) = edges.cut(cut.settle) else {
        let times = if found == 1 { "once" } else { "nowhere" };
        return refuse(
            format!("{} {times}", edge.verb()),
            "two edges or more: one for each pattern",
        );
    };
    match (cut.samples, found.windows.samples) {
        (Some(asked), samples) if asked != samples => {
            refuse(format!("{} every {samples} samples", edge.verb()), &format!("{asked}"))
        }
        _ => Ok(found),
    }
}

#[cfg(test)]
mod tests;

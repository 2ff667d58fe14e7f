//! What a file holds beside readings, or instead: traces and patterns of a user's own.

use super::trial::Guess;
use super::{command, command::Command};
use crate::files::contents::{Array, Contents};
use crate::files::trace::{self, Cut};
use nirspi_recon::Size;
use nirspi_recon::reconstruct::few_patterns_see;
use nirspi_recon::words::count_of;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Fields that are no readings.
pub(super) const NO_READINGS: [&str; 13] = [
    "n",
    "h_row",
    "sign",
    "simulated",
    "noise",
    "most_noise",
    "recon",
    "image",
    "images",
    "provenance",
    "patterns",
    "matrix",
    "trigger",
];

/// The most readings of a sweep: pairs of the patterns of 256 x 256 pixels.
const MOST_READINGS: usize = 2 << 16;

/// Share of a trigger's samples near one of its two levels, and how near: in shares of its range.
const AT_LEVELS: f64 = 0.98;
const NEAR: f64 = 0.1;

/// Least number of edges of a trigger, and of samples from one to the next.
const LEAST_EDGES: usize = 4;
const LEAST_SAMPLES: usize = 3;

/// A jump is so many times larger than the usual change, and that share of the largest one.
const JUMP_OF_USUAL: f64 = 8.0;
const JUMP_OF_MOST: f64 = 0.02;

/// Share of the jumps that are whole readings apart, and least number of jumps.
const IN_STEP: f64 = 0.95;
const LEAST_JUMPS: usize = 8;

/// The largest share of the variation of samples that is within readings, where they are samples of
/// readings.
const WITHIN: f64 = 0.1;

/// Least number of patterns, and of their pixels.
const LEAST_PIXELS: usize = 16;

/// Something in a file that is no measurement by Hadamard patterns.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Finding {
    /// What it is, in one line.
    pub what: String,
    /// The commands for it.
    pub commands: Vec<String>,
}

/// The samples of a trace, and the readings that they make.
pub(super) struct Trace {
    pub(super) cut: Cut,
    pub(super) readings: Vec<f64>,
    samples: usize,
    length: usize,
    path: PathBuf,
}

impl Trace {
    /// The readings of this trace; `None` if it cannot be cut so.
    pub(super) fn of(path: &Path, cut: Cut) -> Option<Self> {
        let found = trace::read(path, &cut).ok()?;
        let (samples, length) = (found.samples, found.length);
        Some(Self { cut, readings: found.readings, samples, length, path: path.to_owned() })
    }

    /// The file that the command writes the readings to.
    pub(super) fn out(&self, path: &Path) -> PathBuf {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        format!("{stem}-readings.npz").into()
    }

    pub(super) fn finding(&self) -> Finding {
        let field = self.cut.field.as_ref().map(|name| format!(" `{name}`")).unwrap_or_default();
        let by = self.cut.trigger.as_ref();
        let by = by.map(|name| format!(", and a trigger `{name}`")).unwrap_or_default();
        Finding {
            what: format!(
                "a trace{field} of {}{by}: {} of {} each",
                count_of(self.length, "sample"),
                count_of(self.readings.len(), "reading"),
                count_of(self.samples, "sample")
            ),
            commands: vec![command::readings(&self.path, &self.cut, &self.out(&self.path)).line()],
        }
    }
}

/// Traces with a trigger, and arrays with several samples of each reading in a row.
pub(super) fn traces(path: &Path, contents: &mut Contents) -> Vec<Trace> {
    let arrays: Vec<Array> = contents.arrays().to_vec();
    let decimal_comma = contents.decimal_comma();
    let named = |field: &Array| (!field.name.is_empty()).then(|| field.name.clone());
    let mut found = Vec::new();
    for array in &arrays {
        let [readings, samples] = array.axes()[..] else { continue };
        if readings > samples && samples >= LEAST_SAMPLES && !is_patterns(array) {
            let numbers = contents.numbers(&array.name).unwrap_or_default();
            let cut = Cut { field: named(array), samples: Some(samples), ..Cut::default() };
            if is_of_samples(&numbers, samples) {
                found.extend(Trace::of(path, cut));
            }
        }
    }
    let plain = |array: &&Array| {
        let look = array.numbers.as_ref();
        array.axes().len() == 1
            && !NO_READINGS[..3].contains(&&*array.name)
            && look.is_some_and(|look| !look.is_counter && look.count > LEAST_SAMPLES)
    };
    let series: Vec<&Array> = arrays.iter().filter(plain).collect();
    let mut is_trigger =
        |array: &&Array| contents.numbers(&array.name).is_some_and(|numbers| rises(&numbers));
    let (triggers, signals): (Vec<&Array>, Vec<&Array>) =
        series.into_iter().partition(|array| is_trigger(array));
    for trigger in triggers {
        for signal in signals.iter().filter(|signal| signal.shape == trigger.shape) {
            let cut = Cut {
                field: named(signal),
                trigger: named(trigger),
                decimal_comma,
                ..Cut::default()
            };
            let trace = Trace::of(path, cut);
            found.extend(trace.filter(|trace| trace.samples >= LEAST_SAMPLES));
        }
    }
    found
}

/// Traces without a trigger, whose samples jump every so many places: the ways to cut them, with a full sweep of
/// readings each.
pub(super) fn stepped(path: &Path, contents: &mut Contents) -> Vec<Trace> {
    let arrays: Vec<Array> = contents.arrays().to_vec();
    let decimal_comma = contents.decimal_comma();
    let mut found = Vec::new();
    for array in arrays.iter().filter(|array| array.axes().len() == 1) {
        let numbers = contents.numbers(&array.name).unwrap_or_default();
        let Some((samples, first)) = steps(&numbers) else { continue };
        let mut skips = vec![first, first % samples];
        skips.dedup();
        for skip in skips {
            let readings = (numbers.len() - skip) / samples;
            // Pairs and readings of patterns alone.
            let sweeps = (1..=8).flat_map(|power| [1, 2].map(|each| each << (2 * power)));
            let counts = sweeps.filter(|&count: &usize| count <= readings);
            let counts: Vec<usize> = counts.collect();
            found.extend(counts.into_iter().rev().take(2).filter_map(|count| {
                let field = (!array.name.is_empty()).then(|| array.name.clone());
                let (samples, count) = (Some(samples), Some(count));
                let cut = Cut { field, samples, skip, count, decimal_comma, ..Cut::default() };
                Trace::of(path, cut)
            }));
        }
    }
    found
}

/// After how many samples numbers jump to another level, and the first such place.
fn steps(numbers: &[f64]) -> Option<(usize, usize)> {
    let changes: Vec<f64> = numbers.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    let mut sorted = changes.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let (usual, most) = (*sorted.get(sorted.len() / 2)?, *sorted.last()?);
    let least = (JUMP_OF_USUAL * usual).max(JUMP_OF_MOST * most);
    let jumps: Vec<usize> = (1..numbers.len()).filter(|&at| changes[at - 1] > least).collect();
    let first = *jumps.first()?;
    let fits = |samples: usize| {
        let in_step = jumps.iter().filter(|&&at| (at - first).is_multiple_of(samples)).count();
        in_step as f64 >= IN_STEP * jumps.len() as f64
    };
    if jumps.len() < LEAST_JUMPS {
        return None;
    }
    // A jump out of step spoils two gaps.
    let mut gaps: Vec<usize> = jumps.windows(2).map(|pair| pair[1] - pair[0]).collect();
    gaps.sort_unstable();
    let longest = gaps[(2.0 * (1.0 - IN_STEP) * gaps.len() as f64) as usize];
    (LEAST_SAMPLES..=longest).rev().find(|&samples| fits(samples)).map(|samples| (samples, first))
}

/// Whether an array varies otherwise than times and counters do.
fn is_signal(array: &Array) -> bool {
    array.numbers.as_ref().is_some_and(|look| !look.is_counter)
}

/// Whether numbers are at two levels and rise from one to the other several times.
fn rises(numbers: &[f64]) -> bool {
    let least = numbers.iter().copied().fold(f64::INFINITY, f64::min);
    let most = numbers.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let near = NEAR * (most - least);
    let at_level = |number: f64| number <= least + near || number >= most - near;
    let at_levels = numbers.iter().filter(|&&number| at_level(number)).count();
    let is_high = |number: f64| number > 0.5 * (least + most);
    let edges = numbers.windows(2).filter(|pair| !is_high(pair[0]) && is_high(pair[1])).count();
    most > least && at_levels as f64 >= AT_LEVELS * numbers.len() as f64 && edges >= LEAST_EDGES
}

/// Whether numbers vary little within rows of so many.
fn is_of_samples(numbers: &[f64], samples: usize) -> bool {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
    let squares = |values: &[f64], about: f64| -> f64 {
        values.iter().map(|value| (value - about).powi(2)).sum()
    };
    let within: f64 = numbers.chunks_exact(samples).map(|row| squares(row, mean(row))).sum();
    within < WITHIN * squares(numbers, mean(numbers))
}

/// Whether an array holds patterns: a stack of pictures or rows of few different weights, or an array of
/// such a name.
pub(super) fn is_patterns(array: &Array) -> bool {
    let axes = array.axes();
    let is_named = ["patterns", "matrix"].contains(&&*array.name);
    let has_levels = array.numbers.as_ref().is_some_and(|look| look.levels.is_some());
    let is_large = axes.iter().product::<usize>() >= LEAST_PIXELS * LEAST_PIXELS;
    matches!(axes.len(), 2 | 3) && (is_named || has_levels) && is_large
}

/// Patterns of a user's own, with the command that reconstructs readings by them.
pub(super) fn patterns(path: &Path, contents: &Contents) -> Vec<Finding> {
    let arrays = contents.arrays();
    let found = arrays.iter().filter(|array| is_patterns(array));
    found.map(|array| of_patterns(path, array, arrays)).collect()
}

fn of_patterns(path: &Path, array: &Array, arrays: &[Array]) -> Finding {
    let axes = array.axes();
    let square = |area: usize| Size::square(area).map(|size| size.to_string());
    let (count, size, is_known) = match axes[..] {
        [first, last] => match (square(last), square(first)) {
            (Some(size), _) => (first, size, true),
            (None, Some(size)) => (last, size, true),
            (None, None) => (first, count_of(last, "pixel"), false),
        },
        [count, height, width] => (count, format!("{height} x {width}"), true),
        _ => (0, String::new(), false),
    };
    let name = (!array.name.is_empty()).then_some(&array.name);
    let of = name.map(|name| format!(" in `{name}`")).unwrap_or_default();
    let pixels = if is_known { " pixels" } else { "" };
    // Readings of these patterns in the same file.
    let own = arrays.iter().find(|other| {
        let look = other.numbers.as_ref();
        let fits = look.is_some_and(|look| look.count == count || look.count == 2 * count);
        fits && other.name != array.name && !NO_READINGS.contains(&&*other.name)
    });
    let is_default = name.is_none_or(|name| ["patterns", "matrix"].contains(&&**name));
    let begun = match own {
        Some(own) => Command::new("reconstruct", path)
            .some("--field", (!["y", "d"].contains(&&*own.name)).then_some(&own.name)),
        None => Command::new("reconstruct", Path::new("READINGS")),
    };
    let size_words = (!is_known).then_some("HxW");
    let line = begun
        .option("--matrix", path.display())
        .some("--matrix-field", name.filter(|_| !is_default))
        .some("--size", size_words)
        .option("--out", "out/")
        .line();
    Finding {
        what: format!("{} of {size}{pixels}{of}", count_of(count, "pattern")),
        commands: vec![line],
    }
}

/// What to do with readings that no way explains.
pub(super) fn unexplained(
    path: &Path,
    contents: &Contents,
    findings: &[Finding],
    guesses: &[Guess],
) -> Option<Finding> {
    if !findings.is_empty() || guesses.iter().any(Guess::fits) {
        return None;
    }
    if let Some(long) = contents.arrays().iter().find(|array| is_long(array) && is_signal(array)) {
        let cut = Command::new("readings", path)
            .some("--field", (!long.name.is_empty()).then_some(&long.name))
            .option("--samples", "K")
            .option("--out", "readings.npz");
        let what = "more numbers than a sweep has readings: samples of a trace, perhaps".to_owned();
        return Some(Finding { what, commands: vec![cut.line()] });
    }
    let picture = contents.arrays().iter().find(|array| array.axes().len() > 1);
    if guesses.iter().any(|guess| few_patterns_see(&guess.measurements)) {
        let what = match picture {
            None => "readings of a scene that few patterns see: they fit every order alike",
            Some(_) => {
                "readings of a scene that few patterns see, which fit every order alike, or an image"
            }
        };
        let shown = Command::new("reconstruct", path)
            .option("--shown", "ORDER")
            .option("--out", "out/")
            .line();
        return Some(Finding { what: what.to_owned(), commands: vec![shown] });
    }
    let what = match (guesses.is_empty(), picture) {
        (true, None) => "no readings that fit a sweep of Hadamard patterns",
        (true, Some(_)) => "no readings; perhaps images",
        (false, None) => {
            "readings that no known order explains: they are noise, or readings of other patterns"
        }
        (false, Some(_)) => {
            "numbers that no known order explains: perhaps an image, or readings of other patterns"
        }
    };
    let matrix = Command::new("reconstruct", path)
        .option("--matrix", "PATTERNS")
        .option("--out", "out/")
        .line();
    Some(Finding { what: what.to_owned(), commands: vec![matrix] })
}

/// Whether an array has more numbers along one axis than a sweep has readings.
pub(super) fn is_long(array: &Array) -> bool {
    matches!(array.axes()[..], [count] if count > MOST_READINGS)
}

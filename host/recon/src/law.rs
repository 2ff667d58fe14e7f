//! What light can do, and readings that contradict it.
//!
//! For any scene, no pattern collects more light than the all-on pattern, and none less than the
//! all-off pattern, its complement. So the difference of no pattern is larger than that of the all-on
//! pattern, whatever its sign. A pattern and its complement together collect the light of the whole
//! scene, so their sum changes only with the lamp, up to noise.
//!
//! Where many readings break this law, they are not what they are said to be. A [`Doubt`] says so and
//! names the form in which the same readings would keep the law. The readings are never rearranged.
//! Where a few readings break it, these are [`Outlier`]s, and their patterns are left out. A run
//! without any signal is a [`Dropout`].
//!
//! # Invariant
//! Readings that keep the law, with the noise that their own scatter shows and with a lamp that drifts,
//! give measurements of every pattern and no doubt (`tests::right`).

mod doubt;
mod dropout;
mod ends;
mod form;
mod lamp;
mod outlier;
mod pairs;
mod repeats;
pub(crate) mod robust;
mod signed;
mod trend;

pub use doubt::{Broken, Doubt, Explanation, Extreme};
pub use dropout::Dropout;
pub use form::Form;
pub use lamp::{Lamp, LampReadings, Witness};
pub use outlier::{Impossible, Outlier};
pub use signed::keeps_the_law;

use crate::measurements::{MeasurementError, expect_finite, expect_length};
use crate::{Measurements, Rows};

/// Magnitudes from here on are an instrument's words for "overload" (9.9e37) and "no number"
/// (9.91e37) in SCPI, the language of bench instruments, to the rounding of `f32`. They are not
/// readings.
pub const OVERLOAD: f64 = 9.899e37;

/// What readings are said to be.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Claim {
    /// How readings belong to patterns.
    pub form: Form,
    /// Whether the side of the image follows from the number of readings alone. Several samples of each
    /// reading, or several sweeps one after another, then look like a larger image.
    pub side_guessed: bool,
    /// Whether readings are divided by the lamp's level. Each difference of a pair is then divided here by the sum of the
    /// pair, and multiplied by the median of the sums; readings of other forms were [divided](LampReadings::divided) before.
    pub divide_by_lamp: bool,
}

impl From<Form> for Claim {
    /// Readings of this form, of an image whose side is known.
    fn from(form: Form) -> Self {
        Self { form, side_guessed: false, divide_by_lamp: false }
    }
}

/// Readings that have become measurements.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// The measurements, without the patterns of drop-outs and outliers.
    pub measurements: Measurements,
    /// Runs without a signal.
    pub dropouts: Vec<Dropout>,
    /// Single readings that light cannot have given.
    pub outliers: Vec<Outlier>,
    /// What contradicts the claim, and what is wrong with many readings.
    pub doubts: Vec<Doubt>,
    /// The dark level that was found in readings of single patterns and removed.
    pub dark_level: Option<f64>,
    /// How steady the light was, of pairs that are what they are said to be; of patterns alone, a drift that limits the image.
    pub lamp: Option<Lamp>,
}

impl Reading {
    /// Measurements without drop-outs, dark level and lamp.
    fn of(measurements: Measurements, outliers: Vec<Outlier>, doubts: Vec<Doubt>) -> Self {
        let (dropouts, dark_level, lamp) = (Vec::new(), None, None);
        Self { measurements, dropouts, outliers, doubts, dark_level, lamp }
    }
}

/// Where patterns are in a recording of which some were not read.
#[derive(Debug, Clone, Copy)]
pub struct Places<'p> {
    /// The place of each pattern that was read, in the order shown.
    pub read: &'p [usize],
    /// Number of patterns, those that were not read included.
    pub patterns: usize,
}

impl Places<'_> {
    /// The place of a pattern that was read.
    fn of(places: Option<Places<'_>>, pattern: usize) -> usize {
        places.map_or(pattern, |places| places.read[pattern])
    }

    /// Values for every place, to look for the order of the recording: a pattern that was not read has those of the
    /// pattern before.
    fn filled<T: Copy>(places: Option<Places<'_>>, values: &[T]) -> Vec<T> {
        let Some(Places { read, patterns }) = places else { return values.to_vec() };
        let before = |place| read.partition_point(|&read| read <= place).saturating_sub(1);
        (0..patterns).map(|place| values[before(place)]).collect()
    }
}

/// Measurements from finite readings of `rows`, in the order in which the patterns were shown. Pairs
/// are `[+, -, +, -, ...]`, also those of [`Form::Halves`], which says how the recording had them.
///
/// # Errors
/// [`MeasurementError`] if there are not as many readings as the form has for these rows, or a reading
/// is not finite; [`Empty`](MeasurementError::Empty) if no pattern is left.
pub fn read(rows: &Rows, y: &[f64], claim: Claim) -> Result<Reading, MeasurementError> {
    read_at(rows, y, claim, None)
}

/// As [`read`], of the patterns at these places of a recording.
///
/// # Errors
/// As [`read`].
pub fn read_at(
    rows: &Rows,
    y: &[f64],
    claim: Claim,
    places: Option<Places<'_>>,
) -> Result<Reading, MeasurementError> {
    let field = if claim.form == Form::Differences { "d" } else { "y" };
    expect_length(field, y.len(), rows.len() * claim.form.readings())?;
    expect_finite(field, y)?;
    if let Some(doubt) = all_equal(y, claim.form) {
        let measurements = match claim.form {
            Form::Pairs | Form::Halves => pairs::differences(rows, y.as_chunks::<2>().0, |_| true)?,
            Form::Single => Measurements::from_single(rows, y)?,
            Form::Differences => Measurements::from_differential(rows, y)?,
        };
        return Ok(Reading::of(measurements, Vec::new(), vec![doubt]));
    }
    match claim.form {
        Form::Pairs | Form::Halves => pairs::read(rows, y, claim, places),
        Form::Single => signed::read_single(rows, y, claim, places),
        Form::Differences => signed::read_differences(rows, y, claim, places),
    }
}

impl Measurements {
    /// Measurements from raw readings in time order, each pattern followed by its complement:
    /// `y = [+, -, +, -, ...]`, `2 * rows.len()` readings. A constant dark level cancels in each
    /// difference. As [`read`] of [`Form::Pairs`].
    ///
    /// # Errors
    /// As [`read`].
    pub fn from_pairs(rows: &Rows, y: &[f64]) -> Result<Reading, MeasurementError> {
        read(rows, y, Form::Pairs.into())
    }
}

/// Fewest readings of which it says something that all are equal.
const FEWEST_EQUAL: usize = 8;

fn all_equal(y: &[f64], form: Form) -> Option<Doubt> {
    let (first, others) = y.split_first()?;
    // Differences of nothing are an even, dark scene.
    let says = *first != 0.0 || form != Form::Differences;
    let equal = says && others.iter().all(|value| value == first);
    (equal && y.len() >= FEWEST_EQUAL)
        .then_some(Doubt::AllEqual { readings: y.len(), value: *first })
}

/// The most readings, of this many, that count as a few.
#[must_use]
pub fn few(of: usize) -> usize {
    match of {
        // One of three is not a few.
        0..=7 => 0,
        _ => (of / 50).max(2),
    }
}

#[cfg(test)]
mod tests;

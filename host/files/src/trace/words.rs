//! What was found in a trace, in words.

use super::Found;
use nirspi_recon::words::count_of;

/// The least and the greatest side of an image, as powers of two.
const SIDES: std::ops::RangeInclusive<u32> = 1..=8;
/// The least side of which several sweeps are recognized.
const LEAST_REPEATED: usize = 8;

/// A full sweep: of patterns and their complements, or of patterns alone.
#[derive(Clone, Copy)]
struct Sweep {
    side: usize,
    readings: usize,
}

impl Sweep {
    fn all() -> impl Iterator<Item = Self> {
        SIDES
            .map(|power| 1 << power)
            .flat_map(|side: usize| [1, 2].map(|each| Self { side, readings: each * side * side }))
    }

    fn patterns(self) -> String {
        let Self { side, readings } = self;
        let complements = if readings > side * side { " and their complements" } else { "" };
        format!("{side} x {side} patterns{complements}")
    }
}

impl Found {
    /// The readings, in lines for a user.
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        let (before, after) = self.outside;
        let by = if self.by_trigger { "trigger" } else { "number of samples" };
        let mut lines = vec![format!(
            "{} by the {by}, {} a pattern; of the trace's {}, {before} are before the first pattern and {after} \
             after the last reading",
            count_of(self.readings.len(), "reading"),
            count_of(self.samples, "sample"),
            count_of(self.length, "sample"),
        )];
        if let Some(sweep) = Sweep::all().find(|sweep| sweep.readings == self.readings.len()) {
            lines.push(format!("a full sweep: {}", sweep.patterns()));
        }
        lines
    }

    /// Reasons to distrust the readings, one line each.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let Self { lost, extra, overloads, .. } = self;
        let mut lines = Vec::new();
        if !lost.is_empty() {
            lines.push(format!(
                "{} not there, because the trigger has no edge or too few samples follow it: {}",
                are(lost.len(), "reading"),
                first_of(lost)
            ));
        }
        if !extra.is_empty() {
            lines.push(format!(
                "{} left out, because an edge of the trigger comes too early for a pattern: at {}",
                are(extra.len(), "edge"),
                first_of(extra)
            ));
        }
        if !overloads.is_empty() {
            let (readings, places) = (are(overloads.len(), "reading"), first_of(overloads));
            lines.push(format!("overload: {readings} not there: {places}"));
        }
        if let Some(samples) = self.cut_off {
            let samples = count_of(samples, "sample");
            lines.push(format!(
                "the trace ends {samples} after the last edge, which has no reading"
            ));
        }
        lines.extend(self.no_sweep());
        lines
    }

    /// What is wrong with the number of readings, if it is not that of a full sweep.
    fn no_sweep(&self) -> Option<String> {
        let found = self.readings.len();
        let apart = |sweep: &Sweep| sweep.readings.abs_diff(found);
        let nearest = Sweep::all().min_by_key(apart).filter(|sweep| apart(sweep) > 0)?;
        let several = Sweep::all()
            .filter(|sweep| sweep.side >= LEAST_REPEATED && found.is_multiple_of(sweep.readings));
        if let Some(sweep) = several.last() {
            let times = found / sweep.readings;
            let (patterns, each) = (sweep.patterns(), sweep.readings);
            return Some(format!(
                "{found} readings are no full sweep, but may be {times} sweeps of {patterns}: \
                 --count {each} keeps the first one"
            ));
        }
        let (patterns, expected) = (nearest.patterns(), nearest.readings);
        let (by, hint) = match found.checked_sub(expected) {
            Some(more) => {
                (format!("{more} more than"), format!("--count {expected} keeps the first of them"))
            }
            None => (
                format!("{} fewer than", expected - found),
                "only part of a sweep may have been shown".to_owned(),
            ),
        };
        Some(format!(
            "{found} readings are no full sweep: {by} the {expected} of {patterns}; {hint}"
        ))
    }
}

fn are(number: usize, noun: &str) -> String {
    format!("{} {}", count_of(number, noun), if number == 1 { "is" } else { "are" })
}

/// The first numbers of a list, and how many there are.
fn first_of(numbers: &[usize]) -> String {
    const SHOWN: usize = 5;
    let shown: Vec<String> = numbers.iter().take(SHOWN).map(usize::to_string).collect();
    let more = numbers.len().saturating_sub(SHOWN);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("{}{more}", shown.join(", "))
}

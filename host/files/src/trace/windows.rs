//! Cuts a trace into the samples of each pattern.

use super::Trace;
use std::ops::Range;
use thiserror::Error;

/// Part of the usual interval below which an edge belongs to no pattern.
const EXTRA: f64 = 0.5;

/// Part of its samples that the last pattern needs.
const WHOLE: f64 = 0.9;

/// Where a trace is cut.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Cut {
    /// Samples of a pattern; without a trigger, all patterns have this number. With a trigger, the
    /// number that its edges must show.
    pub samples: Option<usize>,
    /// Samples before the first pattern.
    pub skip: usize,
    /// Samples at the beginning of each pattern that its reading leaves out, while the light settles.
    pub settle: usize,
}

/// The samples of each pattern, and the readings.
#[derive(Debug, Clone, PartialEq)]
pub struct Found {
    /// The samples that make each reading; `None` for a pattern without a trigger.
    pub windows: Vec<Option<Range<usize>>>,
    /// The mean of each window; NaN without one.
    pub readings: Vec<f64>,
    /// Samples of a pattern: the middle one of all intervals.
    pub samples: usize,
    /// What was odd, one line each.
    pub notes: Vec<String>,
}

/// Why a trace gives no readings.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum TraceError {
    /// Neither a trigger nor a number of samples.
    #[error("no trigger and no number of samples of a pattern, expected one of them")]
    NoCut,
    /// The trigger has fewer than two edges.
    #[error("the trigger rises {found} times, expected two times or more")]
    NoEdges {
        /// Number of edges.
        found: usize,
    },
    /// The trigger has another interval.
    #[error("{asked} samples of a pattern, but the trigger rises every {found} samples")]
    Interval {
        /// The number that was asked for.
        asked: usize,
        /// The trigger's.
        found: usize,
    },
    /// Nothing is left of a pattern.
    #[error("{settle} samples to settle leave nothing of the {samples} samples of a pattern")]
    Settle {
        /// Samples to settle.
        settle: usize,
        /// Samples of a pattern.
        samples: usize,
    },
    /// The trace ends before the first pattern does.
    #[error("{found} samples after the {skip} skipped, expected {samples} for a pattern")]
    Short {
        /// Samples left.
        found: usize,
        /// Samples skipped.
        skip: usize,
        /// Samples of a pattern.
        samples: usize,
    },
}

impl Trace {
    /// The reading of each pattern: the mean of its samples.
    ///
    /// With a trigger, a pattern begins where the trigger rises through the middle of its range, and ends
    /// where it rises again.
    ///
    /// # Errors
    /// [`TraceError`] if the trace cannot be cut this way.
    pub fn cut(&self, cut: Cut) -> Result<Found, TraceError> {
        let mut notes = Vec::new();
        let (starts, samples) = match &self.trigger {
            Some(trigger) => by_trigger(trigger, cut, &mut notes)?,
            None => by_number(self.samples.len(), cut, &mut notes)?,
        };
        if cut.settle >= samples {
            return Err(TraceError::Settle { settle: cut.settle, samples });
        }
        let window = |&(start, length): &(Option<usize>, usize)| {
            start.map(|start| start + cut.settle..start + length)
        };
        let windows: Vec<_> = starts.iter().map(window).collect();
        let mean = |window: &Option<Range<usize>>| match window {
            Some(window) => {
                let count = window.len() as f64;
                self.samples[window.clone()].iter().map(|sample| sample / count).sum()
            }
            None => f64::NAN,
        };
        let readings = windows.iter().map(mean).collect();
        Ok(Found { windows, readings, samples, notes })
    }
}

/// The first sample of each pattern, and its number of samples.
type Starts = Vec<(Option<usize>, usize)>;

fn by_number(
    length: usize,
    cut: Cut,
    notes: &mut Vec<String>,
) -> Result<(Starts, usize), TraceError> {
    let samples = cut.samples.filter(|&samples| samples > 0).ok_or(TraceError::NoCut)?;
    let found = length.saturating_sub(cut.skip);
    let count = found / samples;
    if count == 0 {
        return Err(TraceError::Short { found, skip: cut.skip, samples });
    }
    let left = found - count * samples;
    if left > 0 {
        notes
            .push(format!("{left} samples at the end are left over: less than those of a pattern"));
    }
    Ok(((0..count).map(|k| (Some(cut.skip + k * samples), samples)).collect(), samples))
}

fn by_trigger(
    trigger: &[f64],
    cut: Cut,
    notes: &mut Vec<String>,
) -> Result<(Starts, usize), TraceError> {
    let range = |of: fn(f64, f64) -> f64, from| trigger.iter().copied().fold(from, of);
    let level = f64::midpoint(range(f64::min, f64::INFINITY), range(f64::max, f64::NEG_INFINITY));
    let rises = |at: &usize| trigger[at - 1] < level && trigger[*at] >= level;
    let edges: Vec<usize> = (cut.skip.max(1)..trigger.len()).filter(rises).collect();
    let mut intervals: Vec<usize> = edges.windows(2).map(|two| two[1] - two[0]).collect();
    if intervals.is_empty() {
        return Err(TraceError::NoEdges { found: edges.len() });
    }
    intervals.sort_unstable();
    let samples = intervals[intervals.len() / 2];
    if let Some(asked) = cut.samples.filter(|&asked| asked != samples) {
        return Err(TraceError::Interval { asked, found: samples });
    }
    let usual = samples as f64;
    let mut starts: Starts = Vec::with_capacity(edges.len());
    let (mut extra, mut lost) = (Vec::new(), Vec::new());
    let mut last = edges[0];
    for &edge in edges[1..].iter().chain([&trigger.len()]) {
        let interval = (edge - last) as f64;
        let is_end = edge == trigger.len();
        if is_end {
            match interval >= WHOLE * usual {
                true => starts.push((Some(last), samples.min(edge - last))),
                false => notes.push(format!(
                    "the trace ends {} samples after the last edge: this pattern is left out",
                    edge - last
                )),
            }
            break;
        }
        if interval < EXTRA * usual {
            extra.push(edge);
            continue;
        }
        let patterns = (interval / usual).round().max(1.0) as usize;
        starts.push((Some(last), if patterns == 1 { edge - last } else { samples }));
        for _ in 1..patterns {
            lost.push(starts.len());
            starts.push((None, 0));
        }
        last = edge;
    }
    if !extra.is_empty() {
        notes.push(format!("edges that come too early are left out: {}", first_of(&extra)));
    }
    if !lost.is_empty() {
        notes.push(format!("patterns without an edge have no reading: {}", first_of(&lost)));
    }
    Ok((starts, samples))
}

/// The first numbers of a list, and how many there are.
fn first_of(numbers: &[usize]) -> String {
    const SHOWN: usize = 5;
    let shown: Vec<String> = numbers.iter().take(SHOWN).map(usize::to_string).collect();
    let more = numbers.len().saturating_sub(SHOWN);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    format!("{}{more}", shown.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A trace of these levels, of so many samples each after some others, and its trigger.
    fn trace(levels: &[f64], samples: usize, before: usize) -> Trace {
        let each = |of: &dyn Fn(usize, usize) -> f64| {
            let pattern = (0..levels.len()).flat_map(|k| (0..samples).map(move |at| (k, at)));
            std::iter::repeat_n(0.0, before).chain(pattern.map(|(k, at)| of(k, at))).collect()
        };
        Trace {
            samples: each(&|k, _| levels[k]),
            trigger: Some(each(&|_, at| if at < 2 { 5.0 } else { 0.1 })),
            note: None,
        }
    }

    proptest! {
        #[test]
        fn readings_are_the_levels_by_the_trigger_and_by_their_number(
            levels in proptest::collection::vec(-9.0..9.0_f64, 2..60),
            samples in 4_usize..40,
            before in 1_usize..200,
            settle in 0_usize..3,
        ) {
            let by_trigger = trace(&levels, samples, before);
            let number = Trace { trigger: None, ..by_trigger.clone() };
            let cut = Cut { settle, ..Cut::default() };
            let counted = Cut { samples: Some(samples), skip: before, settle };
            for found in [by_trigger.cut(cut).unwrap(), number.cut(counted).unwrap()] {
                prop_assert_eq!(found.samples, samples);
                prop_assert_eq!(found.readings.len(), levels.len());
                for (reading, level) in found.readings.iter().zip(&levels) {
                    prop_assert!((reading - level).abs() < 1e-9);
                }
                prop_assert!(found.notes.is_empty());
                prop_assert!(found.windows.iter().flatten().all(|w| w.len() == samples - settle));
            }
        }
    }

    #[test]
    fn lost_and_extra_edges_are_named_and_move_no_other_reading() {
        let levels: Vec<f64> = (0..12).map(f64::from).collect();
        let mut spoilt = trace(&levels, 20, 7);
        let trigger = spoilt.trigger.as_mut().unwrap();
        // The edge of pattern 4, and one in the middle of pattern 8.
        trigger[7 + 4 * 20..][..2].fill(0.0);
        trigger[7 + 8 * 20 + 6] = 5.0;
        let found = spoilt.cut(Cut::default()).unwrap();
        assert_eq!(found.readings.len(), 12);
        for (k, reading) in found.readings.iter().enumerate() {
            assert!(
                if k == 4 { reading.is_nan() } else { (reading - k as f64).abs() < 1e-9 },
                "{k}"
            );
        }
        assert_eq!(
            found.notes,
            [
                "edges that come too early are left out: 173",
                "patterns without an edge have no reading: 4"
            ]
        );
        // Samples that jitter.
        let mut jitter = trace(&levels, 20, 7);
        jitter.samples.remove(50);
        jitter.trigger.as_mut().unwrap().remove(50);
        let found = jitter.cut(Cut { settle: 2, ..Cut::default() }).unwrap();
        assert!(found.readings.iter().zip(&levels).all(|(a, b)| (a - b).abs() < 1e-9));
        // A trace that ends early.
        let mut short = trace(&levels, 20, 7);
        short.samples.truncate(7 + 11 * 20 + 9);
        short.trigger.as_mut().unwrap().truncate(7 + 11 * 20 + 9);
        let found = short.cut(Cut::default()).unwrap();
        assert_eq!(found.readings.len(), 11);
        assert!(found.notes[0].contains("ends 9 samples after the last edge"), "{:?}", found.notes);
    }

    #[test]
    fn what_cannot_be_cut_is_refused_in_one_line() {
        let good = trace(&[1.0, 2.0, 3.0], 20, 5);
        let told = |trace: &Trace, cut| trace.cut(cut).unwrap_err().to_string();
        let of = |samples, skip, settle| Cut { samples: Some(samples), skip, settle };
        let found = told(&good, of(25, 0, 0));
        assert_eq!(found, "25 samples of a pattern, but the trigger rises every 20 samples");
        let number = Trace { trigger: None, ..good.clone() };
        assert!(told(&number, Cut::default()).contains("expected one of them"));
        assert!(told(&number, of(0, 0, 0)).contains("expected one of them"));
        assert!(told(&number, of(20, 1000, 0)).starts_with("0 samples after the 1000 skipped"));
        assert!(told(&number, of(20, 5, 20)).starts_with("20 samples to settle leave nothing"));
        let flat = Trace { trigger: Some(vec![1.0; 65]), ..good };
        assert_eq!(
            told(&flat, Cut::default()),
            "the trigger rises 0 times, expected two times or more"
        );
        let left = number.cut(of(20, 0, 0)).unwrap();
        assert_eq!(left.readings.len(), 3);
        assert!(left.notes[0].starts_with("5 samples at the end are left over"));
    }
}

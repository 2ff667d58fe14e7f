//! Adds up the samples of each reading while they come.

use nirspi_recon::law::OVERLOAD;
use std::ops::Range;

/// The most samples that a picture shows.
const MOST_SHOWN: usize = 4000;

/// Adds up samples, a block at a time.
pub(super) struct Sums<W: Iterator<Item = Range<usize>>> {
    windows: W,
    /// The window whose samples come next.
    window: Option<Range<usize>>,
    /// The next sample's place.
    at: usize,
    sum: f64,
    is_overload: bool,
    step: usize,
    found: Summed,
}

/// The readings, and what was found among their samples.
pub(super) struct Summed {
    pub(super) readings: Vec<f64>,
    /// Readings with an instrument's word for overload among their samples.
    pub(super) overloads: Vec<usize>,
    /// The first sample of a reading that is not finite, and its value.
    pub(super) wrong: Option<(usize, f64)>,
    /// The end of the last reading.
    pub(super) end: usize,
    /// The samples that a picture shows, by their range and with their places.
    pub(super) shown: Range<usize>,
    pub(super) first: Vec<(usize, f64)>,
}

impl<W: Iterator<Item = Range<usize>>> Sums<W> {
    pub(super) fn new(windows: W, shown: Range<usize>) -> Self {
        let found = Summed {
            readings: Vec::new(),
            overloads: Vec::new(),
            wrong: None,
            end: 0,
            shown: shown.clone(),
            first: Vec::new(),
        };
        let step = shown.len().div_ceil(MOST_SHOWN).max(1);
        let mut sums =
            Self { windows, window: None, at: 0, sum: 0.0, is_overload: false, step, found };
        sums.next_window();
        sums
    }

    /// Goes on to the next window with samples.
    fn next_window(&mut self) {
        self.window = self.windows.next();
        while self.window.as_ref().is_some_and(Range::is_empty) {
            self.found.readings.push(f64::NAN);
            self.window = self.windows.next();
        }
    }

    pub(super) fn take(&mut self, block: &[f64]) {
        self.show(block);
        let end = self.at + block.len();
        while let Some(window) = self.window.clone()
            && window.start < end
        {
            let from = window.start.max(self.at);
            let samples = &block[from - self.at..window.end.min(end) - self.at];
            self.add(from, samples);
            if window.end > end {
                break;
            }
            let reading = if self.is_overload { f64::NAN } else { self.sum / window.len() as f64 };
            if self.is_overload {
                self.found.overloads.push(self.found.readings.len());
            }
            self.found.readings.push(reading);
            self.found.end = window.end;
            (self.sum, self.is_overload) = (0.0, false);
            self.next_window();
        }
        self.at = end;
    }

    fn add(&mut self, from: usize, samples: &[f64]) {
        let good = samples.iter().fold(true, |good, sample| good & (sample.abs() < OVERLOAD));
        if !good {
            self.is_overload = true;
            let wrong = samples.iter().position(|sample| !sample.is_finite());
            let wrong = wrong.map(|k| (from + k, samples[k]));
            self.found.wrong = self.found.wrong.or(wrong);
        }
        self.sum += samples.iter().sum::<f64>();
    }

    /// Keeps samples for a picture.
    fn show(&mut self, block: &[f64]) {
        let Range { start, end } = self.found.shown;
        let from = start.max(self.at);
        let first = from + (self.step - (from - start) % self.step) % self.step;
        for place in (first..end.min(self.at + block.len())).step_by(self.step) {
            self.found.first.push((place, block[place - self.at]));
        }
    }

    pub(super) fn finished(self) -> Summed {
        self.found
    }
}

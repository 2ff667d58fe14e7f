//! Which samples make each reading.

use std::ops::Range;

/// Part of the usual interval below which an edge belongs to no pattern.
const EXTRA: f64 = 0.5;

/// Part of the usual interval that the first and the last pattern need.
const WHOLE: f64 = 0.9;

/// Parts of a trigger's range: it is high where it reaches the second one, and low below the first one. Between them it is what
/// it was before.
const LOW: f64 = 0.4;
const HIGH: f64 = 0.6;

/// The samples of every reading, in turn.
#[derive(Debug, Clone)]
pub(super) struct Windows {
    starts: Starts,
    /// Samples of a pattern: the middle one of all intervals.
    pub(super) samples: usize,
    /// Samples at the beginning of each pattern that belong to no reading.
    settle: usize,
    /// Samples of the trace.
    end: usize,
}

#[derive(Debug, Clone)]
enum Starts {
    Every {
        first: usize,
        count: usize,
    },
    Edges {
        edges: Vec<usize>,
        /// Whether the last edge begins a pattern, and not only ends one.
        last_begins: bool,
    },
}

impl Windows {
    /// Windows of `samples` each after `skip` others.
    pub(super) fn every(samples: usize, skip: usize, settle: usize, end: usize) -> Self {
        let count = end.saturating_sub(skip) / samples;
        Self { starts: Starts::Every { first: skip, count }, samples, settle, end }
    }

    /// The samples of each reading, none for a pattern without an edge.
    pub(super) fn iter(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        let (first, count, edges, last_begins) = match &self.starts {
            Starts::Every { first, count } => (*first, *count, &[][..], false),
            Starts::Edges { edges, last_begins } => (0, 0, &**edges, *last_begins),
        };
        let every = (0..count).map(move |k| {
            let start = first + k * self.samples;
            self.settled(start, start + self.samples)
        });
        let between = edges.windows(2).flat_map(move |pair| {
            let patterns = self.patterns(pair[1] - pair[0]);
            let end = if patterns == 1 { pair[1] } else { pair[0] + self.samples };
            let lost = std::iter::repeat_n(0..0, patterns - 1);
            std::iter::once(self.settled(pair[0], end)).chain(lost)
        });
        let last = edges.last().filter(|_| last_begins);
        let last = last.map(|&edge| self.settled(edge, (edge + self.samples).min(self.end)));
        every.chain(between).chain(last)
    }

    /// Number of patterns that are as long as this.
    fn patterns(&self, interval: usize) -> usize {
        ((interval as f64 / self.samples as f64).round() as usize).max(1)
    }

    fn settled(&self, start: usize, end: usize) -> Range<usize> {
        if start + self.settle < end { start + self.settle..end } else { 0..0 }
    }

    /// The first sample of the first pattern.
    pub(super) fn first(&self) -> usize {
        match &self.starts {
            Starts::Every { first, .. } => *first,
            Starts::Edges { edges, .. } => edges.first().copied().unwrap_or(0),
        }
    }

    /// Where the trigger rises at the beginning of a pattern; nothing without a trigger.
    pub(super) fn edges(&self) -> &[usize] {
        match &self.starts {
            Starts::Every { .. } => &[],
            Starts::Edges { edges, .. } => edges,
        }
    }
}

/// Where patterns begin.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Edge {
    Rise,
    Fall,
    Both,
}

impl Edge {
    /// The field of a trigger and its edges: `NAME`, `NAME:fall`, or `NAME:both`, unless that is a field itself.
    pub(super) fn of<'n>(trigger: &'n str, names: &[String]) -> (&'n str, Self) {
        let is_field = |name: &str| names.iter().any(|known| known == name);
        match trigger.rsplit_once(':') {
            Some((name, "fall")) if !is_field(trigger) => (name, Self::Fall),
            Some((name, "both")) if !is_field(trigger) => (name, Self::Both),
            _ => (trigger, Self::Rise),
        }
    }

    /// What the trigger does there.
    pub(super) fn verb(self) -> &'static str {
        match self {
            Self::Rise => "rises",
            Self::Fall => "falls",
            Self::Both => "changes",
        }
    }
}

/// Finds the edges of a trigger, a block of its samples at a time.
pub(super) struct Edges {
    edge: Edge,
    low: f64,
    high: f64,
    /// The next sample's place.
    at: usize,
    skip: usize,
    most: usize,
    was_high: Option<bool>,
    /// Whether the first edge is the beginning of the trace, where the trigger is as after an edge.
    begins_high: bool,
    found: Vec<usize>,
}

/// What the edges of a trigger are.
pub(super) struct Cut {
    pub(super) windows: Windows,
    /// Edges that come too early and begin no pattern.
    pub(super) extra: Vec<usize>,
    /// Samples after the last edge, if they are too few for a pattern.
    pub(super) cut_off: Option<usize>,
}

impl Edges {
    /// Edges of a trigger within this range, behind the first `skip` samples, and one more than `most` of them.
    pub(super) fn new(edge: Edge, (least, greatest): (f64, f64), skip: usize, most: usize) -> Self {
        let level = |part: f64| (1.0 - part) * least + part * greatest;
        Self {
            edge,
            low: level(LOW),
            high: level(HIGH),
            at: 0,
            skip,
            most,
            was_high: None,
            begins_high: false,
            found: Vec::new(),
        }
    }

    pub(super) fn take(&mut self, block: &[f64]) {
        for &level in block {
            let is_high = level >= self.high && level > self.low;
            if self.at >= self.skip && (is_high || level < self.low) {
                let is_ours = match self.edge {
                    Edge::Rise => is_high,
                    Edge::Fall => !is_high,
                    Edge::Both => true,
                };
                let begins = self.at == self.skip;
                let is_new = self.was_high.map_or(begins, |before| before != is_high);
                if is_ours && is_new && self.found.len() <= self.most {
                    self.begins_high |= begins;
                    self.found.push(self.at);
                }
                self.was_high = Some(is_high);
            }
            self.at += 1;
        }
    }

    /// Number of edges.
    pub(super) fn count(&self) -> usize {
        self.found.len() - usize::from(self.begins_high)
    }

    /// The patterns that the edges begin; `None` for fewer than two edges.
    pub(super) fn cut(mut self, settle: usize) -> Option<Cut> {
        let real = &self.found[usize::from(self.begins_high)..];
        let mut intervals: Vec<usize> = real.windows(2).map(|two| two[1] - two[0]).collect();
        let middle = intervals.len() / 2;
        if intervals.is_empty() {
            return None;
        }
        let samples = *intervals.select_nth_unstable(middle).1;
        drop(intervals);
        let usual = samples as f64;
        // The trace may begin with the first pattern, or within the time in which the trigger is high.
        let is_whole = |interval: usize| (interval as f64 / usual - 1.0).abs() <= 1.0 - WHOLE;
        if self.begins_high && !is_whole(self.found[1] - self.found[0]) {
            self.found.remove(0);
        }
        let mut extra = Vec::new();
        let mut last = None;
        self.found.retain(|&edge| {
            let early = last.is_some_and(|last| ((edge - last) as f64) < EXTRA * usual);
            if early {
                extra.push(edge);
            } else {
                last = Some(edge);
            }
            !early
        });
        let tail = self.at - last?;
        let last_begins = tail as f64 >= WHOLE * usual;
        let starts = Starts::Edges { edges: self.found, last_begins };
        let windows = Windows { starts, samples, settle, end: self.at };
        Some(Cut { windows, extra, cut_off: (!last_begins).then_some(tail) })
    }
}

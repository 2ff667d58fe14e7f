//! A trigger beside the samples of a feed.

use super::header::Trigger;

/// Finds where readings begin.
#[derive(Debug)]
pub(super) struct Triggered {
    levels: Trigger,
    /// Samples of a reading.
    each: u32,
    /// The sample of the detector whose trigger comes next.
    held: Option<f64>,
    /// Whether the trigger was below its lower level since the last edge, or the feed has just begun: a DAQ that starts with
    /// the first pattern has no sample before its edge.
    was_low: bool,
    /// Samples since the edge of the last reading; `None` before the first edge.
    since: Option<u64>,
    /// Whether the samples belong to a reading that is not complete.
    is_open: bool,
}

/// What a sample of the trigger is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Edge {
    /// No edge.
    None,
    /// An edge less than half of a reading after the last one.
    Early,
    /// A reading begins. Before it, the edges of `lost` readings were missed.
    Begins {
        /// Number of readings without an edge.
        lost: usize,
    },
}

impl Triggered {
    pub(super) fn new(levels: Trigger, each: u32) -> Self {
        Self { levels, each, held: None, was_low: true, since: None, is_open: false }
    }

    /// Takes a number. Returns a sample of the detector that belongs to a reading, and its edge.
    pub(super) fn take(&mut self, number: f64) -> Option<(f64, Edge)> {
        let Some(sample) = self.held.take() else {
            self.held = Some(number);
            return None;
        };
        let edge = self.edge(number);
        match edge {
            Edge::Begins { .. } => self.is_open = true,
            // An edge is told, whether or not its sample counts.
            Edge::Early if !self.is_open => return None,
            _ => {}
        }
        self.is_open.then_some((sample, edge))
    }

    /// The reading has all its samples. Others belong to none until the next edge.
    pub(super) fn completed(&mut self) {
        self.is_open = false;
    }

    fn edge(&mut self, trigger: f64) -> Edge {
        self.since = self.since.map(|since| since + 1);
        self.was_low |= trigger < self.levels.low;
        if !(self.was_low && trigger >= self.levels.high) {
            return Edge::None;
        }
        self.was_low = false;
        let each = u64::from(self.each);
        match self.since {
            Some(since) if 2 * since < each => Edge::Early,
            since => {
                let readings = since.map_or(1, |since| (since + each / 2) / each);
                self.since = Some(0);
                Edge::Begins { lost: usize::try_from(readings.max(1) - 1).unwrap_or(usize::MAX) }
            }
        }
    }
}

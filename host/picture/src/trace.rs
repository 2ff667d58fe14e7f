//! The beginning of a trace: its samples, the trigger's edges, and the samples that make each reading.

use super::{Axis, Chart, Line};
use nirspi_files::trace::Found;

/// A point that a line leaves out, so that the next piece of the line is apart.
const APART: (f64, f64) = (f64::NAN, f64::NAN);

/// A chart of the first readings of a trace. A reading is a line over the samples that make it, at their mean.
#[must_use]
pub fn of_trace(found: &Found, footer: String) -> Chart {
    let first = &found.first;
    let samples: Vec<(f64, f64)> = first.samples.iter().map(|&(at, v)| (at as f64, v)).collect();
    let x = Axis::around("sample", samples.iter().map(|point| point.0));
    let y = Axis::around("signal", samples.iter().map(|point| point.1));
    let level = |(window, &reading): (&std::ops::Range<usize>, &f64)| {
        // The window's last sample is the one before its end.
        [(window.start as f64, reading), (window.end as f64 - 1.0, reading), APART]
    };
    let is_there = |(window, reading): &(&std::ops::Range<usize>, &f64)| {
        !window.is_empty() && reading.is_finite()
    };
    let readings = first.windows.iter().zip(&found.readings).filter(is_there);
    let upright = |edges: &[usize]| -> Vec<(f64, f64)> {
        let line = |&at: &usize| [(at as f64, y.from), (at as f64, y.to), APART];
        edges.iter().flat_map(line).collect()
    };
    let line =
        |name: &str, colour, dashed, points| Line { name: name.to_owned(), colour, dashed, points };
    let mut lines = vec![line("samples", 0, false, samples)];
    for (name, colour, edges) in [
        ("edge of the trigger: a pattern begins", 2, &first.edges),
        ("edge that comes too early: left out", 3, &first.extra),
    ] {
        if !edges.is_empty() {
            lines.push(line(name, colour, true, upright(edges)));
        }
    }
    let means = readings.flat_map(level).collect();
    lines.push(line("reading: the mean of these samples", 1, false, means));
    let header = format!("The first {} of {} readings", first.windows.len(), found.readings.len());
    Chart { header, x, y, lines, footer }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_files::provenance::Taken;
    use nirspi_files::trace::First;

    #[test]
    fn readings_and_edges_stand_where_they_were_found() {
        let first = First {
            samples: (0..40).map(|at| (at, f64::from(u32::from(at >= 20)))).collect(),
            windows: vec![2..20, 0..0, 22..40],
            edges: vec![0, 20],
            extra: vec![27],
        };
        let found = Found {
            readings: vec![0.0, f64::NAN, 1.0, 3.0],
            samples: 20,
            length: 400,
            outside: (0, 0),
            by_trigger: true,
            lost: vec![1],
            extra: vec![27],
            overloads: Vec::new(),
            cut_off: None,
            skipped: None,
            taken: Taken::simulated_or(None),
            first,
        };
        let chart = of_trace(&found, String::new());
        assert_eq!(chart.header, "The first 3 of 4 readings");
        let finite = |line: &Line| -> Vec<(f64, f64)> {
            line.points.iter().copied().filter(|point| point.0.is_finite()).collect()
        };
        let [samples, edges, extra, readings] = &chart.lines[..] else { panic!("{chart:?}") };
        assert_eq!(samples.points.len(), 40);
        let ends = (chart.y.from, chart.y.to);
        assert_eq!(finite(edges), [(0.0, ends.0), (0.0, ends.1), (20.0, ends.0), (20.0, ends.1)]);
        assert_eq!(finite(extra), [(27.0, ends.0), (27.0, ends.1)]);
        assert_eq!(finite(readings), [(2.0, 0.0), (19.0, 0.0), (22.0, 1.0), (39.0, 1.0)]);
    }
}

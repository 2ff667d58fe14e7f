//! Fourier patterns: cosines of each frequency in three or four steps, and the spectrum that they give.
//!
//! The pattern of frequency (v, u) in step p of s is `1/2 + cos(2 pi (v r / height + u c / width + p / s)) / 2` on pixel
//! (r, c). The readings of one frequency give its complex coefficient, without any constant light (Z. Zhang, X. Ma and
//! J. Zhong, Nat. Commun. 6, 6225 (2015)). A coefficient and that of the opposite frequency are conjugate; each pair gives
//! two real rows, a cosine and a sine, so that all rows are orthogonal.

use crate::Size;
use std::f64::consts::{SQRT_2, TAU};

/// A complex number.
pub type Complex = (f64, f64);

/// The angle of a frequency at a pixel, in turns.
fn turns(size: Size, (v, u): (usize, usize), pixel: usize) -> f64 {
    let (height, width) = (size.height(), size.width());
    let (row, column) = (pixel / width, pixel % width);
    // The whole turns are left out before the division, which is then exact enough at any frequency.
    let down = (v * row % height) as f64 / height as f64;
    down + (u * column % width) as f64 / width as f64
}

/// The weights of the patterns as they are shown: of each frequency, row by row, all steps.
#[must_use]
pub fn shown_weights(size: Size, steps: usize) -> Vec<f64> {
    let area = size.area();
    let mut weights = Vec::with_capacity(area * area * steps);
    for frequency in 0..area {
        let frequency = (frequency / size.width(), frequency % size.width());
        for step in 0..steps {
            let moved = step as f64 / steps as f64;
            let weight = |pixel| 0.5 + 0.5 * (TAU * (turns(size, frequency, pixel) + moved)).cos();
            weights.extend((0..area).map(weight));
        }
    }
    weights
}

/// Coefficients of frequencies side by side: rows `v`, columns `u` from 0 on, as many as were measured.
#[derive(Debug, Clone)]
pub struct Spectrum {
    /// Size of the image.
    pub size: Size,
    /// Number of columns that were measured.
    pub columns: usize,
    /// `None`: not read.
    pub values: Vec<Option<Complex>>,
}

/// Fewest numbers that tell a noise: to a quarter.
const LEAST_TWINS: usize = 8;

/// A row of the matrix: a cosine, or a sine downwards, of a frequency.
#[derive(Debug, Clone)]
pub struct Row {
    frequency: (usize, usize),
    is_sine: bool,
    scale: f64,
}

impl Row {
    /// The weights of the row on the pixels of an image of this size.
    pub fn weights(&self, size: Size) -> impl Iterator<Item = f64> + '_ {
        (0..size.area()).map(move |pixel| {
            let angle = TAU * turns(size, self.frequency, pixel);
            self.scale * if self.is_sine { -angle.sin() } else { angle.cos() }
        })
    }
}

impl Spectrum {
    /// Moves the zero frequency from the middle to the beginning, if it stands there: light has no frequency of larger
    /// amplitude. Returns a note.
    pub fn center(&mut self) -> Option<String> {
        let (height, columns) = (self.size.height(), self.columns);
        let is_whole = columns == self.size.width();
        let middle = (height / 2, if is_whole { columns / 2 } else { 0 });
        let amplitude =
            |at: usize| self.values[at].map_or(0.0, |(real, imaginary)| real.hypot(imaginary));
        let at = (0..self.values.len()).max_by(|&a, &b| amplitude(a).total_cmp(&amplitude(b)))?;
        let (v, u) = (at / columns, at % columns);
        if (v, u) == (0, 0) {
            return None;
        }
        if (v, u) != middle {
            return Some(format!(
                "frequency [{v}, {u}] is larger than the zero frequency: light has no such spectrum"
            ));
        }
        let values = &self.values;
        let from = |at: usize| {
            ((at / columns + middle.0) % height) * columns + (at % columns + middle.1) % columns
        };
        self.values = (0..values.len()).map(|at| values[from(at)]).collect();
        Some("the zero frequency is in the middle of the spectrum".to_owned())
    }

    /// Standard deviation of the noise of a value of [`rows`](Self::rows), by opposite frequencies that were both read: but for
    /// noise, their coefficients are conjugate. `None` for too few.
    #[must_use]
    pub fn noise(&self) -> Option<f64> {
        let (height, width) = (self.size.height(), self.size.width());
        let read = |v: usize, u: usize| self.values.get(v * self.columns + u).copied().flatten();
        let (mut squares, mut count) = (0.0, 0);
        for (v, u) in (0..height).flat_map(|v| (0..self.columns).map(move |u| (v, u))) {
            let opposite = ((height - v) % height, (width - u) % width);
            if (v, u) < opposite
                && opposite.1 < self.columns
                && let (Some(one), Some(other)) = (read(v, u), read(opposite.0, opposite.1))
            {
                squares += (one.0 - other.0).powi(2) + (one.1 + other.1).powi(2);
                count += 2;
            }
        }
        // A difference has the noise of both.
        (count >= LEAST_TWINS).then(|| (squares / (2 * count) as f64).sqrt())
    }

    /// The rows of all coefficients that were read, and their values, all with the same noise.
    #[must_use]
    pub fn rows(&self) -> (Vec<Row>, Vec<f64>) {
        let (height, width) = (self.size.height(), self.size.width());
        let read = |v: usize, u: usize| match u < self.columns {
            true => self.values[v * self.columns + u],
            false => None,
        };
        let (mut rows, mut values) = (Vec::new(), Vec::new());
        for v in 0..height {
            for u in 0..width {
                let frequency = (v, u);
                let opposite = ((height - v) % height, (width - u) % width);
                if frequency > opposite {
                    continue;
                }
                let one = read(v, u);
                let is_own = frequency == opposite;
                let other = if is_own { None } else { read(opposite.0, opposite.1) };
                let (value, scale) = match (one, other.map(|(real, imaginary)| (real, -imaginary)))
                {
                    // The mean has less noise, so that it counts for more.
                    (Some(one), Some(other)) => {
                        (((one.0 + other.0) / 2.0, (one.1 + other.1) / 2.0), SQRT_2)
                    }
                    (Some(value), None) | (None, Some(value)) => (value, 1.0),
                    (None, None) => continue,
                };
                rows.push(Row { frequency, is_sine: false, scale });
                values.push(scale * value.0);
                if !is_own {
                    rows.push(Row { frequency, is_sine: true, scale });
                    values.push(scale * value.1);
                }
            }
        }
        (rows, values)
    }
}

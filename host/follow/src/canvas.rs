//! The scene on a canvas that is larger than the camera's field, and what the camera reads of it.
//!
//! A target that moves shows parts that were outside the field before. So the scene has twice the side of the image,
//! which stands in its middle. The scene is kept as its Fourier transform, in which a motion is a factor:
//! what a frame reads at time `t` of a scene that moves by `v` pixels a frame is
//!
//! ```text
//! readings = H C F^-1 [ scene(f) exp(-2 pi i f.v t) sinc(f.v b) ]
//! ```
//!
//! with the crop `C` to the field and the Hadamard patterns `H` that were shown. The `sinc` is the motion within the
//! `b` frames that were added.

use nirspi_recon::{Rows, fwht};
use num_complex::Complex32;
use rustfft::{Fft, FftPlanner};
use std::f64::consts::TAU;
use std::sync::Arc;

/// Side of the canvas, in sides of the image.
const SIDES: usize = 2;

/// What turns scenes into readings and back, for one list of patterns.
pub(crate) struct Canvas {
    /// Side of the image.
    image: usize,
    /// Side of the canvas.
    side: usize,
    rows: Vec<usize>,
    forward: Arc<dyn Fft<f32>>,
    backward: Arc<dyn Fft<f32>>,
    /// Frequencies in cycles a pixel.
    frequencies: Vec<f64>,
}

/// Factors of one frame: of each frequency down and to the right.
pub(crate) struct Way {
    down: Vec<Complex32>,
    right: Vec<Complex32>,
}

impl Canvas {
    pub fn new(rows: &Rows) -> Self {
        let image = rows.side().pixels();
        let side = SIDES * image;
        let mut planner = FftPlanner::new();
        let frequencies = (0..side)
            .map(|k| if 2 * k < side { k as f64 } else { k as f64 - side as f64 } / side as f64)
            .collect();
        Self {
            image,
            side,
            rows: rows.iter().map(|&row| row as usize).collect(),
            forward: planner.plan_fft_forward(side),
            backward: planner.plan_fft_inverse(side),
            frequencies,
        }
    }

    /// Number of frequencies.
    pub fn len(&self) -> usize {
        self.side * self.side
    }

    /// Number of readings of a frame.
    pub fn readings(&self) -> usize {
        self.rows.len()
    }

    /// Place of a frequency in a spectrum: spectra have the frequencies to the right one after another, each with all
    /// frequencies down.
    pub fn each_frequency(&self) -> impl Iterator<Item = [f64; 2]> + '_ {
        let right = self.frequencies.iter();
        right.flat_map(|&right| self.frequencies.iter().map(move |&down| [down, right]))
    }

    /// Factors of a motion during `frames` frames.
    pub fn smear(&self, velocity_px: [f64; 2], frames: f64) -> Vec<f32> {
        let sinc =
            |x: f64| if x.abs() < 1e-9 { 1.0 } else { (x * TAU / 2.0).sin() / (x * TAU / 2.0) };
        self.each_frequency()
            .map(|[down, right]| {
                // The highest frequency has no sign, so it cannot be moved.
                if down <= -0.5 || right <= -0.5 {
                    return 0.0;
                }
                sinc((down * velocity_px[0] + right * velocity_px[1]) * frames) as f32
            })
            .collect()
    }

    /// The way from the middle of the frames to `time` frames after it.
    pub fn way(&self, velocity_px: [f64; 2], time: f64) -> Way {
        let factors = |pixels: f64| {
            let phase = |f: &f64| {
                let (sin, cos) = (-TAU * f * pixels * time).sin_cos();
                Complex32::new(cos as f32, sin as f32)
            };
            self.frequencies.iter().map(phase).collect()
        };
        Way { down: factors(velocity_px[0]), right: factors(velocity_px[1]) }
    }

    /// The field as the camera sees it, row by row.
    fn field(&self, spectrum: &[Complex32], way: &Way) -> Vec<f32> {
        let mut turned = spectrum.to_vec();
        for (column, right) in turned.chunks_exact_mut(self.side).zip(&way.right) {
            for (value, down) in column.iter_mut().zip(&way.down) {
                *value *= down * right;
            }
        }
        self.backward.process(&mut turned);
        // Only the lines of the field are needed.
        let first = (self.side - self.image) / 2;
        let mut lines = vec![Complex32::ZERO; self.image * self.side];
        for (line, to) in lines.chunks_exact_mut(self.side).enumerate() {
            for (column, to) in to.iter_mut().enumerate() {
                *to = turned[column * self.side + first + line];
            }
        }
        self.backward.process(&mut lines);
        let scale = 1.0 / self.len() as f32;
        let lines = lines.chunks_exact(self.side);
        lines
            .flat_map(|line| line[first..first + self.image].iter().map(|v| v.re * scale))
            .collect()
    }

    /// The spectrum of a field in the middle of an empty canvas.
    fn spectrum(&self, field: &[f32]) -> Vec<Complex32> {
        let first = (self.side - self.image) / 2;
        let mut lines = vec![Complex32::ZERO; self.image * self.side];
        for (line, from) in lines.chunks_exact_mut(self.side).zip(field.chunks_exact(self.image)) {
            for (to, from) in line[first..].iter_mut().zip(from) {
                to.re = *from;
            }
        }
        self.forward.process(&mut lines);
        let mut turned = vec![Complex32::ZERO; self.len()];
        for (line, from) in lines.chunks_exact(self.side).enumerate() {
            for (column, from) in from.iter().enumerate() {
                turned[column * self.side + first + line] = *from;
            }
        }
        self.forward.process(&mut turned);
        turned
    }

    /// The readings of a field: values of the patterns, divided by the side, so that all of them have the field's length.
    fn read(&self, mut field: Vec<f32>) -> Vec<f32> {
        self.walsh(&mut field);
        self.rows.iter().map(|&row| field[row]).collect()
    }

    /// The readings of a frame.
    pub fn frame(&self, spectrum: &[Complex32], way: &Way) -> Vec<f32> {
        self.read(self.field(spectrum, way))
    }

    /// Adds to `sum` what a frame's readings say of the scene: the transposed [`frame`](Self::frame), in units in which the
    /// scalar product of two spectra is that of their scenes.
    pub fn add_back(&self, readings: &[f32], way: &Way, sum: &mut [Complex32]) {
        let spectrum = self.spectrum(&self.least(readings));
        let columns = sum.chunks_exact_mut(self.side).zip(spectrum.chunks_exact(self.side));
        for ((to, from), right) in columns.zip(&way.right) {
            for ((to, from), down) in to.iter_mut().zip(from).zip(&way.down) {
                *to += from * (down * right).conj();
            }
        }
    }

    /// The smallest field with these readings.
    pub fn least(&self, readings: &[f32]) -> Vec<f32> {
        let mut field = vec![0.0; self.image * self.image];
        self.rows.iter().zip(readings).for_each(|(&row, &value)| field[row] = value);
        self.walsh(&mut field);
        field
    }

    fn walsh(&self, field: &mut [f32]) {
        // The length is the square of a power of two.
        let _ = fwht(field);
        let scale = 1.0 / self.image as f32;
        field.iter_mut().for_each(|value| *value *= scale);
    }
}

//! The image inside a UNet: for each pixel all of its channels side by side, and a margin of zeros
//! around the image.
//!
//! Loops over channels then read and write whole vectors, whatever the size of the image, where
//! [`Planes`](super::planes::Planes) fill vectors with pixels of one channel.
//!
//! # Invariant
//! Margins and the padding after a pixel's channels are zero
//! (`cpu::tests::winograds_convolution_is_the_sum_over_channels_and_taps`), so a convolution reads
//! zeros beyond the edge.

use super::aligned::{Aligned, LINE_FLOATS};

/// Rows of pixels; each pixel is `pitch` floats, the channels and then zeros.
///
/// Height and width are rounded up to even numbers in memory, and one pixel of zeros lies on each
/// side.
#[derive(Debug)]
pub(super) struct Pixels {
    height: usize,
    width: usize,
    channels: usize,
    values: Aligned,
}

impl Pixels {
    /// An image of zeros.
    pub fn new(channels: usize, height: usize, width: usize) -> Self {
        let mut pixels = Self { height, width, channels, values: Aligned::default() };
        pixels.values = Aligned::zeros((stored(height) + 2) * pixels.row_stride());
        pixels
    }

    /// Zeros in an image of the same size with another number of channels.
    pub fn like(&self, channels: usize) -> Self {
        Self::new(channels, self.height, self.width)
    }

    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Number of rows and columns.
    pub fn size(&self) -> (usize, usize) {
        (self.height, self.width)
    }

    /// Number of floats from one pixel to the next.
    pub fn pitch(&self) -> usize {
        padded(self.channels)
    }

    /// Number of floats from one row to the next.
    pub fn row_stride(&self) -> usize {
        (stored(self.width) + 2) * self.pitch()
    }

    /// The image with its margins, which begins with the margin above the first row.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// The image with its margins, which begins with the margin above the first row.
    pub fn values_mut(&mut self) -> &mut [f32] {
        &mut self.values
    }

    /// The pixels of row `row`.
    pub fn row(&self, row: usize) -> &[f32] {
        &self.values[(row + 1) * self.row_stride() + self.pitch()..][..self.width * self.pitch()]
    }

    /// The pixels of row `row`.
    pub fn row_mut(&mut self, row: usize) -> &mut [f32] {
        let (stride, pitch, width) = (self.row_stride(), self.pitch(), self.width);
        &mut self.values[(row + 1) * stride + pitch..][..width * pitch]
    }

    /// The channels of the pixels of each window side by side, one window after another: channel c
    /// of the window's pixel (dy, dx) has the index `(dy side + dx) channels + c`.
    pub fn windows(&self, Window { side, stride, margin }: Window) -> Vec<f32> {
        let (rows, columns) = (self.height.div_ceil(stride), self.width.div_ceil(stride));
        let (pitch, line) = (self.pitch(), self.row_stride());
        let mut out = Vec::with_capacity(rows * columns * side * side * self.channels);
        for (row, column) in (0..rows).flat_map(|r| (0..columns).map(move |c| (r, c))) {
            let first = 1 - margin;
            let corner = (stride * row + first) * line + (stride * column + first) * pitch;
            for dy in 0..side {
                let pixels = &self.values[corner + dy * line..][..side * pitch];
                if pitch == self.channels {
                    out.extend_from_slice(pixels);
                } else {
                    pixels
                        .chunks_exact(pitch)
                        .for_each(|pixel| out.extend_from_slice(&pixel[..self.channels]));
                }
            }
        }
        out
    }

    /// The sum of each channel.
    pub fn sums(&self) -> Vec<f32> {
        let mut sums = vec![0.0; self.pitch()];
        // Margins are zero, so they add nothing.
        for pixel in self.values.chunks_exact(self.pitch()) {
            sums.iter_mut().zip(pixel).for_each(|(sum, value)| *sum += value);
        }
        sums.truncate(self.channels);
        sums
    }

    /// Adds squares of `side` x `side` pixels, each in `pitch` floats of `squares` and in the order
    /// of [`windows`](Self::windows).
    pub fn add_squares(&mut self, side: usize, squares: &[f32], pitch: usize) {
        let (own, channels, columns) = (self.pitch(), self.channels, self.width / side);
        for (index, square) in squares.chunks_exact(pitch).enumerate() {
            let (row, column) = (index / columns, index % columns);
            for (dy, line) in square.chunks_exact(side * channels).take(side).enumerate() {
                let to = self.row_mut(side * row + dy).chunks_exact_mut(own).skip(side * column);
                for (pixel, values) in to.zip(line.chunks_exact(channels)) {
                    pixel.iter_mut().zip(values).for_each(|(pixel, value)| *pixel += value);
                }
            }
        }
    }

    /// Stores an image of `2 height` x `2 width` in four channels: pixel (2r + dy, 2c + dx) goes to
    /// channel `channel + 2 dy + dx` of (r, c).
    pub fn unshuffle(&mut self, channel: usize, image: &[f32]) {
        let (pitch, width) = (self.pitch(), 2 * self.width);
        for (row, line) in image.chunks_exact(width).enumerate() {
            let to = self.row_mut(row / 2).chunks_exact_mut(pitch);
            for (pixel, pair) in to.zip(line.chunks_exact(2)) {
                pixel[channel + 2 * (row % 2)..][..2].copy_from_slice(pair);
            }
        }
    }

    /// The image of `2 height` x `2 width` in the first four channels.
    pub fn shuffled(&self) -> Vec<f32> {
        let lines = (0..2 * self.height).map(|row| (self.row(row / 2), 2 * (row % 2)));
        let pairs = lines.flat_map(|(line, channel)| {
            line.chunks_exact(self.pitch()).flat_map(move |pixel| &pixel[channel..][..2])
        });
        pairs.copied().collect()
    }
}

/// Pixels that a convolution takes together: squares of `side` x `side` pixels, `stride` pixels
/// apart.
#[derive(Debug, Clone, Copy)]
pub(super) struct Window {
    pub side: usize,
    pub stride: usize,
    /// Rows and columns, 0 or 1, of the first window that lie beyond the edge.
    pub margin: usize,
}

/// The number of rows or columns in memory, without margins.
fn stored(pixels: usize) -> usize {
    pixels.next_multiple_of(2)
}

/// Number of floats of `channels` channels with their padding.
pub(super) fn padded(channels: usize) -> usize {
    channels.next_multiple_of(LINE_FLOATS)
}

//! Channels of one image inside a network, each with a margin of zeros.
//!
//! # Invariant
//! Outside a convolution's inner loop every margin is zero
//! (`cpu::tests::a_convolution_is_the_sum_over_channels_and_taps`). So a tap of a convolution is
//! one offset into a channel, the same for every pixel, at the edge too.

/// Number of floats after a channel that a loop over whole vectors may read, and may write if the
/// channel is its output.
pub(super) const SLACK: usize = 64;

/// Channels of `height` x `width` pixels with a margin of `margin` zeros, rows one after another.
#[derive(Debug, Clone)]
pub(super) struct Planes {
    height: usize,
    width: usize,
    margin: usize,
    values: Vec<f32>,
    channels: usize,
}

impl Planes {
    /// Channels of zeros.
    pub fn new(channels: usize, height: usize, width: usize, margin: usize) -> Self {
        let mut planes = Self { height, width, margin, values: Vec::new(), channels };
        planes.values = vec![0.0; channels * planes.stride()];
        planes
    }

    /// Planes of the same size with another number of channels.
    pub fn like(&self, channels: usize) -> Self {
        Self::new(channels, self.height, self.width, self.margin)
    }

    /// Number of channels.
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Number of rows and columns.
    pub fn size(&self) -> (usize, usize) {
        (self.height, self.width)
    }

    /// Number of floats from one row to the next.
    pub fn row_stride(&self) -> usize {
        self.width + 2 * self.margin
    }

    /// Number of floats from one channel to the next.
    pub fn stride(&self) -> usize {
        (self.height + 2 * self.margin) * self.row_stride() + SLACK
    }

    /// Index of the first pixel in its channel.
    pub fn first(&self) -> usize {
        self.margin * (self.row_stride() + 1)
    }

    /// Number of floats from the first pixel to the last, inclusive; the margins between rows lie
    /// within.
    pub fn span(&self) -> usize {
        (self.height - 1) * self.row_stride() + self.width
    }

    /// All channels, with margins and slack.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// All channels, with margins and slack.
    pub fn values_mut(&mut self) -> &mut [f32] {
        &mut self.values
    }

    /// Row `row` of channel `channel`.
    pub fn row(&self, channel: usize, row: usize) -> &[f32] {
        let start = channel * self.stride() + self.first() + row * self.row_stride();
        &self.values[start..start + self.width]
    }

    /// Row `row` of channel `channel`.
    pub fn row_mut(&mut self, channel: usize, row: usize) -> &mut [f32] {
        let start = channel * self.stride() + self.first() + row * self.row_stride();
        &mut self.values[start..start + self.width]
    }

    /// Restores the zeros of the margins after a loop over whole channels.
    pub fn clear_margins(&mut self) {
        let (stride, row, first, span) =
            (self.stride(), self.row_stride(), self.first(), self.span());
        for channel in self.values.chunks_exact_mut(stride) {
            channel[..first].fill(0.0);
            for end in 1..self.height {
                channel[first + end * row - 2 * self.margin..][..2 * self.margin].fill(0.0);
            }
            channel[first + span..].fill(0.0);
        }
    }

    /// All pixels, channel by channel, without margins.
    pub fn pixels(&self) -> Vec<f32> {
        let rows = (0..self.channels).flat_map(|c| (0..self.height).map(move |row| (c, row)));
        rows.flat_map(|(channel, row)| self.row(channel, row)).copied().collect()
    }

    /// Each four channels become one of twice the size, with margin `margin`: channel
    /// `4 c + 2 dy + dx` of pixel (row, column) becomes pixel (2 row + dy, 2 column + dx) of channel c.
    pub fn shuffle(&self, margin: usize) -> Self {
        let (height, width) = self.size();
        let mut out = Self::new(self.channels / 4, 2 * height, 2 * width, margin);
        for channel in 0..self.channels {
            let (dy, dx) = (channel / 2 % 2, channel % 2);
            for row in 0..height {
                let line = out.row_mut(channel / 4, 2 * row + dy);
                for (value, pixel) in line[dx..].iter_mut().step_by(2).zip(self.row(channel, row)) {
                    *value = *pixel;
                }
            }
        }
        out
    }
}

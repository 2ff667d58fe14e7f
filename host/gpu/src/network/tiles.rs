//! Distributes a convolution to warps that multiply small matrices, as tensor cores do.
//!
//! # How
//! A workgroup computes a tile: some pixels of the output times some of its channels. It takes 16
//! input channels at a time into shared memory: every input pixel under its tile, with the margin
//! that the kernel needs, and the weights of all taps. Then each tap is a product of matrices, pixels
//! by input channels and input channels by output channels, and for another tap only the first pixel
//! of a row differs. So a number is loaded and rounded once for all taps.
//!
//! Each of the 32 units of a warp holds a fixed part of a matrix (PTX ISA, "Matrix Fragments for
//! `mma.m16n8k16`"). `ldmatrix` fetches four matrices of 8 x 8 from shared memory: each unit names the
//! address of one row of eight numbers, which have 16 bytes in `f16`.
//!
//! # Invariant
//! Eight rows that follow each other lie in eight different sets of banks, so a warp never waits for
//! a bank (`tests::eight_rows_that_follow_each_other_meet_no_bank_twice`).

use super::plan::Geometry;
use crate::limits::{DeviceLimits, GROUPS};
use cubecl::prelude::*;

/// Number of input channels in one step through shared memory, and of a product of matrices.
pub const STEP: usize = 16;

/// Number of units of a warp.
pub(super) const WARP: usize = 32;

/// Number of warps of a workgroup.
const WARPS: usize = 4;

/// Number of pixels in one product of matrices.
pub(super) const PIXELS: usize = 16;

/// Number of output channels in one product of matrices.
pub(super) const CHANNELS: usize = 8;

/// Possible numbers of products side by side in a warp, of [`CHANNELS`] channels each. They are
/// even, because one `ldmatrix` fetches the weights of two.
const ACROSS: [usize; 3] = [6, 4, 2];

/// Number of products below each other in a warp, of [`PIXELS`] pixels each: with enough workgroups
/// to fill a large GPU, and with fewer.
const DOWN: [usize; 2] = [4, 2];

/// Number of workgroups from which a warp takes the larger number of pixels: an H200 has 132
/// multiprocessors, and each can hold three.
const ENOUGH_GROUPS: usize = 400;

/// The part of the output channels that one workgroup computes. Only the number of output channels
/// decides about it, so weights can be packed before the size of a batch is known.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Columns {
    /// Number of products side by side in a warp.
    pub(super) across: usize,
    /// Number of warps side by side.
    pub(super) warps: usize,
}

impl Columns {
    /// The columns for `outputs` output channels; `None` if they are not a multiple of 16.
    #[must_use]
    pub fn of(outputs: usize) -> Option<Self> {
        let across = ACROSS.into_iter().find(|across| outputs.is_multiple_of(CHANNELS * across))?;
        let warps = if outputs.is_multiple_of(2 * CHANNELS * across) { 2 } else { 1 };
        (outputs > 0).then_some(Self { across, warps })
    }

    /// Number of output channels of a workgroup.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.warps * self.across * CHANNELS
    }
}

/// Where half `half` (0 or 1) of the 16 numbers of row `row` lies in shared memory, in units of
/// eight numbers. Rows are pixels, or output channels in the weights of a tap.
#[must_use]
pub fn half_at(row: usize, half: usize) -> usize {
    place(row, half)
}

/// [`half_at`], for kernels too.
#[cube]
pub(super) fn place(row: usize, half: usize) -> usize {
    2 * row + (half ^ ((row >> 2) & 1))
}

/// A convolution for images of one size, as its kernel is compiled for it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Tiles {
    pub columns: Columns,
    /// Number of products below each other in a warp.
    pub down: usize,
    /// Number of terms of each activation, 1 or 2: one number in `f16`, or two whose sum has 22 bits.
    pub planes: usize,
    /// Number of lines of the kernel whose weights are in shared memory at a time: all, or one where
    /// the memory is small.
    pub lines: usize,
    pub kernel: usize,
    pub stride: usize,
    pub centre: usize,
    pub side: usize,
    pub out_side: usize,
}

impl Tiles {
    /// The tiles for `frames` images of `side` x `side`; `None` if this convolution does not fit
    /// tiles, or the device has too little shared memory for it.
    pub fn new(
        geometry: &Geometry,
        columns: Columns,
        (frames, side): (usize, usize),
        planes: usize,
        limits: &DeviceLimits,
    ) -> Option<Self> {
        let out_side = geometry.side(side);
        let Geometry { kernel, stride, centre, .. } = *geometry;
        let of = |down, lines| Self {
            columns,
            down,
            planes,
            lines,
            kernel,
            stride,
            centre,
            side,
            out_side,
        };
        if !out_side.is_power_of_two() || out_side > of(DOWN[1], 1).pixels() {
            return None;
        }
        let fits = |tiles: &Self| {
            tiles.is_whole()
                && tiles.shared_bytes() <= limits.shared_bytes
                && tiles.groups(frames) <= GROUPS
        };
        let groups = of(DOWN[0], 1).groups(frames) * (geometry.outputs / columns.channels());
        let [first, second] = if groups >= ENOUGH_GROUPS { DOWN } else { [DOWN[1], DOWN[0]] };
        let lines = [kernel, 1];
        let ways = [first, second].into_iter().flat_map(|down| lines.map(|lines| of(down, lines)));
        ways.into_iter().find(fits)
    }

    /// The same with this number of products below each other in a warp, where that fits.
    pub fn with_down(self, down: usize, limits: &DeviceLimits) -> Self {
        let ways = [self.kernel, 1].map(|lines| Self { down, lines, ..self });
        let fits = |tiles: &Self| tiles.is_whole() && tiles.shared_bytes() <= limits.shared_bytes;
        ways.into_iter().find(fits).unwrap_or(self)
    }

    /// Whether tiles cover whole rows of an image, or whole images.
    fn is_whole(&self) -> bool {
        let (pixels, side) = (self.pixels(), self.out_side);
        side <= pixels && pixels.is_multiple_of(side * self.rows())
    }

    /// Number of warps below each other.
    pub fn warps_down(&self) -> usize {
        WARPS / self.columns.warps
    }

    /// Number of units of a workgroup.
    pub fn units(&self) -> usize {
        WARPS * WARP
    }

    /// Number of output pixels of a workgroup.
    pub fn pixels(&self) -> usize {
        self.warps_down() * self.down * PIXELS
    }

    /// Number of rows of an image in a workgroup's pixels.
    pub fn rows(&self) -> usize {
        self.out_side.min(self.pixels() / self.out_side)
    }

    /// Number of images in a workgroup's pixels.
    pub fn frames(&self) -> usize {
        self.pixels() / (self.rows() * self.out_side)
    }

    /// Number of workgroups for the pixels of `frames` images.
    pub fn groups(&self, frames: usize) -> usize {
        frames.div_ceil(self.frames()) * (self.out_side / self.rows())
    }

    /// Number of input rows of an image under a workgroup's pixels, with the margin.
    pub fn staged_rows(&self) -> usize {
        (self.rows() - 1) * self.stride + self.kernel
    }

    /// Number of input columns under a workgroup's pixels, with the margin.
    pub fn staged_columns(&self) -> usize {
        (self.out_side - 1) * self.stride + self.kernel
    }

    /// Number of input pixels under a workgroup's pixels.
    pub fn staged(&self) -> usize {
        self.frames() * self.staged_rows() * self.staged_columns()
    }

    /// Number of weights of a workgroup in shared memory.
    pub fn weights(&self) -> usize {
        self.lines * self.kernel * self.columns.channels() * STEP
    }

    /// Bytes of shared memory, in `f16`.
    pub fn shared_bytes(&self) -> usize {
        2 * (self.planes * self.staged() * STEP + self.weights())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const H100: DeviceLimits =
        DeviceLimits { shared_bytes: 227 << 10, buffer_bytes: 1 << 30, units: 1024, buffers: 64 };

    fn tiles(channels: usize, side: usize, frames: usize) -> Tiles {
        let geometry =
            Geometry { inputs: channels, outputs: channels, kernel: 3, stride: 1, centre: 1 };
        Tiles::new(&geometry, Columns::of(channels).unwrap(), (frames, side), 2, &H100).unwrap()
    }

    #[test]
    fn eight_rows_that_follow_each_other_meet_no_bank_twice() {
        for (first, half) in (0..64).flat_map(|first| [(first, 0), (first, 1)]) {
            let mut sets: Vec<usize> =
                (first..first + 8).map(|row| half_at(row, half) % 8).collect();
            sets.sort_unstable();
            assert_eq!(sets, [0, 1, 2, 3, 4, 5, 6, 7], "rows from {first}");
        }
        let mut places: Vec<usize> =
            (0..40).flat_map(|row| [half_at(row, 0), half_at(row, 1)]).collect();
        places.sort_unstable();
        assert!(places.into_iter().eq(0..80), "each half has a place of its own");
    }

    #[test]
    fn tiles_of_the_shipped_networks_waste_no_channel_and_no_pixel() {
        for (channels, side, pixels, columns, frames) in
            [(48, 32, 256, 48, 1), (96, 16, 128, 96, 1), (192, 8, 128, 96, 2)]
        {
            let tiles = tiles(channels, side, 1024);
            assert_eq!((tiles.pixels(), tiles.columns.channels()), (pixels, columns));
            assert_eq!(tiles.frames(), frames);
            assert_eq!(tiles.groups(1024) * pixels, 1024 * side * side);
            // Three workgroups fit a multiprocessor of an H100.
            assert!(3 * tiles.shared_bytes() <= 228 << 10, "{}", tiles.shared_bytes());
        }
        assert_eq!(
            tiles(48, 32, 1).pixels(),
            128,
            "one frame has too few workgroups of 256 pixels"
        );
        assert_eq!(Columns::of(12), None);
        assert_eq!(Columns::of(0), None);
    }

    #[test]
    fn what_does_not_fit_tiles_is_refused() {
        let of = |side, frames, limits: &DeviceLimits| {
            let geometry = Geometry { inputs: 48, outputs: 48, kernel: 3, stride: 1, centre: 1 };
            Tiles::new(&geometry, Columns::of(48).unwrap(), (frames, side), 1, limits)
        };
        assert!(of(32, 4, &H100).is_some());
        assert_eq!(of(24, 4, &H100), None, "rows that do not fill a tile");
        assert_eq!(of(512, 4, &H100), None, "a row that is longer than a tile");
        let with =
            |shared_bytes| of(32, 4, &DeviceLimits { shared_bytes, ..H100 }).map(|t| t.lines);
        assert_eq!(with(22 << 10), Some(3));
        assert_eq!(with(16 << 10), Some(1), "weights of one line at a time");
        assert_eq!(with(10 << 10), None);
        assert!(of(32, 16_383, &H100).is_some());
        assert_eq!(of(32, 16_384, &H100), None, "more workgroups than every device takes");
    }

    #[test]
    fn every_pixel_of_a_tile_has_its_input() {
        for (kernel, stride, centre) in [(3, 1, 1), (1, 1, 0), (2, 2, 0)] {
            for side in [4, 8, 16, 32, 64] {
                let geometry = Geometry { inputs: 16, outputs: 32, kernel, stride, centre };
                let columns = Columns::of(32).unwrap();
                let Some(tiles) = Tiles::new(&geometry, columns, (3, side), 1, &H100) else {
                    continue;
                };
                let pixel = |frame: usize, y: usize, x: usize| {
                    (frame * tiles.staged_rows() + y * stride) * tiles.staged_columns() + x * stride
                };
                let last = pixel(tiles.frames() - 1, tiles.rows() - 1, tiles.out_side - 1);
                let tap = (kernel - 1) * tiles.staged_columns() + kernel - 1;
                assert_eq!(last + tap + 1, tiles.staged(), "{kernel} {stride} {side}");
            }
        }
    }
}

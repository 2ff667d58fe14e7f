//! Distributes a convolution to workgroups within the limits of a device.
//!
//! # Invariant
//! No unit makes more rounds of loops than software Vulkan finishes. Software Vulkan ends a longer
//! loop after some 65 535 rounds without an error
//! (`tests::a_convolution_of_too_many_rounds_is_refused`).

use crate::limits::{BUFFER_BYTES, GROUPS, ROUNDS};

/// Number of input channels in one step through shared memory. It equals [`COLUMNS`], so a unit
/// loads the pixels that it computes.
pub const DEPTH: usize = 8;

/// Number of units side by side in a workgroup; each has other channels.
pub const COLUMNS: usize = 8;

/// Number of units below each other; each has other pixels.
pub(super) const ROWS: usize = 32;

/// Number of units of a workgroup.
pub(super) const UNITS: usize = COLUMNS * ROWS;

/// Possible numbers of channels that one unit computes for each of its pixels.
const CHANNELS_A_UNIT: [usize; 4] = [8, 6, 4, 2];

/// Number of pixels of one unit: with enough pixels to fill a large GPU with workgroups, and with
/// fewer.
const PIXELS_A_UNIT: [usize; 2] = [8, 2];

/// Number of pixels times tiles of channels from which units take the larger number of pixels.
const ENOUGH_PIXELS: usize = 1 << 16;

/// Sizes of a convolution of square kernels over square images.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Geometry {
    /// Number of input channels.
    pub inputs: usize,
    /// Number of output channels.
    pub outputs: usize,
    /// Side of a kernel.
    pub kernel: usize,
    /// Distance of two neighbouring outputs in the input.
    pub stride: usize,
    /// The tap, in both directions, that lies on the pixel itself; this many zeros surround the
    /// image.
    pub centre: usize,
}

impl Geometry {
    /// Side of the output for an input of `side` x `side`.
    pub fn side(&self, side: usize) -> usize {
        (side + 2 * self.centre - self.kernel) / self.stride + 1
    }

    /// Number of steps of [`DEPTH`] input channels.
    pub fn steps(&self) -> usize {
        self.kernel * self.kernel * self.inputs.div_ceil(DEPTH)
    }

    /// Number of loop rounds of one unit.
    fn rounds(&self) -> usize {
        let steps = self.steps();
        self.kernel + self.kernel * self.kernel + steps * (1 + DEPTH)
    }

    /// The most input channels of a convolution whose kernel has this side, so that no unit makes more
    /// than [`ROUNDS`] rounds of loops.
    pub fn most_inputs(kernel: usize) -> usize {
        let taps = kernel * kernel;
        (ROUNDS - kernel - taps) / (taps * (1 + DEPTH)) * DEPTH
    }

    /// Whether a unit stays within the rounds.
    pub(crate) fn fits(&self) -> bool {
        self.rounds() <= ROUNDS
    }
}

/// Number of channels of one unit. The tiles of `outputs` channels then waste least; of equal
/// choices the widest wins.
pub fn channels_a_unit(outputs: usize) -> usize {
    let padded = |channels: usize| outputs.next_multiple_of(COLUMNS * channels);
    let best = CHANNELS_A_UNIT.into_iter().min_by_key(|&channels| padded(channels));
    best.unwrap_or(CHANNELS_A_UNIT[0])
}

/// Number of pixels of one unit, for `pixels` in all and `tiles` tiles of channels.
pub(crate) fn pixels_a_unit(pixels: usize, tiles: usize) -> usize {
    let [many, few] = PIXELS_A_UNIT;
    if pixels * tiles >= ENOUGH_PIXELS || pixels > GROUPS * ROWS * few { many } else { few }
}

/// Number of frames that a network processes at once, if the largest activation of a frame has
/// `numbers` numbers and a buffer `buffer_bytes`: at least one, at most `most`.
pub fn frames_at_once(numbers: usize, buffer_bytes: usize, most: usize) -> usize {
    let bytes = buffer_bytes.min(BUFFER_BYTES);
    (bytes / (size_of::<f32>() * numbers.max(1))).clamp(1, most)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn geometry(inputs: usize, kernel: usize, stride: usize, centre: usize) -> Geometry {
        Geometry { inputs, outputs: 48, kernel, stride, centre }
    }

    #[test]
    fn sides_are_those_of_pytorch() {
        // Kernel, stride, padding, side in and side out of torch.nn.Conv2d.
        for (kernel, stride, centre, side, expected) in [
            (3, 1, 1, 32, 32),
            (3, 2, 1, 32, 16),
            (3, 2, 1, 15, 8),
            (2, 2, 0, 16, 8),
            (5, 1, 2, 8, 8),
            (1, 1, 0, 1, 1),
        ] {
            assert_eq!(
                geometry(1, kernel, stride, centre).side(side),
                expected,
                "{kernel} {stride}"
            );
        }
    }

    #[test]
    fn tiles_waste_no_channel_of_the_shipped_networks_and_few_of_others() {
        for (outputs, channels) in
            [(48, 6), (96, 6), (192, 8), (64, 8), (32, 4), (16, 2), (12, 2), (4, 2), (128, 8)]
        {
            assert_eq!(channels_a_unit(outputs), channels, "{outputs}");
        }
        for outputs in 1..400_usize {
            let tile = COLUMNS * channels_a_unit(outputs);
            assert!(outputs.next_multiple_of(tile) - outputs < 16, "{outputs}: {tile}");
        }
    }

    #[test]
    fn a_convolution_of_too_many_rounds_is_refused() {
        for kernel in [1, 2, 3, 5] {
            let most = Geometry::most_inputs(kernel);
            assert!(geometry(most, kernel, 1, 0).fits(), "{kernel}");
            assert!(!geometry(most + 1, kernel, 1, 0).fits(), "{kernel}");
            assert!(geometry(most, kernel, 1, 0).rounds() < 65_535);
        }
        assert!(Geometry::most_inputs(3) >= 4 * 1024, "the widest network that can be trained");
    }

    #[test]
    fn as_many_frames_at_once_as_a_buffer_holds() {
        assert_eq!(frames_at_once(32 * 32 * 48, 128 << 20, 256), 256);
        assert_eq!(frames_at_once(32 * 32 * 1024, 128 << 20, 256), 32);
        assert_eq!(frames_at_once(usize::MAX / 8, 128 << 20, 256), 1);
        assert_eq!(
            frames_at_once(32 * 32 * 48, usize::MAX, 100_000),
            BUFFER_BYTES / (4 * 32 * 32 * 48)
        );
    }

    #[test]
    fn workgroups_stay_below_what_every_device_takes() {
        for pixels in [1, 4095, 1 << 16, 4_194_240, 4_194_241, 16_000_000] {
            let groups = pixels_div(pixels, pixels_a_unit(pixels, 1));
            assert!(groups <= GROUPS, "{pixels}: {groups}");
        }
        assert_eq!((pixels_a_unit(1024, 1), pixels_a_unit(1 << 14, 4)), (2, 8));
    }

    fn pixels_div(pixels: usize, a_unit: usize) -> usize {
        pixels.div_ceil(ROWS * a_unit)
    }
}

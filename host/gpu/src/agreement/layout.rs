//! The order of the numbers that the host gives to the kernel.

/// Side of an image.
pub(super) const FINE: usize = 64;

/// Numbers of a matrix of 32 x 32.
const SMALL: usize = 32 * 32;

/// First number in the tables of the waves of 64 pixels, row after row.
pub(super) const WAVES: usize = 0;
/// Of the waves of 32 pixels.
pub(super) const COSINES: usize = FINE * FINE;
/// Of the same matrix, transposed.
pub(super) const COSINES_ACROSS: usize = COSINES + SMALL;
/// Of the matrix from the cosine transform of readings to their Walsh-Hadamard transform.
pub(super) const WALSH: usize = COSINES_ACROSS + SMALL;
/// Of the same matrix, transposed.
pub(super) const WALSH_ACROSS: usize = WALSH + SMALL;
/// Of a 1 for each measured row and a 0 for the others.
pub(super) const MASK: usize = WALSH_ACROSS + SMALL;
/// Number of numbers of the tables.
pub(super) const TABLES: usize = MASK + SMALL;

/// Where each setting stands.
pub(super) struct Places {
    pub sigma_scale: usize,
    pub sigma_least: usize,
    pub sigma_most: usize,
    pub noise_scale: usize,
    pub noise_least: usize,
    pub noise_most: usize,
    pub noise_floor: usize,
    pub tau: usize,
    pub least_log: usize,
    pub most_log: usize,
    pub degrees: usize,
    pub tolerance: usize,
    pub reached: usize,
    pub stuck: usize,
}

pub(super) const SETTINGS: Places = Places {
    sigma_scale: 0,
    sigma_least: 1,
    sigma_most: 2,
    noise_scale: 3,
    noise_least: 4,
    noise_most: 5,
    noise_floor: 6,
    tau: 7,
    least_log: 8,
    most_log: 9,
    degrees: 10,
    tolerance: 11,
    reached: 12,
    stuck: 13,
};

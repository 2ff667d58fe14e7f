//! Random numbers that depend on seed, purpose and number, and not on earlier draws.

use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

/// The purpose of random numbers. Two purposes never share a stream.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Purpose {
    /// Choice of the held-out groups.
    Split,
    /// Training examples.
    Training,
    /// Held-out examples.
    HeldOut,
    /// Pairs for training.
    Pairs,
}

/// The stream of random numbers for example `index` of this seed.
#[must_use]
pub fn stream(seed: u64, purpose: Purpose, index: u64) -> Pcg64Mcg {
    let mixed =
        [purpose as u64, index].iter().fold(mix(seed), |state, part| mix(state ^ mix(*part)));
    Pcg64Mcg::seed_from_u64(mixed)
}

/// The finaliser of splitmix64 (Steele, Lea and Flood, OOPSLA 2014), which makes neighbouring
/// values independent.
fn mix(value: u64) -> u64 {
    let mut z = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::RngExt;

    #[test]
    fn seed_purpose_and_number_each_make_another_stream() {
        let first = |seed, purpose, index| stream(seed, purpose, index).random::<u64>();
        let base = first(1, Purpose::Training, 1);
        assert_eq!(base, first(1, Purpose::Training, 1));
        for other in [
            first(2, Purpose::Training, 1),
            first(1, Purpose::HeldOut, 1),
            first(1, Purpose::Training, 2),
        ] {
            assert_ne!(base, other);
        }
    }
}

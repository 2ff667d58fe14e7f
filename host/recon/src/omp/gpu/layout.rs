//! How numbers of a pursuit lie in a device's memory: what kernels and host must agree on.

/// Vectors of which one unit computes the products together.
pub(super) const TOGETHER: usize = 8;

/// Numbers of a frame's state.
pub(super) const STATE: usize = 8;
/// Energy of the measurement.
pub(super) const ENERGY: usize = 0;
/// Energy of a residual that is explained enough.
pub(super) const ENOUGH: usize = 1;
/// Energy of the residual.
pub(super) const REMAINING: usize = 2;
/// The first atom's score.
pub(super) const FIRST_BEST: usize = 3;
/// Atoms in the support.
pub(super) const COUNT: usize = 4;
/// Whether the pursuit goes on: the number of a [`Progress`].
pub(super) const STOP: usize = 5;
/// Least lead of a chosen atom's score over the next best.
pub(super) const LEAD: usize = 6;
/// Least distance of the residual's energy from enough, where that was asked.
pub(super) const CLOSEST: usize = 7;

/// Whether a pursuit goes on, and if not, why. Kernels keep it as a number among the state's.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub(super) enum Progress {
    /// Looking for the next atom, or as many atoms as asked for.
    Looking = 0,
    /// The residual is explained enough.
    Explained = 1,
    /// No atom is left that explains more.
    NoAtomLeft = 2,
    /// The best atom left is a combination of those chosen.
    Dependent = 3,
}

/// [`Progress::Looking`] as kernels write it: buffers on a device start with it, as zeros.
pub(super) const LOOKING: f32 = Progress::Looking.number();
/// [`Progress::Explained`] as kernels write it.
pub(super) const EXPLAINED: f32 = Progress::Explained.number();
/// [`Progress::NoAtomLeft`] as kernels write it.
pub(super) const NO_ATOM_LEFT: f32 = Progress::NoAtomLeft.number();
/// [`Progress::Dependent`] as kernels write it.
pub(super) const DEPENDENT: f32 = Progress::Dependent.number();

impl Progress {
    const ALL: [Self; 4] = [Self::Looking, Self::Explained, Self::NoAtomLeft, Self::Dependent];

    const fn number(self) -> f32 {
        self as u8 as f32
    }

    /// What a kernel wrote; [`Progress::Dependent`], whose frames are solved again, for any other number.
    pub(super) fn read(number: f32) -> Self {
        let found = Self::ALL.into_iter().find(|progress| progress.number() == number);
        found.unwrap_or(Self::Dependent)
    }
}

/// What is known of a pursuit when its kernel is compiled.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(super) struct Shape {
    /// Units of the workgroup that pursues one frame; a power of two.
    pub units: usize,
    /// Atoms of each unit: `atom = unit + units * i`.
    pub per_unit: usize,
    /// Room for the weights of chosen atoms in shared memory.
    pub capacity: usize,
}

impl Shape {
    /// Atoms with padding: the length of a vector over all of them.
    pub(super) fn width(&self) -> usize {
        self.units * self.per_unit
    }

    /// Shared memory of a pursuit: three numbers a unit, the weights, and the chosen atom's projection.
    pub(super) fn shared_bytes(&self) -> usize {
        4 * (3 * self.units + self.capacity + 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_end_of_a_pursuit_is_read_as_it_was_written() {
        for progress in Progress::ALL {
            assert_eq!(Progress::read(progress.number()), progress);
        }
        assert_eq!([LOOKING, EXPLAINED, NO_ATOM_LEFT, DEPENDENT], [0.0, 1.0, 2.0, 3.0]);
        assert_eq!(Progress::read(f32::NAN), Progress::Dependent);
    }
}

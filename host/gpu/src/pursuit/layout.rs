//! The layout of a pursuit's numbers in a device's memory, which kernels and host share.

/// Number of vectors whose products one unit computes together.
pub const TOGETHER: usize = 8;

/// Number of state values of a frame.
pub const STATE: usize = 9;
/// Energy of the measurement.
pub const ENERGY: usize = 0;
/// Energy of the residual at which the pursuit stops.
pub const ENOUGH: usize = 1;
/// Energy of the residual.
pub const REMAINING: usize = 2;
/// The first atom's score.
pub const FIRST_BEST: usize = 3;
/// Number of atoms in the support.
pub const COUNT: usize = 4;
/// Whether the pursuit goes on: the number of a [`Progress`].
pub const STOP: usize = 5;
/// Smallest lead of a chosen atom's score over the next best score.
pub const LEAD: usize = 6;
/// Smallest distance of the residual's energy from the limit, over the steps that checked it.
pub const CLOSEST: usize = 7;

/// Number of choices that were made in double precision.
pub const DECIDED: usize = 8;

/// Whether a pursuit goes on, and if not, why. Kernels store it as a number of the state.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Progress {
    /// Looking for the next atom, or the requested number of atoms is reached.
    Looking = 0,
    /// The residual is within the limit.
    Explained = 1,
    /// No atom is left that correlates with the residual.
    NoAtomLeft = 2,
    /// The best atom left is a combination of the chosen atoms.
    Dependent = 3,
}

/// [`Progress::Looking`] as a number for kernels; new buffers hold it, because it is zero.
pub const LOOKING: f32 = Progress::Looking.number();
/// [`Progress::Explained`] as a number for kernels.
pub const EXPLAINED: f32 = Progress::Explained.number();
/// [`Progress::NoAtomLeft`] as a number for kernels.
pub const NO_ATOM_LEFT: f32 = Progress::NoAtomLeft.number();
/// [`Progress::Dependent`] as a number for kernels.
pub const DEPENDENT: f32 = Progress::Dependent.number();

impl Progress {
    const ALL: [Self; 4] = [Self::Looking, Self::Explained, Self::NoAtomLeft, Self::Dependent];

    const fn number(self) -> f32 {
        self as u8 as f32
    }

    /// The progress that a kernel wrote. Any unknown number is [`Progress::Dependent`], whose
    /// frames are solved again.
    pub fn read(number: f32) -> Self {
        let found = Self::ALL.into_iter().find(|progress| progress.number() == number);
        found.unwrap_or(Self::Dependent)
    }
}

/// Facts about a pursuit that its kernel is compiled for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Shape {
    /// Number of units in the workgroup of a frame; a power of two.
    pub units: usize,
    /// Number of atoms of each unit: `atom = unit + units * i`.
    pub per_unit: usize,
    /// Number of weights that shared memory has room for.
    pub capacity: usize,
}

impl Shape {
    /// Number of atoms with padding: the length of a vector over all atoms.
    pub fn width(&self) -> usize {
        self.units * self.per_unit
    }

    /// Bytes of shared memory of a pursuit: three numbers for each unit, the weights, and the
    /// chosen atom's projection.
    pub fn shared_bytes(&self) -> usize {
        4 * (3 * self.units + self.capacity + 1)
    }
}

impl Shape {
    /// Bytes of shared memory of a pursuit with a referee: also two numbers in `f64` for each
    /// coefficient or unit.
    pub fn refereed_bytes(&self) -> usize {
        self.shared_bytes() + 8 * (self.capacity + self.units)
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

//! Distributes pursuits to workgroups and launches within the limits of a device.

use super::layout::{Shape, TOGETHER};
use super::referee::STEPS;
use crate::error::GpuError;
use crate::limits::{BUFFER_BYTES, DeviceLimits, GROUPS, ROUNDS, check};

/// Largest number of buffers that a kernel here uses.
const BUFFERS: usize = 7;

/// Number of atoms for each unit, if there are enough units; that many projections stay in
/// registers.
const PER_UNIT: usize = 4;

/// Fewest and most units of a workgroup: four planes of 16, and the number that every GPU has.
const UNITS: std::ops::RangeInclusive<usize> = 64..=256;

/// Largest number of frames at once: the number of workgroups that every device takes in one
/// direction.
const FRAMES: usize = GROUPS / TOGETHER * TOGETHER;

impl DeviceLimits {
    /// Distribution of `atoms` atoms to the units of a workgroup, with room for the weights of
    /// `sparsity` atoms.
    ///
    /// # Errors
    /// [`GpuError`] if the device has too few buffers, or too little shared memory.
    pub fn shape(&self, atoms: usize, sparsity: usize) -> Result<Shape, GpuError> {
        check("buffers of a kernel", BUFFERS, self.buffers)?;
        check("units of a workgroup", *UNITS.start(), self.units)?;
        let most = UNITS.end().min(&self.units);
        let most = 1 << most.ilog2();
        let units = atoms.div_ceil(PER_UNIT).next_power_of_two().clamp(*UNITS.start(), most);
        let per_unit = atoms.div_ceil(units).max(1);
        let capacity = sparsity.next_power_of_two();
        let shape = Shape { units, per_unit, capacity };
        check("bytes of shared memory", shape.shared_bytes(), self.shared_bytes)?;
        Ok(shape)
    }

    /// Number of frames that can be pursued together if the largest buffer has `numbers` numbers
    /// for each frame.
    ///
    /// # Errors
    /// [`GpuError`] if not even one frame fits.
    pub fn frames(&self, numbers: usize) -> Result<usize, GpuError> {
        self.fits("bytes of memory for a frame", numbers)?;
        let within = self.buffer_bytes.min(BUFFER_BYTES) / (4 * numbers.max(1));
        Ok(within.clamp(1, FRAMES))
    }
}

impl Shape {
    /// Splits the steps of a pursuit into launches `first..last`, none of which takes more than
    /// `rounds` rounds of loops. Step `k` takes `k` rounds over the rows and `k` over the units, to
    /// fetch the weights; with a referee, each step may need it. A launch starts with a pass over the atoms chosen before.
    ///
    /// # Errors
    /// [`GpuError`] if one step takes more rounds than allowed.
    pub fn launches(
        &self,
        sparsity: usize,
        rounds: usize,
        refereed: bool,
    ) -> Result<Vec<(usize, usize)>, GpuError> {
        let step = |k: usize| {
            let referee = if refereed { self.referee_rounds(k) } else { 0 };
            1 + k + k.div_ceil(self.units) + referee
        };
        let mut launches = Vec::new();
        let mut first = 0;
        while first < sparsity {
            let mut last = first;
            let mut used = first;
            while last < sparsity && used + step(last) <= rounds {
                used += step(last);
                last += 1;
            }
            if last == first {
                return check("rounds of loops", first + step(first), rounds).map(|()| launches);
            }
            launches.push((first, last));
            first = last;
        }
        Ok(launches)
    }
}

impl Shape {
    /// Number of rounds that the referee of step `k` takes at most: to substitute back, to refine
    /// [`STEPS`] times, and to score the rivals.
    fn referee_rounds(&self, k: usize) -> usize {
        let own = k.div_ceil(self.units);
        let substitution = k + k * own;
        let refinement = own * (k + 2) + 2 * substitution;
        2 * own + substitution + STEPS * refinement + self.per_unit * k
    }
}

/// Splits the rows of a product into launches `first..last`.
pub(super) fn row_launches(rows: usize) -> Vec<(usize, usize)> {
    (0..rows).step_by(ROUNDS).map(|first| (first, rows.min(first + ROUNDS))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn device(shared_bytes: usize) -> DeviceLimits {
        DeviceLimits { shared_bytes, buffer_bytes: 128 << 20, units: 1024, buffers: 8 }
    }

    #[test]
    fn every_atom_has_a_unit_and_shared_memory_bounds_the_support() {
        for atoms in [1, 63, 64, 65, 1000, 1024, 4096, 5000] {
            let shape = device(16 << 10).shape(atoms, 64).unwrap();
            assert!(shape.units * shape.per_unit >= atoms, "{atoms}: {shape:?}");
            assert!(shape.units.is_power_of_two() && UNITS.contains(&shape.units));
        }
        let most = |bytes| {
            (1..).take_while(|&k| device(bytes).shape(1024, 1 << k).is_ok()).last().map(|k| 1 << k)
        };
        assert_eq!((most(16 << 10), most(32 << 10)), (Some(2048), Some(4096)));
        let refused = device(16 << 10).shape(1024, 4096).unwrap_err();
        let expected = 4 * (3 * 256 + 4096 + 1);
        assert_eq!(
            refused,
            GpuError::TooLarge {
                what: "bytes of shared memory",
                needed: expected,
                limit: 16 << 10
            }
        );
    }

    #[test]
    fn no_launch_takes_more_rounds_than_software_vulkan_finishes() {
        for (sparsity, units) in [(0, 64), (1, 64), (64, 256), (346, 256), (347, 256), (2000, 64)] {
            let shape = Shape { units, per_unit: 4, capacity: 1 };
            let launches = shape.launches(sparsity, ROUNDS, false).unwrap();
            let mut next = 0;
            for &(first, last) in &launches {
                assert_eq!(first, next);
                let rounds: usize =
                    first + (first..last).map(|k| 1 + k + k.div_ceil(units)).sum::<usize>();
                assert!(rounds <= ROUNDS && last > first, "{rounds}");
                next = last;
            }
            assert_eq!(next, sparsity);
            assert_eq!(launches.len() > 1, sparsity > 345, "{sparsity}: {launches:?}");
        }
        let shape = Shape { units: 64, per_unit: 4, capacity: 1 };
        assert!(matches!(shape.launches(40_000, ROUNDS, false), Err(GpuError::TooLarge { .. })));
        let shape = Shape { units: 256, per_unit: 4, capacity: 64 };
        let with = shape.launches(64, ROUNDS, true).unwrap();
        assert!(with.len() < 4 && with.last().unwrap().1 == 64, "{with:?}");
        assert_eq!(row_launches(0), []);
        assert_eq!(row_launches(ROUNDS + 1), [(0, ROUNDS), (ROUNDS, ROUNDS + 1)]);
    }

    #[test]
    fn as_many_frames_at_once_as_a_buffer_holds() {
        let limits = device(16 << 10);
        assert_eq!(limits.frames(64 * 1024), Ok(512));
        assert_eq!(limits.frames(1), Ok(FRAMES));
        assert!(limits.frames(64 << 20).is_err());
    }
}

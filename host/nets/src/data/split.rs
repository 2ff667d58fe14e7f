//! Splits groups into those for training and those held out.
//!
//! # Invariant
//! Each group is whole on one of the two sides
//! (`tests::no_group_is_on_both_sides_and_no_image_is_lost`). Otherwise the bold style of a font
//! family, or a writer's second sheet, would be known from training when it is judged.

use super::{DataError, Purpose, Stack, stream};
use rand::seq::SliceRandom;
use serde::Serialize;
use std::collections::BTreeSet;

/// An image, given by its stack and its number there.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Place {
    /// Number of the stack.
    pub stack: usize,
    /// Number of the image in the stack.
    pub image: usize,
}

/// Images for training and images for judging.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Split {
    training: Vec<Place>,
    held_out: Vec<Place>,
    groups: Vec<HeldOutGroups>,
}

/// The held-out groups of one stack, for the record.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct HeldOutGroups {
    /// The stack's name.
    pub stack: String,
    /// Number of its images.
    pub images: usize,
    /// Number of its groups.
    pub groups: usize,
    /// Held-out groups, in ascending order.
    pub held_out: Vec<u32>,
}

impl Split {
    /// Holds out `share` of the groups of each stack, at least one, chosen by the seed. The choice
    /// depends on the seed, the stack's name and its groups, and not on other stacks or the order
    /// of images.
    ///
    /// # Errors
    /// [`DataError`] if a stack has only one group, there is no stack, or `share` is not above 0
    /// and below 1.
    pub fn new(stacks: &[Stack], share: f64, seed: u64) -> Result<Self, DataError> {
        if !(share > 0.0 && share < 1.0) {
            let expected = "more than 0 and less than 1";
            return Err(DataError::Share {
                name: "held-out share",
                found: share.to_string(),
                expected,
            });
        }
        if stacks.is_empty() {
            return Err(DataError::Empty);
        }
        let mut split = Self { training: Vec::new(), held_out: Vec::new(), groups: Vec::new() };
        for (at, stack) in stacks.iter().enumerate() {
            let all: BTreeSet<u32> = stack.groups().iter().copied().collect();
            if all.len() < 2 {
                return Err(DataError::OneGroup { name: stack.name().to_owned() });
            }
            let wanted = ((all.len() as f64 * share).round() as usize).clamp(1, all.len() - 1);
            let mut shuffled: Vec<u32> = all.iter().copied().collect();
            shuffled.shuffle(&mut stream(seed, Purpose::Split, name_hash(stack.name())));
            let held_out: BTreeSet<u32> = shuffled[..wanted].iter().copied().collect();
            for (image, group) in stack.groups().iter().enumerate() {
                let side = match held_out.contains(group) {
                    true => &mut split.held_out,
                    false => &mut split.training,
                };
                side.push(Place { stack: at, image });
            }
            split.groups.push(HeldOutGroups {
                stack: stack.name().to_owned(),
                images: stack.len(),
                groups: all.len(),
                held_out: held_out.into_iter().collect(),
            });
        }
        Ok(split)
    }

    /// Images for training, by stack and number.
    #[must_use]
    pub fn training(&self) -> &[Place] {
        &self.training
    }

    /// Images for judging.
    #[must_use]
    pub fn held_out(&self) -> &[Place] {
        &self.held_out
    }

    /// The held-out groups, for the record.
    #[must_use]
    pub fn groups(&self) -> &[HeldOutGroups] {
        &self.groups
    }
}

/// FNV-1a hash: the same on every machine and in every version.
fn name_hash(name: &str) -> u64 {
    name.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{AREA_PX, Kind};
    use proptest::prelude::*;

    fn stack(name: &str, groups: &[u32]) -> Stack {
        let levels = vec![0; groups.len() * AREA_PX];
        Stack::new(name, Kind::Drawn, levels, None, groups.to_vec()).unwrap()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn no_group_is_on_both_sides_and_no_image_is_lost(
            groups in prop::collection::vec(0u32..9, 2..60), share in 0.01..0.99, seed: u64
        ) {
            prop_assume!(groups.iter().any(|g| *g != groups[0]));
            let stacks = [stack("a", &groups), stack("b", &[1, 2, 3])];
            let split = Split::new(&stacks, share, seed).unwrap();
            let of = |places: &[Place]| -> BTreeSet<(usize, u32)> {
                places.iter().map(|p| (p.stack, stacks[p.stack].groups()[p.image])).collect()
            };
            prop_assert!(of(split.training()).is_disjoint(&of(split.held_out())));
            let mut all: Vec<Place> = [split.training(), split.held_out()].concat();
            all.sort_unstable();
            all.dedup();
            prop_assert_eq!(all.len(), groups.len() + 3);
            prop_assert!((0..2).all(|s| split.held_out().iter().any(|p| p.stack == s)));
            prop_assert!((0..2).all(|s| split.training().iter().any(|p| p.stack == s)));
        }
    }

    #[test]
    fn another_stack_beside_it_changes_nothing_for_a_stack() {
        let groups: Vec<u32> = (0..40).collect();
        let alone = Split::new(&[stack("a", &groups)], 0.2, 7).unwrap();
        let beside = Split::new(&[stack("b", &groups), stack("a", &groups)], 0.2, 7).unwrap();
        assert_eq!(alone.groups()[0], beside.groups()[1]);
        assert_ne!(beside.groups()[0].held_out, beside.groups()[1].held_out);
        assert_eq!(alone.groups()[0].held_out.len(), 8);
    }

    #[test]
    fn a_stack_of_one_group_cannot_be_split() {
        let error = Split::new(&[stack("fonts", &[3, 3])], 0.1, 1).unwrap_err();
        assert_eq!(error, DataError::OneGroup { name: "fonts".to_owned() });
        assert!(matches!(Split::new(&[], 0.1, 1), Err(DataError::Empty)));
        for share in [0.0, 1.0, f64::NAN] {
            let refused = Split::new(&[stack("a", &[1, 2])], share, 1);
            assert!(matches!(refused, Err(DataError::Share { .. })));
        }
    }
}

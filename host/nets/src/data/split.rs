//! Splits groups into those for training and those held out.
//!
//! # Invariant
//! Each group is whole on one of the two sides
//! (`tests::no_group_is_on_both_sides_and_no_image_is_lost`). Otherwise the bold style of a font
//! family, or a writer's second sheet, would be known from training when it is judged. Groups that
//! share an image are on the same side, so no held-out image is byte for byte one of training
//! (`tests::groups_that_share_an_image_are_on_the_same_side`).

use super::{DataError, Families, Purpose, Stack, stream};
use rand::seq::SliceRandom;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};

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
    /// Holds out `share` of the [families](Families) of each stack, at least one, chosen by the seed.
    /// The choice depends on the seed, the stack's name, its groups and its images, and not on the
    /// order of images, or on other stacks unless they share images with the stack: a family is held
    /// out in all stacks if it is held out in one.
    ///
    /// # Errors
    /// [`DataError`] if a stack has only one family, all families of a stack are held out through
    /// other stacks, there is no stack, or `share` is not above 0 and below 1.
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
        let families = Families::of(stacks);
        let mut held_families: BTreeSet<usize> = BTreeSet::new();
        for (at, stack) in stacks.iter().enumerate() {
            // A family is named by its smallest group, so that other stacks change nothing.
            let mut first: BTreeMap<usize, u32> = BTreeMap::new();
            for (&group, &family) in families.of_stack(at) {
                first.entry(family).or_insert(group);
            }
            if first.len() < 2 {
                return Err(DataError::OneGroup { name: stack.name().to_owned() });
            }
            let wanted = ((first.len() as f64 * share).round() as usize).clamp(1, first.len() - 1);
            let mut shuffled: Vec<(u32, usize)> =
                first.into_iter().map(|(family, group)| (group, family)).collect();
            shuffled.sort_unstable();
            shuffled.shuffle(&mut stream(seed, Purpose::Split, name_hash(stack.name())));
            held_families.extend(shuffled[..wanted].iter().map(|&(_, family)| family));
        }
        let mut split = Self { training: Vec::new(), held_out: Vec::new(), groups: Vec::new() };
        for (at, stack) in stacks.iter().enumerate() {
            let of = families.of_stack(at);
            let hidden = |family: &usize| held_families.contains(family);
            if of.values().all(hidden) {
                return Err(DataError::OneGroup { name: stack.name().to_owned() });
            }
            for (image, group) in stack.groups().iter().enumerate() {
                let side = match hidden(&of[group]) {
                    true => &mut split.held_out,
                    false => &mut split.training,
                };
                side.push(Place { stack: at, image });
            }
            let held_out = of.iter().filter(|(_, family)| hidden(family)).map(|(&group, _)| group);
            split.groups.push(HeldOutGroups {
                stack: stack.name().to_owned(),
                images: stack.len(),
                groups: of.len(),
                held_out: held_out.collect(),
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

    /// A stack whose images are all alike and blank, so that groups share no glyph.
    fn stack(name: &str, groups: &[u32]) -> Stack {
        let levels = vec![0; groups.len() * AREA_PX];
        Stack::new(name, Kind::Drawn, levels, None, groups.to_vec()).unwrap()
    }

    /// A stack of one image a group, group k with glyph `glyphs[k]`.
    fn of_glyphs(name: &str, glyphs: &[u8]) -> Stack {
        let image = |&glyph: &u8| {
            let mut image = vec![0; AREA_PX];
            image[usize::from(glyph)] = 255;
            image
        };
        let levels = glyphs.iter().flat_map(image).collect();
        Stack::new(name, Kind::Drawn, levels, None, (0..glyphs.len() as u32).collect()).unwrap()
    }

    #[test]
    fn groups_that_share_an_image_are_on_the_same_side() {
        // Each glyph is in two groups of a stack, and glyph 3 in both stacks.
        let stacks = [
            of_glyphs("a", &[1, 2, 3, 4, 5, 6, 1, 2, 3, 4, 5, 6]),
            of_glyphs("b", &[3, 20, 21, 22, 20, 21, 22]),
        ];
        for seed in 0..40 {
            let split = Split::new(&stacks, 0.3, seed).unwrap();
            let of = |places: &[Place]| -> BTreeSet<Vec<u8>> {
                places.iter().map(|p| stacks[p.stack].image(p.image).to_vec()).collect()
            };
            let (training, held_out) = (of(split.training()), of(split.held_out()));
            assert!(training.is_disjoint(&held_out), "seed {seed}");
            assert_eq!(split.training().len() + split.held_out().len(), 19);
        }
        let twice = [of_glyphs("a", &[1, 2]), of_glyphs("b", &[1, 1])];
        let refused = Split::new(&twice, 0.5, 1).unwrap_err();
        assert_eq!(refused, DataError::OneGroup { name: "b".to_owned() });
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

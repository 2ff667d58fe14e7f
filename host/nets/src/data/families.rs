//! Families: groups that share an image are one family, because a split of such groups shows in
//! training what is judged afterwards.
//!
//! Two font families of different names may share glyphs byte for byte: one is often a copy of the
//! other with another name. Images of one level everywhere are no glyphs and connect nothing.
//!
//! # Invariant
//! No image is in two families
//! (`tests::groups_that_share_an_image_are_one_family_also_across_stacks`).

use super::Stack;
use std::collections::{BTreeMap, BTreeSet, HashMap};

/// The families of the groups of some stacks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Families {
    /// The family of each group, stack by stack. A family has the number of its first group.
    of: Vec<BTreeMap<u32, usize>>,
}

impl Families {
    /// Joins the groups of these stacks that share an image, within a stack and across stacks.
    #[must_use]
    pub fn of(stacks: &[Stack]) -> Self {
        let mut numbers: Vec<BTreeMap<u32, usize>> = Vec::with_capacity(stacks.len());
        let mut parents: Vec<usize> = Vec::new();
        let mut first_with: HashMap<&[u8], usize> = HashMap::new();
        for stack in stacks {
            let groups: BTreeSet<u32> = stack.groups().iter().copied().collect();
            let first = parents.len();
            let own: BTreeMap<u32, usize> =
                groups.into_iter().enumerate().map(|(k, group)| (group, first + k)).collect();
            parents.extend(first..first + own.len());
            for (at, group) in stack.groups().iter().enumerate() {
                let image = stack.image(at);
                if image.iter().all(|&level| level == image[0]) {
                    continue;
                }
                let number = own[group];
                let other = *first_with.entry(image).or_insert(number);
                let [a, b] = [root(&parents, number), root(&parents, other)];
                parents[a.max(b)] = a.min(b);
            }
            numbers.push(own);
        }
        let family = |(group, number)| (group, root(&parents, number));
        Self { of: numbers.into_iter().map(|own| own.into_iter().map(family).collect()).collect() }
    }

    /// The family of each group of a stack.
    #[must_use]
    pub fn of_stack(&self, stack: usize) -> &BTreeMap<u32, usize> {
        &self.of[stack]
    }

    /// The groups of a stack that training has not seen: those in `held_out` whose whole family is
    /// held out. `None` for a stack that training does not know, of which all groups are held out.
    #[must_use]
    pub fn unseen(&self, held_out: &[Option<&[u32]>]) -> Vec<BTreeSet<u32>> {
        let hidden = |stack: usize, group: &u32| {
            held_out.get(stack).copied().flatten().is_none_or(|groups| groups.contains(group))
        };
        let each = || self.of.iter().enumerate();
        let seen: BTreeSet<usize> = each()
            .flat_map(|(stack, of)| of.iter().filter(move |(group, _)| !hidden(stack, group)))
            .map(|(_, &family)| family)
            .collect();
        let unseen = |of: &BTreeMap<u32, usize>| {
            of.iter()
                .filter(|(_, family)| !seen.contains(family))
                .map(|(&group, _)| group)
                .collect()
        };
        each().map(|(_, of)| unseen(of)).collect()
    }
}

/// The first group of a group's family.
fn root(parents: &[usize], mut number: usize) -> usize {
    while parents[number] != number {
        number = parents[number];
    }
    number
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{AREA_PX, Kind};

    /// A stack with an image for each pair: its group and the glyph that it shows.
    fn stack(name: &str, images: &[(u32, u8)]) -> Stack {
        let glyph = |&(_, glyph): &(u32, u8)| {
            let mut image = vec![0; AREA_PX];
            image[usize::from(glyph)] = glyph;
            image
        };
        let levels = images.iter().flat_map(glyph).collect();
        let groups = images.iter().map(|image| image.0).collect();
        Stack::new(name, Kind::Drawn, levels, None, groups).unwrap()
    }

    #[test]
    fn groups_that_share_an_image_are_one_family_also_across_stacks() {
        // 1 and 3 share glyph 7, 3 and 5 glyph 9, and group 2 of the other stack has glyph 8.
        let fonts = stack("fonts", &[(1, 7), (1, 8), (2, 6), (3, 7), (3, 9), (5, 9), (6, 10)]);
        let others = stack("others", &[(2, 8), (4, 11)]);
        let families = Families::of(&[fonts, others]);
        let of = families.of_stack(0);
        assert!(of[&1] == of[&3] && of[&3] == of[&5], "{of:?}");
        assert_eq!(families.of_stack(1)[&2], of[&1]);
        let distinct: BTreeSet<usize> =
            families.of.iter().flat_map(|of| of.values().copied()).collect();
        assert_eq!(distinct.len(), 4, "{families:?}");
    }

    #[test]
    fn a_blank_image_connects_nothing() {
        let fonts = stack("fonts", &[(1, 0), (2, 0), (1, 5), (2, 6)]);
        let families = Families::of(&[fonts]);
        assert_ne!(families.of_stack(0)[&1], families.of_stack(0)[&2]);
    }

    #[test]
    fn a_group_is_unseen_if_its_whole_family_is() {
        let fonts = stack("fonts", &[(1, 7), (2, 7), (3, 8), (4, 9)]);
        let others = stack("others", &[(1, 9), (2, 10)]);
        let families = Families::of(&[fonts, others]);
        // Training has seen group 2 of the fonts and all groups but 1, 3 and 4.
        let unseen = families.unseen(&[Some(&[1, 3]), None]);
        assert_eq!(unseen[0], BTreeSet::from([3]), "1 has a glyph of 2, and 4 was trained on");
        assert_eq!(unseen[1], BTreeSet::from([2]), "1 has a glyph of the fonts' 4");
    }
}

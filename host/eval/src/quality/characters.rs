//! The characters of all quality measurements.
//!
//! # Invariant
//! Every image belongs to a family, writer or photograph outside the training data
//! (`tests::only_groups_held_out_are_taken`), and none is byte for byte an image of the training
//! data under another family's name (`tests::no_held_out_image_is_one_of_training`).

use crate::characters;
use crate::error::{EvalError, On, Result};
use nirspi::files::read_small_text;
use nirspi_nets::HELD_OUT;
use nirspi_nets::data::{Families, Stack};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// The least number of images of a stack, because a distance of sets needs two.
const LEAST: usize = 2;

/// The origin of images.
#[derive(Debug, Clone, Serialize)]
pub struct Origin {
    /// The stack's name.
    pub stack: String,
    /// Number of images taken.
    pub images: usize,
    /// Number of font families, writers or photographs of the images, on which the intervals are
    /// based.
    pub groups: usize,
    /// `of 460 held out`, or why all were taken.
    pub choice: String,
}

/// One image.
#[derive(Debug, Clone)]
pub struct Character {
    /// 64 x 64 in [0, 1].
    pub sharp: Vec<f32>,
    /// The character in the image, if known.
    pub label: Option<u8>,
    /// Index of the image's origin.
    pub stack: usize,
    /// Font family, writer or photograph, as numbered in the stack.
    pub group: u32,
}

/// All images, stack after stack.
#[derive(Debug, Clone)]
pub struct Characters {
    all: Vec<Character>,
    origins: Vec<Origin>,
    notes: Vec<String>,
}

impl Characters {
    /// `count` images of each stack at `path`, chosen by the seed from the groups held out.
    ///
    /// # Errors
    /// [`EvalError`] for files that cannot be read, or if no image is left.
    pub fn read(path: &Path, held_out: Option<&Path>, count: usize, seed: u64) -> Result<Self> {
        let groups = match held_out {
            None => groups(HELD_OUT).on(|| "held_out.json of the embedded weights".to_owned())?,
            Some(file) => {
                let text = read_small_text(file);
                let text = text.on(|| format!("{}: cannot read it", file.display()))?;
                groups(&text).on_file(file)?
            }
        };
        let all = Self::of(&characters::read(path)?, &groups, count, seed);
        if all.all.is_empty() {
            let path = path.display();
            return Err(EvalError::Content(format!("{path}: no image that training has not seen")));
        }
        Ok(all)
    }

    /// `count` images of each stack, chosen by the seed from these groups of the stack. A stack
    /// that is not named is taken whole. Groups that share an image with a group that is not in the
    /// lists are left out with a note.
    #[must_use]
    pub fn of(
        stacks: &[Stack],
        groups: &BTreeMap<String, Vec<u32>>,
        count: usize,
        seed: u64,
    ) -> Self {
        Self::of_each(stacks, groups, &|_| count, seed)
    }

    /// As [`of`](Self::of), with a number of images that depends on the stack's name.
    #[must_use]
    pub fn of_each(
        stacks: &[Stack],
        groups: &BTreeMap<String, Vec<u32>>,
        count: &dyn Fn(&str) -> usize,
        seed: u64,
    ) -> Self {
        let mut all = Self { all: Vec::new(), origins: Vec::new(), notes: Vec::new() };
        let named: Vec<Option<&[u32]>> =
            stacks.iter().map(|stack| groups.get(stack.name()).map(Vec::as_slice)).collect();
        let unseen = Families::of(stacks).unseen(&named);
        for ((stack, named), unseen) in stacks.iter().zip(named).zip(unseen) {
            all.add(stack, named, &unseen, count(stack.name()), seed);
        }
        all
    }

    fn add(
        &mut self,
        stack: &Stack,
        named: Option<&[u32]>,
        unseen: &BTreeSet<u32>,
        count: usize,
        seed: u64,
    ) {
        let groups: BTreeSet<u32> = stack.groups().iter().copied().collect();
        let wanted = |group: &u32| named.is_none_or(|named| named.contains(group));
        let shared = groups.iter().filter(|g| wanted(g) && !unseen.contains(g)).count();
        if shared > 0 {
            let name = stack.name();
            self.notes
                .push(format!("{name}: {shared} groups share images with training: left out"));
        }
        let unseen = |at: &usize| unseen.contains(&stack.groups()[*at]);
        let mut places: Vec<usize> = (0..stack.len()).filter(unseen).collect();
        let choice = match named {
            Some(_) => format!("of {} held out", places.len()),
            None => format!("of {}: training is not said to have seen this stack", places.len()),
        };
        if places.len() < count {
            let name = stack.name();
            self.notes.push(format!("{name}: {} images, fewer than {count}", places.len()));
        }
        if places.len() < LEAST {
            self.notes.push(format!("{}: left out", stack.name()));
            return;
        }
        places.shuffle(&mut Pcg64Mcg::seed_from_u64(seed));
        places.truncate(count);
        let at = self.origins.len();
        self.all.extend(places.iter().map(|&place| Character {
            sharp: stack.image(place).iter().map(|&level| f32::from(level) / 255.0).collect(),
            label: stack.label(place),
            stack: at,
            group: stack.groups()[place],
        }));
        let (name, images) = (stack.name().to_owned(), places.len());
        let groups = self.groups_of(at);
        self.origins.push(Origin { stack: name, images, groups, choice });
    }

    /// Number of groups among the images of a stack.
    fn groups_of(&self, stack: usize) -> usize {
        let groups = self.all.iter().filter(|c| c.stack == stack).map(|c| c.group);
        groups.collect::<BTreeSet<u32>>().len()
    }

    /// The first `count` images of each stack.
    #[must_use]
    pub fn first(&self, count: usize) -> Self {
        let mut fewer = Self { all: Vec::new(), ..self.clone() };
        for (at, origin) in fewer.origins.iter_mut().enumerate() {
            let of_stack = self.all.iter().filter(|character| character.stack == at).take(count);
            let before = fewer.all.len();
            fewer.all.extend(of_stack.cloned());
            origin.images = fewer.all.len() - before;
        }
        for at in 0..fewer.origins.len() {
            fewer.origins[at].groups = fewer.groups_of(at);
        }
        fewer
    }

    /// Number of images.
    #[must_use]
    pub fn len(&self) -> usize {
        self.all.len()
    }

    /// Whether there is no image.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Iterates over the images.
    pub fn iter(&self) -> std::slice::Iter<'_, Character> {
        self.all.iter()
    }

    /// All pixels, (N, 64, 64).
    #[must_use]
    pub fn values(&self) -> Vec<f32> {
        self.all.iter().flat_map(|character| character.sharp.iter().copied()).collect()
    }

    /// The origins of the images.
    #[must_use]
    pub fn origins(&self) -> &[Origin] {
        &self.origins
    }

    /// Notes about stacks with fewer images than requested.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }
}

/// Groups of each stack, from JSON.
pub(crate) fn groups(text: &str) -> Result<BTreeMap<String, Vec<u32>>> {
    serde_json::from_str(text).on(|| "expected {\"stack\": [group, ...], ...}".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_nets::data::Kind;

    /// Six images of two writers each. The level of each image is its number, but for its first
    /// pixel, which is `marks`' level.
    fn stack_with(marks: [u8; 6]) -> Stack {
        let mut pixels: Vec<u8> = (0..6 * 64 * 64).map(|at| (at / 4096) as u8).collect();
        for (at, mark) in marks.into_iter().enumerate() {
            pixels[4096 * at..4096 * (at + 1)].fill(mark);
            pixels[4096 * at] = 200;
        }
        Stack::new("own", Kind::Drawn, pixels, Some((0..6).collect()), vec![1, 1, 2, 2, 3, 3])
            .unwrap()
    }

    fn of_stack(stack: Stack, groups: Option<&[u32]>, count: usize, seed: u64) -> Characters {
        let named = groups.map(|groups| ("own".to_owned(), groups.to_vec()));
        Characters::of(&[stack], &named.into_iter().collect(), count, seed)
    }

    fn of(groups: Option<&[u32]>, count: usize, seed: u64) -> Characters {
        of_stack(stack_with([0, 1, 2, 3, 4, 5]), groups, count, seed)
    }

    #[test]
    fn a_group_that_shares_an_image_with_training_is_left_out_with_a_note() {
        // The first image of writer 3, who is held out, is the second of writer 2, who is not.
        let taken = of_stack(stack_with([0, 1, 2, 3, 3, 5]), Some(&[1, 3]), 2, 1);
        assert!(taken.iter().all(|image| image.group == 1) && taken.len() == 2, "{taken:?}");
        assert_eq!(taken.notes(), ["own: 1 groups share images with training: left out"]);
    }

    #[test]
    fn no_held_out_image_is_one_of_training() {
        let Some(data) = std::env::var_os("NIRSPI_DATA") else {
            eprintln!("skipped: NIRSPI_DATA is not set, so there are no characters");
            return;
        };
        let stacks = characters::read(&Path::new(&data).join("chars74k")).unwrap();
        let held_out = groups(HELD_OUT).unwrap();
        let (mut training, mut judged) = (BTreeSet::new(), Vec::new());
        for stack in &stacks {
            for (at, group) in stack.groups().iter().enumerate() {
                match held_out[stack.name()].contains(group) {
                    true => judged.push((stack.name(), *group, stack.image(at))),
                    false => _ = training.insert(stack.image(at)),
                }
            }
        }
        let twins: Vec<(&str, u32)> = judged
            .iter()
            .filter(|(.., image)| training.contains(image))
            .map(|&(name, group, _)| (name, group))
            .collect();
        assert_eq!(twins, [], "images of held-out groups that are byte for byte in training");
        // The list leaves nothing to leave out: it is the one truth about the split.
        let taken = Characters::of(&stacks, &held_out, usize::MAX, 1);
        assert_eq!(taken.len(), judged.len());
        assert!(!taken.notes().iter().any(|note| note.contains("share")), "{:?}", taken.notes());
    }

    #[test]
    fn only_groups_held_out_are_taken() {
        for seed in 0..5 {
            let taken = of(Some(&[3, 1]), 3, seed);
            assert_eq!((taken.len(), taken.origins()[0].choice.as_str()), (3, "of 4 held out"));
            assert!(taken.iter().all(|c| ![2, 3].contains(&c.label.unwrap())), "{taken:?}");
            assert!(taken.iter().all(|c| [1, 3].contains(&c.group)), "{taken:?}");
            assert_eq!(taken.origins()[0].groups, 2);
        }
        assert_eq!(of(None, 6, 1).len(), 6);
    }

    #[test]
    fn a_choice_follows_from_its_seed_and_few_are_the_first_of_many() {
        let labels = |c: &Characters| c.iter().map(|c| c.label.unwrap()).collect::<Vec<u8>>();
        assert_eq!(labels(&of(None, 6, 7)), labels(&of(None, 6, 7)));
        let many = of(None, 6, 7);
        let few = many.first(2);
        assert_eq!(labels(&few), labels(&many)[..2]);
        assert_eq!(few.origins()[0].images, 2);
    }

    #[test]
    fn a_stack_with_too_few_images_is_left_out_with_a_note() {
        let none = of(Some(&[9]), 4, 1);
        assert!(none.is_empty() && none.origins().is_empty());
        assert_eq!(none.notes(), ["own: 0 images, fewer than 4", "own: left out"]);
    }
}

//! Characters and other shapes as one seeded source of scenes.

use super::augment::Augmentation;
use super::shapes::Shape;
use super::split::Place;
use super::{DataError, Split, Stack};
use rand::seq::IndexedRandom;
use rand::{Rng, RngExt};

/// The part of the groups from which scenes are drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// Groups for training.
    Training,
    /// Groups that training never uses.
    HeldOut,
}

/// The origin of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Origin {
    /// An image of a stack.
    Stack(Place),
    /// A procedural scene.
    Shape(Shape),
}

/// A sharp scene: the output that a network must learn.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// 64 x 64 values in `[0, 1]`, row-major.
    pub image: Vec<f32>,
    /// Class of the character, if the scene is a character of known class.
    pub label: Option<u8>,
    /// Where it comes from.
    pub origin: Origin,
}

/// The sources of scenes.
#[derive(Debug, Clone)]
pub struct Scenes {
    stacks: Vec<Stack>,
    split: Option<Split>,
    by_stack: [Vec<Vec<Place>>; 2],
    /// Augmentation of training images from stacks. Held-out images stay unchanged.
    pub augmentation: Augmentation,
    /// Share of the training scenes without letters.
    pub shapes: f32,
}

impl Scenes {
    /// Procedural scenes alone. They are unlimited and have no groups.
    #[must_use]
    pub fn procedural() -> Self {
        Self {
            stacks: Vec::new(),
            split: None,
            by_stack: [Vec::new(), Vec::new()],
            augmentation: Augmentation::default(),
            shapes: 1.0,
        }
    }

    /// Scenes from these stacks. Of each stack's groups, the share `held_out` is kept for
    /// [`Part::HeldOut`]; of the training scenes, the share `shapes` is procedural.
    ///
    /// # Errors
    /// [`DataError`] as from [`Split::new`], or if `shapes` is not in `[0, 1]`.
    pub fn new(
        stacks: Vec<Stack>,
        held_out: f64,
        shapes: f32,
        seed: u64,
    ) -> Result<Self, DataError> {
        if !(0.0..=1.0).contains(&shapes) {
            let (name, expected) = ("share of shapes", "0 to 1");
            return Err(DataError::Share { name, found: shapes.to_string(), expected });
        }
        let split = Split::new(&stacks, held_out, seed)?;
        let by_stack = [split.training(), split.held_out()].map(|places| {
            (0..stacks.len())
                .map(|at| places.iter().copied().filter(|place| place.stack == at).collect())
                .collect()
        });
        Ok(Self {
            stacks,
            split: Some(split),
            by_stack,
            augmentation: Augmentation::default(),
            shapes,
        })
    }

    /// The stacks.
    #[must_use]
    pub fn stacks(&self) -> &[Stack] {
        &self.stacks
    }

    /// The held-out groups; `None` for procedural scenes.
    #[must_use]
    pub fn split(&self) -> Option<&Split> {
        self.split.as_ref()
    }

    /// Draws a scene. Each stack is equally likely, whatever its number of images, so handwriting
    /// counts as much as type.
    #[must_use]
    pub fn draw(&self, part: Part, rng: &mut impl Rng) -> Scene {
        let places = &self.by_stack[part as usize];
        let shape = part == Part::Training && rng.random::<f32>() < self.shapes;
        let place =
            if shape { None } else { places.choose(rng).and_then(|stack| stack.choose(rng)) };
        let Some(&place) = place else {
            let shape = Shape::ALL[rng.random_range(0..Shape::ALL.len())];
            return Scene { image: shape.draw(rng), label: None, origin: Origin::Shape(shape) };
        };
        let stack = &self.stacks[place.stack];
        let levels = stack.image(place.image);
        let image = match part {
            Part::Training => self.augmentation.view(levels, stack.kind(), rng),
            Part::HeldOut => levels.iter().map(|&level| f32::from(level) / 255.0).collect(),
        };
        Scene { image, label: stack.label(place.image), origin: Origin::Stack(place) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::{AREA_PX, Kind, Purpose, stream};

    fn stack(name: &str, images: usize) -> Stack {
        let groups = (0..images as u32).collect();
        Stack::new(name, Kind::Drawn, vec![9; images * AREA_PX], None, groups).unwrap()
    }

    #[test]
    fn training_draws_from_no_held_out_image_and_the_other_way_round() {
        let scenes = Scenes::new(vec![stack("a", 20), stack("b", 4)], 0.25, 0.2, 5).unwrap();
        let split = scenes.split().unwrap();
        for index in 0..200 {
            for (part, theirs) in
                [(Part::Training, split.held_out()), (Part::HeldOut, split.training())]
            {
                let scene = scenes.draw(part, &mut stream(1, Purpose::Training, index));
                if let Origin::Stack(place) = scene.origin {
                    assert!(!theirs.contains(&place), "{part:?} drew {place:?}");
                }
            }
        }
    }

    #[test]
    fn small_stacks_are_drawn_as_often_as_large_ones() {
        let scenes = Scenes::new(vec![stack("a", 200), stack("b", 4)], 0.25, 0.0, 5).unwrap();
        let of_b = (0..400)
            .filter(|&index| {
                let scene = scenes.draw(Part::Training, &mut stream(1, Purpose::Training, index));
                matches!(scene.origin, Origin::Stack(Place { stack: 1, .. }))
            })
            .count();
        assert!((150..250).contains(&of_b), "{of_b} of 400");
    }
}

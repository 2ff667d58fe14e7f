//! What to train on: characters of a user's, and the part of them that training never sees.

use crate::error::{On, Result};
use nirspi::files::characters;
use nirspi::training::fonts;
use nirspi_nets::data::{Scenes, Stack};
use serde::Serialize;
use std::path::PathBuf;

/// Which characters.
#[derive(Debug, Clone, PartialEq)]
pub struct Data {
    /// `.npz` stacks, folders of them, or Chars74K's folder. Without any stack and font: procedural scenes alone.
    pub stacks: Vec<PathBuf>,
    /// Folders of fonts, from which characters are drawn.
    pub fonts: Vec<PathBuf>,
    /// Share of the font families, writers and photographs that training never sees.
    pub held_out: f64,
    /// Share of the scenes that are no letters.
    pub shapes: f32,
}

/// What was found, for the record.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Found {
    /// Of each stack.
    pub stacks: Vec<nirspi_nets::data::split::HeldOutGroups>,
    /// Images to train on.
    pub training_images: usize,
    /// Images that training never sees.
    pub held_out_images: usize,
    /// Fonts that were left out.
    pub skipped_fonts: Vec<PathBuf>,
}

impl Data {
    /// Reads them; the split follows from the seed.
    ///
    /// # Errors
    /// Files that cannot be read, characters that cannot be split.
    pub fn scenes(&self, seed: u64) -> Result<(Scenes, Found)> {
        let mut stacks: Vec<Stack> = Vec::new();
        let mut skipped_fonts = Vec::new();
        for path in &self.stacks {
            stacks.extend(characters::read(path)?);
        }
        for folder in &self.fonts {
            let rendered = fonts::render(folder)?;
            stacks.push(rendered.stack);
            skipped_fonts.extend(rendered.skipped);
        }
        let scenes = if stacks.is_empty() {
            Scenes::procedural()
        } else {
            Scenes::new(stacks, self.held_out, self.shapes, seed)
                .on(|| "training data".to_owned())?
        };
        let split = scenes.split();
        let found = Found {
            stacks: split.map_or_else(Vec::new, |split| split.groups().to_vec()),
            training_images: split.map_or(0, |split| split.training().len()),
            held_out_images: split.map_or(0, |split| split.held_out().len()),
            skipped_fonts,
        };
        Ok((scenes, found))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_files_scenes_are_procedural() {
        let data = Data { stacks: Vec::new(), fonts: Vec::new(), held_out: 0.1, shapes: 0.15 };
        let (scenes, found) = data.scenes(1).unwrap();
        assert!(scenes.split().is_none());
        assert_eq!((found.training_images, found.held_out_images, found.stacks.len()), (0, 0, 0));
        let gone = Data { stacks: vec!["none.npz".into()], ..data };
        let told = gone.scenes(1).err().unwrap().to_string();
        assert!(told.starts_with("none.npz: cannot read it"), "{told}");
    }
}

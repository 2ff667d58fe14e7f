//! Training data: a user's characters, and their split into training and held-out groups.

use crate::error::{On, Result};
use nirspi::files::characters;
use nirspi::training::fonts;
use nirspi_nets::data::{Scenes, Stack};
use serde::Serialize;
use std::path::PathBuf;

/// The choice of characters.
#[derive(Debug, Clone, PartialEq)]
pub struct Data {
    /// `.npz` stacks, folders of stacks, or Chars74K's folder. Without stacks and fonts, only
    /// procedural scenes.
    pub stacks: Vec<PathBuf>,
    /// Folders of fonts, from which characters are drawn.
    pub fonts: Vec<PathBuf>,
    /// Share of the font families, writers and photographs that are held out from training.
    pub held_out: f64,
    /// Share of the scenes other than letters.
    pub shapes: f32,
}

/// The data that were found, for the record.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Found {
    /// The data of each stack.
    pub stacks: Vec<nirspi_nets::data::split::HeldOutGroups>,
    /// Number of images for training.
    pub training_images: usize,
    /// Number of images held out from training.
    pub held_out_images: usize,
    /// Fonts that were left out.
    pub skipped_fonts: Vec<PathBuf>,
}

impl Data {
    /// Reads the data. The split follows from the seed.
    ///
    /// # Errors
    /// `EvalError` for files that cannot be read, or characters that cannot be split.
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

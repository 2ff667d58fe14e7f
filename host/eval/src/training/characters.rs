//! The characters of which pairs are made: a user's files and fonts, split into groups for training
//! and groups that are held out.

use super::fonts;
use crate::characters;
use nirspi::files::output::OutputDir;
use nirspi::files::{FileError, archive, npy};
use nirspi_nets::data::split::HeldOutGroups;
use nirspi_nets::data::{AREA_PX, DataError, SIDE_PX, Scenes, Stack};
use serde::Serialize;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// The choice of characters.
#[derive(Debug, Clone, PartialEq)]
pub struct Characters {
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

/// The characters that were found, for the record.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Found {
    /// The groups of each stack.
    pub stacks: Vec<HeldOutGroups>,
    /// Number of images for training.
    pub training_images: usize,
    /// Number of images held out from training.
    pub held_out_images: usize,
    /// Fonts that were left out.
    pub skipped_fonts: Vec<PathBuf>,
}

/// Why there are no characters. `Display` is one line.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum CharactersError {
    /// A file or a folder cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// The characters cannot be split.
    #[error("characters: {0}")]
    Split(#[from] DataError),
}

impl Characters {
    /// Reads the characters. The split follows from the seed.
    ///
    /// # Errors
    /// [`CharactersError`] for files that cannot be read, or characters that cannot be split.
    pub fn scenes(&self, seed: u64) -> Result<(Scenes, Found), CharactersError> {
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
            Scenes::new(stacks, self.held_out, self.shapes, seed)?
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

/// Writes the stacks of `scenes` to a new folder, a `.npz` file each, for the Python trainer's
/// `--data`. The names begin with the stacks' numbers, so a folder keeps the stacks' order, to which
/// pairs refer.
///
/// # Errors
/// [`FileError`] for a folder that exists, or a file that cannot be written.
pub fn write_stacks(folder: &Path, scenes: &Scenes) -> Result<(), FileError> {
    if folder.exists() {
        let (path, expected) = (folder.to_owned(), "the name of a new folder");
        return Err(FileError::Exists { path, expected });
    }
    let mut out = OutputDir::create(folder)?;
    for (number, stack) in scenes.stacks().iter().enumerate() {
        let name = format!("{number:03}-{}.npz", stack.name());
        out.write(&name, &encode(&folder.join(&name), stack)?)?;
    }
    out.commit()?;
    Ok(())
}

/// The bytes of a `.npz` file with the images, groups and, if there are any, classes of a stack.
fn encode(path: &Path, stack: &Stack) -> Result<Vec<u8>, FileError> {
    let count = stack.len();
    let levels: Vec<u8> = (0..count).flat_map(|at| stack.image(at).iter().copied()).collect();
    debug_assert_eq!(levels.len(), count * AREA_PX);
    let groups: Vec<i64> = stack.groups().iter().map(|&group| group.into()).collect();
    let labels: Option<Vec<i64>> = (0..count).map(|at| stack.label(at).map(i64::from)).collect();
    let mut members = vec![
        ("x", npy::encode(&[count, SIDE_PX, SIDE_PX], &levels)),
        ("group", npy::encode(&[count], &groups)),
    ];
    members.extend(labels.map(|labels| ("label", npy::encode(&[count], &labels))));
    archive::encode(path, &members)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_nets::data::Kind;

    fn none() -> Characters {
        Characters { stacks: Vec::new(), fonts: Vec::new(), held_out: 0.1, shapes: 0.15 }
    }

    #[test]
    fn without_files_scenes_are_procedural() {
        let (scenes, found) = none().scenes(1).unwrap();
        assert!(scenes.split().is_none());
        assert_eq!((found.training_images, found.held_out_images, found.stacks.len()), (0, 0, 0));
        let gone = Characters { stacks: vec!["none.npz".into()], ..none() };
        let told = gone.scenes(1).err().unwrap().to_string();
        assert!(told.starts_with("none.npz: cannot read it"), "{told}");
    }

    #[test]
    fn stacks_that_were_written_are_read_again_in_their_order() {
        let stack = |name: &str, first: u8, labels| {
            let levels = (0..3 * AREA_PX).map(|at| (at / AREA_PX) as u8 * 7 + first).collect();
            Stack::new(name, Kind::Drawn, levels, labels, vec![4, 2, 9]).unwrap()
        };
        // By their names alone, "a" would come first.
        let stacks = vec![stack("b", 1, Some(vec![61, 0, 10])), stack("a", 2, None)];
        let scenes = Scenes::new(stacks.clone(), 0.3, 0.0, 1).unwrap();
        let temporary = tempfile::tempdir().unwrap();
        let folder = temporary.path().join("letters");
        write_stacks(&folder, &scenes).unwrap();
        let read = characters::read(&folder).unwrap();
        let names: Vec<&str> = read.iter().map(Stack::name).collect();
        assert_eq!(names, ["000-b", "001-a"]);
        for (read, written) in read.iter().zip(&stacks) {
            assert_eq!((read.groups(), read.len()), (written.groups(), 3));
            for at in 0..3 {
                assert_eq!(
                    (read.image(at), read.label(at)),
                    (written.image(at), written.label(at))
                );
            }
        }
        assert!(write_stacks(&folder, &scenes).is_err());
    }
}

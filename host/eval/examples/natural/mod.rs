//! The natural scenes of `natural/bsds_train.npz`, which several examples read.

use nirspi::files::archive::Archive;
use std::error::Error;
use std::path::{Path, PathBuf};

/// Natural scenes of one size.
pub struct Scenes {
    /// Rows of a scene.
    pub height: usize,
    /// Columns of a scene.
    pub width: usize,
    /// 8-bit pixels, scene after scene, row-major.
    levels: Vec<u8>,
}

impl Scenes {
    /// The file of the scenes in the folder of data.
    pub fn file(data: &Path) -> PathBuf {
        data.join("natural/bsds_train.npz")
    }

    /// Reads the scenes from the folder of data.
    pub fn read(data: &Path) -> Result<Self, Box<dyn Error>> {
        let mut archive = Archive::open(&Self::file(data))?;
        let x = archive.numbers_of::<f32>("x", |shape| match shape {
            [_, _, _] => Ok(()),
            _ => Err("(N, height, width)".to_owned()),
        })?;
        let levels = x.values.into_iter().map(|level| level as u8).collect();
        Ok(Self { height: x.shape[1], width: x.shape[2], levels })
    }

    /// The pixels of each scene.
    pub fn iter(&self) -> impl Iterator<Item = &[u8]> {
        self.levels.chunks_exact(self.height * self.width)
    }
}

//! The natural scenes of `natural/bsds_train.npz`, which several examples read.

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
        let file = Self::file(data);
        let wrong = |what: String| format!("{}: {what}", file.display());
        let open = std::fs::File::open(&file).map_err(|error| wrong(error.to_string()))?;
        let mut archive = zip::ZipArchive::new(std::io::BufReader::new(open))?;
        let member = npyz::NpyFile::new(archive.by_name("x.npy")?)?;
        let &[_, height, width] = member.shape() else {
            let found = member.shape();
            return Err(wrong(format!("x has shape {found:?}, expected (N, height, width)")).into());
        };
        let (height, width) = (height as usize, width as usize);
        Ok(Self { height, width, levels: member.into_vec()? })
    }

    /// The pixels of each scene.
    pub fn iter(&self) -> impl Iterator<Item = &[u8]> {
        self.levels.chunks_exact(self.height * self.width)
    }
}

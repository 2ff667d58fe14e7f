//! Images in and images out, as arrays or as pictures: `.npy`, PNG or JPEG, or a folder of these.
//!
//! The law: what goes into a network is of the right size and in [0, 1], or one line says what is not; where the
//! results go is checked before anything is computed.

use anyhow::{Context, Result, bail};
use nirspi::files::image::{Grey, encode_grey, read_grey};
use nirspi::files::npy;
use nirspi::files::output::{OutputDir, write_atomic};
use nirspi_nets::Images;
use std::fs;
use std::path::{Path, PathBuf};

/// Images of one size.
pub struct Input {
    path: PathBuf,
    count: usize,
    height: usize,
    width: usize,
    values: Vec<f32>,
    form: Form,
}

/// How the images came, which is how results go.
enum Form {
    Array {
        is_single: bool,
    },
    /// Names of the files.
    Pictures(Vec<String>),
}

impl Input {
    /// Reads a `.npy` array, a picture or a folder of pictures, which are brought to a side if one is given.
    pub fn read(path: &Path, resize: Option<u32>) -> Result<Self> {
        if path.is_dir() {
            return Self::folder(path, resize);
        }
        if is_picture(path) {
            let picture = read_picture(path, resize)?;
            return Ok(Self {
                path: path.to_owned(),
                count: 1,
                height: picture.height as usize,
                width: picture.width as usize,
                values: picture.values,
                form: Form::Pictures(vec![file_name(path)]),
            });
        }
        let npy::Pictures { is_single, stack } = npy::read_pictures(path)?;
        let npy::Stack { count, height, width, values } = stack;
        let form = Form::Array { is_single };
        Ok(Self { path: path.to_owned(), count, height, width, values, form })
    }

    fn folder(path: &Path, resize: Option<u32>) -> Result<Self> {
        let entries = fs::read_dir(path).with_context(|| path.display().to_string())?;
        let mut files = Vec::new();
        for entry in entries {
            let file = entry.with_context(|| path.display().to_string())?.path();
            if is_picture(&file) {
                files.push(file);
            }
        }
        files.sort();
        let Some(first) = files.first() else {
            bail!("{}: no .png or .jpg files in it", path.display());
        };
        let (mut size, mut values) = (None, Vec::new());
        for file in &files {
            let picture = read_picture(file, resize)?;
            let found = (picture.height as usize, picture.width as usize);
            let expected = *size.get_or_insert(found);
            if found != expected {
                bail!(
                    "{}: {} x {} pixels, expected {} x {} as {} has",
                    file.display(),
                    found.0,
                    found.1,
                    expected.0,
                    expected.1,
                    first.display()
                );
            }
            values.extend(picture.values);
        }
        let (height, width) = size.unwrap_or_default();
        let names: Vec<String> = files.iter().map(|file| file_name(file)).collect();
        // Sorted by path: equal names are neighbours.
        if let Some(twice) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            bail!("{}: two pictures whose result would be {}", path.display(), twice[0]);
        }
        let form = Form::Pictures(names);
        Ok(Self { path: path.to_owned(), count: files.len(), height, width, values, form })
    }

    /// How many.
    pub fn count(&self) -> usize {
        self.count
    }

    /// The images, of this size and in [0, 1].
    pub fn images<const SIDE: usize>(&self) -> Result<Images<'_, SIDE>> {
        if (self.height, self.width) != (SIDE, SIDE) {
            bail!(
                "{}: images of {} x {} pixels, expected {SIDE} x {SIDE}; --resize brings pictures to that",
                self.path.display(),
                self.height,
                self.width
            );
        }
        Images::new(&self.values).with_context(|| self.path.display().to_string())
    }

    /// Where results of these images go: an array for `.npy`, one picture for `.png`, else a folder of
    /// pictures.
    pub fn target(&self, out: &Path) -> Result<Target> {
        let shape = match self.form {
            Form::Array { is_single: true } => None,
            Form::Array { is_single: false } | Form::Pictures(_) => Some(self.count),
        };
        let kind = if has_extension(out, "npy") {
            Kind::Array(shape)
        } else if has_extension(out, "png") {
            if self.count != 1 {
                bail!(
                    "--out {}: one picture for {} images, expected a .npy file or a folder",
                    out.display(),
                    self.count
                );
            }
            Kind::Picture
        } else {
            let names = match &self.form {
                Form::Pictures(names) => names.clone(),
                Form::Array { .. } => (0..self.count).map(|i| format!("{i:05}.png")).collect(),
            };
            Kind::Folder(names)
        };
        Ok(Target { path: out.to_owned(), kind })
    }
}

/// Where results go.
pub struct Target {
    path: PathBuf,
    kind: Kind,
}

enum Kind {
    /// Of a stack of so many, or of one image alone.
    Array(Option<usize>),
    Picture,
    Folder(Vec<String>),
}

impl Target {
    /// Writes images of `side` x `side` in [0, 1].
    pub fn write(&self, side: usize, values: &[f32]) -> Result<()> {
        match &self.kind {
            Kind::Array(Some(count)) => {
                write_atomic(&self.path, &npy::encode(&[*count, side, side], values))?;
            }
            Kind::Array(None) => write_atomic(&self.path, &npy::encode(&[side, side], values))?,
            Kind::Picture => write_atomic(&self.path, &encode_grey(side, side, values))?,
            Kind::Folder(names) => {
                let mut folder = OutputDir::create(&self.path)?;
                for (name, image) in names.iter().zip(values.chunks_exact(side * side)) {
                    folder.write(name, &encode_grey(side, side, image))?;
                }
                folder.commit()?;
            }
        }
        Ok(())
    }
}

fn is_picture(path: &Path) -> bool {
    ["png", "jpg", "jpeg"].iter().any(|extension| has_extension(path, extension))
}

fn read_picture(path: &Path, resize: Option<u32>) -> Result<Grey> {
    let picture = read_grey(path)?;
    Ok(match resize {
        None => picture,
        Some(side) => picture.resized(side),
    })
}

fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|found| found.eq_ignore_ascii_case(extension))
}

/// The name of a picture's result, which is a PNG.
fn file_name(path: &Path) -> String {
    path.with_extension("png")
        .file_name()
        .map(|name| name.to_string_lossy().into_owned())
        .unwrap_or_default()
}

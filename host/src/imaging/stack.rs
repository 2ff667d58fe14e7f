//! Reads and writes stacks of images as arrays or as pictures: `.npy`, PNG or JPEG, or a folder of
//! these.
//!
//! # Invariant
//! The path of the results is checked before anything is computed: [`ImageStack::target`] fails
//! first (`host/cli/tests/cli/enhance.rs`).

use crate::files::FileError;
use crate::files::image::{
    FOR_PEOPLE, Grey, encode_grey, is_picture, pictures_in, provenance_of, read_grey, read_grey_if,
};
use crate::files::npy;
use crate::files::output::{Existing, OutputDir, write_result};
use crate::picture::{FigureStyle, Panel, Pictures, Sheet, SideBySide, Unit};
use crate::provenance::{Provenance, Taken};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why images cannot be read together, or cannot be written to a path. `Display` is one line.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StackError {
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The folder holds no pictures.
    #[error("{}: no .png or .jpg files in it", .0.display())]
    Empty(PathBuf),
    /// The results of two pictures of a folder would have the same name.
    #[error("{}: two pictures whose result would be {name}", folder.display())]
    Twice {
        /// The folder.
        folder: PathBuf,
        /// The common name.
        name: String,
    },
    /// The images do not have the size that is needed.
    #[error(
        "{}: images of {height} x {width} pixels, expected {side} x {side}; --resize brings pictures to that",
        path.display()
    )]
    Size {
        /// The path of the images.
        path: PathBuf,
        /// Rows.
        height: usize,
        /// Columns.
        width: usize,
        /// The number of rows and of columns needed.
        side: usize,
    },
    /// The results of several images cannot be one picture.
    #[error("--out {}: one picture for {count} images, expected a .npy file or a folder", path.display())]
    OnePicture {
        /// The path of the results.
        path: PathBuf,
        /// The number of images.
        count: usize,
    },
}

/// So far, in shares of white, noise takes values below black and above white.
const NOISE: f32 = 0.5;

type Result<T> = std::result::Result<T, StackError>;

/// Images of one size.
#[derive(Debug)]
pub struct ImageStack {
    path: PathBuf,
    count: usize,
    height: usize,
    width: usize,
    values: Vec<f32>,
    form: Form,
}

/// The form of the images; results have the same form.
#[derive(Debug)]
enum Form {
    Array {
        is_single: bool,
    },
    /// Pictures, with the names of the files.
    Pictures(Vec<String>),
}

impl ImageStack {
    /// Reads a `.npy` array, a picture or a folder of pictures, for a command that needs `side` x `side` pixels. With
    /// `resize`, pictures are resized to that.
    ///
    /// # Errors
    /// [`StackError`] for a file that cannot be read, or for pictures of another size.
    pub fn read(path: &Path, side: u32, resize: bool) -> Result<Self> {
        if path.is_dir() {
            return Self::folder(path, side, resize);
        }
        if is_picture(path) {
            let picture = read_picture(path, side, resize)?;
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

    fn folder(path: &Path, side: u32, resize: bool) -> Result<Self> {
        let files = pictures_in(path)?;
        if files.is_empty() {
            return Err(StackError::Empty(path.to_owned()));
        }
        let mut values = Vec::new();
        for file in &files {
            values.extend(read_picture(file, side, resize)?.values);
        }
        let (height, width) = (side as usize, side as usize);
        let names: Vec<String> = files.iter().map(|file| file_name(file)).collect();
        // The names are sorted by path, so equal names are adjacent.
        if let Some(twice) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            let (folder, name) = (path.to_owned(), twice[0].clone());
            return Err(StackError::Twice { folder, name });
        }
        let form = Form::Pictures(names);
        Ok(Self { path: path.to_owned(), count: files.len(), height, width, values, form })
    }

    /// Cuts values that noise has taken out of `[0, 1]` to 0 or 1, as images in shares of white have
    /// them. Returns the number of values cut. If a value is off by 0.5 or more, the images
    /// have another scale: they stay as they are.
    pub fn cut_noise(&mut self) -> usize {
        let is_near = |value: &f32| *value > -NOISE && *value < 1.0 + NOISE;
        if !self.values.iter().all(is_near) {
            return 0;
        }
        let mut cut = 0;
        for value in self.values.iter_mut().filter(|value| !(0.0..=1.0).contains(*value)) {
            *value = value.clamp(0.0, 1.0);
            cut += 1;
        }
        cut
    }

    /// The number of images.
    #[must_use]
    pub fn count(&self) -> usize {
        self.count
    }

    /// The path of the images.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Where the images come from: what a picture of this program says of itself, and else an unknown
    /// camera. Several pictures are of one origin only if all say the same.
    ///
    /// # Errors
    /// [`StackError::File`] if a picture states a damaged provenance.
    pub fn taken(&self) -> Result<Taken> {
        let unknown = Taken::of_file(&self.path, None);
        let Form::Pictures(_) = &self.form else { return Ok(unknown) };
        let files = match self.path.is_dir() {
            true => pictures_in(&self.path)?,
            false => vec![self.path.clone()],
        };
        let mut all = Vec::with_capacity(files.len());
        for file in files.iter().filter(|file| has_extension(file, "png")) {
            all.push(provenance_of(file)?.map(|found| found.taken));
        }
        Ok(match all.first().cloned().flatten() {
            Some(first) if all.len() == files.len() => {
                match all.iter().all(|taken| taken.as_ref() == Some(&first)) {
                    true => first,
                    false => unknown,
                }
            }
            _ => unknown,
        })
    }

    /// The values of the images, row-major, one after another.
    ///
    /// # Errors
    /// [`StackError::Size`] for images of another size than `side` x `side`.
    pub fn values(&self, side: usize) -> Result<&[f32]> {
        let Self { height, width, .. } = *self;
        match (height, width) == (side, side) {
            true => Ok(&self.values),
            false => Err(StackError::Size { path: self.path.clone(), height, width, side }),
        }
    }

    /// The form of the results: an array for `.npy`, one picture for `.png`, else a folder of
    /// pictures. With `overwrite`, a file that is there is replaced, but none of the images.
    ///
    /// # Errors
    /// [`StackError::OnePicture`] for one picture and several images; [`StackError::File`] if a
    /// result has the name of a file that stays.
    pub fn target(&self, out: &Path, overwrite: bool) -> Result<StackTarget> {
        let shape = match self.form {
            Form::Array { is_single: true } => None,
            Form::Array { is_single: false } | Form::Pictures(_) => Some(self.count),
        };
        let kind = if has_extension(out, "npy") {
            Kind::Array(shape)
        } else if has_extension(out, "png") {
            if self.count != 1 {
                let (path, count) = (out.to_owned(), self.count);
                return Err(StackError::OnePicture { path, count });
            }
            Kind::Picture
        } else {
            let names = match &self.form {
                Form::Pictures(names) => names.clone(),
                Form::Array { .. } => (0..self.count).map(|i| format!("{i:05}.png")).collect(),
            };
            Kind::Folder(names)
        };
        let input = match self.count == 1 && self.height == self.width {
            true => Shown::Single(Panel::square("input", self.width, &self.values, Unit::OfWhite)),
            false => Shown::Many,
        };
        let (path, source) = (out.to_owned(), self.path.clone());
        let target =
            StackTarget { path, kind, input, source, overwrite, figure: FigureStyle::Paper };
        match &target.kind {
            Kind::Folder(names) => {
                OutputDir::create(out)?.check(names.iter().map(String::as_str))?;
            }
            Kind::Array(_) | Kind::Picture => target.existing().check(out)?,
        }
        Ok(target)
    }
}

/// Where and in which form results are written.
#[derive(Debug)]
pub struct StackTarget {
    path: PathBuf,
    kind: Kind,
    input: Shown,
    /// Where the images are that the results are made of.
    source: PathBuf,
    overwrite: bool,
    /// What the picture beside the results is made for.
    figure: FigureStyle,
}

/// What a picture shows beside the results: the image itself, if there is one.
#[derive(Debug)]
enum Shown {
    Single(Panel),
    Many,
}

#[derive(Debug)]
enum Kind {
    /// An array of a stack of this many images, or of one image without the first axis.
    Array(Option<usize>),
    Picture,
    Folder(Vec<String>),
}

impl StackTarget {
    fn existing(&self) -> Existing<'_> {
        Existing::of(self.overwrite, Some(&self.source))
    }

    /// The same target, with a picture beside it that is made for something else.
    #[must_use]
    pub fn with_figure(self, figure: FigureStyle) -> Self {
        Self { figure, ..self }
    }

    /// Writes images of `side` x `side` with values in [0, 1].
    ///
    /// # Errors
    /// [`StackError::File`] if the images cannot be written.
    pub fn write(&self, side: usize, values: &[f32], provenance: &Provenance) -> Result<()> {
        let write = |bytes: &[u8]| write_result(&self.path, self.existing(), bytes);
        match &self.kind {
            Kind::Array(Some(count)) => write(&npy::encode(&[*count, side, side], values))?,
            Kind::Array(None) => write(&npy::encode(&[side, side], values))?,
            Kind::Picture => write(&encode_grey(side, side, values, provenance))?,
            Kind::Folder(names) => {
                let mut folder = OutputDir::create(&self.path)?;
                for (name, image) in names.iter().zip(values.chunks_exact(side * side)) {
                    folder.write(name, &encode_grey(side, side, image, provenance))?;
                }
                folder.commit()?;
            }
        }
        Ok(())
    }

    /// Writes the images, and beside them a picture for people: input and result side by side, or a
    /// contact sheet of the results. `title` names the results.
    ///
    /// # Errors
    /// [`StackError::File`] if the images or the picture cannot be written.
    pub fn write_and_show(
        &self,
        side: usize,
        values: &[f32],
        title: &str,
        provenance: &Provenance,
    ) -> Result<Pictures> {
        let name = match self.kind {
            Kind::Folder(_) => self.path.file_name(),
            Kind::Array(_) | Kind::Picture => self.path.file_stem(),
        };
        let name = name.map_or_else(|| "images".into(), |name| name.to_string_lossy());
        let file = self.path.with_file_name(format!("{name}{FOR_PEOPLE}"));
        let mut pictures = Pictures::new(self.figure, provenance);
        let named = file.display().to_string();
        for ending in ["png", "svg", "pdf"] {
            self.existing().check(&file.with_extension(ending))?;
        }
        self.write(side, values, provenance)?;
        match &self.input {
            Shown::Single(input) => {
                let result = Panel::square(title, side, values, Unit::OfWhite);
                let panels = vec![input.clone(), result];
                let (header, footer) = (String::new(), String::new());
                pictures.add(&named, SideBySide { header, panels, footer });
            }
            Shown::Many => {
                let images = values.chunks_exact(side * side).collect();
                let header = title.to_owned();
                pictures.sheet(&named, &Sheet::new(header, (side, side), images, Unit::OfWhite));
            }
        }
        pictures.write_files(self.existing())?;
        Ok(pictures)
    }
}

fn read_picture(path: &Path, side: u32, resize: bool) -> Result<Grey> {
    if resize {
        return Ok(read_grey(path)?.resized(side));
    }
    read_grey_if(path, |(width, height)| match (width, height) == (side, side) {
        true => Ok(()),
        false => {
            let (height, width, side) = (height as usize, width as usize, side as usize);
            Err(StackError::Size { path: path.to_owned(), height, width, side })
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A header of 16384 x 16384 pixels of one bit took 1.3 GB to be told that it is not 64 x 64.
    #[test]
    fn a_picture_of_another_size_is_refused_before_its_pixels_are_decoded() {
        let headed = |width: u32, height: u32| {
            let mut bytes = Vec::new();
            let mut encoder = ::png::Encoder::new(&mut bytes, width, height);
            encoder.set_depth(::png::BitDepth::One);
            let mut writer = encoder.write_header().unwrap();
            // The pixels are missing, which the decoder would tell.
            writer.write_chunk(::png::chunk::IDAT, &[]).unwrap();
            drop(writer);
            bytes
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("in.png");
        for (width, height) in [(65, 64), (64, 65), (8192, 8192)] {
            std::fs::write(&path, headed(width, height)).unwrap();
            let told = ImageStack::read(&path, 64, false).unwrap_err().to_string();
            let expected = format!("images of {height} x {width} pixels, expected 64 x 64");
            assert!(told.contains(&expected), "{told}");
        }
        std::fs::write(&path, headed(64, 64)).unwrap();
        let told = ImageStack::read(&path, 64, false).unwrap_err().to_string();
        assert!(told.contains("damaged or cut short"), "{told}");
    }
}

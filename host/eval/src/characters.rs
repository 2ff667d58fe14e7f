//! Reads characters for training from a user's files: `.npz` stacks, or Chars74K in its authors'
//! folders.
//!
//! # Invariant
//! Every character read is 64 x 64 pixels with its class and its group, and drawn characters are
//! bright on dark (`tests::chars74k_is_read_as_its_authors_hand_it_out`). A file that does not fit
//! is named in the error (`tests::what_does_not_fit_is_named`).
//!
//! # Formats
//!
//! A `.npz` stack:
//!
//! | field | content |
//! |---|---|
//! | `x` | `(N, 64, 64)`, 0 to 255, or 0 to 1 |
//! | `label` | optional `(N,)`: class, 0 to 61 for 0-9, A-Z, a-z |
//! | `group`, `family`, `writer` or `font` | optional `(N,)`: who drew it; without one each image is its own group |
//!
//! Chars74K (T. de Campos et al., VISAPP 2009): `English/Fnt/Sample001/img001-00001.png` (type,
//! four styles of one family in a row), `English/Hnd/Img/Sample001/...` (handwriting, numbered by
//! writer) and `English/Img/GoodImg/Bmp/Sample001/...` (photographs). Drawn characters are cut out
//! and scaled so that their longer side is 48 pixels. Photographs are scaled to 64 pixels and
//! padded with the levels of their own edge.

use nirspi::files::FileError;
use nirspi::files::archive::Archive;
use nirspi::files::image::{Filter, Grey, read_grey, to_level};
use nirspi_nets::data::{AREA_PX, CLASSES, DataError, Kind, SIDE_PX, Stack};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Longer side of a drawn character, in pixels.
pub(crate) const GLYPH_PX: u32 = 48;
/// Pixels brighter than this level are ink.
const INK: f32 = 0.25;
/// A stack holds drawn characters if the rim of most images is darker than this level.
const DARK_RIM: f32 = 32.0;
/// Styles of one family in Chars74K's `Fnt`: plain, bold, italic, and bold italic.
const STYLES: u32 = 4;
/// Fields that may name the group of each image.
const GROUPS: [&str; 4] = ["group", "family", "writer", "font"];

const EXPECTED: &str = "a .npz stack, a folder of them, or Chars74K's folder English";
const EXPECTED_FILE: &str = "64 x 64 images with one label and one group each";

/// Reads every stack at `path`: one `.npz`, all `.npz` files of a folder, or Chars74K's folders.
///
/// # Errors
/// [`FileError`], one line that names the file, what was found and what was expected.
pub fn read(path: &Path) -> Result<Vec<Stack>, FileError> {
    let metadata = std::fs::metadata(path).map_err(|error| FileError::io(path, "read", error))?;
    if !metadata.is_dir() {
        return Ok(vec![read_npz(path)?]);
    }
    let archives: Vec<PathBuf> = entries(path)?
        .into_iter()
        .filter(|entry| entry.extension().is_some_and(|ending| ending == "npz"))
        .collect();
    if !archives.is_empty() {
        return archives.iter().map(|file| read_npz(file)).collect();
    }
    let mut stacks = Vec::new();
    for (folder, what) in LAYOUT {
        let places = [path.join("English").join(folder), path.join(folder)];
        if let Some(place) = places.iter().find(|place| place.is_dir()) {
            stacks.push(read_folder(place, what)?);
        }
    }
    if stacks.is_empty() {
        return Err(FileError::kind(path, "a folder without either", EXPECTED));
    }
    Ok(stacks)
}

/// Files and folders in a folder, sorted by name.
pub(crate) fn entries(folder: &Path) -> Result<Vec<PathBuf>, FileError> {
    let read = |error| FileError::io(folder, "read", error);
    let mut entries = std::fs::read_dir(folder)
        .map_err(read)?
        .map(|entry| entry.map(|entry| entry.path()).map_err(read))
        .collect::<Result<Vec<PathBuf>, FileError>>()?;
    entries.sort_unstable();
    Ok(entries)
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

pub(crate) fn refused(path: &Path, error: &DataError) -> FileError {
    FileError::Damaged { path: path.to_owned(), found: error.to_string(), expected: EXPECTED_FILE }
}

fn read_npz(path: &Path) -> Result<Stack, FileError> {
    let mut archive = Archive::open(path)?;
    if !archive.holds("x") {
        let found = archive.names().to_vec();
        let expected = "x (N, 64, 64), label, and group, family or writer";
        return Err(FileError::Missing { path: path.to_owned(), field: "x", found, expected });
    }
    let side = SIDE_PX as u64;
    let x = archive.numbers_of::<f32>("x", |shape| match shape {
        [images, height, width] if *images > 0 && (*height, *width) == (side, side) => Ok(()),
        _ => Err("(N, 64, 64)".to_owned()),
    })?;
    let wrong = |field: &'static str, found, expected: &str| FileError::Field {
        path: path.to_owned(),
        field: field.into(),
        found,
        expected: expected.to_owned(),
    };
    if let Some(at) = x.values.iter().position(|v| !(0.0..=255.0).contains(v)) {
        let found = format!("is {} in image {}", x.values[at], at / AREA_PX);
        return Err(wrong("x", found, "0 to 255, or 0 to 1"));
    }
    let scale = if x.values.iter().all(|&v| v <= 1.0) { 255.0 } else { 1.0 };
    let levels: Vec<u8> = x.values.iter().map(|v| (v * scale).round() as u8).collect();
    let images = levels.len() / AREA_PX;

    let mut integers = |field: &'static str, last: f64| -> Result<Option<Vec<u32>>, FileError> {
        if !archive.holds(field) {
            return Ok(None);
        }
        let numbers = archive.numbers(field, |shape| match shape {
            [count] if *count == images as u64 => Ok(()),
            _ => Err(format!("({images},): one an image")),
        })?;
        let whole = |v: f64| v.fract() == 0.0 && (0.0..=last).contains(&v);
        match numbers.values.iter().position(|&v| !whole(v)) {
            Some(at) => {
                let found = format!("is {} at [{at}]", numbers.values[at]);
                Err(wrong(field, found, &format!("whole numbers from 0 to {last}")))
            }
            None => Ok(Some(numbers.values.iter().map(|&v| v as u32).collect())),
        }
    };
    let labels = integers("label", (CLASSES - 1) as f64)?;
    let mut groups = None;
    for field in GROUPS {
        groups = groups.or(integers(field, f64::from(u32::MAX))?);
    }
    let groups = groups.unwrap_or_else(|| (0..images as u32).collect());
    let labels = labels.map(|labels| labels.into_iter().map(|label| label as u8).collect());
    Stack::new(stem(path), kind_of(&levels), levels, labels, groups)
        .map_err(|error| refused(path, &error))
}

/// The kind of characters by their rims: drawn characters are on black up to the rim, photographs
/// are not.
fn kind_of(levels: &[u8]) -> Kind {
    let last = SIDE_PX - 1;
    let rim =
        |at: &usize| [0, last].contains(&(at % SIDE_PX)) || [0, last].contains(&(at / SIDE_PX));
    let places: Vec<usize> = (0..AREA_PX).filter(rim).collect();
    let dark = |image: &&[u8]| {
        let sum: f32 = places.iter().map(|&at| f32::from(image[at])).sum();
        sum / (places.len() as f32) < DARK_RIM
    };
    let images = levels.len() / AREA_PX;
    let dark = levels.chunks_exact(AREA_PX).filter(dark).count();
    if 2 * dark > images { Kind::Drawn } else { Kind::Photograph }
}

/// One of Chars74K's folders.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Folder {
    Type,
    Handwriting,
    Photographs,
}

const LAYOUT: [(&str, Folder); 3] = [
    ("Fnt", Folder::Type),
    ("Hnd/Img", Folder::Handwriting),
    ("Img/GoodImg/Bmp", Folder::Photographs),
];

/// Reads `SampleNNN/imgNNN-MMMMM.png`: the class is NNN - 1; the font, writer or photograph is
/// MMMMM.
fn read_folder(folder: &Path, what: Folder) -> Result<Stack, FileError> {
    let mut files: Vec<(PathBuf, u8, u32)> = Vec::new();
    for sample in entries(folder)? {
        let class = stem(&sample).strip_prefix("Sample").and_then(|n| n.parse::<usize>().ok());
        let Some(class) = class.filter(|_| sample.is_dir()) else { continue };
        if !(1..=CLASSES).contains(&class) {
            return Err(FileError::kind(
                &sample,
                format!("class {class}"),
                "Sample001 to Sample062",
            ));
        }
        for file in entries(&sample)? {
            if file.extension().is_none_or(|ending| ending != "png") {
                continue;
            }
            let name = stem(&file);
            let number = name.split_once('-').and_then(|(_, number)| number.parse::<u32>().ok());
            let number = number.ok_or_else(|| {
                FileError::kind(&file, "a name without a number", "img001-00001.png or the like")
            })?;
            let group = match what {
                Folder::Type => number.saturating_sub(1) / STYLES,
                Folder::Handwriting | Folder::Photographs => number,
            };
            files.push((file, (class - 1) as u8, group));
        }
    }
    let images: Vec<Vec<u8>> = files
        .par_iter()
        .map(|(file, ..)| {
            let picture = read_grey(file)?;
            match what {
                Folder::Photographs => Ok(photograph(&picture)),
                Folder::Type | Folder::Handwriting => {
                    let ink = picture.values.iter().map(|v| 1.0 - v).collect();
                    centred(&Grey { values: ink, ..picture }, GLYPH_PX).ok_or_else(|| {
                        FileError::kind(
                            file,
                            "an empty page",
                            "a dark character on a bright ground",
                        )
                    })
                }
            }
        })
        .collect::<Result<_, FileError>>()?;
    let (name, kind) = match what {
        Folder::Type => ("fnt", Kind::Drawn),
        Folder::Handwriting => ("hnd", Kind::Drawn),
        Folder::Photographs => ("img", Kind::Photograph),
    };
    let labels = files.iter().map(|(_, label, _)| *label).collect();
    let groups = match what {
        // The numbers of photographs start again in each class, so each photograph gets its own
        // group.
        Folder::Photographs => (0..files.len() as u32).collect(),
        _ => files.iter().map(|(.., group)| *group).collect(),
    };
    Stack::new(name, kind, images.concat(), Some(labels), groups)
        .map_err(|error| refused(folder, &error))
}

fn resized(picture: &Grey, longer_px: u32) -> Grey {
    let (width, height) = (picture.width, picture.height);
    let scale = longer_px as f32 / width.max(height) as f32;
    let size = |edge: u32| ((edge as f32 * scale).round() as u32).clamp(1, longer_px);
    picture.scaled((size(width), size(height)), Filter::Triangle)
}

/// Each pixel with its place: column and row.
fn pixels(picture: &Grey) -> impl Iterator<Item = (u32, u32, f32)> {
    let places = 0..picture.width * picture.height;
    let wide = picture.width;
    places.zip(&picture.values).map(move |(at, value)| (at % wide, at / wide, *value))
}

/// Cuts out and centres a bright character on dark, as 64 x 64 levels with a longer side of
/// `longer_px`; `None` if there is no ink.
pub(crate) fn centred(ink: &Grey, longer_px: u32) -> Option<Vec<u8>> {
    let inked = || pixels(ink).filter(|(.., value)| *value > INK);
    let (left, right) = (inked().map(|(x, ..)| x).min()?, inked().map(|(x, ..)| x).max()?);
    let (top, bottom) = (inked().map(|(_, y, _)| y).min()?, inked().map(|(_, y, _)| y).max()?);
    let cut = ink.part((left, top), (right - left + 1, bottom - top + 1));
    let small = resized(&cut, longer_px);
    let side = SIDE_PX as u32;
    let (x0, y0) = ((side - small.width) / 2, (side - small.height) / 2);
    let mut levels = vec![0; AREA_PX];
    for (x, y, value) in pixels(&small) {
        levels[((y + y0) * side + x + x0) as usize] = to_level(value);
    }
    Some(levels)
}

/// A photograph as 64 x 64 levels: its longer side is 64 pixels, padded with the levels of its
/// edge. If the rim is brighter than the middle, the result is a negative, so that characters are
/// bright.
fn photograph(picture: &Grey) -> Vec<u8> {
    let small = resized(picture, SIDE_PX as u32);
    let (width, height) = (small.width, small.height);
    let side = SIDE_PX as u32;
    let (x0, y0) = ((side - width) / 2, (side - height) / 2);
    let (mut rim, mut all) = (Vec::new(), 0.0);
    for (x, y, value) in pixels(&small) {
        all += value;
        if x == 0 || y == 0 || x + 1 == width || y + 1 == height {
            rim.push(value);
        }
    }
    let negative = rim.iter().sum::<f32>() / rim.len() as f32 > all / (width * height) as f32;
    (0..side * side)
        .map(|at| {
            let x = (at % side).saturating_sub(x0).min(width - 1);
            let y = (at / side).saturating_sub(y0).min(height - 1);
            let value = small.value(x, y);
            to_level(if negative { 1.0 - value } else { value })
        })
        .collect()
}

#[cfg(test)]
mod tests;

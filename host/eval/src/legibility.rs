//! Legibility of characters, judged by Tesseract if the machine has it.
//!
//! Every image is judged in the same way. The character is cut out where the image is brighter than
//! a half, drawn dark on bright 40 pixels high with a margin, and read as one character (`--psm
//! 10`) of the 62. Tesseract 5.3.0 then reads 49 of the 62 clean 64 x 64 characters of Chars74K's
//! fonts, more than with a margin of 10, uncut, or as a word.

use nirspi::files::image::{Filter, Grey, to_level};
use nirspi_nets::data::CHARACTERS;
use std::io;
use std::process::Command;
use thiserror::Error;

/// Pixels brighter than this level belong to the character.
const INK: f32 = 0.5;
/// Height of the drawn character.
const HEIGHT_PX: u32 = 40;
/// White margin around the character.
const MARGIN_PX: u32 = 20;
/// The character that Tesseract prints after each image.
const PAGE_END: char = '\u{c}';

/// Why the images were not read. `Display` is one line.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LegibilityError {
    /// Tesseract is not on this machine.
    #[error("no tesseract on this machine (Debian: apt install tesseract-ocr)")]
    Absent,
    /// The system reported an error.
    #[error("tesseract cannot be run")]
    Io(#[from] io::Error),
    /// Tesseract reported an error.
    #[error("tesseract: {0}")]
    Failed(String),
    /// The number of answers is not the number of images.
    #[error("tesseract answered for {found} images, expected {expected}")]
    Pages {
        /// Number of answers.
        found: usize,
        /// Number of images.
        expected: usize,
    },
}

/// A program that reads characters.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Judge {
    program: String,
    /// Name and version of the program: `tesseract 5.3.0`.
    pub name: String,
}

impl Judge {
    /// Tesseract, if it is on the path.
    ///
    /// # Errors
    /// [`LegibilityError::Absent`] if Tesseract is not on the path.
    pub fn tesseract() -> Result<Self, LegibilityError> {
        Self::from_program("tesseract")
    }

    fn from_program(program: &str) -> Result<Self, LegibilityError> {
        let output = run(Command::new(program).arg("--version"))?;
        let name = output.lines().next().unwrap_or("tesseract").trim().to_owned();
        Ok(Self { program: program.to_owned(), name })
    }

    /// The character read in each image of `height` x `width` pixels in [0, 1], bright on dark;
    /// `None` if Tesseract reads no character or several.
    ///
    /// # Errors
    /// [`LegibilityError`] if Tesseract cannot be run.
    ///
    /// # Panics
    /// If the values are not whole images of at least one pixel.
    pub fn read(
        &self,
        images: &[f32],
        (height, width): (usize, usize),
    ) -> Result<Vec<Option<char>>, LegibilityError> {
        let folder = tempfile::tempdir()?;
        let mut list = String::new();
        let stack = images.chunks_exact(height * width);
        let expected = stack.len();
        for (k, image) in stack.enumerate() {
            let path = folder.path().join(format!("{k}.pgm"));
            std::fs::write(&path, pgm(&drawn(image, width)))?;
            list.push_str(&format!("{}\n", path.display()));
        }
        // One run reads all images, because starting Tesseract takes longer than reading an image.
        let path = folder.path().join("images.txt");
        std::fs::write(&path, list)?;
        let text = run(Command::new(&self.program)
            // Without the limit, Tesseract starts a thread for each part of a picture, also for
            // pictures with one part.
            .env("OMP_THREAD_LIMIT", "1")
            .arg(&path)
            .args(["stdout", "--psm", "10", "-c"])
            .arg(format!("tessedit_char_whitelist={CHARACTERS}")))?;
        answers(&text, expected)
    }
}

/// The character of each page; an error if the number of pages differs.
fn answers(text: &str, expected: usize) -> Result<Vec<Option<char>>, LegibilityError> {
    let read = |page: &str| {
        let mut characters = page.trim().chars();
        characters.next().filter(|_| characters.next().is_none())
    };
    let mut pages: Vec<_> = text.split(PAGE_END).map(read).collect();
    // Nothing follows the last page end.
    pages.pop();
    let found = pages.len();
    if found == expected { Ok(pages) } else { Err(LegibilityError::Pages { found, expected }) }
}

fn run(command: &mut Command) -> Result<String, LegibilityError> {
    let output = command.output().map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => LegibilityError::Absent,
        _ => LegibilityError::Io(error),
    })?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        return Err(LegibilityError::Failed(said.trim().replace('\n', "; ")));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// The character cut out, dark on bright, with a margin.
fn drawn(image: &[f32], width: usize) -> Grey {
    let inked = || image.iter().enumerate().filter(|(_, v)| **v > INK).map(|(at, _)| at);
    let rows = || inked().map(|at| (at / width) as u32);
    let columns = || inked().map(|at| (at % width) as u32);
    let span = |first: Option<u32>, last: Option<u32>, all: usize| match first.zip(last) {
        Some((first, last)) => (first, last - first + 1),
        None => (0, all as u32),
    };
    let (top, high) = span(rows().min(), rows().max(), image.len() / width);
    let (left, wide) = span(columns().min(), columns().max(), width);
    let dark = image.iter().map(|value| 1.0 - value).collect();
    let picture = Grey { width: width as u32, height: (image.len() / width) as u32, values: dark };
    let scaled = (f64::from(wide) * f64::from(HEIGHT_PX) / f64::from(high)).round() as u32;
    let cut = picture.part((left, top), (wide, high));
    let cut = cut.scaled((scaled.max(1), HEIGHT_PX), Filter::CatmullRom);
    let (width, height) = (cut.width + 2 * MARGIN_PX, HEIGHT_PX + 2 * MARGIN_PX);
    let mut page = vec![1.0; (width * height) as usize];
    for (row, y) in cut.values.chunks_exact(cut.width as usize).zip(MARGIN_PX..) {
        page[(y * width + MARGIN_PX) as usize..][..row.len()].copy_from_slice(row);
    }
    Grey { width, height, values: page }
}

/// The bytes of a portable grey map (PGM, 8 bits).
fn pgm(picture: &Grey) -> Vec<u8> {
    let mut bytes = format!("P5 {} {} 255\n", picture.width, picture.height).into_bytes();
    bytes.extend(picture.values.iter().map(|value| to_level(*value)));
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi::scene::SceneSource;

    #[test]
    fn the_character_is_cut_out_dark_on_bright() {
        // A bar of two columns and four rows in 6 x 8 pixels.
        let bar = |at: usize| (1..5).contains(&(at / 8)) && (2..4).contains(&(at % 8));
        let image: Vec<f32> = (0..48).map(|at| if bar(at) { 0.8 } else { 0.0 }).collect();
        let page = drawn(&image, 8);
        assert_eq!((page.width, page.height), (20 + 2 * MARGIN_PX, HEIGHT_PX + 2 * MARGIN_PX));
        assert_eq!(to_level(page.value(MARGIN_PX + 10, MARGIN_PX + 20)), 51);
        assert_eq!(page.value(MARGIN_PX - 1, MARGIN_PX + 20), 1.0);
        let blank = drawn(&[0.0; 48], 8);
        assert_eq!((blank.width, blank.height), (53 + 2 * MARGIN_PX, 80));
    }

    #[test]
    fn a_machine_without_it_says_so() {
        let error = Judge::from_program("no-such-program-of-nirspi").unwrap_err();
        assert!(matches!(error, LegibilityError::Absent), "{error}");
    }

    #[test]
    fn there_is_an_answer_for_each_image_or_none_at_all() {
        let pages = answers("A\n\u{c}ab\n\u{c}\u{c}", 3).unwrap();
        assert_eq!(pages, [Some('A'), None, None]);
        for (text, found) in [("", 0), ("A\n\u{c}", 1)] {
            let error = answers(text, 3).unwrap_err();
            assert!(matches!(error, LegibilityError::Pages { found: f, .. } if f == found));
        }
    }

    #[test]
    fn tesseract_reads_our_own_letters() {
        let judge = match Judge::tesseract() {
            Ok(judge) => judge,
            Err(error) => return eprintln!("skipped: {error}"),
        };
        let images: Vec<f32> = "ABEFHN"
            .chars()
            .flat_map(|c| SceneSource::Letter(c).load(64).unwrap().reflectance)
            .collect();
        let read: String = judge.read(&images, (64, 64)).unwrap().into_iter().flatten().collect();
        assert_eq!(read, "ABEFHN");
    }
}

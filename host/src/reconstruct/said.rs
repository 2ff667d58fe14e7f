//! What is said of the images of a stack: each text once, with the images that it is about.

use super::FileImage;
use std::collections::HashMap;
use std::path::PathBuf;

/// The most texts that are kept. The report of each image has all of its own.
const MOST: usize = 1000;

/// What a text is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Kind {
    /// A reading that light cannot have given.
    Outlier,
    /// Something that contradicts the readings or the networks' result.
    Warning,
    /// A note for the user.
    Note,
}

/// A text, and the images that it is about.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Said {
    /// What it is about.
    pub kind: Kind,
    /// The text.
    pub text: String,
    /// Number of the first image, from 0.
    pub first: usize,
    /// The file of the first image, and its number in a file of several.
    pub of: (PathBuf, Option<usize>),
    /// Number of images.
    pub images: usize,
}

impl Said {
    /// In words, of a stack of one file or of several: `frame 3 and 15 more: the text`.
    #[must_use]
    pub fn words(&self, many: bool) -> String {
        let Self { text, first, of: (file, index), images, .. } = self;
        let place = match (many, index) {
            (false, _) => format!("frame {first}"),
            (true, Some(index)) => format!("{}, {index}", file.display()),
            (true, None) => file.display().to_string(),
        };
        match images {
            1 => format!("{place}: {text}"),
            images => format!("{place} and {} more: {text}", images - 1),
        }
    }
}

/// All texts, in the order of their first images.
#[derive(Debug, Default)]
pub struct AllSaid {
    said: Vec<Said>,
    known: HashMap<(Kind, String), usize>,
    left_out: usize,
}

impl AllSaid {
    /// The texts.
    #[must_use]
    pub fn texts(&self) -> &[Said] {
        &self.said
    }

    /// Number of times that something was said that is not among the texts.
    #[must_use]
    pub fn left_out(&self) -> usize {
        self.left_out
    }

    /// Adds what is said of the next image, with its number.
    pub(super) fn of_image(&mut self, number: usize, image: &FileImage) {
        let of = || (image.file.clone(), image.index);
        image.outliers.iter().for_each(|outlier| {
            self.add(Kind::Outlier, &outlier.to_string(), number, of);
        });
        image.warnings.iter().for_each(|text| self.add(Kind::Warning, text, number, of));
        image.notes.iter().for_each(|text| self.add(Kind::Note, text, number, of));
    }

    pub(super) fn add(
        &mut self,
        kind: Kind,
        text: &str,
        first: usize,
        of: impl Fn() -> (PathBuf, Option<usize>),
    ) {
        let key = (kind, text.to_owned());
        if let Some(&at) = self.known.get(&key) {
            self.said[at].images += 1;
        } else if self.said.len() < MOST {
            self.known.insert(key, self.said.len());
            self.said.push(Said { kind, text: text.to_owned(), first, of: of(), images: 1 });
        } else {
            self.left_out += 1;
        }
    }

    /// Brings the texts into the order of their images.
    pub(super) fn sorted(mut self) -> Self {
        self.said.sort_by_key(|said| said.first);
        self.known.clear();
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_of_many_images_stands_once_and_the_texts_are_bounded() {
        let mut all = AllSaid::default();
        let of = || (PathBuf::from("a.npz"), None);
        all.add(Kind::Note, "late", 7, of);
        for image in 0..2 * MOST {
            all.add(Kind::Warning, "dark", image, of);
            all.add(Kind::Note, &format!("number {image}"), image, of);
        }
        // Two texts of their own, and the rest of the numbers.
        assert_eq!(all.left_out(), 2 * MOST - (MOST - 2));
        let all = all.sorted();
        assert_eq!((all.texts().len(), all.texts()[0].text.as_str()), (MOST, "dark"));
        assert_eq!(all.texts()[0].images, 2 * MOST);
        assert!(all.texts().is_sorted_by_key(|said| said.first));
    }
}

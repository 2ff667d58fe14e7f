//! Typefaces of test targets that are outside the networks' training data, and the choice of
//! character and typeface for a scene.
//!
//! Training used only families under the Open Font License, and none of these typefaces has that
//! licence (`fonts/README.md`). Training also used Chars74K, which does not name its fonts, so
//! relatives of these typefaces may be among its fonts.

use nirspi::picture::Typeface;

/// The characters of the scenes, in turn.
pub const CHARACTERS: &[u8; 62] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789";

const FILES: [(&str, &[u8]); 4] = [
    ("DejaVu Serif", include_bytes!("../fonts/dejavu-serif.ttf")),
    ("Latin Modern Roman", include_bytes!("../fonts/latin-modern-roman.otf")),
    ("Latin Modern Sans", include_bytes!("../fonts/latin-modern-sans.otf")),
    ("Latin Modern Mono", include_bytes!("../fonts/latin-modern-mono.otf")),
];

/// All typefaces; Ubuntu Light is first.
#[must_use]
pub fn all() -> Vec<Typeface> {
    let files = FILES.iter().filter_map(|(name, bytes)| Typeface::from_bytes(name, bytes));
    [Typeface::ubuntu_light(), Typeface::hack()].into_iter().chain(files).collect()
}

/// The character and the typeface of scene number `i`, as indices. Every 62 scenes show every
/// character once, each time in the next typeface, so 62 times the number of typefaces show every
/// pair once.
#[must_use]
pub fn of_scene(i: usize, typefaces: usize) -> (usize, usize) {
    let character = i % CHARACTERS.len();
    (character, (character + i / CHARACTERS.len()) % typefaces)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn every_typeface_draws_every_character_and_each_its_own_way() {
        let all = all();
        assert_eq!(all.len(), 6);
        for &character in CHARACTERS {
            let drawn: Vec<Vec<f32>> =
                all.iter().map(|face| face.draw(char::from(character), 32, 0.9).unwrap()).collect();
            for (at, picture) in drawn.iter().enumerate() {
                assert!(
                    !drawn[..at].contains(picture),
                    "{} {}",
                    all[at].name(),
                    char::from(character)
                );
            }
        }
    }

    #[test]
    fn every_pair_of_character_and_typeface_comes_once() {
        let pairs: BTreeSet<_> = (0..372).map(|i| of_scene(i, 6)).collect();
        assert_eq!(pairs.len(), 372);
        let first: BTreeSet<_> = (0..62).map(|i| of_scene(i, 6).0).collect();
        assert_eq!(first.len(), 62);
    }
}

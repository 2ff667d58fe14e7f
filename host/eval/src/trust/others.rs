//! What is no single Latin character: sheets, noise, shapes, words, and other alphabets.
//!
//! # Invariant
//! The rule of the reader is chosen on other words, sheets and typefaces than those that judge it
//! (`tests::the_halves_share_no_scene`).

use super::Half;
use nirspi::picture::Typeface;
use nirspi_nets::data::shapes::Shape;
use nirspi_nets::data::{Purpose, SIDE_PX, stream};
use rand::RngExt;

/// A scene that is no character, and its kind.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Other {
    pub kind: &'static str,
    pub sharp: Vec<f32>,
}

/// Letters of other alphabets that no digit and no Latin letter looks like, for the rule.
const ALPHABETS: &str = "\u{393}\u{394}\u{398}\u{39e}\u{3a0}\u{3a3}\u{3a6}\u{3a8}\u{3a9}\u{3b4}\u{3b6}\u{3b8}\u{3bb}\u{3be}\u{3c0}\u{3c6}\u{3c8}\
                         \u{411}\u{414}\u{416}\u{419}\u{41b}\u{424}\u{426}\u{427}\u{428}\u{429}\u{42a}\u{42b}\u{42d}\u{42e}\u{42f}\u{434}\u{436}\u{439}\u{444}\u{446}\u{448}\u{44a}\u{44b}\u{44d}\u{44e}\u{44f}";

/// Letters and signs for the judging: Greek, Cyrillic, Armenian, Georgian, arrows, mathematics.
const JUDGED: &str = "\u{393}\u{398}\u{39e}\u{3a3}\u{3a6}\u{3a8}\u{3a9}\u{3b4}\u{3bb}\u{3be}\u{3c0}\u{3c6}\u{3c8}\u{416}\u{41b}\u{424}\u{426}\u{428}\u{429}\u{42b}\u{42e}\u{42f}\
                      \u{434}\u{436}\u{444}\u{449}\u{44e}\u{44f}\u{531}\u{532}\u{533}\u{534}\u{53a}\u{53e}\u{540}\u{543}\u{56f}\u{573}\u{10d0}\u{10d1}\u{10d3}\u{10da}\u{10e0}\u{10e5}\
                      \u{2190}\u{2191}\u{21d2}\u{21c4}\u{2200}\u{2202}\u{2205}\u{2207}\u{2211}\u{221e}\u{2229}\u{222b}\u{2248}\u{2260}\u{2264}\u{25a0}\u{25b2}\u{25c6}";

/// Words.
const WORDS: [&str; 16] = [
    "GO", "NO", "TAXI", "OPEN", "PULL", "door", "left", "AREA", "Bus", "line", "BAY 4", "Hot",
    "P4", "room", "wet", "SLOW",
];
const JUDGED_WORDS: [&str; 12] =
    ["STOP", "EXIT", "PARK", "HALT", "UP", "Ufer", "Gate", "cold", "OFF", "on", "K7", "metro"];

/// Signs beside letters, for the rule: Hack alone has them, the judging has others.
const SIGNS: &str = "\u{2192}\u{2193}\u{2194}\u{21d0}\u{2203}\u{2208}\u{2206}\u{220f}\u{221a}\u{222a}\u{2245}\u{2261}\u{2265}\u{25cf}\u{25bc}\u{2605}#%&@$?!*+=~^<>";

/// Scenes that are no character, `count` of each kind where there is no list.
pub(super) fn others(half: Half, count: usize, seed: u64) -> Vec<Other> {
    let mut all = Vec::new();
    let judged = half == Half::Judging;
    let mut rng = stream(seed ^ u64::from(judged) << 40, Purpose::HeldOut, 1);
    for shape in Shape::ALL {
        // A single bar or stroke is an I, an l or a 1.
        let drawn =
            (0..count.div_ceil(4)).map(|_| Other { kind: "shapes", sharp: shape.draw(&mut rng) });
        all.extend(drawn);
    }
    for k in 0..count {
        let level = (k as f32 + if judged { 0.5 } else { 0.0 }) / count as f32;
        let slope = if k % 3 == 2 { rng.random_range(-0.3..0.3_f32) } else { 0.0 };
        let sheet = |at: usize| level + slope * ((at % SIDE_PX) as f32 / SIDE_PX as f32 - 0.5);
        let sharp = (0..SIDE_PX * SIDE_PX).map(|at| sheet(at).clamp(0.0, 1.0)).collect();
        all.push(Other { kind: "sheets", sharp });
    }
    for _ in 0..count / 4 {
        all.push(Other { kind: "sheets", sharp: vec![0.0; SIDE_PX * SIDE_PX] });
    }
    let [ubuntu, hack] = [Typeface::ubuntu_light(), Typeface::hack()];
    let (face, words) = match half {
        Half::Calibration => (&ubuntu, &WORDS[..]),
        Half::Judging => (&hack, &JUDGED_WORDS[..]),
    };
    for text in words {
        for height in [14, 20, 26] {
            all.extend(word(face, text, height, 0.5 + 0.5 * rng.random::<f32>()));
        }
    }
    let letters = |face: &Typeface, all: &str, fill: f32| -> Vec<Other> {
        let each = all.chars().filter_map(|letter| face.draw(letter, SIDE_PX, fill));
        each.map(|sharp| Other { kind: "alphabets", sharp }).collect()
    };
    match half {
        Half::Calibration => {
            all.extend(letters(&ubuntu, ALPHABETS, 0.75));
            all.extend(letters(&ubuntu, ALPHABETS, 0.9));
            all.extend(letters(&hack, SIGNS, 0.75));
        }
        Half::Judging => {
            all.extend(letters(&hack, JUDGED, 0.75));
            all.extend(letters(&hack, JUDGED, 0.9));
        }
    }
    all
}

/// Characters side by side in the middle, as high as `height` pixels or as the width allows.
fn word(face: &Typeface, text: &str, height: usize, ink: f32) -> Option<Other> {
    let count = text.chars().count();
    let cell = height.min((SIDE_PX - 2) / count);
    let mut sharp = vec![0.0; SIDE_PX * SIDE_PX];
    let (top, left) = ((SIDE_PX - cell) / 2, (SIDE_PX - cell * count) / 2);
    for (k, letter) in text.chars().enumerate() {
        if letter == ' ' {
            continue;
        }
        let glyph = face.draw(letter, cell, 0.9)?;
        for (at, value) in glyph.into_iter().enumerate() {
            let (row, column) = (top + at / cell, left + k * cell + at % cell);
            sharp[row * SIDE_PX + column] = ink * value;
        }
    }
    Some(Other { kind: "words", sharp })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_halves_share_no_scene() {
        let [rule, judging] = [Half::Calibration, Half::Judging].map(|half| others(half, 8, 1));
        let flat = |scene: &Other| scene.sharp.iter().all(|value| *value == scene.sharp[0]);
        let shared = judging.iter().filter(|scene| !flat(scene) && rule.contains(scene)).count();
        assert_eq!(shared, 0);
        for kind in ["shapes", "sheets", "words", "alphabets"] {
            let count = |all: &[Other]| all.iter().filter(|other| other.kind == kind).count();
            assert!(count(&rule) >= 10 && count(&judging) >= 10, "{kind}");
        }
        assert!(JUDGED_WORDS.iter().all(|word| !WORDS.contains(word)));
    }
}

//! Characters from a folder of TrueType and OpenType fonts, in the form of Chars74K's: bright on
//! dark, centred.
//!
//! # Invariant
//! A font gives either all 62 characters or none, because networks would learn the boxes of missing
//! characters (`tests::a_font_that_lacks_one_character_gives_none`).

use crate::characters::{GLYPH_PX, entries, refused};
use ab_glyph::{Font as _, FontVec, GlyphId, PxScale, point};
use nirspi::files::{FileError, read_small};
use nirspi_nets::data::{AREA_PX, CHARACTERS, Kind, SIDE_PX, Stack};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Longer sides of characters, in pixels, which fonts use in turn. Most have the size of
/// Chars74K's.
const SIZES_PX: [f32; 5] = [48.0, 48.0, 48.0, 32.0, 57.0];
const EXPECTED: &str = "a folder of .ttf or .otf fonts";

/// The characters of a folder of fonts.
#[derive(Debug)]
pub struct Rendered {
    /// The characters. Each family is a group.
    pub stack: Stack,
    /// Number of fonts used.
    pub fonts: usize,
    /// Number of families of these fonts.
    pub families: usize,
    /// Fonts left out because they lack a character or are not valid fonts.
    pub skipped: Vec<PathBuf>,
}

/// Draws 0-9, A-Z and a-z from every font in `folder` and its subfolders. Files named
/// `Family-Style.ttf` belong to one family.
///
/// # Errors
/// [`FileError`] if the folder cannot be read, or none of its fonts has all characters.
pub fn render(folder: &Path) -> Result<Rendered, FileError> {
    let mut files = Vec::new();
    find(folder, &mut files)?;
    let drawn: Vec<Option<Vec<u8>>> = files
        .par_iter()
        .enumerate()
        .map(|(number, file)| {
            let bytes = read_small(file).map_err(|error| FileError::io(file, "read", error))?;
            let font = FontVec::try_from_vec(bytes).ok();
            Ok(font.and_then(|font| alphabet(&font, SIZES_PX[number % SIZES_PX.len()])))
        })
        .collect::<Result<_, FileError>>()?;

    let mut families: BTreeMap<String, u32> = BTreeMap::new();
    let (mut levels, mut labels, mut groups) = (Vec::new(), Vec::new(), Vec::new());
    let mut skipped = Vec::new();
    let mut fonts = 0;
    for (file, drawn) in files.iter().zip(drawn) {
        let Some(drawn) = drawn else {
            skipped.push(file.clone());
            continue;
        };
        let next = families.len() as u32;
        let family = *families.entry(family(file)).or_insert(next);
        labels.extend((0..CHARACTERS.len()).map(|class| class as u8));
        groups.resize(labels.len(), family);
        levels.extend(drawn);
        fonts += 1;
    }
    if fonts == 0 {
        let found = format!("{} fonts, none of them with 0-9, A-Z and a-z", files.len());
        return Err(FileError::kind(folder, found, EXPECTED));
    }
    let stack = Stack::new("fonts", Kind::Drawn, levels, Some(labels), groups)
        .map_err(|error| refused(folder, &error))?;
    Ok(Rendered { stack, fonts, families: families.len(), skipped })
}

fn find(folder: &Path, files: &mut Vec<PathBuf>) -> Result<(), FileError> {
    for entry in entries(folder)? {
        let font = |ending: &std::ffi::OsStr| {
            ["ttf", "otf"].iter().any(|known| ending.eq_ignore_ascii_case(known))
        };
        // Links are skipped, because a link to a folder may lead back to this folder.
        if entry.is_dir() && !entry.is_symlink() {
            find(&entry, files)?;
        } else if entry.extension().is_some_and(font) {
            files.push(entry);
        }
    }
    Ok(())
}

/// The family of a file: `Roboto-BoldItalic.ttf` and `Roboto[wght].ttf` are Roboto.
fn family(file: &Path) -> String {
    let name = file.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
    name.split(['-', '_', '[']).next().unwrap_or_default().to_owned()
}

/// All 62 characters; `None` if the font lacks one.
fn alphabet(font: &FontVec, size_px: f32) -> Option<Vec<u8>> {
    let drawn: Option<Vec<Vec<u8>>> =
        CHARACTERS.chars().map(|character| glyph(font, character, size_px)).collect();
    Some(drawn?.concat())
}

/// One character, centred, with a longer side of `size_px`, anti-aliased by coverage.
fn glyph(font: &FontVec, character: char, size_px: f32) -> Option<Vec<u8>> {
    let id = font.glyph_id(character);
    if id == GlyphId(0) {
        return None;
    }
    let bounds = font.outline(id)?.bounds;
    let longer = (bounds.max.x - bounds.min.x).abs().max((bounds.max.y - bounds.min.y).abs());
    if !(longer > 0.0 && longer.is_finite()) {
        return None;
    }
    let size_px = size_px.min(GLYPH_PX as f32 * 1.2);
    // `PxScale` is the height from descent to ascent in pixels.
    let scale = PxScale::from(size_px / longer * font.height_unscaled());
    let at_origin = font.outline_glyph(id.with_scale(scale))?.px_bounds();
    let centre = SIDE_PX as f32 / 2.0;
    let shift = point(
        centre - (at_origin.min.x + at_origin.max.x) / 2.0,
        centre - (at_origin.min.y + at_origin.max.y) / 2.0,
    );
    let outlined = font.outline_glyph(id.with_scale_and_position(scale, shift))?;
    let corner = outlined.px_bounds().min;
    let mut levels = vec![0; AREA_PX];
    outlined.draw(|dx, dy, coverage| {
        let (x, y) = (corner.x as i64 + i64::from(dx), corner.y as i64 + i64::from(dy));
        let inside = 0..SIDE_PX as i64;
        if inside.contains(&x) && inside.contains(&y) {
            levels[y as usize * SIDE_PX + x as usize] = nirspi::files::image::to_level(coverage);
        }
    });
    Some(levels)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_class_is_drawn_bright_on_dark_and_centred() {
        let folder = tempfile::tempdir().unwrap();
        let inner = folder.path().join("inner");
        std::fs::create_dir(&inner).unwrap();
        std::fs::write(folder.path().join("Hack-Regular.ttf"), epaint_default_fonts::HACK_REGULAR)
            .unwrap();
        std::fs::write(inner.join("Ubuntu-Light.TTF"), epaint_default_fonts::UBUNTU_LIGHT).unwrap();
        std::fs::write(inner.join("broken.otf"), b"no font").unwrap();
        let rendered = render(folder.path()).unwrap();
        let stack = &rendered.stack;
        assert_eq!((rendered.fonts, rendered.families, stack.len()), (2, 2, 124));
        assert_eq!(rendered.skipped, [inner.join("broken.otf")]);
        assert_eq!(
            (stack.label(0), stack.label(61), stack.label(62)),
            (Some(0), Some(61), Some(0))
        );
        for at in 0..124 {
            let bright: Vec<usize> = (0..AREA_PX).filter(|&p| stack.image(at)[p] > 127).collect();
            let extent = |of: &dyn Fn(&usize) -> usize| {
                let of = || bright.iter().map(of);
                (of().min().unwrap(), of().max().unwrap())
            };
            let (left, right) = extent(&|p| p % SIDE_PX);
            let (top, bottom) = extent(&|p| p / SIDE_PX);
            // The outline is centred. Only edge pixels that are more than half covered are bright.
            assert!((left + right).abs_diff(SIDE_PX - 1) <= 2, "{at}: columns {left} to {right}");
            assert!((top + bottom).abs_diff(SIDE_PX - 1) <= 2, "{at}: rows {top} to {bottom}");
            let longer = (right - left).max(bottom - top) + 1;
            assert!((46..=49).contains(&longer), "{at}: {longer}");
        }
    }

    /// Ubuntu Light without the outline of this character: its place in the table `loca` is empty.
    fn without(character: char) -> Vec<u8> {
        let mut bytes = epaint_default_fonts::UBUNTU_LIGHT.to_vec();
        let id = FontVec::try_from_vec(bytes.clone()).unwrap().glyph_id(character).0;
        let table = |name: &[u8]| {
            // The table directory: 12 bytes, then 16 bytes a table, the place at the ninth byte.
            let entry = bytes[12..].chunks(16).find(|entry| entry.starts_with(name)).unwrap();
            u32::from_be_bytes(entry[8..12].try_into().unwrap()) as usize
        };
        let (head, loca) = (table(b"head"), table(b"loca"));
        let width = if bytes[head + 51] == 0 { 2 } else { 4 };
        let at = loca + usize::from(id) * width;
        bytes.copy_within(at + width..at + 2 * width, at);
        bytes
    }

    #[test]
    fn a_font_that_lacks_one_character_gives_none() {
        let folder = tempfile::tempdir().unwrap();
        let lacking = folder.path().join("Lacking.ttf");
        std::fs::write(&lacking, without('z')).unwrap();
        std::fs::write(folder.path().join("Whole.ttf"), epaint_default_fonts::UBUNTU_LIGHT)
            .unwrap();
        let rendered = render(folder.path()).unwrap();
        assert_eq!((rendered.fonts, rendered.stack.len()), (1, 62));
        assert_eq!(rendered.skipped, [lacking]);
    }

    #[test]
    fn a_folder_without_fonts_is_named() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.ttf"), b"x").unwrap();
        let line = render(folder.path()).unwrap_err().to_string();
        assert!(line.contains("found 1 fonts, none of them with 0-9"), "{line}");
    }

    #[test]
    fn styles_are_of_one_family() {
        for name in ["Roboto-Bold.ttf", "roboto[wght].ttf", "a/Roboto_x.otf"] {
            assert_eq!(family(Path::new(name)), "roboto");
        }
    }
}

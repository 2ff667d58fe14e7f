//! One character as a test target: as large as possible, anti-aliased, bold.
//!
//! # Invariant
//! The drawn strokes, thickening included, touch the edges of a centred square of the requested
//! size and never leave it
//! (`tests::every_printable_ascii_character_fills_the_target_and_is_centred`).

use super::text::Font;
use ab_glyph::{Font as _, FontRef, GlyphId, PxScale, point};

/// Samples a pixel along each edge for anti-aliasing.
const OVERSAMPLING: usize = 4;
/// The font's strokes are thin for a target that a 32 x 32 camera must resolve. Each edge of a
/// stroke is moved outwards by this part of the target.
const THICKENING: f32 = 0.028;

/// A typeface for test targets.
#[derive(Debug, Clone)]
pub struct Typeface {
    name: &'static str,
    font: FontRef<'static>,
}

impl Typeface {
    /// Ubuntu Light, the typeface of letter scenes.
    #[must_use]
    pub fn ubuntu_light() -> Self {
        Self { name: "Ubuntu Light", font: Font::sans().clone() }
    }

    /// Hack, a typeface of fixed width.
    #[must_use]
    pub fn hack() -> Self {
        Self { name: "Hack", font: Font::mono().clone() }
    }

    /// The typeface in the bytes of a TrueType or OpenType file; `None` if the bytes are not a
    /// font.
    #[must_use]
    pub fn from_bytes(name: &'static str, bytes: &'static [u8]) -> Option<Self> {
        let font = FontRef::try_from_slice(bytes).ok()?;
        Some(Self { name, font })
    }

    /// Whether the typeface has a shape for this character. Blanks and unknown characters have no
    /// shape.
    #[must_use]
    pub fn has_shape(&self, character: char) -> bool {
        has_shape(&self.font, character)
    }

    /// The name of the typeface.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// The character in `[0, 1]`, bright on dark, `size_px * size_px` row-major. Its longer side is
    /// `fill` of the edge, and its strokes are thickened. `None` if the typeface has no shape for
    /// the character.
    #[must_use]
    pub fn draw(&self, character: char, size_px: usize, fill: f32) -> Option<Vec<f32>> {
        render(&self.font, character, size_px, fill)
    }
}

fn has_shape(font: &FontRef<'_>, character: char) -> bool {
    let id = font.glyph_id(character);
    id != GlyphId(0) && font.outline(id).is_some()
}

/// The character in `[0, 1]`, bright on dark, `size_px * size_px` row-major. Its longer side is
/// `fill` of the edge. `None` if the font has no shape for the character.
fn render(font: &FontRef<'_>, character: char, size_px: usize, fill: f32) -> Option<Vec<f32>> {
    if !has_shape(font, character) {
        return None;
    }
    let fine_px = size_px * OVERSAMPLING;
    let edge = fine_px as f32;
    let radius = THICKENING * edge;
    let thin = outline_mask(font, character, fine_px, fill * edge - 2.0 * radius)?;
    Some(average(&thicken(&thin, fine_px, radius), size_px))
}

/// The fine pixels that the centred character covers if its longer side has `longer_px`.
fn outline_mask(
    font: &FontRef<'_>,
    character: char,
    fine_px: usize,
    longer_px: f32,
) -> Option<Vec<bool>> {
    let id = font.glyph_id(character);
    let unscaled = font.outline(id)?.bounds;
    let longer =
        (unscaled.max.x - unscaled.min.x).abs().max((unscaled.max.y - unscaled.min.y).abs());
    if longer <= 0.0 {
        return None;
    }
    // `PxScale` is the height from descent to ascent in pixels.
    let scale = PxScale::from(longer_px.max(1.0) / longer * font.height_unscaled());
    let at_origin = font.outline_glyph(id.with_scale(scale))?.px_bounds();
    let centre = fine_px as f32 / 2.0;
    let shift = point(
        centre - (at_origin.min.x + at_origin.max.x) / 2.0,
        centre - (at_origin.min.y + at_origin.max.y) / 2.0,
    );
    let outlined = font.outline_glyph(id.with_scale_and_position(scale, shift))?;
    let bounds = outlined.px_bounds();
    let mut mask = vec![false; fine_px * fine_px];
    outlined.draw(|x, y, coverage| {
        let (x, y) = (bounds.min.x as i64 + i64::from(x), bounds.min.y as i64 + i64::from(y));
        let inside = 0..fine_px as i64;
        if coverage >= 0.5 && inside.contains(&x) && inside.contains(&y) {
            mask[y as usize * fine_px + x as usize] = true;
        }
    });
    Some(mask)
}

/// Every pixel within `radius` of a covered pixel: a covered pixel `dy` rows away covers, in this
/// row, the pixels up to `sqrt(radius^2 - dy^2)` to its left and right. The nearest covered pixel of
/// a column covers the most, so each column gives one interval, and a row is the union of these.
fn thicken(mask: &[bool], edge: usize, radius: f32) -> Vec<bool> {
    let reach = radius.floor() as usize;
    let half_widths: Vec<usize> = (0..=reach)
        .map(|dy| (radius * radius - (dy * dy) as f32).max(0.0).sqrt().floor() as usize)
        .collect();
    let rows_away = rows_to_covered(mask, edge);
    let mut thick = Vec::with_capacity(mask.len());
    let mut begins_less_ends = vec![0_i32; edge + 1];
    for away in rows_away.chunks_exact(edge) {
        begins_less_ends.fill(0);
        for (x, &dy) in away.iter().enumerate() {
            let Some(&half) = half_widths.get(dy as usize) else { continue };
            begins_less_ends[x.saturating_sub(half)] += 1;
            begins_less_ends[(x + half + 1).min(edge)] -= 1;
        }
        let mut open = 0;
        thick.extend(begins_less_ends[..edge].iter().map(|change| {
            open += change;
            open > 0
        }));
    }
    thick
}

/// How many rows each pixel is away from the nearest covered pixel of its column; `u32::MAX` in a
/// column without one.
fn rows_to_covered(mask: &[bool], edge: usize) -> Vec<u32> {
    let mut away: Vec<u32> =
        mask.iter().map(|&covered| if covered { 0 } else { u32::MAX }).collect();
    for at in edge..away.len() {
        away[at] = away[at].min(away[at - edge].saturating_add(1));
    }
    for at in (0..away.len().saturating_sub(edge)).rev() {
        away[at] = away[at].min(away[at + edge].saturating_add(1));
    }
    away
}

fn average(mask: &[bool], size_px: usize) -> Vec<f32> {
    let fine_px = size_px * OVERSAMPLING;
    let mut counts = vec![0u32; size_px * size_px];
    for (at, _) in mask.iter().enumerate().filter(|&(_, &covered)| covered) {
        counts[at / fine_px / OVERSAMPLING * size_px + at % fine_px / OVERSAMPLING] += 1;
    }
    counts.into_iter().map(|count| count as f32 / (OVERSAMPLING * OVERSAMPLING) as f32).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SIZE_PX: usize = 200;
    const FILL: f32 = 0.9;

    /// The smallest range of rows and columns that holds every pixel brighter than a half: left,
    /// right, top, bottom.
    fn extent(map: &[f32]) -> [usize; 4] {
        let lit = || {
            map.iter()
                .enumerate()
                .filter(|(_, value)| **value > 0.5)
                .map(|(at, _)| (at % SIZE_PX, at / SIZE_PX))
        };
        [
            lit().map(|(x, _)| x).min().unwrap(),
            lit().map(|(x, _)| x + 1).max().unwrap(),
            lit().map(|(_, y)| y).min().unwrap(),
            lit().map(|(_, y)| y + 1).max().unwrap(),
        ]
    }

    #[test]
    fn every_printable_ascii_character_fills_the_target_and_is_centred() {
        for character in '!'..='~' {
            let map = render(Font::sans(), character, SIZE_PX, FILL).unwrap();
            assert!(map.iter().all(|value| (0.0..=1.0).contains(value)));
            let [left, right, top, bottom] = extent(&map);
            let longer = (right - left).max(bottom - top) as f32 / SIZE_PX as f32;
            assert!((longer - FILL).abs() < 0.015, "{character}: {longer}");
            assert!(
                (left + right).abs_diff(SIZE_PX) <= 2,
                "{character}: columns {left} to {right}"
            );
            assert!((top + bottom).abs_diff(SIZE_PX) <= 2, "{character}: rows {top} to {bottom}");
        }
    }

    proptest! {
        #[test]
        fn a_thick_stroke_is_every_pixel_within_the_radius_of_a_thin_one(
            edge in 1_usize..30,
            covered in prop::collection::vec((0_usize..30, 0_usize..30), 0..12),
            radius in 0.0_f32..40.0,
        ) {
            let mut mask = vec![false; edge * edge];
            for &(x, y) in covered.iter().filter(|&&(x, y)| x < edge && y < edge) {
                mask[y * edge + x] = true;
            }
            let near = |at: usize| {
                (0..edge * edge).filter(|&other| mask[other]).any(|other| {
                    let dx = (at % edge).abs_diff(other % edge);
                    let dy = (at / edge).abs_diff(other / edge);
                    (dx * dx + dy * dy) as f32 <= radius * radius
                })
            };
            let expected: Vec<bool> = (0..edge * edge).map(near).collect();
            prop_assert_eq!(thicken(&mask, edge, radius), expected);
        }
    }

    #[test]
    fn strokes_of_a_capital_are_wide_enough_for_32_pixels() {
        // The bar of I, which is one stroke, compared with 2 of the camera's 32 pixels.
        let [left, right, ..] = extent(&render(Font::sans(), 'I', SIZE_PX, FILL).unwrap());
        assert!((right - left) as f32 / SIZE_PX as f32 > 2.0 / 32.0, "{}", right - left);
    }

    #[test]
    fn edges_are_smooth() {
        let map = render(Font::sans(), 'O', SIZE_PX, FILL).unwrap();
        let between = map.iter().filter(|value| (0.05..0.95).contains(*value)).count();
        assert!(between > SIZE_PX, "{between} pixels between dark and bright");
    }

    #[test]
    fn blanks_and_unknown_characters_have_no_shape() {
        for character in [' ', '\n', '\0', '\u{200b}', '漢', '\u{10ffff}'] {
            assert!(!has_shape(Font::sans(), character), "{character:?}");
            assert_eq!(render(Font::sans(), character, 16, FILL), None);
        }
    }

    #[test]
    fn a_target_of_few_pixels_is_drawn_too() {
        for size_px in 1..8 {
            assert_eq!(render(Font::sans(), 'R', size_px, FILL).unwrap().len(), size_px * size_px);
        }
    }
}

//! The line of provenance below a picture.

use super::drawing::Drawing;
use super::look::Look;
use super::text::{Block, Style};
use nirspi_files::provenance::Provenance;

/// The drawing with its provenance in words below it.
pub(super) fn signed(drawing: Drawing, look: &Look, provenance: &Provenance) -> Drawing {
    let (width, height) = drawing.size();
    let left = look.px(MARGIN).min(width);
    let line = provenance.to_string();
    let wide = width.saturating_sub(2 * left).max(1);
    let words = Block::new(Style::faint(look), [line.as_str()], wide);
    let mut whole = Drawing::new(look, width, height + words.height() + look.px(6));
    whole.place(drawing, 0, 0);
    words.draw(&mut whole, left, height);
    whole
}

/// Blank around all pictures, in sixteenths of the text's size.
pub(super) const MARGIN: u32 = 10;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::provenance;
    use crate::{Axis, Chart, Figure, FigureStyle};

    #[test]
    fn a_picture_stays_as_it_is_above_its_line_of_provenance() {
        let axis = |name| Axis::of(name, vec![0.0, 1.0], false);
        let (header, footer) = (String::new(), String::new());
        let chart = Chart { header, x: axis("x"), y: axis("y"), lines: Vec::new(), footer };
        let look = FigureStyle::Paper.look();
        let drawing = Figure::from(chart).draw(&look);
        let (picture, (width, height)) = (drawing.raster(), drawing.size());
        let signed = signed(drawing, &look, &provenance()).raster();
        assert!(signed.width() == width && signed.height() > height);
        assert_eq!(signed.part((0, 0), (width, height)), picture);
        let below = &signed.pixels()[(width * height) as usize..];
        let inked = below.iter().filter(|pixel| **pixel != look.palette.ground);
        assert!(inked.count() > 500);
    }
}

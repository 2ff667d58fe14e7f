//! A drawing as a PDF of one page. The glyphs that the page needs are in the file.

use super::drawing::{Drawing, Shape, enlarged};
use super::look::Colour;
use super::text::{Font, placed_glyphs};
use ab_glyph::{Font as _, FontRef, GlyphId};
use flate2::Compression;
use flate2::write::ZlibEncoder;
use nirspi_files::provenance::Provenance;
use pdf_writer::types::{CidFontType, FontFlags, LineJoinStyle, SystemInfo, UnicodeCmap};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect, Ref, Str, TextStr};
use std::collections::BTreeMap;
use std::io::Write;
use subsetter::GlyphRemapper;

const CATALOG: Ref = Ref::new(1);
const PAGES: Ref = Ref::new(2);
const PAGE: Ref = Ref::new(3);
const CONTENT: Ref = Ref::new(4);
const FONT: Ref = Ref::new(5);
const CID_FONT: Ref = Ref::new(6);
const DESCRIPTOR: Ref = Ref::new(7);
const FONT_FILE: Ref = Ref::new(8);
const UNICODE: Ref = Ref::new(9);
const INFO: Ref = Ref::new(10);
const FIRST_IMAGE: i32 = 11;

const FONT_NAME: Name<'static> = Name(b"F");
/// A tag of six letters says that the font is a part of Ubuntu Light.
const BASE_FONT: Name<'static> = Name(b"NIRSPI+Ubuntu-Light");
const REGISTRY: SystemInfo<'static> =
    SystemInfo { registry: Str(b"Adobe"), ordering: Str(b"Identity"), supplement: 0 };

impl Drawing {
    /// The drawing as PDF, with its provenance in the document's information.
    #[must_use]
    pub fn pdf(&self, provenance: &Provenance) -> Vec<u8> {
        let mut page = Page {
            scale: self.points_per_pixel() as f32,
            height: f64::from(self.height),
            content: Content::new(),
            glyphs: GlyphRemapper::new(),
            letters: BTreeMap::new(),
            images: Vec::new(),
        };
        page.colour(self.ground);
        let (wide, high) = (f64::from(self.width), f64::from(self.height));
        page.rect([0.0, 0.0, wide, high]);
        page.content.fill_nonzero();
        for shape in &self.shapes {
            page.draw(shape);
        }
        let scale = self.points_per_pixel();
        page.finish((wide * scale, high * scale), provenance)
    }
}

/// A page that is being written.
struct Page {
    /// Points in a pixel.
    scale: f32,
    /// In pixels.
    height: f64,
    content: Content,
    glyphs: GlyphRemapper,
    /// The letter of each glyph, by its number in the file.
    letters: BTreeMap<u16, (GlyphId, char)>,
    /// Columns, rows and levels.
    images: Vec<(u32, u32, Vec<u8>)>,
}

impl Page {
    /// Pixels from the upper left corner as points from the lower left.
    fn point(&self, (x, y): (f64, f64)) -> (f32, f32) {
        (x as f32 * self.scale, (self.height - y) as f32 * self.scale)
    }

    fn colour(&mut self, colour: Colour) {
        let [red, green, blue] = colour.map(|level| f32::from(level) / 255.0);
        self.content.set_fill_rgb(red, green, blue);
        self.content.set_stroke_rgb(red, green, blue);
    }

    fn rect(&mut self, [left, top, wide, high]: [f64; 4]) {
        let (x, y) = self.point((left, top + high));
        self.content.rect(x, y, wide as f32 * self.scale, high as f32 * self.scale);
    }

    fn path(&mut self, points: &[(f64, f64)]) {
        for (k, point) in points.iter().enumerate() {
            let (x, y) = self.point(*point);
            if k == 0 {
                self.content.move_to(x, y);
            } else {
                self.content.line_to(x, y);
            }
        }
    }

    fn draw(&mut self, shape: &Shape) {
        match shape {
            Shape::Box { at, colour } => {
                self.colour(*colour);
                self.rect(*at);
                self.content.fill_nonzero();
            }
            Shape::Line { points, width, dashes, colour } => {
                self.colour(*colour);
                self.content.set_line_width(*width as f32 * self.scale);
                self.content.set_line_join(LineJoinStyle::RoundJoin);
                let dashes = dashes.iter().map(|dash| *dash as f32 * self.scale);
                self.content.set_dash_pattern(dashes, 0.0);
                self.path(points);
                self.content.stroke();
            }
            Shape::Area { corners, colour } => {
                self.colour(*colour);
                self.path(corners);
                self.content.close_path();
                self.content.fill_nonzero();
            }
            Shape::Text { x, baseline, size, colour, text } => {
                self.colour(*colour);
                self.text((*x, *baseline), *size as f32, text);
            }
            Shape::Image { at, columns, levels, smooth } => {
                let (columns, levels) = enlarged(*columns, levels, *smooth);
                let rows = levels.len() as u32 / columns;
                let [left, top, wide, high] = at.map(f64::from);
                let (x, y) = self.point((left, top + high));
                let (wide, high) = (wide as f32 * self.scale, high as f32 * self.scale);
                let name = format!("I{}", self.images.len());
                self.content.save_state();
                self.content.transform([wide, 0.0, 0.0, high, x, y]);
                self.content.x_object(Name(name.as_bytes()));
                self.content.restore_state();
                self.images.push((columns, rows, levels));
            }
        }
    }

    fn text(&mut self, at: (f64, f64), size: f32, text: &str) {
        let (x, y) = self.point(at);
        self.content.begin_text();
        self.content.set_font(FONT_NAME, size * self.scale);
        self.content.set_text_matrix([1.0, 0.0, 0.0, 1.0, x, y]);
        let mut shown = self.content.show_positioned();
        let mut items = shown.items();
        for (letter, glyph, kern) in placed_glyphs(text, size) {
            if kern != 0.0 {
                // In thousandths of the font's size, to the left.
                items.adjust(-1000.0 * kern / size);
            }
            let id = self.glyphs.remap(glyph.0);
            self.letters.insert(id, (glyph, letter));
            items.show(Str(&id.to_be_bytes()));
        }
        items.finish();
        shown.finish();
        self.content.end_text();
    }

    fn finish(self, (wide, high): (f64, f64), provenance: &Provenance) -> Vec<u8> {
        let mut pdf = Pdf::new();
        pdf.catalog(CATALOG).pages(PAGES);
        pdf.pages(PAGES).kids([PAGE]).count(1);
        let images: Vec<Ref> =
            (0..self.images.len() as i32).map(|k| Ref::new(FIRST_IMAGE + k)).collect();
        let mut page = pdf.page(PAGE);
        page.media_box(Rect::new(0.0, 0.0, wide as f32, high as f32));
        page.parent(PAGES).contents(CONTENT);
        let mut resources = page.resources();
        resources.fonts().pair(FONT_NAME, FONT);
        let mut objects = resources.x_objects();
        for (k, id) in images.iter().enumerate() {
            objects.pair(Name(format!("I{k}").as_bytes()), *id);
        }
        objects.finish();
        resources.finish();
        page.finish();

        for ((columns, rows, levels), id) in self.images.iter().zip(&images) {
            let packed = packed(levels);
            let mut image = pdf.image_xobject(*id, &packed);
            image.filter(Filter::FlateDecode);
            image.width(*columns as i32).height(*rows as i32);
            image.color_space().device_gray();
            image.bits_per_component(8).interpolate(false);
        }
        pdf.stream(CONTENT, &packed(self.content.finish().as_slice())).filter(Filter::FlateDecode);
        embed(&mut pdf, &self.glyphs, &self.letters);
        let mut info = pdf.document_info(INFO);
        info.producer(TextStr(&provenance.software()));
        info.subject(TextStr(&provenance.to_string()));
        info.keywords(TextStr(&provenance.json()));
        info.finish();
        pdf.finish()
    }
}

/// Puts the glyphs that are used into the file.
fn embed(pdf: &mut Pdf, glyphs: &GlyphRemapper, letters: &BTreeMap<u16, (GlyphId, char)>) {
    let font: &FontRef<'_> = Font::sans();
    let per_em = 1000.0 / font.units_per_em().unwrap_or(1000.0);
    pdf.type0_font(FONT)
        .base_font(BASE_FONT)
        .encoding_predefined(Name(b"Identity-H"))
        .descendant_font(CID_FONT)
        .to_unicode(UNICODE);
    let mut cid = pdf.cid_font(CID_FONT);
    cid.subtype(CidFontType::Type2).base_font(BASE_FONT).system_info(REGISTRY);
    cid.font_descriptor(DESCRIPTOR).default_width(0.0);
    cid.cid_to_gid_map_predefined(Name(b"Identity"));
    let mut widths = cid.widths();
    for (id, (glyph, _)) in letters {
        widths.same(*id, *id, font.h_advance_unscaled(*glyph) * per_em);
    }
    widths.finish();
    cid.finish();
    let (ascent, descent) = (font.ascent_unscaled() * per_em, font.descent_unscaled() * per_em);
    pdf.font_descriptor(DESCRIPTOR)
        .name(BASE_FONT)
        .flags(FontFlags::NON_SYMBOLIC)
        .bbox(Rect::new(-200.0, descent, 2000.0, ascent))
        .italic_angle(0.0)
        .ascent(ascent)
        .descent(descent)
        .cap_height(0.74 * ascent)
        .stem_v(60.0)
        .font_file2(FONT_FILE);
    let part = subsetter::subset(epaint_default_fonts::UBUNTU_LIGHT, 0, glyphs)
        .expect("the embedded font is whole: every test that draws relies on it");
    pdf.stream(FONT_FILE, &packed(&part))
        .filter(Filter::FlateDecode)
        .pair(Name(b"Length1"), part.len() as i32);
    let mut unicode = UnicodeCmap::new(Name(b"NIRSPI"), REGISTRY);
    for (id, (_, letter)) in letters {
        unicode.pair(*id, *letter);
    }
    pdf.cmap(UNICODE, unicode.finish().as_slice());
}

fn packed(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
    let written = encoder.write_all(bytes).and_then(|()| encoder.finish());
    written.expect("bytes are packed into memory")
}

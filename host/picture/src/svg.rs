//! A drawing as SVG: texts are text, images are PNG files inside it.

use super::drawing::{Drawing, Shape, enlarged};
use super::look::Colour;
use super::text;
use data_encoding::BASE64;
use nirspi_files::provenance::Provenance;
use std::fmt::Write;

impl Drawing {
    /// The drawing as SVG, with its provenance in words and as JSON.
    #[must_use]
    pub fn svg(&self, provenance: &Provenance) -> String {
        let (width, height) = self.size();
        let mm = |px: u32| f64::from(px) / self.dpi * 25.4;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{:.2}mm\" height=\"{:.2}mm\" \
             viewBox=\"0 0 {width} {height}\" font-family=\"'Ubuntu Light', Ubuntu, Arial, 'DejaVu Sans', \
             sans-serif\">\n<desc>{}</desc>\n<metadata>{}</metadata>\n\
             <rect width=\"{width}\" height=\"{height}\" fill=\"{}\"/>\n",
            mm(width),
            mm(height),
            escaped(&provenance.to_string()),
            escaped(&provenance.json()),
            hex(self.ground),
        );
        for shape in &self.shapes {
            // A `String` takes everything.
            let _ = write_shape(&mut svg, shape);
        }
        svg.push_str("</svg>\n");
        svg
    }
}

fn write_shape(svg: &mut String, shape: &Shape) -> std::fmt::Result {
    let list = |points: &[(f64, f64)]| {
        let points: Vec<String> = points.iter().map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
        points.join(" ")
    };
    match shape {
        Shape::Box { at: [x, y, wide, high], colour } => writeln!(
            svg,
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{wide:.1}\" height=\"{high:.1}\" fill=\"{}\"/>",
            hex(*colour)
        ),
        Shape::Line { points, width, dashes, colour } => {
            let dashes: Vec<String> = dashes.iter().map(|dash| format!("{dash:.1}")).collect();
            let dashed = match dashes.is_empty() {
                true => String::new(),
                false => format!(" stroke-dasharray=\"{}\"", dashes.join(" ")),
            };
            writeln!(
                svg,
                "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{width:.1}\" \
                 stroke-linejoin=\"round\"{dashed}/>",
                list(points),
                hex(*colour)
            )
        }
        Shape::Area { corners, colour } => {
            writeln!(svg, "<polygon points=\"{}\" fill=\"{}\"/>", list(corners), hex(*colour))
        }
        Shape::Text { x, baseline, size, colour, text } => writeln!(
            svg,
            "<text x=\"{x:.1}\" y=\"{baseline:.1}\" font-size=\"{size:.2}\" textLength=\"{:.1}\" \
             lengthAdjust=\"spacingAndGlyphs\" fill=\"{}\" xml:space=\"preserve\">{}</text>",
            text::width(text, *size),
            hex(*colour),
            escaped(text)
        ),
        Shape::Image { at: [x, y, wide, high], columns, levels, smooth } => {
            let (columns, levels) = enlarged(*columns, levels, *smooth);
            let rendering = if *smooth { "auto" } else { "pixelated" };
            writeln!(
                svg,
                "<image x=\"{x}\" y=\"{y}\" width=\"{wide}\" height=\"{high}\" \
                 preserveAspectRatio=\"none\" image-rendering=\"{rendering}\" \
                 href=\"data:image/png;base64,{}\"/>",
                BASE64.encode(&grey_png(columns, &levels))
            )
        }
    }
}

/// The bytes of a grey PNG.
fn grey_png(columns: u32, levels: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let encoded = (|| {
        let mut encoder = png::Encoder::new(&mut bytes, columns, levels.len() as u32 / columns);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_compression(png::Compression::High);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(levels)?;
        writer.finish()
    })();
    encoded.expect("an image of at least one pixel encodes into memory");
    bytes
}

fn hex([red, green, blue]: Colour) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

pub(super) fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            // XML has no other control characters.
            c if c.is_control() => escaped.push(' '),
            c => escaped.push(c),
        }
    }
    escaped
}

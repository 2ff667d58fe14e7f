//! The provenance of a PNG, in text chunks: the keywords of the PNG specification for people and for
//! other programs, and everything as JSON under [`KEY`].

use super::{EXPECTED, FileError, open_file};
use crate::provenance::{KEY, Provenance};
use std::io::{BufRead, BufReader, Seek, Write};
use std::path::Path;

/// Adds the provenance to a picture that is not yet begun.
pub fn sign<W: Write>(
    encoder: &mut png::Encoder<'_, W>,
    provenance: &Provenance,
) -> Result<(), png::EncodingError> {
    // These chunks hold Latin-1.
    let latin = |text: String| {
        text.chars().map(|letter| if letter > '\u{ff}' { '?' } else { letter }).collect()
    };
    for (keyword, text) in [
        ("Software", provenance.software()),
        ("Creation Time", provenance.made.date.clone()),
        ("Source", provenance.source()),
        (KEY, provenance.json()),
    ] {
        encoder.add_text_chunk(keyword.to_owned(), latin(text))?;
    }
    Ok(())
}

/// The provenance of a PNG; `None` for a picture of another program.
///
/// # Errors
/// [`FileError`] if the file cannot be read, is no PNG, or states a damaged provenance.
pub fn provenance_of(path: &Path) -> Result<Option<Provenance>, FileError> {
    let (file, _) = open_file(path, EXPECTED)?;
    let wrong = |found: String| FileError::kind(path, found, EXPECTED);
    let text = text_of(BufReader::new(file), KEY).map_err(|error| wrong(error.to_string()))?;
    text.map(|text| serde_json::from_str(&text))
        .transpose()
        .map_err(|error| wrong(format!("a damaged provenance: {error}")))
}

/// The text of this key in a PNG, which is read up to its first pixel.
pub(super) fn text_of(
    stream: impl BufRead + Seek,
    key: &str,
) -> Result<Option<String>, png::DecodingError> {
    let limits = png::Limits { bytes: 1 << 20 };
    let reader = png::Decoder::new_with_limits(stream, limits).read_info()?;
    let texts = &reader.info().uncompressed_latin1_text;
    Ok(texts.iter().find(|text| text.keyword == key).map(|text| text.text.clone()))
}

//! Opens plain files, reads text, and tells kinds of files apart.

use super::FileError;
#[cfg(not(target_family = "wasm"))]
use std::borrow::Cow;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// The first bytes of a NumPy array.
pub(super) const NUMPY: &[u8; 6] = b"\x93NUMPY";

/// The most memory that the numbers of a file take: a field of measurements, or a picture with its grey levels.
pub const MAX_MEMORY_BYTES: u64 = 512 << 20;

/// Opens a plain file. Every error names the path.
pub(super) fn open_file(path: &Path, expected: &'static str) -> Result<(File, u64), FileError> {
    let read = |error| FileError::io(path, "read", error);
    // The kind of file is checked before opening, because opening a named pipe would wait for a
    // writer.
    let metadata = std::fs::metadata(path).map_err(read)?;
    if metadata.is_dir() {
        return Err(FileError::kind(path, "a folder", expected));
    }
    if !metadata.is_file() {
        return Err(FileError::kind(path, "a device or pipe", expected));
    }
    if metadata.len() == 0 {
        return Err(FileError::kind(path, "an empty file", expected));
    }
    Ok((File::open(path).map_err(read)?, metadata.len()))
}

/// Opens a plain file and reads its first bytes; it is then at its first byte again. Every error names the path.
#[cfg(not(target_family = "wasm"))]
pub(super) fn open_start(
    path: &Path,
    expected: &'static str,
    most: usize,
) -> Result<(File, u64, Vec<u8>), FileError> {
    let (mut file, length) = open_file(path, expected)?;
    let mut start = Vec::new();
    let read = file.by_ref().take(most as u64).read_to_end(&mut start);
    let read = read.and_then(|_| std::io::Seek::rewind(&mut file));
    read.map_err(|error| FileError::io(path, "read", error))?;
    Ok((file, length, start))
}

/// Largest text file of numbers that is read: a table of 100 000 rows of four numbers is 4 MB.
const MAX_TEXT_MIB: u64 = 4;
/// Largest text file of measurements: 32 sweeps of 256 x 256 pairs with 20 characters a reading are
/// 84 MB.
#[cfg(not(target_family = "wasm"))]
const MAX_LARGE_TEXT_MIB: u64 = 256;

/// Reads a plain text file of at most 4 MiB: UTF-16 where it begins with the mark of UTF-16, else UTF-8, without the
/// mark.
///
/// # Errors
/// [`FileError`] naming the path, if the file cannot be read or is no text; `expected` says what it should be.
pub fn read_text(path: &Path, expected: &'static str) -> Result<String, FileError> {
    let bytes = read_bytes(path, expected, MAX_TEXT_MIB)?;
    decode(bytes).map_err(|NotText(found)| FileError::kind(path, found, expected))
}

/// Reads a plain text file of at most 256 MiB, by [`decode`]. Every error names the path. A heading
/// may be in another code page than UTF-8.
#[cfg(not(target_family = "wasm"))]
pub(super) fn read_large_text(path: &Path, expected: &'static str) -> Result<String, FileError> {
    let bytes = read_bytes(path, expected, MAX_LARGE_TEXT_MIB)?;
    match UTF_16_MARKS.iter().any(|mark| bytes.starts_with(mark)) {
        true => decode(bytes).map_err(|NotText(found)| FileError::kind(path, found, expected)),
        false => Ok(without_mark(
            String::from_utf8(bytes)
                .unwrap_or_else(|error| String::from_utf8_lossy(error.as_bytes()).into_owned()),
        )),
    }
}

/// The largest file that [`read_small`] reads. The bitstream of the largest ECP5 has 2 MB.
const MAX_SMALL_BYTES: u64 = 32 << 20;

/// The bytes of a file of at most 32 MiB: descriptions, calibrations, bitstreams. A pipe is refused,
/// because opening a pipe waits for a writer, and so is a device, which may never end.
///
/// # Errors
/// The system's error; [`ErrorKind::InvalidInput`](std::io::ErrorKind::InvalidInput) for anything
/// but a file of that size.
pub fn read_small(path: &Path) -> std::io::Result<Vec<u8>> {
    read_at_most(path, MAX_SMALL_BYTES)
}

/// As [`read_small`], with another limit.
///
/// # Errors
/// As [`read_small`].
pub fn read_at_most(path: &Path, most_bytes: u64) -> std::io::Result<Vec<u8>> {
    use std::io::{Error, ErrorKind};
    let metadata = std::fs::metadata(path)?;
    if metadata.is_dir() {
        return Err(ErrorKind::IsADirectory.into());
    }
    if !metadata.is_file() {
        return Err(Error::new(ErrorKind::InvalidInput, "a device or pipe, expected a file"));
    }
    let mut bytes = Vec::new();
    // A file may grow meanwhile.
    if metadata.len() <= most_bytes {
        File::open(path)?.take(most_bytes + 1).read_to_end(&mut bytes)?;
    }
    if metadata.len().max(bytes.len() as u64) > most_bytes {
        let reason = match most_bytes >> 20 {
            0 => format!("more than {most_bytes} bytes"),
            mebibytes => format!("more than {mebibytes} MiB"),
        };
        return Err(Error::new(ErrorKind::InvalidInput, reason));
    }
    Ok(bytes)
}

/// The text of a file that [`read_small`] reads, in UTF-8 or, by its mark, in UTF-16.
///
/// # Errors
/// As [`read_small`]; [`ErrorKind::InvalidData`](std::io::ErrorKind::InvalidData) for a file that is
/// not text.
pub fn read_small_text(path: &Path) -> std::io::Result<String> {
    use std::io::{Error, ErrorKind};
    decode(read_small(path)?)
        .map_err(|NotText(found)| Error::new(ErrorKind::InvalidData, format!("it is {found}")))
}

/// What is found in place of text, for an error message.
#[derive(Debug)]
struct NotText(&'static str);

/// The byte-order mark of a text, which programs on Windows write.
const MARK: char = '\u{feff}';
/// [`MARK`] in UTF-16, the low byte first and the high byte first.
const UTF_16_MARKS: [[u8; 2]; 2] = [[0xff, 0xfe], [0xfe, 0xff]];

/// The text of these bytes, without its byte-order mark: UTF-16 where they begin with the mark of
/// UTF-16 (what `>` writes in Windows PowerShell 5.1, and Excel's "Unicode text"), else UTF-8.
fn decode(bytes: Vec<u8>) -> Result<String, NotText> {
    let Some(order) = UTF_16_MARKS.iter().position(|mark| bytes.starts_with(mark)) else {
        let text = String::from_utf8(bytes);
        return text.map(without_mark).map_err(|_| NotText("a binary file"));
    };
    let (pairs, []) = bytes[2..].as_chunks::<2>() else {
        return Err(NotText("text in UTF-16 that ends within a character"));
    };
    let units = pairs.iter().map(|&pair| match order {
        0 => u16::from_le_bytes(pair),
        _ => u16::from_be_bytes(pair),
    });
    let text = char::decode_utf16(units).collect::<Result<String, _>>();
    text.map_err(|_| NotText("a binary file that begins as text in UTF-16 does"))
}

/// The text that a file with these first bytes begins with, if the file is text.
#[cfg(not(target_family = "wasm"))]
pub(super) fn start_of_text(start: &[u8]) -> Cow<'_, [u8]> {
    if UTF_16_MARKS.iter().any(|mark| start.starts_with(mark)) {
        let text = decode(start[..start.len() & !1].to_vec()).unwrap_or_default();
        return Cow::Owned(text.into_bytes());
    }
    Cow::Borrowed(start.strip_prefix(MARK.to_string().as_bytes()).unwrap_or(start))
}

fn without_mark(text: String) -> String {
    match text.strip_prefix(MARK) {
        Some(rest) => rest.to_owned(),
        None => text,
    }
}

/// Whether these words of a text's first line are the names of its columns: each begins with what
/// no number begins with, and one has a letter. A first number that cannot be read is then an
/// error, and is not left out as a heading.
pub(super) fn is_heading<'w>(words: impl Iterator<Item = &'w str> + Clone) -> bool {
    let begins_as_number =
        |word: &str| word.starts_with(|c: char| c.is_ascii_digit() || "+-.,".contains(c));
    let mut names = words.clone().map(|word| word.trim_start_matches(['"', ' ']));
    let mut letters = words.flat_map(str::chars);
    names.all(|word| word.parse::<f64>().is_err() && !begins_as_number(word))
        && letters.any(char::is_alphabetic)
}

fn read_bytes(path: &Path, expected: &'static str, most_mib: u64) -> Result<Vec<u8>, FileError> {
    let (file, length) = open_file(path, expected)?;
    let mut bytes = Vec::with_capacity(length.min(most_mib << 20) as usize + 1);
    file.take((most_mib << 20) + 1)
        .read_to_end(&mut bytes)
        .map_err(|error| FileError::io(path, "read", error))?;
    match bytes.len() as u64 <= most_mib << 20 {
        true => Ok(bytes),
        false => Err(FileError::kind(path, format!("more than {most_mib} MiB"), expected)),
    }
}

/// The kind of a file of another program by its first bytes, or else by the end of its name: some programs change the first
/// bytes with each version.
#[cfg(not(target_family = "wasm"))]
pub(super) fn kind_of(path: &Path, start: &[u8]) -> &'static str {
    const ENDS: &[(&str, &str)] = &[
        ("wfm", "a waveform file (.wfm; save it as CSV)"),
        ("isf", "a waveform file of Tektronix (.isf; save it as CSV)"),
        ("tdms", "a TDMS file of LabVIEW that is damaged"),
        ("psdata", "a file of PicoScope (.psdata; save it as CSV or MATLAB)"),
        ("pt", "tensors of PyTorch (save the array with NumPy)"),
        ("pth", "tensors of PyTorch (save the array with NumPy)"),
        ("pkl", "a pickle of Python (save its array with NumPy)"),
        ("pickle", "a pickle of Python (save its array with NumPy)"),
        ("bin", "a file of another kind, or numbers without a heading (nirspi readings --raw)"),
        ("dat", "a file of another kind, or numbers without a heading (nirspi readings --raw)"),
        ("raw", "a file of another kind, or numbers without a heading (nirspi readings --raw)"),
    ];
    let by_start = kind_by_start(start);
    if by_start != UNKNOWN {
        return by_start;
    }
    let end = path.extension().and_then(|end| end.to_str()).unwrap_or_default();
    let by_end = ENDS.iter().find(|(known, _)| end.eq_ignore_ascii_case(known));
    by_end.map_or(UNKNOWN, |&(_, kind)| kind)
}

/// The kind of a text that other programs read, and that holds no table.
#[cfg(not(target_family = "wasm"))]
pub(super) fn kind_of_text(start: &[u8]) -> Option<&'static str> {
    let begins = |begin: &&[u8]| start.starts_with(begin);
    // Of protocol 0, which Python 2 writes.
    const PICKLES: [&[u8]; 5] = [b"(lp", b"(dp", b"(tp", b"cnumpy", b"ccopy_reg"];
    if PICKLES.iter().any(begins) {
        return Some("a pickle of Python (save its array with NumPy)");
    }
    let text: Vec<u8> =
        start.iter().copied().filter(|byte| !byte.is_ascii_whitespace()).take(2).collect();
    (text == b"{\"" || text == b"[{").then_some("a JSON text (save its numbers as CSV)")
}

/// A file of a kind that is not known.
const UNKNOWN: &str = "a file of another kind";

/// The kind of a file by its first bytes. An error message uses the kind to tell a user which file
/// was chosen by mistake.
pub(super) fn kind_by_start(start: &[u8]) -> &'static str {
    if is_mat_4(start) {
        return "a MATLAB file";
    }
    if start.starts_with(b"RIFF") && start.get(8..12) == Some(b"WAVE") {
        return "a WAV file";
    }
    const KINDS: &[(&[u8], &str)] = &[
        (b"PK", "a zip archive"),
        (NUMPY, "a single NumPy array (.npy)"),
        (b"\x89PNG", "a PNG image"),
        (b"\xff\xd8\xff", "a JPEG image"),
        (b"\x89HDF", "an HDF5 file"),
        (b"\x89MCAP", "a recording (MCAP)"),
        (b"MATLAB", "a MATLAB file"),
        (b"\x1f\x8b", "a gzip file (unpack it)"),
        (
            b"TDSm",
            "a TDMS file of LabVIEW (two lines of Python make an .npz file of it: docs/measurements.md, Traces)",
        ),
        (b":WFM", "a waveform file of Tektronix (.isf; save it as CSV)"),
        (b"\x0f\x0f:WFM", "a waveform file of Tektronix (.wfm; save it as CSV)"),
        (b"\xf0\xf0:WFM", "a waveform file of Tektronix (.wfm; save it as CSV)"),
        (b"\xd0\xcf\x11\xe0", "an old workbook of Excel (.xls; save it as CSV)"),
        (b"\xa5\xa5", "a waveform file (.wfm; save it as CSV)"),
        (b"PAR1", "a Parquet file (save it as CSV)"),
        (b"II*\0", "a TIFF image"),
        (b"MM\0*", "a TIFF image"),
        (b"%PDF", "a PDF document"),
    ];
    match start {
        [0x80, 2, 0x8a, b'\n', ..] => return "tensors of PyTorch (save the array with NumPy)",
        [0x80, 2..=5, ..] => return "a pickle of Python (save its array with NumPy)",
        _ if start.windows(8).any(|word| word == b"WAVEDESC") => {
            return "a waveform file of LeCroy (.trc; save it as CSV)";
        }
        // The short form of the heading that oscilloscopes send.
        _ if start.windows(6).any(|word| word == b"BIT_N " || word == b"BIT_NR") => {
            return "a waveform file of Tektronix (.isf; save it as CSV)";
        }
        _ => {}
    }
    KINDS.iter().find(|(magic, _)| start.starts_with(magic)).map_or(UNKNOWN, |&(_, kind)| kind)
}

/// Whether a file with these first bytes is a MATLAB file of level 4: five words, of which the first is the form of the
/// numbers (MOPT), the fourth says whether they are complex, and the fifth is the length of the name that follows
/// with a zero at its end.
///
/// Format: MathWorks, *MAT-File Format*, R2023a, "Level 4 MAT-Files".
pub(super) fn is_mat_4(start: &[u8]) -> bool {
    let word =
        |at: usize, of: fn([u8; 4]) -> u32| Some(of(start[4 * at..].first_chunk().copied()?));
    let head = |of: fn([u8; 4]) -> u32, order: u32| {
        let [form, _, _, is_complex, name] = [0, 1, 2, 3, 4].map(|at| word(at, of));
        let (form, name) = (form?, name? as usize);
        let [thousands, hundreds, tens, ones] =
            [form / 1000, form / 100 % 10, form / 10 % 10, form % 10];
        let is_form = thousands == order && hundreds == 0 && tens <= 5 && ones <= 2;
        let name = start.get(20..20_usize.checked_add(name)?)?;
        let is_name = name.split_last().is_some_and(|(end, name)| {
            *end == 0
                && !name.is_empty()
                && name.iter().all(|c| c.is_ascii_alphanumeric() || *c == b'_')
        });
        Some(is_form && is_complex? <= 1 && is_name)
    };
    start.len() >= 20
        && (head(u32::from_le_bytes, 0) == Some(true) || head(u32::from_be_bytes, 1) == Some(true))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::file;
    use proptest::prelude::*;

    fn utf_16(text: &str, bytes_of: fn(u16) -> [u8; 2]) -> Vec<u8> {
        format!("{MARK}{text}").encode_utf16().flat_map(bytes_of).collect()
    }

    proptest! {
        /// A law of every reader of text, because all of them read by these two functions.
        #[test]
        fn text_is_the_same_with_a_mark_and_in_utf_16(text in "[^\u{feff}]\\PC{0,40}") {
            let marked = format!("{MARK}{text}").into_bytes();
            for bytes in [
                text.clone().into_bytes(),
                marked,
                utf_16(&text, u16::to_le_bytes),
                utf_16(&text, u16::to_be_bytes),
            ] {
                let (_folder, path) = file("a.txt", &bytes);
                prop_assert_eq!(&read_text(&path, "text").unwrap(), &text);
                prop_assert_eq!(&read_large_text(&path, "text").unwrap(), &text);
                prop_assert_eq!(&read_small_text(&path).unwrap(), &text);
            }
        }
    }

    #[test]
    fn files_of_other_programs_are_named_with_what_to_do() {
        for (start, kind) in [
            (&b"\x80\x02\x8a\nl\xfc\x9cF"[..], "tensors of PyTorch (save the array with NumPy)"),
            (b"\x80\x03cnumpy", "a pickle of Python (save its array with NumPy)"),
            (b"#9000001024WAVEDESC", "a waveform file of LeCroy (.trc; save it as CSV)"),
            (b"\xa5\xa5\xa4\x01", "a waveform file (.wfm; save it as CSV)"),
            (b"BYT_N 2;BIT_N 16;ENC BIN", "a waveform file of Tektronix (.isf; save it as CSV)"),
            (b"PAR1\x15", "a Parquet file (save it as CSV)"),
            (b"\x80\x01", "a file of another kind"),
        ] {
            assert_eq!(kind_by_start(start), kind);
        }
        // By the end of the name where the bytes say nothing.
        for (name, kind) in [
            ("a.WFM", "a waveform file (.wfm; save it as CSV)"),
            ("a.psdata", "a file of PicoScope (.psdata; save it as CSV or MATLAB)"),
            ("adc.bin", "numbers without a heading (nirspi readings --raw)"),
            ("a.thing", "a file of another kind"),
        ] {
            let found = kind_of(Path::new(name), b"\x01\xff\x01\xff");
            assert!(found.ends_with(kind), "{name}: {found}");
        }
        assert_eq!(kind_of(Path::new("a.wfm"), b"\x89PNG"), "a PNG image");
        for (start, kind) in [
            (&b"(lp0\nF83.7"[..], "a pickle of Python"),
            (b"cnumpy.core.multiarray\n_reconstruct", "a pickle of Python"),
            (b"{\n \"y\": [1, 2]}", "a JSON text"),
            (b"[ {\"y\": 1}]", "a JSON text"),
        ] {
            assert!(kind_of_text(start).is_some_and(|found| found.starts_with(kind)));
        }
        for table in [&b"{1,2.5}"[..], b"[[1, 2]]", b"(1, 2)", b"\"t\",y\n", b"", b"l,d"] {
            assert_eq!(kind_of_text(table), None);
        }
    }

    #[test]
    fn what_begins_as_utf_16_and_is_not_is_refused() {
        for (bytes, found) in [
            (&b"\xff\xfe1\x002"[..], "ends within a character"),
            (b"\xfe\xff\xd8\x00\x00a", "a binary file that begins as text in UTF-16"),
            (b"\xc3\x28", "a binary file"),
        ] {
            let (_folder, path) = file("a.txt", bytes);
            let message = read_text(&path, "text").unwrap_err().to_string();
            assert!(message.contains(found), "{message}");
            let message = read_small_text(&path).unwrap_err().to_string();
            assert!(message.contains(found), "{message}");
        }
    }

    #[test]
    fn a_number_that_cannot_be_read_is_no_heading() {
        for heading in ["place,ml", "\"U in V\",t", "µs,y", "(mm),ml", "T,#"] {
            assert!(is_heading(heading.split(',')), "{heading}");
        }
        for numbers in ["1.5", "1.5.2", "8 ml,left", "-,left", "--,..", "left,8", "nan,x", "#,#"] {
            assert!(!is_heading(numbers.split(',')), "{numbers}");
        }
    }
}

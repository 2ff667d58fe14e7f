//! Reads numbers in a text file of a spreadsheet or a logger: `.csv`, `.txt`, with decimal points
//! or commas.
//!
//! # Invariant
//! A comma is never guessed to be a decimal comma
//! (`tests::a_decimal_comma_is_seen_where_the_file_shows_it_and_asked_for_where_not`). A comma is
//! decimal only if the user says so, or if the file shows it in one of three ways: numbers are
//! separated by semicolons, tabs or blanks; a number has digits that a whole number does not have,
//! as in `0,05` or `1,5E-3`; some numbers of a line have commas and others have none. One comma a
//! line, under a heading with one comma, separates two columns.

mod export;

use super::FileError;
use super::field::{EXPECTED, Field};
use super::plain::{is_heading, read_large_text, start_of_text};
use std::path::Path;

/// Words for a reading that was not taken.
const UNREAD: [&str; 10] =
    ["nan", "null", "na", "none", "#n/a", "n/a", "#num!", "-1.#ind", "1.#qnan", "-nan"];

/// Words for a reading beyond what an instrument measures.
const OVERLOADED: [&str; 5] = ["∞", "+∞", "ol", "ovld", "overload"];

/// What instruments write themselves for such a reading.
const OVERLOAD: f64 = 9.9e37;

/// What a text file holds.
pub(super) struct Text {
    pub(super) numbers: Numbers,
    /// What was left out, in one line.
    pub(super) skipped: Option<String>,
}

/// The numbers of a text file.
pub(super) enum Numbers {
    /// Columns with names from a heading.
    Columns(Vec<(String, Field)>),
    /// Rows of numbers without names.
    Table(Field),
}

/// Whether a file with these first bytes is text.
pub(super) fn is_start(start: &[u8]) -> bool {
    let text = &*start_of_text(start);
    // Beside letters and digits; pandas leaves the name of its first column empty.
    const BEGIN: &[u8] = b"#+-.\"%_,;([";
    !text.is_empty() && text.iter().all(|&b| b >= b' ' && b != 0x7f || b"\t\r\n".contains(&b)) && {
        let first = text.iter().position(|b| !b.is_ascii_whitespace());
        first.is_some_and(|at| text[at].is_ascii_alphanumeric() || BEGIN.contains(&text[at]))
    }
}

/// Reads a file. With `decimal_comma`, every comma is a decimal comma. A text that is no plain table may
/// [have one in it](export).
pub(super) fn read(path: &Path, decimal_comma: bool) -> Result<Text, FileError> {
    let text = read_large_text(path, EXPECTED)?;
    // Lines that end as on an old Macintosh.
    let text = if text.contains('\n') { text } else { text.replace('\r', "\n") };
    let lines: Vec<(usize, &str)> = text
        .lines()
        .enumerate()
        // A tab at the end of a line may close an empty cell.
        .map(|(at, line)| (at + 1, line.trim_start().trim_end_matches([' ', '\r'])))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with(['#', '%']))
        // Spreadsheets tell each other the separator.
        .filter(|&(at, line)| at > 1 || !line.to_ascii_lowercase().starts_with("sep="))
        .collect();
    let refused = match plain(path, &lines, decimal_comma) {
        Ok(numbers) => return Ok(Text { numbers, skipped: None }),
        Err(error) => error,
    };
    let Some(found) = export::find(path, &lines, decimal_comma) else { return Err(refused) };
    let export::Found { columns, names, skipped } = found?;
    let numbers = match names {
        Some(names) => Numbers::Columns(names.into_iter().zip(columns).collect()),
        None => {
            let (height, width) = (columns[0].real.len(), columns.len());
            let row = |at: usize| columns.iter().map(move |column| column.real[at]);
            let real = (0..height).flat_map(row).collect();
            Numbers::Table(Field { shape: vec![height, width], real, imaginary: None })
        }
    };
    Ok(Text { numbers, skipped })
}

/// The numbers of a plain table: a heading if there is one, and lines of numbers.
fn plain(path: &Path, lines: &[(usize, &str)], decimal_comma: bool) -> Result<Numbers, FileError> {
    let wrong = |line: usize, found: String, expected: &str| {
        FileError::field(path, "table", format!("has {found} in line {line}"), expected)
    };
    let names_columns = |(_, line): &(usize, &str)| {
        let words = line.split([',', ';', '\t', ' ']).filter(|word| !word.is_empty());
        is_heading(words.clone()) && words.clone().all(|word| parse(word, '.').is_none())
    };
    let (heading, body) = match lines.split_first() {
        Some((first, body)) if names_columns(first) => (Some(first.1), body),
        _ => (None, lines),
    };
    if body.is_empty() {
        return Err(FileError::kind(path, "a text file without numbers", EXPECTED));
    }
    let separators = Separators::of(path, heading, body, decimal_comma)?;
    let mut rows: Vec<Vec<f64>> = Vec::new();
    for &(line, content) in body {
        let row = separators
            .split(content)
            .map(|word| {
                let number = parse(word, separators.decimal);
                number.ok_or_else(|| wrong(line, format!("{:?}", shortened(word)), "a number"))
            })
            .collect::<Result<Vec<f64>, _>>()?;
        if let Some(first) = rows.first()
            && first.len() != row.len()
        {
            let expected = format!("{} as in the lines before", first.len());
            return Err(wrong(line, format!("{} numbers", row.len()), &expected));
        }
        rows.push(row);
    }
    let (height, width) = (rows.len(), rows[0].len());
    let names: Option<Vec<String>> = heading.map(|heading| {
        separators.split(heading).map(|name| name.trim_matches('"').to_owned()).collect()
    });
    Ok(match names.filter(|names| names.len() == width) {
        Some(names) => Numbers::Columns(
            names
                .into_iter()
                .enumerate()
                .map(|(at, name)| {
                    let real = rows.iter().map(|row| row[at]).collect();
                    (name, Field { shape: vec![height], real, imaginary: None })
                })
                .collect(),
        ),
        None => Numbers::Table(Field {
            shape: vec![height, width],
            real: rows.concat(),
            imaginary: None,
        }),
    })
}

/// The separator between numbers, and the decimal mark.
struct Separators {
    /// The separator; `None` means any blank.
    between: Option<char>,
    decimal: char,
    /// Whether every line ends with the separator. The last separator then closes the line and
    /// starts no further number.
    closes: bool,
}

impl Separators {
    fn of(
        path: &Path,
        heading: Option<&str>,
        body: &[(usize, &str)],
        decimal_comma: bool,
    ) -> Result<Self, FileError> {
        let has = |mark: char| body.iter().any(|(_, line)| line.contains(mark));
        let between = [';', '\t'].into_iter().find(|&mark| has(mark));
        let decimal = |between: Option<char>, decimal| {
            let ends = |mark| body.iter().all(|(_, line)| line.ends_with(mark));
            Ok(Self { between, decimal, closes: between.is_some_and(ends) })
        };
        if decimal_comma {
            return decimal(between, ',');
        }
        if !has(',') {
            return decimal(between, '.');
        }
        if has('.') {
            return match between {
                None => decimal(Some(','), '.'),
                Some(_) => Err(FileError::field(
                    path,
                    "table",
                    "has points and commas in its numbers",
                    "decimal points, or decimal commas with --decimal-comma",
                )),
            };
        }
        let blanks = body.iter().any(|(_, line)| {
            // A blank that does not follow a comma separates two numbers.
            line.split_whitespace().rev().skip(1).any(|word| !word.ends_with(','))
        });
        if between.is_some() || blanks {
            return decimal(between, ',');
        }
        let commas: Vec<usize> = body.iter().map(|(_, line)| line.matches(',').count()).collect();
        if commas.iter().all(|&count| count <= 1) {
            let shows_decimals = |(_, line): &(usize, &str)| {
                line.split_once(',').is_some_and(|(whole, part)| {
                    let part = part.trim();
                    whole.trim() == "-0"
                        || part.contains(['e', 'E'])
                        || part.len() > 1 && part.starts_with('0')
                })
            };
            if commas.contains(&0) || body.iter().any(shows_decimals) {
                return decimal(None, ',');
            }
            // Two names head two columns.
            if heading.is_some_and(|heading| heading.matches(',').count() == 1) {
                return decimal(Some(','), '.');
            }
            return Err(FileError::field(
                path,
                "table",
                "has one comma a line, which is a decimal comma or parts two columns",
                "--decimal-comma, or numbers parted by semicolons",
            ));
        }
        decimal(Some(','), '.')
    }

    fn split<'l>(&self, line: &'l str) -> impl Iterator<Item = &'l str> + use<'l> {
        let between = self.between;
        let closing = between.filter(|_| self.closes);
        let line = closing.map_or(line, |mark| line.strip_suffix(mark).unwrap_or(line));
        line.split(move |c: char| between.map_or(c.is_whitespace(), |mark| c == mark))
            .map(str::trim)
            .filter(move |word| between.is_some() || !word.is_empty())
    }
}

/// The number that a word states, with the point or comma of its decimals; NaN for a reading that was not
/// taken, 9.9e37 for one beyond what an instrument measures.
pub(super) fn parse(word: &str, decimal: char) -> Option<f64> {
    let word = word.trim_matches('"');
    if let Some(number) = plain_number(word, decimal) {
        return Some(number);
    }
    let lower = word.to_lowercase();
    if word.is_empty() || UNREAD.contains(&lower.as_str()) {
        return Some(f64::NAN);
    }
    if OVERLOADED.contains(&lower.as_str()) {
        return Some(OVERLOAD);
    }
    if lower == "-∞" || lower == "−∞" {
        return Some(-OVERLOAD);
    }
    // What NumPy 2 prints, and Fortran's exponents.
    let printed = ["np.float64(", "np.float32(", "np.int64("].iter();
    let inner = printed.filter_map(|by| lower.strip_prefix(by)?.strip_suffix(')')).next();
    let plain = inner.unwrap_or(&lower).replace('−', "-");
    let is_exponent = plain.contains(|c: char| c.is_ascii_digit()) && plain.contains('d');
    plain_number(&if is_exponent { plain.replacen('d', "e", 1) } else { plain }, decimal)
}

fn plain_number(word: &str, decimal: char) -> Option<f64> {
    match decimal {
        '.' => word.parse().ok(),
        _ if word.contains('.') => None,
        _ => word.replacen(decimal, ".", 1).parse().ok(),
    }
}

fn shortened(word: &str) -> String {
    word.chars().take(40).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{file, line};

    fn table(content: &str) -> (Vec<usize>, Vec<f64>) {
        let (_folder, path) = file("y.txt", content.as_bytes());
        match read(&path, false).unwrap().numbers {
            Numbers::Table(field) => (field.shape, field.real),
            Numbers::Columns(columns) => panic!("{columns:?}"),
        }
    }

    #[test]
    fn numbers_are_read_however_a_spreadsheet_writes_them() {
        assert_eq!(table("1.5\n-2\n3e-1\n"), (vec![3, 1], vec![1.5, -2.0, 0.3]));
        assert_eq!(table("1.5, 2\n3,4.5\n"), (vec![2, 2], vec![1.5, 2.0, 3.0, 4.5]));
        assert_eq!(table("1,5;2;\n3;4,25;\n"), (vec![2, 2], vec![1.5, 2.0, 3.0, 4.25]));
        assert_eq!(table("1,5\t2\r\n3\t4\r\n"), (vec![2, 2], vec![1.5, 2.0, 3.0, 4.0]));
        assert_eq!(table("# log\n1 2 3\n"), (vec![1, 3], vec![1.0, 2.0, 3.0]));
        assert_eq!(table("1,2,3\n4,5,6\n").0, [2, 3]);
        assert_eq!(table("voltage of the wing\n1\n2\n3 ").1, [1.0, 2.0, 3.0]);
        // A byte that is not valid UTF-8, as in a heading of another code page.
        let (_folder, path) = file("y.txt", b"U in \xb5V\n1\n2\n");
        assert!(
            matches!(read(&path, false).unwrap().numbers, Numbers::Table(field) if field.real == [1.0, 2.0])
        );
    }

    #[test]
    fn text_in_utf_16_is_known_by_its_beginning() {
        let text = "\u{feff}d\r\n1,5\r\n";
        for bytes_of in [u16::to_le_bytes, u16::to_be_bytes] {
            let bytes: Vec<u8> = text.encode_utf16().flat_map(bytes_of).collect();
            // Only the first bytes of a file are looked at, which may end within a character.
            assert!(is_start(&bytes) && is_start(&bytes[..7]), "{bytes:?}");
        }
        assert!(is_start(b"\xef\xbb\xbf1\n") && !is_start(b"\xff\xfe\x01\x00\x02\x00"));
    }

    #[test]
    fn a_decimal_comma_is_seen_where_the_file_shows_it_and_asked_for_where_not() {
        assert_eq!(table("0,5\n0,05\n").1, [0.5, 0.05]);
        assert_eq!(table("1,5E-3\n2,5E-3\n").1, [0.0015, 0.0025]);
        assert_eq!(table("1,5\n2\n").1, [1.5, 2.0]);
        assert_eq!(table("1,5 2,5\n3 4\n").1, [1.5, 2.5, 3.0, 4.0]);
        let (_folder, path) = file("y.txt", b"1,5\n2,5\n");
        let message = line(&read(&path, false).err().unwrap(), "y.txt");
        assert!(message.contains("one comma a line") && message.contains("--decimal-comma"));
        let Numbers::Table(field) = read(&path, true).unwrap().numbers else { panic!("a table") };
        assert_eq!(field.real, [1.5, 2.5]);
        let (_folder, path) = file("y.csv", b"h_row,d\n0,15\n3,-4\n");
        let Numbers::Columns(columns) = read(&path, false).unwrap().numbers else {
            panic!("columns")
        };
        assert_eq!(columns[1].1.real, [15.0, -4.0]);
        let (_folder, path) = file("y.txt", b"1,5;2.5\n");
        assert!(line(&read(&path, false).err().unwrap(), "y.txt").contains("points and commas"));
    }

    #[test]
    fn numbers_are_read_however_programs_print_them() {
        let printed = "np.float64(1.5)\nnp.float64(-2)\n1.25D+01\n\u{2212}3\n";
        assert_eq!(table(printed).1, [1.5, -2.0, 12.5, -3.0]);
        let (_, found) =
            table("1\n#N/A\n-1.#IND\nOL\n-\u{221e}\n".replace("\n#", "\n\"#").as_str());
        assert!(found[1].is_nan() && found[2].is_nan(), "{found:?}");
        assert_eq!([found[0], found[3], found[4]], [1.0, OVERLOAD, -OVERLOAD]);
        assert_eq!(table("1.5\r2.5\r").1, [1.5, 2.5]);
        assert_eq!(table("sep=;\n1,5;2\n3;4,5\n").1, [1.5, 2.0, 3.0, 4.5]);
        let (_folder, path) = file("y.csv", b",y\n0,1.5\n1,2.5\n");
        let Numbers::Columns(columns) = read(&path, false).unwrap().numbers else { panic!() };
        assert_eq!((&*columns[1].0, &columns[1].1.real), ("y", &vec![1.5, 2.5]));
    }

    #[test]
    fn a_heading_names_the_columns_and_words_for_unread_are_nan() {
        let (_folder, path) = file("y.csv", b"h_row; d\n0;1,5\n3;null\n2;\n1;NaN\n");
        let Numbers::Columns(columns) = read(&path, false).unwrap().numbers else {
            panic!("columns")
        };
        assert_eq!([&columns[0].0, &columns[1].0], ["h_row", "d"]);
        assert_eq!(columns[0].1.real, [0.0, 3.0, 2.0, 1.0]);
        let d = &columns[1].1.real;
        assert!(d[0] == 1.5 && d[1..].iter().all(|v| v.is_nan()) && d.len() == 4, "{d:?}");
    }

    #[test]
    fn what_is_no_number_is_named_with_its_line() {
        for (content, found) in [
            ("1\n2\nthree\n", "\"three\" in line 3"),
            ("1 2\n3\n", "1 numbers in line 2"),
            ("a b\n", "without numbers"),
            ("1,2;x\n", "\"x\" in line 1"),
            ("1.5.2\n2\n3\n", "\"1.5.2\" in line 1"),
        ] {
            let (_folder, path) = file("y.txt", content.as_bytes());
            let message = line(&read(&path, false).err().unwrap(), "y.txt");
            assert!(message.contains(found), "{message}");
        }
    }
}

//! The reader as it was before it became fast: the same text must give the same table.

use super::super::export::{Found, LEAST_LINES, MOST_AFTER, MOST_BEFORE, UNITS};
use super::super::{
    EXPECTED, Field, FileError, Numbers, OVERLOAD, OVERLOADED, Text, UNREAD, is_heading,
};
use nirspi_recon::words::count_of;
use std::path::Path;

pub(super) fn read(path: &Path, text: &str, decimal_comma: bool) -> Result<Text, FileError> {
    let text = if text.contains('\n') { text.to_owned() } else { text.replace('\r', "\n") };
    let lines: Vec<(usize, &str)> = text
        .lines()
        .enumerate()
        .map(|(at, line)| (at + 1, line.trim_start().trim_end_matches([' ', '\r'])))
        .filter(|(_, line)| !line.is_empty() && !line.starts_with(['#', '%']))
        .filter(|&(at, line)| at > 1 || !line.to_ascii_lowercase().starts_with("sep="))
        .collect();
    let refused = match plain(path, &lines, decimal_comma) {
        Ok(numbers) => return Ok(Text { numbers, skipped: None }),
        Err(error) => error,
    };
    let Some(found) = find(path, &lines, decimal_comma) else { return Err(refused) };
    let Found { columns, names, skipped } = found?;
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
fn parse(word: &str, decimal: char) -> Option<f64> {
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

/// A line and its number.
type Line<'t> = (usize, &'t str);

/// The table in these lines; `None` if no table is found, or if it is not certain that the lines are one
/// table.
fn find(path: &Path, lines: &[Line<'_>], decimal_comma: bool) -> Option<Result<Found, FileError>> {
    let body = longest(lines)?;
    let (before, after) = (&lines[..body.start], &lines[body.end..]);
    if before.len() > MOST_BEFORE || after.len() > MOST_AFTER {
        return None;
    }
    let body = &lines[body];
    let above = before.last().map(|(_, line)| *line);
    let separators = match Separators::of(path, above, body, decimal_comma) {
        Ok(separators) => separators,
        Err(error) => return Some(Err(error)),
    };
    let rows: Vec<Vec<&str>> =
        body.iter().map(|(_, line)| cells(line, separators.between)).collect();
    let width = rows[0].len();
    if rows.iter().any(|row| row.len() != width) {
        return None;
    }
    let number = |word: &str| parse(word, separators.decimal);
    let numeric: Vec<usize> = (0..width).filter(|&at| is_numeric(&rows, at, number)).collect();
    let is_row =
        |row: &[&str]| row.len() == width && numeric.iter().all(|&at| number(row[at]).is_some());
    let outside = before.iter().chain(after).map(|(_, line)| cells(line, separators.between));
    if numeric.is_empty() || outside.into_iter().any(|row| is_row(&row)) {
        return None;
    }
    // A last line of totals.
    let rows_end = rows.iter().rposition(|row| is_row(row)).map_or(0, |last| last + 1);
    let ends = rows.len() - rows_end;
    if ends > MOST_AFTER || rows_end < LEAST_LINES {
        return None;
    }
    let wrong = |line: usize, word: &str| {
        let found = format!("has {:?} in line {line}", shortened(word));
        FileError::field(path, "table", found, "a number")
    };
    let mut columns = vec![Vec::with_capacity(rows_end); numeric.len()];
    for ((line, _), row) in body.iter().zip(&rows[..rows_end]) {
        for (column, &at) in columns.iter_mut().zip(&numeric) {
            match number(row[at]) {
                Some(value) => column.push(value),
                None => return Some(Err(wrong(*line, row[at]))),
            }
        }
    }
    let (heading, units) = heading(before, separators.between, &numeric, number);
    let named = |heading: &Vec<&str>, at: usize| heading[at].trim_matches('"').trim().to_owned();
    let words: Vec<String> = (0..width)
        .filter(|at| !numeric.contains(at) && rows.iter().any(|row| !row[*at].is_empty()))
        .map(|at| match heading.as_ref().filter(|heading| at < heading.len()) {
            Some(heading) => format!("`{}`", shortened(&named(heading, at))),
            None => format!("{}", at + 1),
        })
        .collect();
    let headed = usize::from(heading.is_some()) + usize::from(units);
    let mut skipped = Vec::new();
    if before.len() > headed {
        let count = count_of(before.len() - headed, "line");
        skipped.push(format!("{count} before the table"));
    }
    if units {
        skipped.push("the units below its heading".to_owned());
    }
    if !words.is_empty() {
        skipped.push(format!("columns that hold words: {}", words.join(", ")));
    }
    if after.len() + ends > 0 {
        skipped.push(format!("{} after it", count_of(after.len() + ends, "line")));
    }
    let names = heading.map(|heading| numeric.iter().map(|&at| named(&heading, at)).collect());
    let field = |real: Vec<f64>| Field { shape: vec![real.len()], real, imaginary: None };
    let columns = columns.into_iter().map(field).collect();
    let told = || format!("left out of the text: {}", skipped.join("; "));
    let skipped = (!skipped.is_empty()).then(told);
    Some(Ok(Found { columns, names, skipped }))
}

/// The longest run of lines with the same number of cells, some of them numbers.
fn longest(lines: &[Line<'_>]) -> Option<std::ops::Range<usize>> {
    let mut best = 0..0;
    for between in [Some(';'), Some('\t'), Some(','), None] {
        let shape = |(_, line): &Line<'_>| {
            let cells = cells(line, between);
            let is_number = |word: &&str| {
                !word.is_empty() && (parse(word, '.').is_some() || parse(word, ',').is_some())
            };
            (cells.len(), cells.iter().any(is_number))
        };
        let shapes: Vec<(usize, bool)> = lines.iter().map(shape).collect();
        let mut start = 0;
        for run in shapes.chunk_by(|a, b| a == b) {
            if run[0].1 && run.len() > best.len() {
                best = start..start + run.len();
            }
            start += run.len();
        }
    }
    (best.len() >= LEAST_LINES).then_some(best)
}

/// Whether at least half of a column's cells are numbers.
fn is_numeric(rows: &[Vec<&str>], at: usize, number: impl Fn(&str) -> Option<f64>) -> bool {
    let numbers = rows.iter().filter(|row| !row[at].is_empty() && number(row[at]).is_some());
    2 * numbers.count() >= rows.len()
}

/// The names of the columns, in the line before the table or in that before a line of units; and whether
/// there are units.
fn heading<'t>(
    before: &[Line<'t>],
    between: Option<char>,
    numeric: &[usize],
    number: impl Fn(&str) -> Option<f64>,
) -> (Option<Vec<&'t str>>, bool) {
    let last = numeric.last().copied().unwrap_or(0);
    let words = |(_, line): &Line<'t>| {
        let cells = cells(line, between);
        let are_words = cells.len() > last
            && numeric.iter().all(|&at| cells[at].is_empty() || number(cells[at]).is_none())
            && numeric.iter().any(|&at| !cells[at].is_empty());
        are_words.then_some(cells)
    };
    let is_unit = |word: &str| {
        let plain = word.trim_matches(['(', ')', '[', ']', '"', ' ']);
        UNITS.contains(&plain.to_lowercase().as_str())
    };
    let mut above = before.iter().rev().map(words);
    let Some(Some(nearest)) = above.next() else { return (None, false) };
    let are_units = numeric.iter().all(|&at| is_unit(nearest[at]));
    match above.next() {
        Some(Some(names)) if are_units => (Some(names), true),
        _ => (Some(nearest), false),
    }
}

/// The cells of a line. A separator in quotes separates nothing.
fn cells(line: &str, between: Option<char>) -> Vec<&str> {
    let mut quoted = false;
    let parts = line.split(|c: char| {
        quoted ^= c == '"';
        !quoted && between.map_or(c.is_whitespace(), |mark| c == mark)
    });
    parts.map(str::trim).filter(|word| between.is_some() || !word.is_empty()).collect()
}

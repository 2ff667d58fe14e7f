//! The number that a word of a text states, and the words that stand for none.

/// Words for a reading that was not taken.
const UNREAD: [&str; 19] = [
    "nan",
    "null",
    "na",
    "none",
    "#n/a",
    "n/a",
    "#num!",
    "#value!",
    "#div/0!",
    "#ref!",
    "-1.#ind",
    "1.#ind",
    "1.#qnan",
    "-1.#qnan",
    "-nan",
    "nan(ind)",
    "-nan(ind)",
    "--",
    "---",
];

/// Words for a reading beyond what an instrument measures.
const OVERLOADED: [&str; 10] =
    ["∞", "+∞", "ol", "o.l", "o.l.", "ovld", "over", "overflow", "overload", "1.#inf"];

/// What instruments write themselves for such a reading.
pub(super) const OVERLOAD: f64 = 9.9e37;

/// The number that a word states, with the point or comma of its decimals; NaN for a reading that was not
/// taken, 9.9e37 for one beyond what an instrument measures.
#[must_use]
pub fn parse(word: &str, decimal: char) -> Option<f64> {
    let bytes = word.as_bytes();
    let word = match bytes.first() == Some(&b'"') || bytes.last() == Some(&b'"') {
        true => word.trim_matches('"'),
        false => word,
    };
    plain_number(word, decimal)
        .or_else(|| odd_number(word, decimal))
        .or_else(|| grouped_number(word, decimal))
}

/// The longest of [`UNREAD`] and [`OVERLOADED`], in bytes.
const LONGEST_WORD: usize = max(longest(&UNREAD), longest(&OVERLOADED));

const fn longest(words: &[&str]) -> usize {
    let (mut most, mut at) = (0, 0);
    while at < words.len() {
        most = max(most, words[at].len());
        at += 1;
    }
    most
}

const fn max(a: usize, b: usize) -> usize {
    if a > b { a } else { b }
}

/// What is no plain number.
#[inline(never)]
fn odd_number(word: &str, decimal: char) -> Option<f64> {
    // A long word is an exponent of Fortran or what NumPy prints, or no number.
    let has_exponent = || word.bytes().any(|byte| matches!(byte, b'd' | b'D'));
    if word.len() > LONGEST_WORD
        && word.is_ascii()
        && !word.starts_with(['n', 'N'])
        && !has_exponent()
    {
        return None;
    }
    let lower = word.to_lowercase();
    if word.is_empty() || UNREAD.contains(&lower.as_str()) {
        return Some(f64::NAN);
    }
    if OVERLOADED.contains(&lower.as_str()) {
        return Some(OVERLOAD);
    }
    if ["-∞", "−∞", "-1.#inf"].contains(&lower.as_str()) {
        return Some(-OVERLOAD);
    }
    // What NumPy 2 prints, and Fortran's exponents.
    let printed = ["np.float64(", "np.float32(", "np.int64("].iter();
    let inner = printed.filter_map(|by| lower.strip_prefix(by)?.strip_suffix(')')).next();
    let plain = inner.unwrap_or(&lower).replace('−', "-");
    let is_exponent = plain.contains(|c: char| c.is_ascii_digit()) && plain.contains('d');
    plain_number(&if is_exponent { plain.replacen('d', "e", 1) } else { plain }, decimal)
}

/// The longest number with a decimal comma that is read without an allocation.
const SHORT: usize = 32;

fn plain_number(word: &str, decimal: char) -> Option<f64> {
    match decimal {
        '.' => word.parse().ok(),
        _ if word.contains('.') => None,
        ',' if word.len() <= SHORT => {
            let mut bytes = [0; SHORT];
            let with_point = &mut bytes[..word.len()];
            with_point.copy_from_slice(word.as_bytes());
            if let Some(comma) = with_point.iter_mut().find(|byte| **byte == b',') {
                *comma = b'.';
            }
            std::str::from_utf8(with_point).ok()?.parse().ok()
        }
        _ => word.replacen(decimal, ".", 1).parse().ok(),
    }
}

/// A number with a mark between its thousands, as spreadsheets show it: `83,770.02`, or `83.770,02` with a decimal comma. A
/// single mark may be a decimal one, so a number has two of them, or decimals behind it.
#[inline(never)]
fn grouped_number(word: &str, decimal: char) -> Option<f64> {
    let mark = if decimal == '.' { ',' } else { '.' };
    let (whole, decimals) = match word.split_once(decimal) {
        Some((whole, decimals)) => (whole, Some(decimals)),
        None => (word, None),
    };
    let mut groups = whole.trim_start_matches(['-', '+']).split(mark);
    let is_digits = |group: &str| group.bytes().all(|byte| byte.is_ascii_digit());
    groups.next().filter(|first| (1..=3).contains(&first.len()) && is_digits(first))?;
    let others: Vec<&str> = groups.collect();
    let is_grouped = others.iter().all(|group| group.len() == 3 && is_digits(group))
        && (others.len() > 1 || others.len() == 1 && decimals.is_some())
        && decimals.is_none_or(|decimals| !decimals.contains(mark));
    is_grouped.then(|| plain_number(&word.replace(mark, ""), decimal))?
}

/// 1 for a plus and -1 for a minus, which stand for a pattern and its complement.
pub(super) fn sign(word: &str) -> Option<f64> {
    match word.trim_matches('"') {
        "+" => Some(1.0),
        "-" | "−" => Some(-1.0),
        _ => None,
    }
}

//! The first line of a feed: one JSON object.

use nirspi_files::Shown;
use nirspi_files::provenance::{Origin, Taken};
use nirspi_files::trace::Raw;
use nirspi_recon::law::Form;
use nirspi_recon::{Order, Side, Size};
use serde::Deserialize;
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// A header, for error messages.
const EXAMPLE: &str = r#"{"n": 64, "order": "zig-zag", "readings": "pairs", "numbers": "f32"}"#;

/// The most patterns of a frame: 16 sweeps of 256 x 256.
const MAX_PATTERNS: usize = 1 << 20;

/// The most samples of a reading.
const MAX_SAMPLES: u32 = 1 << 20;

/// What a feed says of its numbers.
#[derive(Debug, Clone, PartialEq)]
pub struct Header {
    /// The patterns that are shown in each frame.
    pub shown: FeedPatterns,
    /// How readings belong to patterns.
    pub form: Form,
    /// What the numbers are.
    pub numbers: Numbers,
    /// How many numbers make a reading.
    pub samples: Samples,
    /// Where readings begin, if a trigger says so; each sample of the detector is then followed by one of the trigger.
    pub trigger: Option<Trigger>,
    /// The unit of the readings.
    pub unit: Option<String>,
    /// The name of the bench.
    pub name: Option<String>,
    /// Whether no real light is measured; `None` if the header does not say.
    pub simulated: Option<bool>,
}

/// The patterns of a frame.
#[derive(Debug, Clone, PartialEq)]
pub enum FeedPatterns {
    /// Hadamard patterns.
    Hadamard {
        /// Side of the image.
        side: Side,
        /// The row of the natural-order Hadamard matrix that is shown k-th. A row may be shown several times.
        rows: Vec<u32>,
    },
    /// Patterns of the bench's own, which the feed does not hold.
    Own {
        /// Height and width of the image.
        size: Size,
        /// Number of patterns.
        count: usize,
    },
}

/// The levels of a trigger: a reading begins where the trigger reaches `high` after it was below `low`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Trigger {
    /// The lower level.
    pub low: f64,
    /// The upper level, at least the lower one.
    pub high: f64,
}

/// A feed of its own patterns where Hadamard patterns are needed. `Display` is one line.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error(
    "the feed shows {count} patterns of its own on {size} pixels, expected Hadamard patterns; serve --matrix PATTERNS \
     shows it, capture records it, and reconstruct --matrix PATTERNS makes images of the recording"
)]
pub struct OwnPatterns {
    /// Height and width of the image.
    pub size: Size,
    /// Number of patterns.
    pub count: usize,
}

/// What the numbers of a feed are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Numbers {
    /// Text with blanks or line ends between numbers.
    Text,
    /// Little-endian bytes without anything between numbers.
    Binary(Raw),
}

/// How many numbers of a feed make a reading: their mean.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Samples {
    /// Numbers of a reading, at least 1.
    pub each: u32,
    /// Numbers at the beginning of each reading that its mean leaves out; fewer than `each`.
    pub settle: u32,
}

/// Why a line is no header. `Display` is one line.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("the header {}, expected {}", Shown::text(.found), .expected)]
pub struct HeaderError {
    /// What was found, as the rest of a sentence.
    pub found: String,
    /// What was expected.
    pub expected: String,
}

impl HeaderError {
    pub(super) fn new(found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self { found: found.into(), expected: expected.into() }
    }

    /// A line that is no header at all.
    pub(super) fn no_header(found: impl Into<String>) -> Self {
        Self::new(found, format!("one JSON line such as {EXAMPLE}"))
    }
}

/// The header as its sender writes it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Stated {
    n: Option<u64>,
    height: Option<usize>,
    width: Option<usize>,
    order: Option<String>,
    patterns: Option<usize>,
    h_row: Option<Vec<u32>>,
    readings: String,
    numbers: Option<String>,
    samples: Option<u32>,
    settle: Option<u32>,
    trigger: Option<Levels>,
    unit: Option<String>,
    name: Option<String>,
    simulated: Option<bool>,
}

/// One level of a trigger, or the lower and the upper one.
#[derive(Clone, Copy, Deserialize)]
#[serde(untagged)]
enum Levels {
    One(f64),
    Two([f64; 2]),
}

impl FromStr for Numbers {
    type Err = String;

    fn from_str(word: &str) -> Result<Self, String> {
        match word {
            "text" => Ok(Self::Text),
            word => word
                .parse()
                .map(Self::Binary)
                .map_err(|_| format!("text, {}", Raw::ALL.map(Raw::name).join(", "))),
        }
    }
}

impl fmt::Display for Numbers {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Text => f.write_str("text"),
            Self::Binary(raw) => f.write_str(raw.name()),
        }
    }
}

impl FromStr for Header {
    type Err = HeaderError;

    fn from_str(line: &str) -> Result<Self, HeaderError> {
        let stated: Stated = serde_json::from_str(line)
            .map_err(|error| HeaderError::no_header(format!("is no JSON of a feed ({error})")))?;
        let says = |key: &str, value: &str| format!("says \"{key}\": {value}");
        let text = |key: &str, value: &str| format!("says \"{key}\": {value:?}");
        let form: Form = stated.readings.parse().map_err(|_| {
            let expected = Form::ALL.map(Form::name).join(", ");
            HeaderError::new(text("readings", &stated.readings), expected)
        })?;
        let numbers = match &stated.numbers {
            None => Numbers::Text,
            Some(word) => word
                .parse()
                .map_err(|expected: String| HeaderError::new(text("numbers", word), expected))?,
        };
        let each = stated.samples.unwrap_or(1);
        if !(1..=MAX_SAMPLES).contains(&each) {
            let expected = format!("1 to {MAX_SAMPLES} samples of a reading");
            return Err(HeaderError::new(says("samples", &each.to_string()), expected));
        }
        let settle = stated.settle.unwrap_or(0);
        if settle >= each {
            let expected = format!("fewer than the {each} samples of a reading");
            return Err(HeaderError::new(says("settle", &settle.to_string()), expected));
        }
        let trigger = stated.trigger.map(|levels| match levels {
            Levels::One(level) => Trigger { low: level, high: level },
            Levels::Two([low, high]) => Trigger { low, high },
        });
        if trigger.is_some() && each < 2 {
            let expected = "\"samples\": the numbers of the detector in a reading, at least 2";
            return Err(HeaderError::new(
                "has a \"trigger\" for each of which there is one sample",
                expected,
            ));
        }
        if let Some(Trigger { low, high }) = trigger
            && low > high
        {
            let found = says("trigger", &format!("[{low}, {high}]"));
            return Err(HeaderError::new(found, "a level, or the lower and the upper one"));
        }
        let shown = stated.shown()?;
        let Stated { unit, name, simulated, .. } = stated;
        let samples = Samples { each, settle };
        Ok(Self { shown, form, numbers, samples, trigger, unit, name, simulated })
    }
}

impl Stated {
    /// The patterns: Hadamard rows of a side, or patterns of the bench's own of a height and width.
    fn shown(&self) -> Result<FeedPatterns, HeaderError> {
        let Self { n, height, width, .. } = *self;
        let is_named = self.order.is_some() || self.h_row.is_some();
        match (n, height, width) {
            (Some(n), None, None) => {
                let side = Side::new(n).map_err(|_| {
                    let found = format!("says \"n\": {n}");
                    HeaderError::new(found, "a power of two from 2 to 256")
                })?;
                Ok(FeedPatterns::Hadamard { side, rows: self.rows(side)? })
            }
            (None, Some(height), Some(width)) if !is_named => {
                let size = Size::new(height, width).map_err(|error| {
                    let found = format!("says \"height\": {height}, \"width\": {width} ({error})");
                    HeaderError::new(found, "the size of an image")
                })?;
                match self.patterns {
                    Some(count @ 1..=MAX_PATTERNS) => Ok(FeedPatterns::Own { size, count }),
                    found => {
                        let found = found.map_or("has no \"patterns\"".to_owned(), |count| {
                            format!("says \"patterns\": {count}")
                        });
                        Err(HeaderError::new(
                            found,
                            format!("1 to {MAX_PATTERNS} beside height and width"),
                        ))
                    }
                }
            }
            _ => Err(HeaderError::new(
                "says no size, or more than one",
                "\"n\" with \"order\" or \"h_row\"; or \"height\", \"width\" and \"patterns\" for patterns of its own",
            )),
        }
    }

    /// The rows that are shown, in their order.
    fn rows(&self, side: Side) -> Result<Vec<u32>, HeaderError> {
        let area = side.area();
        match (&self.order, &self.h_row) {
            (Some(name), None) => {
                let order: Order = name.parse().map_err(|_| {
                    let expected = format!("one of {}; or h_row", Order::expected());
                    HeaderError::new(format!("says \"order\": {name:?}"), expected)
                })?;
                let count = self.patterns.unwrap_or(area);
                if !(1..=area).contains(&count) {
                    let expected = format!("1 to {area} patterns for n = {}", side.pixels());
                    return Err(HeaderError::new(format!("says \"patterns\": {count}"), expected));
                }
                let rows = order.rows(side).map_err(|error| {
                    HeaderError::new(format!("says \"order\": {name:?} ({error})"), "an order")
                })?;
                Ok(rows[..count].to_vec())
            }
            (None, Some(rows)) => {
                if let Some(count) = self.patterns.filter(|&count| count != rows.len()) {
                    let found = format!("says \"patterns\": {count}");
                    let expected =
                        format!("{}, as many as h_row has, or no \"patterns\"", rows.len());
                    return Err(HeaderError::new(found, expected));
                }
                if rows.is_empty() || rows.len() > MAX_PATTERNS {
                    let found = format!("has an h_row of {} entries", rows.len());
                    return Err(HeaderError::new(found, format!("1 to {MAX_PATTERNS}")));
                }
                match rows.iter().position(|&row| row as usize >= area) {
                    None => Ok(rows.clone()),
                    Some(at) => {
                        let found = format!("has {} at [{at}] of h_row", rows[at]);
                        let n = side.pixels();
                        Err(HeaderError::new(found, format!("0 to {} for n = {n}", area - 1)))
                    }
                }
            }
            (Some(_), Some(_)) => {
                Err(HeaderError::new("has both \"order\" and \"h_row\"", "one of the two"))
            }
            (None, None) => Err(HeaderError::new(
                "has neither \"order\" nor \"h_row\"",
                "the order in which patterns are shown",
            )),
        }
    }
}

impl Header {
    /// Number of readings of a frame.
    #[must_use]
    pub fn readings(&self) -> usize {
        self.patterns() * self.form.readings()
    }

    /// Number of patterns of a frame.
    #[must_use]
    pub fn patterns(&self) -> usize {
        match &self.shown {
            FeedPatterns::Hadamard { rows, .. } => rows.len(),
            FeedPatterns::Own { count, .. } => *count,
        }
    }

    /// Height and width of the image.
    #[must_use]
    pub fn size(&self) -> Size {
        match &self.shown {
            FeedPatterns::Hadamard { side, .. } => (*side).into(),
            FeedPatterns::Own { size, .. } => *size,
        }
    }

    /// Side and rows of Hadamard patterns.
    ///
    /// # Errors
    /// [`OwnPatterns`] for others.
    pub fn hadamard(&self) -> Result<(Side, &[u32]), OwnPatterns> {
        match &self.shown {
            FeedPatterns::Hadamard { side, rows } => Ok((*side, rows)),
            &FeedPatterns::Own { size, count } => Err(OwnPatterns { size, count }),
        }
    }

    /// The order of the patterns, in words: its name, `h_row`, or `own` for patterns of the bench's own.
    #[must_use]
    pub fn order(&self) -> String {
        match &self.shown {
            FeedPatterns::Hadamard { side, rows } => {
                Order::of(rows, *side).map_or_else(|| "h_row".to_owned(), |order| order.to_string())
            }
            FeedPatterns::Own { .. } => "own".to_owned(),
        }
    }

    /// Where readings of a feed with this header come from, at an address in words.
    #[must_use]
    pub fn taken(&self, address: &str) -> Taken {
        let origin = match self.simulated {
            Some(true) => Origin::Simulated,
            Some(false) => Origin::Measured,
            None => Origin::Unknown,
        };
        let name = self.name.clone().unwrap_or_else(|| address.to_owned());
        Taken { origin, camera: None, file: Some(name) }
    }

    /// The type of a recorded reading, as NumPy writes it. A mean of samples is no integer.
    pub(crate) fn recorded(&self) -> Raw {
        match self.numbers {
            Numbers::Binary(raw) if self.samples.each == 1 => raw,
            _ => Raw::F64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(line: &str) -> String {
        let line = line.parse::<Header>().unwrap_err().to_string();
        assert_eq!(line.lines().count(), 1, "{line}");
        line
    }

    #[test]
    fn a_header_says_the_patterns_and_the_numbers() {
        let header: Header = EXAMPLE.parse().unwrap();
        let (side, rows) = header.hadamard().unwrap();
        assert_eq!((side.pixels(), header.readings()), (64, 2 * 64 * 64));
        assert_eq!(*rows, *Order::ZigZag.rows(side).unwrap());
        assert_eq!(header.numbers, Numbers::Binary(Raw::F32));
        assert_eq!((header.samples.each, header.order()), (1, "zig-zag".to_owned()));
        let own = r#"{"n":2,"h_row":[0,3,3],"readings":"single","samples":20,"settle":4,"unit":"V","name":"a","simulated":true}"#;
        let header: Header = own.parse().unwrap();
        assert_eq!((header.hadamard().unwrap().1, header.readings()), (&[0, 3, 3][..], 3));
        assert_eq!(header.samples, Samples { each: 20, settle: 4 });
        assert_eq!((header.numbers, header.recorded()), (Numbers::Text, Raw::F64));
        assert_eq!((header.unit.as_deref(), header.simulated), (Some("V"), Some(true)));
        let part: Header =
            r#"{"n":4,"order":"natural","patterns":3,"readings":"halves"}"#.parse().unwrap();
        assert_eq!((part.hadamard().unwrap().1, part.readings()), (&[0, 1, 2][..], 6));
        let own = r#"{"height":12,"width":15,"patterns":300,"readings":"pairs","samples":9,"trigger":[1,2.5]}"#;
        let header: Header = own.parse().unwrap();
        assert_eq!((header.readings(), &*header.order()), (600, "own"));
        assert_eq!(header.trigger, Some(Trigger { low: 1.0, high: 2.5 }));
        let told = header.hadamard().unwrap_err().to_string();
        assert!(
            told.starts_with("the feed shows 300 patterns of its own on 12 x 15 pixels"),
            "{told}"
        );
    }

    #[test]
    fn what_is_no_header_is_refused_in_one_line_that_names_it() {
        let order = r#""order":"natural","readings":"single""#;
        for (line, found) in [
            ("hello".to_owned(), "is no JSON of a feed"),
            (format!("{{{order}}}"), "says no size, or more than one, expected \"n\" with"),
            (
                format!("{{\"n\":4,\"height\":4,\"width\":4,{order}}}"),
                "says no size, or more than one",
            ),
            (r#"{"height":4,"width":4,"readings":"single"}"#.into(), "has no \"patterns\""),
            (r#"{"height":0,"width":4,"patterns":3,"readings":"single"}"#.into(), "\"height\": 0"),
            (
                format!("{{\"n\":4,{order},\"trigger\":1}}"),
                "\"samples\": the numbers of the detector",
            ),
            (
                format!("{{\"n\":4,{order},\"samples\":9,\"trigger\":[2,1]}}"),
                "the lower and the upper one",
            ),
            (format!("{{\"n\":3,{order}}}"), "\"n\": 3, expected a power of two from 2 to 256"),
            (
                format!("{{\"n\":4,{order},\"gain\":3}}"),
                "unknown field `gain`, expected one of `n`",
            ),
            (format!("{{\"n\":4,{order},\"n\":4}}"), "duplicate field `n`"),
            (format!("{{\"n\":4,{order},\"patterns\":17}}"), "1 to 16 patterns for n = 4"),
            (
                format!("{{\"n\":4,{order},\"numbers\":\"f16\"}}"),
                "expected text, f32, f64, i16, i32",
            ),
            (format!("{{\"n\":4,{order},\"samples\":0}}"), "\"samples\": 0, expected 1 to 1048576"),
            (format!("{{\"n\":4,{order},\"settle\":1}}"), "fewer than the 1 samples"),
            (format!("{{\"n\":4,{order},\"h_row\":[0]}}"), "both \"order\" and \"h_row\""),
            (r#"{"n":4,"readings":"single"}"#.into(), "neither \"order\" nor \"h_row\""),
            (r#"{"n":4,"order":"a\nb","readings":"single"}"#.into(), "expected one of natural"),
            (r#"{"n":4,"order":"natural","readings":"triples"}"#.into(), "expected pairs, halves"),
            (r#"{"n":4,"h_row":[0,16],"readings":"single"}"#.into(), "16 at [1] of h_row"),
            (r#"{"n":4,"h_row":[],"readings":"single"}"#.into(), "an h_row of 0 entries"),
            (
                r#"{"n":4,"h_row":[0],"patterns":2,"readings":"single"}"#.into(),
                "as many as h_row has",
            ),
        ] {
            let told = refused(&line);
            assert!(told.contains(found), "{line}: {told}");
        }
    }
}

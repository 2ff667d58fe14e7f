//! Frames of the bytes of a feed.

use super::account::Account;
use super::header::{Header, Numbers, Samples};
use super::trigger::{Edge, Triggered};
use nirspi_files::Shown;
use nirspi_files::measurement::is_reading;
use nirspi_files::parse_number;
use nirspi_files::trace::Raw;
use nirspi_recon::words::count;
use thiserror::Error;

/// The longest word that can be a number.
const MAX_WORD: usize = 64;

/// Bytes after the header of a feed, made into frames.
#[derive(Debug)]
pub struct Frames {
    numbers: Numbers,
    samples: Samples,
    /// Where readings begin, if a trigger says so.
    trigger: Option<Triggered>,
    /// Readings of a frame.
    readings: usize,
    /// The frame so far.
    frame: Vec<f64>,
    /// The beginning of a number whose end has not come yet.
    begun: Vec<u8>,
    /// Samples of a reading so far: their number, and the sum of those that count.
    taken: u32,
    sum: f64,
    /// Whether a sample of the reading was refused.
    marred: bool,
    account: Account,
}

/// How far bytes were taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Taken {
    /// Number of bytes.
    pub bytes: usize,
    /// Whether a frame with at least one reading is complete: [`Frames::frame`].
    pub complete: bool,
}

/// A second header in the middle of the numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Error)]
#[error(
    "a second header after {}: another header needs another connection or file",
    count(*.frames, "frame")
)]
pub struct SecondHeader {
    /// Complete frames before it.
    pub frames: u64,
}

impl Frames {
    /// Frames of the numbers that follow this header.
    #[must_use]
    pub fn new(header: &Header) -> Self {
        Self {
            numbers: header.numbers,
            samples: header.samples,
            trigger: header.trigger.map(|levels| Triggered::new(levels, header.samples.each)),
            readings: header.readings(),
            frame: Vec::with_capacity(header.readings()),
            begun: Vec::new(),
            taken: 0,
            sum: 0.0,
            marred: false,
            account: Account::default(),
        }
    }

    /// The account so far.
    #[must_use]
    pub fn account(&self) -> &Account {
        &self.account
    }

    /// The readings of the frame that [`take`](Self::take) has completed; NaN for one that was not read.
    #[must_use]
    pub fn frame(&self) -> &[f64] {
        &self.frame
    }

    /// Takes bytes until a frame is complete, or all of them.
    ///
    /// # Errors
    /// [`SecondHeader`] where a word of a text begins with `{`.
    pub fn take(&mut self, bytes: &[u8]) -> Result<Taken, SecondHeader> {
        let mut at = 0;
        while at < bytes.len() {
            if self.frame.len() == self.readings {
                self.frame.clear();
            }
            at += match self.numbers {
                Numbers::Text => self.take_text(&bytes[at..])?,
                Numbers::Binary(raw) => self.take_binary(raw, &bytes[at..]),
            };
            if self.frame.len() == self.readings {
                if self.frame.iter().copied().any(is_reading) {
                    self.account.frames += 1;
                    return Ok(Taken { bytes: at, complete: true });
                }
                self.account.empty_frames += 1;
            }
        }
        Ok(Taken { bytes: at, complete: false })
    }

    /// The feed has ended. Returns whether its last number completes a frame.
    ///
    /// # Errors
    /// As [`take`](Self::take).
    pub fn end(&mut self) -> Result<bool, SecondHeader> {
        // A text may end without a line end.
        let is_text = self.numbers == Numbers::Text;
        if is_text && !self.begun.is_empty() && self.take(b"\n")?.complete {
            return Ok(true);
        }
        if self.is_whole_reading() {
            self.complete_reading();
            if self.frame.len() == self.readings && self.frame.iter().copied().any(is_reading) {
                self.account.frames += 1;
                return Ok(true);
            }
        }
        let inside = self.frame.len() % self.readings;
        let begun = self.taken > 0 || !self.begun.is_empty();
        self.account.cut = inside as u64 + u64::from(begun);
        Ok(false)
    }

    /// Takes one word of a text, or bytes between words. Returns the number of bytes.
    fn take_text(&mut self, bytes: &[u8]) -> Result<usize, SecondHeader> {
        let blank = |byte: &u8| byte.is_ascii_whitespace();
        if self.begun.is_empty() {
            let blanks = bytes.iter().position(|byte| !blank(byte)).unwrap_or(bytes.len());
            if blanks > 0 {
                return Ok(blanks);
            }
        }
        let end = bytes.iter().position(blank);
        let part = &bytes[..end.unwrap_or(bytes.len())];
        if self.begun.is_empty() && part.first() == Some(&b'{') {
            return Err(SecondHeader { frames: self.account.frames });
        }
        let (Some(end), true) = (end, self.begun.is_empty()) else {
            // One byte more than a number has tells a long word.
            let room = (MAX_WORD + 1).saturating_sub(self.begun.len()).min(part.len());
            self.begun.extend_from_slice(&part[..room]);
            if end.is_some() {
                let word = std::mem::take(&mut self.begun);
                self.word(&word);
            }
            return Ok(part.len() + usize::from(end.is_some()));
        };
        self.word(part);
        Ok(end + 1)
    }

    fn word(&mut self, word: &[u8]) {
        let text = std::str::from_utf8(word).ok().filter(|word| word.len() <= MAX_WORD);
        match text.and_then(|word| parse_number(word, '.')) {
            Some(number) => self.sample(number),
            None => {
                let shown: String = String::from_utf8_lossy(word).chars().take(20).collect();
                self.refuse(&format!("\"{shown}\""));
            }
        }
    }

    /// Takes whole numbers up to the end of the frame, or the beginning of one. Returns the number of bytes.
    fn take_binary(&mut self, raw: Raw, bytes: &[u8]) -> usize {
        let size = raw.bytes();
        if !self.begun.is_empty() || bytes.len() < size {
            let more = (size - self.begun.len()).min(bytes.len());
            self.begun.extend_from_slice(&bytes[..more]);
            if self.begun.len() == size {
                let whole = std::mem::take(&mut self.begun);
                self.sample(raw.number(&whole));
            }
            return more;
        }
        if self.samples.each > 1 {
            self.sample(raw.number(&bytes[..size]));
            return size;
        }
        let from = self.frame.len();
        let count = (self.readings - from).min(bytes.len() / size);
        let taken = count * size;
        raw.numbers(&bytes[..taken], &mut self.frame);
        if self.frame[from..].iter().any(|value| !value.is_finite()) {
            for value in self.frame.split_off(from) {
                self.sample(value);
            }
        }
        taken
    }

    /// One number: a reading, or a sample of one.
    fn sample(&mut self, number: f64) {
        if number.is_infinite() {
            return self.refuse(&number.to_string());
        }
        let number = match &mut self.trigger {
            None => number,
            Some(trigger) => match trigger.take(number) {
                None => return,
                Some((number, Edge::None)) => number,
                Some((number, Edge::Early)) => {
                    self.account.early += 1;
                    number
                }
                Some((number, Edge::Begins { lost })) => {
                    if self.taken > 0 {
                        self.complete_reading();
                    }
                    // The trigger of a frame may wait for the next frame for any time.
                    let inside = self.frame.len() % self.readings;
                    let room = if inside == 0 { 0 } else { self.readings - inside };
                    let lost = room.min(lost);
                    self.frame.extend(std::iter::repeat_n(f64::NAN, lost));
                    self.account.lost += lost as u64;
                    number
                }
            },
        };
        self.taken += 1;
        if self.taken > self.samples.settle {
            self.sum += number;
        }
        if self.taken == self.samples.each {
            self.complete_reading();
            if let Some(trigger) = &mut self.trigger {
                trigger.completed();
            }
        }
    }

    /// Whether a trigger began this reading and more than half of its samples came. At the end of a
    /// feed, only the next edge is then missing.
    fn is_whole_reading(&self) -> bool {
        self.trigger.is_some()
            && self.taken > self.samples.settle
            && 2 * self.taken > self.samples.each
    }

    /// Adds the mean of the samples so far to the frame.
    fn complete_reading(&mut self) {
        let counted = f64::from(self.taken.saturating_sub(self.samples.settle));
        // Numbers so large that their sum is infinite are no readings.
        let mean = self.sum / counted;
        let mean = if mean.is_finite() { mean } else { f64::NAN };
        if mean.is_nan() && !self.marred {
            self.account.not_read += 1;
        }
        self.frame.push(mean);
        (self.taken, self.sum, self.marred) = (0, 0.0, false);
    }

    /// Takes the place of one number that could not be read as a number. The reading counts as not read.
    fn refuse(&mut self, shown: &str) {
        self.account.refused += 1;
        if self.account.first_refused.is_none() {
            let reading = self.frame.len() + 1;
            let frame = self.account.frames + self.account.empty_frames + 1;
            let shown = Shown::text(shown);
            let first = format!("{shown} as reading {reading} of frame {frame}");
            self.account.first_refused = Some(first);
        }
        self.marred = true;
        // A sample that does not count mars nothing.
        self.sample(f64::NAN);
    }
}

/// The mean of each reading over the frames in which it was read.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Mean {
    sums: Vec<f64>,
    counts: Vec<u32>,
}

impl Mean {
    /// Adds a frame of as many readings as the others.
    pub fn add(&mut self, frame: &[f64]) {
        self.sums.resize(frame.len(), 0.0);
        self.counts.resize(frame.len(), 0);
        for ((sum, count), value) in self.sums.iter_mut().zip(&mut self.counts).zip(frame) {
            if !value.is_nan() {
                *sum += value;
                *count += 1;
            }
        }
    }

    /// The mean; NaN for a reading that was read in no frame.
    #[must_use]
    pub fn readings(&self) -> Vec<f64> {
        self.sums.iter().zip(&self.counts).map(|(sum, &count)| sum / f64::from(count)).collect()
    }
}

/// The [`Mean`] of these frames.
#[must_use]
pub fn mean<F: AsRef<[f64]>>(frames: &[F]) -> Vec<f64> {
    let mut mean = Mean::default();
    frames.iter().for_each(|frame| mean.add(frame.as_ref()));
    mean.readings()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn header(more: &str) -> Header {
        format!("{{\"n\":2,\"order\":\"natural\",\"readings\":\"single\"{more}}}").parse().unwrap()
    }

    /// The frames of these pieces of bytes, and the account.
    fn frames<'b>(
        header: &Header,
        pieces: impl IntoIterator<Item = &'b [u8]>,
    ) -> (Vec<Vec<f64>>, Account) {
        let mut frames = Frames::new(header);
        let mut found = Vec::new();
        for mut piece in pieces {
            while !piece.is_empty() {
                let taken = frames.take(piece).unwrap();
                piece = &piece[taken.bytes..];
                if taken.complete {
                    found.push(frames.frame().to_vec());
                }
            }
        }
        if frames.end().unwrap() {
            found.push(frames.frame().to_vec());
            frames.end().unwrap();
        }
        (found, frames.account().clone())
    }

    #[test]
    fn numbers_are_text_or_bytes_of_any_kind() {
        let expected = vec![vec![1.0, -2.0, 3.0, 4.0]];
        let whole = Account { frames: 1, ..Account::default() };
        for text in ["1 -2\r\n3\t4", "\n1.0\n-2e0\n 3\n+4\n\n"] {
            assert_eq!(frames(&header(""), [text.as_bytes()]), (expected.clone(), whole.clone()));
        }
        let of = |bytes: Vec<Vec<u8>>| bytes.concat();
        for (kind, bytes) in [
            ("f32", of(expected[0].iter().map(|v| (*v as f32).to_le_bytes().to_vec()).collect())),
            ("f64", of(expected[0].iter().map(|v| v.to_le_bytes().to_vec()).collect())),
            ("i16", of(expected[0].iter().map(|v| (*v as i16).to_le_bytes().to_vec()).collect())),
            ("i32", of(expected[0].iter().map(|v| (*v as i32).to_le_bytes().to_vec()).collect())),
        ] {
            let header = header(&format!(",\"numbers\":\"{kind}\""));
            assert_eq!(frames(&header, [&bytes[..]]), (expected.clone(), whole.clone()), "{kind}");
        }
    }

    #[test]
    fn a_word_takes_the_place_of_one_reading() {
        let long = "7".repeat(1000);
        let text = format!("1 two 3 4\n5 inf 1,5 {long}\n9 nan 11 12\n");
        let (found, account) = frames(&header(""), [text.as_bytes()]);
        let is = |frame: &[f64], expected: [Option<f64>; 4]| {
            let read: Vec<Option<f64>> =
                frame.iter().map(|&value| Some(value).filter(|value| !value.is_nan())).collect();
            assert_eq!(read, expected);
        };
        is(&found[0], [Some(1.0), None, Some(3.0), Some(4.0)]);
        is(&found[1], [Some(5.0), None, None, None]);
        is(&found[2], [Some(9.0), None, Some(11.0), Some(12.0)]);
        assert_eq!((account.frames, account.refused, account.not_read), (3, 4, 1));
        assert_eq!(account.first_refused.as_deref(), Some("\"two\" as reading 2 of frame 1"));
        let infinite = f32::INFINITY.to_le_bytes();
        let (found, account) = frames(
            &header(",\"numbers\":\"f32\""),
            [&infinite[..], &[0; 12], &infinite, &infinite],
        );
        is(&found[0], [None, Some(0.0), Some(0.0), Some(0.0)]);
        assert_eq!((account.refused, account.cut), (3, 2));
    }

    #[test]
    fn a_frame_without_a_reading_is_counted_and_left_out() {
        let (found, account) = frames(&header(""), [&b"nan nan x 9.9e37\n1 2 3 4 5"[..]]);
        assert_eq!(found, [[1.0, 2.0, 3.0, 4.0]]);
        let expected = "1 frame; 1 frame without any reading, 1 number refused (first \"x\" as reading 3 of frame 1), \
                        2 readings not read (NaN), 1 reading of a last frame that is not complete";
        assert_eq!(account.to_string(), expected);
        assert!(!account.is_whole());
    }

    #[test]
    fn a_reading_is_the_mean_of_its_samples_that_have_settled() {
        let header = header(",\"samples\":3,\"settle\":1");
        let text = b"9 1 2\nx 3 4\n9 5 x\n9 7 8\n9 9";
        let (found, account) = frames(&header, [&text[..]]);
        assert_eq!(found[0][0], 1.5);
        // A word among the samples that are left out harms nothing.
        assert_eq!((found[0][1], found[0][3]), (3.5, 7.5));
        assert!(found[0][2].is_nan());
        assert_eq!((account.refused, account.not_read, account.cut), (2, 0, 1));
    }

    #[test]
    fn a_trigger_says_where_readings_begin_and_losses_move_no_other_reading() {
        let header = header(",\"samples\":4,\"settle\":1,\"trigger\":[1,2]");
        // Of each pattern its samples, the first of which has not settled, and the trigger, high for two samples.
        let pattern = |level: f64, samples: usize| -> String {
            (0..samples)
                .map(|at| {
                    format!(
                        "{} {}\n",
                        if at == 0 { 99.0 } else { level },
                        if at < 2 { 5 } else { 0 }
                    )
                })
                .collect()
        };
        let before = "7 0\n7 1.5\n";
        let whole: String = [1.0, 2.0, 3.0, 4.0].iter().map(|&level| pattern(level, 4)).collect();
        let (found, account) = frames(&header, [format!("{before}{whole}{whole}").as_bytes()]);
        assert_eq!(found, [[1.0, 2.0, 3.0, 4.0], [1.0, 2.0, 3.0, 4.0]]);
        assert!(account.is_whole(), "{account:?}");
        // Patterns of other lengths, and a pause between frames, are no losses.
        let pause = "0 0\n".repeat(37);
        let uneven = [(1.0, 5), (2.0, 3), (3.0, 4), (4.0, 5)];
        let uneven: String =
            uneven.iter().map(|&(level, samples)| pattern(level, samples)).collect();
        let (found, account) =
            frames(&header, [format!("{uneven}{pause}{whole}{}", pattern(1.0, 3)).as_bytes()]);
        assert_eq!(found, [[1.0, 2.0, 3.0, 4.0], [1.0, 2.0, 3.0, 4.0]]);
        assert_eq!(account, Account { frames: 2, cut: 1, ..Account::default() });
        // The edge of the second pattern is lost: its reading is not read. A frame whose last edges are lost ends in the pause.
        let without = pattern(2.0, 4).replace(" 5\n", " 0\n");
        let lost = [pattern(1.0, 4), without, pattern(3.0, 4), pattern(4.0, 4)].concat();
        let cut = pattern(1.0, 4) + &pattern(2.0, 4);
        let text = format!("0 0\n{lost}{pause}{cut}{pause}{whole}");
        let (found, account) = frames(&header, [text.as_bytes()]);
        let read: Vec<Vec<Option<f64>>> = found
            .iter()
            .map(|frame| {
                frame.iter().map(|&value| Some(value).filter(|value| !value.is_nan())).collect()
            })
            .collect();
        let (one, two) = (Some(1.0), Some(2.0));
        assert_eq!(read[0], [one, None, Some(3.0), Some(4.0)]);
        assert_eq!(read[1], [one, two, None, None]);
        assert_eq!(read[2], [one, two, Some(3.0), Some(4.0)]);
        assert_eq!((account.lost, account.frames, account.not_read), (3, 3, 0));
        assert!(
            account.missing().unwrap().contains("3 readings whose trigger was lost"),
            "{account}"
        );
        // An edge that comes too early begins no reading, and noise between the levels is no edge.
        let header = Header { samples: Samples { each: 8, settle: 1 }, ..header };
        let slow: String = [1.0, 2.0, 3.0, 4.0].iter().map(|&level| pattern(level, 8)).collect();
        let early = slow.replacen("1 5\n1 0\n1 0\n", "1 5\n1 0\n1 5\n", 1);
        let early = early.replacen("2 5\n2 0\n", "2 1.5\n2 2.5\n", 1);
        let (found, account) = frames(&header, [format!("0 0\n{early}").as_bytes()]);
        assert_eq!(found, [[1.0, 2.0, 3.0, 4.0]]);
        assert_eq!(account, Account { frames: 1, early: 1, ..Account::default() });
        assert_eq!(account.to_string(), "1 frame; 1 edge that came too early");
    }

    #[test]
    fn a_mean_is_over_the_frames_that_were_read() {
        let nan = f64::NAN;
        let found = mean(&[[1.0, nan, nan], [3.0, 5.0, nan]]);
        assert!(found[..2] == [2.0, 5.0] && found[2].is_nan(), "{found:?}");
    }

    #[test]
    fn a_second_header_ends_the_numbers() {
        let mut frames = Frames::new(&header(""));
        assert_eq!(frames.take(b"1 2 3 4\n{\"n\": 8}").unwrap().bytes, 8);
        let line = frames.take(b"{\"n\": 8}").unwrap_err().to_string();
        assert!(line.starts_with("a second header after 1 frame:"), "{line}");
    }

    proptest! {
        #[test]
        fn every_number_has_its_place_however_the_bytes_are_cut(
            values in proptest::collection::vec(-1e6_f64..1e6, 0..40),
            cuts in proptest::collection::vec(1_usize..30, 1..60),
            binary in any::<bool>(),
            samples in 1_u32..3,
        ) {
            let kind = if binary { "f64" } else { "text" };
            let header = header(&format!(",\"numbers\":\"{kind}\",\"samples\":{samples}"));
            let bytes: Vec<u8> = values
                .iter()
                .flat_map(|value| match binary {
                    true => value.to_le_bytes().to_vec(),
                    false => format!("{value} ").into_bytes(),
                })
                .collect();
            let mut rest = &bytes[..];
            let mut pieces = Vec::new();
            for cut in cuts.iter().cycle() {
                if rest.is_empty() { break; }
                let (piece, others) = rest.split_at((*cut).min(rest.len()));
                (pieces, rest) = ([pieces, vec![piece]].concat(), others);
            }
            let (found, account) = frames(&header, pieces);
            let means: Vec<f64> = values
                .chunks_exact(samples as usize)
                .map(|chunk| if samples == 1 { chunk[0] } else { (chunk[0] + chunk[1]) / 2.0 })
                .collect();
            let whole = means.len() / 4;
            prop_assert_eq!(found.concat(), &means[..4 * whole]);
            prop_assert_eq!(account.frames, whole as u64);
            let begun = values.len() % samples as usize;
            prop_assert_eq!(account.cut as usize, means.len() % 4 + begun);
            prop_assert_eq!(account.refused + account.not_read, 0);
        }
    }
}

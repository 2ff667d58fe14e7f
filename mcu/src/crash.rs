//! The crash record: what the firmware leaves in memory when it crashes, for the host that connects
//! after the restart.
//!
//! # Invariant
//! Memory without a crash record is never read as a record: a record needs its magic number and a
//! right checksum (`tests::crash::memory_that_nobody_wrote_is_no_record`,
//! `tests::crash::a_record_comes_back_and_no_damaged_one_does`).

use crate::Micros;
use heapless::String;
use nirspi_wire::Crc32;
use nirspi_wire::message::CRASH_TEXT_MAX;

/// Words of memory that a record takes. The memory must survive a restart.
pub const CRASH_WORDS: usize = HEAD_WORDS + CRASH_TEXT_MAX / 4 + 1;

/// Magic, uptime, length of the text.
const HEAD_WORDS: usize = 4;

/// `"DIED"` in ASCII.
const MAGIC: u32 = 0x4449_4544;

/// Why the firmware restarted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Crash {
    /// Time of the crash, since power-up.
    pub uptime: Micros,
    /// Place and reason of the crash.
    pub text: String<CRASH_TEXT_MAX>,
}

impl Crash {
    /// Keeps as much of the text as there is room for, in whole characters.
    #[must_use]
    pub fn new(uptime: Micros, text: core::fmt::Arguments<'_>) -> Self {
        let mut cut = Cut(String::new());
        // A write can only fail because the text is full.
        let _ = core::fmt::write(&mut cut, text);
        Self { uptime, text: cut.0 }
    }

    /// The record as words of memory.
    #[must_use]
    pub fn to_words(&self) -> [u32; CRASH_WORDS] {
        let mut words = [0; CRASH_WORDS];
        let text = self.text.as_bytes();
        let low = self.uptime.0 as u32;
        let head = [MAGIC, low, (self.uptime.0 >> 32) as u32, text.len() as u32];
        for (word, value) in words.iter_mut().zip(head) {
            *word = value;
        }
        for (word, piece) in words.iter_mut().skip(HEAD_WORDS).zip(text.chunks(4)) {
            let mut bytes = [0; 4];
            for (to, from) in bytes.iter_mut().zip(piece) {
                *to = *from;
            }
            *word = u32::from_le_bytes(bytes);
        }
        let checksum = checksum(&words);
        if let Some(last) = words.last_mut() {
            *last = checksum;
        }
        words
    }

    /// The record in memory, if there is one.
    #[must_use]
    pub fn from_words(words: &[u32; CRASH_WORDS]) -> Option<Self> {
        let &[magic, low, high, length, ref rest @ ..] = words;
        let (&found, text) = rest.split_last()?;
        if magic != MAGIC || found != checksum(words) {
            return None;
        }
        let bytes = text.iter().flat_map(|word| word.to_le_bytes());
        let mut kept = heapless::Vec::<u8, CRASH_TEXT_MAX>::new();
        for byte in bytes.take(usize::try_from(length).ok()?) {
            kept.push(byte).ok()?;
        }
        let text = String::from_utf8(kept).ok()?;
        Some(Self { uptime: Micros(u64::from(high) << 32 | u64::from(low)), text })
    }
}

/// Checksum over all words but the last.
fn checksum(words: &[u32; CRASH_WORDS]) -> u32 {
    let mut crc = Crc32::new();
    for word in words.iter().take(CRASH_WORDS.saturating_sub(1)) {
        crc.update(&word.to_le_bytes());
    }
    crc.value()
}

/// A writer that keeps what fits and drops the rest.
struct Cut(String<CRASH_TEXT_MAX>);

impl core::fmt::Write for Cut {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        text.chars().try_for_each(|c| self.0.push(c).map_err(|_| core::fmt::Error))
    }
}

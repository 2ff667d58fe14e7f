//! What the firmware leaves behind when it crashes, for the host that connects after the restart.
//!
//! The one law: memory that no crash has written is no record; it is told from one by magic and checksum.

use crate::Micros;
use heapless::String;
use nirspi_wire::Crc32;
use nirspi_wire::message::CRASH_TEXT_MAX;

/// Words of memory that a record takes, where a restart does not clear them.
pub const CRASH_WORDS: usize = HEAD_WORDS + CRASH_TEXT_MAX / 4 + 1;

/// Magic, uptime, length of the text.
const HEAD_WORDS: usize = 4;

/// `"DIED"` in ASCII.
const MAGIC: u32 = 0x4449_4544;

/// Why the firmware restarted.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Crash {
    /// When, since power-up.
    pub uptime: Micros,
    /// Where and why.
    pub text: String<CRASH_TEXT_MAX>,
}

impl Crash {
    /// As much of the text as there is room for, in whole characters.
    #[must_use]
    pub fn new(uptime: Micros, text: core::fmt::Arguments<'_>) -> Self {
        let mut cut = Cut(String::new());
        // Full is all that can happen to it.
        let _ = core::fmt::write(&mut cut, text);
        Self { uptime, text: cut.0 }
    }

    /// As it stands in memory.
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

/// Over all words but the last.
fn checksum(words: &[u32; CRASH_WORDS]) -> u32 {
    let mut crc = Crc32::new();
    for word in words.iter().take(CRASH_WORDS.saturating_sub(1)) {
        crc.update(&word.to_le_bytes());
    }
    crc.value()
}

/// Takes what there is room for.
struct Cut(String<CRASH_TEXT_MAX>);

impl core::fmt::Write for Cut {
    fn write_str(&mut self, text: &str) -> core::fmt::Result {
        text.chars().try_for_each(|c| self.0.push(c).map_err(|_| core::fmt::Error))
    }
}

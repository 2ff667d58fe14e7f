//! Goes through the records of an MCAP file, be it whole, cut short or damaged.
//!
//! A chunk without compression is transparent: its records are read as if they stood in the file by
//! themselves, so a torn chunk gives the records before the tear. A record is believed if its
//! content or the record after it is right. After damage the scan goes on at the next record that
//! can be believed. A packet holds no zero byte but its delimiter, and the head of a record holds
//! several, so no packet is taken for a record.
//!
//! # Invariant
//! No record takes more memory than [`LONGEST`], whatever length it claims
//! (`tests::a_length_beyond_the_file_takes_no_memory`). One damaged byte costs at most the record
//! that it hits and the one before
//! (`one_damaged_byte_costs_no_more_than_two_packets` in `host/tests/damaged_recordings.rs`).

use crc32fast::Hasher;
use mcap::records::op;
use nirspi_wire::packet::MAX_DEVICE_PACKET;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Read};

/// The longest record that is read or passed over.
pub(super) const LONGEST: u64 = 64 << 20;
const MAGIC: &[u8] = b"\x89MCAP0\r\n";
/// Bytes of a record before its content: the kind and the length.
const HEAD: usize = 9;
/// Bytes of a message before its data.
const MESSAGE_HEAD: usize = 22;
/// Bytes that are read at a time.
const BLOCK: usize = 1 << 20;

/// What a record says.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Entry {
    Header {
        profile: String,
    },
    Channel {
        id: u16,
        topic: String,
        encoding: String,
    },
    Message {
        channel: u16,
        time_ns: u64,
        data: Vec<u8>,
    },
    Metadata {
        name: String,
        texts: BTreeMap<String, String>,
    },
    /// A chunk with this compression, which cannot be read.
    Compressed(String),
}

/// What was wrong with a file.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Damage {
    /// Places at which bytes were passed over.
    pub places: u64,
    /// Bytes that were passed over.
    pub bytes: u64,
    /// Place of the first of these bytes in the file.
    pub first: Option<u64>,
    /// Chunks whose checksum is wrong.
    pub chunks: u64,
    /// Whether the checksum of the file's records is wrong.
    pub checksum: bool,
    /// Whether the file ends early.
    pub is_cut: bool,
    /// Place at which another recording begins, behind the end of this one.
    pub another: Option<u64>,
}

impl std::fmt::Display for Damage {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut parts = Vec::new();
        if let Some(first) = self.first {
            let (places, bytes) = (self.places, self.bytes);
            let places = nirspi_recon::words::count(places, "place");
            parts.push(format!("{bytes} bytes lost at {places}, the first at byte {first}"));
        } else if self.chunks > 0 {
            let chunks = nirspi_recon::words::count(self.chunks, "chunk");
            parts.push(format!("wrong checksum of {chunks}"));
        } else if self.checksum {
            parts.push("wrong checksum of the file".to_owned());
        }
        if self.is_cut {
            parts.push("the file ends early".to_owned());
        }
        if let Some(place) = self.another {
            parts.push(format!("another recording begins at byte {place}"));
        }
        f.write_str(&parts.join("; "))
    }
}

/// A file that is scanned.
pub(super) struct Scan {
    file: File,
    buffer: Vec<u8>,
    /// Place of the next byte in `buffer`.
    at: usize,
    /// Place of the next byte in the file.
    position: u64,
    at_end: bool,
    /// Checksum of everything up to the end of the data.
    checksum: Option<Hasher>,
    chunk: Option<Chunk>,
    footer: bool,
    over: bool,
    pub(super) damage: Damage,
}

/// The checksum of the chunk that is being read.
struct Chunk {
    end: u64,
    expected: u32,
    hasher: Hasher,
}

impl Scan {
    pub(super) fn new(file: File) -> Self {
        Self {
            file,
            buffer: Vec::new(),
            at: 0,
            position: 0,
            at_end: false,
            checksum: Some(Hasher::new()),
            chunk: None,
            footer: false,
            over: false,
            damage: Damage::default(),
        }
    }

    /// Reads the first bytes of the file. Returns whether they are those of an MCAP file, of which
    /// one may be damaged.
    pub(super) fn begin(&mut self) -> io::Result<bool> {
        let start = self.peek(MAGIC.len())?;
        let same = start.iter().zip(MAGIC).filter(|(found, expected)| found == expected).count();
        if same + 1 < MAGIC.len() || start.len() < MAGIC.len() {
            return Ok(false);
        }
        if same < MAGIC.len() {
            (self.damage.places, self.damage.bytes) = (1, 1);
            (self.damage.first, self.checksum) = (Some(0), None);
        }
        self.advance(MAGIC.len());
        Ok(true)
    }

    /// Whether the file holds no byte.
    pub(super) fn is_empty(&mut self) -> io::Result<bool> {
        Ok(self.peek(1)?.is_empty())
    }

    /// The next bytes, at most `length`.
    fn peek(&mut self, length: usize) -> io::Result<&[u8]> {
        while self.buffer.len() - self.at < length && !self.at_end {
            if self.at > 0 {
                self.buffer.drain(..self.at);
                self.at = 0;
            }
            let missing = (length - self.buffer.len()).max(BLOCK) as u64;
            let read = (&mut self.file).take(missing).read_to_end(&mut self.buffer)?;
            self.at_end = (read as u64) < missing;
        }
        let rest = self.buffer.get(self.at..).unwrap_or(&[]);
        Ok(rest.get(..length).unwrap_or(rest))
    }

    fn advance(&mut self, length: usize) {
        let passed = self.buffer.get(self.at..self.at + length).unwrap_or(&[]);
        if let Some(checksum) = &mut self.checksum {
            checksum.update(passed);
        }
        if let Some(chunk) = &mut self.chunk {
            let inside = (chunk.end - self.position).min(length as u64) as usize;
            chunk.hasher.update(passed.get(..inside).unwrap_or(passed));
        }
        self.at += length;
        self.position += length as u64;
        if let Some(chunk) = self.chunk.take_if(|chunk| chunk.end <= self.position)
            && chunk.expected != 0
            && chunk.hasher.finalize() != chunk.expected
        {
            self.damage.chunks += 1;
        }
    }

    /// The next record that says something; `None` at the end of the file.
    pub(super) fn next(&mut self) -> io::Result<Option<Entry>> {
        while !self.over {
            if self.footer {
                self.over = true;
                self.end()?;
                break;
            }
            if !self.is_believed(false)? {
                if !self.resynchronise()? {
                    self.over = true;
                }
                continue;
            }
            if let Some(entry) = self.take()? {
                return Ok(Some(entry));
            }
        }
        Ok(None)
    }

    /// Reads what stands behind the last record: the closing magic, and nothing else in a whole file.
    fn end(&mut self) -> io::Result<()> {
        if self.peek(MAGIC.len())? != MAGIC {
            self.damage.is_cut = true;
            return Ok(());
        }
        self.advance(MAGIC.len());
        let end = self.position;
        self.damage.another = (self.peek(MAGIC.len())? == MAGIC).then_some(end);
        loop {
            match self.peek(BLOCK)?.len() {
                0 => break,
                length => self.advance(length),
            }
        }
        if self.position > end {
            self.damage.places += 1;
            self.damage.bytes += self.position - end;
            self.damage.first.get_or_insert(end);
        }
        Ok(())
    }

    /// Passes over bytes up to the next record that can be believed. False at the end of the file.
    fn resynchronise(&mut self) -> io::Result<bool> {
        let (first, mut lost) = (self.position, 0);
        loop {
            if self.peek(HEAD)?.len() < HEAD {
                // Nothing follows, so the file is cut in its last record.
                self.damage.is_cut = true;
                return Ok(false);
            }
            self.advance(1);
            lost += 1;
            if self.is_believed(true)? {
                self.damage.places += 1;
                self.damage.bytes += lost;
                self.damage.first.get_or_insert(first);
                // The file's own checksum says no more.
                self.checksum = None;
                return Ok(true);
            }
        }
    }

    /// Kind and length of the record `ahead` bytes on, if they can be those of a record. `None` at
    /// the end of the file too.
    fn head(&mut self, ahead: usize) -> io::Result<Option<(u8, usize)>> {
        let bytes = self.peek(ahead + HEAD)?;
        let Some((&kind, length)) = bytes.get(ahead..).and_then(|head| head.split_first()) else {
            return Ok(None);
        };
        let Some(length) = length.first_chunk().map(|bytes| u64::from_le_bytes(*bytes)) else {
            return Ok(None);
        };
        let possible = match kind {
            op::HEADER | op::CHANNEL => length <= 1 << 16,
            op::FOOTER => length == 20,
            op::DATA_END => length == 4,
            op::MESSAGE => (MESSAGE_HEAD as u64..=LONGEST).contains(&length),
            // Two zero bytes at least, which no packet holds.
            op::CHUNK => (40..1 << 48).contains(&length),
            op::SCHEMA..=op::DATA_END => length <= LONGEST,
            _ => false,
        };
        Ok(possible.then_some((kind, length.min(LONGEST) as usize)))
    }

    /// Whether the next bytes are a record. `strictly` after damage, where a record must say more
    /// for itself.
    fn is_believed(&mut self, strictly: bool) -> io::Result<bool> {
        let Some((kind, length)) = self.head(0)? else { return Ok(false) };
        if kind == op::CHUNK {
            // A chunk may be torn; the records in it speak for it.
            let head = HEAD + self.chunk_head()?.map_or(0, |chunk| chunk.bytes);
            return Ok(head > HEAD && (!strictly || self.head(head)?.is_some()));
        }
        let record = self.peek(HEAD + length)?;
        let Some(body) = record.get(HEAD..HEAD + length) else { return Ok(false) };
        if !fits(kind, body) {
            return Ok(false);
        }
        if kind == op::MESSAGE
            && let Some((&0, packet)) = body.get(MESSAGE_HEAD..).and_then(<[u8]>::split_last)
            && packet.len() <= MAX_DEVICE_PACKET
            && !packet.contains(&0)
            // nirspi writes the time of arrival twice.
            && (!strictly || body.get(6..14) == body.get(14..22))
        {
            return Ok(true);
        }
        if kind == op::FOOTER {
            return Ok(self.peek(HEAD + length + MAGIC.len())?.ends_with(MAGIC) || !strictly);
        }
        let is_last = self.peek(HEAD + length + HEAD)?.len() < HEAD + length + HEAD;
        Ok((is_last && !strictly) || self.head(HEAD + length)?.is_some())
    }

    /// Takes the record, which is believed.
    fn take(&mut self) -> io::Result<Option<Entry>> {
        let Some((kind, length)) = self.head(0)? else { return Ok(None) };
        if kind == op::CHUNK {
            let Some(chunk) = self.chunk_head()? else { return Ok(None) };
            if !chunk.compression.is_empty() {
                return Ok(Some(Entry::Compressed(chunk.compression)));
            }
            self.chunk = None;
            self.advance(HEAD + chunk.bytes);
            let (end, expected) = (self.position.saturating_add(chunk.records), chunk.checksum);
            self.chunk = Some(Chunk { end, expected, hasher: Hasher::new() });
            return Ok(None);
        }
        let body = self.peek(HEAD + length)?.get(HEAD..).unwrap_or(&[]);
        let mut rest = Rest(body);
        let entry = match kind {
            op::HEADER => rest.text().map(|profile| Entry::Header { profile }),
            op::CHANNEL => channel(&mut rest),
            op::MESSAGE => message(&mut rest),
            op::METADATA => metadata(&mut rest),
            op::DATA_END => {
                let expected = rest.number().map(u32::from_le_bytes);
                let found = self.checksum.take().map(Hasher::finalize);
                self.damage.checksum |= match (found, expected) {
                    (Some(found), Some(expected)) => expected != 0 && expected != found,
                    _ => false,
                };
                None
            }
            op::FOOTER => {
                self.footer = true;
                None
            }
            _ => None,
        };
        let must_say = matches!(kind, op::HEADER | op::CHANNEL | op::MESSAGE | op::METADATA);
        if must_say && entry.is_none() {
            self.damage.places += 1;
            self.damage.bytes += (HEAD + length) as u64;
            self.damage.first.get_or_insert(self.position);
        }
        self.advance(HEAD + length);
        Ok(entry)
    }

    /// The head of the chunk that begins here, if it is whole and its lengths add up to the chunk's.
    /// A wrong byte in the length of the compression's name must not make a compressed chunk of a
    /// plain one, because a compressed chunk ends the scan.
    fn chunk_head(&mut self) -> io::Result<Option<ChunkHead>> {
        let mut rest = Rest(self.peek(HEAD + 64)?.get(1..).unwrap_or(&[]));
        let read = (|| {
            let length = u64::from_le_bytes(rest.number()?);
            let before = rest.0.len();
            rest.take(24)?;
            let checksum = u32::from_le_bytes(rest.number()?);
            let compression = rest.text()?;
            let records = u64::from_le_bytes(rest.number()?);
            let bytes = before - rest.0.len();
            let is_sound = records.checked_add(bytes as u64) == Some(length)
                && compression.bytes().all(|byte| byte.is_ascii_alphanumeric());
            is_sound.then_some(ChunkHead { checksum, compression, records, bytes })
        })();
        Ok(read)
    }
}

/// Whether the lengths in a record of this kind add up to the record. A chunk whose kind is damaged
/// must not be passed over as another record.
fn fits(kind: u8, body: &[u8]) -> bool {
    let mut rest = Rest(body);
    let read = (|| {
        match kind {
            op::HEADER => [rest.block()?, rest.block()?].len(),
            op::SCHEMA => [rest.take(2)?, rest.block()?, rest.block()?, rest.block()?].len(),
            op::CHANNEL => [rest.take(4)?, rest.block()?, rest.block()?, rest.block()?].len(),
            op::MESSAGE_INDEX => [rest.take(2)?, rest.block()?].len(),
            op::CHUNK_INDEX => {
                let (times, block) = (rest.take(32)?, rest.block()?);
                [times, block, rest.take(8)?, rest.block()?, rest.take(16)?].len()
            }
            op::STATISTICS => [rest.take(42)?, rest.block()?].len(),
            op::METADATA => [rest.block()?, rest.block()?].len(),
            op::METADATA_INDEX => [rest.take(16)?, rest.block()?].len(),
            op::SUMMARY_OFFSET => rest.take(17)?.len(),
            op::MESSAGE | op::DATA_END | op::FOOTER => rest.take(body.len())?.len(),
            // Attachments; nirspi writes none.
            _ => return None,
        };
        Some(())
    })();
    read.is_some() && rest.0.is_empty()
}

struct ChunkHead {
    checksum: u32,
    compression: String,
    /// Bytes of the chunk's records.
    records: u64,
    /// Bytes of this head.
    bytes: usize,
}

fn channel(rest: &mut Rest<'_>) -> Option<Entry> {
    let id = u16::from_le_bytes(rest.number()?);
    rest.take(2)?;
    let (topic, encoding) = (rest.text()?, rest.text()?);
    Some(Entry::Channel { id, topic, encoding })
}

fn message(rest: &mut Rest<'_>) -> Option<Entry> {
    let channel = u16::from_le_bytes(rest.number()?);
    rest.take(4)?;
    let time_ns = u64::from_le_bytes(rest.number()?);
    rest.take(8)?;
    Some(Entry::Message { channel, time_ns, data: rest.0.to_vec() })
}

fn metadata(rest: &mut Rest<'_>) -> Option<Entry> {
    let name = rest.text()?;
    let mut block = Rest(rest.block()?);
    let mut texts = BTreeMap::new();
    while !block.0.is_empty() {
        texts.insert(block.text()?, block.text()?);
    }
    Some(Entry::Metadata { name, texts })
}

/// The part of a record that is not read yet.
struct Rest<'r>(&'r [u8]);

impl<'r> Rest<'r> {
    fn take(&mut self, length: usize) -> Option<&'r [u8]> {
        let (taken, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(taken)
    }

    fn number<const N: usize>(&mut self) -> Option<[u8; N]> {
        self.take(N)?.first_chunk().copied()
    }

    /// Reads a length of 32 bits, and as many bytes.
    fn block(&mut self) -> Option<&'r [u8]> {
        let length = u32::from_le_bytes(self.number()?);
        self.take(usize::try_from(length).ok()?)
    }

    fn text(&mut self) -> Option<String> {
        String::from_utf8(self.block()?.to_vec()).ok()
    }
}

#[cfg(test)]
mod tests;

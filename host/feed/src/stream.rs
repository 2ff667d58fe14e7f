//! A feed as it arrives: its header, then frame after frame.

use super::account::Account;
use super::address::{Address, AddressError, Plain, Source, pump};
use super::frames::{Frames, SecondHeader};
use super::header::{Header, HeaderError, Numbers};
use nirspi_files::trace::Raw;
use std::io::{self, Read};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::time::{Duration, Instant};
use thiserror::Error;

/// The longest header: an `h_row` of 16 sweeps of 256 x 256 patterns has 6 MiB.
pub const MAX_HEADER_BYTES: usize = 16 << 20;

/// Bytes that are read at a time.
const BLOCK: usize = 1 << 16;
/// Blocks that wait while frames are made: a tenth of a second at 20 million numbers of 16 bits a second.
pub(super) const BLOCKS: usize = 64;
/// Time between two looks whether a feed that was full has room.
const FULL: Duration = Duration::from_millis(1);
/// The longest wait between two questions whether to go on.
const TICK: Duration = Duration::from_millis(50);

/// Why a feed did not begin. `Display` is one line.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FeedError {
    /// Nothing can be read at the address.
    #[error(transparent)]
    Address(#[from] AddressError),
    /// Reading failed before the header was complete.
    #[error("{address}: {system}")]
    Lost {
        /// The address.
        address: String,
        /// The system's error.
        system: io::Error,
    },
    /// The first line is no header.
    #[error("{address}: {problem}")]
    Header {
        /// The address.
        address: String,
        /// What is wrong.
        problem: HeaderError,
    },
    /// The program was asked to stop before the header was complete.
    #[error("{0}: stopped before the header came")]
    Stopped(String),
}

/// Why a feed has ended.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum End {
    /// The sender has closed it.
    #[error("the feed ended")]
    Closed,
    /// Reading failed.
    #[error("the feed was lost: {0}")]
    Lost(io::Error),
    /// Another header came in the middle of the numbers.
    #[error(transparent)]
    SecondHeader(#[from] SecondHeader),
}

/// What came next.
#[derive(Debug)]
pub enum Next<'f> {
    /// The readings of a frame, as many as [`Header::readings`]; NaN for one that was not read.
    Frame(&'f [f64]),
    /// No frame was complete in time. No number has come for this long.
    Quiet(Duration),
    /// No more will come.
    End(&'f End),
}

/// A feed whose header has come.
#[derive(Debug)]
pub struct Feed {
    header: Header,
    frames: Frames,
    bytes: Bytes,
    /// The block whose numbers are being taken, and how far.
    block: Vec<u8>,
    at: usize,
    end: Option<End>,
}

/// Gives the numbers of this program to a [`Feed`]. The feed ends when its last giver is dropped.
#[derive(Debug, Clone)]
pub struct Giver(SyncSender<io::Result<Vec<u8>>>);

impl Giver {
    /// Gives numbers in the order in which their patterns were shown, in blocks of any length. Where the feed is full, the
    /// call waits as long as `go_on` returns true. Returns whether the feed has taken all.
    pub fn give(&self, numbers: &[f64], go_on: impl Fn() -> bool) -> bool {
        for some in numbers.chunks(BLOCK / size_of::<f64>()) {
            let mut block = Ok(some.iter().flat_map(|number| number.to_le_bytes()).collect());
            loop {
                match self.0.try_send(block) {
                    Ok(()) => break,
                    Err(TrySendError::Full(full)) if go_on() => block = full,
                    Err(_) => return false,
                }
                std::thread::sleep(FULL);
            }
        }
        true
    }
}

/// The bytes of a feed, read by a thread of their own. The thread ends with the feed; one that waits for a pipe or the
/// standard input ends with the next byte, or with the program.
#[derive(Debug)]
struct Bytes {
    blocks: Receiver<io::Result<Vec<u8>>>,
    closed: Arc<AtomicBool>,
    /// When bytes have come last.
    last: Instant,
}

impl Drop for Bytes {
    fn drop(&mut self) {
        self.closed.store(true, Ordering::Relaxed);
    }
}

impl Bytes {
    fn of(source: Box<dyn Source>) -> io::Result<Self> {
        let (give, blocks) = sync_channel(BLOCKS);
        let closed = Arc::new(AtomicBool::new(false));
        let is_closed = Arc::clone(&closed);
        std::thread::Builder::new().name("feed".to_owned()).spawn(move || {
            pump(source, &is_closed, BLOCK, |block| give.send(block).is_ok());
        })?;
        Ok(Self { blocks, closed, last: Instant::now() })
    }

    /// Bytes that the giver gives, without a thread.
    fn given() -> (Giver, Self) {
        let (give, blocks) = sync_channel(BLOCKS);
        (Giver(give), Self { blocks, closed: Arc::default(), last: Instant::now() })
    }

    /// The next block, if it comes in time; an empty block is the end.
    fn next(&mut self, patience: Duration) -> Option<io::Result<Vec<u8>>> {
        let block = match self.blocks.recv_timeout(patience) {
            Ok(block) => block,
            Err(RecvTimeoutError::Timeout) => return None,
            Err(RecvTimeoutError::Disconnected) => Ok(Vec::new()),
        };
        self.last = Instant::now();
        Some(block)
    }
}

impl Feed {
    /// Opens an address and waits for the header, as long as `go_on` returns true.
    ///
    /// # Errors
    /// [`FeedError`], one line.
    pub fn open(address: &Address, go_on: impl Fn() -> bool) -> Result<Self, FeedError> {
        Self::begin(&address.to_string(), address.open()?, go_on)
    }

    /// A feed of any reader; `name` names it in messages.
    ///
    /// # Errors
    /// As [`open`](Self::open).
    pub fn of_reader(
        name: &str,
        reader: impl Read + Send + 'static,
        go_on: impl Fn() -> bool,
    ) -> Result<Self, FeedError> {
        Self::begin(name, Box::new(Plain(reader)), go_on)
    }

    /// A feed of numbers that this program gives. What the header says of text or bytes is ignored.
    #[must_use]
    pub fn of_numbers(header: Header) -> (Giver, Self) {
        let header = Header { numbers: Numbers::Binary(Raw::F64), ..header };
        let (giver, bytes) = Bytes::given();
        let frames = Frames::new(&header);
        (giver, Self { header, frames, bytes, block: Vec::new(), at: 0, end: None })
    }

    fn begin(
        address: &str,
        source: Box<dyn Source>,
        go_on: impl Fn() -> bool,
    ) -> Result<Self, FeedError> {
        let lost = |system| FeedError::Lost { address: address.to_owned(), system };
        let refused = |problem| FeedError::Header { address: address.to_owned(), problem };
        let mut bytes = Bytes::of(source).map_err(lost)?;
        let mut line: Vec<u8> = Vec::new();
        loop {
            if !go_on() {
                return Err(FeedError::Stopped(address.to_owned()));
            }
            let Some(block) = bytes.next(TICK) else { continue };
            let block = block.map_err(lost)?;
            if block.is_empty() {
                let found = match line.len() {
                    0 => "did not come: the feed was empty".to_owned(),
                    length => format!("did not end: the feed ended after {length} bytes"),
                };
                return Err(refused(HeaderError::no_header(found)));
            }
            let end = block.iter().position(|&byte| byte == b'\n');
            line.extend_from_slice(&block[..end.unwrap_or(block.len())]);
            if let Some(found) = no_header(&line) {
                return Err(refused(HeaderError::no_header(found)));
            }
            let Some(end) = end else { continue };
            let header = std::str::from_utf8(without_mark(&line))
                .map_err(|_| HeaderError::no_header("is no text in UTF-8"))
                .and_then(str::parse::<Header>)
                .map_err(refused)?;
            let frames = Frames::new(&header);
            return Ok(Self { header, frames, bytes, block, at: end + 1, end: None });
        }
    }

    /// The header.
    #[must_use]
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The account so far.
    #[must_use]
    pub fn account(&self) -> &Account {
        self.frames.account()
    }

    /// Number of readings of a frame that has begun and is not complete.
    #[must_use]
    pub fn begun(&self) -> usize {
        self.frames.frame().len() % self.header.readings()
    }

    /// Waits for the next frame, for this long at most.
    pub fn next(&mut self, patience: Duration) -> Next<'_> {
        match (self.frame_comes(patience), &self.end) {
            (true, _) => Next::Frame(self.frames.frame()),
            (false, Some(end)) => Next::End(end),
            (false, None) => Next::Quiet(self.bytes.last.elapsed()),
        }
    }

    /// Whether a frame is complete in time.
    fn frame_comes(&mut self, patience: Duration) -> bool {
        let until = Instant::now() + patience;
        loop {
            while self.at < self.block.len() {
                match self.frames.take(&self.block[self.at..]) {
                    Ok(taken) => {
                        self.at += taken.bytes;
                        if taken.complete {
                            return true;
                        }
                    }
                    Err(second) => {
                        (self.at, self.end) = (self.block.len(), Some(second.into()));
                        // What was begun before it is counted.
                        let _ = self.frames.end();
                    }
                }
            }
            if self.end.is_some() {
                return false;
            }
            // Bytes that give no frame must not keep the caller for ever.
            let wait = until.saturating_duration_since(Instant::now());
            if wait.is_zero() && !self.block.is_empty() {
                self.block.clear();
                return false;
            }
            let end = match self.bytes.next(wait) {
                None => return false,
                Some(Ok(block)) if !block.is_empty() => {
                    (self.block, self.at) = (block, 0);
                    continue;
                }
                Some(Ok(_)) => End::Closed,
                Some(Err(error)) => End::Lost(error),
            };
            self.end = Some(end);
            match self.frames.end() {
                Ok(complete) => return complete,
                Err(second) => self.end = Some(second.into()),
            }
        }
    }
}

fn without_mark(line: &[u8]) -> &[u8] {
    line.strip_prefix("\u{feff}".as_bytes()).unwrap_or(line)
}

/// What is wrong with the beginning of a header, whatever follows.
fn no_header(line: &[u8]) -> Option<String> {
    if line.len() > MAX_HEADER_BYTES {
        return Some(format!("is longer than {} MiB", MAX_HEADER_BYTES >> 20));
    }
    let first = without_mark(line).iter().position(|byte| !byte.is_ascii_whitespace())?;
    let begin = &without_mark(line)[first..];
    // A byte-order mark may come in pieces.
    let is_mark = "\u{feff}".as_bytes().starts_with(begin);
    (begin[0] != b'{' && !is_mark).then(|| {
        let shown: String = String::from_utf8_lossy(begin).chars().take(20).collect();
        format!("begins with {shown:?}")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "{\"n\":2,\"order\":\"natural\",\"readings\":\"single\"}\n";
    const PATIENCE: Duration = Duration::from_secs(20);

    fn of(bytes: impl Into<Vec<u8>>) -> Result<Feed, FeedError> {
        Feed::of_reader("feed:test", io::Cursor::new(bytes.into()), || true)
    }

    fn refused(bytes: impl Into<Vec<u8>>) -> String {
        let line = of(bytes).err().unwrap().to_string();
        assert_eq!(line.lines().count(), 1, "{line}");
        assert!(line.starts_with("feed:test: the header "), "{line}");
        line
    }

    #[test]
    fn frames_come_until_the_end_and_the_last_needs_no_line_end() {
        let mut feed = of(format!("\u{feff}{HEADER}1 2 3 4\n5 6 7 8")).unwrap();
        assert_eq!(feed.header().hadamard().unwrap().1, [0, 1, 2, 3]);
        for expected in [[1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0]] {
            assert!(matches!(feed.next(PATIENCE), Next::Frame(frame) if frame == expected));
        }
        assert!(matches!(feed.next(PATIENCE), Next::End(End::Closed)));
        assert!(matches!(feed.next(PATIENCE), Next::End(End::Closed)));
        assert!(feed.account().is_whole() && feed.account().frames == 2);
    }

    #[test]
    fn a_frame_that_is_cut_and_a_second_header_are_counted() {
        let mut feed = of(format!("{HEADER}1 2 3 4 5 6 7")).unwrap();
        assert!(matches!(feed.next(PATIENCE), Next::Frame(_)));
        assert!(matches!(feed.next(PATIENCE), Next::End(End::Closed)));
        assert_eq!(feed.account().cut, 3);
        let mut feed = of(format!("{HEADER}1 2 3 4 5\n{HEADER}1 2 3 4\n")).unwrap();
        assert!(matches!(feed.next(PATIENCE), Next::Frame(_)));
        let Next::End(end) = feed.next(PATIENCE) else { panic!("the second header") };
        assert!(end.to_string().starts_with("a second header after 1 frame:"), "{end}");
        assert_eq!(feed.account().cut, 1);
    }

    #[test]
    fn numbers_of_this_program_are_a_feed_that_ends_with_its_giver() {
        let header = || HEADER.parse::<Header>().unwrap();
        let (giver, mut feed) = Feed::of_numbers(header());
        assert!(giver.give(&[1.0, 2.0, 3.0], || true) && giver.give(&[4.0, 5.0], || true));
        assert!(matches!(feed.next(PATIENCE), Next::Frame([1.0, 2.0, 3.0, 4.0])));
        assert!(matches!(feed.next(Duration::ZERO), Next::Quiet(_)));
        drop(giver);
        assert!(matches!(feed.next(PATIENCE), Next::End(End::Closed)));
        assert_eq!(feed.account().cut, 1);
        // A feed that nothing reads is full after some blocks, and a giver without a feed gives nothing.
        let (giver, feed) = Feed::of_numbers(header());
        assert!((0..BLOCKS).all(|_| giver.give(&[1.0], || false)));
        assert!(!giver.give(&[1.0], || false));
        drop(feed);
        assert!(!giver.give(&[1.0], || true));
    }

    #[test]
    fn a_feed_that_is_silent_says_for_how_long() {
        let (reader, mut writer) = io::pipe().unwrap();
        io::Write::write_all(&mut writer, format!("{HEADER}1 2").as_bytes()).unwrap();
        let mut feed = Feed::of_reader("feed:test", reader, || true).unwrap();
        let Next::Quiet(quiet) = feed.next(Duration::from_millis(60)) else { panic!("a frame") };
        assert!(quiet >= Duration::from_millis(50) && quiet < PATIENCE, "{quiet:?}");
        io::Write::write_all(&mut writer, b" 3 4 ").unwrap();
        assert!(matches!(feed.next(PATIENCE), Next::Frame([1.0, 2.0, 3.0, 4.0])));
    }

    #[test]
    fn what_does_not_begin_with_a_header_is_refused_in_one_line() {
        assert!(refused("").contains("the feed was empty"));
        assert!(refused("{\"n\":").contains("did not end: the feed ended after 5 bytes"));
        assert!(refused("1 2 3\n").contains("begins with \"1 2 3\", expected one JSON line"));
        assert!(refused([b'{', 0xc3, 0x28, b'\n']).contains("no text in UTF-8"));
        let stopped = Feed::of_reader("feed:test", io::empty(), || false).err().unwrap();
        assert_eq!(stopped.to_string(), "feed:test: stopped before the header came");
    }

    #[test]
    fn a_header_without_end_is_refused_before_it_fills_the_memory() {
        // It ends after the limit, so that the reason says whether the limit has refused it.
        let long = io::Cursor::new(b"{").chain(io::repeat(b' ').take(20 << 20));
        let refused = Feed::of_reader("feed:test", long, || true).err().unwrap().to_string();
        assert!(refused.contains("the header is longer than 16 MiB"), "{refused}");
    }
}

//! Reads a recording in one pass, whole or cut short: first the setup, then packet by packet.

use super::lengths;
use super::{
    ACCOUNT, IDENTITY, JSON, PROFILE, RUN, RunAccount, SETTLING, SETUP, TOPIC, protocol_of,
};
use crate::calibration::Settling;
use crate::session::CameraIdentity;
use crate::setup::MeasurementSetup;
use mcap::McapError;
use mcap::records::{Metadata, Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use nirspi_wire::version;
use serde::de::DeserializeOwned;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// The longest record of nirspi. A longer record is damaged.
const LONGEST_RECORD: usize = 64 << 20;

/// An open recording: the information before its packets, and the packets as an iterator.
///
/// ```no_run
/// # fn main() -> Result<(), nirspi::recording::RecordingError> {
/// let mut recording = nirspi::recording::Recording::open("capture.mcap".as_ref())?;
/// println!("{} patterns", recording.setup.rows.len());
/// while let Some(packet) = recording.next().transpose()? {
///     println!("{} bytes", packet.bytes.len());
/// }
/// println!("{} packets", recording.end().packets);
/// # Ok(())
/// # }
/// ```
pub struct Recording {
    /// The identity of the recorded camera.
    pub identity: CameraIdentity,
    /// The setup of the measurement.
    pub setup: MeasurementSetup,
    /// The settling of the camera, if measured.
    pub settling: Option<Settling>,
    /// Number of the run whose frames count; `None` for a recording without a number, in which the
    /// first frame's run counts.
    pub run: Option<u16>,
    records: Records,
    /// The first packet, which was read at the end of the header.
    first: Option<Packet>,
    end: End,
}

/// One packet of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Packet {
    /// The packet as received, delimiter included.
    pub bytes: Vec<u8>,
    /// Time of arrival in ns of the host's clock.
    pub time_ns: u64,
}

/// The information at the end of a recording.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct End {
    /// The account as the capture wrote it; `None` if the recording is cut short.
    pub account: Option<RunAccount>,
    /// Packets read.
    pub packets: u64,
    /// The problem, if the file ends early or is damaged. Everything before the problem was read.
    pub cut_short: Option<String>,
}

impl Recording {
    /// Opens `path` and reads the information before its packets.
    ///
    /// # Errors
    /// [`RecordingError`] if the file is not a recording, or is cut short before its first packet.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let mut records = Records::open(path)?;
        let (mut parts, mut end) = (Parts::default(), End::default());
        let first = loop {
            match records.next(&mut end)? {
                Some(Found::Packet(packet)) => break Some(packet),
                Some(Found::Metadata(metadata)) => parts.keep(path, &metadata)?,
                None => break None,
            }
        };
        let missing = |missing| RecordingError::Missing {
            path: path.to_owned(),
            missing,
            cut_short: end.cut_short.clone(),
        };
        let identity = parts.identity.ok_or_else(|| missing("identity"))?;
        let setup = parts.setup.ok_or_else(|| missing("setup"))?;
        end.account = parts.account;
        Ok(Self { identity, setup, settling: parts.settling, run: parts.run, records, first, end })
    }

    /// The information at the end of the recording. Complete after the iterator has returned its
    /// last packet.
    #[must_use]
    pub fn end(&self) -> &End {
        &self.end
    }

    fn next_packet(&mut self) -> Result<Option<Packet>, RecordingError> {
        if let Some(first) = self.first.take() {
            return Ok(Some(first));
        }
        let mut parts = Parts::default();
        loop {
            match self.records.next(&mut self.end)? {
                Some(Found::Packet(packet)) => return Ok(Some(packet)),
                Some(Found::Metadata(metadata)) => {
                    parts.keep(&self.records.path, &metadata)?;
                    if let Some(account) = parts.account.take() {
                        self.end.account = Some(account);
                    }
                }
                None => return Ok(None),
            }
        }
    }
}

/// The packets in order of arrival. A file that ends early is not an error: the iterator returns
/// every packet before the end, and [`End::cut_short`] gives the problem. After an error the
/// iterator ends.
impl Iterator for Recording {
    type Item = Result<Packet, RecordingError>;

    fn next(&mut self) -> Option<Self::Item> {
        let next = self.next_packet().transpose()?;
        match &next {
            Ok(_) => self.end.packets += 1,
            Err(_) => self.records.over = true,
        }
        Some(next)
    }
}

/// The records of a file that the reader needs, one by one.
struct Records {
    path: PathBuf,
    file: File,
    reader: LinearReader,
    /// Whether the header says that nirspi wrote the file.
    ours: bool,
    over: bool,
}

/// A record that the reader needs.
enum Found {
    Packet(Packet),
    Metadata(Metadata),
}

impl Records {
    fn open(path: &Path) -> Result<Self, RecordingError> {
        let io_error = |source| RecordingError::Io { path: path.to_owned(), source };
        // Opening a pipe would wait for a writer, and a device may never end.
        if !std::fs::metadata(path).map_err(io_error)?.is_file() {
            let found = "a folder, a device or a pipe".to_owned();
            return Err(RecordingError::NotARecording { path: path.to_owned(), found });
        }
        let file = File::open(path).map_err(io_error)?;
        let reader = LinearReader::new_with_options(
            LinearReaderOptions::default()
                // Each packet has its own checksum. The checksum of the data section covers the
                // information about the packets.
                .with_validate_data_section_crc(true)
                // Whole chunks are refused below, because the crate panics on some damaged chunks
                // (0.26, found by fuzzing).
                .with_emit_chunks(true)
                .with_record_length_limit(LONGEST_RECORD),
        );
        Ok(Self { path: path.to_owned(), file, reader, ours: false, over: false })
    }

    /// The next record that the reader needs; `None` at the end of the file, or at damage, which
    /// `end` then reports.
    fn next(&mut self, end: &mut End) -> Result<Option<Found>, RecordingError> {
        let Self { path, file, reader, ours, over } = self;
        let io_error = |source| RecordingError::Io { path: path.clone(), source };
        let not_ours = |found: String| RecordingError::NotARecording { path: path.clone(), found };
        if *over {
            return Ok(None);
        }
        while let Some(event) = reader.next_event() {
            let record = match event {
                Ok(LinearReadEvent::ReadRequest(need)) => {
                    let read = file.read(reader.insert(need)).map_err(io_error)?;
                    reader.notify_read(read);
                    continue;
                }
                // Only records that nirspi writes are parsed, because the crate panics on some
                // damaged attachments (0.26, found by fuzzing).
                Ok(LinearReadEvent::Record {
                    opcode: opcode @ (op::HEADER | op::CHANNEL | op::MESSAGE | op::METADATA),
                    data,
                }) if lengths::fit(opcode, data) => mcap::parse_record(opcode, data),
                Ok(LinearReadEvent::Record {
                    opcode: op::HEADER | op::CHANNEL | op::METADATA,
                    ..
                }) => Err(McapError::UnexpectedEof),
                Ok(LinearReadEvent::Record { opcode: op::CHUNK, .. }) => {
                    return Err(not_ours(
                        "records in chunks, as other tools write them,".to_owned(),
                    ));
                }
                Ok(LinearReadEvent::Record { .. }) => continue,
                Err(error) => Err(error),
            };
            match record {
                Ok(Record::Header(header)) if header.profile == PROFILE => *ours = true,
                Ok(Record::Header(header)) => {
                    return Err(not_ours(format!("an MCAP file of profile {:?}", header.profile)));
                }
                Ok(Record::Channel(channel)) => {
                    let protocol = protocol_of(&channel.message_encoding);
                    if channel.topic != TOPIC || !protocol.is_some_and(version::speaks) {
                        let found = format!("{:?} {:?}", channel.topic, channel.message_encoding);
                        return Err(RecordingError::Version { path: path.clone(), found });
                    }
                }
                Ok(Record::Message { header, data }) => {
                    let packet = Packet { bytes: data.into_owned(), time_ns: header.log_time };
                    return Ok(Some(Found::Packet(packet)));
                }
                Ok(Record::Metadata(metadata)) => return Ok(Some(Found::Metadata(metadata))),
                Ok(_) => {}
                Err(McapError::UnexpectedEof) if !*ours => {
                    return Err(not_ours("an empty or cut file".to_owned()));
                }
                Err(McapError::BadMagic) => {
                    return Err(not_ours("a file of another kind".to_owned()));
                }
                Err(error) if !*ours => return Err(not_ours(one_line(&error))),
                Err(error) => {
                    end.cut_short = Some(one_line(&error));
                    break;
                }
            }
        }
        *over = true;
        if *ours { Ok(None) } else { Err(not_ours("an empty or foreign file".to_owned())) }
    }
}

/// Why a file cannot be read as a recording.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// The file cannot be read.
    #[error("{path}: cannot read the recording")]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// The file is not a recording of nirspi.
    #[error("{path}: {found}, expected a nirspi recording (MCAP)")]
    NotARecording {
        /// The file.
        path: PathBuf,
        /// The kind of the file.
        found: String,
    },
    /// The recording has a newer wire protocol.
    #[error(
        "{path}: recorded as {found}, this program reads {TOPIC:?} of nirspi-wire-v{} to v{}: update this program",
        version::MIN,
        version::CURRENT
    )]
    Version {
        /// The file.
        path: PathBuf,
        /// The encoding of the channel.
        found: String,
    },
    /// A required part is missing.
    #[error("{path}: no {missing} in the recording{}", cut_note(.cut_short))]
    Missing {
        /// The file.
        path: PathBuf,
        /// The part.
        missing: &'static str,
        /// Whether the file is cut short.
        cut_short: Option<String>,
    },
    /// A part cannot be parsed.
    #[error("{path}: the recording's {part} does not read: {reason}")]
    Damaged {
        /// The file.
        path: PathBuf,
        /// The part.
        part: &'static str,
        /// The parser's reason.
        reason: String,
    },
}

fn cut_note(cut_short: &Option<String>) -> String {
    cut_short.as_ref().map_or_else(String::new, |reason| format!(", which is cut short: {reason}"))
}

/// One line of the parser's messages, which are drawings of several lines.
fn one_line(error: &McapError) -> String {
    let text = error.to_string();
    let words: Vec<&str> = text.split_whitespace().take(16).collect();
    words.join(" ")
}

#[derive(Default)]
struct Parts {
    identity: Option<CameraIdentity>,
    setup: Option<MeasurementSetup>,
    settling: Option<Settling>,
    run: Option<u16>,
    account: Option<RunAccount>,
}

impl Parts {
    fn keep(&mut self, path: &Path, metadata: &Metadata) -> Result<(), RecordingError> {
        match metadata.name.as_str() {
            IDENTITY => self.identity = Some(parse(path, "identity", metadata)?),
            SETUP => {
                let setup: MeasurementSetup = parse(path, "setup", metadata)?;
                setup.check().map_err(|problem| damaged(path, "setup", &problem))?;
                self.setup = Some(setup);
            }
            SETTLING => {
                let settling: Settling = parse(path, "settling", metadata)?;
                settling.check().map_err(|problem| damaged(path, "settling", &problem))?;
                self.settling = Some(settling);
            }
            RUN => self.run = Some(parse(path, "run", metadata)?),
            ACCOUNT => self.account = Some(parse(path, "account", metadata)?),
            _ => {}
        }
        Ok(())
    }
}

fn parse<T: DeserializeOwned>(
    path: &Path,
    part: &'static str,
    metadata: &Metadata,
) -> Result<T, RecordingError> {
    let json = metadata.metadata.get(JSON).map_or("", String::as_str);
    serde_json::from_str(json).map_err(|error| damaged(path, part, &error))
}

fn damaged(path: &Path, part: &'static str, problem: &impl ToString) -> RecordingError {
    RecordingError::Damaged { path: path.to_owned(), part, reason: problem.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::account::LossCounters;
    use crate::recording::{Recorder, Target};

    fn identity() -> CameraIdentity {
        CameraIdentity {
            protocol: 1,
            firmware: "0.1.0".into(),
            gateware: "0.1.0".into(),
            board: "virtual".into(),
            serial: "1".into(),
            adc_hz: 125_000_000,
            adc_bits: 14,
            wavelength_nm: 1550,
            capabilities: Vec::new(),
        }
    }

    fn setup() -> MeasurementSetup {
        MeasurementSetup::new(&nirspi_recon::Order::CakeCutting, 0.3).unwrap()
    }

    fn account(received: u64) -> RunAccount {
        let counters = LossCounters { received, ..Default::default() };
        RunAccount { counters, made: Some(received), ..Default::default() }
    }

    fn recording(path: &Path, packets: usize) {
        let target = Target::New(path.to_owned());
        let mut recorder = Recorder::create(&target, &identity(), &setup(), None, Some(7)).unwrap();
        for n in 0..packets {
            recorder.packet(&vec![n as u8; 5000]).unwrap();
        }
        recorder.finish(&account(packets as u64)).unwrap();
    }

    #[test]
    fn packets_come_back_as_they_were() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        recording(&path, 700);
        let mut recording = Recording::open(&path).unwrap();
        assert_eq!((&recording.identity, &recording.setup), (&identity(), &setup()));
        assert_eq!(recording.run, Some(7));
        for (count, packet) in recording.by_ref().enumerate() {
            assert_eq!(packet.unwrap().bytes, vec![count as u8; 5000]);
        }
        let account = Some(account(700));
        assert_eq!(recording.end(), &End { account, packets: 700, cut_short: None });
    }

    #[test]
    fn a_recording_cut_anywhere_gives_what_is_before_the_cut_or_says_what_is_missing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        recording(&path, 450);
        let whole = std::fs::read(&path).unwrap();
        let cut_path = folder.path().join("cut.mcap");
        let mut most = 0;
        for cut in (0..whole.len()).step_by(whole.len() / 97 + 1) {
            std::fs::write(&cut_path, &whole[..cut]).unwrap();
            match Recording::open(&cut_path) {
                Ok(mut recording) => {
                    assert!(recording.by_ref().all(|packet| packet.unwrap().bytes.len() == 5000));
                    let count = recording.end().packets;
                    let cut_short = recording.end().cut_short.as_ref();
                    assert!(cut_short.is_some(), "cut at {cut} went unnoticed");
                    assert!(count >= most, "{count} packets at {cut}, {most} before");
                    most = count;
                }
                Err(error) => assert_eq!(error.to_string().lines().count(), 1, "{error}"),
            }
        }
        assert!(most > 200, "only {most} packets of a file that is nearly whole");
    }

    #[test]
    fn a_damaged_record_of_a_kind_that_we_do_not_write_is_passed_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        recording(&path, 3);
        // An attachment of two zero bytes, directly after magic and header. The header's length
        // marks its end.
        let mut bytes = std::fs::read(&path).unwrap();
        let header = 8 + 9 + u64::from_le_bytes(bytes[9..17].try_into().unwrap()) as usize;
        bytes.splice(header..header, [op::ATTACHMENT, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
        std::fs::write(&path, bytes).unwrap();
        assert_eq!(Recording::open(&path).unwrap().filter_map(Result::ok).count(), 3);
    }

    #[test]
    fn another_file_is_refused_in_one_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.mcap");
        for content in [&b""[..], b"PK\x03\x04 not an mcap", &[0x89; 100]] {
            std::fs::write(&path, content).unwrap();
            let error = Recording::open(&path).err().unwrap().to_string();
            assert!(error.contains("x.mcap") && error.lines().count() == 1, "{error}");
        }
    }
}

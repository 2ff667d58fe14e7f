//! Reads a recording back, whole or cut short.

use super::{ACCOUNT, ENCODING, IDENTITY, JSON, PROFILE, SETTLING, SETUP, TOPIC};
use crate::account::LossCounters;
use crate::calibration::Settling;
use crate::session::CameraIdentity;
use crate::setup::MeasurementSetup;
use mcap::McapError;
use mcap::records::{Metadata, Record, op};
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use serde::de::DeserializeOwned;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use thiserror::Error;

/// No record of ours is longer; a longer one is damage.
const LONGEST_RECORD: usize = 64 << 20;

/// What a recording says besides its packets.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// Who was recorded.
    pub identity: CameraIdentity,
    /// What was measured.
    pub setup: MeasurementSetup,
    /// How the camera settles, where that was measured.
    pub settling: Option<Settling>,
    /// The account as the capture closed it; `None` where it was cut short.
    pub account: Option<LossCounters>,
    /// Packets read.
    pub packets: u64,
    /// Where the file ends in the middle or is damaged: what is wrong there. All before it was read.
    pub cut_short: Option<String>,
}

/// Why a file is no recording.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The file cannot be read.
    #[error("{path}: {source}")]
    Io {
        /// Which file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// Not one of ours.
    #[error("{path}: {found}, expected a nirspi recording (MCAP)")]
    NotARecording {
        /// Which file.
        path: PathBuf,
        /// What it is instead.
        found: String,
    },
    /// A recording of another wire protocol.
    #[error("{path}: recorded as {found}, this program reads {ENCODING}")]
    Version {
        /// Which file.
        path: PathBuf,
        /// What the channel says.
        found: String,
    },
    /// A part that every recording has is not there.
    #[error("{path}: no {missing} in the recording{}", cut_note(.cut_short))]
    Missing {
        /// Which file.
        path: PathBuf,
        /// Which part.
        missing: &'static str,
        /// Whether the file is cut short.
        cut_short: Option<String>,
    },
    /// A part that does not read.
    #[error("{path}: the recording's {part} does not read: {reason}")]
    Damaged {
        /// Which file.
        path: PathBuf,
        /// Which part.
        part: &'static str,
        /// Why.
        reason: String,
    },
}

fn cut_note(cut_short: &Option<String>) -> String {
    cut_short.as_ref().map_or_else(String::new, |reason| format!(", which is cut short: {reason}"))
}

/// Reads `path`, giving each packet (delimiter included) and its arrival time in ns to `packet`.
///
/// # Errors
/// [`RecordingError`]. A file that ends in the middle is no error: everything before is given.
pub fn read(path: &Path, mut packet: impl FnMut(&[u8], u64)) -> Result<Recording, RecordingError> {
    let io_error = |source| RecordingError::Io { path: path.to_owned(), source };
    let not_ours = |found: String| RecordingError::NotARecording { path: path.to_owned(), found };
    let mut file = File::open(path).map_err(io_error)?;
    let mut reader = LinearReader::new_with_options(
        LinearReaderOptions::default()
            // Each packet has a checksum of its own; that of the whole data section covers what is said about them.
            .with_validate_data_section_crc(true)
            // Whole, they are refused below: the crate panics on some damaged chunks (0.26, found by fuzzing).
            .with_emit_chunks(true)
            .with_record_length_limit(LONGEST_RECORD),
    );
    let mut parts = Parts::default();
    let mut packets = 0;
    let mut cut_short = None;
    let mut ours = false;
    while let Some(event) = reader.next_event() {
        let record = match event {
            Ok(LinearReadEvent::ReadRequest(need)) => {
                let read = file.read(reader.insert(need)).map_err(io_error)?;
                reader.notify_read(read);
                continue;
            }
            // Only what we write is looked at: the crate panics on some damaged attachments (0.26, found by fuzzing).
            Ok(LinearReadEvent::Record {
                opcode: opcode @ (op::HEADER | op::CHANNEL | op::MESSAGE | op::METADATA),
                data,
            }) => mcap::parse_record(opcode, data),
            Ok(LinearReadEvent::Record { opcode: op::CHUNK, .. }) => {
                return Err(not_ours("records in chunks, as other tools write them,".to_owned()));
            }
            Ok(LinearReadEvent::Record { .. }) => continue,
            Err(error) => Err(error),
        };
        match record {
            Ok(Record::Header(header)) if header.profile == PROFILE => ours = true,
            Ok(Record::Header(header)) => {
                return Err(not_ours(format!("an MCAP file of profile {:?}", header.profile)));
            }
            Ok(Record::Channel(channel)) => {
                if channel.topic != TOPIC || channel.message_encoding != ENCODING {
                    let found = format!("{:?} {:?}", channel.topic, channel.message_encoding);
                    return Err(RecordingError::Version { path: path.to_owned(), found });
                }
            }
            Ok(Record::Message { header, data }) => {
                packets += 1;
                packet(&data, header.log_time);
            }
            Ok(Record::Metadata(metadata)) => parts.keep(path, &metadata)?,
            Ok(_) => {}
            Err(McapError::UnexpectedEof) if !ours => {
                return Err(not_ours("an empty or cut file".to_owned()));
            }
            Err(McapError::BadMagic) => return Err(not_ours("a file of another kind".to_owned())),
            Err(error) if !ours => return Err(not_ours(one_line(&error))),
            Err(error) => {
                cut_short = Some(one_line(&error));
                break;
            }
        }
    }
    if !ours {
        return Err(not_ours("an empty or foreign file".to_owned()));
    }
    let missing = |missing| {
        let (path, cut_short) = (path.to_owned(), cut_short.clone());
        RecordingError::Missing { path, missing, cut_short }
    };
    Ok(Recording {
        identity: parts.identity.ok_or_else(|| missing("identity"))?,
        setup: parts.setup.ok_or_else(|| missing("setup"))?,
        settling: parts.settling,
        account: parts.account,
        packets,
        cut_short,
    })
}

/// The parser's messages are drawings of several lines.
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
    account: Option<LossCounters>,
}

impl Parts {
    fn keep(&mut self, path: &Path, metadata: &Metadata) -> Result<(), RecordingError> {
        match metadata.name.as_str() {
            IDENTITY => self.identity = Some(parse(path, "identity", metadata)?),
            SETUP => self.setup = Some(parse(path, "setup", metadata)?),
            SETTLING => self.settling = Some(parse(path, "settling", metadata)?),
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
    serde_json::from_str(json).map_err(|error| RecordingError::Damaged {
        path: path.to_owned(),
        part,
        reason: error.to_string(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Recorder;

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
        }
    }

    fn setup() -> MeasurementSetup {
        MeasurementSetup::new(&nirspi_recon::Order::CakeCutting, 0.3).unwrap()
    }

    fn recording(path: &Path, packets: usize) {
        let mut recorder = Recorder::create(path, &identity(), &setup(), None).unwrap();
        for n in 0..packets {
            recorder.packet(&vec![n as u8; 5000]).unwrap();
        }
        recorder.finish(&LossCounters { received: packets as u64, ..Default::default() }).unwrap();
    }

    #[test]
    fn packets_come_back_as_they_were() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.mcap");
        recording(&path, 700);
        let mut count = 0usize;
        let recording = read(&path, |packet, _| {
            assert_eq!(packet, vec![count as u8; 5000]);
            count += 1;
        })
        .unwrap();
        assert_eq!(count, 700);
        assert_eq!(recording.setup, setup());
        assert_eq!(recording.account.map(|a| a.received), Some(700));
        assert_eq!(recording.cut_short, None);
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
            let mut count = 0;
            match read(&cut_path, |packet, _| {
                assert_eq!(packet.len(), 5000);
                count += 1;
            }) {
                Ok(recording) => {
                    assert!(recording.cut_short.is_some(), "cut at {cut} went unnoticed");
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
        // An attachment of two zero bytes, right after magic and header, which end at the header's length.
        let mut bytes = std::fs::read(&path).unwrap();
        let header = 8 + 9 + u64::from_le_bytes(bytes[9..17].try_into().unwrap()) as usize;
        bytes.splice(header..header, [op::ATTACHMENT, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
        std::fs::write(&path, bytes).unwrap();
        let mut count = 0;
        read(&path, |_, _| count += 1).unwrap();
        assert_eq!(count, 3);
    }

    #[test]
    fn another_file_is_refused_in_one_line() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.mcap");
        for content in [&b""[..], b"PK\x03\x04 not an mcap", &[0x89; 100]] {
            std::fs::write(&path, content).unwrap();
            let error = read(&path, |_, _| {}).unwrap_err().to_string();
            assert!(error.contains("x.mcap") && error.lines().count() == 1, "{error}");
        }
    }
}

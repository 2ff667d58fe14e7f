//! Reads a recording in one pass, whole or cut short: first the setup, then packet by packet.

use super::scan::{Damage, Entry, Scan};
use super::{
    ACCOUNT, CHECKSUM, IDENTITY, JSON, PART, PROFILE, Part, RUN, RunAccount, SETTLING, SETUP,
    TOPIC, protocol_of,
};
use nirspi_camera::response::Settling;
use nirspi_camera::setup::MeasurementSetup;
use nirspi_camera::tally::FrameCount;
use nirspi_files::identity::CameraIdentity;
use nirspi_files::provenance::{KEY, Provenance};
use nirspi_wire::packet::MAX_DEVICE_PACKET;
use nirspi_wire::{crc32, version};
use serde::de::DeserializeOwned;
use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// An open recording: the information before its packets, and the packets as an iterator.
///
/// ```no_run
/// # fn main() -> Result<(), nirspi_record::recording::RecordingError> {
/// let mut recording = nirspi_record::recording::Recording::open("capture.mcap".as_ref())?;
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
    /// The place of the file in a run of several files; `None` for a run in one file.
    pub part: Option<Part>,
    /// The program that wrote the file, if the file says so.
    pub provenance: Option<Provenance>,
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
    /// The problem in words, if the file ends early or is damaged. Everything else was read.
    pub cut_short: Option<String>,
    /// What is damaged.
    pub damage: Damage,
}

impl Recording {
    /// Opens `path` and reads the information before its packets. A recording says the information
    /// once more at its end; if the first copy is damaged, the second one counts.
    ///
    /// # Errors
    /// [`RecordingError`] if the file is not a recording, or both copies are damaged or missing.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        let mut records = Records::open(path)?;
        let (mut parts, mut end) = (Parts::default(), End::default());
        let first = loop {
            match records.next(&mut end)? {
                Some(Found::Packet(packet)) => break Some(packet),
                Some(Found::Metadata { name, texts }) => parts.keep(path, &name, &texts),
                None => break None,
            }
        };
        if parts.lacks() && first.is_some() {
            let mut again = Records::open(path)?;
            let mut far = End::default();
            while let Some(found) = again.next(&mut far)? {
                if let Found::Metadata { name, texts } = found {
                    parts.keep(path, &name, &texts);
                }
            }
            end.cut_short = far.cut_short;
        }
        // A damaged version in the channel is outvoted by an identity with a right checksum.
        if let (Some(found), false) = (records.unspoken.take(), parts.is_vouched) {
            return Err(RecordingError::Version { path: path.to_owned(), found });
        }
        let mut problem = parts.problem.take();
        let mut missing = |missing| {
            let (path, cut_short) = (path.to_owned(), end.cut_short.clone());
            problem.take().unwrap_or(RecordingError::Missing { path, missing, cut_short })
        };
        let identity = parts.identity.ok_or_else(|| missing("identity"))?;
        let setup = parts.setup.ok_or_else(|| missing("setup"))?;
        if let Some(problem) = problem {
            return Err(problem);
        }
        // What is wrong with the file is said at its end.
        if first.is_some() {
            end = End::default();
        }
        end.account = parts.account;
        let Parts { settling, run, part, provenance, .. } = parts;
        Ok(Self { identity, setup, settling, run, part, provenance, records, first, end })
    }

    /// Number of the first frame of the file in its run.
    #[must_use]
    pub fn first_frame(&self) -> u64 {
        self.part.as_ref().map_or(0, |part| part.first_frame)
    }

    /// The count of the recording's frames before its first packet.
    #[must_use]
    pub fn frame_count(&self) -> FrameCount {
        FrameCount::new(&self.setup, self.run).beginning_at(self.first_frame())
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
                Some(Found::Metadata { name, texts }) => {
                    parts.keep(&self.records.path, &name, &texts);
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
    scan: Scan,
    /// The profile in the header of the file.
    profile: Option<String>,
    /// The channel of the packets.
    wire: Option<u16>,
    /// Other channels.
    others: Vec<u16>,
    /// Topic and encoding of packets in a protocol version that this program does not speak.
    unspoken: Option<String>,
    over: bool,
}

/// A record that the reader needs.
enum Found {
    Packet(Packet),
    Metadata { name: String, texts: BTreeMap<String, String> },
}

impl Records {
    fn open(path: &Path) -> Result<Self, RecordingError> {
        let io_error = |source| RecordingError::Io { path: path.to_owned(), source };
        let refuse = |found: &str| {
            Err(RecordingError::NotARecording { path: path.to_owned(), found: found.to_owned() })
        };
        // Opening a pipe would wait for a writer, and a device may never end.
        if !std::fs::metadata(path).map_err(io_error)?.is_file() {
            return refuse("a folder, a device or a pipe");
        }
        let mut scan = Scan::new(File::open(path).map_err(io_error)?);
        if scan.is_empty().map_err(io_error)? {
            return refuse("an empty or cut file");
        }
        if !scan.begin().map_err(io_error)? {
            return refuse("a file of another kind");
        }
        Ok(Self {
            path: path.to_owned(),
            scan,
            profile: None,
            wire: None,
            others: Vec::new(),
            unspoken: None,
            over: false,
        })
    }

    /// The next record that the reader needs; `None` at the end of the file. `end` then says what
    /// is wrong with the file.
    fn next(&mut self, end: &mut End) -> Result<Option<Found>, RecordingError> {
        if self.over {
            return Ok(None);
        }
        let path = &self.path;
        let io_error = |source| RecordingError::Io { path: path.clone(), source };
        while let Some(entry) = self.scan.next().map_err(io_error)? {
            match entry {
                Entry::Header { profile } => self.profile = Some(profile),
                // One of the two may be damaged.
                Entry::Channel { id, topic, encoding }
                    if topic == TOPIC || protocol_of(&encoding).is_some() =>
                {
                    if !protocol_of(&encoding).is_some_and(version::speaks) {
                        self.unspoken = Some(format!("{topic:?} {encoding:?}"));
                    }
                    self.wire = Some(id);
                }
                Entry::Channel { id, .. } => self.others.push(id),
                Entry::Compressed(_) => {
                    return Err(RecordingError::NotARecording {
                        path: path.clone(),
                        found: "records in compressed chunks, as other tools write them".to_owned(),
                    });
                }
                Entry::Message { channel, time_ns, data } => {
                    self.check_ours()?;
                    if self.is_packet(channel, &data) {
                        return Ok(Some(Found::Packet(Packet { bytes: data, time_ns })));
                    }
                }
                Entry::Metadata { name, texts } => {
                    self.check_ours()?;
                    return Ok(Some(Found::Metadata { name, texts }));
                }
            }
        }
        self.over = true;
        self.check_ours()?;
        end.damage = self.scan.damage.clone();
        if end.damage != Damage::default() {
            end.cut_short = Some(end.damage.to_string());
        }
        Ok(None)
    }

    /// Whether a message is a packet. In a channel that is not known, because a record is damaged,
    /// the message has to look like a packet.
    fn is_packet(&self, channel: u16, data: &[u8]) -> bool {
        match (self.wire == Some(channel), self.others.contains(&channel)) {
            (true, false) => true,
            (false, true) => false,
            (true, true) | (false, false) => {
                data.len() <= MAX_DEVICE_PACKET + 1
                    && data.iter().position(|&byte| byte == 0) == data.len().checked_sub(1)
            }
        }
    }

    /// Refuses a file of another program.
    fn check_ours(&self) -> Result<(), RecordingError> {
        let refuse =
            |found: String| Err(RecordingError::NotARecording { path: self.path.clone(), found });
        match &self.profile {
            _ if self.wire.is_some() => Ok(()),
            Some(profile) if profile == PROFILE => Ok(()),
            Some(profile) => refuse(format!("an MCAP file of profile {profile:?}")),
            None => refuse("an empty or foreign file".to_owned()),
        }
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
        "{path}: recorded as {found}, this program reads {TOPIC:?} of protocol {}: update this program",
        version::Spoken
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

#[derive(Default)]
struct Parts {
    identity: Option<CameraIdentity>,
    setup: Option<MeasurementSetup>,
    settling: Option<Settling>,
    run: Option<u16>,
    part: Option<Part>,
    provenance: Option<Provenance>,
    account: Option<RunAccount>,
    /// Whether the identity has a checksum, and this program speaks its protocol.
    is_vouched: bool,
    /// Why a part could not be read. A later copy of the part clears the problem.
    problem: Option<RecordingError>,
}

impl Parts {
    /// Keeps a part. The first sound copy counts.
    fn keep(&mut self, path: &Path, name: &str, texts: &BTreeMap<String, String>) {
        let kept = match name {
            IDENTITY => fill(&mut self.identity, path, "identity", texts, |_| Ok(())),
            SETUP => fill(&mut self.setup, path, "setup", texts, |setup: &MeasurementSetup| {
                setup.check().map_err(|problem| problem.to_string())
            }),
            SETTLING => fill(&mut self.settling, path, "settling", texts, |found: &Settling| {
                found.check().map_err(|problem| problem.to_string())
            }),
            RUN => fill(&mut self.run, path, "run", texts, |_| Ok(())),
            PART => fill(&mut self.part, path, "part", texts, Part::check),
            // A recording whose provenance is damaged is read all the same.
            KEY => {
                Ok(fill(&mut self.provenance, path, "provenance", texts, |_| Ok(()))
                    .unwrap_or(false))
            }
            ACCOUNT => fill(&mut self.account, path, "account", texts, |_| Ok(())),
            _ => Ok(false),
        };
        match kept {
            Ok(true) => {
                if let (IDENTITY, Some(identity)) = (name, &self.identity) {
                    let has_checksum = texts.contains_key(CHECKSUM);
                    self.is_vouched = has_checksum && version::speaks(identity.protocol);
                }
                let cleared = |problem: &mut RecordingError| matches!(problem, RecordingError::Damaged { part, .. } if name.ends_with(*part));
                self.problem.take_if(cleared);
            }
            Ok(false) => {}
            Err(problem) => {
                self.problem.get_or_insert(problem);
            }
        }
    }

    /// Whether a part is missing that every recording has, or damaged.
    fn lacks(&self) -> bool {
        self.identity.is_none() || self.setup.is_none() || self.problem.is_some()
    }
}

/// Fills a part that is not known yet. Returns whether the part is filled now.
fn fill<T: DeserializeOwned>(
    part: &mut Option<T>,
    path: &Path,
    name: &'static str,
    texts: &BTreeMap<String, String>,
    check: impl Fn(&T) -> Result<(), String>,
) -> Result<bool, RecordingError> {
    if part.is_some() {
        return Ok(false);
    }
    let damaged =
        |reason: String| RecordingError::Damaged { path: path.to_owned(), part: name, reason };
    let json = texts.get(JSON).map_or("", String::as_str);
    // Recordings before 0.2 have no checksum.
    if let Some(expected) = texts.get(CHECKSUM)
        && *expected != checksum(json)
    {
        return Err(damaged("its checksum is wrong".to_owned()));
    }
    let value = serde_json::from_str(json).map_err(|error| damaged(error.to_string()))?;
    check(&value).map_err(damaged)?;
    *part = Some(value);
    Ok(true)
}

/// The checksum of a part's text.
pub(super) fn checksum(json: &str) -> String {
    format!("{:08x}", crc32(json.as_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::{Opening, Recorder, Target};
    use nirspi_camera::account::LossCounters;

    fn identity() -> CameraIdentity {
        CameraIdentity::current("virtual", "1")
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
        let mut recorder =
            Recorder::create(&target, &Opening::of(&identity(), &setup(), 7)).unwrap();
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
        assert_eq!(recording.end(), &End { account, packets: 700, ..End::default() });
    }

    #[test]
    fn damaged_provenance_is_left_out_and_no_other_damage_is() {
        let damaged = BTreeMap::from([(JSON.to_owned(), "{".to_owned())]);
        let mut parts = Parts::default();
        parts.keep(Path::new("a.mcap"), KEY, &damaged);
        assert!(parts.provenance.is_none() && parts.problem.is_none());
        parts.keep(Path::new("a.mcap"), RUN, &damaged);
        assert!(parts.problem.is_some());
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
        bytes.splice(header..header, [9, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
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

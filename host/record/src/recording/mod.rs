//! Recordings: an MCAP file with every wire packet as received, and the information to interpret
//! the packets.
//!
//! Channel `/wire` holds the packets (COBS, delimiter included), both intact and damaged. The
//! message encoding names the protocol version of the session. Recordings of all versions from
//! `version::MIN` on are read. Metadata records hold the camera's identity, the setup, the
//! calibration, the number of the run, the place of a file in a run of several files (`split`), and, at
//! the end, the account of the run; each is one JSON
//! text with a checksum, and stands once more at the end. Channels `/telemetry` and `/log`, and
//! `/image` and `/calibration` in an exported file, say the same in forms that other programs show
//! (`schemas.rs`); nothing is read from them. Times are nanoseconds of the host's clock. Records are
//! in chunks of about 1 MiB, not compressed, each with a checksum and an index.
//!
//! # Invariant
//! A capture that is killed keeps everything up to its last flush, half a second before at most if the
//! disk keeps up
//! (test
//! `reader::tests::a_recording_cut_anywhere_gives_what_is_before_the_cut_or_says_what_is_missing`).
//! If the computer loses power, everything flushed five seconds before is on the disk. Damage in
//! the middle of a file costs what it hits, and is reported (`host/tests/damaged_recordings.rs`).

mod book;
mod file;
mod hear;
mod info;
mod monitor;
mod protobuf;
mod reader;
mod recover;
mod run;
mod scan;
mod schemas;
mod split;
mod spool;
mod sync;
mod writer;

pub use book::{Book, Opening};
pub use file::Target;
pub use hear::{Heard, hear_recording, tally_recording};
pub use info::RecordingInfo;
pub use reader::{End, Packet, Recording, RecordingError};
pub use recover::{RecoverError, Recovered, recover};
pub use run::RunAccount;
pub use scan::Damage;
pub use schemas::Pinhole;
pub use split::{Part, Split, SplitError};
pub(crate) use split::{name_of, part_path};
pub use writer::Recorder;

/// MCAP profile of nirspi's files.
pub const PROFILE: &str = "nirspi";
/// Topic of the packets.
pub const TOPIC: &str = "/wire";
/// Message encoding of the packets, without the number of the wire protocol's version.
const ENCODING: &str = "nirspi-wire-v";

/// Message encoding of the packets of a session of this protocol version.
#[must_use]
pub fn encoding(protocol: u16) -> String {
    format!("{ENCODING}{protocol}")
}

/// The protocol version that a message encoding names.
fn protocol_of(encoding: &str) -> Option<u16> {
    encoding.strip_prefix(ENCODING)?.parse().ok()
}

const IDENTITY: &str = "nirspi.identity";
const SETUP: &str = "nirspi.setup";
const SETTLING: &str = "nirspi.settling";
/// Number of the recorded run. Frames of another run are stragglers. Recordings before 0.2 have no
/// number.
const RUN: &str = "nirspi.run";
/// The place of the file in a run of several files. A run in one file has no such record.
const PART: &str = "nirspi.part";
const ACCOUNT: &str = "nirspi.account";
/// The key of the text in each metadata record.
const JSON: &str = "json";
/// The key of the text's checksum.
const CHECKSUM: &str = "crc32";

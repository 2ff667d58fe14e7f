//! Recordings: an MCAP file with every wire packet as it came, and what is needed to understand them.
//!
//! Channel `/wire` holds the packets (COBS, delimiter included), intact ones and damaged ones alike; the
//! message encoding names the protocol version of the session; recordings of all versions from `version::MIN` on
//! are read. Metadata records hold the camera's identity, the setup, the calibration, the number of the run and, at
//! the end, the account of the run, each as one JSON text. Times are nanoseconds of the
//! host's clock. Records follow each other plainly, in no chunks: a file that ends anywhere, or is damaged in one
//! packet, loses no other, and the crate's chunk reader, which panics on some damage, is never used.
//!
//! # Invariant
//! A capture that is killed keeps everything up to its last flush, half a second before at most; of a computer that loses
//! power, what was flushed five seconds before is on the disk:
//! `reader::tests::a_recording_cut_anywhere_gives_what_is_before_the_cut_or_says_what_is_missing`.

mod file;
mod lengths;
mod reader;
mod run;
mod writer;

pub use file::Target;
pub use reader::{End, Packet, Recording, RecordingError};
pub use run::RunAccount;
pub use writer::Recorder;

/// MCAP profile of our files.
pub const PROFILE: &str = "nirspi";
/// Topic of the packets.
pub const TOPIC: &str = "/wire";
/// Message encoding of the packets, but for the number of the wire protocol's version.
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
/// Number of the run that is recorded; frames of another one are stragglers. Recordings before 0.2 have none.
const RUN: &str = "nirspi.run";
const ACCOUNT: &str = "nirspi.account";
/// The one key of each metadata record.
const JSON: &str = "json";

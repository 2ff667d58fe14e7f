//! Writes the records of a recording, wherever they go.

use super::monitor::Monitor;
use super::schemas::{self, Channel};
use super::{
    ACCOUNT, CHECKSUM, IDENTITY, JSON, PART, PROFILE, Part, RUN, RunAccount, SETTLING, SETUP,
    TOPIC, encoding, reader::checksum,
};
use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{McapError, WriteOptions, Writer};
use nirspi_camera::response::Settling;
use nirspi_camera::setup::MeasurementSetup;
use nirspi_camera::tally::FrameCount;
use nirspi_files::identity::CameraIdentity;
use nirspi_files::provenance::{KEY, Provenance};
use nirspi_recon::Image;
use nirspi_wire::{DeviceMessage, PacketError};
use serde::Serialize;
use std::collections::BTreeMap;
use std::io::{self, Write};

/// Bytes of a chunk. A chunk that is not full is written with each flush.
const CHUNK: u64 = 1 << 20;

/// Bytes that a file adds to each message: the head of the record, and its place in the index.
const SIZE_OF_MESSAGE: u64 = 31 + 17;
/// Bytes that a file adds to a chunk: its head, the index of each channel, and its place in the summary.
const SIZE_OF_CHUNK: u64 = 600;
/// Schemas, channels (twice), the account and the summary of a file.
const SIZE_OF_REST: u64 = 40_000;

fn size_of_note(name: &str, json: &str) -> u64 {
    (name.len() + json.len()) as u64 + 200
}

/// What a recording says before its packets.
#[derive(Debug, Clone, Copy)]
pub struct Opening<'o> {
    /// The camera.
    pub identity: &'o CameraIdentity,
    /// The measurement.
    pub setup: &'o MeasurementSetup,
    /// The camera's response, if it is known.
    pub settling: Option<&'o Settling>,
    /// The number of the run whose frames count.
    pub run: Option<u16>,
    /// The place of the file in a run of several files.
    pub part: Option<&'o Part>,
    /// The camera, and the program that writes the file.
    pub provenance: Option<&'o Provenance>,
}

impl<'o> Opening<'o> {
    /// The opening of a run in one file; nothing else is known.
    #[must_use]
    pub fn of(identity: &'o CameraIdentity, setup: &'o MeasurementSetup, run: u16) -> Self {
        let (settling, part, provenance) = (None, None, None);
        Self { identity, setup, settling, run: Some(run), part, provenance }
    }
}

/// The records of a recording.
pub struct Book<W: Write> {
    writer: Writer<NoSeek<W>>,
    wire: u16,
    channels: [u16; Channel::RECORDED.len()],
    /// Number of messages in each channel, the packets first.
    sequences: [u32; Channel::RECORDED.len() + 1],
    opening: Vec<(&'static str, String)>,
    monitor: Monitor,
    /// An estimate of the file's size if the book ended now, a little too high.
    bytes: u64,
}

fn to_io(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}

impl<W: Write> Book<W> {
    /// Writes what stands before the packets.
    ///
    /// # Errors
    /// The writer's error.
    pub fn begin(to: W, opening: &Opening<'_>) -> io::Result<Self> {
        let options = WriteOptions::new()
            .chunk_size(Some(CHUNK))
            .compression(None)
            .profile(PROFILE)
            .disable_seeking(true);
        let mut parts = vec![part(IDENTITY, opening.identity)?, part(SETUP, opening.setup)?];
        parts.extend(opening.settling.map(|settling| part(SETTLING, settling)).transpose()?);
        parts.extend(opening.run.map(|run| part(RUN, &run)).transpose()?);
        parts.extend(opening.part.map(|place| part(PART, place)).transpose()?);
        parts.extend(opening.provenance.map(|made| part(KEY, made)).transpose()?);
        let begun = || -> Result<_, McapError> {
            let mut writer = options.create(NoSeek::new(to))?;
            let none = BTreeMap::new();
            let encoding = encoding(opening.identity.protocol);
            let name = format!("nirspi.wire.v{}", opening.identity.protocol);
            let schema = writer.add_schema(&name, "text", schemas::WIRE.as_bytes())?;
            let wire = writer.add_channel(schema, TOPIC, &encoding, &none)?;
            let mut channels = [0; Channel::RECORDED.len()];
            for (id, channel) in channels.iter_mut().zip(Channel::RECORDED) {
                let descriptors = channel.descriptors();
                let schema =
                    writer.add_schema(channel.schema(), schemas::ENCODING, &descriptors)?;
                *id = writer.add_channel(schema, channel.topic(), schemas::ENCODING, &none)?;
            }
            Ok((writer, wire, channels))
        };
        let (writer, wire, channels) = begun().map_err(to_io)?;
        let sequences = [0; Channel::RECORDED.len() + 1];
        let monitor = Monitor::default();
        let noted = parts.iter().map(|(name, json)| size_of_note(name, json)).sum::<u64>();
        let bytes = SIZE_OF_REST + 2 * noted;
        let mut book = Self { writer, wire, channels, sequences, opening: parts, monitor, bytes };
        book.write_opening()?;
        // After this flush the file identifies itself, whatever happens.
        book.flush()?;
        Ok(book)
    }

    fn write_opening(&mut self) -> io::Result<()> {
        for (name, json) in &self.opening {
            note(&mut self.writer, name, json)?;
        }
        Ok(())
    }

    fn message(&mut self, channel: u16, number: usize, time: u64, data: &[u8]) -> io::Result<()> {
        let sequence = self.sequences[number];
        self.sequences[number] = sequence.wrapping_add(1);
        self.bytes += SIZE_OF_MESSAGE + data.len() as u64;
        let header =
            MessageHeader { channel_id: channel, sequence, log_time: time, publish_time: time };
        self.writer.write_to_known_channel(&header, data).map_err(to_io)
    }

    fn other(&mut self, channel: Channel, time_ns: u64, data: &[u8]) -> io::Result<()> {
        let at = Channel::RECORDED.iter().position(|&other| other == channel).unwrap_or(0);
        self.message(self.channels[at], at + 1, time_ns, data)
    }

    /// An estimate of the file's size if the book ended now, a little too high.
    pub(super) fn size(&self) -> u64 {
        self.bytes
    }

    /// Says which place the file has in its run, before the first packet.
    ///
    /// # Errors
    /// The writer's error.
    pub(super) fn place(&mut self, place: &Part) -> io::Result<()> {
        let (name, json) = part(PART, place)?;
        note(&mut self.writer, name, &json)?;
        self.bytes += 2 * size_of_note(name, &json);
        self.opening.push((name, json));
        Ok(())
    }

    /// Writes a packet as received.
    ///
    /// # Errors
    /// The writer's error.
    pub fn packet(&mut self, time_ns: u64, raw: &[u8]) -> io::Result<()> {
        self.message(self.wire, 0, time_ns, raw)
    }

    /// Writes what the packet means for log and telemetry. `count` has counted the packet.
    ///
    /// # Errors
    /// The writer's error.
    pub fn heard(
        &mut self,
        time_ns: u64,
        content: &Result<DeviceMessage<'_>, PacketError>,
        count: &FrameCount,
    ) -> io::Result<()> {
        if let Some((level, text)) = self.monitor.line(content) {
            self.other(Channel::Log, time_ns, &schemas::log(time_ns, level, &text))?;
        }
        if let Some(telemetry) = self.monitor.telemetry(time_ns, count) {
            self.other(Channel::Telemetry, time_ns, &telemetry.encode(time_ns))?;
        }
        Ok(())
    }

    /// Writes an image, of which the values of `range` become 0 to 1.
    ///
    /// # Errors
    /// The writer's error.
    pub fn image(&mut self, time_ns: u64, image: &Image, range: [f32; 2]) -> io::Result<()> {
        self.other(Channel::Image, time_ns, &schemas::image(time_ns, image, range))
    }

    /// Writes an enhanced image of `side` x `side` pixels in [0, 1], its spread, and the half-widths of its
    /// intervals.
    ///
    /// # Errors
    /// The writer's error.
    pub fn enhanced(
        &mut self,
        time_ns: u64,
        side: usize,
        pixels: &[f32],
        spread: Option<&[f32]>,
        half_width: Option<&[f32]>,
    ) -> io::Result<()> {
        self.other(Channel::Enhanced, time_ns, &schemas::raw_image(time_ns, side, pixels))?;
        for (channel, values) in [(Channel::Spread, spread), (Channel::Interval, half_width)] {
            if let Some(values) = values {
                self.other(channel, time_ns, &schemas::raw_image(time_ns, side, values))?;
            }
        }
        Ok(())
    }

    /// Writes a depth map in the camera's image, in metres.
    ///
    /// # Errors
    /// The writer's error.
    pub fn depth(&mut self, time_ns: u64, pixels_m: &[f32]) -> io::Result<()> {
        let image = schemas::raw_image(time_ns, nirspi_optics::SIDE, pixels_m);
        self.other(Channel::Depth, time_ns, &image)
    }

    /// Writes the geometry of the images.
    ///
    /// # Errors
    /// The writer's error.
    pub fn pinhole(&mut self, time_ns: u64, pinhole: &schemas::Pinhole) -> io::Result<()> {
        self.other(Channel::Calibration, time_ns, &pinhole.encode(time_ns))
    }

    /// Ends the chunk and flushes the writer.
    ///
    /// # Errors
    /// The writer's error.
    pub fn flush(&mut self) -> io::Result<()> {
        self.bytes += SIZE_OF_CHUNK;
        self.writer.flush().map_err(to_io)
    }

    /// Writes what stands after the packets, if the run has an account. What stands before the
    /// packets is repeated, in case the first copy is damaged.
    ///
    /// # Errors
    /// The writer's error.
    pub fn end(mut self, account: Option<&RunAccount>) -> io::Result<()> {
        self.write_opening()?;
        if let Some(account) = account {
            let (name, json) = part(ACCOUNT, account)?;
            note(&mut self.writer, name, &json)?;
        }
        self.writer.finish().map_err(to_io)?;
        self.writer.into_inner().into_inner().flush()
    }
}

fn part(name: &'static str, value: &impl Serialize) -> io::Result<(&'static str, String)> {
    Ok((name, serde_json::to_string(value).map_err(io::Error::other)?))
}

fn note<W: Write>(writer: &mut Writer<NoSeek<W>>, name: &str, json: &str) -> io::Result<()> {
    let texts = [(JSON.to_owned(), json.to_owned()), (CHECKSUM.to_owned(), checksum(json))];
    let metadata = Metadata { name: name.to_owned(), metadata: BTreeMap::from(texts) };
    writer.write_metadata(&metadata).map_err(to_io)
}

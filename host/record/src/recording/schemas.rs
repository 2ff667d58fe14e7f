//! The channels of a recording, and the schemas by which other programs read them.
//!
//! Images, log and calibration have the schemas of Foxglove, which Foxglove and Rerun show
//! (<https://github.com/foxglove/foxglove-sdk>, `schemas/proto`). Telemetry has one of our own.

use super::protobuf::{Field, Kind, Message, Type, descriptor, file};
use nirspi_camera::account::LossCounters;
use nirspi_camera::events::Level;
use nirspi_recon::Image;

/// The frame of reference of the images.
const FRAME_ID: &str = "nirspi";
const TIME: Type = Type::Of(".google.protobuf.Timestamp", Kind::Message);

/// What the schema of the packets says.
pub(super) const WIRE: &str = "\
Packets of nirspi's wire protocol, as they came from the camera, intact and damaged.
packet = COBS( postcard(DeviceMessage) ++ CRC-32 of the message, little-endian ) ++ 00
The number of the protocol's version is in the encoding of the channel's messages.
docs/protocol.md of nirspi describes every message; mcu/wire is the code.
";

/// The encoding of the messages and of their descriptions in all channels of this module.
pub(crate) const ENCODING: &str = "protobuf";

/// A channel beside the packets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Channel {
    Telemetry,
    Log,
    Image,
    Calibration,
    /// The depth map in the camera's image.
    Depth,
    /// The enhanced image.
    Enhanced,
    /// How well each pixel of the enhanced image repeats.
    Spread,
    /// Half-width of the 95 % interval of each pixel of the enhanced image.
    Interval,
}

impl Channel {
    /// The channels of a recording.
    pub(super) const RECORDED: [Self; 8] = [
        Self::Telemetry,
        Self::Log,
        Self::Image,
        Self::Calibration,
        Self::Depth,
        Self::Enhanced,
        Self::Spread,
        Self::Interval,
    ];

    pub(crate) fn topic(self) -> &'static str {
        match self {
            Self::Telemetry => "/telemetry",
            Self::Log => "/log",
            Self::Image => "/image",
            Self::Calibration => "/calibration",
            Self::Enhanced => "/enhanced",
            Self::Depth => "/depth",
            Self::Spread => "/spread",
            Self::Interval => "/interval",
        }
    }

    /// The full name of the channel's messages.
    pub(crate) fn schema(self) -> &'static str {
        match self {
            Self::Telemetry => "nirspi.Telemetry",
            Self::Log => "foxglove.Log",
            Self::Image | Self::Enhanced | Self::Depth | Self::Spread | Self::Interval => {
                "foxglove.RawImage"
            }
            Self::Calibration => "foxglove.CameraCalibration",
        }
    }

    fn fields(self) -> &'static [Field] {
        match self {
            Self::Telemetry => &[
                (1, "timestamp", TIME),
                (2, "device_time_us", Type::Uint64),
                (3, "received", Type::Uint64),
                (4, "lost", Type::Uint64),
                (5, "corrupt", Type::Uint64),
                (6, "late", Type::Uint64),
                (7, "damaged_packets", Type::Uint64),
                (8, "frames_per_s", Type::Double),
                (9, "temperature_celsius", Type::Double),
                (10, "leds_on", Type::Bool),
                (11, "interlock_closed", Type::Bool),
                (12, "has_status", Type::Bool),
            ],
            Self::Log => &[
                (1, "timestamp", TIME),
                (2, "level", Type::Of(".foxglove.Log.Level", Kind::Enum)),
                (3, "message", Type::Text),
                (4, "name", Type::Text),
                (5, "file", Type::Text),
                (6, "line", Type::Fixed32),
            ],
            Self::Image | Self::Enhanced | Self::Depth | Self::Spread | Self::Interval => &[
                (1, "timestamp", TIME),
                (7, "frame_id", Type::Text),
                (2, "width", Type::Fixed32),
                (3, "height", Type::Fixed32),
                (4, "encoding", Type::Text),
                (5, "step", Type::Fixed32),
                (6, "data", Type::Bytes),
            ],
            Self::Calibration => &[
                (1, "timestamp", TIME),
                (9, "frame_id", Type::Text),
                (2, "width", Type::Fixed32),
                (3, "height", Type::Fixed32),
                (4, "distortion_model", Type::Text),
                (5, "D", Type::Doubles),
                (6, "K", Type::Doubles),
                (7, "R", Type::Doubles),
                (8, "P", Type::Doubles),
            ],
        }
    }

    /// The description of the channel's messages, a `FileDescriptorSet`.
    pub(crate) fn descriptors(self) -> Vec<u8> {
        static LEVELS: [(&str, &[&str]); 1] =
            [("Level", &["UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL"])];
        let (package, name) = self.schema().split_once('.').unwrap_or_default();
        let enums = if self == Self::Log { &LEVELS[..] } else { &[] };
        let import = "google/protobuf/timestamp.proto";
        let path = format!("{package}/{name}.proto");
        let message = descriptor(name, self.fields(), enums);
        let described = file(&path, package, &[import], &message);
        let time = [(1, "seconds", Type::Int64), (2, "nanos", Type::Int32)];
        let time = file(import, "google.protobuf", &[], &descriptor("Timestamp", &time, &[]));
        Message::default().nested(1, &time).nested(1, &described).end()
    }
}

fn stamped(time_ns: u64) -> Message {
    let time = Message::default().uint(1, time_ns / 1_000_000_000).uint(2, time_ns % 1_000_000_000);
    Message::default().nested(1, &time)
}

/// The state of a capture at one moment.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Telemetry {
    pub(crate) device_time_us: u64,
    pub(crate) counters: LossCounters,
    pub(crate) damaged_packets: u64,
    pub(crate) frames_per_s: f64,
    /// What the camera reported last; `None` before its first status.
    pub(crate) status: Option<nirspi_wire::Status>,
}

impl Telemetry {
    pub(crate) fn encode(&self, time_ns: u64) -> Vec<u8> {
        let LossCounters { received, lost, corrupt, late } = self.counters;
        let message = stamped(time_ns)
            .uint(2, self.device_time_us)
            .uint(3, received)
            .uint(4, lost)
            .uint(5, corrupt)
            .uint(6, late)
            .uint(7, self.damaged_packets)
            .double(8, self.frames_per_s);
        let Some(status) = self.status else { return message.end() };
        let celsius = match status.temperature_centi_celsius {
            i16::MIN => f64::NAN,
            hundredths => f64::from(hundredths) / 100.0,
        };
        message
            .double(9, celsius)
            .bool(10, status.leds_on)
            .bool(11, status.interlock_closed)
            .bool(12, true)
            .end()
    }
}

/// A line of the log.
pub(crate) fn log(time_ns: u64, level: Level, text: &str) -> Vec<u8> {
    let number = match level {
        Level::Info => 2,
        Level::Warning => 3,
        Level::Error => 4,
    };
    stamped(time_ns).uint(2, number).text(3, text).text(4, FRAME_ID).end()
}

/// An image in float32. Values from `least` to `most` become 0 to 1, because viewers show that
/// range.
pub(super) fn image(time_ns: u64, image: &Image, [least, most]: [f32; 2]) -> Vec<u8> {
    let scale = if most > least { 1.0 / (most - least) } else { 0.0 };
    let pixels: Vec<f32> = image.pixels().iter().map(|pixel| (pixel - least) * scale).collect();
    raw_image(time_ns, image.side().pixels(), &pixels)
}

/// A square image of these pixels, row by row, in float32.
pub(crate) fn raw_image(time_ns: u64, side: usize, pixels: &[f32]) -> Vec<u8> {
    let side = side as u32;
    let data: Vec<u8> = pixels.iter().flat_map(|pixel| pixel.to_le_bytes()).collect();
    stamped(time_ns)
        .fixed32(2, side)
        .fixed32(3, side)
        .text(4, "32FC1")
        .fixed32(5, 4 * side)
        .bytes(6, &data)
        .text(7, FRAME_ID)
        .end()
}

/// A camera without distortion, whose axis goes through the middle of the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pinhole {
    /// Side of the image in pixels.
    pub side: u32,
    /// Focal length in pixels.
    pub focal_px: f64,
}

/// The geometry of the images of a camera, as its description has the projector: the images have no
/// distortion.
impl From<&nirspi_optics::CameraModel> for Pinhole {
    fn from(camera: &nirspi_optics::CameraModel) -> Self {
        let side = nirspi_optics::SIDE;
        let focal_px = side as f64 / camera.projector().field_over_distance();
        Self { side: side as u32, focal_px }
    }
}

impl Pinhole {
    pub(crate) fn encode(&self, time_ns: u64) -> Vec<u8> {
        let Self { side, focal_px: f } = *self;
        let c = f64::from(side) / 2.0;
        stamped(time_ns)
            .fixed32(2, side)
            .fixed32(3, side)
            .doubles(6, &[f, 0.0, c, 0.0, f, c, 0.0, 0.0, 1.0])
            .doubles(7, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])
            .doubles(8, &[f, 0.0, c, 0.0, 0.0, f, c, 0.0, 0.0, 0.0, 1.0, 0.0])
            .text(9, FRAME_ID)
            .end()
    }
}

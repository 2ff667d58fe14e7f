//! Commands of the host, replies and stream of the device.
//!
//! # Invariant
//! These types are the format of every version from [`version::MIN`](crate::version::MIN) on: from the first release on,
//! variants and fields are appended, everything else stays ([`version`](crate::version) has the rules; `tests/frozen`
//! holds the bytes).

use crate::samples::{Block, Samples, Words};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// A host that sends no valid command for this long while LEDs are on is taken for dead, and they go off.
pub const HOST_SILENCE_US: u64 = 5_000_000;
/// Most bytes of the text of a [`CrashReport`].
pub const CRASH_TEXT_MAX: usize = 128;
/// Most bytes of a [`GatewareChunk`].
pub const GATEWARE_CHUNK_MAX: usize = 2048;

/// Major, minor, patch.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Version(pub u8, pub u8, pub u8);

impl Version {
    /// The version in the FPGA's register: `major << 16 | minor << 8 | patch`.
    #[must_use]
    pub const fn of_register(value: u32) -> Self {
        let [_, major, minor, patch] = value.to_be_bytes();
        Self(major, minor, patch)
    }
}

impl core::fmt::Display for Version {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "{}.{}.{}", self.0, self.1, self.2)
    }
}

/// Host to device: a command with a number that its reply repeats.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Request<'a> {
    /// Chosen by the host.
    pub id: u16,
    /// The command.
    #[serde(borrow)]
    pub command: Command<'a>,
}

/// A command of the host.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Command<'a> {
    /// First command of a session. Its bytes never change.
    Hello {
        /// Protocol version of the host.
        protocol: u16,
    },
    /// Sets up a measurement; also acknowledges a fault whose cause is gone.
    #[serde(borrow)]
    Configure(Configuration<'a>),
    /// Starts frames. LEDs go on.
    Start(RunLength),
    /// Ends frames. LEDs go off.
    Stop,
    /// Asks for [`Status`]. Like every command it shows that the host is alive ([`HOST_SILENCE_US`]).
    Status,
    /// Checks the device without any optics.
    SelfTest,
    /// Reads one FPGA register, for diagnosis.
    ReadRegister {
        /// Register address.
        address: u16,
    },
    /// One piece of an FPGA bitstream, in order.
    LoadGateware(GatewareChunk<'a>),
    /// Records a burst of plain ADC samples from the first clock of a sweep, for calibration.
    RawBurst {
        /// Number of samples, at most [`RAW_SAMPLES_MAX`](crate::register::RAW_SAMPLES_MAX).
        samples: u16,
    },
    /// Switches the LEDs off and restarts the device.
    Reboot(RebootInto),
}

/// How long a run lasts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum RunLength {
    /// Until `Stop`.
    Continuous,
    /// This many frames, at least one.
    Frames(u32),
}

/// What the device starts after a restart.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum RebootInto {
    /// The camera application.
    Application,
    /// The chip's own boot loader.
    Bootloader,
}

/// Where samples come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum SampleSource {
    /// The photodiode's ADC.
    Detector,
    /// The FPGA's test generator (see [`register::test_sample`](crate::register::test_sample)).
    TestPattern,
}

/// Which pattern is shown k-th.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum PatternOrder<'a> {
    /// Pattern k is Hadamard row k.
    Natural,
    /// Pattern k is the Hadamard row with k sign changes ([`walsh::sequency`](crate::walsh::sequency)).
    Sequency,
    /// Pattern k is the Hadamard row that entry k of this table names. The table has one entry for each pattern shown, and
    /// no row twice.
    #[serde(borrow)]
    Table(Words<'a>),
}

/// One measurement setup. Dwell, blanking and latency are in ADC clocks of 8 ns.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Configuration<'a> {
    /// Order of the patterns.
    #[serde(borrow)]
    pub order: PatternOrder<'a>,
    /// Patterns of a sweep: the first this many of the order, 1 to 1024.
    pub patterns: u16,
    /// Whether each pattern is followed by its complement, whose sum is subtracted.
    pub differential: bool,
    /// Whether sweeps differ so that the faults of LEDs and lines cancel in every four
    /// ([`mode::ALTERNATING`](crate::register::mode::ALTERNATING)). Changes nothing unless `differential`.
    pub alternating: bool,
    /// Clocks that each pattern is shown: 5 is 25 MHz.
    pub clocks_per_pattern: u16,
    /// Samples left out at the start of each pattern, in which LEDs and amplifier settle.
    pub blanked: u16,
    /// Clocks from light to sample, 0 to 63.
    pub adc_latency: u8,
    /// Sweeps summed into one frame, at least 1.
    pub sweeps: u32,
    /// Where samples come from.
    pub source: SampleSource,
    /// Over-range samples in one frame that switch the LEDs off; 0 only flags them.
    pub over_range_trip: u32,
}

/// A piece of an FPGA bitstream.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GatewareChunk<'a> {
    /// Offset of the piece in the bitstream, in bytes. Pieces come in order, the first at 0.
    pub offset: u32,
    /// Length of the whole bitstream in bytes.
    pub total: u32,
    /// CRC-32 of the whole bitstream.
    pub crc: u32,
    /// The piece, at most [`GATEWARE_CHUNK_MAX`] bytes.
    #[serde(borrow, with = "block")]
    pub data: &'a [u8],
}

/// Bytes as one block in a field that is a plain slice.
mod block {
    use super::{Block, Deserialize, Deserializer, Serialize, Serializer};

    pub fn serialize<S: Serializer>(bytes: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
        Block(bytes).serialize(serializer)
    }

    pub fn deserialize<'de: 'a, 'a, D>(deserializer: D) -> Result<&'a [u8], D::Error>
    where
        D: Deserializer<'de>,
    {
        Block::deserialize(deserializer).map(|Block(bytes)| bytes)
    }
}

/// A message of the device to the host.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum DeviceMessage<'a> {
    /// The answer to a command.
    #[serde(borrow)]
    Reply(Reply<'a>),
    /// One integrated measurement of all patterns.
    Frame(Frame<'a>),
    /// A piece of a raw burst.
    Raw(Raw<'a>),
    /// A time-of-flight depth map.
    Depth(Depth<'a>),
    /// An event in the camera.
    Event(Event),
    /// A report of the crash that ended the firmware's last start: once, after the first `Hello`.
    #[serde(borrow)]
    Crash(CrashReport<'a>),
}

/// The answer to the request of the same number.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Reply<'a> {
    /// The request's number.
    pub id: u16,
    /// The answer, or the reason of the refusal.
    #[serde(borrow)]
    pub outcome: Result<Answer<'a>, Refusal>,
}

/// The answer to a command that was carried out.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Answer<'a> {
    /// To `Hello`: who the device is.
    #[serde(borrow)]
    Hello(Identity<'a>),
    /// To `Configure`, `Start`, `Stop`, `RawBurst` and `Reboot`: the device has done it or has begun.
    Done,
    /// To `Status`.
    Status(Status),
    /// To `SelfTest`.
    SelfTest(SelfTestReport),
    /// To `ReadRegister`.
    Register(u32),
    /// To `LoadGateware`: the device has taken the piece.
    Gateware {
        /// Offset of the next piece in the bitstream.
        next_offset: u32,
    },
}

/// Who the device is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Identity<'a> {
    /// Protocol version of the session; the device's own where there is no session. The first field in every version.
    pub protocol: u16,
    /// Version of the firmware.
    pub firmware: Version,
    /// Version of the gateware; 0.0.0 where no gateware answers.
    pub gateware: Version,
    /// Name of the board: its folder under `boards/`, or `virtual`.
    pub board: &'a str,
    /// Serial number, unique to the device.
    pub serial: &'a str,
    /// LEDs along one edge.
    pub side: u8,
    /// Sample rate of the ADC in Hz.
    pub adc_hz: u32,
    /// Resolution of the ADC in bits.
    pub adc_bits: u8,
    /// Wavelength of the LEDs in nm.
    pub wavelength_nm: u16,
    /// What the device can do.
    pub capabilities: Capabilities,
}

/// What a camera can do, one bit each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Capabilities(pub u32);

impl Capabilities {
    /// The camera has a time-of-flight sensor and sends depth maps.
    pub const DEPTH: Self = Self(1 << 0);
    /// The camera takes FPGA bitstreams over the link (`LoadGateware`).
    pub const LOAD_GATEWARE: Self = Self(1 << 1);
    /// The camera can restart into its chip's boot loader.
    pub const BOOTLOADER: Self = Self(1 << 2);
    /// The FPGA runs the bring-up design: there is no ADC, and samples are made of the levels of the LED lines.
    pub const BRING_UP: Self = Self(1 << 3);
    /// Name of every capability, by bit.
    pub const NAMES: [(Self, &'static str); 4] = [
        (Self::DEPTH, "depth"),
        (Self::LOAD_GATEWARE, "load gateware"),
        (Self::BOOTLOADER, "boot loader"),
        (Self::BRING_UP, "bring-up"),
    ];

    /// Whether all bits of `other` are set.
    #[must_use]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Bits of both.
    #[must_use]
    pub const fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

/// Why a command was not carried out. A refused command has changed nothing, except that a `Bus` refusal of `Configure`
/// leaves the device without a configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Refusal {
    /// The device speaks another protocol version.
    Protocol {
        /// The newest version that the device speaks.
        device: u16,
    },
    /// The command is not allowed in this state.
    State(State),
    /// The device cannot show this configuration.
    Configuration(ConfigProblem),
    /// The cause of this fault is still there.
    Fault(Fault),
    /// The FPGA has no such register.
    NoSuchRegister {
        /// The address in the command.
        address: u16,
    },
    /// A raw burst of no sample, or of more samples than the FPGA holds.
    RawLength {
        /// The most samples that the FPGA holds.
        max: u16,
    },
    /// A piece of the bitstream out of order.
    GatewareOffset {
        /// Offset of the piece that the device expects.
        expected: u32,
    },
    /// The checksum of the bitstream is wrong. The host starts again with the first piece.
    GatewareCrc,
    /// This board does not have what the command needs.
    Unsupported,
    /// The FPGA did not answer on its bus.
    Bus,
    /// The device does not know this command: the host speaks a newer version.
    Unknown,
}

/// A part of [`Configuration`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ConfigField {
    /// `patterns`
    Patterns,
    /// `clocks_per_pattern`
    ClocksPerPattern,
    /// `blanked`
    Blanked,
    /// `adc_latency`
    AdcLatency,
    /// `sweeps`
    Sweeps,
    /// Length of the order table.
    OrderLength,
    /// Mean share of LEDs lit, in thousandths.
    DutyPermille,
    /// Frames of a run, in `Start`.
    Frames,
}

/// What is wrong with a configuration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum ConfigProblem {
    /// A number outside its range.
    OutOfRange {
        /// The setting.
        field: ConfigField,
        /// The value in the command.
        found: u32,
        /// Least allowed.
        min: u32,
        /// Most allowed.
        max: u32,
    },
    /// An order table that names a row twice, or a row that does not exist.
    OrderEntry {
        /// Place in the table, from 0.
        index: u16,
        /// The row at this place.
        found: u16,
    },
}

/// State of the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum State {
    /// Nothing configured.
    Idle,
    /// Ready to start.
    Configured,
    /// LEDs on, frames or a raw burst under way.
    Running,
    /// The LEDs stay off until the cause of the fault is gone and `Configure` acknowledges the fault.
    Fault,
}

/// Why the LEDs were switched off.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Fault {
    /// The enclosure's interlock is open.
    Interlock,
    /// The LED array is too hot.
    OverTemperature {
        /// Hundredths of a degree Celsius.
        centi_celsius: i16,
    },
    /// The temperature sensor is broken or out of its range.
    TemperatureSensor,
    /// The LEDs were lit for a larger share of time than the array allows.
    Duty,
    /// More over-range samples in one frame than the configuration allows.
    OverRange,
    /// The firmware did not access the FPGA in time.
    FpgaWatchdog,
    /// The FPGA does not answer, answers with another identity, or cannot be used.
    FpgaAbsent {
        /// What the identity register read. [`NO_CLOCK`](crate::register::NO_CLOCK): the identity is right, and
        /// the ADC's clock is missing or has another frequency. [`IDENTITY`](crate::register::IDENTITY): the gateware is of another
        /// version than the firmware's. [`DAMAGED`](crate::register::DAMAGED): answers or writes came damaged,
        /// however often they were repeated.
        identity: u32,
    },
    /// The FPGA refused a configuration that the firmware had accepted.
    FpgaConfiguration,
    /// The FPGA completed no frame for many times the duration of a frame.
    FpgaStalled,
    /// The host sent no command for [`HOST_SILENCE_US`] while LEDs were on.
    HostSilent,
    /// The self-test saw light while the board's LED enable was low. Stands until the firmware restarts.
    BoardEnableStuck,
    /// The self-test saw light while the FPGA's LED enable was low. Stands until the firmware restarts.
    FpgaEnableStuck,
}

/// What happened to a frame, one bit each; the same bits in the FPGA's header and on the wire.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct FrameFlags(pub u16);

impl FrameFlags {
    /// A sample was outside the ADC's range.
    pub const OVER_RANGE: Self = Self(1 << 0);
    /// A 48-bit accumulator has wrapped.
    pub const OVERFLOW: Self = Self(1 << 1);
    /// The FPGA lost at least one frame directly before this one.
    pub const AFTER_LOSS: Self = Self(1 << 2);
    /// Samples come from the test generator.
    pub const TEST_SOURCE: Self = Self(1 << 3);
    /// Samples are differences of a pattern and its complement.
    pub const DIFFERENTIAL: Self = Self(1 << 4);

    /// Whether all bits of `other` are set.
    #[must_use]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Bits of both.
    #[must_use]
    pub const fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

/// One integrated measurement: `samples[k]` belongs to the pattern shown k-th.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Frame<'a> {
    /// Number of the run since power-up, modulo 2^16. A frame of an earlier run has another number.
    pub run: u16,
    /// Number of the frame since `Start`, counted in the FPGA, so a gap is a loss. Wraps at 2^32: after two
    /// days at the fastest rate.
    pub sequence: u32,
    /// Device time of the frame's first pattern.
    pub device_time_us: u64,
    /// Sweeps summed.
    pub sweeps: u32,
    /// What happened to the frame.
    pub flags: FrameFlags,
    /// Summed ADC counts, one a pattern shown; of 24 bits in a run in which no sample can leave 24 bits.
    #[serde(borrow)]
    pub samples: Samples<'a>,
}

/// A piece of a burst of plain ADC samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Raw<'a> {
    /// Clock of the first sample, counted from the burst's first pattern.
    pub first_clock: u16,
    /// Samples of the whole burst.
    pub total: u16,
    /// ADC codes; bit 15 is the over-range bit.
    #[serde(borrow)]
    pub samples: Words<'a>,
}

/// A time-of-flight depth map, row-major.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Depth<'a> {
    /// Device time of the measurement.
    pub device_time_us: u64,
    /// Zones along one edge.
    pub side: u8,
    /// Distance of each zone in mm; 0 for a zone without a reading.
    #[serde(borrow)]
    pub distances_mm: Words<'a>,
}

/// The record that a crash of the firmware leaves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct CrashReport<'a> {
    /// Time of the crash since the start that it ended.
    pub uptime_us: u64,
    /// Place and reason, at most [`CRASH_TEXT_MAX`] bytes.
    pub text: &'a str,
}

/// An event in the camera.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Event {
    /// Device time of the event.
    pub device_time_us: u64,
    /// The event.
    pub kind: EventKind,
}

/// What an event is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum EventKind {
    /// The LEDs went off for this reason.
    Fault(Fault),
    /// A run has ended, by its length, `Stop` or a fault; comes after its last frame.
    RunEnded {
        /// Number of the run.
        run: u16,
        /// Frames that the FPGA has completed: sequence numbers 0 to this less one.
        frames_made: u32,
        /// Frames of the run for which the link had no room.
        frames_dropped: u32,
        /// Frames of the run that were lost in the FPGA because the firmware was too slow.
        fpga_frames_lost: u32,
        /// Frames of the run that were damaged between FPGA and firmware.
        fpga_frames_corrupt: u32,
    },
    /// A raw burst was not sent whole because the link had no room.
    RawDropped,
    /// The host sent bytes that are not a command.
    CommandDamaged,
    /// Register accesses between firmware and FPGA came damaged and were repeated. At most once a second.
    FpgaAccessesDamaged {
        /// All since power-up.
        total: u32,
    },
}

/// State, counters and sensors of the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Status {
    /// State of the device.
    pub state: State,
    /// The fault that keeps the LEDs off.
    pub fault: Option<Fault>,
    /// Time since power-up: the clock of every `device_time_us`.
    pub uptime_us: u64,
    /// Number of this run or the last one.
    pub run: u16,
    /// Frames completed by the FPGA in this run or the last one.
    pub frames_made: u32,
    /// Frames given to the link.
    pub frames_sent: u32,
    /// Frames dropped whole: the link had no room.
    pub frames_dropped: u32,
    /// Frames lost in the FPGA: the firmware was too slow.
    pub fpga_frames_lost: u32,
    /// Frames damaged between FPGA and firmware.
    pub fpga_frames_corrupt: u32,
    /// Packets from the host that were not commands, since power-up.
    pub commands_damaged: u32,
    /// LED array, hundredths of a degree Celsius; `i16::MIN` where the sensor does not answer.
    pub temperature_centi_celsius: i16,
    /// Mean share of LEDs lit by the configuration.
    pub duty_permille: u16,
    /// Whether the FPGA drives LEDs now.
    pub leds_on: bool,
    /// Whether the interlock is closed.
    pub interlock_closed: bool,
    /// What the detector saw lately; `None` before a run has shown two frames.
    pub signal: Option<Signal>,
}

/// What the detector saw in two successive frames of this run or the last one, for alignment and gain. Counts are those of
/// a single ADC sample: sums are divided by their samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Signal {
    /// Mean of the samples, in thousandths of a count: light, ambient light and the ADC's zero.
    pub mean_milli_counts: u32,
    /// What the readings of the patterns differ by, root mean square, without the noise, in thousandths of a count.
    pub signal_milli_counts: u32,
    /// What a reading changes by from frame to frame, root mean square over the square root of 2, in thousandths of a
    /// count. A moving scene counts as noise.
    pub noise_milli_counts: u32,
    /// Signal to noise, in hundredths of a decibel: -20 dB where the noise hides the signal, 120 dB where no reading changes.
    pub snr_centi_db: i16,
    /// Samples outside the ADC's range, in millionths of all samples of the second frame.
    pub over_range_ppm: u32,
}

/// Outcome of the device's checks, one bit each.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct SelfTestReport {
    /// Checks that ran.
    pub ran: u32,
    /// Checks that failed.
    pub failed: u32,
}

impl SelfTestReport {
    /// The FPGA's identity register reads right.
    pub const FPGA_IDENTITY: u32 = 1 << 0;
    /// Every bit of the scratch register holds 0 and 1 alone.
    pub const FPGA_BUS: u32 = 1 << 1;
    /// LEDs are off while not running.
    pub const LEDS_OFF: u32 = 1 << 2;
    /// A frame of the test generator has exactly the sums that it must, and those that try the LED enables come whole.
    pub const TEST_FRAME: u32 = 1 << 3;
    /// Temperature is in a plausible range.
    pub const TEMPERATURE: u32 = 1 << 4;
    /// The interlock is closed.
    pub const INTERLOCK: u32 = 1 << 5;
    /// The memory that frames pass through holds every pattern.
    pub const MEMORY: u32 = 1 << 6;
    /// The FPGA's gateware is of a version and a design that the firmware knows.
    pub const GATEWARE: u32 = 1 << 7;
    /// The ADC's clock ticks at its frequency. Without it, the checks that need it are left out.
    pub const ADC_CLOCK: u32 = 1 << 8;
    /// The detector sees no light while the board's LED enable is low. Left out where there is too little light to judge by.
    pub const BOARD_ENABLE: u32 = 1 << 9;
    /// The detector sees no light while the FPGA's LED enable is low. Left out like `BOARD_ENABLE`.
    pub const FPGA_ENABLE: u32 = 1 << 10;

    /// Name of every check, by bit.
    pub const NAMES: [(u32, &'static str); 11] = [
        (Self::FPGA_IDENTITY, "FPGA identity"),
        (Self::FPGA_BUS, "FPGA bus"),
        (Self::LEDS_OFF, "LEDs off at rest"),
        (Self::TEST_FRAME, "test frame"),
        (Self::TEMPERATURE, "temperature sensor"),
        (Self::INTERLOCK, "interlock"),
        (Self::MEMORY, "frame memory"),
        (Self::GATEWARE, "gateware"),
        (Self::ADC_CLOCK, "ADC clock"),
        (Self::BOARD_ENABLE, "board's LED enable"),
        (Self::FPGA_ENABLE, "FPGA's LED enable"),
    ];
}

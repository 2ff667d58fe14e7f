//! Every message there can be, as proptest strategies.
//!
//! Messages borrow; here they borrow from leaked memory, a few megabytes in a test run.

use nirspi_wire::{
    Answer, Capabilities, Command, ConfigField, ConfigProblem, Configuration, CrashReport, Depth,
    DeviceMessage, Event, EventKind, Fault, Frame, FrameFlags, GatewareChunk, Identity,
    PatternOrder, Raw, RebootInto, Refusal, Reply, Request, RunLength, SampleSource, Samples,
    SelfTestReport, Signal, State, Status, Version,
    message::GATEWARE_CHUNK_MAX,
    samples::{Width, Words},
};
use proptest::collection::vec;
use proptest::prelude::*;

/// Short mostly, and at its longest every now and then.
fn length(most: usize) -> impl Strategy<Value = usize> {
    prop_oneof![8 => 0..=8usize, 4 => 0..=most.min(300), 1 => Just(most)]
}

fn bytes(most: usize) -> impl Strategy<Value = &'static [u8]> {
    length(most).prop_flat_map(|n| vec(any::<u8>(), n)).prop_map(|bytes| &*bytes.leak())
}

fn words(most: usize) -> impl Strategy<Value = Words<'static>> {
    length(most).prop_flat_map(|n| vec(any::<u16>(), n)).prop_map(|words| {
        let buffer = vec![0; 2 * words.len()].leak();
        Words::pack(words.into_iter(), buffer).unwrap()
    })
}

pub fn width() -> impl Strategy<Value = Width> {
    prop_oneof![Just(Width::Bits32), Just(Width::Bits24)]
}

fn samples() -> impl Strategy<Value = Samples<'static>> {
    let values = length(1024).prop_flat_map(|n| vec(any::<i32>(), n));
    (values, width()).prop_map(|(values, width)| {
        let buffer = vec![0; 4 * values.len()].leak();
        let fewer_bits = 8 * (4 - width.bytes());
        Samples::pack(values.iter().map(|value| i64::from(value >> fewer_bits)), width, buffer)
            .unwrap()
    })
}

fn text() -> impl Strategy<Value = &'static str> {
    "\\PC{0,24}".prop_map(|text| &*text.leak())
}

fn order() -> impl Strategy<Value = PatternOrder<'static>> {
    prop_oneof![
        Just(PatternOrder::Natural),
        Just(PatternOrder::Sequency),
        words(1024).prop_map(PatternOrder::Table),
    ]
}

prop_compose! {
    fn configuration()(
        order in order(),
        (patterns, clocks_per_pattern, blanked) in any::<(u16, u16, u16)>(),
        (differential, alternating, adc_latency) in any::<(bool, bool, u8)>(),
        (sweeps, over_range_trip) in any::<(u32, u32)>(),
        source in prop_oneof![Just(SampleSource::Detector), Just(SampleSource::TestPattern)],
    ) -> Configuration<'static> {
        Configuration {
            order, patterns, differential, alternating, clocks_per_pattern, blanked, adc_latency,
            sweeps, source, over_range_trip,
        }
    }
}

fn chunk() -> impl Strategy<Value = GatewareChunk<'static>> {
    (any::<(u32, u32, u32)>(), bytes(GATEWARE_CHUNK_MAX))
        .prop_map(|((offset, total, crc), data)| GatewareChunk { offset, total, crc, data })
}

fn command() -> impl Strategy<Value = Command<'static>> {
    prop_oneof![
        any::<u16>().prop_map(|protocol| Command::Hello { protocol }),
        configuration().prop_map(Command::Configure),
        Just(Command::Start(RunLength::Continuous)),
        any::<u32>().prop_map(|frames| Command::Start(RunLength::Frames(frames))),
        Just(Command::Stop),
        Just(Command::Status),
        Just(Command::SelfTest),
        any::<u16>().prop_map(|address| Command::ReadRegister { address }),
        chunk().prop_map(Command::LoadGateware),
        any::<u16>().prop_map(|samples| Command::RawBurst { samples }),
        Just(Command::Reboot(RebootInto::Application)),
        Just(Command::Reboot(RebootInto::Bootloader)),
    ]
}

/// Anything that a host can send.
pub fn request() -> impl Strategy<Value = Request<'static>> {
    (any::<u16>(), command()).prop_map(|(id, command)| Request { id, command })
}

fn state() -> impl Strategy<Value = State> {
    prop::sample::select(vec![State::Idle, State::Configured, State::Running, State::Fault])
}

fn fault() -> impl Strategy<Value = Fault> {
    prop_oneof![
        any::<i16>().prop_map(|centi_celsius| Fault::OverTemperature { centi_celsius }),
        any::<u32>().prop_map(|identity| Fault::FpgaAbsent { identity }),
        prop::sample::select(vec![
            Fault::Interlock,
            Fault::TemperatureSensor,
            Fault::Duty,
            Fault::OverRange,
            Fault::FpgaWatchdog,
            Fault::FpgaConfiguration,
            Fault::FpgaStalled,
            Fault::HostSilent,
            Fault::BoardEnableStuck,
            Fault::FpgaEnableStuck,
        ]),
    ]
}

fn problem() -> impl Strategy<Value = ConfigProblem> {
    let field = prop::sample::select(vec![
        ConfigField::Patterns,
        ConfigField::ClocksPerPattern,
        ConfigField::Blanked,
        ConfigField::AdcLatency,
        ConfigField::Sweeps,
        ConfigField::OrderLength,
        ConfigField::DutyPermille,
        ConfigField::Frames,
    ]);
    prop_oneof![
        (field, any::<(u32, u32, u32)>()).prop_map(|(field, (found, min, max))| {
            ConfigProblem::OutOfRange { field, found, min, max }
        }),
        any::<(u16, u16)>().prop_map(|(index, found)| ConfigProblem::OrderEntry { index, found }),
    ]
}

fn refusal() -> impl Strategy<Value = Refusal> {
    prop_oneof![
        any::<u16>().prop_map(|device| Refusal::Protocol { device }),
        state().prop_map(Refusal::State),
        problem().prop_map(Refusal::Configuration),
        fault().prop_map(Refusal::Fault),
        any::<u16>().prop_map(|address| Refusal::NoSuchRegister { address }),
        any::<u16>().prop_map(|max| Refusal::RawLength { max }),
        any::<u32>().prop_map(|expected| Refusal::GatewareOffset { expected }),
        Just(Refusal::GatewareCrc),
        Just(Refusal::Unsupported),
        Just(Refusal::Bus),
        Just(Refusal::Unknown),
    ]
}

fn version() -> impl Strategy<Value = Version> {
    any::<(u8, u8, u8)>().prop_map(|(major, minor, patch)| Version(major, minor, patch))
}

prop_compose! {
    fn identity()(
        firmware in version(), gateware in version(), board in text(), serial in text(),
        (protocol, side, adc_hz, adc_bits, wavelength_nm) in any::<(u16, u8, u32, u8, u16)>(),
        capabilities in any::<u32>(),
    ) -> Identity<'static> {
        Identity {
            protocol, firmware, gateware, board, serial, side, adc_hz, adc_bits, wavelength_nm,
            capabilities: Capabilities(capabilities),
        }
    }
}

prop_compose! {
    fn signal()(
        (mean_milli_counts, signal_milli_counts, noise_milli_counts) in any::<(u32, u32, u32)>(),
        (snr_centi_db, over_range_ppm) in any::<(i16, u32)>(),
    ) -> Signal {
        Signal {
            mean_milli_counts, signal_milli_counts, noise_milli_counts, snr_centi_db, over_range_ppm,
        }
    }
}

prop_compose! {
    fn status()(
        state in state(), fault in prop::option::of(fault()),
        (uptime_us, run, frames_made, frames_sent, frames_dropped)
            in any::<(u64, u16, u32, u32, u32)>(),
        (fpga_frames_lost, fpga_frames_corrupt, commands_damaged) in any::<(u32, u32, u32)>(),
        (temperature_centi_celsius, duty_permille) in any::<(i16, u16)>(),
        (leds_on, interlock_closed) in any::<(bool, bool)>(),
        signal in prop::option::of(signal()),
    ) -> Status {
        Status {
            state, fault, uptime_us, run, frames_made, frames_sent, frames_dropped,
            fpga_frames_lost, fpga_frames_corrupt, commands_damaged, temperature_centi_celsius,
            duty_permille, leds_on, interlock_closed, signal,
        }
    }
}

fn answer() -> impl Strategy<Value = Answer<'static>> {
    prop_oneof![
        identity().prop_map(Answer::Hello),
        Just(Answer::Done),
        status().prop_map(Answer::Status),
        any::<(u32, u32)>()
            .prop_map(|(ran, failed)| Answer::SelfTest(SelfTestReport { ran, failed })),
        any::<u32>().prop_map(Answer::Register),
        any::<u32>().prop_map(|next_offset| Answer::Gateware { next_offset }),
    ]
}

fn event() -> impl Strategy<Value = EventKind> {
    prop_oneof![
        fault().prop_map(EventKind::Fault),
        any::<(u16, u32, u32, u32, u32)>().prop_map(|(run, made, dropped, lost, corrupt)| {
            EventKind::RunEnded {
                run,
                frames_made: made,
                frames_dropped: dropped,
                fpga_frames_lost: lost,
                fpga_frames_corrupt: corrupt,
            }
        }),
        Just(EventKind::RawDropped),
        Just(EventKind::CommandDamaged),
        any::<u32>().prop_map(|total| EventKind::FpgaAccessesDamaged { total }),
    ]
}

prop_compose! {
    fn frame()(
        (run, sequence, device_time_us, sweeps, flags) in any::<(u16, u32, u64, u32, u16)>(),
        samples in samples(),
    ) -> Frame<'static> {
        Frame { run, sequence, device_time_us, sweeps, flags: FrameFlags(flags), samples }
    }
}

/// Anything that a device can send.
pub fn device_message() -> impl Strategy<Value = DeviceMessage<'static>> {
    let outcome = prop_oneof![answer().prop_map(Ok), refusal().prop_map(Err)];
    prop_oneof![
        3 => (any::<u16>(), outcome)
            .prop_map(|(id, outcome)| DeviceMessage::Reply(Reply { id, outcome })),
        3 => frame().prop_map(DeviceMessage::Frame),
        1 => (any::<(u16, u16)>(), words(2048)).prop_map(|((first_clock, total), samples)| {
            DeviceMessage::Raw(Raw { first_clock, total, samples })
        }),
        1 => (any::<(u64, u8)>(), words(64)).prop_map(|((device_time_us, side), distances_mm)| {
            DeviceMessage::Depth(Depth { device_time_us, side, distances_mm })
        }),
        1 => (any::<u64>(), event())
            .prop_map(|(device_time_us, kind)| DeviceMessage::Event(Event { device_time_us, kind })),
        1 => (any::<u64>(), text())
            .prop_map(|(uptime_us, text)| DeviceMessage::Crash(CrashReport { uptime_us, text })),
    ]
}

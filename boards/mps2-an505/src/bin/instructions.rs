//! Counts the instructions that one frame costs: the streaming path alone, with memory in place of
//! the buses.
//!
//! Run under `-icount shift=0`, where one instruction is one nanosecond of the emulated clock, so
//! one count of SysTick at 20 MHz is fifty instructions. The result is in instructions and not in
//! cycles: QEMU models neither pipeline nor wait states.
//!
//! The measured code is the whole code of the firmware, linked as in the firmware.
#![no_std]
#![no_main]

#[path = "instructions/streaming.rs"]
mod streaming;
#[path = "instructions/usb.rs"]
mod usb;

use core::hint::black_box;
use core::panic::PanicInfo;
use core::task::Poll;
use cortex_m::Peripherals;
use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::entry;
use cortex_m_semihosting::debug::{EXIT_FAILURE, EXIT_SUCCESS, exit};
use cortex_m_semihosting::hprintln;
use embassy_futures::poll_once;
use nirspi_app::link::{CameraEnd, HostOut, Link, Packet};
use nirspi_mcu::{
    BoardInfo, BusError, Camera, HostPort, Inputs, Limits, Micros, NoLoader, PacketSink, PortBus,
    Ports, Target, Wanted,
};
use nirspi_wire::fpga::MAX_FRAME_BYTES;
use nirspi_wire::host_port::{SEALED_BYTES, seal, unseal};
use nirspi_wire::packet::{self, MAX_HOST_PACKET, encode};
use nirspi_wire::register::{IDENTITY, Register, clocks, control, mode, status};
use nirspi_wire::samples::Width;
use nirspi_wire::{
    ADC_HZ, Command, Configuration, FrameFlags, PATTERNS, PatternOrder, Request, RunLength,
    SampleSource, Version, ready, version,
};
use static_cell::{ConstStaticCell, StaticCell};

/// A quarter of a second at 1000 frames a second: the signal meter compares one pair of frames.
const FRAMES: u32 = 250;
/// Instructions in a count of SysTick.
const GRAIN: u32 = 50;
const TRANSFER_BYTES: usize = 512;
/// Packets by the parallel port in a millisecond: as many as USB carries.
const STREAMED: u32 = 8;
/// Bytes of the message in a packet of the FPGA.
const PAYLOAD_BYTES: usize = ready::HEADER_BYTES + 3 * PATTERNS as usize;

/// A fake FPGA: registers in memory, and a frame that is ready during every run.
struct Memory {
    registers: [u32; 32],
    running: bool,
    sequence: u32,
    writes: u32,
}

impl Memory {
    fn new() -> Self {
        let mut registers = [0; 32];
        // With a level of 0, the signal meter would take this for a moment between two frames.
        registers[usize::from(Register::SumLow.address())] = 1;
        Self { registers, running: false, sequence: 0, writes: 0 }
    }
}

impl Memory {
    fn slot(&mut self, address: u16) -> Option<&mut u32> {
        self.registers.get_mut(usize::from(address))
    }

    /// The packet that is ready now, between zeros. `payload` is room for its message.
    fn packet(&self, payload: &mut [u8; PAYLOAD_BYTES], into: &mut [u8]) {
        let head = ready::Head {
            run: 1,
            sequence: self.sequence,
            device_time_us: u64::from(self.sequence) * 82,
            sweeps: 1,
            flags: FrameFlags::DIFFERENTIAL,
            patterns: PATTERNS,
            width: Width::Bits24,
        };
        let samples = (0..i32::from(PATTERNS)).flat_map(|k| {
            let [low, middle, high, _] = (500 + k).to_le_bytes();
            [low, middle, high]
        });
        let mut bytes = head.to_bytes().into_iter().chain(samples);
        payload.fill_with(|| bytes.next().unwrap_or(0));
        into.fill(0);
        if let Some(room) = into.get_mut(ready::FAST_LEAD_BYTES * 3 / 4 + 1..) {
            let _ = packet::seal(payload, room);
        }
    }
}

impl HostPort for Memory {
    fn write(&mut self, address: u16, sealed: [u8; SEALED_BYTES]) -> Result<(), BusError> {
        let value = unseal(address, sealed).ok_or(BusError::Transfer)?;
        self.writes += 1;
        if address == Register::Control.address() {
            self.running |= value & control::START != 0;
            if value & control::RELEASE != 0 {
                self.sequence += 1;
            }
        } else if let Some(slot) = self.slot(address) {
            // This FPGA has no runs without light, so nothing is compared at the start.
            let is_mode = address == Register::Mode.address();
            *slot = if is_mode { value & !mode::UNLIT } else { value };
        }
        Ok(())
    }

    fn read(&mut self, address: u16) -> Result<[u8; SEALED_BYTES], BusError> {
        let running = if self.running { status::RUNNING | status::LEDS_ON } else { 0 };
        let value = match Register::at(address) {
            Some(Register::Identity) => IDENTITY,
            Some(Register::Version) => Register::Version.reset(),
            Some(Register::Clocks) => {
                clocks::LOCKED | clocks::ALIVE | clocks::READY | (ADC_HZ / clocks::UNIT_HZ)
            }
            Some(Register::Design) => Register::Design.reset(),
            Some(Register::Status) => status::INTERLOCK_CLOSED | running,
            // With the frame that is ready.
            Some(Register::FramesMade) => self.sequence + 1,
            Some(Register::Writes) => self.writes,
            _ => self.slot(address).map_or(0, |slot| *slot),
        };
        Ok(seal(address, value))
    }

    fn frame_ready(&mut self) -> bool {
        self.running
    }

    fn raw_ready(&mut self) -> bool {
        false
    }
}

const CONFIGURATION: Configuration<'static> = Configuration {
    order: PatternOrder::Natural,
    patterns: PATTERNS,
    differential: true,
    alternating: true,
    clocks_per_pattern: 5,
    blanked: 2,
    adc_latency: 3,
    sweeps: 1,
    source: SampleSource::Detector,
    over_range_trip: 0,
};

const INPUTS: Inputs = Inputs { interlock_closed: true, temperature_centi_celsius: Some(2500) };

/// Number of SysTick counts that `work` takes.
fn counts(work: impl FnOnce()) -> u32 {
    let before = SYST::get_current();
    work();
    // SysTick counts down, in 24 bits.
    before.wrapping_sub(SYST::get_current()) & 0x00FF_FFFF
}

/// What the frames of a run cost, in SysTick counts.
#[derive(Default)]
struct Cost {
    /// Between the transfers of two frames.
    between: u32,
    /// The same for the frame that costs least, which the signal meter does not look at.
    least: u32,
    /// On the link, up to the driver of the bus to the host.
    merging: u32,
    /// Bytes that went to the host.
    bytes: u32,
}

/// Where a run has its memory.
struct Room<'r> {
    frame: &'r mut [u8; MAX_FRAME_BYTES],
    payload: &'r mut [u8; PAYLOAD_BYTES],
    command: &'r mut [u8; MAX_HOST_PACKET],
}

/// A command as it is on the wire.
fn command_bytes<'r>(command: Command<'_>, room: &'r mut [u8; MAX_HOST_PACKET]) -> &'r [u8] {
    let Ok(bytes) = encode(&Request { id: 0, command }, room) else { panic!("encode") };
    bytes
}

/// Streams [`FRAMES`] frames of this FPGA.
fn stream(
    memory: Memory,
    room: &mut Room<'_>,
    link: &mut CameraEnd<'_>,
    to_host: &mut HostOut<'_, TRANSFER_BYTES>,
) -> Cost {
    let mut bus = PortBus::new(memory, room.frame);
    let mut camera =
        Camera::new(BoardInfo::new("counted", "", Version(0, 0, 0)), Limits::SIMULATED);
    let mut now = Micros(0);
    for command in [
        Command::Hello { protocol: version::CURRENT },
        Command::Configure(CONFIGURATION),
        Command::Start(RunLength::Continuous),
    ] {
        let bytes = command_bytes(command, room.command);
        let (_, sink) = link.both();
        let ports = &mut Ports { bus: &mut bus, sink: &mut *sink, loader: &mut NoLoader };
        let _ = camera.receive(now, bytes, &INPUTS, ports);
        while poll_once(to_host.transfer()).is_ready() {}
    }

    let mut cost = Cost { least: u32::MAX, ..Cost::default() };
    for _ in 0..FRAMES {
        let (_, sink) = link.both();
        let before = cost.between;
        let mut ports = Ports { bus: &mut bus, sink: &mut *sink, loader: &mut NoLoader };
        // The camera asks for the frame.
        cost.between += counts(|| {
            camera.poll(now, &INPUTS, &mut ports);
        });
        if let Some(Wanted { port, into: Target::Link(length), .. }) = bus.wanted() {
            if let Some(bytes) = sink.claim(length) {
                port.packet(room.payload, bytes);
            }
            bus.transferred(Ok(()));
            let mut ports = Ports { bus: &mut bus, sink: &mut *sink, loader: &mut NoLoader };
            cost.between += counts(|| camera.forward(now, &mut ports));
        }
        // The firmware checks the FPGA once in a millisecond: here once for each frame.
        now.0 += 1_000;
        cost.least = cost.least.min(cost.between - before);
        cost.merging += counts(|| {
            while let Poll::Ready(transfer) = poll_once(to_host.transfer()) {
                cost.bytes += black_box(transfer).len() as u32;
            }
        });
    }
    cost
}

#[entry]
fn main() -> ! {
    static FRAME: ConstStaticCell<[u8; MAX_FRAME_BYTES]> = ConstStaticCell::new([0; _]);
    static PAYLOAD: ConstStaticCell<[u8; PAYLOAD_BYTES]> = ConstStaticCell::new([0; _]);
    static COMMAND: ConstStaticCell<[u8; MAX_HOST_PACKET]> = ConstStaticCell::new([0; _]);
    static PLACES: ConstStaticCell<[Packet; 4]> = ConstStaticCell::new([Packet::EMPTY; 4]);
    static LINK: StaticCell<Link<'static>> = StaticCell::new();

    #[expect(
        unsafe_code,
        reason = "a count is no firmware: cameras on the stack beside each other need more of it"
    )]
    // SAFETY: below the stack there is memory that nothing uses.
    unsafe {
        cortex_m::register::msplim::write(0);
    }
    if let Some(mut peripherals) = Peripherals::take() {
        peripherals.SYST.set_clock_source(SystClkSource::Core);
        peripherals.SYST.set_reload(0x00FF_FFFF);
        peripherals.SYST.clear_current();
        peripherals.SYST.enable_counter();
    }
    let mut room = Room { frame: FRAME.take(), payload: PAYLOAD.take(), command: COMMAND.take() };
    let (mut link, _, mut to_host) = LINK.init(Link::new(PLACES.take())).split();
    let packets = stream(Memory::new(), &mut room, &mut link, &mut to_host);
    if packets.bytes < FRAMES * 3 * u32::from(PATTERNS) {
        hprintln!("no frames came: {} bytes", packets.bytes);
        exit(EXIT_FAILURE);
    }
    hprintln!("packet_link_bytes {}", packets.bytes / FRAMES);
    hprintln!("packet_forwarding {}", packets.between * GRAIN / FRAMES);
    hprintln!("packet_without_meter {}", packets.least * GRAIN);
    hprintln!("packet_merging {}", packets.merging * GRAIN / FRAMES);
    // No packet for longer than that ends the run. In half a second the signal meter looks twice.
    let [none, some] = streaming::count([(0, 200), (STREAMED, 500)]);
    if some.transfers == 0 {
        hprintln!("no packet came out of the ring");
        exit(EXIT_FAILURE);
    }
    hprintln!("streaming_millisecond {}", none.least);
    hprintln!("streaming_packet {}", some.least.saturating_sub(none.least) / STREAMED);
    hprintln!("streaming_meter {}", some.mean.saturating_sub(some.least));
    let [copied, whole] = usb::count();
    hprintln!("usb_512_copied {}", copied);
    hprintln!("usb_whole_packet {}", whole);
    exit(EXIT_SUCCESS);
    panic!("the emulator goes on after its exit");
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    hprintln!("{}", info);
    exit(EXIT_FAILURE);
    loop {}
}

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

use core::hint::black_box;
use core::panic::PanicInfo;
use cortex_m::Peripherals;
use cortex_m::peripheral::SYST;
use cortex_m::peripheral::syst::SystClkSource;
use cortex_m_rt::entry;
use cortex_m_semihosting::debug::{EXIT_FAILURE, EXIT_SUCCESS, exit};
use cortex_m_semihosting::hprintln;
use nirspi_mcu::{
    BoardInfo, BusError, Camera, HostPort, Inputs, Limits, Merger, Micros, NoLoader, PacketSink,
    PortBus, Ports, Wanted,
};
use nirspi_wire::fpga::{FpgaFrame, Header, MAX_FRAME_BYTES, Sums, frame_bytes};
use nirspi_wire::host_port::{SEALED_BYTES, seal, unseal};
use nirspi_wire::packet::{MAX_DEVICE_PACKET, MAX_HOST_PACKET, encode};
use nirspi_wire::register::{IDENTITY, Register, control, status};
use nirspi_wire::{
    Command, Configuration, DeviceMessage, Frame, FrameFlags, PATTERNS, PatternOrder, Request,
    RunLength, SampleSource, Samples, Version, crc32, version,
};
use static_cell::ConstStaticCell;

/// A tenth of a second at 1000 frames a second: the signal meter compares one pair of frames.
const FRAMES: u32 = 100;
/// Instructions in a count of SysTick.
const GRAIN: u32 = 50;
const TRANSFER_BYTES: usize = 512;

/// A fake FPGA: registers in memory, and a frame that is ready during every run.
struct Memory {
    registers: [u32; 32],
    running: bool,
    sequence: u32,
    writes: u32,
}

impl Memory {
    fn slot(&mut self, address: u16) -> Option<&mut u32> {
        self.registers.get_mut(usize::from(address))
    }

    /// The frame that is ready now.
    fn frame(&self, into: &mut [u8]) {
        let header = Header {
            patterns: PATTERNS,
            flags: FrameFlags::DIFFERENTIAL,
            sequence: self.sequence,
            sweeps: 1,
            over_range: 0,
            lost: 0,
            clock: u64::from(self.sequence) * 10_240,
        };
        let mut bytes = header.to_bytes().into_iter().chain(
            (0..PATTERNS)
                .flat_map(|k| Sums { positive: 8_000 + u64::from(k), negative: 7_500 }.to_bytes()),
        );
        let Some((body, crc)) = into.split_last_chunk_mut::<4>() else { return };
        body.fill_with(|| bytes.next().unwrap_or(0));
        *crc = crc32(body).to_le_bytes();
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
            *slot = value;
        }
        Ok(())
    }

    fn read(&mut self, address: u16) -> Result<[u8; SEALED_BYTES], BusError> {
        let running = if self.running { status::RUNNING | status::LEDS_ON } else { 0 };
        let value = match Register::at(address) {
            Some(Register::Identity) => IDENTITY,
            Some(register @ (Register::Version | Register::Design)) => register.reset(),
            Some(Register::Status) => status::INTERLOCK_CLOSED | running,
            Some(Register::FramesMade) => self.sequence,
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

/// Room for one packet.
struct OnePacket {
    bytes: [u8; MAX_DEVICE_PACKET],
    length: usize,
}

impl PacketSink for OnePacket {
    fn claim(&mut self, length: usize) -> Option<&mut [u8]> {
        self.bytes.get_mut(..length)
    }

    fn commit(&mut self, length: usize) {
        self.length = length;
    }
}

const CONFIGURATION: Configuration<'static> = Configuration {
    order: PatternOrder::Natural,
    patterns: PATTERNS,
    differential: true,
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

/// The firmware's three steps with a frame: the FPGA's checksum, the differences, the packet.
fn parts(bus: &mut PortBus<'_, Memory>, sink: &mut OnePacket) -> [u32; 3] {
    static FRAME: ConstStaticCell<[u8; MAX_FRAME_BYTES]> =
        ConstStaticCell::new([0; MAX_FRAME_BYTES]);
    static WORDS: ConstStaticCell<[u8; 4 * PATTERNS as usize]> = ConstStaticCell::new([0; _]);
    let (frame, words) = (FRAME.take(), WORDS.take());
    bus.port().frame(frame);
    let (mut pack, mut send) = (0, 0);
    let check = counts(|| {
        let _ = black_box(FpgaFrame::parse(black_box(frame)));
    });
    if let Ok(frame) = FpgaFrame::parse(frame) {
        let differences = frame.sums().map(|sums| sums.difference());
        let mut packed = None;
        pack = counts(|| packed = Samples::pack(black_box(differences), words).ok());
        if let Some(samples) = packed {
            let frame = Frame {
                run: 1,
                sequence: 1,
                device_time_us: 1_000_000,
                sweeps: 1,
                flags: frame.header.flags,
                samples: black_box(samples),
            };
            send = counts(|| {
                let _ = black_box(encode(&DeviceMessage::Frame(frame), &mut sink.bytes));
            });
        }
    }
    [check, pack, send]
}

/// Number of SysTick counts of a poll.
fn poll(
    camera: &mut Camera,
    now: Micros,
    bus: &mut PortBus<'_, Memory>,
    sink: &mut OnePacket,
) -> u32 {
    counts(|| {
        let ports = &mut Ports { bus, sink, loader: &mut NoLoader };
        camera.poll(now, &INPUTS, ports);
    })
}

#[entry]
fn main() -> ! {
    static BUFFER: ConstStaticCell<[u8; MAX_FRAME_BYTES]> =
        ConstStaticCell::new([0; MAX_FRAME_BYTES]);
    static SPARE: ConstStaticCell<[u8; MAX_FRAME_BYTES]> =
        ConstStaticCell::new([0; MAX_FRAME_BYTES]);
    static SINK: ConstStaticCell<OnePacket> =
        ConstStaticCell::new(OnePacket { bytes: [0; MAX_DEVICE_PACKET], length: 0 });
    static PACKET: ConstStaticCell<[u8; MAX_HOST_PACKET]> =
        ConstStaticCell::new([0; MAX_HOST_PACKET]);

    if let Some(mut peripherals) = Peripherals::take() {
        peripherals.SYST.set_clock_source(SystClkSource::Core);
        peripherals.SYST.set_reload(0x00FF_FFFF);
        peripherals.SYST.clear_current();
        peripherals.SYST.enable_counter();
    }
    let sink = SINK.take();
    let packet = PACKET.take();
    let memory = Memory { registers: [0; 32], running: false, sequence: 0, writes: 0 };
    let mut bus = PortBus::new(memory, BUFFER.take()).with_spare(Some(SPARE.take()));
    let mut camera =
        Camera::new(BoardInfo::new("counted", "", Version(0, 0, 0)), Limits::default());
    let mut now = Micros(0);

    for command in [
        Command::Hello { protocol: version::CURRENT },
        Command::Configure(CONFIGURATION),
        Command::Start(RunLength::Continuous),
    ] {
        let Ok(bytes) = encode(&Request { id: 0, command }, packet) else { panic!("encode") };
        let ports = &mut Ports { bus: &mut bus, sink, loader: &mut NoLoader };
        let _ = camera.receive(now, bytes, &INPUTS, ports);
    }

    let (mut between, mut during, mut merge, mut bytes) = (0, 0, 0, 0);
    let mut merger = Merger::<TRANSFER_BYTES>::new();
    for _ in 0..FRAMES {
        sink.length = 0;
        // The camera asks for the frame, and packs the one before while this one comes.
        between += poll(&mut camera, now, &mut bus, sink);
        if let Some(Wanted { port, into, kept, .. }) = bus.wanted() {
            port.frame(into);
            if let Some(frame) = kept {
                during += counts(|| camera.pack(now, frame, sink));
            }
            bus.transferred(Ok(()));
        }
        // The transfer takes a millisecond or more, so the firmware checks the FPGA once for each frame.
        now.0 += 1_000;
        between += poll(&mut camera, now, &mut bus, sink);
        bytes += sink.length as u32;
        merge += counts(|| {
            let mut rest = sink.bytes.get(..sink.length).unwrap_or(&[]);
            while !rest.is_empty() {
                let taken = merger.take(rest);
                rest = rest.get(taken..).unwrap_or(&[]);
                if merger.is_full() {
                    black_box(merger.transfer());
                }
            }
        });
    }
    let [check, pack, send] = parts(&mut bus, sink);
    // The last frame still waits.
    const PACKED: u32 = FRAMES - 1;
    if bytes < PACKED * 4 * u32::from(PATTERNS) {
        hprintln!("no frames came: {} bytes", bytes);
        exit(EXIT_FAILURE);
    }
    hprintln!("fpga_bytes {}", frame_bytes(PATTERNS));
    hprintln!("link_bytes {}", bytes / PACKED);
    hprintln!("between_transfers {}", between * GRAIN / FRAMES);
    hprintln!("during_transfer {}", during * GRAIN / PACKED);
    hprintln!("merging {}", merge * GRAIN / PACKED);
    hprintln!("of_these_check {}", check * GRAIN);
    hprintln!("of_these_differences {}", pack * GRAIN);
    hprintln!("of_these_packet {}", send * GRAIN);
    exit(EXIT_SUCCESS);
    panic!("the emulator goes on after its exit");
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    hprintln!("{}", info);
    exit(EXIT_FAILURE);
    loop {}
}

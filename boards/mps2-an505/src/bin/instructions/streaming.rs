//! What packets of the FPGA's parallel port cost, with everything that the processor does for them: the camera's loop,
//! the link, the task that serves the host, the executor, the chip's driver of USB and its interrupt.
//!
//! The ring is memory that this file fills, and the registers of USB are memory as in [`usb`](crate::usb). Each
//! millisecond of the clock, as on a board, the loop wakes, finds what has come, and lends it; USB's transfers are over
//! as soon as they have begun.

use super::usb::{self, Chip, ENDPOINTS, PLACES};
use super::{GRAIN, INPUTS, Memory, PAYLOAD_BYTES, command_bytes, counts};
use core::hint::black_box;
use core::pin::pin;
use core::ptr::null_mut;
use core::sync::atomic::{AtomicU32, Ordering};
use embassy_executor::raw::Executor;
use embassy_futures::poll_once;
use embassy_usb_synopsys_otg::State;
use nirspi_app::link::{CameraEnd, Link, Packet};
use nirspi_app::{Board, DepthMailbox, Device, FpgaPort, run};
use nirspi_mcu::{
    BoardInfo, BusError, HostPort, Inputs, Lamps, Limits, NoLoader, Ring, RingMemory,
};
use nirspi_usb::{Memory as UsbMemory, OutBuffer, Presence, device};
use nirspi_wire::fpga::MAX_FRAME_BYTES;
use nirspi_wire::host_port::{SEALED_BYTES, seal};
use nirspi_wire::packet::MAX_HOST_PACKET;
use nirspi_wire::register::Register;
use nirspi_wire::samples::Width;
use nirspi_wire::{Command, PATTERNS, RebootInto, RunLength, Version, ready, version};
use static_cell::{ConstStaticCell, StaticCell};

/// Words of the ring: those of the NUCLEO-U5A5ZJ-Q.
const RING_WORDS: usize = 32 * 1024;
static RING: RingMemory<RING_WORDS> = RingMemory::new();
/// Bytes that the FPGA has sent, and frames that it has made.
static SENT: AtomicU32 = AtomicU32::new(0);
static MADE: AtomicU32 = AtomicU32::new(0);

/// The FPGA with its parallel port.
struct Port {
    memory: Memory,
    ring: Ring,
}

impl HostPort for Port {
    fn write(&mut self, address: u16, sealed: [u8; SEALED_BYTES]) -> Result<(), BusError> {
        self.memory.write(address, sealed)
    }

    fn read(&mut self, address: u16) -> Result<[u8; SEALED_BYTES], BusError> {
        if address == Register::FramesMade.address() {
            return Ok(seal(address, MADE.load(Ordering::Relaxed)));
        }
        self.memory.read(address)
    }

    fn frame_ready(&mut self) -> bool {
        false
    }

    fn raw_ready(&mut self) -> bool {
        false
    }

    fn ring(&mut self) -> Option<&mut Ring> {
        Some(&mut self.ring)
    }

    fn look(&mut self) {
        self.ring.came(SENT.load(Ordering::Relaxed) as usize % (4 * RING_WORDS));
        black_box(self.ring.grant());
    }
}

impl FpgaPort for Port {
    async fn read_bytes(&mut self, _opcode: u8, _into: &mut [u8]) -> Result<(), BusError> {
        Ok(())
    }

    async fn ready(&mut self) {
        core::future::pending::<()>().await;
    }
}

/// Pins that do nothing.
struct Still;

impl Board for Still {
    fn inputs(&mut self) -> Inputs {
        INPUTS
    }

    fn enable_leds(&mut self, enabled: bool) {
        black_box(enabled);
    }

    fn show(&mut self, lamps: Lamps) {
        black_box(lamps);
    }

    fn feed_watchdog(&mut self) {}

    fn restart(&mut self, _into: RebootInto) -> ! {
        panic!("restarted")
    }
}

#[embassy_executor::task]
async fn camera(
    device: Device<'static, Still, Port, NoLoader>,
    camera: CameraEnd<'static>,
    depth: &'static DepthMailbox,
) -> ! {
    run(device, camera, depth).await
}

/// The frames of the FPGA.
struct Frames {
    memory: Memory,
    payload: &'static mut [u8; PAYLOAD_BYTES],
    room: &'static mut [u8; ready::MAX_READ_BYTES],
}

impl Frames {
    /// Sends the next frame: a zero, the packet, and three to six zeros.
    fn transmit(&mut self) {
        self.memory.packet(self.payload, self.room);
        self.memory.sequence += 1;
        MADE.store(self.memory.sequence, Ordering::Relaxed);
        let place = ready::packet_in(self.room, PATTERNS, Width::Bits24).unwrap_or(1..1);
        let (words, _) = self.room[place.start - 1..place.end + 6].as_chunks();
        for word in words {
            let sent = SENT.fetch_add(4, Ordering::Relaxed) as usize;
            if let Some(place) = RING.words().get(sent / 4 % RING_WORDS) {
                place.store(u32::from_le_bytes(*word), Ordering::Relaxed);
            }
        }
    }
}

/// What a millisecond takes.
pub struct Cost {
    /// Instructions of the millisecond that takes the fewest, in which the signal meter looks at nothing.
    pub least: u32,
    /// The mean, with the signal meter.
    pub mean: u32,
    /// Transfers by USB.
    pub transfers: u32,
}

/// Instructions of a millisecond in which so many packets come, from so many milliseconds.
#[inline(never)]
pub fn count<const N: usize>(runs: [(u32, u32); N]) -> [Cost; N] {
    static STATE: State<ENDPOINTS> = State::new();
    static PRESENCE: StaticCell<Presence> = StaticCell::new();
    static MEMORY: StaticCell<UsbMemory> = StaticCell::new();
    static BUFFER: ConstStaticCell<OutBuffer> = ConstStaticCell::new(OutBuffer::new());
    static PACKETS: ConstStaticCell<[Packet; PLACES]> =
        ConstStaticCell::new([Packet::EMPTY; PLACES]);
    static LINK: StaticCell<Link<'static>> = StaticCell::new();
    static EXECUTOR: StaticCell<Executor> = StaticCell::new();
    static MAILBOX: StaticCell<DepthMailbox> = StaticCell::new();
    static FRAME: ConstStaticCell<[u8; MAX_FRAME_BYTES]> = ConstStaticCell::new([0; _]);
    static PAYLOAD: ConstStaticCell<[u8; PAYLOAD_BYTES]> = ConstStaticCell::new([0; _]);
    static ROOM: ConstStaticCell<[u8; ready::MAX_READ_BYTES]> = ConstStaticCell::new([0; _]);
    static COMMAND: ConstStaticCell<[u8; MAX_HOST_PACKET]> = ConstStaticCell::new([0; _]);

    let executor: &'static Executor = EXECUTOR.init(Executor::new(null_mut()));
    let memory = MEMORY.init(UsbMemory::new(PRESENCE.init(Presence::new())));
    let buffer = &mut BUFFER.take().0;
    // The first endpoint has the beginning of the buffer.
    let received = buffer.as_mut_ptr();
    let driver = usb::driver(buffer, &STATE, true);
    let (mut usb_device, endpoints) = device(Chip(driver), "", Version(0, 0, 0), memory);
    let _ = poll_once(pin!(usb_device.run()));
    let (end, commands, to_host) = LINK.init(Link::new(PACKETS.take())).split();
    let today = Memory::new();
    let device = Device {
        board: Still,
        port: Port { memory: today, ring: Ring::new(&RING) },
        frame: FRAME.take(),
        loader: NoLoader,
        info: BoardInfo::new("counted", "", Version(0, 0, 0)),
        limits: Limits::SIMULATED,
        crash: None,
        restarts: 0,
    };
    let tasks = (
        usb::host(endpoints, commands, to_host),
        camera(device, end, MAILBOX.init(DepthMailbox::new())),
    );
    if let (Ok(host), Ok(camera)) = tasks {
        executor.spawner().spawn(host);
        executor.spawner().spawn(camera);
    }
    usb::poll(executor);
    let room = COMMAND.take();
    for command in [
        Command::Hello { protocol: version::CURRENT },
        Command::Configure(super::CONFIGURATION),
        Command::Start(RunLength::Continuous),
    ] {
        usb::receive(command_bytes(command, room), received, &STATE);
        usb::poll(executor);
        usb::send_all(executor, &STATE);
    }
    let mut frames = Frames { memory: Memory::new(), payload: PAYLOAD.take(), room: ROOM.take() };
    runs.map(|(packets, milliseconds)| {
        let (mut least, mut sum, mut transfers) = (u32::MAX, 0, 0);
        for _ in 0..milliseconds {
            for _ in 0..packets {
                frames.transmit();
            }
            usb::pass_millisecond();
            let woken = counts(|| usb::poll(executor));
            let (sending, count) = usb::send_all(executor, &STATE);
            least = least.min(woken + sending);
            sum += woken + sending;
            transfers += count;
        }
        Cost { least: least * GRAIN, mean: sum * GRAIN / milliseconds, transfers }
    })
}

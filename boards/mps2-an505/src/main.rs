//! The camera's firmware on QEMU's `mps2-an505`: everything except the chip.
//!
//! UART0 is the host link, UART1 the FPGA's bus to a simulator, and SysTick the clock. The board
//! has no pins: interlock and temperature come from the simulator, and the LED enable pin does not
//! exist.
//!
//! The application gets the same calls as on any other board.
#![no_std]
#![no_main]

mod clock;
mod emulator;
mod executor;
mod fpga;
mod uart;

use core::cell::Cell;
use core::panic::PanicInfo;
use cortex_m::Peripherals;
use cortex_m::peripheral::{NVIC, SCB};
use cortex_m_rt::{ExceptionFrame, entry, exception};
use embassy_executor::Spawner;
use embassy_futures::join::join;
use fpga::Tunnel;
use nirspi_app::link::{CameraEnd, HostIn, HostOut, Link, Packet};
use nirspi_app::{Board, DepthMailbox, Device, board_info, crash};
use nirspi_mcu::{Inputs, Lamps, Limits, NoLoader};
use nirspi_wire::RebootInto;
use nirspi_wire::fpga::MAX_FRAME_BYTES;
use nirspi_wire::tunnel::Lines;
use static_cell::{ConstStaticCell, StaticCell};
use uart::Uart;

/// UART0 and UART1 by their secure aliases (Arm AN505, memory map).
static HOST: Uart = Uart::at(0x5020_0000);
static FPGA: Uart = Uart::at(0x5020_1000);

/// Number of packets that can wait for the host: 32 ms of frames at 1000 a second.
const PACKETS: usize = 32;

/// Number of bytes that go to the host at once.
const TRANSFER_BYTES: usize = 512;

/// Expansion interrupts of the AN505 image follow the 32 of the IoT kit: receive and transmit of each UART in turn.
#[derive(Clone, Copy)]
#[repr(u16)]
enum Irq {
    HostReceive = 32,
    HostTransmit = 33,
    FpgaReceive = 34,
    FpgaTransmit = 35,
}

#[expect(
    unsafe_code,
    reason = "the compiler cannot check interrupt numbers; these come from the chip's manual"
)]
// SAFETY: each number is different and within the range that the chip has.
unsafe impl cortex_m::interrupt::InterruptNumber for Irq {
    fn number(self) -> u16 {
        self as u16
    }
}

#[exception]
// `allow` instead of `expect`: the macro repeats the attribute where the code is not unsafe.
#[allow(unsafe_code, reason = "cortex-m-rt requires this handler to be an unsafe function")]
unsafe fn DefaultHandler(number: i16) {
    match number {
        32 => HOST.on_receive(),
        33 => HOST.on_transmit(),
        34 => FPGA.on_receive(),
        35 => FPGA.on_transmit(),
        _ => panic!("interrupt {number}"),
    }
}

#[exception]
fn SysTick() {
    clock::on_tick();
}

#[exception]
// `allow` instead of `expect`: the macro repeats the attribute where the code is not unsafe.
#[allow(unsafe_code, reason = "cortex-m-rt requires this handler to be an unsafe function")]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    crash::store(format_args!("hard fault at {:#010x}, from {:#010x}", frame.pc(), frame.lr()));
    SCB::sys_reset()
}

#[panic_handler]
fn panic(info: &PanicInfo<'_>) -> ! {
    crash::store_panic(info);
    SCB::sys_reset()
}

/// A board without pins: the tunnel carries the levels.
struct Emulated {
    lines: &'static Cell<Lines>,
    enable: &'static Cell<bool>,
}

impl Board for Emulated {
    fn inputs(&mut self) -> Inputs {
        let Lines { interlock_closed, temperature_centi_celsius, .. } = self.lines.get();
        Inputs { interlock_closed, temperature_centi_celsius }
    }

    fn enable_leds(&mut self, enabled: bool) {
        self.enable.set(enabled);
    }

    fn show(&mut self, _lamps: Lamps) {}

    fn feed_watchdog(&mut self) {}

    /// The board has no boot loader either.
    fn restart(&mut self, _into: RebootInto) -> ! {
        SCB::sys_reset()
    }
}

#[embassy_executor::task]
async fn camera(board: Emulated, link: CameraEnd<'static>) -> ! {
    static FRAME: ConstStaticCell<[u8; MAX_FRAME_BYTES]> =
        ConstStaticCell::new([0; MAX_FRAME_BYTES]);
    static DEPTH: StaticCell<DepthMailbox> = StaticCell::new();
    let device = Device {
        port: Tunnel::new(&FPGA, board.lines, board.enable),
        board,
        frame: FRAME.take(),
        loader: NoLoader,
        info: board_info("mps2-an505", "QEMU"),
        limits: Limits::SIMULATED,
        crash: crash::take(),
        restarts: 0,
    };
    nirspi_app::run(device, link, DEPTH.init(DepthMailbox::new())).await
}

/// Serves the host. A UART is never closed: a new host begins with `Hello`.
#[embassy_executor::task]
async fn host(mut from: HostIn<'static>, mut to: HostOut<'static, TRANSFER_BYTES>) {
    let receive = async {
        let mut bytes = [0; 64];
        loop {
            let length = HOST.read(&mut bytes).await;
            from.received(bytes.get(..length).unwrap_or(&[])).await;
        }
    };
    let send = async {
        loop {
            HOST.write(to.transfer().await).await;
        }
    };
    let ((), ()) = join(receive, send).await;
}

#[entry]
fn main() -> ! {
    static PLACES: ConstStaticCell<[Packet; PACKETS]> =
        ConstStaticCell::new([Packet::EMPTY; PACKETS]);
    static LINK: StaticCell<Link<'static>> = StaticCell::new();
    static LINES: StaticCell<Cell<Lines>> = StaticCell::new();
    static ENABLE: StaticCell<Cell<bool>> = StaticCell::new();

    if let Some(mut peripherals) = Peripherals::take() {
        clock::start(&mut peripherals);
    }
    emulator::prepare();
    HOST.enable();
    FPGA.enable();
    for irq in [Irq::HostReceive, Irq::HostTransmit, Irq::FpgaReceive, Irq::FpgaTransmit] {
        #[expect(
            unsafe_code,
            reason = "unmasking an interrupt is unsafe unless its handler is ready, and main has set it up"
        )]
        // SAFETY: outside of any critical section; the handlers are those above.
        unsafe {
            NVIC::unmask(irq);
        }
    }
    let link = LINK.init(Link::new(PLACES.take()));
    let lines = LINES.init(Cell::new(Lines::default()));
    let enable = ENABLE.init(Cell::new(false));
    let (camera_end, from_host, to_host) = link.split();
    executor::run(|spawner: Spawner| {
        // Each task is spawned once, so there is room.
        if let (Ok(camera), Ok(host)) =
            (camera(Emulated { lines, enable }, camera_end), host(from_host, to_host))
        {
            spawner.spawn(camera);
            spawner.spawn(host);
        }
    })
}

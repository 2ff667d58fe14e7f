//! The APB UART of Arm's Cortex-M System Design Kit (Arm DDI 0479, APB UART), as the AN505 image has five.
//!
//! The one law: no byte is lost for want of room. A receiver that has none leaves its byte where it is and the line
//! waits, as it does in QEMU; the real chip would count an overrun there.

use crate::emulator;
use core::future::poll_fn;
use core::task::Poll;
use cortex_m::interrupt;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::pipe::Pipe;
use embassy_sync::waitqueue::AtomicWaker;
use embassy_time::{Duration, Instant};
use vcell::VolatileCell;

/// Bytes that have come and were not read yet.
const BUFFER_BYTES: usize = 512;

/// `BAUDDIV`: 20 MHz by its smallest divider, 16, is 1.25 Mbit/s. QEMU's lines take no time.
const BAUD_DIVIDER: u32 = 16;

#[repr(C)]
struct Registers {
    data: VolatileCell<u32>,
    state: VolatileCell<u32>,
    ctrl: VolatileCell<u32>,
    /// Reads the pending interrupts, a 1 written clears one.
    intstatus: VolatileCell<u32>,
    bauddiv: VolatileCell<u32>,
}

const STATE_TX_FULL: u32 = 1 << 0;
const STATE_RX_FULL: u32 = 1 << 1;
const CTRL_TX_ENABLE: u32 = 1 << 0;
const CTRL_RX_ENABLE: u32 = 1 << 1;
const CTRL_TX_INTERRUPT: u32 = 1 << 2;
const CTRL_RX_INTERRUPT: u32 = 1 << 3;
const INT_TX: u32 = 1 << 0;
const INT_RX: u32 = 1 << 1;

/// Nothing came in time.
#[derive(Debug)]
pub struct TimedOut;

/// One UART; its interrupts go to [`on_receive`](Self::on_receive) and [`on_transmit`](Self::on_transmit).
pub struct Uart {
    address: usize,
    received: Pipe<CriticalSectionRawMutex, BUFFER_BYTES>,
    transmitter: AtomicWaker,
}

impl Uart {
    /// By the address of its registers.
    pub const fn at(address: usize) -> Self {
        Self { address, received: Pipe::new(), transmitter: AtomicWaker::new() }
    }

    #[expect(unsafe_code, reason = "registers are at an address")]
    fn registers(&self) -> &Registers {
        // SAFETY: made only for the addresses of UARTs in `main`, which are there as long as the program runs;
        // nothing but volatile accesses of whole words is done with them.
        unsafe { &*(self.address as *const Registers) }
    }

    /// Switches both directions on.
    pub fn enable(&self) {
        let registers = self.registers();
        registers.bauddiv.set(BAUD_DIVIDER);
        registers.ctrl.set(CTRL_TX_ENABLE | CTRL_RX_ENABLE | CTRL_RX_INTERRUPT);
    }

    /// The receive interrupt.
    pub fn on_receive(&self) {
        let registers = self.registers();
        // First: a byte that comes meanwhile is to interrupt again.
        registers.intstatus.set(INT_RX);
        while registers.state.get() & STATE_RX_FULL != 0 {
            if self.received.is_full() {
                registers.ctrl.set(registers.ctrl.get() & !CTRL_RX_INTERRUPT);
                return;
            }
            let byte = registers.data.get() as u8;
            emulator::look_for_input();
            // There is room: nothing else writes.
            let _ = self.received.try_write(&[byte]);
        }
    }

    /// The transmit interrupt.
    pub fn on_transmit(&self) {
        let registers = self.registers();
        registers.intstatus.set(INT_TX);
        registers.ctrl.set(registers.ctrl.get() & !CTRL_TX_INTERRUPT);
        self.transmitter.wake();
    }

    /// There is room again.
    fn resume(&self) {
        interrupt::free(|_| {
            let registers = self.registers();
            if registers.ctrl.get() & CTRL_RX_INTERRUPT == 0 {
                registers.ctrl.set(registers.ctrl.get() | CTRL_RX_INTERRUPT);
                // What came while the interrupt was off has not asked for it.
                self.on_receive();
            }
        });
    }

    /// Waits for bytes; how many came.
    pub async fn read(&self, into: &mut [u8]) -> usize {
        let length = self.received.read(into).await;
        self.resume();
        length
    }

    /// Waits for all of `into`.
    pub async fn read_exact(&self, into: &mut [u8]) {
        let mut rest = into;
        while !rest.is_empty() {
            let length = self.read(rest).await;
            rest = rest.get_mut(length..).unwrap_or_default();
        }
    }

    /// Waits for all of `into`, asleep but for interrupts; other tasks do not run.
    pub fn read_blocking(&self, into: &mut [u8], patience: Duration) -> Result<(), TimedOut> {
        let deadline = Instant::now() + patience;
        let mut rest = into;
        while !rest.is_empty() {
            if let Ok(length) = self.received.try_read(rest) {
                self.resume();
                rest = rest.get_mut(length..).unwrap_or_default();
                continue;
            }
            if Instant::now() > deadline {
                return Err(TimedOut);
            }
            // An interrupt that comes before the wait ends it at once.
            interrupt::free(|_| {
                if self.received.is_empty() {
                    cortex_m::asm::wfi();
                }
            });
        }
        Ok(())
    }

    /// Forgets what came, until nothing has for that long.
    pub fn quieten(&self, silence: Duration) {
        while self.read_blocking(&mut [0], silence).is_ok() {}
    }

    /// Sends everything.
    pub async fn write(&self, bytes: &[u8]) {
        let registers = self.registers();
        for &byte in bytes {
            if registers.state.get() & STATE_TX_FULL != 0 {
                self.transmitted().await;
            }
            registers.data.set(byte.into());
        }
    }

    async fn transmitted(&self) {
        poll_fn(|context| {
            self.transmitter.register(context.waker());
            interrupt::free(|_| {
                let registers = self.registers();
                registers.ctrl.set(registers.ctrl.get() | CTRL_TX_INTERRUPT);
                if registers.state.get() & STATE_TX_FULL == 0 {
                    Poll::Ready(())
                } else {
                    Poll::Pending
                }
            })
        })
        .await;
    }

    /// Sends everything before it returns.
    pub fn write_blocking(&self, bytes: &[u8]) {
        let registers = self.registers();
        for &byte in bytes {
            while registers.state.get() & STATE_TX_FULL != 0 {}
            registers.data.set(byte.into());
        }
    }
}

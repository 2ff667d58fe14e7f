//! The APB UART of Arm's Cortex-M System Design Kit (Arm DDI 0479, APB UART); the AN505 image has
//! five.
//!
//! No byte is lost when the buffer is full: the receiver leaves the byte in its register, and the
//! line waits. QEMU behaves so; a real chip would count an overrun.

use crate::emulator;
use core::future::poll_fn;
use core::task::Poll;
use cortex_m::interrupt;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::pipe::Pipe;
use embassy_sync::waitqueue::AtomicWaker;
use embassy_time::{Duration, Instant};
use vcell::VolatileCell;

/// Bytes that have come and have not been read yet.
const BUFFER_BYTES: usize = 512;

/// `BAUDDIV`: 20 MHz by its smallest divider, 16, is 1.25 Mbit/s. QEMU's lines take no time.
const BAUD_DIVIDER: u32 = 16;

#[repr(C)]
struct Registers {
    data: VolatileCell<u32>,
    state: VolatileCell<u32>,
    ctrl: VolatileCell<u32>,
    /// A read gives the pending interrupts; a 1 written clears one.
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

/// No byte came in time.
#[derive(Debug)]
pub struct TimedOut;

/// One UART; its interrupts go to [`on_receive`](Self::on_receive) and [`on_transmit`](Self::on_transmit).
pub struct Uart {
    address: usize,
    received: Pipe<CriticalSectionRawMutex, BUFFER_BYTES>,
    transmitter: AtomicWaker,
}

impl Uart {
    /// The UART whose registers are at this address.
    pub const fn at(address: usize) -> Self {
        Self { address, received: Pipe::new(), transmitter: AtomicWaker::new() }
    }

    #[expect(unsafe_code, reason = "registers are at an address")]
    fn registers(&self) -> &Registers {
        // SAFETY: `main` makes UARTs only for the addresses of real UARTs, which exist as long as
        // the program runs; the code makes only volatile accesses of whole words.
        unsafe { &*(self.address as *const Registers) }
    }

    /// Enables both directions.
    pub fn enable(&self) {
        let registers = self.registers();
        registers.bauddiv.set(BAUD_DIVIDER);
        registers.ctrl.set(CTRL_TX_ENABLE | CTRL_RX_ENABLE | CTRL_RX_INTERRUPT);
    }

    /// The receive interrupt.
    pub fn on_receive(&self) {
        let registers = self.registers();
        // The clear comes first, so that a byte that comes meanwhile interrupts again.
        registers.intstatus.set(INT_RX);
        while registers.state.get() & STATE_RX_FULL != 0 {
            if self.received.is_full() {
                registers.ctrl.set(registers.ctrl.get() & !CTRL_RX_INTERRUPT);
                return;
            }
            let byte = registers.data.get() as u8;
            emulator::look_for_input();
            // There is room, because no other code writes.
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

    /// Continues after the buffer was full.
    fn resume(&self) {
        interrupt::free(|_| {
            let registers = self.registers();
            if registers.ctrl.get() & CTRL_RX_INTERRUPT == 0 {
                registers.ctrl.set(registers.ctrl.get() | CTRL_RX_INTERRUPT);
                // A byte that came while the interrupt was off has caused no interrupt.
                self.on_receive();
            }
        });
    }

    /// Waits for bytes; returns how many came.
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

    /// Waits for all of `into`. The processor sleeps between interrupts, and no other task runs.
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

    /// Drops bytes until none has come for this long.
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

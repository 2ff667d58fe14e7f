//! What USB costs behind the link: the task that serves the host, the executor, the chip's driver and its interrupt.
//!
//! The driver's registers are memory here, and this file does to them what the core would do: each transfer is over
//! when the driver has begun it. What is counted is every instruction but the processor's own way into the interrupt.

use super::{GRAIN, counts};
use core::cell::RefCell;
use core::future::pending;
use core::ops::Range;
use core::pin::pin;
use core::ptr::null_mut;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use core::task::Waker;
use embassy_executor::raw::Executor;
use embassy_futures::poll_once;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_time_queue_utils::Queue;
use embassy_usb::driver::{
    Bus, ControlPipe, Driver, EndpointAddress, EndpointAllocError, EndpointError, EndpointType,
    Event, Unsupported,
};
use embassy_usb_synopsys_otg::otg_v1::Otg;
use embassy_usb_synopsys_otg::{
    Config, Endpoint, In, OtgInstance, Out, PhyType, State, on_interrupt,
};
use nirspi_app::link::{CameraEnd, HostIn, HostOut, Link, Packet};
use nirspi_mcu::PacketSink;
use nirspi_usb::{BusSpeed, Endpoints, Memory, OutBuffer, PACKET_BYTES, Presence, device, serve};
use nirspi_wire::Version;
use static_cell::{ConstStaticCell, StaticCell};

pub const ENDPOINTS: usize = 9;
/// Packets that wait in the link.
pub const PLACES: usize = 4;
/// Where a packet of 1024 samples of 32 bits lies in its place.
const PACKET: Range<usize> = 2..4134;

const GINTSTS: usize = 0x14;
const DAINT: usize = 0x818;
const DIEPCTL1: usize = 0x920;
const DIEPINT1: usize = 0x928;
const DTXFSTS1: usize = 0x938;
const DOEPCTL1: usize = 0xB20;
const DOEPINT1: usize = 0xB28;
const DOEPTSIZ1: usize = 0xB30;
const FIFO1: usize = 0x2000;

const ENUMDNE: u32 = 1 << 13;
const IEPINT: u32 = 1 << 18;
const OEPINT: u32 = 1 << 19;
const XFRC: u32 = 1;
const USBAEP: u32 = 1 << 15;
const EPENA: u32 = 1 << 31;

static REGISTERS: [AtomicU32; FIFO1 / 4 + 1] = [const { AtomicU32::new(0) }; FIFO1 / 4 + 1];

fn register(offset: usize) -> &'static AtomicU32 {
    &REGISTERS[offset / 4]
}

/// The time of the clock.
static NOW_US: AtomicU32 = AtomicU32::new(1);

/// A clock that moves when it is told so, with the queue that embassy's drivers of time have.
struct Clock(Mutex<CriticalSectionRawMutex, RefCell<Queue>>);

embassy_time_driver::time_driver_impl!(static CLOCK: Clock = Clock(Mutex::new(RefCell::new(Queue::new()))));

impl embassy_time_driver::Driver for Clock {
    fn now(&self) -> u64 {
        NOW_US.load(Ordering::Relaxed).into()
    }

    fn schedule_wake(&self, at: u64, waker: &Waker) {
        self.0.lock(|queue| {
            let mut queue = queue.borrow_mut();
            if queue.schedule_wake(at, waker) {
                queue.next_expiration(self.now());
            }
        });
    }
}

/// A millisecond passes, and wakes the tasks whose time has come.
pub fn pass_millisecond() {
    NOW_US.fetch_add(1_000, Ordering::Relaxed);
    CLOCK.0.lock(|queue| queue.borrow_mut().next_expiration(NOW_US.load(Ordering::Relaxed).into()));
}

#[expect(unsafe_code, reason = "embassy looks for this name")]
#[unsafe(export_name = "__pender")]
fn pender(_context: *mut ()) {
    PENDS.store(true, Ordering::Relaxed);
}

/// A task has been woken that has not run yet.
static PENDS: AtomicBool = AtomicBool::new(false);

/// The chip's endpoints, and a host that has configured the device.
pub struct Chip(pub embassy_usb_synopsys_otg::Driver<'static, ENDPOINTS>);

impl Driver<'static> for Chip {
    type EndpointOut = Endpoint<'static, Out>;
    type EndpointIn = Endpoint<'static, In>;
    type ControlPipe = Host;
    type Bus = Host;

    fn alloc_endpoint_out(
        &mut self,
        ep_type: EndpointType,
        ep_addr: Option<EndpointAddress>,
        max_packet_size: u16,
        interval_ms: u8,
    ) -> Result<Self::EndpointOut, EndpointAllocError> {
        self.0.alloc_endpoint_out(ep_type, ep_addr, max_packet_size, interval_ms)
    }

    fn alloc_endpoint_in(
        &mut self,
        ep_type: EndpointType,
        ep_addr: Option<EndpointAddress>,
        max_packet_size: u16,
        interval_ms: u8,
    ) -> Result<Self::EndpointIn, EndpointAllocError> {
        self.0.alloc_endpoint_in(ep_type, ep_addr, max_packet_size, interval_ms)
    }

    fn start(self, control_max_packet_size: u16) -> (Host, Host) {
        let (mut bus, _) = self.0.start(control_max_packet_size);
        // The driver connects, and learns of high speed.
        let _ = poll_once(bus.poll());
        register(GINTSTS).store(ENUMDNE, Ordering::Relaxed);
        let _ = poll_once(bus.poll());
        register(GINTSTS).store(0, Ordering::Relaxed);
        for endpoint in [DIEPCTL1, DOEPCTL1] {
            register(endpoint).store(USBAEP | PACKET_BYTES as u32, Ordering::Relaxed);
        }
        register(DTXFSTS1).store(PACKET_BYTES as u32 / 4, Ordering::Relaxed);
        STEPS.store(0, Ordering::Relaxed);
        (Host, Host)
    }
}

/// Resets the bus, and configures the device.
pub struct Host;

/// What the host has done.
static STEPS: AtomicU32 = AtomicU32::new(0);

impl Bus for Host {
    async fn enable(&mut self) {}

    async fn disable(&mut self) {}

    async fn poll(&mut self) -> Event {
        match STEPS.load(Ordering::Relaxed) {
            0 => {
                STEPS.store(1, Ordering::Relaxed);
                Event::PowerDetected
            }
            1 => {
                STEPS.store(2, Ordering::Relaxed);
                Event::Reset
            }
            _ => pending().await,
        }
    }

    fn endpoint_set_enabled(&mut self, _ep_addr: EndpointAddress, _enabled: bool) {}

    fn endpoint_set_stalled(&mut self, _ep_addr: EndpointAddress, _stalled: bool) {}

    fn endpoint_is_stalled(&mut self, _ep_addr: EndpointAddress) -> bool {
        false
    }

    async fn remote_wakeup(&mut self) -> Result<(), Unsupported> {
        Err(Unsupported)
    }
}

impl BusSpeed for Host {
    fn is_full_speed(&self) -> bool {
        false
    }
}

impl ControlPipe for Host {
    fn max_packet_size(&self) -> usize {
        64
    }

    async fn setup(&mut self) -> [u8; 8] {
        if STEPS.load(Ordering::Relaxed) != 2 {
            return pending().await;
        }
        STEPS.store(3, Ordering::Relaxed);
        [0, 9, 1, 0, 0, 0, 0, 0]
    }

    async fn data_out(
        &mut self,
        _buf: &mut [u8],
        _first: bool,
        _last: bool,
    ) -> Result<usize, EndpointError> {
        Ok(0)
    }

    async fn data_in(&mut self, _: &[u8], _: bool, _: bool) -> Result<(), EndpointError> {
        Ok(())
    }

    async fn accept(&mut self) {}

    async fn reject(&mut self) {}

    async fn accept_set_address(&mut self, _addr: u8) {}
}

#[embassy_executor::task(pool_size = 3)]
pub async fn host(
    endpoints: Endpoints<Chip>,
    commands: HostIn<'static>,
    packets: HostOut<'static, PACKET_BYTES>,
) -> ! {
    serve(endpoints, commands, packets).await
}

/// Runs the tasks that are woken, until none is.
pub fn poll(executor: &'static Executor) {
    loop {
        PENDS.store(false, Ordering::Relaxed);
        #[expect(unsafe_code, reason = "an executor is polled by its owner")]
        // SAFETY: this is the only call, and the pender does not make it.
        unsafe {
            executor.poll();
        }
        if !PENDS.load(Ordering::Relaxed) {
            break;
        }
    }
}

fn registers() -> Otg {
    #[expect(unsafe_code, reason = "registers are at an address")]
    // SAFETY: the memory is as long as the registers that the driver uses here, and atomic.
    unsafe {
        Otg::from_ptr(REGISTERS.as_ptr().cast_mut().cast())
    }
}

/// The driver of the chip.
pub fn driver(
    buffer: &'static mut [u8],
    state: &'static State<ENDPOINTS>,
    dma: bool,
) -> embassy_usb_synopsys_otg::Driver<'static, ENDPOINTS> {
    let instance = OtgInstance {
        regs: registers(),
        state,
        fifo_depth_words: 1024,
        endpoint_count: ENDPOINTS,
        phy_type: PhyType::InternalHighSpeed,
        extra_rx_fifo_words: 30,
        calculate_trdt_fn: |_| 9,
    };
    let mut config = Config::default();
    config.dma = dma;
    embassy_usb_synopsys_otg::Driver::new(buffer, instance, config)
}

/// The interrupt, which has these flags of the core.
fn interrupt(state: &'static State<ENDPOINTS>) {
    #[expect(unsafe_code, reason = "an interrupt handler is called by the processor alone")]
    // SAFETY: no code of the driver runs now.
    unsafe {
        on_interrupt(registers(), state, ENDPOINTS);
    }
}

/// The core's DMA writes these bytes of the host into the endpoint's buffer.
pub fn receive(bytes: &[u8], buffer: *mut u8, state: &'static State<ENDPOINTS>) {
    #[expect(unsafe_code, reason = "the core writes where the driver has said")]
    // SAFETY: the buffer has room for a packet, and belongs to the core until the interrupt.
    unsafe {
        buffer.copy_from_nonoverlapping(bytes.as_ptr(), bytes.len().min(PACKET_BYTES));
    }
    register(DOEPTSIZ1).store((PACKET_BYTES - bytes.len()) as u32, Ordering::Relaxed);
    register(DOEPINT1).store(XFRC, Ordering::Relaxed);
    register(DAINT).store(1 << 17, Ordering::Relaxed);
    register(GINTSTS).store(OEPINT, Ordering::Relaxed);
    interrupt(state);
    register(GINTSTS).store(0, Ordering::Relaxed);
}

/// The host fetches all that the driver has to send. Returns counts of SysTick, and the number of transfers.
pub fn send_all(executor: &'static Executor, state: &'static State<ENDPOINTS>) -> (u32, u32) {
    let (mut cost, mut transfers) = (0, 0);
    while register(DIEPCTL1).load(Ordering::Relaxed) & EPENA != 0 {
        register(DIEPCTL1).fetch_and(!EPENA, Ordering::Relaxed);
        register(DIEPINT1).store(XFRC, Ordering::Relaxed);
        register(DAINT).store(1 << 1, Ordering::Relaxed);
        register(GINTSTS).store(IEPINT, Ordering::Relaxed);
        cost += counts(|| {
            interrupt(state);
            poll(executor);
        });
        register(GINTSTS).store(0, Ordering::Relaxed);
        transfers += 1;
    }
    (cost, transfers)
}

/// Puts packets into the link, lets the driver send them, and returns the instructions of a transfer.
fn transfers(
    executor: &'static Executor,
    state: &'static State<ENDPOINTS>,
    camera: &mut CameraEnd<'_>,
) -> u32 {
    let (_, sink) = camera.both();
    for _ in 0..PLACES {
        if sink.claim(PACKET.end).is_some() {
            sink.commit(PACKET);
        }
    }
    poll(executor);
    let (cost, transfers) = send_all(executor, state);
    cost * GRAIN / transfers.max(1)
}

/// Instructions of a transfer of 512 bytes that the processor copies, and of a whole packet that the core's DMA reads.
pub fn count() -> [u32; 2] {
    static STATES: [State<ENDPOINTS>; 2] = [const { State::new() }; 2];
    static PRESENCES: StaticCell<[Presence; 2]> = StaticCell::new();
    static MEMORIES: StaticCell<[Memory; 2]> = StaticCell::new();
    static BUFFERS: ConstStaticCell<[OutBuffer; 2]> =
        ConstStaticCell::new([const { OutBuffer::new() }; 2]);
    static ROOMS: ConstStaticCell<[[Packet; PLACES]; 2]> =
        ConstStaticCell::new([const { [Packet::EMPTY; PLACES] }; 2]);
    static LINKS: StaticCell<[Link<'static>; 2]> = StaticCell::new();
    static EXECUTOR: StaticCell<Executor> = StaticCell::new();

    let executor: &'static Executor = EXECUTOR.init(Executor::new(null_mut()));
    let [first, second] = &*PRESENCES.init([const { Presence::new() }; 2]);
    let memories = MEMORIES.init([Memory::new(first), Memory::new(second)]);
    let links = LINKS.init(ROOMS.take().each_mut().map(|places| Link::new(places)));
    let buffers = BUFFERS.take();
    let mut counted = [0; 2];
    let parts = memories.iter_mut().zip(links).zip(buffers).zip(&STATES).zip([false, true]);
    for (counted, ((((memory, link), buffer), state), dma)) in counted.iter_mut().zip(parts) {
        let driver = driver(&mut buffer.0, state, dma);
        let (mut device, endpoints) = device(Chip(driver), "", Version(0, 0, 0), memory);
        let _ = poll_once(pin!(device.run()));
        let (mut camera, commands, packets) = link.split();
        if let Ok(token) = host(endpoints, commands, packets) {
            executor.spawner().spawn(token);
        }
        poll(executor);
        // The first packets find caches of nothing, but a task that has just begun.
        transfers(executor, state, &mut camera);
        *counted = transfers(executor, state, &mut camera);
    }
    counted
}

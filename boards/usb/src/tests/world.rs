//! The whole camera on a simulated bus: the firmware's loop, this device, the chip's driver on a
//! simulated core, and a host. Tasks are polled only when they are woken, as on a chip.

use super::SERIAL;
use super::otg_core::{Answer, ENDPOINTS, OtgCore, Speed};
use crate::{Memory, OutBuffer, Presence, device, serve};
use embassy_usb_synopsys_otg::otg_v1::Otg;
use embassy_usb_synopsys_otg::{Config, Driver, OtgInstance, PhyType, State, testing};
use nirspi_app::bench::{self, FakeBoard, FakeFpga, Pins, configuration, packet};
use nirspi_app::link::{Link, Packet};
use nirspi_app::{DepthMailbox, board_info, run};
use nirspi_mcu::{Crash, Limits, Micros, NoLoader};
use nirspi_wire::fpga::MAX_FRAME_BYTES;
use nirspi_wire::packet::MAX_DEVICE_PACKET;
use nirspi_wire::{
    Answer as Reply, Command, Deframed, Deframer, DeviceMessage, EventKind, Fault, Refusal,
    RunLength, Status, open, usb, version,
};
use std::borrow::ToOwned;
use std::boxed::Box;
use std::cell::{Cell, RefCell};
use std::future::Future;
use std::pin::Pin;
use std::rc::Rc;
use std::string::String;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::task::{Context, Wake, Waker};
use std::vec::Vec;

/// Patterns of a frame: 64 samples fill more than half a packet.
pub const PATTERNS: u16 = 64;

/// From one frame to the next, in microseconds.
const FRAME_US: u64 = 400;

/// The chip's driver, as the firmware of a board has it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Chip {
    /// The release, without the fork's repairs. It copies.
    Released,
    /// The processor copies what goes to the host, 512 bytes at a time.
    Copying,
    /// The core reads whole packets out of memory.
    Dma,
    /// The same, and out of the ring into which the FPGA's parallel port sends them.
    Ring,
}

/// The drivers that boards have.
pub const CHIPS: [Chip; 3] = [Chip::Copying, Chip::Dma, Chip::Ring];

/// Longest time that a host waits for a device, in rounds of the world. A host of flesh waits for
/// seconds.
const HOST_PATIENCE: u32 = 20_000;

/// The address that the host gives the device.
const ADDRESS: u8 = 7;

struct Flag(AtomicBool);

impl Wake for Flag {
    fn wake(self: Arc<Self>) {
        self.0.store(true, Ordering::Relaxed);
    }
}

struct Task {
    future: Pin<Box<dyn Future<Output = ()>>>,
    woken: Arc<Flag>,
}

pub struct World {
    pub core: Rc<RefCell<OtgCore>>,
    pub pins: Rc<Pins>,
    registers: Otg,
    state: &'static State<ENDPOINTS>,
    tasks: Vec<Task>,
    chip: Chip,
}

impl World {
    /// A camera that has just started, without a cable.
    pub fn new(chip: Chip) -> Self {
        Self::started(Rc::default(), None, chip)
    }

    /// The camera after its firmware has crashed: the chip starts anew, and the FPGA has noticed nothing.
    pub fn crashed(self, text: &str) -> Self {
        let crash = Crash::new(Micros(bench::now_us()), format_args!("{text}"));
        self.restarted(Some(crash))
    }

    /// The camera after its supply has failed for a moment: chip and FPGA start anew.
    pub fn powered_up(self) -> Self {
        self.pins.reset_fpga();
        self.restarted(None)
    }

    fn restarted(self, crash: Option<Crash>) -> Self {
        let Self { pins, chip, core, tasks, .. } = self;
        *core.borrow_mut() = OtgCore::default();
        drop(tasks);
        // The chip's reset makes the pin an input, whose resistor switches the LED drivers off.
        pins.leds_enabled.set(false);
        Self::started(pins, crash, chip)
    }

    fn started(pins: Rc<Pins>, crash: Option<Crash>, chip: Chip) -> Self {
        let core: Rc<RefCell<OtgCore>> = Rc::default();
        let registers = testing::install(Rc::clone(&core) as Rc<_>, chip == Chip::Released);
        let state: &'static State<ENDPOINTS> = Box::leak(Box::new(State::new()));
        let instance = OtgInstance {
            regs: registers,
            state,
            fifo_depth_words: 1024,
            endpoint_count: ENDPOINTS,
            phy_type: PhyType::InternalHighSpeed,
            extra_rx_fifo_words: 30,
            calculate_trdt_fn: |_| 9,
        };
        let OutBuffer(buffer) = Box::leak(Box::new(OutBuffer::new()));
        let mut config = Config::default();
        config.dma = matches!(chip, Chip::Dma | Chip::Ring);
        let driver = Driver::new(buffer, instance, config);
        let presence: &'static Presence = Box::leak(Box::new(Presence::new()));
        let memory = Box::leak(Box::new(Memory::new(presence)));
        let info = board_info("bench", SERIAL);
        let (mut usb, endpoints) = device(driver, SERIAL, info.firmware, memory);

        pins.frame_us.set(FRAME_US);
        let link = Box::leak(Box::new(Link::new(std::vec![Packet::EMPTY; 8].leak())));
        let (camera, commands, packets) = link.split();
        let port = FakeFpga::new(Rc::clone(&pins));
        let firmware = nirspi_app::Device {
            board: FakeBoard(Rc::clone(&pins)),
            port: if chip == Chip::Ring { port.with_ring() } else { port },
            frame: Box::leak(Box::new([0; MAX_FRAME_BYTES])),
            loader: NoLoader,
            info,
            limits: Limits::SIMULATED,
            crash,
            restarts: 0,
        };
        let depth: &'static DepthMailbox = Box::leak(Box::new(DepthMailbox::new()));
        let futures: [Pin<Box<dyn Future<Output = ()>>>; 3] = [
            Box::pin(async move { usb.run().await }),
            Box::pin(async move { serve(endpoints, commands, packets).await }),
            Box::pin(async move { run(firmware, camera, depth).await }),
        ];
        let tasks = futures
            .into_iter()
            .map(|future| Task { future, woken: Arc::new(Flag(AtomicBool::new(true))) })
            .collect();
        let mut world = Self { core, pins, registers, state, tasks, chip };
        world.rounds(10);
        world
    }

    /// Some twenty microseconds: interrupts, then each task that is woken.
    pub fn round(&mut self) {
        for _ in 0..100 {
            if !self.core.borrow_mut().interrupt() {
                break;
            }
            testing::interrupt(self.registers, self.state);
        }
        for task in &mut self.tasks {
            if task.woken.0.swap(false, Ordering::Relaxed) {
                let waker = Waker::from(Arc::clone(&task.woken));
                let polled = task.future.as_mut().poll(&mut Context::from_waker(&waker));
                assert!(polled.is_pending());
            }
        }
        bench::advance(20);
    }

    pub fn rounds(&mut self, count: u32) {
        (0..count).for_each(|_| self.round());
    }

    /// Passes so much time.
    pub fn pass(&mut self, micros: u64) {
        let end = bench::now_us() + micros;
        while bench::now_us() < end {
            self.round();
        }
    }

    /// Resets the bus, and agrees on a speed.
    pub fn plug(&mut self, speed: Speed) {
        self.core.borrow_mut().reset();
        self.rounds(20);
        self.core.borrow_mut().enumerated(speed);
        self.rounds(20);
    }

    /// Three milliseconds without the host.
    pub fn falls_silent(&mut self) {
        self.pass(3_000);
        self.core.borrow_mut().suspend();
        self.pass(2_000);
    }

    /// Runs the world beside a host for so many rounds, or until the host is done.
    pub fn beside<T>(&mut self, rounds: u32, host: impl Future<Output = T>) -> Option<T> {
        let mut host = core::pin::pin!(host);
        let mut context = Context::from_waker(Waker::noop());
        for _ in 0..rounds {
            self.round();
            if let core::task::Poll::Ready(done) = host.as_mut().poll(&mut context) {
                return Some(done);
            }
        }
        None
    }

    pub fn is_dark(&self) -> bool {
        !self.pins.leds_enabled.get() && !self.pins.running.get()
    }

    /// A host that has just seen the device.
    pub fn host(&self, log: &Rc<Log>) -> Host {
        Host {
            core: Rc::clone(&self.core),
            log: Rc::clone(log),
            address: 0,
            toggles: [0; 2],
            packet_bytes: 512,
            deframer: Box::default(),
            replies: Vec::new(),
            next_id: 0,
            patterns: PATTERNS,
            begun: 0,
        }
    }

    pub fn assert_no_violation(&self) {
        assert_eq!(self.core.borrow().violations, Vec::<String>::new());
    }
}

/// What hosts have seen, kept when a host is gone.
#[derive(Default)]
pub struct Log {
    /// Run and sequence of each frame.
    pub frames: RefCell<Vec<(u16, u32)>>,
    /// Acknowledgements that are lost, one in so many; 0 for none.
    pub acknowledgements_lost: Cell<u32>,
    pub random: Cell<u64>,
    /// Sessions that reached the stream.
    pub streams: Cell<u32>,
    /// Packets that came damaged, where a test damages packets; `None` where none may be.
    pub damaged: Cell<Option<u32>>,
    /// Faults that the camera has reported.
    pub faults: RefCell<Vec<Fault>>,
    /// Texts of crash reports.
    pub crashes: RefCell<Vec<String>>,
}

impl Log {
    /// A number below `bound` (xorshift).
    pub fn random(&self, bound: u32) -> u32 {
        let mut x = self.random.get() | 1;
        x ^= x << 13;
        x ^= x >> 7;
        x ^= x << 17;
        self.random.set(x);
        (x >> 33) as u32 % bound
    }
}

/// What happens to a packet on the bus, and to the host's answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Way {
    /// Both arrive.
    Clear,
    /// The packet is lost or damaged. The host's controller drops what it gets, and does not answer.
    PacketLost,
    /// The packet arrives, and its acknowledgement is lost.
    AcknowledgementLost,
}

/// The device does not answer.
#[derive(Debug, PartialEq)]
pub struct Deaf;

pub struct Host {
    pub core: Rc<RefCell<OtgCore>>,
    log: Rc<Log>,
    address: u8,
    /// Toggles of the bulk endpoints, in and out.
    toggles: [u8; 2],
    pub packet_bytes: usize,
    deframer: Box<Deframer<MAX_DEVICE_PACKET>>,
    replies: Vec<(u16, Result<Option<Status>, Refusal>)>,
    next_id: u16,
    /// Patterns of the frames that the host asks for.
    pub patterns: u16,
    /// Bytes that have arrived of a packet of the wire protocol.
    pub begun: usize,
}

pub async fn tick() {
    embassy_futures::yield_now().await;
}

impl Host {
    /// A control transfer to the host, or without data; `None` if the device refuses.
    pub async fn control(&mut self, request: [u8; 8]) -> Result<Option<Vec<u8>>, Deaf> {
        let [kind, code, address, .., low, high] = request;
        let length = usize::from(u16::from_le_bytes([low, high]));
        self.until(|core, host| match core.setup(host, request) {
            Answer::Silence => None,
            _ => Some(()),
        })
        .await?;
        if [kind, code] == [0x00, 5] {
            // The core takes the new address after the status stage; the simulated core, at once.
            self.address = address;
        }
        let mut data = Vec::new();
        while kind & 0x80 != 0 {
            let answer = self.until(|core, host| answer(core.fetch(host, 0, true))).await?;
            let Some((bytes, _)) = answer else { return Ok(None) };
            data.extend(&bytes);
            if bytes.len() < 64 || data.len() >= length {
                break;
            }
        }
        let status = if kind & 0x80 != 0 {
            self.until(|core, host| answer(core.send(host, 0, &[], 1))).await?
        } else {
            self.until(|core, host| answer(core.fetch(host, 0, true))).await?
        };
        Ok(status.map(|_| data))
    }

    /// Repeats a transaction until it has an outcome.
    async fn until<T>(
        &mut self,
        mut transaction: impl FnMut(&mut OtgCore, u8) -> Option<T>,
    ) -> Result<T, Deaf> {
        for _ in 0..HOST_PATIENCE {
            let outcome = transaction(&mut self.core.borrow_mut(), self.address);
            tick().await;
            if let Some(outcome) = outcome {
                return Ok(outcome);
            }
        }
        Err(Deaf)
    }

    pub async fn descriptor(&mut self, kind: u8, length: u8) -> Result<Option<Vec<u8>>, Deaf> {
        self.control([0x80, 6, 0, kind, 0, 0, length, 0]).await
    }

    /// What a host does with a new device, up to `SET_CONFIGURATION`.
    pub async fn enumerate(&mut self) -> Result<(), Deaf> {
        self.descriptor(1, 64).await?.expect("a device descriptor");
        self.control([0x00, 5, ADDRESS, 0, 0, 0, 0, 0]).await?;
        self.descriptor(1, 18).await?;
        self.descriptor(2, 9).await?;
        let configuration = self.descriptor(2, 255).await?.expect("a configuration");
        self.packet_bytes = u16::from_le_bytes([configuration[22], configuration[23]]).into();
        self.configure().await
    }

    pub async fn configure(&mut self) -> Result<(), Deaf> {
        self.control([0x00, 9, 1, 0, 0, 0, 0, 0]).await?;
        self.toggles = [0; 2];
        Ok(())
    }

    /// `CLEAR_FEATURE(ENDPOINT_HALT)` of both endpoints.
    pub async fn clear_halts(&mut self) -> Result<(), Deaf> {
        for endpoint in [usb::ENDPOINT_IN, usb::ENDPOINT_OUT] {
            self.control([0x02, 1, 0, 0, endpoint, 0, 0, 0]).await?;
        }
        self.toggles = [0; 2];
        Ok(())
    }

    /// Takes up a device that was asleep: address, configuration and toggles are those of before.
    pub fn resumes(&mut self, toggles: [u8; 2]) {
        self.address = ADDRESS;
        self.toggles = toggles;
    }

    /// Sends a command, and reads until its reply.
    pub async fn ask(
        &mut self,
        command: Command<'_>,
    ) -> Result<Result<Option<Status>, Refusal>, Deaf> {
        let id = self.tell(command).await?;
        for _ in 0..HOST_PATIENCE {
            self.read();
            if let Some(place) = self.replies.iter().position(|(of, _)| *of == id) {
                return Ok(self.replies.swap_remove(place).1);
            }
            tick().await;
        }
        Err(Deaf)
    }

    /// Sends a command, and reads nothing.
    pub async fn tell(&mut self, command: Command<'_>) -> Result<u16, Deaf> {
        self.next_id += 1;
        for piece in packet(self.next_id, command).chunks(self.packet_bytes) {
            let toggle = self.toggles[1];
            self.until(|core, host| answer(core.send(host, 1, piece, toggle))).await?;
            self.toggles[1] ^= 1;
        }
        Ok(self.next_id)
    }

    /// Takes the place of a host whose program has ended, on a device that is still configured.
    pub fn program_restarts(&mut self) {
        self.deframer = Box::default();
        self.begun = 0;
    }

    /// Fetches one packet, if there is one.
    pub fn read(&mut self) {
        let lost = self.log.acknowledgements_lost.get();
        let acknowledged = lost == 0 || self.log.random(lost) != 0;
        self.fetch(if acknowledged { Way::Clear } else { Way::AcknowledgementLost });
    }

    /// Fetches one packet this way. Returns whether there was one.
    pub fn fetch(&mut self, way: Way) -> bool {
        let fetched = self.core.borrow_mut().fetch(self.address, 1, way == Way::Clear);
        let Answer::Data(bytes, toggle) = fetched else { return false };
        // A packet with the toggle of the one before is sent again.
        if way != Way::PacketLost && toggle == self.toggles[0] {
            self.toggles[0] ^= 1;
            self.take(&bytes);
        }
        true
    }

    fn take(&mut self, bytes: &[u8]) {
        self.begun = match bytes.iter().rposition(|&byte| byte == 0) {
            Some(end) => bytes.len() - 1 - end,
            None => self.begun + bytes.len(),
        };
        let mut rest = bytes;
        while let Some(found) = self.deframer.next(&mut rest) {
            let Deframed::Packet(packet) = found else { panic!("{found:?}") };
            let message = open::<DeviceMessage<'_>>(packet);
            if let (Err(_), Some(damaged)) = (&message, self.log.damaged.get()) {
                self.log.damaged.set(Some(damaged + 1));
                continue;
            }
            match message.expect("a whole message") {
                DeviceMessage::Reply(reply) => {
                    let outcome = reply.outcome.map(|answer| match answer {
                        Reply::Status(status) => Some(status),
                        _ => None,
                    });
                    self.replies.push((reply.id, outcome));
                }
                DeviceMessage::Frame(frame) => {
                    assert_eq!(frame.samples.len(), usize::from(self.patterns));
                    self.log.frames.borrow_mut().push((frame.run, frame.sequence));
                }
                DeviceMessage::Event(event) => {
                    if let EventKind::Fault(fault) = event.kind {
                        self.log.faults.borrow_mut().push(fault);
                    }
                }
                DeviceMessage::Crash(report) => {
                    self.log.crashes.borrow_mut().push(report.text.to_owned());
                }
                _ => {}
            }
        }
    }

    pub async fn hello(&mut self) -> Result<(), Deaf> {
        let answered = self.ask(Command::Hello { protocol: version::CURRENT }).await?;
        assert_eq!(answered, Ok(None));
        Ok(())
    }

    pub async fn status(&mut self) -> Result<Status, Deaf> {
        let answered = self.ask(Command::Status).await?;
        Ok(answered.expect("never refused").expect("a status"))
    }

    /// Configures the camera and starts the stream.
    pub async fn start(&mut self) -> Result<(), Deaf> {
        self.start_run(RunLength::Continuous).await
    }

    /// Configures the camera and starts a run.
    pub async fn start_run(&mut self, length: RunLength) -> Result<(), Deaf> {
        assert_eq!(self.ask(Command::Configure(configuration(self.patterns))).await?, Ok(None));
        assert_eq!(self.ask(Command::Start(length)).await?, Ok(None));
        Ok(())
    }

    /// Reads the stream for ever, and shows now and then that the host is alive.
    pub async fn stream(&mut self) -> Result<(), Deaf> {
        self.log.streams.set(self.log.streams.get() + 1);
        loop {
            for _ in 0..500 {
                self.read();
                tick().await;
            }
            self.status().await?;
        }
    }
}

/// Data and toggle, or `None` for a halt; nothing to retry.
fn answer(answer: Answer) -> Option<Option<(Vec<u8>, u8)>> {
    match answer {
        Answer::Data(bytes, toggle) => Some(Some((bytes, toggle))),
        Answer::Stall => Some(None),
        Answer::Nak | Answer::Silence => None,
    }
}

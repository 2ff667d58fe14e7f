//! USB: the chip's core, which is that of `nirspi-otg-core`, and a host at the other end of a cable.
//!
//! Assumed: high speed; a packet of 512 bytes takes 12.8 us of the bus (40 MB/s); a host resets the bus 1 ms after it has
//! seen a device. Not modelled: the PHY, its electrical side, hubs, isochronous traffic.

use crate::unicorn::Memory;
use nirspi_otg_core::{Answer, OtgCore, Speed};
use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::future::Future;
use std::pin::Pin;
use std::rc::Rc;
use std::task::{Context, Waker};

/// `GAHBCFG`, `DCTL`: where the driver shows the device on the bus.
const DCTL: u32 = 0x804;
const SOFT_DISCONNECT: u32 = 1 << 1;
const CID: usize = 0x3C;
const CORE_ID: u32 = 0x5000;

/// Time of a packet of 512 bytes.
const PACKET_PS: u64 = 12_800_000;
/// A host with nothing to do looks once in a microframe.
const MICROFRAME_PS: u64 = 125_000_000;

const ADDRESS: u8 = 7;

struct Ram(Memory);

impl nirspi_otg_core::Memory for Ram {
    fn fetch(&mut self, address: u32, bytes: usize) -> Option<Vec<u8>> {
        self.0.get(address, bytes)
    }

    fn store(&mut self, address: u32, bytes: &[u8]) -> bool {
        (0x2000_0000..0x2027_0000).contains(&address) && self.0.put(address, bytes)
    }
}

/// The cable and what both ends know of each other.
#[derive(Default)]
pub struct Cable {
    /// Whether it is plugged in.
    pub plugged: Cell<bool>,
    /// The host sleeps: the bus is silent.
    pub asleep: Cell<bool>,
    /// The device has a configuration.
    pub configured: Cell<bool>,
    /// Configurations so far.
    pub sessions: Cell<u32>,
    /// From the host's program, and for it.
    pub to_device: RefCell<VecDeque<u8>>,
    pub from_device: RefCell<VecDeque<u8>>,
    /// Whether the host's program reads.
    pub reads: Cell<bool>,
    /// Descriptors by type, as they came.
    pub descriptors: RefCell<Vec<(u8, Vec<u8>)>>,
    /// What a host complains about.
    pub complaints: RefCell<Vec<String>>,
    /// Packets that the host has fetched.
    pub packets: Cell<u64>,
    now: Cell<u64>,
    wait_ps: Cell<u64>,
}

/// The core and the host.
pub struct Usb {
    core: Rc<RefCell<OtgCore>>,
    memory: Memory,
    pub cable: Rc<Cable>,
    host: Pin<Box<dyn Future<Output = ()>>>,
    due_ps: u64,
    /// What earlier cores did wrong, before a reset.
    wrong: Vec<String>,
}

impl Usb {
    /// A chip with a cable, which a host is at the other end of if `plugged`.
    #[must_use]
    pub fn new(memory: Memory, plugged: bool) -> Self {
        let core = Rc::new(RefCell::new(fresh(memory)));
        let cable = Rc::<Cable>::default();
        cable.plugged.set(plugged);
        cable.reads.set(true);
        let host =
            Host { core: Rc::clone(&core), cable: Rc::clone(&cable), address: 0, toggles: [0; 2] };
        let host = Box::pin(host.run());
        Self { core, memory, cable, host, due_ps: 0, wrong: Vec::new() }
    }

    /// A reset of the chip or of the core.
    pub fn restart(&mut self) {
        let mut core = self.core.borrow_mut();
        self.wrong.append(&mut core.violations);
        *core = fresh(self.memory);
        self.cable.configured.set(false);
    }

    /// What the driver did that it must not do, and what a host complains about.
    #[must_use]
    pub fn wrong(&self) -> Vec<String> {
        let mut all = self.wrong.clone();
        all.extend(self.core.borrow().violations.iter().map(|what| format!("USB core: {what}")));
        all.extend(self.cable.complaints.borrow().iter().cloned());
        all
    }

    /// Whether a write shows the device on the bus.
    #[must_use]
    pub fn attaches(&self, offset: u32, value: u32) -> bool {
        offset == DCTL
            && value & SOFT_DISCONNECT == 0
            && self.core.borrow_mut().read(DCTL as usize) & SOFT_DISCONNECT != 0
    }

    #[must_use]
    pub fn is_configured(&self) -> bool {
        self.cable.configured.get()
    }

    pub fn read(&mut self, offset: u32) -> u32 {
        self.core.borrow_mut().read(offset as usize)
    }

    pub fn write(&mut self, offset: u32, value: u32) {
        self.core.borrow_mut().write(offset as usize, value);
    }

    pub fn interrupt(&mut self) -> bool {
        self.core.borrow_mut().interrupt()
    }

    #[must_use]
    pub fn due(&self) -> u64 {
        self.due_ps
    }

    /// Lets the host go on, if it is time. Returns whether it was.
    pub fn step(&mut self, now: u64) -> bool {
        if now < self.due_ps {
            return false;
        }
        self.cable.now.set(now);
        self.cable.wait_ps.set(MICROFRAME_PS);
        let _ = self.host.as_mut().poll(&mut Context::from_waker(Waker::noop()));
        self.due_ps = now + self.cable.wait_ps.get();
        true
    }

    /// Whether a transfer to the host is armed.
    #[must_use]
    pub fn is_armed(&self) -> bool {
        self.core.borrow().is_armed(1)
    }
}

fn fresh(memory: Memory) -> OtgCore {
    let mut core = OtgCore::new(Ram(memory));
    core.write(CID, CORE_ID);
    core.write(DCTL as usize, SOFT_DISCONNECT);
    core
}

struct Host {
    core: Rc<RefCell<OtgCore>>,
    cable: Rc<Cable>,
    address: u8,
    toggles: [u8; 2],
}

/// The device has gone, or does not answer.
struct Gone;

/// Waits for the next step of the host.
async fn step() {
    let mut waited = false;
    std::future::poll_fn(|_| {
        if std::mem::replace(&mut waited, true) {
            std::task::Poll::Ready(())
        } else {
            std::task::Poll::Pending
        }
    })
    .await;
}

impl Host {
    async fn run(mut self) {
        loop {
            // A host of flesh and cable: whatever happens, it begins again.
            let _ = self.visit().await;
            if self.cable.configured.replace(false) {
                // The bus falls silent: after 3 ms the device knows.
                self.wait_us(3_000).await;
                self.core.borrow_mut().suspend();
                self.wait_us(1_000).await;
            }
        }
    }

    async fn wait_us(&self, us: u64) {
        let until = self.cable.now.get() + us * 1_000_000;
        while let left @ 1.. = until.saturating_sub(self.cable.now.get()) {
            self.cable.wait_ps.set(left);
            step().await;
        }
    }

    /// The device waits this long at most.
    async fn quickly(&self) {
        self.cable.wait_ps.set(PACKET_PS);
        step().await;
    }

    fn is_there(&self) -> Result<(), Gone> {
        let there = self.cable.plugged.get() && self.core.borrow().is_attached();
        if there { Ok(()) } else { Err(Gone) }
    }

    async fn visit(&mut self) -> Result<(), Gone> {
        while self.is_there().is_err() {
            step().await;
        }
        self.wait_us(1_000).await;
        self.address = 0;
        self.core.borrow_mut().reset();
        self.wait_us(1_000).await;
        self.core.borrow_mut().enumerated(Speed::High);
        self.wait_us(1_000).await;
        self.enumerate().await?;
        self.cable.sessions.set(self.cable.sessions.get() + 1);
        self.cable.to_device.borrow_mut().clear();
        self.cable.from_device.borrow_mut().clear();
        self.cable.configured.set(true);
        self.wait_us(500).await;
        let sizes = self.core.borrow().packet_bytes(1);
        if sizes != [512; 2] {
            self.complain(format!(
                "endpoint 1 has {sizes:?} bytes in the core, the descriptor 512"
            ));
        }
        self.talk().await
    }

    async fn enumerate(&mut self) -> Result<(), Gone> {
        self.cable.descriptors.borrow_mut().clear();
        self.descriptor(1, 0, 64).await?;
        self.control([0x00, 5, ADDRESS, 0, 0, 0, 0, 0]).await?;
        self.wait_us(2_000).await;
        let device = self.descriptor(1, 0, 18).await?;
        let configuration = self.descriptor(2, 0, 255).await?;
        self.descriptor(15, 0, 255).await?;
        for string in 1..=3 {
            self.descriptor(3, string, 255).await?;
        }
        self.judge(device.as_deref(), configuration.as_deref());
        self.control([0x00, 9, 1, 0, 0, 0, 0, 0]).await?;
        self.toggles = [0; 2];
        Ok(())
    }

    async fn descriptor(
        &mut self,
        kind: u8,
        index: u8,
        length: u8,
    ) -> Result<Option<Vec<u8>>, Gone> {
        let language = if kind == 3 { [9, 4] } else { [0, 0] };
        let found =
            self.control([0x80, 6, index, kind, language[0], language[1], length, 0]).await?;
        match &found {
            Some(bytes) if length > 64 || kind == 1 && length == 18 => {
                self.cable.descriptors.borrow_mut().push((kind, bytes.clone()));
            }
            None => self.complain(format!("descriptor {kind}.{index} is refused")),
            _ => {}
        }
        Ok(found)
    }

    fn complain(&self, what: String) {
        let mut complaints = self.cable.complaints.borrow_mut();
        if !complaints.contains(&what) {
            complaints.push(what);
        }
    }

    /// What the drivers of Linux and Windows check, and what this camera promises.
    fn judge(&self, device: Option<&[u8]>, configuration: Option<&[u8]>) {
        use nirspi_wire::usb;
        let word = |bytes: &[u8], at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        match device {
            Some(bytes) if bytes.len() == 18 => {
                let expected = (usb::VENDOR_ID, usb::PRODUCT_ID, 64, 1);
                let found = (word(bytes, 8), word(bytes, 10), bytes[7], bytes[17]);
                if found != expected {
                    self.complain(format!("device descriptor: {found:?}, expected {expected:?}"));
                }
            }
            other => self.complain(format!("device descriptor: {other:02x?}")),
        }
        let Some(bytes) = configuration.filter(|bytes| bytes.len() >= 9) else {
            self.complain(format!("configuration descriptor: {configuration:02x?}"));
            return;
        };
        if usize::from(word(bytes, 2)) != bytes.len() {
            self.complain(format!(
                "configuration descriptor: {} bytes of {}",
                bytes.len(),
                word(bytes, 2)
            ));
        }
        let (mut rest, mut endpoints, mut classes) = (bytes, Vec::new(), Vec::new());
        while let [length @ 2..=255, kind, ..] = rest
            && rest.len() >= usize::from(*length)
        {
            match kind {
                4 => classes.push(rest[5]),
                5 => endpoints.push((rest[2], rest[3], word(rest, 4))),
                _ => {}
            }
            rest = &rest[usize::from(*length)..];
        }
        // A bulk endpoint at high speed has 512 bytes (USB 2.0, 5.8.3); Windows refuses others.
        let expected = [(usb::ENDPOINT_OUT, 2, 512), (usb::ENDPOINT_IN, 2, 512)];
        if endpoints != expected || classes != [0xFF] || !rest.is_empty() {
            self.complain(format!(
                "configuration: endpoints {endpoints:?}, classes {classes:?}, {} bytes too many",
                rest.len()
            ));
        }
    }

    /// A control transfer to the host, or without data; `None` if the device refuses.
    async fn control(&mut self, request: [u8; 8]) -> Result<Option<Vec<u8>>, Gone> {
        let [kind, code, address, .., low, high] = request;
        let length = usize::from(u16::from_le_bytes([low, high]));
        self.until(|core, host| (core.setup(host, request) != Answer::Silence).then_some(()))
            .await?;
        let mut data = Vec::new();
        let is_to_host = kind & 0x80 != 0;
        let mut is_done = !is_to_host;
        while !is_done {
            let answer = self.until(|core, host| told(core.fetch(host, 0, true))).await?;
            let Some(bytes) = answer else { return Ok(None) };
            data.extend(&bytes);
            is_done = bytes.len() < 64 || data.len() >= length;
        }
        // The core of this model takes a new address at once, a real one after the status stage.
        if [kind, code] == [0x00, 5] {
            self.wait_us(50).await;
            self.address = address;
        }
        let status = if is_to_host {
            self.until(|core, host| told(core.send(host, 0, &[], 1))).await?
        } else {
            self.until(|core, host| told(core.fetch(host, 0, true))).await?
        };
        Ok(status.map(|_| data))
    }

    /// Repeats a transaction until it has an outcome, for half a second.
    async fn until<T>(
        &mut self,
        mut transaction: impl FnMut(&mut OtgCore, u8) -> Option<T>,
    ) -> Result<T, Gone> {
        let patience = self.cable.now.get() + 500_000_000_000;
        loop {
            self.is_there()?;
            let outcome = transaction(&mut self.core.borrow_mut(), self.address);
            if let Some(outcome) = outcome {
                return Ok(outcome);
            }
            if self.cable.now.get() > patience {
                self.complain("the device does not answer for half a second".into());
                return Err(Gone);
            }
            self.quickly().await;
        }
    }

    /// Moves bytes until the device has gone.
    async fn talk(&mut self) -> Result<(), Gone> {
        loop {
            self.is_there()?;
            if self.cable.asleep.get() {
                self.sleep().await?;
            }
            let mut worked = false;
            if !self.cable.to_device.borrow().is_empty() {
                worked |= self.give();
            }
            if self.cable.reads.get() {
                worked |= self.take()?;
            }
            if worked {
                self.quickly().await;
            } else {
                self.cable.wait_ps.set(MICROFRAME_PS / 4);
                step().await;
            }
        }
    }

    async fn sleep(&mut self) -> Result<(), Gone> {
        self.wait_us(3_000).await;
        self.core.borrow_mut().suspend();
        self.cable.configured.set(false);
        while self.cable.asleep.get() {
            self.is_there()?;
            step().await;
        }
        self.core.borrow_mut().resume();
        self.wait_us(2_000).await;
        self.cable.configured.set(true);
        Ok(())
    }

    fn give(&mut self) -> bool {
        let mut waiting = self.cable.to_device.borrow_mut();
        let length = waiting.len().min(512);
        let packet: Vec<u8> = waiting.iter().take(length).copied().collect();
        match self.core.borrow_mut().send(self.address, 1, &packet, self.toggles[1]) {
            Answer::Data(..) => {
                waiting.drain(..length);
                self.toggles[1] ^= 1;
                true
            }
            _ => false,
        }
    }

    fn take(&mut self) -> Result<bool, Gone> {
        let fetched = self.core.borrow_mut().fetch(self.address, 1, true);
        match fetched {
            Answer::Data(bytes, toggle) => {
                if toggle == self.toggles[0] {
                    self.toggles[0] ^= 1;
                    self.cable.from_device.borrow_mut().extend(bytes);
                } else {
                    self.complain("a packet with the wrong toggle".into());
                }
                self.cable.packets.set(self.cable.packets.get() + 1);
                Ok(true)
            }
            Answer::Nak => Ok(false),
            _ => Err(Gone),
        }
    }
}

/// Data, or `None` for a halt; nothing to retry.
fn told(answer: Answer) -> Option<Option<Vec<u8>>> {
    match answer {
        Answer::Data(bytes, _) => Some(Some(bytes)),
        Answer::Stall => Some(None),
        Answer::Nak | Answer::Silence => None,
    }
}

//! Between the camera and the task that serves the host: commands in, packets out.
//!
//! The one law: the link holds whole packets. When all its places are taken the camera is refused one, drops that
//! frame and counts it; nothing waits in the camera for a slow host, and nothing is cut.

use embassy_futures::select::{Either, select};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::pipe::{self, Pipe};
use embassy_sync::signal::Signal;
use embassy_sync::zerocopy_channel::{self, Channel};
use embassy_time::{Duration, Timer};
use nirspi_mcu::{Merger, PacketSink};
use nirspi_wire::packet::{MAX_DEVICE_PACKET, MAX_HOST_PACKET};

/// Place for one packet on its way to the host.
#[derive(Debug, Clone, Copy)]
pub struct Packet {
    bytes: [u8; MAX_DEVICE_PACKET],
    length: usize,
}

impl Packet {
    /// With nothing in it.
    pub const EMPTY: Self = Self { bytes: [0; MAX_DEVICE_PACKET], length: 0 };

    fn after(&self, offset: usize) -> &[u8] {
        self.bytes.get(offset..self.length).unwrap_or(&[])
    }
}

/// The link's memory.
pub struct Link<'m> {
    commands: Pipe<NoopRawMutex, MAX_HOST_PACKET>,
    packets: Channel<'m, NoopRawMutex, Packet>,
    hangup: Hangup,
}

/// The host's side says that it is gone; the camera says that it has cleared up.
struct Hangup {
    gone: Signal<NoopRawMutex, ()>,
    cleared: Signal<NoopRawMutex, ()>,
}

impl Hangup {
    /// Waits for the end of the session, and leaves it to be [taken](CameraEnd::has_gone).
    async fn noticed(&self) {
        self.gone.wait().await;
        self.gone.signal(());
    }
}

impl<'m> Link<'m> {
    /// With as many packets on their way at once as there are places.
    #[must_use]
    pub fn new(places: &'m mut [Packet]) -> Self {
        let hangup = Hangup { gone: Signal::new(), cleared: Signal::new() };
        Self { commands: Pipe::new(), packets: Channel::new(places), hangup }
    }

    /// The camera's end, and the two ends of the task that serves the host.
    pub fn split<const N: usize>(&mut self) -> (CameraEnd<'_>, HostIn<'_>, HostOut<'_, N>) {
        let (commands, bytes) = self.commands.split();
        let (sender, packets) = self.packets.split();
        let hangup = &self.hangup;
        (
            CameraEnd { commands, sink: Sink { sender }, hangup },
            HostIn { bytes, hangup },
            HostOut { packets, sent: 0, merger: Merger::new() },
        )
    }
}

/// Where bytes from the host go in.
pub struct HostIn<'l> {
    bytes: pipe::Writer<'l, NoopRawMutex, MAX_HOST_PACKET>,
    hangup: &'l Hangup,
}

impl HostIn<'_> {
    /// Hands over bytes from the host, and waits while there is no room: a host that asks faster than it is
    /// answered is slowed down.
    pub async fn received(&mut self, bytes: &[u8]) {
        let mut rest = bytes;
        while !rest.is_empty() {
            let taken = self.bytes.write(rest).await;
            rest = rest.get(taken..).unwrap_or(&[]);
        }
    }

    /// The host is gone. When this returns the camera has ended its session, the LEDs are off, and nothing that was
    /// under way in either direction is left, but for what [`HostOut::discard`] has to forget.
    pub async fn closed(&mut self) {
        self.hangup.cleared.reset();
        self.hangup.gone.signal(());
        self.hangup.cleared.wait().await;
    }
}

/// Where bytes to the host come out, in transfers of `N` bytes.
pub struct HostOut<'l, const N: usize> {
    packets: zerocopy_channel::Receiver<'l, NoopRawMutex, Packet>,
    /// Bytes of the first packet that have gone into transfers.
    sent: usize,
    merger: Merger<N>,
}

impl<const N: usize> HostOut<'_, N> {
    /// Waits for something to send; a full transfer, or a short or empty one if nothing follows it now.
    pub async fn transfer(&mut self) -> &[u8] {
        if self.merger.is_done() {
            self.packets.receive().await;
        }
        while !self.merger.is_full()
            && let Some(packet) = self.packets.try_receive()
        {
            self.sent += self.merger.take(packet.after(self.sent));
            if self.sent >= packet.length {
                self.sent = 0;
                self.packets.receive_done();
            }
        }
        self.merger.transfer()
    }

    /// Forgets what is half sent, after [`HostIn::closed`].
    pub fn discard(&mut self) {
        self.packets.clear();
        self.sent = 0;
        self.merger = Merger::new();
    }
}

/// The camera's end.
pub struct CameraEnd<'l> {
    commands: pipe::Reader<'l, NoopRawMutex, MAX_HOST_PACKET>,
    sink: Sink<'l>,
    hangup: &'l Hangup,
}

impl<'l> CameraEnd<'l> {
    /// Bytes from the host that have not been taken.
    pub(crate) fn waiting(&mut self) -> &[u8] {
        self.commands.try_fill_buf().unwrap_or(&[])
    }

    pub(crate) fn taken(&mut self, length: usize) {
        if length > 0 {
            self.commands.consume(length);
        }
    }

    /// Those bytes, and where packets go.
    pub(crate) fn both(&mut self) -> (&[u8], &mut Sink<'l>) {
        (self.commands.try_fill_buf().unwrap_or(&[]), &mut self.sink)
    }

    /// Bytes from the host have come, or it has gone.
    pub(crate) async fn news(&mut self) {
        if !self.waiting().is_empty() {
            // They have been offered and not been taken: the camera has to go on first.
            return self.hangup.noticed().await;
        }
        select(self.hangup.noticed(), self.commands.fill_buf()).await;
    }

    /// Whether the host has gone since the last call. Then [`clear`](Self::clear) is to be called.
    pub(crate) fn has_gone(&self) -> bool {
        self.hangup.gone.try_take().is_some()
    }

    /// Forgets what came from the host that is gone.
    pub(crate) fn clear(&mut self) {
        while let length @ 1.. = self.waiting().len() {
            self.taken(length);
        }
        self.hangup.cleared.signal(());
    }

    /// Until all packets have been sent, for so long at most.
    pub(crate) async fn flush(&self, patience: Duration) {
        let sent = async {
            while !self.sink.sender.is_empty() {
                Timer::after_millis(1).await;
            }
        };
        match select(sent, Timer::after(patience)).await {
            Either::First(()) | Either::Second(()) => {}
        }
    }
}

/// Where the camera puts its packets.
pub struct Sink<'l> {
    sender: zerocopy_channel::Sender<'l, NoopRawMutex, Packet>,
}

impl PacketSink for Sink<'_> {
    fn claim(&mut self, length: usize) -> Option<&mut [u8]> {
        self.sender.try_send()?.bytes.get_mut(..length)
    }

    fn commit(&mut self, length: usize) {
        if let Some(packet) = self.sender.try_send() {
            packet.length = length;
            self.sender.send_done();
        }
    }
}

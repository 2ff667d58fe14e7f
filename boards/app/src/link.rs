//! The link between the camera and the task that serves the host: commands in, packets out.
//!
//! # Invariant
//! The link holds whole packets. When all places are taken, the link refuses the next packet, and
//! the camera drops that frame whole and counts it
//! (`tests::frames_come_in_order_and_a_full_link_drops_whole_ones`). So a slow host never blocks
//! the camera.

use core::ops::Range;
use embassy_futures::select::{Either, select};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::pipe::{self, Pipe};
use embassy_sync::signal::Signal;
use embassy_sync::zerocopy_channel::{self, Channel};
use embassy_time::{Duration, Timer};
#[cfg(any(test, feature = "ring"))]
use nirspi_mcu::Loan;
use nirspi_mcu::{Merger, PacketSink};
use nirspi_wire::packet::{MAX_DEVICE_PACKET, MAX_HOST_PACKET};
use nirspi_wire::ready::MAX_READ_BYTES;

/// Bytes of a place: the longest packet of the firmware, or a read of the longest packet that the FPGA makes.
const PLACE_BYTES: usize =
    if MAX_READ_BYTES > MAX_DEVICE_PACKET { MAX_READ_BYTES } else { MAX_DEVICE_PACKET };

/// Transfers that a packet has to fill before a short one is sent ahead of it, so that it need not be copied.
const LONG: usize = 4;

/// DMA begins to read at multiples of so many bytes.
const DMA_BYTES: usize = 4;

/// The smallest packet of a bulk endpoint: at full speed (USB 2.0, 5.8.3).
const USB_PACKET_BYTES: usize = 64;

/// A place for one packet on its way to the host, or for the loan of a ring, whose packets stay where they are.
#[derive(Debug, Clone)]
#[repr(C)]
pub struct Packet {
    start: usize,
    end: usize,
    #[cfg(any(test, feature = "ring"))]
    loan: Option<Loan>,
    /// At a multiple of [`DMA_BYTES`].
    bytes: [u8; PLACE_BYTES],
}

const _: () = assert!(core::mem::offset_of!(Packet, bytes).is_multiple_of(DMA_BYTES));
const _: () = assert!(align_of::<Packet>().is_multiple_of(DMA_BYTES));

impl Packet {
    /// A place without a packet.
    pub const EMPTY: Self = Self {
        start: 0,
        end: 0,
        #[cfg(any(test, feature = "ring"))]
        loan: None,
        bytes: [0; PLACE_BYTES],
    };

    /// The packet from a place on that DMA can reach: up to three zeros come before its bytes, which mean nothing
    /// between two packets. Of a loan, the bytes that lie together.
    fn whole(&mut self) -> &[u8] {
        #[cfg(any(test, feature = "ring"))]
        if let Some(loan) = &self.loan {
            return lent(loan);
        }
        let begin = self.start - self.start % DMA_BYTES;
        if let Some(gap) = self.bytes.get_mut(begin..self.start) {
            gap.fill(0);
        }
        self.bytes.get(begin..self.end).unwrap_or(&[])
    }

    /// Notes that so many bytes have been sent, all that [`whole`](Self::whole) gave; true if nothing is left.
    fn sent(&mut self, _bytes: usize) -> bool {
        #[cfg(any(test, feature = "ring"))]
        if let Some(loan) = &mut self.loan {
            loan.sent(_bytes);
            if !loan.is_over() {
                return false;
            }
            self.loan = None;
        }
        true
    }

    fn after(&self, offset: usize) -> &[u8] {
        self.bytes.get(self.start..self.end).and_then(|bytes| bytes.get(offset..)).unwrap_or(&[])
    }
}

/// The bytes of a loan that are to be sent next.
#[cfg(any(test, feature = "ring"))]
fn lent(loan: &Loan) -> &[u8] {
    let (words, length) = loan.next();
    assert!(length <= size_of_val(words), "a loan lies in its ring");
    #[expect(unsafe_code, reason = "words that only a DMA channel writes, as bytes")]
    // SAFETY: these words are as long, and have no padding. Neither processor nor channel writes them until they are
    // given back, and the link gives them back after the last use of these bytes, which borrow the link. Only an FPGA
    // that does not wait (a broken wire) makes the channel write them before. The driver of USB passes their address on
    // and reads none of them, and the host finds by CRC-32 what has changed.
    unsafe {
        core::slice::from_raw_parts(words.as_ptr().cast(), length)
    }
}

/// The link's memory.
pub struct Link<'m> {
    commands: Pipe<NoopRawMutex, MAX_HOST_PACKET>,
    packets: Channel<'m, NoopRawMutex, Packet>,
    hangup: Hangup,
}

/// Two signals at the end of a session: the host has gone; the camera has ended the session.
struct Hangup {
    gone: Signal<NoopRawMutex, ()>,
    cleared: Signal<NoopRawMutex, ()>,
}

impl Hangup {
    /// Waits for the end of the session. [`CameraEnd::has_gone`] still reports it afterwards.
    async fn noticed(&self) {
        self.gone.wait().await;
        self.gone.signal(());
    }
}

impl<'m> Link<'m> {
    /// A link on which as many packets can wait as there are places.
    #[must_use]
    pub fn new(places: &'m mut [Packet]) -> Self {
        let hangup = Hangup { gone: Signal::new(), cleared: Signal::new() };
        Self { commands: Pipe::new(), packets: Channel::new(places), hangup }
    }

    /// Splits the link into the camera's end and the two ends of the task that serves the host.
    pub fn split<const N: usize>(&mut self) -> (CameraEnd<'_>, HostIn<'_>, HostOut<'_, N>) {
        let (commands, bytes) = self.commands.split();
        let (sender, packets) = self.packets.split();
        let hangup = &self.hangup;
        (
            CameraEnd { commands, sink: Sink { sender }, hangup },
            HostIn { bytes, hangup },
            HostOut { packets, sent: 0, lent: false, merger: Merger::new() },
        )
    }
}

/// The end that takes bytes from the host.
pub struct HostIn<'l> {
    bytes: pipe::Writer<'l, NoopRawMutex, MAX_HOST_PACKET>,
    hangup: &'l Hangup,
}

impl HostIn<'_> {
    /// Passes on bytes from the host. The call waits while there is no room, so a host that sends
    /// commands faster than the camera answers is slowed down.
    pub async fn received(&mut self, bytes: &[u8]) {
        let mut rest = bytes;
        while !rest.is_empty() {
            let taken = self.bytes.write(rest).await;
            rest = rest.get(taken..).unwrap_or(&[]);
        }
    }

    /// Ends the session of a host that has gone. When this returns, the camera has ended its
    /// session, the LEDs are off, and both directions are empty, except for bytes that
    /// [`HostOut::discard`] has to drop.
    pub async fn closed(&mut self) {
        self.hangup.cleared.reset();
        self.hangup.gone.signal(());
        self.hangup.cleared.wait().await;
    }
}

/// The end that gives bytes for the host, in transfers of `N` bytes.
pub struct HostOut<'l, const N: usize> {
    packets: zerocopy_channel::Receiver<'l, NoopRawMutex, Packet>,
    /// Bytes of the first packet that are already in transfers.
    sent: usize,
    /// The last transfer was `N` bytes of the first packet itself, or the whole of it.
    lent: bool,
    merger: Merger<N>,
}

impl<const N: usize> HostOut<'_, N> {
    /// Waits for bytes to send, and returns the next transfer. It is full, unless no more bytes wait or a long packet
    /// comes next: then it is shorter, or empty. A long packet is not copied; it is sent from where it lies.
    ///
    /// The bytes of the transfer before must have been sent. No loan may be on the link: [`packet`](Self::packet) sends
    /// these.
    pub async fn transfer(&mut self) -> &[u8] {
        let lent = if core::mem::take(&mut self.lent) { N } else { 0 };
        self.pass(lent);
        if self.merger.is_done() {
            self.packets.receive().await;
        }
        while !self.merger.is_full()
            && let Some(packet) = self.packets.try_receive()
        {
            let bytes = packet.after(self.sent);
            self.lent = bytes.len() >= N && self.merger.lets_pass();
            if self.lent || bytes.len() >= LONG * N {
                break;
            }
            let taken = self.merger.take(bytes);
            self.pass(taken);
        }
        match self.packets.try_receive() {
            Some(packet) if self.lent => packet.after(self.sent).get(..N).unwrap_or(&[]),
            _ => self.merger.transfer(),
        }
    }

    /// Waits for a packet to send, whole and where it lies, from a multiple of four bytes on; or for packets of a ring,
    /// as many as were lent together, in two pieces where the ring's memory ends. An empty transfer comes
    /// instead where the packet before has filled its last USB packet and no other packet follows: a read of the host
    /// ends with a USB packet that is not full.
    ///
    /// The bytes that were returned before must have been sent. Of one link either this or
    /// [`transfer`](Self::transfer) is called.
    pub async fn packet(&mut self) -> &[u8] {
        let sent = core::mem::take(&mut self.sent);
        if core::mem::take(&mut self.lent) {
            if self.packets.try_receive().is_none_or(|packet| packet.sent(sent)) {
                self.packets.receive_done();
            }
            if sent.is_multiple_of(USB_PACKET_BYTES) && self.packets.try_receive().is_none() {
                return &[];
            }
        }
        let bytes = self.packets.receive().await.whole();
        self.lent = true;
        self.sent = bytes.len();
        bytes
    }

    /// Counts bytes of the first packet that went into transfers, and frees its place after the last of them.
    fn pass(&mut self, bytes: usize) {
        self.sent += bytes;
        if let Some(packet) = self.packets.try_receive()
            && packet.after(self.sent).is_empty()
        {
            self.sent = 0;
            self.packets.receive_done();
        }
    }

    /// Drops a half-sent packet, after [`HostIn::closed`], and gives back what a ring has lent.
    pub fn discard(&mut self) {
        #[cfg(any(test, feature = "ring"))]
        while let Some(packet) = self.packets.try_receive() {
            if let Some(mut loan) = packet.loan.take() {
                loan.give_back();
            }
            self.packets.receive_done();
        }
        self.packets.clear();
        self.sent = 0;
        self.lent = false;
        self.merger = Merger::new();
    }
}

/// The camera's end of the link.
pub struct CameraEnd<'l> {
    commands: pipe::Reader<'l, NoopRawMutex, MAX_HOST_PACKET>,
    sink: Sink<'l>,
    hangup: &'l Hangup,
}

impl<'l> CameraEnd<'l> {
    /// Bytes from the host that the camera has not taken.
    pub(crate) fn waiting(&mut self) -> &[u8] {
        self.commands.try_fill_buf().unwrap_or(&[])
    }

    pub(crate) fn taken(&mut self, length: usize) {
        if length > 0 {
            self.commands.consume(length);
        }
    }

    /// Bytes from the host, and the place where packets go.
    pub fn both(&mut self) -> (&[u8], &mut Sink<'l>) {
        (self.commands.try_fill_buf().unwrap_or(&[]), &mut self.sink)
    }

    /// Waits for new bytes from the host, or for the end of the session.
    pub(crate) async fn news(&mut self) {
        if !self.waiting().is_empty() {
            // The camera did not take the bytes offered, so it has other work to do first.
            return self.hangup.noticed().await;
        }
        select(self.hangup.noticed(), self.commands.fill_buf()).await;
    }

    /// Whether the host has gone since the last call. The caller must then call
    /// [`clear`](Self::clear).
    pub(crate) fn has_gone(&self) -> bool {
        self.hangup.gone.try_take().is_some()
    }

    /// Drops the bytes of a host that has gone.
    pub(crate) fn clear(&mut self) {
        while let length @ 1.. = self.waiting().len() {
            self.taken(length);
        }
        self.hangup.cleared.signal(());
    }

    /// Waits until all packets have been sent, for at most this long.
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

/// The place where the camera puts its packets.
pub struct Sink<'l> {
    sender: zerocopy_channel::Sender<'l, NoopRawMutex, Packet>,
}

impl PacketSink for Sink<'_> {
    fn claim(&mut self, length: usize) -> Option<&mut [u8]> {
        self.sender.try_send()?.bytes.get_mut(..length)
    }

    fn commit(&mut self, part: Range<usize>) {
        if let Some(packet) = self.sender.try_send() {
            (packet.start, packet.end) = (part.start, part.end);
            self.sender.send_done();
        }
    }

    #[cfg(any(test, feature = "ring"))]
    fn lend(&mut self, loan: Loan) -> bool {
        let Some(packet) = self.sender.try_send() else { return false };
        packet.loan = Some(loan);
        self.sender.send_done();
        true
    }
}

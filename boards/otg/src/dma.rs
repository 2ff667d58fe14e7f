//! The core's own DMA ([`Config::dma`]). Not in the release.
//!
//! With DMA every endpoint goes by DMA, the control endpoint too, and the processor touches neither FIFOs nor `GRXSTSP`.
//! Sources: ST RM0456 (OTG_HS, "DMA mode"), ST's HAL, and the drivers of TinyUSB and Zephyr, which name what a core from
//! version 3.00a on does beyond the manual (the STM32U5A5 has 4.11a). **Never run on silicon.**
//!
//! # Invariant
//! - The core reads the memory of a transfer only while the future of its `write` lives ([`Armed`]).
//! - The control endpoint can always take a request: its OUT side is armed at each reset, and again by the interrupt
//!   that finds it no longer armed. So the words of the control endpoint have places of their own.

use core::future::poll_fn;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering, fence};
use core::task::Poll;

use embassy_usb_driver::{Direction, EndpointError, EndpointType};

use crate::otg_v1::{Otg, RW, Reg, regs};
use crate::{Config, EP_OUT_BUFFER_EMPTY, EpState, State, repair};

/// Largest packet of the control endpoint, and the room for what comes to it: a packet, or up to three requests.
const CONTROL_BYTES: usize = 64;
/// Packets of a transfer: `PKTCNT` has ten bits.
const MOST_PACKETS: usize = 1023;

/// `GAHBCFG.HBSTLEN`: bursts of four words, as ST's HAL and TinyUSB have it.
const BURSTS_OF_4: u8 = 3;
/// `DOEPINT` and `DOEPMSK`: the status stage has come. Zephyr: while this flag stands, no further request is reported.
const STATUS_PHASE: u32 = 1 << 5;
/// `DOEPINT`: what came is a request.
const IS_REQUEST: u32 = 1 << 15;
/// `GINTSTS`: no OUT endpoint takes anything any more.
const GLOBAL_OUT_NAK: u32 = 1 << 7;

/// Where `DIEPDMA` of endpoint 0 lies, and from there that of each next endpoint.
const DIEPDMA: usize = 0x914;
const DIEPDMA_STEP: usize = 0x20;

/// Words at the end of the FIFO memory in which the DMA keeps its addresses, for each endpoint number: 1024 words less
/// the `GHWCFG3.DFIFODEPTH` of 952 that TinyUSB has read from an STM32U5A5, with nine endpoint numbers.
const RESERVED_WORDS_PER_ENDPOINT: u16 = 8;

/// What the driver has for DMA beside the state of the endpoints.
pub(crate) struct Dma {
    is_on: AtomicBool,
    /// Where the core writes what comes to the control endpoint.
    from_host: [AtomicU32; CONTROL_BYTES / 4],
    /// What goes out by the control endpoint, which the caller has anywhere, in flash memory too.
    to_host: [AtomicU32; CONTROL_BYTES / 4],
}

/// Enables DMA.
pub(crate) fn enable(w: &mut regs::Gahbcfg) {
    w.set_hbstlen(BURSTS_OF_4);
    w.set_dmaen(true);
}

/// Unmasks what reports the end of an OUT transfer, which without DMA the receive FIFO does.
pub(crate) fn unmask_out(w: &mut regs::Doepmsk) {
    w.set_xfrcm(true);
    w.0 |= STATUS_PHASE;
}

/// Whether this driver can serve such an endpoint by DMA, with a buffer that begins here.
pub(crate) fn can_serve(ep_type: EndpointType, buffer: &[u8]) -> bool {
    ep_type != EndpointType::Isochronous && buffer.as_ptr().addr() % 4 == 0
}

/// With DMA a bulk endpoint has room for two packets, so that the core fetches the next while it sends one.
pub(crate) fn fifo_words(config: &Config, dir: Direction, ep_type: EndpointType, words: u16) -> u16 {
    let has_two = config.dma && dir == Direction::In && ep_type == EndpointType::Bulk;
    if has_two { 2 * words } else { words }
}

/// Words of the FIFO memory that belong to the DMA.
pub(crate) fn reserved_words(config: &Config, endpoint_count: usize) -> u16 {
    if config.dma {
        RESERVED_WORDS_PER_ENDPOINT * endpoint_count as u16
    } else {
        0
    }
}

/// The address at which the core finds this memory for as long as the driver lives.
fn address_of<T>(memory: *const T, _bytes: usize) -> u32 {
    #[cfg(not(target_os = "none"))]
    return crate::simulated::lend(memory.cast(), _bytes, true);
    #[cfg(target_os = "none")]
    return memory.addr() as u32;
}

impl Dma {
    pub(crate) const fn new() -> Self {
        Self {
            is_on: AtomicBool::new(false),
            from_host: [const { AtomicU32::new(0) }; CONTROL_BYTES / 4],
            to_host: [const { AtomicU32::new(0) }; CONTROL_BYTES / 4],
        }
    }

    pub(crate) fn turn(&self, on: bool) {
        self.is_on.store(on, Ordering::Relaxed);
    }

    #[inline(always)]
    pub(crate) fn is_on(&self) -> bool {
        self.is_on.load(Ordering::Relaxed)
    }

    /// Lets the control endpoint take the next request. Data are taken after `CNAK` only, which the core takes back with
    /// each request.
    pub(crate) fn listen(&self, r: Otg) {
        if r.doepctl(0).read().epena() {
            return;
        }
        r.doeptsiz(0).write(|w| {
            w.set_rxdpid_stupcnt(3);
            w.set_pktcnt(1);
            w.set_xfrsiz(CONTROL_BYTES as _);
        });
        r.doepdma(0)
            .write_value(address_of(self.from_host.as_ptr(), CONTROL_BYTES));
        fence(Ordering::SeqCst);
        r.doepctl(0).modify(|w| w.set_epena(true));
    }

    /// What has come to the control endpoint.
    fn control_came<const EP_COUNT: usize>(&self, r: Otg, state: &State<EP_COUNT>, came: regs::Doepint) {
        fence(Ordering::SeqCst);
        if came.stup() {
            // The last of up to three requests lies before the address at which the core would go on.
            let begin = address_of(self.from_host.as_ptr(), CONTROL_BYTES);
            let words = r.doepdma(0).read().wrapping_sub(begin) as usize / 4;
            let request = words.checked_sub(2).and_then(|first| self.from_host.get(first..words));
            if let Some(request) = request {
                for (to, word) in state.cp_state.setup_data.iter().zip(request) {
                    to.store(word.load(Ordering::Relaxed), Ordering::Relaxed);
                }
                state.cp_state.setup_ready.store(true, Ordering::Release);
                state.ep_states[0].in_waker.wake();
            }
            self.listen(r);
        } else if came.xfrc() && came.0 & IS_REQUEST == 0 {
            let left = r.doeptsiz(0).read().xfrsiz() as usize;
            let bytes = CONTROL_BYTES.saturating_sub(left);
            let ep = &state.ep_states[0];
            if ep.out_size.load(Ordering::Acquire) == EP_OUT_BUFFER_EMPTY {
                // SAFETY: the buffer has a control packet's size, and belongs to the interrupt while `out_size` says so.
                let buffer = unsafe { core::slice::from_raw_parts_mut(*ep.out_buffer.get(), bytes) };
                for (to, word) in buffer.chunks_mut(4).zip(&self.from_host) {
                    to.copy_from_slice(&word.load(Ordering::Relaxed).to_ne_bytes()[..to.len()]);
                }
                ep.out_size.store(bytes as u16, Ordering::Release);
            }
            self.listen(r);
        }
    }

    /// `EndpointIn::write`. Of the control endpoint the bytes are copied; of another endpoint the core reads them where
    /// they lie, until the returned future ends.
    pub(crate) async fn write(&self, r: Otg, index: usize, ep: &EpState, bytes: &[u8]) -> Result<(), EndpointError> {
        until_sent(r, index, ep).await?;
        if index == 0 {
            if bytes.len() > CONTROL_BYTES {
                return Err(EndpointError::BufferOverflow);
            }
            for (to, from) in self.to_host.iter().zip(bytes.chunks(4)) {
                let mut word = [0; 4];
                word[..from.len()].copy_from_slice(from);
                to.store(u32::from_ne_bytes(word), Ordering::Relaxed);
            }
            arm_in(r, 0, 1, address_of(self.to_host.as_ptr(), CONTROL_BYTES), bytes.len());
            return Ok(());
        }
        let packets = bytes
            .len()
            .div_ceil(ep.in_packet.load(Ordering::Relaxed).max(1).into())
            .max(1);
        let is_reached = bytes.is_empty() || bytes.as_ptr().addr() % 4 == 0;
        if packets > MOST_PACKETS || !is_reached {
            return Err(EndpointError::BufferOverflow);
        }
        let _armed = Armed::new(r, index, packets as u16, bytes);
        until_sent(r, index, ep).await
    }
}

/// Waits until nothing is armed.
async fn until_sent(r: Otg, index: usize, ep: &EpState) -> Result<(), EndpointError> {
    poll_fn(|cx| {
        ep.in_waker.register(cx.waker());
        let control = r.diepctl(index).read();
        if !control.usbaep() {
            Poll::Ready(Err(EndpointError::Disabled))
        } else if control.epena() {
            Poll::Pending
        } else {
            Poll::Ready(Ok(()))
        }
    })
    .await
}

/// `DIEPDMA`, where the core reads the transfer of an IN endpoint. The crate of the registers lacks it.
fn diepdma(r: Otg, index: usize) -> Reg<u32, RW> {
    let address = r.as_ptr().wrapping_byte_add(DIEPDMA + DIEPDMA_STEP * index);
    // SAFETY: the register of an endpoint that the driver has.
    unsafe { Reg::from_ptr(address.cast()) }
}

fn arm_in(r: Otg, index: usize, packets: u16, address: u32, bytes: usize) {
    critical_section::with(|_| {
        r.dieptsiz(index).write(|w| {
            w.set_pktcnt(packets);
            w.set_xfrsiz(bytes as _);
        });
        diepdma(r, index).write_value(address);
        // What the core reads was written before.
        fence(Ordering::SeqCst);
        r.diepctl(index).modify(|w| {
            w.set_cnak(true);
            w.set_epena(true);
        });
    });
}

/// A transfer whose memory the core reads. Dropped before its end, the transfer is taken back.
struct Armed<'b> {
    r: Otg,
    index: usize,
    _bytes: &'b [u8],
    #[cfg(not(target_os = "none"))]
    address: u32,
}

impl<'b> Armed<'b> {
    fn new(r: Otg, index: usize, packets: u16, bytes: &'b [u8]) -> Self {
        #[cfg(not(target_os = "none"))]
        let address = crate::simulated::lend(bytes.as_ptr(), bytes.len(), false);
        #[cfg(target_os = "none")]
        let address = bytes.as_ptr().addr() as u32;
        arm_in(r, index, packets, address, bytes.len());
        Self {
            r,
            index,
            _bytes: bytes,
            #[cfg(not(target_os = "none"))]
            address,
        }
    }
}

impl Drop for Armed<'_> {
    fn drop(&mut self) {
        if self.r.diepctl(self.index).read().epena() {
            repair::disarm_in(self.r, self.index);
        }
        #[cfg(not(target_os = "none"))]
        crate::simulated::take_back(self.address);
    }
}

/// Lets the core write the next packet into the endpoint's buffer.
fn arm_out(r: Otg, index: usize, ep: &EpState) {
    // SAFETY: the driver has set the pointer when the endpoint was made, and nothing else writes it.
    let buffer = unsafe { *ep.out_buffer.get() };
    let bytes = r.doepctl(index).read().mpsiz();
    r.doeptsiz(index).write(|w| {
        w.set_pktcnt(1);
        w.set_xfrsiz(bytes.into());
    });
    r.doepdma(index).write_value(address_of(buffer, bytes.into()));
    fence(Ordering::SeqCst);
    r.doepctl(index).modify(|w| {
        w.set_cnak(true);
        w.set_epena(true);
    });
}

/// Takes back what an OUT endpoint could receive ("OUT endpoint disable" in ST's reference manuals): no OUT endpoint
/// takes anything while one is disabled.
pub(crate) fn disarm_out(r: Otg, index: usize) {
    critical_section::with(|_| {
        if !r.doepctl(index).read().epena() {
            return;
        }
        r.dctl().modify(|w| w.set_sgonak(true));
        repair::wait(|| r.gintsts().read().0 & GLOBAL_OUT_NAK != 0);
        r.doepctl(index).modify(|w| {
            w.set_snak(true);
            w.set_epdis(true);
        });
        repair::wait(|| r.doepint(index).read().epdisd());
        r.doepint(index).write(|w| w.set_epdisd(true));
        r.dctl().modify(|w| w.set_cgonak(true));
    });
}

/// Enables an OUT endpoint of this type, or disables it. The control endpoint is always enabled.
pub(crate) fn set_out_enabled(r: Otg, index: usize, ep: &EpState, enabled: Option<EndpointType>) {
    if index != 0 {
        disarm_out(r, index);
        critical_section::with(|_| {
            r.doepctl(index).modify(|w| {
                w.set_usbaep(enabled.is_some());
                w.set_sd0pid_sevnfrm(enabled.is_some_and(repair::starts_with_data0));
            });
            if enabled.is_some() {
                // What came before this configuration belongs to the one before.
                ep.out_size.store(EP_OUT_BUFFER_EMPTY, Ordering::Release);
                arm_out(r, index, ep);
            }
        });
    }
    // Wakes `Endpoint::wait_enabled()`.
    ep.out_waker.wake();
}

/// `EndpointOut::read`.
pub(crate) async fn read(r: Otg, index: usize, ep: &EpState, into: &mut [u8]) -> Result<usize, EndpointError> {
    poll_fn(|cx| {
        ep.out_waker.register(cx.waker());
        if !r.doepctl(index).read().usbaep() {
            return Poll::Ready(Err(EndpointError::Disabled));
        }
        let bytes = ep.out_size.load(Ordering::Acquire);
        if bytes == EP_OUT_BUFFER_EMPTY {
            if index == 0 {
                clear_control_nak(r);
            }
            return Poll::Pending;
        }
        let Some(into) = into.get_mut(..bytes.into()) else {
            return Poll::Ready(Err(EndpointError::BufferOverflow));
        };
        // SAFETY: exclusive access ensured by `out_size`: neither interrupt nor core writes to a buffer that is full.
        into.copy_from_slice(unsafe { core::slice::from_raw_parts(*ep.out_buffer.get(), bytes.into()) });
        critical_section::with(|_| {
            ep.out_size.store(EP_OUT_BUFFER_EMPTY, Ordering::Release);
            if index != 0 {
                arm_out(r, index, ep);
            }
        });
        Poll::Ready(Ok(bytes.into()))
    })
    .await
}

/// Lets the control endpoint take data, if the request has a stage with data. Zephyr: after a request without one, a core
/// whose NAK was cleared may take the data of the next request for those of this one, and stop for good.
pub(crate) fn expect_data(r: Otg, request: &[u8; 8]) {
    if request[6..] != [0, 0] {
        clear_control_nak(r);
    }
}

fn clear_control_nak(r: Otg) {
    critical_section::with(|_| {
        r.doepctl(0).modify(|w| {
            w.set_cnak(true);
            // A written 0 leaves EPENA, which the core may have cleared since it was read.
            w.set_epena(false);
        });
    });
}

/// Takes the first endpoint out of those that have something to say.
fn next<'s, const EP_COUNT: usize>(due: &mut u16, state: &'s State<EP_COUNT>) -> Option<(usize, &'s EpState)> {
    let index = due.trailing_zeros() as usize;
    let ep = state.ep_states.get(index)?;
    *due &= *due - 1;
    Some((index, ep))
}

/// The interrupt.
pub(crate) fn on_interrupt<const EP_COUNT: usize>(r: Otg, state: &State<EP_COUNT>) {
    let ints = r.gintsts().read();
    if ints.wkupint() || ints.usbsusp() || ints.usbrst() || ints.enumdne() || ints.otgint() || ints.srqint() {
        // `Bus` handles these, and unmasks them again.
        r.gintmsk().write(|w| {
            w.set_iepint(true);
            w.set_oepint(true);
        });
        state.bus_waker.wake();
        // A control transfer that waits for the host has ended.
        state.ep_states[0].in_waker.wake();
        state.ep_states[0].out_waker.wake();
    }
    if ints.iepint() {
        let mut due = r.daint().read().iepint();
        while let Some((index, ep)) = next(&mut due, state) {
            let flags = r.diepint(index).read();
            r.diepint(index).write_value(flags);
            ep.in_waker.wake();
        }
    }
    if ints.oepint() {
        let mut due = r.daint().read().oepint();
        while let Some((index, ep)) = next(&mut due, state) {
            let mut flags = r.doepint(index).read();
            if !flags.xfrc() && !flags.stup() {
                // The flag belongs to the end of the transfer, which the core has not reported yet.
                flags.0 &= !IS_REQUEST;
            }
            r.doepint(index).write_value(flags);
            if index == 0 {
                state.dma.control_came(r, state, flags);
            } else if flags.xfrc() {
                fence(Ordering::SeqCst);
                let left = r.doeptsiz(index).read().xfrsiz() as u16;
                let bytes = r.doepctl(index).read().mpsiz().saturating_sub(left);
                ep.out_size.store(bytes, Ordering::Release);
            }
            ep.out_waker.wake();
        }
    }
}

//! What the fork adds to the release. README.md says why.

use core::future::poll_fn;
use core::sync::atomic::Ordering;
use core::task::Poll;

use embassy_usb_driver::{EndpointError, EndpointType};

use crate::fmt::error;
use crate::otg_v1::{Otg, vals};
use crate::{ControlPipeSetupState, EP_OUT_BUFFER_EMPTY, EndpointData, State};

/// Whether the repairs are in force: always, except in a test that shows what the release does.
#[inline(always)]
pub(crate) fn in_force() -> bool {
    #[cfg(not(target_os = "none"))]
    return !crate::simulated::as_released();
    #[cfg(target_os = "none")]
    true
}

/// The most reads of a register until the core must have answered: at least 0.1 ms on the chips that we know of, the
/// time that Linux' dwc2 driver gives the core.
const PATIENCE_READS: u32 = 10_000;

pub(crate) fn wait(mut is_done: impl FnMut() -> bool) {
    if !(0..PATIENCE_READS).any(|_| is_done()) {
        error!("the USB core does not answer");
    }
}

/// Takes back what an IN endpoint has to send: NAK, disable, empty the FIFO ("IN endpoint disable" in ST's reference
/// manuals). `EPENA` is cleared by the core alone: a written 0 does not clear the bit, nor does a reset of the bus.
pub(crate) fn disarm_in(r: Otg, index: usize) {
    // The interrupt clears the flags of DIEPINT.
    critical_section::with(|_| {
        if r.diepctl(index).read().epena() {
            r.diepctl(index).modify(|w| w.set_snak(true));
            wait(|| r.diepint(index).read().inepne());
            r.diepctl(index).modify(|w| {
                w.set_snak(true);
                w.set_epdis(true);
            });
            wait(|| r.diepint(index).read().epdisd());
            r.diepint(index).write(|w| w.set_epdisd(true));
        }
        // A FIFO is not emptied while the core's DMA may still write to it.
        wait(|| r.grstctl().read().ahbidl());
        r.grstctl().write(|w| {
            w.set_txfflsh(true);
            w.set_txfnum(index as _);
        });
        wait(|| !r.grstctl().read().txfflsh());
    });
}

/// Begins an endpoint's data toggle with DATA0, as the host does with each configuration and each cleared halt (USB
/// 2.0, 9.1.1.5 and 9.4.5).
pub(crate) fn starts_with_data0(ep_type: EndpointType) -> bool {
    in_force() && matches!(ep_type, EndpointType::Bulk | EndpointType::Interrupt)
}

/// Forgets what came before the bus was reset, and wakes all that waits for an endpoint.
pub(crate) fn forget<const EP_COUNT: usize>(state: &State<EP_COUNT>) {
    critical_section::with(|_| {
        state.cp_state.setup_ready.store(false, Ordering::Release);
        for ep in &state.ep_states {
            ep.out_size.store(EP_OUT_BUFFER_EMPTY, Ordering::Release);
        }
    });
    for ep in &state.ep_states {
        ep.in_waker.wake();
        ep.out_waker.wake();
    }
}

/// Largest packet of an endpoint at this speed: a full-speed bus allows 64 bytes in a bulk packet (USB 2.0, 5.8.3).
fn packet_bytes(ep: &EndpointData, speed: vals::Dspd) -> u16 {
    let is_slow = speed != vals::Dspd::HIGH_SPEED;
    if is_slow && ep.ep_type == EndpointType::Bulk {
        ep.max_packet_size.min(64)
    } else {
        ep.max_packet_size
    }
}

/// Sets the packet sizes of all endpoints but the first for the speed that the host and the core have agreed on.
pub(crate) fn fit_packets<const EP_COUNT: usize>(
    r: Otg,
    state: &State<EP_COUNT>,
    ep_in: &[Option<EndpointData>],
    ep_out: &[Option<EndpointData>],
    speed: vals::Dspd,
) {
    critical_section::with(|_| {
        for (index, ep) in ep_in.iter().enumerate().skip(1) {
            if let Some(ep) = ep {
                let bytes = packet_bytes(ep, speed);
                r.diepctl(index).modify(|w| w.set_mpsiz(bytes));
                state.ep_states[index].in_packet.store(bytes, Ordering::Relaxed);
            }
        }
        for (index, ep) in ep_out.iter().enumerate().skip(1) {
            if let Some(ep) = ep {
                r.doepctl(index).modify(|w| w.set_mpsiz(packet_bytes(ep, speed)));
            }
        }
    });
}

/// Waits for a stage of a control transfer, until the host ends the transfer by the next request, a reset or a suspend.
/// embassy-usb handles events of the bus only between control transfers, so a stage that waited for ever would hide them.
pub(crate) async fn stage<T>(
    r: Otg,
    setup: &ControlPipeSetupState,
    stage: impl Future<Output = Result<T, EndpointError>>,
) -> Result<T, EndpointError> {
    let is_over = || {
        let ints = r.gintsts().read();
        ints.usbrst() || ints.usbsusp() || setup.setup_ready.load(Ordering::Acquire)
    };
    let mut stage = core::pin::pin!(stage);
    poll_fn(|cx| match stage.as_mut().poll(cx) {
        Poll::Pending if in_force() && is_over() => Poll::Ready(Err(EndpointError::Disabled)),
        polled => polled,
    })
    .await
}

//! Sessions: one host after the other, and what happens to a host that stops reading.

use crate::{Endpoints, PACKET_BYTES};
use embassy_futures::select::{Either, Either3, select, select3};
use embassy_time::{Instant, Timer};
use embassy_usb::driver::{Driver, EndpointIn, EndpointOut};
use embassy_usb_synopsys_otg::In;
use nirspi_app::link::{HostIn, HostOut};
use nirspi_mcu::{Micros, Patience, Remedy};

/// Time that a host gets once the patience is over. A whole packet is nearly always under way, also when
/// the camera's clock jumps ahead.
const MOMENT: embassy_time::Duration = embassy_time::Duration::from_millis(20);

/// An endpoint to the host, beyond what embassy-usb asks of one.
pub trait ToHost: EndpointIn {
    /// Takes back what the host has not fetched.
    fn abort(&mut self);

    /// Whether a `write` takes a packet of the wire protocol whole, out of memory at a multiple of four
    /// bytes, and ends when the host has fetched it. Otherwise a `write` copies at most [`PACKET_BYTES`],
    /// and ends when the host has fetched the ones before.
    fn takes_whole(&self) -> bool;
}

impl ToHost for embassy_usb_synopsys_otg::Endpoint<'_, In> {
    fn abort(&mut self) {
        Self::abort(self);
    }

    fn takes_whole(&self) -> bool {
        self.uses_dma()
    }
}

/// Serves one host after the other.
pub async fn serve<D>(
    endpoints: Endpoints<D>,
    mut commands: HostIn<'_>,
    mut packets: HostOut<'_, PACKET_BYTES>,
) -> !
where
    D: Driver<'static>,
    D::EndpointIn: ToHost,
{
    let Endpoints { mut from_host, mut to_host, presence } = endpoints;
    let mut patience = Patience::new();
    let mut session = None;
    loop {
        while session.is_none() {
            session = presence.session.wait().await;
        }
        // The core may have been asleep when the session before ended.
        to_host.abort();
        patience.session_begins();
        let talk = async {
            if to_host.takes_whole() {
                talk_whole(&mut to_host, &mut packets, &mut patience).await
            } else {
                talk(&mut to_host, &mut packets, &mut patience).await
            }
        };
        let listen = listen(&mut from_host, &mut commands);
        let news = select3(listen, talk, presence.session.wait());
        session = match news.await {
            Either3::Third(next) => next,
            Either3::Second(Some(Remedy::EndSession)) => session,
            Either3::Second(Some(Remedy::LeaveBus)) => {
                presence.leave.signal(());
                None
            }
            // The endpoint is gone: the host has gone, or is about to.
            Either3::First(()) | Either3::Second(None) => None,
        };
        commands.closed().await;
        to_host.abort();
        packets.discard();
    }
}

/// Returns when the endpoint is disabled.
async fn listen(endpoint: &mut impl EndpointOut, commands: &mut HostIn<'_>) {
    let mut bytes = [0; PACKET_BYTES];
    endpoint.wait_enabled().await;
    while let Ok(length) = endpoint.read(&mut bytes).await {
        commands.received(bytes.get(..length).unwrap_or(&[])).await;
    }
}

/// Returns when the endpoint is disabled, or with a remedy when the host fetches nothing.
async fn talk(
    endpoint: &mut impl ToHost,
    packets: &mut HostOut<'_, PACKET_BYTES>,
    patience: &mut Patience,
) -> Option<Remedy> {
    endpoint.wait_enabled().await;
    loop {
        let bytes = packets.transfer().await;
        let Micros(due) = patience.begins(now());
        let due = Timer::at(Instant::from_micros(due));
        match select(endpoint.write(bytes), due).await {
            Either::First(Ok(())) => patience.ends(),
            Either::First(Err(_)) => return None,
            Either::Second(()) => return patience.judge(now()),
        }
    }
}

/// The same for an endpoint that takes packets whole.
async fn talk_whole(
    endpoint: &mut impl ToHost,
    packets: &mut HostOut<'_, PACKET_BYTES>,
    patience: &mut Patience,
) -> Option<Remedy> {
    endpoint.wait_enabled().await;
    loop {
        let bytes = packets.packet().await;
        let Micros(due) = patience.begins(now());
        let due = Instant::from_micros(due);
        let mut write = core::pin::pin!(endpoint.write(bytes));
        let mut written = select(write.as_mut(), Timer::at(due)).await;
        if let Either::Second(()) = written {
            written = select(write.as_mut(), Timer::after(MOMENT)).await;
        }
        match written {
            Either::First(Ok(())) => patience.fetched(),
            Either::First(Err(_)) => return None,
            Either::Second(()) => return patience.judge(now()),
        }
    }
}

fn now() -> Micros {
    Micros(Instant::now().as_micros())
}

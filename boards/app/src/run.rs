//! The camera's loop.
//!
//! One turn of the loop takes at most a millisecond, or the transfer of the longest frame. A packet of
//! the FPGA goes straight into the link's memory. While the loop waits, the tasks that serve the host
//! run.

use crate::link::CameraEnd;
use crate::{Board, DEPTH_SIDE, DepthMap, DepthSensor, FpgaPort};
use core::future::pending;
use embassy_futures::select::select3;
use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Instant, Timer};
use nirspi_mcu::{
    BoardInfo, Camera, Crash, FpgaBus, GatewareLoader, Limits, Micros, PacketSink, PortBus, Ports,
    Target, Wanted,
};
use nirspi_wire::fpga::MAX_FRAME_BYTES;
use nirspi_wire::{State, Version};

/// The longest sleep, and so the longest time between two checks of the safety rules.
const TICK: Duration = Duration::from_millis(1);

/// Longest time for the reply that promises a restart to reach the host.
const FAREWELL: Duration = Duration::from_millis(100);

/// Mailbox from [`measure_depth`] to [`run`]; it holds the newest depth map only.
pub type DepthMailbox = Signal<NoopRawMutex, DepthMap>;

/// Everything that makes a board a camera.
pub struct Device<'b, B, P, G> {
    /// Pins and sensors.
    pub board: B,
    /// The FPGA.
    pub port: P,
    /// Memory for one frame, where the port's DMA can reach it.
    pub frame: &'b mut [u8; MAX_FRAME_BYTES],
    /// The destination of bitstreams.
    pub loader: G,
    /// Identity of the device, from [`board_info`].
    pub info: BoardInfo,
    /// Limits that protect people and LEDs.
    pub limits: Limits,
    /// The crash that ended the last start, from [`crash::take`](crate::crash::take).
    pub crash: Option<Crash>,
    /// Restarts since power-up that no host asked for.
    pub restarts: u32,
}

/// Identity of a board, by the name of its folder, with this firmware's version.
#[must_use]
pub fn board_info(board: &str, serial: &str) -> BoardInfo {
    let part = |text: &str| text.parse().unwrap_or(0);
    let version = Version(
        part(env!("CARGO_PKG_VERSION_MAJOR")),
        part(env!("CARGO_PKG_VERSION_MINOR")),
        part(env!("CARGO_PKG_VERSION_PATCH")),
    );
    BoardInfo::new(board, serial, version)
}

/// Measures depth for ever, so that [`run`] never waits for the sensor.
pub async fn measure_depth(mut sensor: impl DepthSensor, mailbox: &DepthMailbox) -> ! {
    loop {
        match sensor.next().await {
            Some(map) => mailbox.signal(map),
            None => Timer::after_secs(1).await,
        }
    }
}

fn now() -> Micros {
    Micros(Instant::now().as_micros())
}

/// Runs the camera for ever.
pub async fn run<B: Board, P: FpgaPort, G: GatewareLoader>(
    device: Device<'_, B, P, G>,
    mut link: CameraEnd<'_>,
    depth: &DepthMailbox,
) -> ! {
    let Device { mut board, port, frame, mut loader, info, limits, crash, restarts } = device;
    let mut bus = PortBus::new(port, frame);
    let mut camera = Camera::new(info, limits);
    camera.restarted(restarts);
    if let Some(crash) = crash {
        camera.restarted_after(crash);
    }
    loop {
        board.feed_watchdog();
        if loader.step(now()) {
            board.enable_leds(false);
            board.show(camera.lamps(now()));
            yield_now().await;
            continue;
        }
        let inputs = board.inputs();
        let has_gone = link.has_gone();
        let (bytes, sink) = link.both();
        let mut ports = Ports { bus: &mut bus, sink, loader: &mut loader };
        let taken = if has_gone {
            camera.link_closed(now(), &mut ports);
            0
        } else {
            camera.receive(now(), bytes, &inputs, &mut ports)
        };
        let progress = camera.poll(now(), &inputs, &mut ports);
        if let Some(map) = depth.try_take()
            && camera.state() == State::Running
        {
            camera.depth(now(), DEPTH_SIDE, &map, &mut ports);
        }
        board.enable_leds(camera.may_light());
        board.show(camera.lamps(now()));
        if has_gone {
            link.clear();
        }
        link.taken(taken);
        if let Some(into) = progress.reboot {
            link.flush(FAREWELL).await;
            board.restart(into);
        }
        match bus.wanted() {
            Some(Wanted { port, opcode, into }) => {
                let (_, sink) = link.both();
                let bytes = match into {
                    Target::Bus(bytes) => Some(bytes),
                    Target::Link(length) => sink.claim(length),
                };
                if let Some(bytes) = bytes {
                    let done = port.read_bytes(opcode, bytes).await;
                    bus.transferred(done);
                }
                camera.forward(now(), &mut Ports { bus: &mut bus, sink, loader: &mut loader });
            }
            None if progress.worked || taken > 0 => yield_now().await,
            None => rest(&mut bus, &mut link).await,
        }
    }
}

/// Sleeps until there may be work.
async fn rest<P: FpgaPort>(bus: &mut PortBus<'_, P>, link: &mut CameraEnd<'_>) {
    // A line that is high already has led to no work, so the loop waits for another event.
    let is_ready = bus.frame_ready() || bus.raw_ready();
    let ready = async { if is_ready { pending().await } else { bus.port().ready().await } };
    select3(link.news(), ready, Timer::after(TICK)).await;
}

#![cfg_attr(not(test), deny(clippy::disallowed_methods))]
#![doc = include_str!("../README.md")]
//!
//! The virtual camera is an optics simulator and the gateware's golden model, driven by the real
//! firmware logic, with the real wire protocol.
//!
//! ```text
//! scene -> projector -> LED lines <- gateware model <-> firmware logic <-> packets <-> host
//!              '-> light -> LED edges, amplifier, noise, ADC -^
//! ```
//!
//! # Invariant
//! The virtual camera takes no decision that belongs to the firmware or the gateware. Its time is
//! the ADC clock of the model, so a seed gives the same bytes on any machine, at any speed
//! (`the_same_seed_gives_the_same_bytes` in `tests/tests/end_to_end.rs`).

pub mod example;
mod fpga;
mod link;
mod look;
mod model;
mod optics;
mod panels;
mod precomputed;
mod server;
mod shot;
mod specular;
mod stages;
mod tunnel;
pub mod weather;

pub use fpga::{Front, OpticalFpga, SimulatedFpga, StuckEnable, Wiring};
pub use link::MemoryLink;
pub use look::{Bench, Calibrated, Look, LookError, Seen, SeenImage, SeenPicture};
pub use model::{CameraFileError, read_camera_model};
pub use nirspi_optics::CameraModel;
pub use optics::{VirtualOptics, VirtualOpticsError};
pub use panels::{Panels, SCENE_PX, Shown};
pub use precomputed::PrecomputedFpga;
pub use server::{ServeOptions, ServerEvent, serve};
pub use shot::{
    Shot, ShotError, calibrate_against_white, flat_field_against_white, shoot,
    white_level_at_target,
};
pub use specular::{SpecularSpot, SpecularSpotError};
pub use stages::{Stages, StagesError, StagesReport, enhance_stages};
pub use tunnel::serve_tunnel;

use nirspi_mcu::{
    BoardInfo, Camera, Crash, GatewareLoader, Inputs, Limits, Micros, NoLoader, PacketSink, Ports,
    Progress,
};
use nirspi_optics::SimulatedDepth;
use nirspi_wire::{Capabilities, Version};
use std::ops::Range;

/// Bytes waiting for the host at which the link counts as full: the capacity of a real device's USB
/// stack.
const PACKETS_BYTES: usize = 1 << 18;
/// Room that a frame claims: with the zeros around a packet of the FPGA.
const FRAME_BYTES: usize = nirspi_wire::ready::MAX_READ_BYTES;
/// Frames for which the memory of packets has room until it counts as full.
const SPARE_FRAMES: usize = 8;
const _: () = assert!(FRAME_BYTES >= nirspi_wire::packet::MAX_DEVICE_PACKET);
/// Device time between depth maps: 15 Hz, the rate of 8 x 8 time-of-flight sensors.
const DEPTH_PERIOD: Micros = Micros(66_667);
/// Zones along one edge of the depth map.
const DEPTH_SIDE: u8 = nirspi_optics::DEPTH_SIDE as u8;
const _: () = assert!(DEPTH_SIDE as usize == nirspi_optics::DEPTH_SIDE);
// The optics do not depend on the protocol, so each has the number of LEDs.
const _: () = assert!(nirspi_optics::SIDE == nirspi_wire::SIDE as usize);

/// Packets to send to the host.
#[derive(Debug, Default)]
pub struct PacketsOut {
    bytes: Vec<u8>,
    committed: usize,
    sent: usize,
}

impl PacketSink for PacketsOut {
    fn claim(&mut self, length: usize) -> Option<&mut [u8]> {
        if self.committed - self.sent + length > PACKETS_BYTES {
            return None;
        }
        let end = self.committed + length;
        if self.bytes.len() < end {
            self.bytes.resize(end, 0);
        }
        self.bytes.get_mut(self.committed..end)
    }

    fn commit(&mut self, part: Range<usize>) {
        let length = part.len();
        let part = self.committed + part.start..self.committed + part.end;
        self.bytes.copy_within(part, self.committed);
        self.committed += length;
    }
}

impl PacketsOut {
    /// The bytes that wait to be sent.
    #[must_use]
    pub fn waiting(&self) -> &[u8] {
        self.bytes.get(self.sent..self.committed).unwrap_or(&[])
    }

    /// Whether there is no room for 8 more frames.
    #[must_use]
    pub fn is_full(&self) -> bool {
        self.waiting().len() + SPARE_FRAMES * FRAME_BYTES > PACKETS_BYTES
    }

    /// Removes the first `length` waiting bytes, which were sent.
    pub fn sent(&mut self, length: usize) {
        self.sent += length;
        if self.sent >= self.committed {
            self.sent = 0;
            self.committed = 0;
        } else if self.sent > PACKETS_BYTES {
            self.bytes.copy_within(self.sent..self.committed, 0);
            self.committed -= self.sent;
            self.sent = 0;
        }
    }

    fn clear(&mut self) {
        self.sent = 0;
        self.committed = 0;
    }
}

/// Bytes that wait for the firmware, above which a link stops reading.
const INBOX_BYTES: usize = 1 << 16;

/// A camera without hardware. `F` simulates the FPGA and the optics, `G` receives bitstreams.
pub struct VirtualCamera<F, G = NoLoader> {
    camera: Camera,
    info: BoardInfo,
    limits: Limits,
    fpga: F,
    loader: G,
    inbox: Vec<u8>,
    packets: PacketsOut,
    depth: SimulatedDepth,
    next_depth: Micros,
    inputs: Inputs,
}

impl<F: SimulatedFpga> VirtualCamera<F> {
    /// Powers up.
    #[must_use]
    pub fn new(fpga: F, depth: SimulatedDepth, serial: &str) -> Self {
        Self::powered_up(fpga, NoLoader, depth, info(serial))
    }
}

/// The identity of a virtual camera. Its time-of-flight sensor is simulated.
fn info(serial: &str) -> BoardInfo {
    BoardInfo::new("virtual", serial, crate_version()).can(Capabilities::DEPTH)
}

impl<F: SimulatedFpga, G: GatewareLoader> VirtualCamera<F, G> {
    /// Powers up a board that can load gateware.
    #[must_use]
    pub fn with_loader(fpga: F, loader: G, depth: SimulatedDepth, serial: &str) -> Self {
        Self::powered_up(fpga, loader, depth, info(serial).can(Capabilities::LOAD_GATEWARE))
    }

    fn powered_up(fpga: F, loader: G, depth: SimulatedDepth, info: BoardInfo) -> Self {
        let limits = Limits::SIMULATED;
        Self {
            camera: Camera::new(info.clone(), limits),
            info,
            limits,
            fpga,
            loader,
            inbox: Vec::new(),
            packets: PacketsOut::default(),
            depth,
            next_depth: Micros(0),
            inputs: Inputs { interlock_closed: true, temperature_centi_celsius: Some(2500) },
        }
    }

    /// Whether the camera takes more bytes. A link stops reading while it does not, so that a host that
    /// sends and never reads takes no memory.
    #[must_use]
    pub fn takes_bytes(&self) -> bool {
        self.inbox.len() < INBOX_BYTES
    }

    /// Receives bytes from the host. Bytes that the firmware does not accept now are offered again
    /// at each step.
    pub fn receive(&mut self, bytes: &[u8]) {
        self.inbox.extend_from_slice(bytes);
        let now = self.now();
        let ports =
            &mut Ports { bus: &mut self.fpga, sink: &mut self.packets, loader: &mut self.loader };
        let taken = self.camera.receive(now, &self.inbox, &self.inputs, ports);
        self.inbox.drain(..taken);
        self.set_pin();
    }

    /// The board sets its LED enable as the firmware says.
    fn set_pin(&mut self) {
        self.fpga.set_board_enable(self.camera.may_light());
    }

    /// Advances the time by `clocks` ADC clocks, then polls the firmware once. Returns whether the
    /// firmware did anything.
    pub fn step(&mut self, clocks: u32) -> bool {
        self.fpga.advance(clocks);
        let now = self.now();
        if self.loader.step(now) {
            self.fpga.set_board_enable(false);
            return true;
        }
        let worked = self.turn(now);
        self.set_pin();
        worked
    }

    /// A turn of the firmware's loop.
    fn turn(&mut self, now: Micros) -> bool {
        let ports =
            &mut Ports { bus: &mut self.fpga, sink: &mut self.packets, loader: &mut self.loader };
        // Bytes are received before the poll, because the poll measures how long the host has been
        // silent.
        if !self.inbox.is_empty() {
            let taken = self.camera.receive(now, &self.inbox, &self.inputs, ports);
            self.inbox.drain(..taken);
        }
        let Progress { worked, reboot } = self.camera.poll(now, &self.inputs, ports);
        if reboot.is_some() {
            // The reply that promises the restart is among the packets already.
            self.camera = Camera::new(self.info.clone(), self.limits);
            self.inbox.clear();
            return true;
        }
        if now >= self.next_depth {
            self.next_depth = Micros(now.0 + DEPTH_PERIOD.0);
            if self.camera.state() == nirspi_wire::State::Running {
                self.camera.depth(now, DEPTH_SIDE, &self.depth.reading(), ports);
            }
        }
        worked
    }

    /// Packets to send to the host.
    pub fn packets_out(&mut self) -> &mut PacketsOut {
        &mut self.packets
    }

    /// Reports to the firmware that the link has closed.
    pub fn link_closed(&mut self) {
        let now = self.now();
        let ports =
            &mut Ports { bus: &mut self.fpga, sink: &mut self.packets, loader: &mut self.loader };
        self.camera.link_closed(now, ports);
        self.set_pin();
        self.inbox.clear();
        self.packets.clear();
    }

    /// The same camera after power-up with other limits: a test need not wait for five seconds of silence.
    #[must_use]
    pub fn with_limits(mut self, limits: Limits) -> Self {
        self.limits = limits;
        self.camera = Camera::new(self.info.clone(), limits);
        self.set_pin();
        self
    }

    /// The firmware crashes and restarts, and its link with it. The FPGA notices nothing.
    pub fn crash(&mut self, text: &str) {
        let crash = Crash::new(self.now(), format_args!("{text}"));
        self.power_up();
        self.camera.restarted_after(crash);
    }

    /// The firmware starts as after power-up, and its link with it. The FPGA notices nothing.
    pub fn power_up(&mut self) {
        self.camera = Camera::new(self.info.clone(), self.limits);
        self.set_pin();
        self.inbox.clear();
        self.packets.clear();
    }

    /// What the firmware says that the camera does.
    #[must_use]
    pub fn state(&self) -> nirspi_wire::State {
        self.camera.state()
    }

    /// The simulated FPGA, for faults of its own.
    pub fn fpga_mut(&mut self) -> &mut F {
        &mut self.fpga
    }

    /// Opens or closes the enclosure.
    pub fn set_interlock(&mut self, closed: bool) {
        self.inputs.interlock_closed = closed;
        self.fpga.set_interlock(closed);
    }

    /// Sets the temperature of the LED array; `None` unplugs its sensor.
    pub fn set_temperature(&mut self, centi_celsius: Option<i16>) {
        self.inputs.temperature_centi_celsius = centi_celsius;
    }

    /// The device's time.
    #[must_use]
    pub fn now(&self) -> Micros {
        Micros(self.fpga.clock() / u64::from(nirspi_wire::ADC_HZ / 1_000_000))
    }

    /// The simulated FPGA.
    #[must_use]
    pub fn fpga(&self) -> &F {
        &self.fpga
    }
}

fn crate_version() -> Version {
    let part = |text: &str| text.parse().unwrap_or(0);
    Version(
        part(env!("CARGO_PKG_VERSION_MAJOR")),
        part(env!("CARGO_PKG_VERSION_MINOR")),
        part(env!("CARGO_PKG_VERSION_PATCH")),
    )
}

#[cfg(test)]
mod tests {
    use nirspi_optics::instrument;
    use nirspi_wire::register::LATENCY_MAX;

    #[test]
    fn the_optics_have_the_instruments_numbers() {
        assert_eq!(instrument::LEDS, usize::from(nirspi_wire::PATTERNS));
        assert_eq!(instrument::WAVELENGTH_NM, f64::from(nirspi_wire::WAVELENGTH_NM));
        assert_eq!(instrument::SAMPLE_NS * f64::from(nirspi_wire::ADC_HZ), 1e9);
        assert_eq!(instrument::FULL_SCALE_COUNTS, nirspi_wire::ADC_MAX);
        assert_eq!(instrument::MAX_ADC_LATENCY_CLOCKS, LATENCY_MAX);
    }
}

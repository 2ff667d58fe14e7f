mod ends;
mod faults;
mod parallel;
mod program;
mod pulls;
mod start;
mod streams;

use crate::camera::{Camera, Plan};
use crate::fpga::{Even, Golden};
use nirspi::link::Link;
use nirspi::session::{IgnorePackets, Session, request};
use nirspi::setup::MeasurementSetup;
use nirspi_mcu::Limits;
use nirspi_optics::Scene;
use nirspi_recon::Order;
use nirspi_virtual::{MemoryLink, StuckEnable, VirtualOptics};
use nirspi_wire::RunLength;

const SEED: u64 = 7;
const PX: usize = 64;

/// A bar on a rough ground.
fn scene() -> Scene {
    let reflectance = (0..PX * PX).map(|p| {
        let (r, c) = (p / PX, p % PX);
        let rough = (r / 2 * 29 + c / 2 * 71 + r * c * 5) % 89;
        0.003 * rough as f32 + if (r + 2 * c) % 64 < 16 { 0.6 } else { 0.1 }
    });
    Scene::new(reflectance.collect(), PX, 48.0).unwrap()
}

/// The default optics, with all noise, settling and latency.
fn optics() -> VirtualOptics {
    VirtualOptics::new(scene(), 300.0).unwrap()
}

fn plan() -> Plan {
    Plan::new(|| Box::new(Golden::new(optics().fpga(SEED).unwrap())))
}

/// A camera whose ADC always says the same, for what does not depend on light.
fn even() -> Plan {
    Plan::new(|| Box::new(Golden::new(Even::new())))
}

/// A camera that a host has enumerated.
fn connected() -> Option<Camera> {
    connected_as(plan())
}

fn connected_as(plan: Plan) -> Option<Camera> {
    let camera = Camera::start(plan)?;
    camera.connect();
    Some(camera)
}

/// The same camera as a simulation of its firmware alone. Its first light waits for the test of the LED enables, which
/// takes samples of the same noise.
fn virtual_camera() -> Box<dyn Link> {
    let camera = optics().camera(SEED).unwrap();
    Box::new(MemoryLink::new(camera.with_limits(Limits::REFERENCE)))
}

/// A camera with an LED enable that is high whatever its chip says.
fn connected_with(stuck: Option<StuckEnable>) -> Option<Camera> {
    connected_as(Plan::new(move || {
        let fpga = optics().fpga(SEED).unwrap();
        Box::new(Golden::new(match stuck {
            Some(stuck) => fpga.stuck(stuck),
            None => fpga,
        }))
    }))
}

/// The natural order, with the latency of the simulated receiver. A frame of 24 sweeps takes 2 ms, longer than the
/// signal meter looks at one, so that none is lost.
fn natural() -> MeasurementSetup {
    let adc_latency = optics().chain().adc_latency_clocks;
    let setup = MeasurementSetup::new(&Order::Natural, 1.0).unwrap();
    MeasurementSetup { adc_latency, sweeps: 24, ..setup }
}

/// Begins a run without end.
fn start(session: &mut Session, setup: &MeasurementSetup) {
    setup
        .with_configuration(|c| session.command(request::Configure(c), &mut IgnorePackets))
        .unwrap();
    session.command(request::Start(RunLength::Continuous), &mut IgnorePackets).unwrap();
}

/// Whether the LEDs' enable is high.
fn is_lit(camera: &Camera) -> bool {
    camera.with(|machine| machine.chip(|chip| chip.is_lit()))
}

/// Lets so many milliseconds of the chip's time pass.
fn pass(camera: &Camera, ms: f64) {
    camera.with(move |machine| machine.run_while(ms * 1e3, |_| false));
}

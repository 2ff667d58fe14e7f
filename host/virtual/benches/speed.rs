//! ADC samples a second of the whole virtual camera: gateware model, LED array, noisy receiver.
//!
//! `cargo bench -p nirspi-virtual --bench speed [CAMERA...]`: shipped names or files; the paper's camera by default.
//! The fastest of nine runs of 40 ms of the camera's time each.

#![allow(clippy::unwrap_used, reason = "a benchmark may stop at the first surprise")]

use nirspi_mcu::FpgaBus;
use nirspi_optics::Scene;
use nirspi_virtual::{SimulatedFpga, VirtualOptics, read_camera_model};
use nirspi_wire::register::{Register, control, mode};
use std::time::Instant;

const CLOCKS: u32 = 5_000_000;

fn main() {
    let mut cameras: Vec<String> =
        std::env::args().skip(1).filter(|argument| !argument.starts_with("--")).collect();
    if cameras.is_empty() {
        cameras.push("paper".to_owned());
    }
    let mut fpgas = Vec::new();
    for name in &cameras {
        let pixels = (0..1024).map(|i| (i * 7919 % 1000) as f32 / 1000.0).collect();
        let scene = Scene::new(pixels, 32, 48.0).unwrap();
        let camera = read_camera_model(name).unwrap();
        let mut fpga = VirtualOptics::of(&camera, scene, 300.0).unwrap().fpga(1).unwrap();
        for (register, value) in [
            (Register::Mode, mode::DIFFERENTIAL | mode::ALTERNATING),
            (Register::Patterns, 1024),
            (Register::Frames, 0),
            (Register::Control, control::START),
        ] {
            fpga.write(register.address(), value).unwrap();
        }
        fpgas.push((name, fpga, f64::INFINITY));
    }
    // In turns, so that what else the machine does takes from each alike.
    for _ in 0..9 {
        for (_, fpga, best) in &mut fpgas {
            let begun = Instant::now();
            for _ in 0..CLOCKS / 1000 {
                fpga.advance(1000);
                while fpga.frame().unwrap().is_some() {
                    fpga.write(Register::Control.address(), control::RELEASE).unwrap();
                }
            }
            *best = best.min(begun.elapsed().as_secs_f64());
        }
    }
    for (name, fpga, best) in &fpgas {
        assert!(fpga.running(), "{name}: the run has ended");
        println!("{name}: {:.1} M samples/s", f64::from(CLOCKS) / best / 1e6);
    }
}

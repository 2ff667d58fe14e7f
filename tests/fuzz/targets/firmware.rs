//! Fuzzes the firmware with well-framed commands at any time. The firmware must answer or refuse
//! each, and never light LEDs with the interlock open.
#![no_main]

use libfuzzer_sys::fuzz_target;
use nirspi::virtual_camera::{SimulatedFpga, VirtualOptics};
use nirspi_optics::Scene;
use nirspi_wire::crc32;

fuzz_target!(|bytes: &[u8]| {
    let scene = Scene::new(vec![0.5; 4], 2, 48.0).expect("a scene");
    let optics = VirtualOptics::new(scene, 300.0).expect("optics").ideal();
    let mut camera = optics.camera(1).expect("a camera");
    // The greeting, without which the camera refuses every command.
    send(&mut camera, &[0, 0, 1]);
    // Each chunk has one byte for the environment, then the postcard bytes of a request.
    for chunk in bytes.chunks(24).take(32) {
        let (&what, payload) = chunk.split_first().expect("not empty");
        let closed = what & 1 == 0;
        camera.set_interlock(closed);
        send(&mut camera, payload);
        camera.step(u32::from(what) * 8);
        let waiting = camera.packets_out().waiting().len();
        camera.packets_out().sent(if what & 2 == 0 { waiting } else { waiting / 2 });
        assert!(closed || !camera.fpga().running(), "lit with an open interlock");
    }
});

fn send<F: SimulatedFpga>(camera: &mut nirspi::virtual_camera::VirtualCamera<F>, payload: &[u8]) {
    let mut framed = payload.to_vec();
    framed.extend(crc32(payload).to_le_bytes());
    // COBS encoding by zeros alone: short payloads need no block longer than 254.
    let mut packet = vec![0];
    let mut code = 0;
    for byte in framed {
        if byte == 0 {
            packet[code] = (packet.len() - code) as u8;
            code = packet.len();
        }
        packet.push(byte);
    }
    packet[code] = (packet.len() - code) as u8;
    packet.push(0);
    camera.receive(&packet);
}

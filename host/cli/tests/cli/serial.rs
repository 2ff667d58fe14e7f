//! A camera behind a serial port: the virtual one at the far end of a pseudo-terminal.

use crate::bench::Bench;
use nirspi::scene::SceneSource;
use nirspi_optics::Scene;
use nirspi_virtual::{VirtualCamera, VirtualOptics};
use rustix::fd::OwnedFd;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use std::fs::File;
use std::io::{Read, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

/// Clocks between two looks of the firmware: 8 us.
const STEP_CLOCKS: u32 = 1000;

/// A camera on a serial port; unplugged when dropped.
struct Plugged {
    path: String,
    unplug: Arc<AtomicBool>,
    /// Reading and writing the terminal blocks, each in a thread of its own.
    threads: Vec<JoinHandle<()>>,
}

impl Plugged {
    fn new() -> Self {
        let master: OwnedFd = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        let path = ptsname(&master, Vec::new()).unwrap().into_string().unwrap();
        // Held open, so that the terminal outlives each host that comes and goes.
        let held = File::options().read(true).write(true).open(&path).unwrap();
        let mut reader = File::from(master);
        let mut writer = reader.try_clone().unwrap();
        let unplug = Arc::new(AtomicBool::new(false));
        let (said, heard) = std::sync::mpsc::channel::<Vec<u8>>();
        let reading = {
            let unplug = Arc::clone(&unplug);
            std::thread::spawn(move || {
                let mut buffer = vec![0; 4096];
                while let Ok(length @ 1..) = reader.read(&mut buffer) {
                    if unplug.load(Ordering::Relaxed)
                        || said.send(buffer[..length].to_vec()).is_err()
                    {
                        break;
                    }
                }
            })
        };
        let going = Arc::clone(&unplug);
        let camera = std::thread::spawn(move || {
            let mut camera = camera();
            while !going.load(Ordering::Relaxed) {
                while let Ok(bytes) = heard.try_recv() {
                    camera.receive(&bytes);
                }
                let mut worked = false;
                for _ in 0..64 {
                    worked |= !camera.packets_out().is_full() && camera.step(STEP_CLOCKS);
                }
                let waiting = camera.packets_out().waiting().to_vec();
                if writer.write_all(&waiting).is_err() {
                    break;
                }
                camera.packets_out().sent(waiting.len());
                if !worked {
                    std::thread::sleep(Duration::from_millis(1));
                }
            }
            drop(held);
        });
        Self { path, unplug, threads: vec![camera, reading] }
    }
}

impl Drop for Plugged {
    fn drop(&mut self) {
        self.unplug.store(true, Ordering::Relaxed);
        // A byte from the host's side wakes the one that reads.
        if let Ok(mut port) = File::options().write(true).open(&self.path) {
            let _ = port.write_all(b"\n");
        }
        for thread in self.threads.drain(..) {
            let _ = thread.join();
        }
    }
}

fn camera() -> VirtualCamera<nirspi_virtual::OpticalFpga> {
    let map = "letter:R".parse::<SceneSource>().unwrap().load(64).unwrap();
    let scene = Scene::new(map.reflectance, map.size_px, map.side_mm.unwrap()).unwrap();
    VirtualOptics::new(scene, 300.0).unwrap().camera(7).unwrap()
}

#[test]
fn frames_come_through_a_serial_port() {
    let (bench, plugged) = (Bench::new(), Plugged::new());
    let camera = format!("serial:{}:3000000", plugged.path);
    let info = bench.run(&["camera", "info", "--camera", &camera, "--json"]).succeeded().json();
    assert_eq!(info["camera"]["serial"], "virtual-7");
    // A second conversation on the same port, after the first has just gone.
    let capture = ["capture", "--camera", &camera, "--frames", "20", "--out", "rec.mcap", "--json"];
    let report = bench.run(&capture).succeeded().json();
    assert_eq!(report["frames"]["received"], 20, "{report}");
    assert_eq!((&report["complete"], &report["calibrated"]), (&true.into(), &true.into()));
}

#[test]
fn a_serial_port_that_is_not_there_says_how_to_find_one() {
    let bench = Bench::new();
    let camera = "serial:/dev/no-such-port";
    bench
        .run(&["camera", "info", "--camera", camera])
        .failed(1, &[camera, "nirspi camera devices"]);
}

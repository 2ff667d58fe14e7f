//! A virtual camera on TCP that logs its own LEDs: after the line with its address, each line says `on` or `off` and the
//! moment in milliseconds since 1970. `host/cli/tests/browser/led_truth.py` compares what a page says with this log.

use nirspi::scene::SceneSource;
use nirspi_mcu::{BusError, FpgaBus};
use nirspi_virtual::{
    CameraModel, PrecomputedFpga, ServeOptions, SimulatedFpga, VirtualCamera, VirtualOptics, serve,
};
use std::error::Error;
use std::io::{self, Write};
use std::net::TcpListener;
use std::sync::atomic::AtomicBool;
use std::time::SystemTime;

/// An FPGA whose LEDs are logged.
struct Logged<F> {
    fpga: F,
    is_on: bool,
}

impl<F: SimulatedFpga> Logged<F> {
    /// Logs a change.
    fn look(&mut self) {
        if self.is_on == self.fpga.running() {
            return;
        }
        self.is_on = !self.is_on;
        let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
        let word = if self.is_on { "on" } else { "off" };
        // Without a reader the log is lost, and the camera goes on.
        writeln!(io::stdout(), "{word} {}", now.as_millis()).unwrap_or_default();
    }
}

impl<F: SimulatedFpga> SimulatedFpga for Logged<F> {
    fn advance(&mut self, clocks: u32) {
        self.fpga.advance(clocks);
        self.look();
    }

    fn clock(&self) -> u64 {
        self.fpga.clock()
    }

    fn running(&self) -> bool {
        self.fpga.running()
    }

    fn set_interlock(&mut self, closed: bool) {
        self.fpga.set_interlock(closed);
        self.look();
    }

    fn set_board_enable(&mut self, high: bool) {
        self.fpga.set_board_enable(high);
    }
}

impl<F: SimulatedFpga> FpgaBus for Logged<F> {
    fn read(&mut self, address: u16) -> Result<u32, BusError> {
        self.fpga.read(address)
    }

    fn write(&mut self, address: u16, value: u32) -> Result<(), BusError> {
        let written = self.fpga.write(address, value);
        self.look();
        written
    }

    fn frame_ready(&mut self) -> bool {
        self.fpga.frame_ready()
    }

    fn raw_ready(&mut self) -> bool {
        self.fpga.raw_ready()
    }

    fn frame(&mut self) -> Result<Option<&[u8]>, BusError> {
        self.fpga.frame()
    }

    fn raw(&mut self) -> Result<Option<&[u8]>, BusError> {
        self.fpga.raw()
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let letter = "letter:R".parse::<SceneSource>()?.load(64)?;
    let optics = VirtualOptics::before(CameraModel::paper(), &letter, 300.0)?;
    // One frame, sent again and again, leaves the processor to the programs under test.
    let fpga = Logged { fpga: PrecomputedFpga::new(optics.fpga(1)?, 1), is_on: false };
    let mut camera = VirtualCamera::new(fpga, optics.depth(1)?, &optics.serial(1));
    let listener = TcpListener::bind("127.0.0.1:0")?;
    println!("{}", listener.local_addr()?);
    // The time of a real camera goes on whatever its host does.
    let options = ServeOptions { once: false, drop_when_full: true, real_time: true };
    serve(&listener, &mut camera, options, &AtomicBool::new(false), &mut |_| {})?;
    Ok(())
}

//! The other end of the tunnel: a simulated FPGA that an emulated board reaches over a serial line.
//!
//! The one law: simulated time passes with accesses alone. So how fast the emulator is changes no frame.

use nirspi::virtual_camera::SimulatedFpga;
use nirspi_wire::crc32;
use nirspi_wire::host_port::{READ_FRAME, READ_RAW, READ_REGISTER, WRITE_REGISTER};
use nirspi_wire::tunnel::{Lines, REQUEST_BYTES, Request};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// ADC clocks that an access takes.
const ACCESS_CLOCKS: u32 = 100;
/// While nothing is accessed, time passes until a line changes, in steps of the virtual camera's length...
const STEP_CLOCKS: u32 = 1000;
/// ...for so long at most, and not at all while no run is on.
const LOOK_STEPS: u32 = 50;
/// Room temperature.
const CENTI_CELSIUS: i16 = 2500;

/// Serves accesses until the board goes away.
pub fn serve(
    mut line: TcpStream,
    mut fpga: impl SimulatedFpga,
    interlock_closed: &Arc<AtomicBool>,
) {
    let mut buffer = Vec::new();
    let mut chunk = [0; 4096];
    loop {
        match line.read(&mut chunk) {
            Ok(0) | Err(_) => return,
            Ok(length) => buffer.extend_from_slice(&chunk[..length]),
        }
        while let Some(bytes) = buffer.first_chunk::<REQUEST_BYTES>() {
            let Some(request) = Request::from_bytes(bytes) else {
                // A board that has restarted in the middle of a request.
                buffer.remove(0);
                continue;
            };
            buffer.drain(..REQUEST_BYTES);
            fpga.set_interlock(interlock_closed.load(Ordering::Relaxed));
            let data = access(&mut fpga, request);
            let lines = Lines {
                frame_ready: fpga.frame_ready(),
                raw_ready: fpga.raw_ready(),
                interlock_closed: interlock_closed.load(Ordering::Relaxed),
                temperature_centi_celsius: Some(CENTI_CELSIUS),
            };
            let mut reply = lines.to_reply_head(request.number).to_vec();
            reply.extend(data);
            reply.extend(crc32(&reply).to_le_bytes());
            if line.write_all(&reply).is_err() {
                return;
            }
        }
    }
}

fn access(fpga: &mut impl SimulatedFpga, request: Request) -> Vec<u8> {
    let Request { opcode, address, argument, .. } = request;
    let length = request.reply_data();
    let data = match opcode {
        WRITE_REGISTER => {
            fpga.write(address, argument).unwrap();
            Vec::new()
        }
        READ_REGISTER => fpga.read(address).unwrap().to_le_bytes().to_vec(),
        READ_FRAME => padded(fpga.frame(), length),
        READ_RAW => padded(fpga.raw(), length),
        _ => {
            wait(fpga);
            return Vec::new();
        }
    };
    fpga.advance(ACCESS_CLOCKS);
    data
}

/// Beyond the end, and where there is nothing, the FPGA gives zeros.
fn padded(bytes: Result<Option<&[u8]>, nirspi_mcu::BusError>, length: usize) -> Vec<u8> {
    let mut bytes = bytes.unwrap().unwrap_or(&[]).to_vec();
    bytes.resize(length, 0);
    bytes
}

fn wait(fpga: &mut impl SimulatedFpga) {
    for _ in 0..LOOK_STEPS {
        if !fpga.running() || fpga.frame_ready() || fpga.raw_ready() {
            return;
        }
        fpga.advance(STEP_CLOCKS);
    }
}

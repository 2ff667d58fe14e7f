//! A simulated FPGA that the firmware of an emulated board accesses over a serial line
//! ([`nirspi_wire::tunnel`]).
//!
//! # Invariant
//! Simulated time advances only with accesses, so the speed of the emulator changes no frame
//! (`frames_from_the_emulated_board_are_those_of_the_virtual_camera_bit_for_bit` in
//! `tests/tests/qemu.rs`).

use super::SimulatedFpga;
use nirspi::link::is_hangup;
use nirspi_wire::crc32;
use nirspi_wire::host_port::{READ_FRAME, READ_PACKET, READ_RAW, READ_REGISTER, WRITE_REGISTER};
use nirspi_wire::tunnel::{Lines, REQUEST_BYTES, Request};
use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering};

/// ADC clocks of one access.
const ACCESS_CLOCKS: u32 = 100;
/// Without an access, time advances in steps of the virtual camera's length until a line changes...
const STEP_CLOCKS: u32 = 1000;
/// ...for at most this many clocks, and only during a run.
const LOOK_STEPS: u32 = 50;
/// Room temperature.
const CENTI_CELSIUS: i16 = 2500;

/// Serves accesses until the board goes away.
///
/// # Errors
/// If the line fails in another way than by the board's disconnecting.
pub fn serve_tunnel(
    mut line: TcpStream,
    fpga: &mut impl SimulatedFpga,
    interlock_closed: &AtomicBool,
) -> io::Result<()> {
    // Small packets are sent at once; otherwise each access takes 40 ms.
    line.set_nodelay(true)?;
    let mut buffer = Vec::new();
    let mut chunk = [0; 4096];
    loop {
        let length = match line.read(&mut chunk) {
            Ok(0) => return Ok(()),
            Ok(length) => length,
            Err(error) if is_hangup(&error) => return Ok(()),
            Err(error) => return Err(error),
        };
        buffer.extend_from_slice(chunk.get(..length).unwrap_or(&[]));
        while let Some(bytes) = buffer.first_chunk::<REQUEST_BYTES>() {
            let Some(request) = Request::from_bytes(bytes) else {
                // The board may have restarted in the middle of a request.
                buffer.remove(0);
                continue;
            };
            buffer.drain(..REQUEST_BYTES);
            fpga.set_interlock(interlock_closed.load(Ordering::Relaxed));
            fpga.set_board_enable(request.board_enable);
            let data = access(fpga, request);
            let lines = Lines {
                frame_ready: fpga.frame_ready(),
                raw_ready: fpga.raw_ready(),
                interlock_closed: interlock_closed.load(Ordering::Relaxed),
                temperature_centi_celsius: Some(CENTI_CELSIUS),
            };
            let mut reply = lines.to_reply_head(request.number).to_vec();
            reply.extend(data);
            reply.extend(crc32(&reply).to_le_bytes());
            match line.write_all(&reply) {
                Err(error) if is_hangup(&error) => return Ok(()),
                written => written?,
            }
        }
    }
}

/// The answer of the FPGA. An FPGA whose bus fails reads as zeros, like a missing FPGA.
fn access(fpga: &mut impl SimulatedFpga, request: Request) -> Vec<u8> {
    let Request { opcode, address, argument, .. } = request;
    let data = match opcode {
        WRITE_REGISTER => fpga.write(address, argument).map(|()| Vec::new()),
        READ_REGISTER => fpga.read(address).map(|value| value.to_le_bytes().to_vec()),
        READ_FRAME | READ_PACKET => fpga.frame().map(|bytes| bytes.unwrap_or(&[]).to_vec()),
        READ_RAW => fpga.raw().map(|bytes| bytes.unwrap_or(&[]).to_vec()),
        _ => {
            wait(fpga);
            return Vec::new();
        }
    };
    fpga.advance(ACCESS_CLOCKS);
    let mut data = data.unwrap_or_default();
    // The FPGA gives zeros beyond the end of its data and at addresses without data.
    data.resize(request.reply_data(), 0);
    data
}

fn wait(fpga: &mut impl SimulatedFpga) {
    for _ in 0..LOOK_STEPS {
        if !fpga.running() || fpga.frame_ready() || fpga.raw_ready() {
            return;
        }
        fpga.advance(STEP_CLOCKS);
    }
}

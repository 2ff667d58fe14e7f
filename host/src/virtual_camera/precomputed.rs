//! Precomputed frames, for load tests of everything after the FPGA.
//!
//! The simulator computes some hundred frames a second; the instrument makes up to 24 414. This
//! FPGA simulates the first frames of a run once. The frames are then repeated as fast as the
//! firmware takes them, each with its own sequence number, clock and checksum. To firmware logic,
//! protocol, link and host, the camera runs at full speed. Registers and raw bursts come from the
//! model.
//!
//! This FPGA says that it is gateware 0.3.0, which makes no packets: a packet's new sequence number and time
//! would move the bytes of its COBS code, so that each repetition would be encoded anew, which is the work that
//! packets are to save.

use super::fpga::SimulatedFpga;
use nirspi_mcu::{BusError, FpgaBus};
use nirspi_wire::crc32;
use nirspi_wire::fpga::{CRC_BYTES, FpgaFrame, HEADER_BYTES, Header};
use nirspi_wire::register::{Register, control, status};

/// Version 0.3.0 of the gateware.
const NO_PACKETS: u32 = 0x0000_0300;

/// Clocks of the model that one start computes at most: 0.13 s of the camera's time. The server
/// answers no host meanwhile.
const PATIENCE_CLOCKS: u64 = 1 << 24;

/// An FPGA that repeats its first frames. Frames that take longer than 0.13 s of the camera's time are not
/// repeated: the model then makes each of them.
pub struct PrecomputedFpga<F> {
    model: F,
    /// Number of frames of each run that the model computes.
    count: usize,
    run: Option<Run>,
    /// Clocks of all frames offered so far, in all runs.
    repeated_clocks: u64,
}

/// A run of repeated frames.
struct Run {
    /// The computed frames.
    frames: Vec<Vec<u8>>,
    frame_clocks: u64,
    /// Sequence number of the offered frame.
    sequence: u32,
    /// Number of frames of the run; 0 means until stopped.
    length: u32,
    ended: bool,
    first_clock: u64,
    /// Whether the offered frame already contains the sequence number.
    stamped: bool,
}

impl Run {
    fn offers(&self) -> bool {
        !self.ended && (self.length == 0 || self.sequence < self.length)
    }

    fn slot(&self) -> usize {
        self.sequence as usize % self.frames.len()
    }

    /// The offered frame, with header and checksum of this repetition.
    fn stamp(&mut self) -> Option<&[u8]> {
        let (slot, sequence) = (self.slot(), self.sequence);
        let clock = self.first_clock + u64::from(sequence) * self.frame_clocks;
        let frame = self.frames.get_mut(slot)?;
        if !self.stamped {
            stamp(frame, sequence, clock)?;
            self.stamped = true;
        }
        Some(frame)
    }
}

/// Writes header and checksum into a frame.
fn stamp(frame: &mut [u8], sequence: u32, clock: u64) -> Option<()> {
    let header = Header { sequence, lost: 0, clock, ..FpgaFrame::parse_header(frame)? };
    frame.get_mut(..HEADER_BYTES)?.copy_from_slice(&header.to_bytes());
    let (covered, crc) = frame.split_last_chunk_mut::<CRC_BYTES>()?;
    *crc = crc32(covered).to_le_bytes();
    Some(())
}

impl<F: SimulatedFpga> PrecomputedFpga<F> {
    /// An FPGA that repeats the first `count` frames of every run of `model`.
    #[must_use]
    pub fn new(model: F, count: usize) -> Self {
        Self { model, count: count.max(1), run: None, repeated_clocks: 0 }
    }

    /// Starts the model, takes its first frames and stops it. If the model refuses, its registers
    /// hold the reason.
    fn start(&mut self) -> Result<(), BusError> {
        let length = self.model.read(Register::Frames.address())?;
        self.model.write(Register::Frames.address(), 0)?;
        self.model.write(Register::Control.address(), control::START)?;
        let first_clock = self.clock();
        let begun = self.model.clock();
        let mut frames = Vec::new();
        while frames.len() < self.count
            && self.model.read(Register::Status.address())? & status::RUNNING != 0
            && self.model.clock() - begun < PATIENCE_CLOCKS
        {
            self.model.advance(64);
            if self.model.frame_ready() {
                frames.extend(self.model.frame()?.map(<[u8]>::to_vec));
                self.model.write(Register::Control.address(), control::RELEASE)?;
            }
        }
        self.model.write(Register::Control.address(), control::STOP)?;
        self.model.write(Register::Frames.address(), length)?;
        self.run = None;
        if frames.is_empty() && self.model.clock() - begun >= PATIENCE_CLOCKS {
            return self.model.write(Register::Control.address(), control::START);
        }
        if let Some(frame_clocks) = frame_clocks(&frames) {
            self.run = Some(Run {
                frames,
                frame_clocks,
                sequence: 0,
                length,
                ended: false,
                first_clock,
                stamped: false,
            });
        }
        Ok(())
    }
}

/// Clocks from one frame to the next in a sequence of frames.
fn frame_clocks(frames: &[Vec<u8>]) -> Option<u64> {
    let clock = |made: &[u8]| Some(FpgaFrame::parse_header(made)?.clock);
    match frames {
        [] => None,
        [_] => Some(0),
        [first, second, ..] => Some(clock(second)? - clock(first)?),
    }
}

impl<F: SimulatedFpga> SimulatedFpga for PrecomputedFpga<F> {
    fn advance(&mut self, clocks: u32) {
        // During a run, the time is the time of the offered frames.
        if !self.run.as_ref().is_some_and(Run::offers) {
            self.model.advance(clocks);
        }
    }

    fn clock(&self) -> u64 {
        self.model.clock() + self.repeated_clocks
    }

    fn running(&self) -> bool {
        self.run.as_ref().is_some_and(Run::offers) || self.model.running()
    }

    fn set_interlock(&mut self, closed: bool) {
        self.model.set_interlock(closed);
    }
}

impl<F: SimulatedFpga> FpgaBus for PrecomputedFpga<F> {
    fn read(&mut self, address: u16) -> Result<u32, BusError> {
        let value = self.model.read(address)?;
        if address == Register::Version.address() {
            return Ok(NO_PACKETS);
        }
        let Some(run) = &self.run else { return Ok(value) };
        Ok(match Register::at(address) {
            Some(Register::FramesMade) => run.sequence,
            Some(Register::FramesLost) => 0,
            Some(Register::Status) if run.offers() => {
                value | status::RUNNING | status::LEDS_ON | status::FRAME_READY
            }
            _ => value,
        })
    }

    fn write(&mut self, address: u16, value: u32) -> Result<(), BusError> {
        if Register::at(address) != Some(Register::Control) {
            return self.model.write(address, value);
        }
        if let Some(run) = &mut self.run {
            if value & control::RELEASE != 0 && run.offers() {
                run.sequence += 1;
                run.stamped = false;
                self.repeated_clocks += run.frame_clocks;
            }
            if value & control::STOP != 0 {
                run.ended = true;
            }
        }
        if value & control::START_RAW != 0 {
            self.run = None;
        }
        self.model.write(address, value & !control::START)?;
        if value & control::START != 0 {
            self.start()?;
        }
        Ok(())
    }

    fn frame_ready(&mut self) -> bool {
        self.run.as_ref().is_some_and(Run::offers)
    }

    fn raw_ready(&mut self) -> bool {
        self.model.raw_ready()
    }

    fn frame(&mut self) -> Result<Option<&[u8]>, BusError> {
        let run = self.run.as_mut().filter(|run| run.offers());
        Ok(run.and_then(Run::stamp))
    }

    fn raw(&mut self) -> Result<Option<&[u8]>, BusError> {
        self.model.raw()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::virtual_camera::VirtualOptics;
    use nirspi_optics::Scene;
    use nirspi_wire::register::mode;

    fn fpga(sweeps: u32) -> PrecomputedFpga<impl SimulatedFpga> {
        let sheet = Scene::new(vec![0.9; 4], 2, 48.0).unwrap();
        let model = VirtualOptics::new(sheet, 300.0).unwrap().ideal().fpga(1).unwrap();
        let mut fpga = PrecomputedFpga::new(model, 2);
        fpga.write(Register::Patterns.address(), 4).unwrap();
        fpga.write(Register::Mode.address(), mode::DIFFERENTIAL).unwrap();
        fpga.write(Register::Sweeps.address(), sweeps).unwrap();
        fpga
    }

    #[test]
    fn frames_longer_than_a_start_may_take_come_from_the_model() {
        // A frame of 4 patterns takes 40 clocks a sweep, with complements.
        let mut fpga = fpga(u32::MAX);
        let begun = std::time::Instant::now();
        fpga.write(Register::Control.address(), control::START).unwrap();
        assert!(fpga.run.is_none() && fpga.running());
        assert!(!fpga.frame_ready());
        // A start of such a run once took minutes.
        assert!(begun.elapsed() < std::time::Duration::from_secs(60));
    }

    #[test]
    fn short_frames_are_repeated() {
        let mut fpga = fpga(1);
        fpga.write(Register::Control.address(), control::START).unwrap();
        for _ in 0..5 {
            assert!(fpga.frame().unwrap().is_some());
            fpga.write(Register::Control.address(), control::RELEASE).unwrap();
        }
        assert_eq!(fpga.read(Register::FramesMade.address()).unwrap(), 5);
    }
}

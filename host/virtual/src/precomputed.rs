//! Precomputed frames, for load tests of everything after the FPGA.
//!
//! The simulator computes some hundred frames a second; the instrument makes up to 24 414. This
//! FPGA simulates the first frames of a run once. The frames are then repeated as fast as the
//! firmware takes them, each in a packet with its own sequence number, time and checksum. To firmware logic,
//! protocol, link and host, the camera runs at full speed. Registers and raw bursts come from the
//! model.

use super::fpga::SimulatedFpga;
use nirspi_mcu::{BusError, CLOCKS_PER_MICRO, FpgaBus};
use nirspi_wire::packet::{MAX_DEVICE_PACKET, parse, seal, unseal};
use nirspi_wire::ready::{HEADER_BYTES, Head};
use nirspi_wire::register::{Register, control, mode, status};
use nirspi_wire::{DeviceMessage, Frame};

/// Clocks of the model that one start computes at most: 0.13 s of the camera's time. The server
/// answers no host meanwhile.
const PATIENCE_CLOCKS: u64 = 1 << 24;

/// What the signal meter asks the FPGA for while a frame is delivered.
const MEASURES: [Register; 3] = [Register::SumLow, Register::SumHigh, Register::OverRange];

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
    computed: Vec<Computed>,
    frame_clocks: u64,
    /// Sequence number of the offered frame.
    sequence: u32,
    /// Number of frames of the run; 0 means until stopped.
    length: u32,
    ended: bool,
    /// The packet of the offered frame, once it has been asked for.
    packet: Option<usize>,
    room: Box<[u8; MAX_DEVICE_PACKET]>,
}

/// A frame that the model has made.
struct Computed {
    /// The head of its packet.
    head: Head,
    /// The message of its packet.
    payload: Vec<u8>,
    /// The values of [`MEASURES`].
    measures: [u32; 3],
}

impl Computed {
    /// `None`: the bytes are no packet of a frame.
    fn of(packet: &[u8], measures: [u32; 3]) -> Option<Self> {
        let mut encoded = packet.strip_suffix(&[0])?.to_vec();
        let payload = unseal(&mut encoded).ok()?.to_vec();
        let Ok(DeviceMessage::Frame(frame)) = parse(&payload) else { return None };
        let Frame { run, sequence, device_time_us, sweeps, flags, samples } = frame;
        let (patterns, width) = (u16::try_from(samples.len()).ok()?, samples.width());
        let head = Head { run, sequence, device_time_us, sweeps, flags, patterns, width };
        Some(Self { head, payload, measures })
    }
}

impl Run {
    fn offers(&self) -> bool {
        !self.ended && (self.length == 0 || self.sequence < self.length)
    }

    fn slot(&self) -> usize {
        self.sequence as usize % self.computed.len()
    }

    /// The packet of the offered frame, with number, time and checksum of this repetition.
    fn packet(&mut self) -> Option<&[u8]> {
        let length = match self.packet {
            Some(length) => length,
            None => {
                let sequence = self.sequence;
                let passed_us = u64::from(sequence) * self.frame_clocks / CLOCKS_PER_MICRO;
                let device_time_us = self.computed.first()?.head.device_time_us + passed_us;
                let slot = self.slot();
                let Computed { head, payload, .. } = self.computed.get_mut(slot)?;
                let head = Head { sequence, device_time_us, ..*head };
                payload.get_mut(..HEADER_BYTES)?.copy_from_slice(&head.to_bytes());
                let length = seal(payload, &mut self.room[..]).ok()?.len();
                self.packet = Some(length);
                length
            }
        };
        self.room.get(..length)
    }
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
        let begun = self.model.clock();
        let mut computed = Vec::new();
        while computed.len() < self.count
            && self.model.read(Register::Status.address())? & status::RUNNING != 0
            && self.model.clock() - begun < PATIENCE_CLOCKS
        {
            self.model.advance(64);
            if self.model.frame_ready() {
                let mut measures = [0; 3];
                for (measure, register) in measures.iter_mut().zip(MEASURES) {
                    *measure = self.model.read(register.address())?;
                }
                computed
                    .extend(self.model.frame()?.and_then(|frame| Computed::of(frame, measures)));
                self.model.write(Register::Control.address(), control::RELEASE)?;
            }
        }
        self.model.write(Register::Control.address(), control::STOP)?;
        self.model.write(Register::Frames.address(), length)?;
        self.run = None;
        if computed.is_empty() && self.model.clock() - begun >= PATIENCE_CLOCKS {
            return self.model.write(Register::Control.address(), control::START);
        }
        if !computed.is_empty() {
            self.run = Some(Run {
                computed,
                frame_clocks: self.frame_clocks()?,
                sequence: 0,
                length,
                ended: false,
                packet: None,
                room: Box::new([0; MAX_DEVICE_PACKET]),
            });
        }
        Ok(())
    }

    /// Clocks from one frame to the next.
    fn frame_clocks(&mut self) -> Result<u64, BusError> {
        let mut setting = |register: Register| self.model.read(register.address()).map(u64::from);
        let is_differential = setting(Register::Mode)? & u64::from(mode::DIFFERENTIAL) != 0;
        let slots = setting(Register::Patterns)? * if is_differential { 2 } else { 1 };
        Ok(slots * setting(Register::Dwell)? * setting(Register::Sweeps)?)
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

    fn set_board_enable(&mut self, high: bool) {
        self.model.set_board_enable(high);
    }
}

impl<F: SimulatedFpga> FpgaBus for PrecomputedFpga<F> {
    fn read(&mut self, address: u16) -> Result<u32, BusError> {
        let value = self.model.read(address)?;
        let Some(run) = &self.run else { return Ok(value) };
        Ok(match Register::at(address) {
            // The offered frame is made.
            Some(Register::FramesMade) => run.sequence + u32::from(run.offers()),
            Some(Register::FramesLost) => 0,
            Some(register) if run.offers() && MEASURES.contains(&register) => {
                let measures = MEASURES.into_iter().zip(run.computed[run.slot()].measures);
                measures.filter(|(of, _)| *of == register).map(|(_, value)| value).sum()
            }
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
                run.packet = None;
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
        Ok(run.and_then(Run::packet))
    }

    fn raw(&mut self) -> Result<Option<&[u8]>, BusError> {
        self.model.raw()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::VirtualOptics;
    use nirspi_optics::Scene;
    use nirspi_wire::register::mode;

    fn fpga(sweeps: u32) -> PrecomputedFpga<impl SimulatedFpga> {
        let sheet = Scene::new(vec![0.9; 4], 2, 48.0).unwrap();
        let model = VirtualOptics::new(sheet, 300.0).unwrap().ideal().fpga(1).unwrap();
        let mut fpga = PrecomputedFpga::new(model, 2);
        fpga.write(Register::Patterns.address(), 4).unwrap();
        fpga.write(Register::Mode.address(), mode::DIFFERENTIAL | mode::PACKETS).unwrap();
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

    /// Once a camera with precomputed frames had an older gateware than one without.
    #[test]
    fn identity_and_version_are_those_of_the_model_before_and_in_a_run() {
        let mut fpga = fpga(1);
        let names = [Register::Identity, Register::Version].map(Register::address);
        let of_model = names.map(|address| fpga.model.read(address).unwrap());
        assert_eq!(names.map(|address| fpga.read(address).unwrap()), of_model);
        fpga.write(Register::Control.address(), control::START).unwrap();
        assert!(fpga.run.is_some());
        assert_eq!(names.map(|address| fpga.read(address).unwrap()), of_model);
    }

    #[test]
    fn short_frames_are_repeated() {
        let mut fpga = fpga(1);
        fpga.write(Register::Control.address(), control::START).unwrap();
        for number in 0..5 {
            let packet = fpga.frame().unwrap().unwrap().to_vec();
            let again = Computed::of(&packet, [0; 3]).expect("an intact packet");
            assert_eq!(again.head.sequence, number);
            // 40 clocks are 0.32 us.
            assert_eq!(again.head.device_time_us, u64::from(number) * 40 / 125);
            fpga.write(Register::Control.address(), control::RELEASE).unwrap();
        }
        // With the frame that is offered.
        assert_eq!(fpga.read(Register::FramesMade.address()).unwrap(), 6);
    }
}

//! The simulated RTL as the firmware's FPGA bus.
//!
//! The simulator cannot leave its thread. Each call waits until the simulator has done its work, so
//! a run is as repeatable as on one thread.

use crate::board::{Board, Front, HOST_PS, Seen};
use nirspi_mcu::{BusError, FpgaBus};
use nirspi_optics::Chain;
use nirspi_virtual::{SimulatedFpga, StuckEnable, VirtualOptics};
use nirspi_wire::register::{Register, control, mode};
use std::sync::mpsc::{Receiver, Sender, channel};

enum Ask {
    Advance(u32),
    Interlock(bool),
    BoardEnable(bool),
    AdcClock(bool),
    Read(u16),
    Write(u16, u32),
    Frame,
    Raw,
}

#[derive(Default)]
struct Told {
    seen: Seen,
    value: u32,
    bytes: Vec<u8>,
}

/// The RTL between an LED array and a photodiode's ADC.
pub struct RtlFpga {
    asks: Sender<Ask>,
    answers: Receiver<Told>,
    seen: Seen,
    frame: Option<Vec<u8>>,
    raw: Option<Vec<u8>>,
    /// Level of the microcontroller's LED enable.
    board_enable: bool,
    /// The mode written last.
    mode: u32,
    /// A run without light was started and neither stopped nor released: no pin shows it for certain.
    unlit: bool,
}

impl RtlFpga {
    /// A board in front of a scene, powered, with the interlock closed.
    pub fn new(optics: &VirtualOptics, seed: u64) -> Self {
        Self::with(optics, seed, None)
    }

    /// The same with an LED enable that is stuck high.
    pub fn with(optics: &VirtualOptics, seed: u64, stuck: Option<StuckEnable>) -> Self {
        let array = optics.led_array();
        let chain = Chain::new(*optics.chain(), seed).unwrap();
        Self::behind(Front::Camera(Box::new(array), Box::new(chain)), stuck)
    }

    /// Two evaluation boards and the wires between them, with the bring-up design and the interlock closed.
    pub fn bring_up() -> Self {
        Self::behind(Front::loopback(), None)
    }

    /// Takes the ADC's clock away, or brings it back.
    pub fn adc_clock(&mut self, ticks: bool) {
        self.ask(Ask::AdcClock(ticks));
    }

    fn behind(front: Front, stuck: Option<StuckEnable>) -> Self {
        let (asks, asked) = channel();
        let (answer, answers) = channel();
        std::thread::spawn(move || {
            let mut board = Board::new(front, HOST_PS);
            board.stuck = stuck;
            for ask in asked {
                let mut told = Told::default();
                match ask {
                    Ask::Advance(clocks) => board.advance(clocks),
                    Ask::Interlock(closed) => board.interlock(closed),
                    Ask::BoardEnable(high) => board.board_enable(high),
                    Ask::AdcClock(ticks) => board.set_adc_clock(ticks),
                    Ask::Read(address) => told.value = board.read(address),
                    Ask::Write(address, value) => board.write(address, value),
                    Ask::Frame => told.bytes = board.frame(),
                    Ask::Raw => told.bytes = board.raw(),
                }
                told.seen = board.seen();
                if answer.send(told).is_err() {
                    return;
                }
            }
        });
        Self {
            asks,
            answers,
            seen: Seen::default(),
            frame: None,
            raw: None,
            board_enable: false,
            mode: 0,
            unlit: false,
        }
    }

    fn ask(&mut self, ask: Ask) -> Told {
        self.asks.send(ask).unwrap();
        let told = self.answers.recv().unwrap();
        self.seen = told.seen;
        told
    }
}

impl FpgaBus for RtlFpga {
    fn read(&mut self, address: u16) -> Result<u32, BusError> {
        Ok(self.ask(Ask::Read(address)).value)
    }

    fn write(&mut self, address: u16, value: u32) -> Result<(), BusError> {
        const STARTS: u32 = control::START | control::START_RAW;
        if address == Register::Control.address() {
            if value & (control::RELEASE | STARTS) != 0 {
                (self.frame, self.raw) = (None, None);
            }
            if value & (control::STOP | control::RELEASE | STARTS) != 0 {
                self.unlit = value & STARTS != 0 && self.mode & mode::UNLIT != 0;
            }
        } else if address == Register::Mode.address() {
            self.mode = value;
        }
        self.ask(Ask::Write(address, value));
        Ok(())
    }

    fn frame_ready(&mut self) -> bool {
        self.seen.frame_ready
    }

    fn raw_ready(&mut self) -> bool {
        self.seen.raw_ready
    }

    fn frame(&mut self) -> Result<Option<&[u8]>, BusError> {
        if self.frame.is_none() && self.seen.frame_ready {
            self.frame = Some(self.ask(Ask::Frame).bytes);
        }
        Ok(self.frame.as_deref())
    }

    fn raw(&mut self) -> Result<Option<&[u8]>, BusError> {
        if self.raw.is_none() && self.seen.raw_ready {
            self.raw = Some(self.ask(Ask::Raw).bytes);
        }
        Ok(self.raw.as_deref())
    }
}

impl SimulatedFpga for RtlFpga {
    fn advance(&mut self, clocks: u32) {
        self.ask(Ask::Advance(clocks));
    }

    fn clock(&self) -> u64 {
        self.seen.clock
    }

    fn running(&self) -> bool {
        self.seen.lit || self.unlit
    }

    fn set_interlock(&mut self, closed: bool) {
        self.ask(Ask::Interlock(closed));
    }

    fn set_board_enable(&mut self, high: bool) {
        // Most turns of the firmware leave the level as it is.
        if self.board_enable != high {
            self.board_enable = high;
            self.ask(Ask::BoardEnable(high));
        }
    }
}

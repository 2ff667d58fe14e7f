//! A test bench: a gateware with closed interlock, registers by name, samples from a seed.

use crate::oracle::Measured;
use nirspi_hdl_model::{AdcSample, Gateware};
use nirspi_wire::{
    fpga::FpgaFrame,
    register::{FaultCode, Register, control, status},
};

pub struct Bench(pub Gateware);

impl Bench {
    pub fn new() -> Self {
        let mut gateware = Gateware::new();
        gateware.set_interlock(true);
        Self(gateware)
    }

    pub fn set(&mut self, register: Register, value: u32) {
        assert!(self.0.write(register.address(), value));
    }

    pub fn get(&mut self, register: Register) -> u32 {
        self.0.read(register.address()).unwrap()
    }

    pub fn control(&mut self, bits: u32) {
        self.set(Register::Control, bits);
    }

    /// Starts a run that must be accepted.
    pub fn start(&mut self) {
        self.control(control::START);
        assert!(self.0.running(), "start refused");
    }

    pub fn status(&mut self, bit: u32) -> bool {
        self.get(Register::Status) & bit != 0
    }

    pub fn fault(&mut self) -> FaultCode {
        let fault = FaultCode::from_register(self.get(Register::Fault)).unwrap();
        assert_eq!(self.status(status::FAULT), fault != FaultCode::None);
        fault
    }

    pub fn tick(&mut self, code: u16) {
        self.0.tick(AdcSample { code, over_range: false });
    }

    pub fn ticks(&mut self, clocks: u64) {
        for _ in 0..clocks {
            self.tick(0);
        }
    }

    /// Ticks until the LEDs go off; returns the number of clocks in which they were lit.
    pub fn ticks_until_dark(&mut self, sample: AdcSample, at_most: u64) -> u64 {
        let mut lit = 0;
        while self.0.lines().enable && lit <= at_most {
            self.0.tick(sample);
            lit += 1;
        }
        lit
    }

    /// Reads the delivered frame, checks that it is intact, and releases it.
    pub fn take_frame(&mut self) -> Measured {
        let frame = FpgaFrame::parse(self.0.frame().expect("no frame")).expect("damaged frame");
        let measured = Measured { header: frame.header, sums: frame.sums().collect() };
        self.control(control::RELEASE);
        measured
    }
}

/// The sample of clock `t` of an endless random stream. One sample of 16 is over range.
pub fn random_sample(seed: u64, t: u64) -> AdcSample {
    let mut z = seed ^ t.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^= z >> 31;
    AdcSample { code: (z & 0x3FFF) as u16, over_range: z >> 60 == 0 }
}

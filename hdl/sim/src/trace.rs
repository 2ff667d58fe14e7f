//! A record of all levels at the pins, for another simulator to repeat.
//!
//! The record begins before the first reset and has every edge, so another simulator needs nothing
//! else. Edges follow one another, all little-endian; `hdl/verilator/replay.cpp` reads them:
//!
//! | bytes | field |
//! |---|---|
//! | 1 | bits 0 to 2: [`Edge`]; bit 3: inputs follow; bit 4: outputs follow. What does not follow is as before, and all 0 before the first |
//! | 4 | inputs before the edge: sample (14 bits), over range, interlock, `sck`, `cs_n`, lines (4 bits), beat, PLL locked and clock alive together, design (7 bits), ready of the parallel port |
//! | 12 | outputs after it: rows; columns; enable, frame ready, raw ready, access, lines (4 bits), drive (4 bits); the parallel port's lines (8 bits), enable, strobe (2 bits) |

use nirspi_hdl_model::AdcSample;
use std::{
    fs::File,
    io::{BufWriter, Write},
    path::PathBuf,
    sync::atomic::{AtomicUsize, Ordering},
};

/// Which clock rises, and whether its domain is in reset.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Edge {
    Adc = 0,
    Host = 1,
    AdcReset = 2,
    HostReset = 3,
    BridgeReset = 4,
    Sck = 5,
    /// The pin resets what `sck` clocks.
    Deselected = 6,
}

const INPUTS: u8 = 1 << 3;
const OUTPUTS: u8 = 1 << 4;

/// Levels of the inputs.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Levels {
    pub sample: AdcSample,
    pub interlock: bool,
    pub sck: bool,
    pub selected: bool,
    pub lines: u8,
    pub beat: bool,
    /// The PLL is locked and the clock alive.
    pub healthy: bool,
    pub design: u8,
    /// The parallel port's receiver takes bytes.
    pub ready: bool,
}

impl Levels {
    fn word(self) -> u32 {
        u32::from(self.sample.code)
            | u32::from(self.sample.over_range) << 14
            | u32::from(self.interlock) << 15
            | u32::from(self.sck) << 16
            | u32::from(!self.selected) << 17
            | u32::from(self.lines & 0xF) << 18
            | u32::from(self.beat) << 22
            | u32::from(self.healthy) << 23
            | u32::from(self.design & 0x7F) << 24
            | u32::from(self.ready) << 31
    }
}

/// A record in progress.
#[derive(Debug)]
pub(crate) struct Trace {
    file: BufWriter<File>,
    inputs: u32,
    outputs: [u32; 3],
}

impl Trace {
    /// A new record in `$NIRSPI_PIN_TRACE`, if that variable is set.
    pub(crate) fn asked_for() -> Option<Self> {
        static COUNT: AtomicUsize = AtomicUsize::new(0);
        let folder = PathBuf::from(std::env::var_os("NIRSPI_PIN_TRACE")?);
        let name = format!("{}.trace", COUNT.fetch_add(1, Ordering::Relaxed));
        let file = BufWriter::new(File::create(folder.join(name)).unwrap());
        Some(Self { file, inputs: 0, outputs: [0; 3] })
    }

    pub(crate) fn edge(&mut self, edge: Edge, inputs: Levels, outputs: [u32; 3]) {
        let inputs = inputs.word();
        let mut head = edge as u8;
        head |= if inputs == self.inputs { 0 } else { INPUTS };
        head |= if outputs == self.outputs { 0 } else { OUTPUTS };
        let mut bytes = vec![head];
        if head & INPUTS != 0 {
            bytes.extend(inputs.to_le_bytes());
        }
        if head & OUTPUTS != 0 {
            bytes.extend(outputs.iter().flat_map(|word| word.to_le_bytes()));
        }
        (self.inputs, self.outputs) = (inputs, outputs);
        self.file.write_all(&bytes).unwrap();
    }
}

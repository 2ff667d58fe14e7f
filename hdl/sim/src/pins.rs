//! The simulated FPGA seen from its pins, with its two clocks and `sck`, which is a third.
//!
//! Pins change between clock edges, and edges come in the order of their time.

use crate::project::Project;
use crate::trace::{Edge, Levels, Trace};
use nirspi_hdl_model::{AdcSample, Lines};
use nirspi_wire::register::{Design, clocks, sampling};
use veryl_analyzer::ir::{VarId, VarPath};
use veryl_analyzer::value::Value;
use veryl_simulator::{Simulator, ir::Event};

/// Clocks for which the board holds each of its resets: `hdl/boards/ecp5-evn/reset_synchroniser.sv`.
const RESET_CLOCKS: u8 = 8;

/// Where the board's resets stand after the ADC's clock was lost: `hdl/boards/ecp5-evn/resets.sv`. Each number is of
/// the edges that the reset still lasts.
#[derive(Debug, Clone, Copy, Default)]
struct Resets {
    first: u8,
    adc: u8,
    bridge: u8,
}

/// What the board says of the ADC's sampling phase: step 17 of a period of 40, in the middle of 15 that are right.
/// `hdl/verilator/replay.cpp` has it too.
pub const SAMPLING: u32 = sampling::DONE | sampling::STEPS << 16 | 15 << 8 | 17;

/// The core on its board; the caller drives both clocks.
pub struct Pins {
    sim: Simulator,
    adc: Event,
    host: Event,
    sck: Event,
    reset_sck: Event,
    reset_adc: Event,
    reset_bridge: Event,
    /// The ADC's clock ticks.
    clocked: bool,
    resets: Resets,
    /// Edges of the ADC's clock, of which the board makes `adc_beat`.
    beats: u32,
    inputs: Inputs,
    trace: Option<Trace>,
    levels: Levels,
    /// The flags since the last edge and change of an input, once they have been read.
    flags: Option<[bool; 5]>,
}

struct Inputs {
    code: VarId,
    over_range: VarId,
    interlock: VarId,
    sck: VarId,
    cs_n: VarId,
    lines: VarId,
    design: VarId,
    beat: VarId,
    locked: VarId,
    alive: VarId,
    ready: VarId,
    sampling: VarId,
}

/// Outputs of the parallel port in one clock of the ADC.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Parallel {
    /// Level of its clock in the first half of this clock, bit 1, and in the second, bit 0.
    pub strobe: u8,
    /// The lines hold a byte.
    pub enable: bool,
    /// The eight lines.
    pub lines: u8,
}

/// Outputs in bundles, because the simulator looks a port up by its name each time, which took a third of a run.
const BUNDLES: [(&str, &str); 2] = [
    (
        "module core (\n",
        "module core (
    bundle_leds : output 'adc logic<64>,
    bundle_adc  : output 'adc logic<5>,
    bundle_lines: output 'host logic<8>,
    bundle_parallel: output 'adc logic<11>,
",
    ),
    (
        "for an activity LED\n) {\n",
        "for an activity LED
) {
    assign bundle_leds  = {led_rows, led_columns};
    assign bundle_adc   = {led_rows != 0 || led_columns != 0, led_enable, access, frame_ready, raw_ready};
    assign bundle_lines = {spi_out, spi_drive};
    assign bundle_parallel = {parallel_strobe, parallel_enable, parallel_lines};
",
    ),
];

impl Pins {
    /// The FPGA after reset, with open interlock and idle port. `$NIRSPI_PIN_TRACE` names a folder
    /// for a record of all levels at the pins, which another simulator can repeat.
    ///
    /// # Panics
    /// If the core does not build, or has no such ports.
    #[must_use]
    pub fn new(project: &Project) -> Self {
        let bundle = |project: Project, (from, to)| project.with("core", from, to);
        let mut sim = BUNDLES.into_iter().fold(project.clone(), bundle).simulate("core");
        let adc = sim.get_clock("clk_adc").unwrap();
        let host = sim.get_clock("clk_host").unwrap();
        let sck = sim.get_clock("clk_sck").unwrap();
        let input = |name: &str| *sim.ir.ports.get(&name.parse::<VarPath>().unwrap()).unwrap();
        let inputs = Inputs {
            code: input("adc_code"),
            over_range: input("adc_over_range"),
            interlock: input("interlock"),
            sck: input("spi_sck"),
            cs_n: input("spi_cs_n"),
            lines: input("spi_in"),
            design: input("design_id"),
            beat: input("adc_beat"),
            locked: input("pll_locked"),
            alive: input("clock_alive"),
            ready: input("parallel_ready"),
            sampling: input("sampling"),
        };
        let reset_sck = sim.get_reset("rst_sck").unwrap();
        let reset_adc = sim.get_reset("rst_adc").unwrap();
        let reset_host = sim.get_reset("rst_host").unwrap();
        let reset_bridge = sim.get_reset("rst_bridge").unwrap();
        sim.step(&Event::Initial);
        let (trace, levels) = (Trace::asked_for(), Levels::default());
        let mut pins = Self {
            sim,
            adc,
            host,
            sck,
            reset_sck,
            reset_adc,
            reset_bridge,
            clocked: true,
            resets: Resets::default(),
            beats: 0,
            inputs,
            trace,
            levels,
            flags: None,
        };
        pins.levels.selected = true;
        pins.select(false);
        pins.design(Design::Camera);
        pins.set(pins.inputs.sampling, SAMPLING.into(), 32);
        pins.clock_levels(true);
        for _ in 0..4 {
            pins.adc_reset_edge();
            pins.sim.step_reset(&pins.host, &reset_host);
            pins.record(Edge::HostReset);
            pins.bridge_reset_edge();
        }
        pins
    }

    fn adc_reset_edge(&mut self) {
        self.sim.step_reset(&self.adc, &self.reset_adc);
        self.record(Edge::AdcReset);
    }

    fn bridge_reset_edge(&mut self) {
        self.sim.step_reset(&self.host, &self.reset_bridge);
        self.record(Edge::BridgeReset);
    }

    /// Which design the board says that it is; a camera without this call.
    pub fn design(&mut self, design: Design) {
        self.levels.design = design as u8;
        self.set(self.inputs.design, design as u64, 8);
    }

    fn clock_levels(&mut self, healthy: bool) {
        self.levels.healthy = healthy;
        self.set(self.inputs.locked, healthy.into(), 1);
        self.set(self.inputs.alive, healthy.into(), 1);
    }

    /// Takes the ADC's clock away, or brings it back. The board then holds its resets one after the other: until the
    /// host port's clock has ticked, until the ADC's has, and until the host port's has again.
    pub fn adc_clock(&mut self, ticks: bool) {
        self.clocked = ticks;
        self.clock_levels(ticks);
        let each = RESET_CLOCKS;
        self.resets = Resets { first: each, adc: each, bridge: each };
    }

    /// Whether the ADC's clock domain has left every reset, so that register accesses reach it.
    #[must_use]
    pub fn adc_answers(&self) -> bool {
        self.adc_runs() && self.resets.bridge == 0
    }

    /// Whether the ADC's domain is out of reset.
    #[must_use]
    pub fn adc_runs(&self) -> bool {
        self.clocked && self.resets.adc == 0
    }

    /// Records an edge, with the inputs before it and the outputs after it.
    fn record(&mut self, edge: Edge) {
        self.flags = None;
        if let Some(mut trace) = self.trace.take() {
            let outputs = self.levels_out();
            trace.edge(edge, self.levels, outputs);
            self.trace = Some(trace);
        }
    }

    /// All outputs; layout as in `trace.rs`.
    fn levels_out(&mut self) -> [u32; 3] {
        let Lines { rows, columns, enable } = self.leds();
        let (lines, drive) = self.driven();
        let (frame, raw) = self.ready();
        let flags = [enable, frame, raw, self.access()];
        let flags = flags.iter().rev().fold(0, |word, &flag| word << 1 | u32::from(flag));
        let parallel = self.get("bundle_parallel") as u32;
        [rows, columns, flags | u32::from(lines) << 4 | u32::from(drive) << 8 | parallel << 12]
    }

    fn set(&mut self, port: VarId, value: u64, width: usize) {
        self.flags = None;
        self.sim.set_var_by_id(&port, Value::new(value, width, false));
        self.sim.mark_comb_dirty();
    }

    fn get(&mut self, output: &str) -> u64 {
        self.sim.get(output).expect("no such port").to_u64().expect("undefined")
    }

    /// Whether any LED line is high; `led_enable`, `access`, `frame_ready` and `raw_ready`.
    fn flags(&mut self) -> [bool; 5] {
        if let Some(flags) = self.flags {
            return flags;
        }
        let flags = self.get("bundle_adc");
        let flags = [16, 8, 4, 2, 1].map(|flag| flags & flag != 0);
        *self.flags.insert(flags)
    }

    /// A rising edge of the ADC's clock, if it ticks.
    pub fn adc_edge(&mut self) {
        if !self.clocked {
            return;
        }
        self.beats = self.beats.wrapping_add(1);
        let beat = !(self.beats / clocks::PRESCALER).is_multiple_of(2);
        if beat != self.levels.beat {
            self.levels.beat = beat;
            self.set(self.inputs.beat, beat.into(), 1);
        }
        if self.resets.adc == 0 {
            self.sim.step(&self.adc);
            return self.record(Edge::Adc);
        }
        self.adc_reset_edge();
        if self.resets.first == 0 {
            self.resets.adc -= 1;
        }
    }

    /// A rising edge of the host port's clock.
    pub fn host_edge(&mut self) {
        let Resets { first, adc, bridge } = &mut self.resets;
        if *bridge == 0 {
            self.sim.step(&self.host);
            return self.record(Edge::Host);
        }
        if self.clocked {
            if *first > 0 {
                *first -= 1;
            } else if *adc == 0 {
                *bridge -= 1;
            }
        }
        self.bridge_reset_edge();
    }

    /// Sets the ADC's output.
    pub fn sample(&mut self, sample: AdcSample) {
        self.levels.sample = sample;
        self.set(self.inputs.code, sample.code.into(), 14);
        self.set(self.inputs.over_range, sample.over_range.into(), 1);
    }

    /// Opens or closes the interlock loop.
    pub fn interlock(&mut self, closed: bool) {
        self.levels.interlock = closed;
        self.set(self.inputs.interlock, closed.into(), 1);
    }

    /// Drives `parallel_ready`.
    pub fn receives(&mut self, ready: bool) {
        self.levels.ready = ready;
        self.set(self.inputs.ready, ready.into(), 1);
    }

    /// The parallel port.
    pub fn parallel(&mut self) -> Parallel {
        let word = self.get("bundle_parallel");
        Parallel { strobe: (word >> 9) as u8, enable: word >> 8 & 1 != 0, lines: word as u8 }
    }

    /// Drives `cs_n`: low when selected. The level resets what `sck` clocks, with or without a clock.
    pub fn select(&mut self, selected: bool) {
        let falls = self.levels.selected && !selected;
        self.levels.selected = selected;
        self.set(self.inputs.cs_n, (!selected).into(), 1);
        if falls {
            self.sim.step_reset(&self.sck, &self.reset_sck);
            self.record(Edge::Deselected);
        }
    }

    /// Drives the host port's `sck`. What it clocks is in reset while the port is not selected.
    pub fn sck(&mut self, high: bool) {
        let rises = high && !self.levels.sck;
        self.levels.sck = high;
        self.set(self.inputs.sck, high.into(), 1);
        if rises && self.levels.selected {
            self.sim.step(&self.sck);
            self.record(Edge::Sck);
        }
    }

    /// Sets the levels that the host drives on the four lines.
    pub fn drive(&mut self, lines: u8) {
        self.levels.lines = lines;
        self.set(self.inputs.lines, lines.into(), 4);
    }

    /// Levels that the FPGA drives on the host port, and the lines that it drives.
    pub fn driven(&mut self) -> (u8, u8) {
        let lines = self.get("bundle_lines");
        ((lines >> 4) as u8, (lines & 0xF) as u8)
    }

    /// The LED lines.
    pub fn leds(&mut self) -> Lines {
        let [any, enable, ..] = self.flags();
        let lines = if any { self.get("bundle_leds") } else { 0 };
        Lines { rows: (lines >> 32) as u32, columns: lines as u32, enable }
    }

    /// Whether an access of the host takes effect in this clock.
    pub fn access(&mut self) -> bool {
        self.flags()[2]
    }

    /// `frame_ready` and `raw_ready`.
    pub fn ready(&mut self) -> (bool, bool) {
        let [.., frame, raw] = self.flags();
        (frame, raw)
    }
}

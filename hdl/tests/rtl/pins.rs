//! The simulated FPGA seen from its pins, with its two clocks.
//!
//! The one law: pins change between clock edges, and edges come in the order of their time.

use crate::project::Project;
use nirspi_hdl::{AdcSample, Lines};
use veryl_analyzer::ir::{VarId, VarPath};
use veryl_analyzer::value::Value;
use veryl_simulator::{Simulator, ir::Event};

/// The core, clocked by hand.
pub struct Pins {
    sim: Simulator,
    adc: Event,
    host: Event,
    inputs: Inputs,
    outputs: Outputs,
}

struct Inputs {
    code: VarId,
    over_range: VarId,
    interlock: VarId,
    sck: VarId,
    cs_n: VarId,
    lines: VarId,
}

struct Outputs {
    rows: String,
    columns: String,
    enable: String,
    access: String,
    frame_ready: String,
    raw_ready: String,
    lines: String,
    drive: String,
}

impl Pins {
    /// After reset; interlock open, port idle.
    pub fn new(project: &Project) -> Self {
        let mut sim = project.simulate("core");
        let adc = sim.get_clock("clk_adc").unwrap();
        let host = sim.get_clock("clk_host").unwrap();
        let input = |name: &str| *sim.ir.ports.get(&name.parse::<VarPath>().unwrap()).unwrap();
        let inputs = Inputs {
            code: input("adc_code"),
            over_range: input("adc_over_range"),
            interlock: input("interlock"),
            sck: input("spi_sck"),
            cs_n: input("spi_cs_n"),
            lines: input("spi_in"),
        };
        let outputs = Outputs {
            rows: "led_rows".into(),
            columns: "led_columns".into(),
            enable: "led_enable".into(),
            access: "access".into(),
            frame_ready: "frame_ready".into(),
            raw_ready: "raw_ready".into(),
            lines: "spi_out".into(),
            drive: "spi_drive".into(),
        };
        let reset_adc = sim.get_reset("rst_adc").unwrap();
        let reset_host = sim.get_reset("rst_host").unwrap();
        sim.step(&Event::Initial);
        let mut pins = Self { sim, adc, host, inputs, outputs };
        pins.select(false);
        for _ in 0..4 {
            pins.sim.step_reset(&pins.adc, &reset_adc);
            pins.sim.step_reset(&pins.host, &reset_host);
        }
        pins
    }

    fn set(&mut self, port: VarId, value: u64, width: usize) {
        self.sim.set_var_by_id(&port, Value::new(value, width, false));
        self.sim.mark_comb_dirty();
    }

    fn get(&mut self, output: impl Fn(&Outputs) -> &str) -> u64 {
        let value = self.sim.get(output(&self.outputs)).expect("no such port");
        value.to_u64().expect("undefined")
    }

    pub fn adc_edge(&mut self) {
        self.sim.step(&self.adc);
    }

    pub fn host_edge(&mut self) {
        self.sim.step(&self.host);
    }

    pub fn sample(&mut self, sample: AdcSample) {
        self.set(self.inputs.code, sample.code.into(), 14);
        self.set(self.inputs.over_range, sample.over_range.into(), 1);
    }

    pub fn interlock(&mut self, closed: bool) {
        self.set(self.inputs.interlock, closed.into(), 1);
    }

    pub fn select(&mut self, selected: bool) {
        self.set(self.inputs.cs_n, (!selected).into(), 1);
    }

    pub fn sck(&mut self, high: bool) {
        self.set(self.inputs.sck, high.into(), 1);
    }

    pub fn drive(&mut self, lines: u8) {
        self.set(self.inputs.lines, lines.into(), 4);
    }

    /// What the FPGA drives on the host port, and on which lines.
    pub fn driven(&mut self) -> (u8, u8) {
        (self.get(|o| &o.lines) as u8, self.get(|o| &o.drive) as u8)
    }

    pub fn leds(&mut self) -> Lines {
        Lines {
            rows: self.get(|o| &o.rows) as u32,
            columns: self.get(|o| &o.columns) as u32,
            enable: self.get(|o| &o.enable) != 0,
        }
    }

    /// An access of the host takes effect before this clock is done with.
    pub fn access(&mut self) -> bool {
        self.get(|o| &o.access) != 0
    }

    pub fn ready(&mut self) -> (bool, bool) {
        (self.get(|o| &o.frame_ready) != 0, self.get(|o| &o.raw_ready) != 0)
    }
}

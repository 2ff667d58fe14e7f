//! One module of the RTL on its own, driven by the names of its ports.
//!
//! Ports change between clock edges. A value read before an edge belongs to the clock that the edge
//! ends.

use crate::project::Project;
use veryl_analyzer::{ir::VarPath, value::Value};
use veryl_simulator::{Simulator, ir::Event};

/// A field of a bundle of signals, as a port packs it: value and width in bits.
pub type Field = (u64, usize);

/// A module with all inputs 0.
pub struct Bench(Simulator);

impl Bench {
    /// The module after a reset of `clk`, if it has a clock of that name.
    pub fn new(project: &Project, module: &str) -> Self {
        let mut sim = project.simulate(module);
        sim.step(&Event::Initial);
        let mut bench = Self(sim);
        if bench.0.get_reset("rst").is_some() {
            bench.reset("clk", "rst");
        }
        bench
    }

    /// Holds the reset of a clock for one edge.
    pub fn reset(&mut self, clock: &str, reset: &str) {
        let (clock, reset) = (self.0.get_clock(clock).unwrap(), self.0.get_reset(reset).unwrap());
        self.0.step_reset(&clock, &reset);
    }

    fn set_value(&mut self, port: &str, value: Value) {
        let path: VarPath = port.parse().unwrap();
        assert!(self.0.ir.ports.contains_key(&path), "no port {port}");
        self.0.set(port, value);
    }

    /// Sets a port. A port narrower than the value takes its low bits.
    pub fn set(&mut self, port: &str, value: impl Into<u64>) {
        self.set_value(port, Value::new(value.into(), 64, false));
    }

    /// Sets a bundle; the most significant field comes first.
    pub fn set_fields(&mut self, port: &str, fields: &[Field]) {
        let values = fields.iter().map(|&(value, width)| Value::new(value, width, false));
        self.set_value(port, values.reduce(|high, low| high.concat(&low)).unwrap());
    }

    pub fn get(&mut self, port: &str) -> u64 {
        self.0.get(port).expect("no such port").to_u64().expect("undefined")
    }

    pub fn is(&mut self, port: &str) -> bool {
        self.get(port) != 0
    }

    /// Reads a bundle as fields of these widths; the most significant field comes first.
    pub fn get_fields(&mut self, port: &str, widths: &[usize]) -> Vec<u64> {
        let value = self.0.get(port).expect("no such port");
        let mut end = widths.iter().sum::<usize>();
        assert_eq!(value.width(), end, "bits of {port}");
        let field = |&width: &usize| {
            end -= width;
            value.select(end + width - 1, end).to_u64().expect("undefined")
        };
        widths.iter().map(field).collect()
    }

    pub fn edge(&mut self, clock: &str) {
        let clock = self.0.get_clock(clock).unwrap();
        self.0.step(&clock);
    }

    /// An edge of `clk`.
    pub fn tick(&mut self) {
        self.edge("clk");
    }
}

//! One module on its own, driven by name.

use crate::project::Project;
use veryl_analyzer::value::Value;
use veryl_simulator::{Simulator, ir::Event};

/// A module of one clock (or the first of two), after reset.
pub struct Bench(pub Simulator);

impl Bench {
    pub fn new(module: &str) -> Self {
        let mut sim = Project::read().simulate(module);
        sim.step(&Event::Initial);
        Self(sim)
    }

    /// Holds the reset of a clock.
    pub fn reset(&mut self, clock: &str, reset: &str) {
        let (clock, reset) = (self.0.get_clock(clock).unwrap(), self.0.get_reset(reset).unwrap());
        self.0.step_reset(&clock, &reset);
    }

    /// Ports too wide for the value take its low bits.
    pub fn set(&mut self, port: &str, value: u64) {
        self.0.set(port, Value::new(value, 64, false));
    }

    pub fn get(&mut self, port: &str) -> u64 {
        self.0.get(port).expect("no such port").to_u64().expect("undefined")
    }

    pub fn edge(&mut self, clock: &str) {
        let clock = self.0.get_clock(clock).unwrap();
        self.0.step(&clock);
    }
}

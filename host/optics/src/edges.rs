//! How the light of the LEDs follows their lines: a rise and a fall, each with its own time constant and delay.
//!
//! # Model
//! An LED that is switched on or off goes on as it was for a delay, and then approaches its new light by a first-order
//! edge. The light of all LEDs is
//!
//! `light = settled - deficit + tail`
//!
//! where the deficit is what rising LEDs still lack, and the tail is what falling LEDs still give. LEDs that are switched
//! on add their light to the deficit, LEDs that are switched off add theirs to the tail, and each of the two pools decays
//! with its own time constant. The delay of a switch ends within its clock ([`ChainSettings`](crate::ChainSettings)), and light is constant
//! otherwise, so pools and amplifier are stepped exactly.
//!
//! # Accuracy
//! The pools are exact if rise and fall are alike. If not, an LED that is switched before it has settled keeps its rest in
//! the wrong pool: an error of its light of at most `exp(-t / tau)` of a step times the difference of the two edges, where
//! `t` is the time between its switches and `tau` the slower time constant. With the circuit of `boards/electronics` and
//! patterns of 40 ns that is below 0.0003 of a step
//! (`the_pools_agree_with_1024_leds_of_their_own` in
//! `host/optics/tests/edges.rs`).

use crate::poles::{decay, shared_decay};
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};

/// The edges of the LEDs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LedEdges {
    /// Rise time of the light from 10 to 90 %, in ns. Fast 1550 nm LEDs take 10 to 20.
    pub rise_ns: f64,
    /// Fall time of the light from 90 to 10 %, in ns.
    pub fall_ns: f64,
    /// Time from the line's change until the light begins to rise, in ns: at most one ADC clock.
    pub turn_on_delay_ns: f64,
    /// Time from the line's change until the light begins to fall, in ns: at most one ADC clock.
    pub turn_off_delay_ns: f64,
}

impl LedEdges {
    /// LEDs that rise and fall alike, without delay.
    #[must_use]
    pub const fn alike(edge_ns: f64) -> Self {
        Self { rise_ns: edge_ns, fall_ns: edge_ns, turn_on_delay_ns: 0.0, turn_off_delay_ns: 0.0 }
    }

    /// Whether a rising LED is the reverse of a falling one, so that the light is linear in the patterns.
    #[must_use]
    pub fn are_alike(&self) -> bool {
        self.rise_ns == self.fall_ns && self.turn_on_delay_ns == self.turn_off_delay_ns
    }

    pub(crate) fn has_delay(&self) -> bool {
        self.turn_on_delay_ns != 0.0 || self.turn_off_delay_ns != 0.0
    }
}

/// A key of a camera's serial number. Edges that are alike have the key and value that they had before rise and fall could
/// differ, so that kept calibrations stay those of their camera.
impl Serialize for LedEdges {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        if *self == Self::alike(self.rise_ns) {
            map.serialize_entry("led_edge_ns", &self.rise_ns)?;
        } else {
            map.serialize_entry("led_rise_ns", &self.rise_ns)?;
            map.serialize_entry("led_fall_ns", &self.fall_ns)?;
            map.serialize_entry("led_turn_on_delay_ns", &self.turn_on_delay_ns)?;
            map.serialize_entry("led_turn_off_delay_ns", &self.turn_off_delay_ns)?;
        }
        map.end()
    }
}

/// Time constant of a first-order edge, which takes ln 9 of them from 10 to 90 %.
pub(crate) fn time_constant_ns(edge_ns: f64) -> f64 {
    edge_ns / 9.0_f64.ln()
}

/// The light of the lines in one clock.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Light {
    /// Electrons per ADC sample after the LEDs have settled.
    pub settled: f32,
    /// Light of the LEDs that were switched at the start of this clock, on or off, in electrons per ADC sample.
    pub switched: f32,
    /// Lines that rose at the start of this clock, less lines that fell.
    pub lines_risen: i8,
}

/// Light of which nothing is known but its sum: what it grows by rises, what it shrinks by falls.
impl From<f32> for Light {
    fn from(settled: f32) -> Self {
        Self { settled, ..Self::default() }
    }
}

/// Light that is on its way: the deficit of rising LEDs, which counts negative, and the tail of falling ones.
#[derive(Debug, Clone)]
pub(crate) struct Pools {
    /// Electrons per sample at the start of the clock, with their sign.
    left: [f64; 2],
    settled: f64,
    /// Of a unit in a pool, the share that is left after a clock, and the share that is in the amplifier's output at the end
    /// of the clock.
    old: [Shares; 2],
    /// The same of a unit that was switched at the start of the clock.
    fresh: [Shares; 2],
}

#[derive(Debug, Clone, Copy)]
struct Shares {
    left: f64,
    amplified: f64,
}

impl Shares {
    /// `t` is a clock and `amplifier` the amplifier's time constant, in ns.
    fn of(t: f64, edge_ns: f64, delay: f64, amplifier: f64) -> Self {
        let tau = time_constant_ns(edge_ns);
        let after = t - delay;
        // During the delay the pool is a constant, behind the amplifier's pole.
        let during = if delay == 0.0 { 0.0 } else { decay(after, amplifier) - decay(t, amplifier) };
        Self {
            left: if after > 0.0 { decay(after, tau) } else { 1.0 },
            amplified: during + shared_decay(after, tau, amplifier),
        }
    }
}

impl Pools {
    /// The pools of dark LEDs.
    pub(crate) fn of(edges: &LedEdges, t: f64, amplifier: f64) -> Self {
        let (rise, fall) = (edges.rise_ns, edges.fall_ns);
        let (on, off) = (edges.turn_on_delay_ns, edges.turn_off_delay_ns);
        Self {
            left: [0.0; 2],
            settled: 0.0,
            old: [Shares::of(t, rise, 0.0, amplifier), Shares::of(t, fall, 0.0, amplifier)],
            fresh: [Shares::of(t, rise, on, amplifier), Shares::of(t, fall, off, amplifier)],
        }
    }

    /// The settled light of the clock before.
    #[inline]
    pub(crate) fn settled(&self) -> f64 {
        self.settled
    }

    /// One clock in which nothing switches. Returns what the pools add to the amplifier's output at the end of the clock.
    #[inline]
    pub(crate) fn hold(&mut self) -> f64 {
        let ([rise, fall], [deficit, tail]) = (&self.old, self.left);
        self.left = [deficit * rise.left, tail * fall.left];
        deficit * rise.amplified + tail * fall.amplified
    }

    /// As [`Self::hold`], with this settled light, of which `switched` was switched at the clock's start.
    #[inline]
    pub(crate) fn switch(&mut self, settled: f64, switched: f64) -> f64 {
        let held = self.hold();
        let grown = settled - self.settled;
        self.settled = settled;
        let switched = switched.max(grown.abs());
        let (up, down) = ((switched + grown) / 2.0, (switched - grown) / 2.0);
        let [rise, fall] = &self.fresh;
        self.left[0] -= up * rise.left;
        self.left[1] += down * fall.left;
        held + down * fall.amplified - up * rise.amplified
    }
}

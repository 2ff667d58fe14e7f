#![doc = include_str!("../README.md")]
//!
//! [`Gateware`] is the whole FPGA seen from its pins: registers and frames on the host port, LED
//! lines, ADC, interlock. One [`Gateware::tick`] is one ADC clock of 8 ns. The virtual camera runs
//! on this model, and the RTL is checked against the model.
//!
//! The model takes every address, bit, code and offset from [`nirspi_wire::register`] and
//! [`nirspi_wire::fpga`]. Each module below is one block of the RTL:
//!
//! ```text
//!  host port ── registers ── settings (copied at a start)
//!                   │            │
//!              order table ── sequencer ── leds ──────────── row and column lines
//!                                              └─ safety ─── enable (watchdog, duty, over-range, interlock)
//!  ADC ─ source ─ window (latency, blanking, slot sum) ── frames (three banks) ── format ── host port
//!            └─── raw ──────────────────────────────────────────────────────────────────── host port
//!                                                                  frames ── parallel ──── parallel port
//! ```
//!
//! # Where the register map is silent
//! * Accesses happen between two clocks. A start takes effect with the next clock, which is clock 0 of
//!   the run; stop, fault and open interlock switch the LEDs off before the next clock.
//! * A run of finite length is under way, LEDs off, until the samples of its last `Latency` clocks are in.
//! * An accepted start drops every frame and raw burst of earlier runs, unreleased ones too. A refused one
//!   changes nothing but `CONFIG_ERROR`, and that only if nothing but a setting was in its way.
//! * Every setting is checked at every start, of raw bursts too; an undefined bit of `Mode` is out of range.
//!   A `DutyLimit` of 0 is not: it trips on the first lit clock.
//! * Only an access ends the watchdog's count, and every one does, also to an address that does not exist.
//!   LEDs are lit for exactly `Watchdog` clocks after the last one.
//! * A fault in the clock that completes a frame or a raw burst discards it. Of several faults in one clock
//!   the first of interlock, over-range, duty, watchdog is latched.
//! * `RELEASE` gives back frame and raw burst.
//! * A raw burst goes on from sweep to sweep until it is long enough; `Sweeps` and `Frames` do not end it.
//! * The count of over-range samples stops at 2^32 - 1. Frame counters wrap. Samples of the test generator
//!   are never over range.
//! * Writing a read-only register does nothing. The order table is all 0 after power-up, keeps ten bits of
//!   what is written and is not checked: a pattern in it twice is shown twice.
//! * Outside a run all LED lines are 0.
//!
//! The RTL may take a few clocks more than the model from the last sample of a frame to `FRAME_READY`, and
//! from a pin or the host port to its effect; lines, attribution of samples and bytes of frames are exact.
//!
//! # The RTL
//! `hdl/rtl` has the gateware in Veryl, and `hdl/sv` the SystemVerilog emitted from it.
//! `hdl/sim/tests/rtl` runs the RTL in Veryl's simulator beside this model and compares both, pin
//! by pin and clock by clock. The tests there bound the RTL's delays:
//!
//! - Clock 0 of a run comes 14 clocks after the access that starts the run.
//! - LEDs are lit up to 9 clocks longer after a stop, and up to 7 after a trip.
//! - LEDs go out 3 clocks after the interlock pin opens.
//! - Lines are at the pins 6 clocks after the choice of a slot. `Latency` counts from there: 0 is a
//!   sample that is at the ADC's pins in the clock in which its light is at the LEDs' pins.

mod format;
mod frames;
mod gateware;
mod leds;
mod order;
mod packet;
mod parallel;
mod raw;
mod registers;
mod safety;
mod sequencer;
mod settings;
mod source;
mod window;

pub use gateware::Gateware;
pub use leds::Lines;
pub use packet::{Stamp, packet};
pub use parallel::on_lines;
pub use source::AdcSample;

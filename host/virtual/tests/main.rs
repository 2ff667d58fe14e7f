//! Tests of the virtual camera as its users see it.

mod budget;
mod calibration;
mod circuit;
mod edges;
mod flat_field;
mod moving;
mod selftest;
mod stray;

//! The camera against a scripted FPGA and a scripted link.

mod commands;
mod configuring;
mod crash;
mod fake_ecp5;
pub(crate) mod fake_fpga;
mod frames;
mod host_port;
mod laws;
mod loading;
mod merge;
mod model;
mod packets;
mod patience;
mod safety;
mod selftest;
pub(crate) mod support;
mod versions;
mod wires;

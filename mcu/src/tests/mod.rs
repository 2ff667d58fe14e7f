//! The camera against a scripted FPGA and a scripted link.

mod access;
mod bitstreams;
mod commands;
mod configuring;
mod crash;
mod fake_ecp5;
pub(crate) mod fake_fpga;
mod frames;
mod host_port;
mod lamps;
mod laws;
mod loading;
mod merge;
mod model;
mod packets;
mod patience;
mod ports;
mod safety;
mod selftest;
mod silence;
mod streamed;
pub(crate) mod support;
mod timing;
mod versions;
mod width;
mod wires;

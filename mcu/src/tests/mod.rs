//! The camera against a scripted FPGA and a scripted link.

mod commands;
mod fake_fpga;
mod frames;
mod laws;
mod loading;
mod safety;
mod selftest;
mod support;

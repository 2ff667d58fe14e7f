//! The program as its users meet it: the real binary, real processes, real sockets, real files.
//!
//! # Invariant
//! Every wait is bounded, and no process outlives its test (`bench::Process`).

#![allow(clippy::unwrap_used)] // helpers of tests are tests

mod arguments;
mod bad_files;
mod bench;
mod calibrate;
mod camera_model;
mod capture_files;
mod capture_tcp;
mod cases;
mod demo;
mod dishonest_cameras;
mod doors;
mod effects;
#[cfg(unix)]
mod ends;
mod enhance;
mod everyday;
mod exports;
mod feed;
mod figures;
mod foreign_devices;
mod forms;
mod help;
mod inspect;
mod many;
mod metrics;
mod options;
mod other_forms;
mod own_patterns;
mod packaging;
mod pairs;
#[cfg(unix)]
mod preview;
mod provenance;
mod quality;
mod rain;
mod readings;
mod readme;
mod real_data;
mod reconstruct;
// The page is of a build with the default features.
#[cfg(not(feature = "flash"))]
mod reference;
mod report_page;
mod selftest;
#[cfg(unix)]
mod serial;
mod serve;
mod serve_controls;
mod serve_feed;
mod serve_guarded;
mod serve_proxied;
mod settings;
mod sparse_problems;
mod split;
mod traces;
mod update;
mod versions;
mod weights;

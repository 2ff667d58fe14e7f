//! The files of the live page and of recordings by which threads hand things over, as they are in `host`, with the threads and locks of
//! the model checker `loom`.
#![allow(dead_code, reason = "the files have parts that only the program uses")]

// The files name each other by their own crates.
extern crate self as nirspi;
extern crate self as nirspi_camera;

#[path = "../../../host/camera/src/account.rs"]
pub mod account;

pub mod recording;
pub mod serve;

//! The files of the live page and of recordings by which threads hand things over, as they are in `host`, with the threads and locks of
//! the model checker `loom`.
#![allow(dead_code, reason = "the files have parts that only the program uses")]

#[path = "../../../host/src/account.rs"]
// Files of `nirspi-serve` name the crate `nirspi`.
extern crate self as nirspi;

pub mod account;

pub mod recording;
pub mod serve;

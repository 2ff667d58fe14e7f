//! The laws, by what they read.

pub mod camera;
pub mod descriptions;
pub mod feeds;
pub mod gateware;
pub mod measurements;
pub mod pictures;
pub mod recordings;
pub mod service;
pub mod weights;
pub mod wire;

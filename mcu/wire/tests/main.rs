//! Tests of the contract as both of its sides see it.

mod bits;
mod bounds;
mod frames;
mod frozen;
mod packets;
mod ready;
mod register_map;

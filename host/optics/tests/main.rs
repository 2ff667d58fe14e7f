//! Tests of the crate as its users see it.

mod adc_noise;
mod array;
mod chain;
mod depth;
mod edges;
mod mie;
mod motion;
mod projector;
mod rain;
mod range;
mod scene_in_rain;
mod through_the_noise;

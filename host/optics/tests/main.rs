//! Tests of the crate as its users see it.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

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

use nirspi_optics::rain::BeamShadows;
use nirspi_optics::{Footprint, LEDS, Projector, SIDE, Scene};

/// A footprint in which every LED sees something of its own.
fn footprint() -> Footprint {
    let pixels = (0..LEDS).map(|i| (i * 7919 % 1000) as f32 / 1000.0).collect();
    let scene = Scene::new(pixels, SIDE, 48.0).unwrap();
    Projector::default().footprint(&scene, 300.0).unwrap()
}

fn beams(distance_mm: f64) -> BeamShadows {
    let projector = Projector::default();
    BeamShadows { projector, distance_mm, baseline_mm: 40.0, collector_mm: 1.66 }
}

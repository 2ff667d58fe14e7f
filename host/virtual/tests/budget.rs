//! The photon budget is that of the camera that is simulated: the same signal and the same noise, term for term.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use nirspi_optics::Scene;
use nirspi_optics::pixel::PixelBudget;
use nirspi_optics::rain::{Drops, Weather};
use nirspi_optics::water::Water;
use nirspi_recon::{Order, reconstruct};
use nirspi_virtual::{CameraModel, VirtualOptics, calibrate_against_white, shoot};
use std::ops::ControlFlow;

/// Pictures of a white sheet through the whole virtual camera: mean pixel and noise of a pixel of one picture.
fn simulated(camera: &CameraModel, distance_mm: f64, sweeps: u32, pictures: u32) -> (f64, f64) {
    let optics = VirtualOptics::of(camera, Scene::white(), distance_mm).unwrap();
    let settling = calibrate_against_white(&optics, 5).unwrap();
    let setup = optics.setup(&Order::Natural, 1.0).unwrap();
    let (mut sum, mut squares, mut pixels) = (0.0, 0.0, 0.0);
    for seed in 0..pictures {
        let mut go_on = |_: &_| ControlFlow::Continue(());
        let shot =
            shoot(&optics, setup.clone(), &settling, sweeps, u64::from(seed), &mut go_on).unwrap();
        let image = reconstruct::hadamard(&shot.measurements().unwrap());
        // Pixel (0, 0) shows the difference of rise and fall, where there is one.
        let values: Vec<f64> = image.pixels().iter().skip(1).map(|&v| f64::from(v)).collect();
        let mean = values.iter().sum::<f64>() / 1023.0;
        sum += mean;
        squares += values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
        // Their mean takes one degree of freedom.
        pixels += 1022.0;
    }
    (sum / f64::from(pictures), (squares / pixels).sqrt())
}

#[test]
fn the_budget_is_that_of_the_camera_simulated() {
    let one_metre = CameraModel::named("one-metre").unwrap();
    let paper = CameraModel::paper();
    // LEDs that rise unlike they fall, and a supply that sags more than any that could be built.
    let uneven = CameraModel::parse(
        "name = \"uneven\"\n[leds]\nrise_ns = 12.8\nfall_ns = 16.4\nturn_on_delay_ns = 1.2\ntile_sag = 0.15",
    )
    .unwrap();
    // Far away many sweeps are needed to know the signal: it shows in one of 1024 coefficients alone.
    let cases = [
        (paper, 300.0, 20),
        (paper, 600.0, 100),
        (paper, 1000.0, 600),
        (&one_metre, 1000.0, 12),
        (&uneven, 300.0, 20),
    ];
    for (camera, distance_mm, sweeps) in cases {
        let dry = Weather::new(Drops::none(), camera.wavelength_nm, Water::Segelstein).unwrap();
        let shown_us = f64::from(camera.readout.clocks_per_pattern) * 8e-3 * f64::from(sweeps);
        let budget =
            PixelBudget::new(&camera.instrument(), &dry, distance_mm, 1.0, shown_us).unwrap();
        let (signal, noise) = simulated(camera, distance_mm, sweeps, 8);
        let (found, expected) = (signal / noise, budget.pixel_snr);
        println!("{} at {distance_mm} mm: SNR {found:.3}, budget {expected:.3}", camera.name);
        assert!(
            (found / expected - 1.0).abs() < 0.03,
            "{}, {distance_mm} mm: {found} against {expected}",
            camera.name
        );
    }
}

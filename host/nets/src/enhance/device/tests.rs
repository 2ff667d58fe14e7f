//! Tests on the GPUs of this machine, including software Vulkan; without any, the tests are skipped
//! with a message.

use nirspi_recon::omp::gpu;

use super::super::tests::{cross, enhancer, seen};
use super::*;
use crate::consistency::MeasuredRows;
use crate::images::Images;

fn on(device: &Device) -> DeviceEnhancer {
    let [fsrcnn, estimator, bridge] =
        ["fsrcnn", "estimator", "diffusion"].map(|model| Weights::embedded(model).unwrap());
    DeviceEnhancer::new(device, &fsrcnn, &estimator, &bridge).unwrap()
}

fn devices() -> Vec<(Device, gpu::Device)> {
    let open = |backend| match (Device::open(backend), gpu::Device::open(backend)) {
        (Ok(networks), Ok(Some(omp))) => Some((networks, omp)),
        (absent, _) => {
            eprintln!("skipped: {}", absent.unwrap_err());
            None
        }
    };
    [Backend::Wgpu, Backend::Cuda].into_iter().filter_map(open).collect()
}

fn apart(a: &[f32], b: &[f32]) -> f32 {
    assert_eq!(a.len(), b.len());
    let apart = a.iter().zip(b).map(|(a, b)| (a - b).abs());
    // NaN counts as the largest possible difference.
    apart.map(|apart| if apart.is_nan() { f32::INFINITY } else { apart }).fold(0.0, f32::max)
}

#[test]
fn images_that_are_there_become_what_the_processor_makes_of_them() {
    let readings: Vec<f32> = (0..3).flat_map(|i| seen(&cross(), i as f32, 0.02, i)).collect();
    let depth = DepthMaps::new(vec![0.6; 64], [1, 8, 8], 3).unwrap();
    // Half of the patterns.
    let rows: Vec<u32> = (0..512).collect();
    let measured = MeasuredRows::new(fusion::SIDE, &rows).unwrap();
    let halved = Options { measured, ..Options::default() };
    let white = 2.5;
    let bright: Vec<f32> = readings.iter().map(|v| v * white).collect();
    for (device, omp) in devices() {
        let mut there = on(&device);
        // One batch of two images, and a smaller one.
        there.batch = 2;
        let images = DeviceImages::upload(&omp, &bright, fusion::SIDE * fusion::SIDE).unwrap();
        for (depth, options) in [(Some(&depth), &Options::default()), (None, &halved)] {
            let mut told = Vec::new();
            let ours =
                there.enhance(&images, white, depth, options, &mut |done| told.push(done)).unwrap();
            let seen = Images::new(&readings).unwrap();
            let theirs = enhancer(1).enhance(seen, depth, options, &mut |_| {}).unwrap();
            // The batches are counted as each ends; at the end all are.
            assert_eq!(told.last(), Some(&3));
            assert!(told.is_sorted(), "{told:?}");
            for (ours, theirs) in ours.estimates.iter().zip(&theirs.estimates) {
                assert!((ours.sigma_px - theirs.sigma_px).abs() < 1e-3, "{ours:?} {theirs:?}");
                assert!((ours.noise - theirs.noise).abs() < 1e-4, "{ours:?} {theirs:?}");
            }
            let start = apart(&ours.upscaled.unwrap(), &theirs.upscaled.unwrap());
            let sharp = apart(&ours.images, &theirs.images);
            let inconsistency = apart(&ours.inconsistency, &theirs.inconsistency);
            assert!(start < 1e-4 && sharp < 2e-3, "{start} {sharp}");
            assert!(inconsistency < 1e-2, "{inconsistency}");
        }
    }
}

#[test]
fn where_the_agreement_does_not_fit_the_device_the_processor_makes_it_and_the_user_is_told() {
    let weights =
        ["fsrcnn", "estimator", "diffusion"].map(|model| Weights::embedded(model).unwrap());
    let readings = seen(&cross(), 1.0, 0.02, 0);
    for (device, omp) in devices() {
        let images = DeviceImages::upload(&omp, &readings, fusion::SIDE * fusion::SIDE).unwrap();
        let [fsrcnn, estimator, bridge] = &weights;
        let engine = device.engine().unwrap();
        let mut chain = Chain::new(&device, &engine, [fsrcnn, estimator, bridge]).unwrap();
        chain.limits.shared_bytes = 16 << 10;
        let small = DeviceEnhancer { chain, ..on(&device) };
        let enhance = |by: &DeviceEnhancer| {
            by.enhance(&images, 1.0, None, &Options::default(), &mut |_| {}).unwrap()
        };
        let theirs = enhance(&on(&device));
        let _ = device.notes();
        let ours = enhance(&small);
        assert!(apart(&ours.images, &theirs.images) < 2e-4);
        assert!(apart(&ours.inconsistency, &theirs.inconsistency) < 1e-3);
        let notes = device.notes();
        let [note] = &notes[..] else { panic!("{notes:?}") };
        let note = note.to_string();
        assert!(note.ends_with("the CPU computes the agreement with the readings"), "{note}");
    }
}

#[test]
fn a_reading_that_is_not_a_number_stays_none() {
    for (device, _) in devices() {
        // What `DeviceImages::upload` refuses, a kernel of OMP could still leave on the device.
        let engine = device.engine().unwrap();
        let mut readings = vec![0.5; 2 * 1024];
        readings[1024 + 7] = f32::NAN;
        let there = engine.upload(&readings);
        let part = engine.readings(&there, 0, 1.0, 2048);
        let back = engine.read(&[&part]).unwrap();
        assert!(back[0].floats()[1024 + 7].is_nan());
        assert_eq!(back[0].floats()[..1024], readings[..1024]);
    }
}

#[test]
fn what_cannot_be_enhanced_there_is_refused() {
    let weights = Weights::embedded("fsrcnn").unwrap();
    let on_cpu = DeviceEnhancer::new(&Device::cpu(), &weights, &weights, &weights);
    assert!(matches!(on_cpu, Err(DeviceEnhancerError::NoGpu)));
    for (device, omp) in devices() {
        let there = on(&device);
        let refuse = |pixels, white, options: &Options| {
            let images = DeviceImages::upload(&omp, &vec![0.5; pixels], pixels).unwrap();
            there.enhance(&images, white, None, options, &mut |_| {}).unwrap_err()
        };
        let options = Options::default();
        let size = refuse(64 * 64, 1.0, &options).to_string();
        assert_eq!(size, "images of 4096 pixels, expected 32 x 32");
        for white in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert!(matches!(refuse(1024, white, &options), DeviceEnhancerError::White { .. }));
        }
        let copies = Options { copies: 2, ..options };
        assert!(matches!(refuse(1024, 1.0, &copies), DeviceEnhancerError::Copies));
    }
}

//! Times the same path on a GPU: measurements are transferred to the GPU, enhanced images come
//! back.

use super::{Measured, Timed, Times, Work, enhanced, scenes};
use crate::error::Result;
use nirspi_nets::{DeviceEnhancer, Enhancer};
use nirspi_recon::Side;
use nirspi_recon::omp::gpu::{Device, DeviceDictionary, DeviceImages};

/// Times `work` on a GPU, where images stay from the pursuit to the networks. Also times the same
/// work with images brought to the host in between, which `on_host` enhances.
///
/// # Errors
/// `EvalError` if the device fails.
pub fn on_gpu(
    work: &Work,
    device: &Device,
    on_device: &DeviceEnhancer,
    on_host: &Enhancer,
) -> Result<Timed> {
    let dictionary = DeviceDictionary::new(device, work.matrix.clone(), true)?;
    let pictures = dictionary.upload_pictures(&scenes::cosines(), Side::INSTRUMENT.area())?;

    // The choices of f32 are used: if f32 cannot decide between two atoms, the image is equally
    // good with either.
    let reconstruct = || -> Result<Vec<DeviceImages>> {
        Ok(dictionary.in_turns(work.limits.sparsity, &work.y, |y| {
            let solutions = dictionary.pursue(&work.limits, &dictionary.upload(y)?)?;
            dictionary.images(&solutions, Some(&pictures))
        })?)
    };
    let brought = || -> Result<Vec<f32>> {
        let turns = reconstruct()?;
        let images = turns.iter().map(|turn| Ok(turn.download()?.to_vec()));
        Ok(images.collect::<Result<Vec<_>>>()?.concat())
    };
    let whole = || -> Result<Vec<f32>> {
        let turns = reconstruct()?;
        let images = turns
            .iter()
            .map(|turn| Ok(on_device.enhance(turn, 1.0, None, &work.options, &mut |_| {})?.images));
        Ok(images.collect::<Result<Vec<_>>>()?.concat())
    };
    let through_host = || enhanced(on_host, &brought()?, &work.options);
    let first_ms = Times::of(1, whole).median_ms;
    let reconstructed = brought()?;
    let pairs = whole()?.into_iter().zip(through_host()?);
    let largest_difference = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    work.timed(Measured {
        first_ms,
        whole: Times::of(work.settings.repeats, whole),
        reconstruct: Times::of(work.settings.repeats, brought),
        enhance: Times::of(work.settings.repeats, || {
            enhanced(on_host, &reconstructed, &work.options)
        }),
        through_host: Some(Times::of(work.settings.repeats, through_host)),
        largest_difference: Some(largest_difference),
        reconstructed,
    })
}

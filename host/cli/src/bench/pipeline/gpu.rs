//! The same on a GPU: measurements go there, enhanced images come back.

use super::{Networks, Timed, Times, Work, enhanced, enhancer, scenes};
use anyhow::{Context, Result};
use nirspi_nets::Backend;
use nirspi_recon::Side;
use nirspi_recon::omp::gpu::{Device, DeviceDictionary, DeviceImages};

/// What `work` takes on the device of the networks, and whether the processor plays it.
pub fn time(work: &Work, backend: Backend, networks: &mut Networks) -> Result<(Timed, bool)> {
    let device = Device::open(backend)?.context("the networks' device is none for OMP")?;
    let dictionary = DeviceDictionary::new(&device, work.matrix.clone(), true)?;
    let pictures = dictionary.upload_pictures(&scenes::cosines(), Side::INSTRUMENT.area())?;
    let (there, here) = (networks.device_enhancer()?, enhancer(networks)?);

    // As f32 finds them: where it cannot decide between two atoms, an image is as good with either.
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
            .map(|turn| Ok(there.enhance(turn, 1.0, None, &work.options, &mut |_| {})?.images));
        Ok(images.collect::<Result<Vec<_>>>()?.concat())
    };
    let through_host = || enhanced(&here, &brought()?, &work.options);
    let first_ms = Times::of(1, whole).median_ms;
    let reconstructed = brought()?;
    let pairs = whole()?.into_iter().zip(through_host()?);
    let largest_difference = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    let timed = Timed {
        first_ms,
        whole: Times::of(work.repeats, whole),
        reconstruct: Times::of(work.repeats, brought),
        enhance: Times::of(work.repeats, || enhanced(&here, &reconstructed, &work.options)),
        through_host: Some(Times::of(work.repeats, through_host)),
        largest_difference: Some(largest_difference),
        reconstructed,
    };
    Ok((timed, device.is_software()))
}

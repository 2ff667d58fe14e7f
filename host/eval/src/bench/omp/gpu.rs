//! Times the same problem on a GPU, including the transfer of measurements to the GPU, and of
//! solutions and images back.

use super::super::{milliseconds, scenes};
use super::{Precision, Report, Settings, Timed, matrix, report};
use crate::error::Result;
use nirspi::problem::ProblemFile;
use nirspi_recon::Side;
use nirspi_recon::omp::gpu::{Device, DeviceDictionary, DevicePictures};
use nirspi_recon::omp::{BackendError, Limits, Solution};
use std::time::Instant;

/// Times `problem` on a GPU, after a run to warm up.
///
/// # Errors
/// [`Precision::F64`], which the kernels do not have, or a device that fails.
pub fn on_gpu(problem: &ProblemFile, settings: &Settings, device: &Device) -> Result<Report> {
    if settings.precision == Precision::F64 {
        return Err(BackendError::Precision.into());
    }
    let start = Instant::now();
    let dictionary = DeviceDictionary::new(device, matrix(problem), settings.normalise)?;
    let prepare_ms = milliseconds(start);
    // Without pictures of the atoms, an image has the coefficients at the atoms' positions.
    let pictures = settings.cosines.then(|| cosines(&dictionary)).transpose()?;
    let solve = || solve(settings, problem, &dictionary, pictures.as_ref());
    let (mut solutions, mut solved_in_f64, pixels) = solve()?;
    let mut times_ms = Vec::new();
    for _ in 0..settings.repeats.max(1) {
        let start = Instant::now();
        (solutions, solved_in_f64, _) = solve()?;
        times_ms.push(milliseconds(start));
    }
    let frames = (problem.frames.len() / problem.measurements) as f64;
    // An index, a step, a pivot and a coefficient for each atom, and the result of the search.
    let solution = 4 * problem.sparsity * 4 + 36;
    // In double precision too, for the referee.
    let of_measurement = if settings.precision == Precision::F32 { 4 } else { 12 };
    let transferred_bytes_per_frame =
        (of_measurement * problem.measurements + solution) as f64 + 4.0 * pixels as f64 / frames;
    let timed = Timed {
        backend: device.backend(),
        device: Some(device.name().to_owned()),
        software: device.is_software(),
        prepare_ms,
        times_ms,
        solutions,
        solved_in_f64,
        transferred_bytes_per_frame,
    };
    Ok(report(settings, problem, timed))
}

/// The solutions, the number of double-precision solutions, and the number of transferred pixels.
fn solve(
    settings: &Settings,
    problem: &ProblemFile,
    dictionary: &DeviceDictionary,
    pictures: Option<&DevicePictures>,
) -> Result<(Vec<Solution>, usize, usize)> {
    let limits = Limits::atoms(problem.sparsity);
    let solved = dictionary.in_turns(problem.sparsity, &problem.frames, |y| {
        let there = match settings.precision {
            Precision::F32 => dictionary.upload(y)?,
            _ => dictionary.upload_exact(y)?,
        };
        let there = dictionary.pursue(&limits, &there)?;
        let images = dictionary.images(&there, pictures)?;
        let (found, doubtful) = dictionary.download_with_doubts(&there)?;
        Ok((found, doubtful, images.download()?.len()))
    })?;
    let (mut solutions, mut doubtful, mut pixels) = (Vec::new(), Vec::new(), 0);
    for (mut found, doubts, back) in solved {
        doubtful.extend(doubts.into_iter().map(|i| solutions.len() + i));
        solutions.append(&mut found);
        pixels += back;
    }
    match settings.precision {
        Precision::F32 => doubtful.clear(),
        _ => dictionary.settle(&limits, &problem.frames, &doubtful, &mut solutions)?,
    }
    Ok((solutions, doubtful.len(), pixels))
}

/// Pictures of the atoms of a random problem.
fn cosines(dictionary: &DeviceDictionary) -> Result<DevicePictures> {
    Ok(dictionary.upload_pictures(&scenes::cosines(), Side::INSTRUMENT.area())?)
}

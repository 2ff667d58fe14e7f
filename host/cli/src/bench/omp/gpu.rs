//! The same problem on a GPU: measurements go there, solutions and images come back, and all of it is timed.

use super::super::{milliseconds, scenes};
use super::{Args, Precision, Timed, matrix};
use anyhow::Result;
use nirspi::files::problem::ProblemFile;
use nirspi_recon::Side;
use nirspi_recon::omp::gpu::{Device, DeviceDictionary, DevicePictures};
use nirspi_recon::omp::{BackendError, Limits, Solution};
use std::time::Instant;

/// Solves `problem` on `device` as often as asked for, once more to warm up.
pub fn time(args: &Args, problem: &ProblemFile, device: &Device) -> Result<Timed> {
    if args.precision == Precision::F64 {
        return Err(BackendError::Precision.into());
    }
    let start = Instant::now();
    let dictionary = DeviceDictionary::new(device, matrix(problem), args.normalises())?;
    let prepare_ms = milliseconds(start);
    let pictures = match &args.input {
        None => Some(cosines(&dictionary)?),
        // Nobody knows what its atoms look like: an image is the coefficients at their places.
        Some(_) => None,
    };
    let solve = || solve(args, problem, &dictionary, pictures.as_ref());
    let (mut solutions, mut solved_in_f64, pixels) = solve()?;
    let mut times_ms = Vec::new();
    for _ in 0..args.repeats {
        let start = Instant::now();
        (solutions, solved_in_f64, _) = solve()?;
        times_ms.push(milliseconds(start));
    }
    let frames = (problem.frames.len() / problem.measurements) as f64;
    // An index, a step, a pivot and a coefficient for each atom, and what the search ended with.
    let solution = 4 * problem.sparsity * 4 + 32;
    let transferred_bytes_per_frame =
        (4 * problem.measurements + solution) as f64 + 4.0 * pixels as f64 / frames;
    Ok(Timed {
        backend: device.backend(),
        device: Some(device.name().to_owned()),
        software: device.is_software(),
        prepare_ms,
        times_ms,
        solutions,
        solved_in_f64,
        transferred_bytes_per_frame,
    })
}

/// Solutions, how many of them took double precision, and how many pixels came back.
fn solve(
    args: &Args,
    problem: &ProblemFile,
    dictionary: &DeviceDictionary,
    pictures: Option<&DevicePictures>,
) -> Result<(Vec<Solution>, usize, usize)> {
    let limits = Limits::atoms(problem.sparsity);
    let solved = dictionary.in_turns(problem.sparsity, &problem.frames, |y| {
        let there = dictionary.pursue(&limits, &dictionary.upload(y)?)?;
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
    match args.precision {
        Precision::F32 => doubtful.clear(),
        _ => dictionary.settle(&limits, &problem.frames, &doubtful, &mut solutions)?,
    }
    Ok((solutions, doubtful.len(), pixels))
}

/// What the atoms of a random problem look like.
fn cosines(dictionary: &DeviceDictionary) -> Result<DevicePictures> {
    Ok(dictionary.upload_pictures(&scenes::cosines(), Side::INSTRUMENT.area())?)
}

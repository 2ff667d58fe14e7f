//! The images of a stack: the frames of a recording, or the measurements of a file.
//!
//! Much of what a method finds out is the same for like measurements, and finding it out takes longer
//! than making an image: the noise, how fast amplitudes fall, OMP's number of atoms. So it is found
//! out once for a kind.
//!
//! # What a kind is
//! Measurements of the same rows, whose sizes (roots of the sums of squares) are within a [factor](LIKE)
//! of two of the middle one. Measurements of other sizes are made by themselves, and so are kinds of
//! fewer than [`LEAST`] measurements. What is found out is that of a [sample](super::kind::SAMPLE), evenly chosen: the
//! mean falloff, and the noise: that by which repeated measurements of one scene differ
//! ([`Repeats`](crate::Repeats)), but no more than each can have, else the middle one of the sample. It is found out anew every [`AT_A_TIME`] measurements, so that a
//! long recording may change, and takes no more memory than a short one.
//!
//! # Invariant
//! Images are in the order of the measurements, whatever the number of threads, and measurements that
//! are alone in their kind have the image that [`Reconstruct::reconstruct`] gives
//! (`tests::a_stack_has_the_images_of_its_kinds_in_order`).

use super::kind::{GoingOn, sample};
use super::noise;
use super::{Reconstruct, ReconstructError, Reconstruction};
use crate::Measurements;
use crate::measurements::Kind;
use crate::repeats::noise_of_repeats;
use rayon::prelude::*;
use std::borrow::Cow;
use std::collections::HashMap;

/// Measurements that are looked at together. A longer stack is made in parts of this number, so a
/// caller who gives parts of this number gets the same images.
pub const AT_A_TIME: usize = 4096;

/// The fewest measurements that are a kind.
const LEAST: usize = 8;

/// The largest ratio of the sizes of a measurement and the middle one of its kind.
const LIKE: f64 = 2.0;

/// Images of all measurements by one method, in their order.
///
/// # Errors
/// As [`Reconstruct::reconstruct`], of the first measurement that has no image.
pub fn stack(
    method: &dyn Reconstruct,
    measurements: &[Measurements],
) -> Result<Vec<Reconstruction>, ReconstructError> {
    stack_while(method, measurements, &|| Ok(()))
}

/// As [`stack`]; `going_on` is called before each image, from any thread.
///
/// # Errors
/// As [`stack`]; and the error of `going_on`.
pub fn stack_while(
    method: &dyn Reconstruct,
    measurements: &[Measurements],
    going_on: GoingOn<'_>,
) -> Result<Vec<Reconstruction>, ReconstructError> {
    if method.is_of_each() {
        return each(method, measurements, going_on);
    }
    let parts = measurements.chunks(AT_A_TIME).map(|part| part_of_stack(method, part, going_on));
    Ok(parts.collect::<Result<Vec<_>, _>>()?.into_iter().flatten().collect())
}

fn part_of_stack(
    method: &dyn Reconstruct,
    measurements: &[Measurements],
    going_on: GoingOn<'_>,
) -> Result<Vec<Reconstruction>, ReconstructError> {
    let mut made: Vec<Option<Reconstruction>> = vec![None; measurements.len()];
    let (kinds, alone) = kinds(measurements);
    for positions in kinds {
        let of_kind: Vec<Measurements> =
            positions.iter().map(|&k| measurements[k].clone()).collect();
        let images = method.reconstruct_kind(&of_kind, going_on)?;
        positions.into_iter().zip(images).for_each(|(k, image)| made[k] = Some(image));
    }
    let one = |&k: &usize| going_on().and_then(|()| method.reconstruct(&measurements[k]));
    let images: Vec<Reconstruction> = alone.par_iter().map(one).collect::<Result<_, _>>()?;
    alone.into_iter().zip(images).for_each(|(k, image)| made[k] = Some(image));
    Ok(made.into_iter().flatten().collect())
}

/// The image of each measurement by itself.
pub(super) fn each(
    method: &dyn Reconstruct,
    measurements: &[Measurements],
    going_on: GoingOn<'_>,
) -> Result<Vec<Reconstruction>, ReconstructError> {
    let one = |measured| going_on().and_then(|()| method.reconstruct(measured));
    measurements.par_iter().map(one).collect()
}

/// The positions of each kind, and of the measurements that are made by themselves.
fn kinds(measurements: &[Measurements]) -> (Vec<Vec<usize>>, Vec<usize>) {
    let mut by_rows: HashMap<&[u32], Vec<usize>> = HashMap::new();
    for (k, measured) in measurements.iter().enumerate() {
        by_rows.entry(measured.rows()).or_default().push(k);
    }
    let (mut kinds, mut alone) = (Vec::new(), Vec::new());
    for positions in by_rows.into_values() {
        let sizes: Vec<f64> = positions.iter().map(|&k| size(&measurements[k])).collect();
        let mut sorted = sizes.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        let middle = sorted[sorted.len() / 2];
        let is_like = |size: f64| size <= LIKE * middle && middle <= LIKE * size;
        let (like, other): (Vec<_>, Vec<_>) =
            positions.into_iter().zip(sizes).partition(|&(_, size)| size > 0.0 && is_like(size));
        let position = |(k, _)| k;
        alone.extend(other.into_iter().map(position));
        let like: Vec<usize> = like.into_iter().map(position).collect();
        match like.len() >= LEAST {
            true => kinds.push(like),
            false => alone.extend(like),
        }
    }
    // In an order that does not depend on the map's.
    kinds.sort_unstable();
    alone.sort_unstable();
    (kinds, alone)
}

fn size(measured: &Measurements) -> f64 {
    measured.values().iter().map(|value| value * value).sum::<f64>().sqrt()
}

/// Measurements of one kind, with the noise that they have in common; as they are if the camera measured
/// the noise of each.
pub(super) fn with_common_noise(measurements: &[Measurements]) -> Cow<'_, [Measurements]> {
    match measurements.iter().all(|measured| measured.noise().is_some()) {
        true => Cow::Borrowed(measurements),
        false => Cow::Owned(with_statistics(measurements)),
    }
}

/// Measurements of one kind, with the noise and the falloff that they have in common.
pub(super) fn with_statistics(measurements: &[Measurements]) -> Vec<Measurements> {
    let some: Vec<usize> = sample(measurements.len()).collect();
    let found: Vec<Kind> = some.par_iter().map(|&k| noise::estimated(&measurements[k])).collect();
    let falloff = found.iter().map(|kind| kind.falloff).sum::<f64>() / found.len() as f64;
    let middle = |mut of_some: Vec<f64>| {
        of_some.sort_unstable_by(f64::total_cmp);
        of_some[of_some.len() / 2]
    };
    // Like scenes that are not the same differ by more than noise.
    let most = || middle(some.iter().map(|&k| noise::most(&measurements[k])).collect());
    let noise = match noise_of_repeats(measurements) {
        Some(noise) => noise.min(most()),
        None => middle(found.iter().map(|kind| kind.noise).collect()),
    };
    let kind = Kind { noise, falloff };
    measurements.iter().cloned().map(|measured| measured.of_kind(kind)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reconstruct::{Method, MethodSettings};
    use crate::testing::{noisy, scene, side};
    use crate::{Order, Rows};
    use std::sync::Mutex;
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// Remembers the sizes of the kinds that it was asked for.
    struct Told(Box<dyn Reconstruct>, Mutex<Vec<usize>>);

    impl Reconstruct for Told {
        fn name(&self) -> &str {
            self.0.name()
        }

        fn reconstruct(&self, one: &Measurements) -> Result<Reconstruction, ReconstructError> {
            self.0.reconstruct(one)
        }

        fn reconstruct_kind(
            &self,
            all: &[Measurements],
            going_on: GoingOn<'_>,
        ) -> Result<Vec<Reconstruction>, ReconstructError> {
            self.1.lock().unwrap().push(all.len());
            self.0.reconstruct_kind(all, going_on)
        }
    }

    fn prepared(method: Method) -> Told {
        Told(method.prepare(&MethodSettings::default()).unwrap(), Mutex::default())
    }

    fn rows(share: f64) -> Rows {
        let all = Order::ZigZag.rows(side(16)).unwrap();
        all.first((share * all.len() as f64) as usize)
    }

    #[test]
    fn a_stack_has_the_images_of_its_kinds_in_order() {
        let scene = scene(side(16), 1);
        // Frames of two sets of rows, and one ten times as bright, in turn.
        let frames: Vec<Measurements> = (0..40)
            .map(|k| match k {
                7 => {
                    let bright: Vec<f64> = scene.iter().map(|value| 10.0 * value).collect();
                    noisy(&rows(0.5), &bright, 0.5, k)
                }
                _ if k % 4 == 0 => noisy(&rows(0.3), &scene, 0.5, k),
                _ => noisy(&rows(0.5), &scene, 0.5, k),
            })
            .collect();
        let method = prepared(Method::HADAMARD);
        let made = stack(&method, &frames).unwrap();
        let alone = frames.iter().map(|frame| method.reconstruct(frame).unwrap());
        assert!(
            made.iter()
                .map(|made| &made.image)
                .eq(&alone.map(|made| made.image).collect::<Vec<_>>())
        );
        let mut kinds = method.1.into_inner().unwrap();
        kinds.sort_unstable();
        assert_eq!(kinds, [10, 29]);
        // The one that is alone has the image that it has by itself.
        let method = prepared(Method::OMP);
        assert_eq!(stack(&method, &frames).unwrap()[7], method.reconstruct(&frames[7]).unwrap());
    }

    #[test]
    fn few_measurements_and_dark_ones_are_made_by_themselves() {
        let scene = scene(side(16), 1);
        let few: Vec<Measurements> = (0..7).map(|k| noisy(&rows(0.5), &scene, 0.5, k)).collect();
        let dark = vec![noisy(&rows(0.5), &vec![0.0; 256], 0.0, 1); 9];
        for frames in [few, dark, Vec::new()] {
            let method = prepared(Method::OMP);
            let made = stack(&method, &frames).unwrap();
            let alone = frames.iter().map(|frame| method.reconstruct(frame).unwrap());
            assert_eq!(made, alone.collect::<Vec<_>>());
            assert!(method.1.into_inner().unwrap().is_empty());
        }
    }

    #[test]
    fn a_stack_that_is_stopped_ends_with_that_word() {
        let scene = scene(side(16), 1);
        let frames: Vec<_> = (0..20).map(|k| noisy(&rows(0.5), &scene, 0.5, k)).collect();
        for word in ["hadamard", "omp", "tikhonov", "auto"] {
            let method = prepared(word.parse().unwrap());
            let ended = stack_while(&method, &frames, &|| Err(ReconstructError::Stopped));
            assert_eq!(ended.err(), Some(ReconstructError::Stopped), "{word}");
        }
    }

    #[test]
    fn progress_is_told_of_each_image() {
        let scene = scene(side(16), 1);
        let frames: Vec<_> = (0..20).map(|k| noisy(&rows(0.5), &scene, 0.5, k)).collect();
        for word in ["hadamard", "omp", "tikhonov", "fista", "tv"] {
            let (method, begun) = (prepared(word.parse().unwrap()), AtomicUsize::new(0));
            let count = || {
                begun.fetch_add(1, Ordering::Relaxed);
                Ok(())
            };
            stack_while(&method, &frames, &count).unwrap();
            assert_eq!(begun.into_inner(), frames.len(), "{word}");
        }
    }

    #[test]
    fn the_noise_that_is_asked_for_is_the_noise_of_each() {
        let scene = scene(side(16), 1);
        let frames: Vec<_> = (0..10).map(|k| noisy(&rows(0.5), &scene, 0.5, k)).collect();
        let sparsity = crate::reconstruct::Sparsity::Fixed(5);
        let printed = MethodSettings { sparsity, as_printed: true, ..MethodSettings::default() };
        let method = Method::OMP.prepare(&printed).unwrap();
        for (made, frame) in stack(&*method, &frames).unwrap().iter().zip(&frames) {
            assert_eq!(made.report.noise, Some(0.0));
            assert_eq!(made.report.sparsity, method.reconstruct(frame).unwrap().report.sparsity);
        }
    }

    /// Root of the mean squared error of the images.
    fn error(made: &[Reconstruction], truth: &[f64]) -> f64 {
        let of = |image: &crate::Image| {
            let pixels = image.pixels().iter().zip(truth);
            pixels.map(|(found, truth)| (f64::from(*found) - truth).powi(2)).sum::<f64>()
        };
        let sum: f64 = made.iter().map(|made| of(&made.image)).sum();
        (sum / (made.len() * truth.len()) as f64).sqrt()
    }

    #[test]
    fn what_is_found_out_once_is_as_good_as_what_is_found_out_for_each() {
        let side = side(32);
        for word in ["omp", "tikhonov", "fista", "tv"] {
            let method: Method = word.parse().unwrap();
            for (kind, share, noise) in [(1, 0.5, 0.5), (1, 0.5, 5.0), (2, 0.3, 0.5), (2, 1.0, 5.0)]
            {
                let scene = scene(side, kind);
                let rows = Order::ZigZag.rows(side).unwrap().first((share * 1024.0) as usize);
                let frames: Vec<_> = (0..10).map(|k| noisy(&rows, &scene, noise, k)).collect();
                let method = method.prepare(&MethodSettings::default()).unwrap();
                let alone = frames.par_iter().map(|frame| method.reconstruct(frame).unwrap());
                let alone = error(&alone.collect::<Vec<_>>(), &scene);
                let together = error(&stack(&*method, &frames).unwrap(), &scene);
                let name = method.name();
                assert!(
                    together < 1.02 * alone,
                    "{name}, scene {kind}, {share} of the rows, noise {noise}: alone {alone}, together {together}"
                );
            }
        }
    }
}

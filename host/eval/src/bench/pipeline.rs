//! Times the whole path from measurements to enhanced images on many frames.

mod gpu;

use super::{FASTEST_SWEEPS_HZ, Times, scenes};
use crate::error::{EvalError, Result};
use nalgebra::DMatrix;
use nirspi_nets::{Enhancer, Images, MeasuredRows, Options, fusion};
use nirspi_recon::basis::Transform;
use nirspi_recon::metrics::psnr;
use nirspi_recon::omp::{Limits, MixedDictionary};
use nirspi_recon::{Basis, Order, Side};
use rayon::prelude::*;
use serde::Serialize;

pub use gpu::on_gpu;

/// What to time.
#[derive(Debug, Clone, Copy)]
pub struct Settings {
    /// Number of frames: soft blobs with noise.
    pub frames: u32,
    /// Number of measurements of a frame, of 1024: random rows of a Hadamard matrix, including the
    /// row that sees all light.
    pub measurements: u32,
    /// Number of atoms to choose, at most the number of measurements.
    pub sparsity: u32,
    /// Whether enhanced images are moved until they agree with the readings.
    pub consistency: bool,
    /// Number of runs after the first.
    pub repeats: u32,
    /// Seed of rows and frames.
    pub seed: u64,
}

/// The measured times.
#[derive(Debug, Serialize)]
pub struct Timed {
    /// The first run, in which a GPU compiles its kernels.
    pub first_ms: f64,
    /// The whole path.
    #[serde(flatten)]
    pub whole: Times,
    /// The time from measurements to images on the host.
    pub reconstruct: Times,
    /// The time from images on the host to enhanced images.
    pub enhance: Times,
    /// The whole path with images brought to the host in between; `None` if they are on the host
    /// anyway.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub through_host: Option<Times>,
    /// The largest difference of a pixel between the two paths.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub largest_difference: Option<f32>,
    /// Frames a second, from the median.
    pub frames_per_s: f64,
    /// Frames a second, divided by the sweeps a second that the patterns' clock allows.
    pub of_fastest_sweeps: f64,
    /// PSNR of the reconstructed images, median over the frames.
    pub reconstructed_psnr_db: f64,
}

/// Times of one device, and its reconstructed images.
struct Measured {
    first_ms: f64,
    whole: Times,
    reconstruct: Times,
    enhance: Times,
    through_host: Option<Times>,
    largest_difference: Option<f32>,
    reconstructed: Vec<f32>,
}

/// Frames to reconstruct and enhance.
#[derive(Debug)]
pub struct Work {
    settings: Settings,
    /// (N, 32, 32): the true frames.
    truth: Vec<f32>,
    matrix: DMatrix<f64>,
    limits: Limits,
    /// `frames x measurements`.
    y: Vec<f64>,
    options: Options,
}

impl Work {
    /// The frames and their measurements.
    ///
    /// # Errors
    /// [`EvalError::Setting`] for more atoms than measurements.
    pub fn new(settings: Settings) -> Result<Self> {
        let Settings { frames, measurements, sparsity, seed, .. } = settings;
        if !(1..=measurements).contains(&sparsity) {
            return Err(EvalError::setting("sparsity", sparsity, format!("1 to {measurements}")));
        }
        let side = Side::INSTRUMENT;
        let mut rows = Order::Random(seed).rows(side)?.to_vec();
        // The pattern that sees all light is first, as in every order of a camera.
        rows.sort_by_key(|&row| row != 0);
        rows.truncate(measurements as usize);
        let truth = scenes::blobs(frames as usize, seed);
        let mut y = Vec::new();
        for image in truth.chunks_exact(side.area()) {
            y.append(&mut scenes::seen_by(&rows, image)?);
        }
        Ok(Self {
            settings,
            truth,
            matrix: DMatrix::from_row_slice(rows.len(), side.area(), &scenes::cosines_by(&rows)?),
            limits: Limits::atoms(sparsity as usize),
            y,
            options: Options {
                consistency: settings.consistency,
                measured: MeasuredRows::new(side.pixels(), &rows)?,
                ..Options::default()
            },
        })
    }

    fn timed(&self, measured: Measured) -> Result<Timed> {
        let side = Side::INSTRUMENT;
        let images = measured.reconstructed.chunks_exact(side.area());
        let mut quality = (self.truth.chunks_exact(side.area()).zip(images))
            .map(|(truth, image)| psnr(truth, image, side.pixels(), side.pixels(), 1.0))
            .collect::<Result<Vec<_>, _>>()?;
        quality.sort_by(f64::total_cmp);
        let frames_per_s = f64::from(self.settings.frames) / measured.whole.median_ms * 1e3;
        Ok(Timed {
            first_ms: measured.first_ms,
            whole: measured.whole,
            reconstruct: measured.reconstruct,
            enhance: measured.enhance,
            through_host: measured.through_host,
            largest_difference: measured.largest_difference,
            frames_per_s,
            of_fastest_sweeps: frames_per_s / FASTEST_SWEEPS_HZ,
            reconstructed_psnr_db: quality[quality.len() / 2],
        })
    }
}

/// Enhances reconstructed images that are on the host.
fn enhanced(enhancer: &Enhancer, images: &[f32], options: &Options) -> Result<Vec<f32>> {
    let lit: Vec<f32> = images.par_iter().map(|v| v.clamp(0.0, 1.0)).collect();
    let lit: Images<'_, { fusion::SIDE }> = Images::new(&lit)?;
    Ok(enhancer.enhance(lit, None, options, &mut |_| {})?.images)
}

/// Times `work` on all cores of the CPU.
///
/// # Errors
/// The pursuit's error.
pub fn on_cpu(work: &Work, enhancer: &Enhancer) -> Result<Timed> {
    let dictionary = MixedDictionary::new(work.matrix.clone(), true);
    let transform = Transform::new(Basis::Dct, Side::INSTRUMENT);
    let reconstruct = || -> Result<Vec<f32>> {
        let (solutions, _) = dictionary.solve_batch(&work.limits, &work.y)?;
        let mut images = vec![0.0; solutions.len() * Side::INSTRUMENT.area()];
        let frames = images.par_chunks_exact_mut(Side::INSTRUMENT.area()).zip(&solutions);
        frames.for_each(|(image, solution)| {
            for (&atom, &value) in solution.support.iter().zip(&solution.coefficients) {
                image[atom] = value as f32;
            }
            transform.synthesise(image);
        });
        Ok(images)
    };
    let whole = || enhanced(enhancer, &reconstruct()?, &work.options);
    let first_ms = Times::of(1, whole).median_ms;
    let reconstructed = reconstruct()?;
    whole()?;
    work.timed(Measured {
        first_ms,
        whole: Times::of(work.settings.repeats, whole),
        reconstruct: Times::of(work.settings.repeats, reconstruct),
        enhance: Times::of(work.settings.repeats, || {
            enhanced(enhancer, &reconstructed, &work.options)
        }),
        through_host: None,
        largest_difference: None,
        reconstructed,
    })
}

//! A dictionary on a device, for any number of batches.
//!
//! The matrix, its Gram matrix and the atoms' pictures are uploaded or computed once, when the
//! dictionary is made, and stay on the device. A batch uploads its measurements and downloads its
//! solutions.
//!
//! A batch is processed in turns of `TURN` frames, `AT_A_TIME` turns at a time, each by its own
//! thread. CubeCL gives each thread a stream, so one turn is copied and unpacked while another is
//! pursued.
//!
//! Measurements, solutions and images can stay on the device too ([`DeviceFrames`],
//! [`DeviceSolutions`], [`DeviceImages`]); the networks of `nirspi-nets` read the images there.

use super::device::Device;
use super::gram::{DeviceGram, DeviceSolutions, FRAMES_A_THREAD, width};
use super::images::DeviceImages;
use crate::dictionary::Atoms;
use crate::pursuit::energy;
use crate::referee::{self, BELIEVED};
use crate::{
    BackendError, Dictionary, Limits, MixedDictionary, OmpError, Path, Scalar, Solution, finite,
};
use nalgebra::DMatrix;
use nirspi_gpu::pursuit::layout::{Shape, TOGETHER};
use nirspi_gpu::pursuit::{Exact, referee as kernel};
use nirspi_gpu::{Buffer, limits};
use rayon::prelude::*;
use std::sync::OnceLock;

/// Largest number of frames in a turn: enough to fill a large GPU, and few enough that a batch of
/// some thousands has several turns.
const TURN: usize = 1024;

/// Number of turns that share the device's memory.
const AT_A_TIME: usize = 4;

/// The kernel's referee refines as often and as far as the processor's.
const _: () = assert!(kernel::STEPS == referee::STEPS && kernel::REFINED == referee::REFINED);

/// A `measurements x atoms` matrix with any column norms, on a device.
#[derive(Debug)]
pub struct DeviceDictionary {
    gram: DeviceGram,
    /// The matrix, row-major, with rows as wide as the Gram matrix's.
    matrix: Buffer,
    measurements: usize,
    /// The matrix in `f64`, and whether atoms are chosen by correlation, for frames that single
    /// precision cannot decide.
    exact: (DMatrix<f64>, bool),
    mixed: OnceLock<MixedDictionary>,
    referee: OnceLock<Referee>,
}

/// The dictionary in `f64` on the device, made when double precision is first asked for.
#[derive(Debug)]
struct Referee {
    matrix: Buffer,
    gram: Buffer,
    norms: Buffer,
}

/// Measurements on a device.
#[derive(Debug)]
pub struct DeviceFrames {
    y: Buffer,
    /// The same in `f64`, for a referee.
    exact: Option<Buffer>,
    energies: Vec<f64>,
}

/// The atoms' pictures on a device: one image for each atom.
#[derive(Debug)]
pub struct DevicePictures {
    buffer: Buffer,
    pixels: usize,
}

impl DeviceDictionary {
    /// Uploads `matrix` and computes its Gram matrix on the device. Atoms are chosen by their
    /// correlations with the residual or, with `normalised` false, by their plain inner products.
    ///
    /// # Errors
    /// [`OmpError`] if a number is not finite in `f32`, or the matrices do not fit the device.
    pub fn new(device: &Device, matrix: DMatrix<f64>, normalised: bool) -> Result<Self, OmpError> {
        let (measurements, atoms) = matrix.shape();
        if measurements == 0 {
            return Err(OmpError::Length { found: 0, expected: 1 });
        }
        let width = width(device, atoms)?;
        let single = matrix.map(|v| v as f32);
        finite("dictionary", single.as_slice())?;
        device.limits().fits("bytes of a buffer for the dictionary", measurements * width)?;
        let mut columns = vec![0.0; width * measurements];
        columns[..atoms * measurements].copy_from_slice(single.as_slice());
        let mut rows = vec![0.0; measurements * width];
        for (row, values) in rows.chunks_exact_mut(width).zip(single.row_iter()) {
            row.iter_mut().zip(values.iter()).for_each(|(row, &value)| *row = value);
        }
        let engine = &device.engine;
        let columns = engine.upload(&columns);
        let matrix_there = engine.upload(&rows);
        let gram = engine.products(&columns, &matrix_there, measurements, width);
        let energies = matrix.column_iter().map(|atom| atom.norm_squared() as f32).collect();
        let atoms = Atoms::new(energies);
        let atoms = if normalised {
            let like = (1.0 - f32::DEPENDENT) as f32;
            let marks = engine.read(&[&engine.doubles(&gram, width, like)])?;
            let doubles = confirmed(&matrix, &atoms, marks[0].words());
            atoms.with_doubles(doubles)
        } else {
            atoms.unnormalised()
        };
        let gram = DeviceGram::new(device, gram, atoms)?;
        let exact = (matrix, normalised);
        Ok(Self {
            gram,
            matrix: matrix_there,
            measurements,
            exact,
            mixed: OnceLock::new(),
            referee: OnceLock::new(),
        })
    }

    /// The dictionary's device.
    #[must_use]
    pub fn device(&self) -> &Device {
        &self.gram.device
    }

    /// Number of frames that [`pursue`](Self::pursue) takes at once for up to `sparsity` atoms.
    ///
    /// # Errors
    /// [`OmpError`] if one frame does not fit the device.
    pub fn frames_at_once(&self, sparsity: usize) -> Result<usize, OmpError> {
        let other = self.device().limits().frames(self.measurements)?;
        Ok(self.gram.frames_at_once(sparsity)?.min(other / TOGETHER * TOGETHER).max(1))
    }

    /// Calls `work` with the measurements of each turn of a batch; returns the results in the order
    /// of the turns.
    ///
    /// # Errors
    /// [`OmpError`] if one frame does not fit the device, or an error of `work`.
    pub fn in_turns<T: Sync, R: Send>(
        &self,
        sparsity: usize,
        y: &[T],
        work: impl Fn(&[T]) -> Result<R, OmpError> + Sync,
    ) -> Result<Vec<R>, OmpError> {
        // All turns together use no more memory than one turn alone could.
        let frames = (self.frames_at_once(sparsity)? / AT_A_TIME).clamp(1, TURN);
        let turn = frames * self.measurements;
        let mut done = Vec::new();
        for turns in y.chunks(AT_A_TIME * turn) {
            done.extend(turns.par_chunks(turn).map(&work).collect::<Result<Vec<R>, _>>()?);
        }
        Ok(done)
    }

    /// Uploads measurements. Each has `measurements` numbers; one follows the other.
    ///
    /// # Errors
    /// [`OmpError`] if the length is not a multiple of the dictionary's measurements, or a number
    /// is not finite in `f32`.
    pub fn upload<T: Scalar>(&self, y: &[T]) -> Result<DeviceFrames, OmpError> {
        let expected = self.measurements;
        if !y.len().is_multiple_of(expected) {
            return Err(OmpError::Length { found: y.len(), expected });
        }
        // Frames are padded to whole groups.
        let there = (y.len() / expected).next_multiple_of(TOGETHER).max(TOGETHER);
        let mut single = vec![0.0; there * expected];
        let frames = single.par_chunks_exact_mut(expected).zip(y.par_chunks_exact(expected));
        let convert = |(out, y): (&mut [f32], &[T])| {
            out.iter_mut().zip(y).for_each(|(out, &y)| *out = self::single(y));
            energy(out)
        };
        let energies: Vec<f64> = frames.with_min_len(FRAMES_A_THREAD).map(convert).collect();
        if !energies.iter().all(|energy| energy.is_finite()) {
            finite("measurement", y)?;
            finite("measurement", &single)?;
        }
        let y = self.device().engine.upload(&single);
        Ok(DeviceFrames { y, exact: None, energies })
    }

    /// [`upload`](Self::upload), with the measurements in double precision too:
    /// [`pursue`](Self::pursue) then leaves choices that single precision cannot make to a referee
    /// in `f64`, if the device has it.
    ///
    /// # Errors
    /// As [`upload`](Self::upload).
    pub fn upload_exact(&self, y: &[f64]) -> Result<DeviceFrames, OmpError> {
        let frames = self.upload(y)?;
        let there = frames.y.count();
        let limits = self.device().limits();
        let fits = limits.fits("bytes of a buffer in f64", 2 * there).is_ok()
            && limits.fits("bytes of the Gram matrix in f64", 2 * self.gram.width().pow(2)).is_ok();
        if !fits || !self.device().engine.has_doubles() {
            return Ok(frames);
        }
        let mut padded = y.to_vec();
        padded.resize(there, 0.0);
        let exact = Some(self.device().engine.upload_doubles(&padded));
        Ok(DeviceFrames { exact, ..frames })
    }

    /// The dictionary in `f64` on the device.
    fn referee(&self) -> &Referee {
        self.referee.get_or_init(|| {
            let (matrix, normalised) = &self.exact;
            let (rows, atoms, width) = (self.measurements, matrix.ncols(), self.gram.width());
            let mut columns = vec![0.0; width * rows];
            columns[..atoms * rows].copy_from_slice(matrix.as_slice());
            let mut lines = vec![0.0; rows * width];
            for (line, values) in lines.chunks_exact_mut(width).zip(matrix.row_iter()) {
                line.iter_mut().zip(values.iter()).for_each(|(line, &value)| *line = value);
            }
            let mut norms = vec![0.0; width];
            for (norm, atom) in norms.iter_mut().zip(matrix.column_iter()) {
                *norm = if *normalised { 1.0 / atom.norm() } else { 1.0 };
            }
            let engine = &self.device().engine;
            let columns = engine.upload_doubles(&columns);
            let matrix = engine.upload_doubles(&lines);
            let gram = engine.exact_products(&columns, &matrix, rows, width);
            Referee { matrix, gram, norms: engine.upload_doubles(&norms) }
        })
    }

    /// Finds a sparse representation of each frame. Everything stays on the device.
    ///
    /// # Errors
    /// [`OmpError`] if a limit is negative or NaN, or there are more frames than fit at once.
    pub fn pursue(
        &self,
        limits: &Limits,
        frames: &DeviceFrames,
    ) -> Result<DeviceSolutions, OmpError> {
        let limit = self.frames_at_once(limits.sparsity)?;
        limits::check("frames at once", frames.energies.len(), limit)?;
        let (engine, width) = (&self.device().engine, self.gram.width());
        let projection = engine.products(&frames.y, &self.matrix, self.measurements, width);
        let exact = |shape: &Shape| {
            let y = frames.exact.as_ref().filter(|_| engine.has_referee(shape))?;
            let Referee { matrix, gram, norms } = self.referee();
            Some(Exact {
                gram: gram.clone(),
                norms: norms.clone(),
                projection: engine.exact_products(y, matrix, self.measurements, width),
                believed: BELIEVED as f32,
            })
        };
        self.gram.pursue(projection, frames.energies.clone(), self.measurements, limits, exact)
    }

    /// Downloads the solutions that `f32` found.
    ///
    /// # Errors
    /// [`OmpError`] if the device failed.
    pub fn download(&self, solutions: &DeviceSolutions) -> Result<Vec<Solution>, OmpError> {
        let found = self.gram.read(solutions)?;
        Ok(found.into_iter().map(|found| found.solution).collect())
    }

    /// Downloads the solutions, and which of them `f32` could not decide.
    ///
    /// # Errors
    /// [`OmpError`] if the device failed.
    pub fn download_with_doubts(
        &self,
        solutions: &DeviceSolutions,
    ) -> Result<(Vec<Solution>, Vec<usize>), OmpError> {
        let (solutions, doubtful, _) = self.download_decided(solutions)?;
        Ok((solutions, doubtful))
    }

    /// Downloads the solutions, those that are still in doubt, and how many of the others have
    /// choices of the referee.
    fn download_decided(
        &self,
        solutions: &DeviceSolutions,
    ) -> Result<(Vec<Solution>, Vec<usize>, usize), OmpError> {
        let found = self.gram.read(solutions)?;
        let doubtful = (0..found.len()).filter(|&i| found[i].doubtful).collect();
        let decided = found.iter().filter(|found| found.decided && !found.doubtful).count();
        Ok((found.into_iter().map(|found| found.solution).collect(), doubtful, decided))
    }

    /// Solves the `doubtful` measurements of `y` again on the processor, with `f64` as the referee.
    /// Call this from one thread for a whole batch, because all threads together prepare the
    /// dictionary in double precision at its first use.
    ///
    /// # Errors
    /// [`OmpError`] if the numbers of measurements and solutions differ, or a measurement is not
    /// finite.
    pub fn settle(
        &self,
        limits: &Limits,
        y: &[f64],
        doubtful: &[usize],
        solutions: &mut [Solution],
    ) -> Result<(), OmpError> {
        let expected = solutions.len() * self.measurements;
        if y.len() != expected {
            return Err(OmpError::Length { found: y.len(), expected });
        }
        if doubtful.is_empty() {
            return Ok(());
        }
        let mixed = self.mixed.get_or_init(|| {
            let (matrix, normalised) = self.exact.clone();
            MixedDictionary::new(matrix, normalised)
        });
        let frame = |i: &usize| &y[i * self.measurements..(i + 1) * self.measurements];
        let again: Vec<f64> = doubtful.iter().flat_map(frame).copied().collect();
        for (&i, solution) in doubtful.iter().zip(mixed.solve_batch(limits, &again)?.0) {
            solutions[i] = solution;
        }
        Ok(())
    }

    /// Uploads the atoms' pictures, of `pixels` numbers each.
    ///
    /// # Errors
    /// [`OmpError`] if there is not one picture for each atom, or the pictures do not fit.
    pub fn upload_pictures(
        &self,
        pictures: &[f32],
        pixels: usize,
    ) -> Result<DevicePictures, OmpError> {
        let expected = self.gram.atoms.count() * pixels;
        if pictures.len() != expected {
            return Err(OmpError::Length { found: pictures.len(), expected });
        }
        self.device().limits().fits("bytes of a buffer for the atoms' pictures", expected)?;
        Ok(DevicePictures { buffer: self.device().engine.upload(pictures), pixels })
    }

    /// Images on the device, as `f32` found them: pictures times coefficients or, without pictures,
    /// each coefficient at its atom's place.
    ///
    /// # Errors
    /// [`OmpError`] if the images do not fit.
    pub fn images(
        &self,
        solutions: &DeviceSolutions,
        pictures: Option<&DevicePictures>,
    ) -> Result<DeviceImages, OmpError> {
        let frames = solutions.frames();
        let pixels = pictures.map_or(solutions.atoms(), |pictures| pictures.pixels);
        self.device().limits().fits("bytes of a buffer for the images", frames * pixels)?;
        let engine = &self.device().engine;
        let buffer = match pictures {
            _ if frames == 0 => engine.empty(0),
            Some(pictures) => engine.images(&solutions.pursuit, &pictures.buffer, pixels),
            None => engine.scatter(&solutions.pursuit, pixels),
        };
        Ok(DeviceImages::of(self.device(), buffer, [frames, pixels]))
    }

    /// [`solve_batch`](crate::solve_batch) in `f32` alone.
    ///
    /// # Errors
    /// [`OmpError`] if `y` does not fit the dictionary, is not finite, or the device fails.
    pub fn solve_batch_single(
        &self,
        limits: &Limits,
        y: &[f32],
    ) -> Result<Vec<Solution>, OmpError> {
        let solve = |y: &[f32]| self.download(&self.pursue(limits, &self.upload(y)?)?);
        Ok(self.in_turns(limits.sparsity, y, solve)?.into_iter().flatten().collect())
    }

    /// Finds sparse representations of a batch; also returns for how many of them double precision
    /// was used. Choices that `f32` cannot make are made in `f64` on the device, if it has that.
    /// Frames that are in doubt for another reason, or on a device without `f64`, are solved again
    /// by the processor.
    ///
    /// # Errors
    /// [`OmpError`] if `y` does not fit the dictionary, is not finite, or the device fails.
    pub fn solve_batch(
        &self,
        limits: &Limits,
        y: &[f64],
    ) -> Result<(Vec<Solution>, usize), OmpError> {
        // One thread makes the dictionary in f64, before the turns share it.
        if self.device().engine.has_doubles() {
            self.referee();
        }
        let solve =
            |y: &[f64]| self.download_decided(&self.pursue(limits, &self.upload_exact(y)?)?);
        let (mut solutions, mut doubtful, mut exact) = (Vec::new(), Vec::new(), 0);
        for (mut found, doubts, decided) in self.in_turns(limits.sparsity, y, solve)? {
            doubtful.extend(doubts.into_iter().map(|i| solutions.len() + i));
            solutions.append(&mut found);
            exact += decided;
        }
        self.settle(limits, y, &doubtful, &mut solutions)?;
        Ok((solutions, exact + doubtful.len()))
    }
}

/// Pairs of atoms that are parallel in double precision too.
fn confirmed(matrix: &DMatrix<f64>, atoms: &Atoms<f32>, marks: &[u32]) -> Vec<(usize, usize)> {
    let seen = |k: &usize| atoms.unseen().binary_search(k).is_err();
    let marked: Vec<usize> = (0..matrix.ncols()).filter(|&k| marks[k] != 0).filter(seen).collect();
    let pairs = marked.into_par_iter().flat_map_iter(|j| {
        let b = matrix.column(j);
        let like = (1.0 - f64::DEPENDENT) * b.norm_squared();
        let same = move |&i: &usize| {
            let a = matrix.column(i);
            a.dot(&b).powi(2) >= like * a.norm_squared()
        };
        (0..j).filter(seen).filter(same).map(move |i| (i, j)).collect::<Vec<_>>()
    });
    pairs.collect()
}

/// Any dictionary whose Gram matrix is on a device; the initial projections come from the dictionary.
pub struct OverDevice<'d, D: ?Sized> {
    dictionary: &'d D,
    gram: DeviceGram,
}

impl<'d, D: ?Sized> OverDevice<'d, D> {
    /// Uploads the Gram matrix column by column.
    ///
    /// # Errors
    /// [`OmpError`] if the device fails, or cannot compute with these numbers.
    pub fn new<T: Scalar>(device: &Device, dictionary: &'d D) -> Result<Self, OmpError>
    where
        D: Dictionary<T>,
    {
        Ok(Self { dictionary, gram: columns_of(device, dictionary)? })
    }

    /// Solves a batch.
    ///
    /// # Errors
    /// [`OmpError`] if a number is not finite, a limit is negative or NaN, or the device fails.
    pub fn solve<T: Scalar>(&self, limits: &Limits, y: &[T]) -> Result<Vec<Solution>, OmpError>
    where
        D: Dictionary<T>,
    {
        let Self { dictionary, gram } = self;
        let measurements = dictionary.measurements();
        let at_once = gram.frames_at_once(limits.sparsity)?;
        let mut solutions = Vec::new();
        for y in y.chunks(at_once * measurements) {
            let found = gram.read(&pursue_over(gram, *dictionary, limits, y)?)?;
            solutions.extend(found.into_iter().map(|found| found.solution));
        }
        Ok(solutions)
    }
}

/// Pursues one measurement over any dictionary, as [`Solver::solve`](crate::Solver::solve)
/// does.
///
/// # Errors
/// The errors of [`OverDevice`].
pub fn path_over<D: Dictionary<f32> + ?Sized>(
    device: &Device,
    dictionary: &D,
    limits: &Limits,
    y: &[f32],
) -> Result<Path<f32>, OmpError> {
    if y.len() != dictionary.measurements() {
        return Err(OmpError::Length { found: y.len(), expected: dictionary.measurements() });
    }
    finite("measurement", y)?;
    let gram = columns_of(device, dictionary)?;
    let solutions = pursue_over(&gram, dictionary, limits, y)?;
    Ok(gram.path(&solutions)?)
}

/// The Gram matrix of any dictionary, on a device.
fn columns_of<T: Scalar, D: Dictionary<T> + ?Sized>(
    device: &Device,
    dictionary: &D,
) -> Result<DeviceGram, OmpError> {
    if T::EPSILON < f32::EPSILON.into() {
        return Err(BackendError::Precision.into());
    }
    let atoms = dictionary.atoms();
    let width = width(device, atoms.count())?;
    let mut gram = vec![0.0; width * width];
    let columns = gram.par_chunks_exact_mut(width).take(atoms.count()).enumerate();
    columns.for_each_init(
        || vec![T::default(); crate::padded(atoms.count())],
        |column, (atom, out)| {
            dictionary.gram_column(atom, column);
            out.iter_mut().zip(&*column).for_each(|(out, &value)| *out = single(value));
        },
    );
    let energies = atoms.energies().iter().map(|&energy| single(energy)).collect();
    let own = Atoms::new(energies).with_doubles(atoms.doubles().to_vec());
    let own = if atoms.is_normalised() { own } else { own.unnormalised() };
    Ok(DeviceGram::new(device, device.engine.upload(&gram), own)?)
}

fn pursue_over<T: Scalar, D: Dictionary<T> + ?Sized>(
    gram: &DeviceGram,
    dictionary: &D,
    limits: &Limits,
    y: &[T],
) -> Result<DeviceSolutions, OmpError> {
    let measurements = dictionary.measurements();
    let frames = y.len() / measurements;
    let padded = crate::padded(dictionary.atoms().count());
    let mut p0 = vec![T::default(); frames * padded];
    dictionary.project_all(y, &mut p0);
    finite("projection", &p0)?;
    let mut projection = vec![0.0; frames.max(1) * gram.width()];
    for (out, p0) in projection.chunks_exact_mut(gram.width()).zip(p0.chunks_exact(padded)) {
        out.iter_mut().zip(p0).for_each(|(out, &value)| *out = single(value));
    }
    let projection = gram.device.engine.upload(&projection);
    let energies = y.chunks_exact(measurements).map(energy).collect();
    gram.pursue(projection, energies, measurements, limits, |_| None)
}

fn single<T: Scalar>(value: T) -> f32 {
    let value: f64 = value.into();
    value as f32
}

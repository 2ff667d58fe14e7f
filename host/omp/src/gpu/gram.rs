//! Pursuits over a Gram matrix that stays on a device.
//!
//! # Invariant
//! A solution is that of [`Solver`](crate::Solver), to within the rounding of `f32`
//! (`tests::gpu::every_kind_of_problem_has_the_references_solution`). A frame in which
//! rounding may have decided is flagged
//! (`tests::gpu::ties_and_ends_that_single_precision_cannot_see_go_to_double`).

use super::device::Device;
use crate::dictionary::Atoms;
use crate::referee::{BELIEVED, BELIEVED_ENERGY};
use crate::{BackendError, Limits, OmpError, Path, Scalar, Solution, Stop};
use nirspi_gpu::pursuit::layout::{
    CLOSEST, COUNT, DECIDED, ENERGY, ENOUGH, LEAD, Progress, REMAINING, STATE, STOP, Shape,
    TOGETHER,
};
use nirspi_gpu::pursuit::{Exact, Pursuit, Rounding};
use nirspi_gpu::{Buffer, limits};
use rayon::prelude::*;

/// Least number of frames that a thread unpacks.
pub(super) const FRAMES_A_THREAD: usize = 32;

/// The Gram matrix and the norms of a dictionary's atoms, on a device.
#[derive(Debug)]
pub(super) struct DeviceGram {
    pub device: Device,
    pub atoms: Atoms<f32>,
    gram: Buffer,
    table: Buffer,
    width: usize,
}

/// Pursuits that have ended, on a device, with frames in the order of measurement.
#[derive(Debug)]
pub struct DeviceSolutions {
    pub(super) pursuit: Pursuit,
    energies: Vec<f64>,
    unseen: Vec<usize>,
    atoms: usize,
}

/// A solution, and whether `f32` may have decided what needs `f64`.
pub(super) struct Found {
    pub solution: Solution,
    pub steps: Vec<f32>,
    pub doubtful: bool,
    /// Whether the device decided a choice in double precision.
    pub decided: bool,
    pub least_lead: f64,
}

impl DeviceGram {
    /// Takes columns of a Gram matrix, each with as many numbers as the matrix has rows. There are
    /// no more atoms than that.
    pub(super) fn new(
        device: &Device,
        gram: Buffer,
        atoms: Atoms<f32>,
    ) -> Result<Self, BackendError> {
        let width = width(device, atoms.count())?;
        let mut table = vec![0.0; 2 * width];
        table[..atoms.count()].copy_from_slice(&atoms.inverse_norms()[..atoms.count()]);
        table[width..][..atoms.count()].copy_from_slice(atoms.energies());
        let table = device.engine.upload(&table);
        Ok(Self { device: device.clone(), atoms, gram, table, width })
    }

    /// Length of a vector over the atoms on the device.
    pub(super) fn width(&self) -> usize {
        self.width
    }

    /// Number of frames that can be pursued together for up to `sparsity` atoms.
    ///
    /// # Errors
    /// [`BackendError`] if one frame does not fit.
    pub(super) fn frames_at_once(&self, sparsity: usize) -> Result<usize, BackendError> {
        let numbers = self.width * self.most(sparsity).max(TOGETHER);
        Ok(self.device.limits().frames(numbers)?)
    }

    /// Limit of the atoms of a pursuit: one more than the dictionary has, which shows that no atom
    /// is left.
    fn most(&self, sparsity: usize) -> usize {
        sparsity.min(self.atoms.count() + 1).max(1)
    }

    /// Pursues frames whose initial projections are on the device: `width` numbers each, for at
    /// least as many frames as there are energies. The projections are overwritten. `exact` gives
    /// what a referee in double precision needs, for choices that single precision cannot make.
    pub(super) fn pursue(
        &self,
        projection: Buffer,
        energies: Vec<f64>,
        measurements: usize,
        limits: &Limits,
        exact: impl FnOnce(&Shape) -> Option<Exact>,
    ) -> Result<DeviceSolutions, OmpError> {
        limits.check()?;
        let engine = &self.device.engine;
        let sparsity = self.most(limits.sparsity);
        let shape = self.device.limits().shape(self.atoms.count(), sparsity)?;
        let exact = exact(&shape);
        let frames = energies.len();
        let mut state = vec![0.0; frames.max(1) * STATE];
        for (state, &energy) in state.chunks_exact_mut(STATE).zip(&energies) {
            state[ENERGY] = energy as f32;
            state[ENOUGH] = limits.enough(energy, measurements) as f32;
            state[REMAINING] = energy as f32;
            state[LEAD] = f32::MAX;
            state[CLOSEST] = f32::MAX;
        }
        let chosen = frames * sparsity;
        let pursuit = Pursuit {
            shape,
            frames,
            sparsity,
            gram: self.gram.clone(),
            atoms: self.table.clone(),
            projection,
            rows: engine.empty(chosen * self.width),
            support: engine.empty(chosen),
            values: engine.empty(2 * chosen),
            state: engine.upload(&state),
            coefficients: engine.empty(chosen),
            exact,
        };
        if frames > 0 {
            let rounding = Rounding { score: f32::ROUNDING as f32, pivot: f32::DEPENDENT as f32 };
            let steps = limits.sparsity.min(sparsity);
            for launch in shape.launches(steps, limits::ROUNDS, pursuit.exact.is_some())? {
                engine.pursue(&pursuit, launch, rounding);
            }
            engine.coefficients(&pursuit);
        }
        let unseen = self.atoms.unseen().to_vec();
        let atoms = self.atoms.count();
        Ok(DeviceSolutions { pursuit, energies, unseen, atoms })
    }

    /// The pursuit of one frame, with a solution for every number of atoms.
    pub(super) fn path(&self, solutions: &DeviceSolutions) -> Result<Path<f32>, BackendError> {
        let factor = self.device.engine.factor(&solutions.pursuit);
        let mut factor = self.device.engine.read(&[&factor])?[0].floats().to_vec();
        let Some(found) = self.read(solutions)?.into_iter().next() else {
            return Err(BackendError::Failed("it pursued nothing".to_owned()));
        };
        let atoms = found.solution.support.len();
        factor.truncate(atoms * (atoms + 1) / 2);
        Ok(Path {
            refereed: usize::from(found.decided),
            support: found.solution.support,
            residual_norms: found.solution.residual_norms,
            stop: found.solution.stop,
            unseen: found.solution.unseen,
            least_lead: found.least_lead,
            factor,
            steps: found.steps,
        })
    }

    /// Downloads solutions.
    pub(super) fn read(&self, solutions: &DeviceSolutions) -> Result<Vec<Found>, BackendError> {
        let pursuit = &solutions.pursuit;
        if pursuit.frames == 0 {
            return Ok(Vec::new());
        }
        let read = self.device.engine.read(&[
            &pursuit.state,
            &pursuit.support,
            &pursuit.values,
            &pursuit.coefficients,
        ])?;
        let (state, support) = (read[0].floats(), read[1].words());
        let (values, coefficients) = (read[2].floats(), read[3].floats());
        let frames =
            (0..pursuit.frames).into_par_iter().with_min_len(FRAMES_A_THREAD).map(|frame| {
                let chosen = frame * pursuit.sparsity..(frame + 1) * pursuit.sparsity;
                let state = &state[frame * STATE..(frame + 1) * STATE];
                let values = &values[2 * chosen.start..2 * chosen.end];
                solutions.found(
                    frame,
                    state,
                    &support[chosen.clone()],
                    values,
                    &coefficients[chosen],
                )
            });
        Ok(frames.collect())
    }
}

impl DeviceSolutions {
    /// Number of frames.
    #[must_use]
    pub fn frames(&self) -> usize {
        self.pursuit.frames
    }

    /// Number of atoms in the dictionary.
    pub(super) fn atoms(&self) -> usize {
        self.atoms
    }

    fn found(
        &self,
        frame: usize,
        state: &[f32],
        support: &[u32],
        values: &[f32],
        coefficients: &[f32],
    ) -> Found {
        let energy = self.energies[frame];
        let count = (state[COUNT] as usize).min(support.len());
        let steps: Vec<f32> = values.chunks_exact(2).map(|pair| pair[0]).take(count).collect();
        let mut residual_norms = vec![if energy > 0.0 { 1.0 } else { 0.0 }];
        let mut remaining = energy;
        for &step in &steps {
            remaining -= f64::from(step).powi(2);
            residual_norms.push((remaining.max(0.0) / energy).sqrt());
        }
        let explained = f64::from(state[REMAINING]) <= f64::from(state[ENOUGH]);
        let stop = match Progress::read(state[STOP]) {
            Progress::Looking if explained => Stop::Residual,
            Progress::Looking => Stop::Sparsity,
            Progress::Explained => Stop::Residual,
            Progress::NoAtomLeft => Stop::NoAtomLeft,
            Progress::Dependent => Stop::Dependent,
        };
        let least_lead = match f64::from(state[LEAD]) {
            lead if lead >= f64::from(f32::MAX) => f64::INFINITY,
            lead => lead / energy.sqrt(),
        };
        let close = f64::from(state[CLOSEST]) < BELIEVED_ENERGY * energy;
        let ended_by_rounding = matches!(stop, Stop::Dependent | Stop::NoAtomLeft);
        let broken = steps.iter().chain(&coefficients[..count]).any(|v| !v.is_finite());
        let doubtful = least_lead < BELIEVED || close || ended_by_rounding || broken;
        let solution = Solution {
            support: support[..count].iter().map(|&atom| atom as usize).collect(),
            coefficients: coefficients[..count].iter().map(|&c| c.into()).collect(),
            residual_norms,
            stop,
            unseen: self.unseen.clone(),
        };
        let decided = state[DECIDED] > 0.0;
        Found { solution, steps, doubtful, decided, least_lead }
    }
}

/// Length of a vector over this many atoms on a device.
///
/// # Errors
/// [`BackendError`] if the Gram matrix would not fit.
pub(super) fn width(device: &Device, atoms: usize) -> Result<usize, BackendError> {
    let limits = device.limits();
    let shape = limits.shape(atoms, 1)?;
    let width = shape.width();
    limits::check("atoms at most", width, limits::ROUNDS)?;
    limits.fits("bytes of a buffer for the Gram matrix", width.saturating_mul(width))?;
    Ok(width)
}

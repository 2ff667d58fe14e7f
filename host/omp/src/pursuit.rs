//! Algorithm 1 from columns of the Gram matrix (Batch-OMP), one measurement at a time.
//!
//! # Invariant
//! Support and coefficients are those of [`reference`](super::reference), to within the rounding of
//! the number type (`tests::both_number_types_find_what_the_reference_finds`).
//!
//! # How
//! Instead of solving two triangular systems for each atom, a pursuit orthogonalises the column of
//! the Gram matrix when its atom is chosen (a partial Cholesky factorisation of the whole Gram
//! matrix, pivoted by the correlations). Row `i` of the factor `q` updates the projection `p` of
//! *all* atoms, and reduces the residual's energy by one square. The factor `q` contains the
//! Cholesky factor of the support, which gives the coefficients for any number of atoms. The Gram
//! matrix and the norm-based stop are from R. Rubinstein et al., *Efficient implementation of the
//! K-SVD algorithm using batch orthogonal matching pursuit* (2008).
//!
//! To find `K` of `N` atoms takes `N K (K - 1) / 2` products for the rows and `2 N K` for `p` and
//! the scores. The earlier rows are read once for each atom, `4 N K (K - 1) / 2` bytes in `f32`. At
//! `K = 64`, `N = 1024` that is 2.1 million products over 8.3 MB in a core's second-level cache,
//! whose bandwidth is the limit.
//!
//! # Rounding
//! The residual's energy is a difference of rounded results. A limit on the residual's norm below
//! about 1e-3 (`f32`) or 1e-7 (`f64`) of the measurement's norm is therefore met by rounding.
//! Coefficients are those of the normal equations: relative to the largest, they err by at most
//! [`error_bound`].

use super::dictionary::{Dictionary, padded};
use super::kernel::{Best, Next, PANEL, Rows, Step, largest, score};
use super::path::Path;
use super::referee::Referee;
use super::scalar::Scalar;
use super::{Limits, OmpError, Stop, finite};
use pulp::Arch;

/// Largest error of the coefficients of `atoms` atoms, relative to the norm of all of them.
/// `condition` is the condition number of the support's Gram matrix with atoms of unit norm. The
/// bound is `4 K condition epsilon`, the leading term of the normal equations' backward error (N.
/// J. Higham, *Accuracy and Stability of Numerical Algorithms*, 2nd ed., sections 10.1 and 20.4)
/// with `K epsilon` for the sums. The tests check every problem against this bound.
#[must_use]
pub fn error_bound<T: Scalar>(atoms: usize, condition: f64) -> f64 {
    4.0 * atoms.max(4) as f64 * condition * T::EPSILON
}

/// Finds sparse representations over one dictionary, one measurement after another, with its own
/// memory.
#[derive(Debug)]
pub struct Solver<'d, T, D: ?Sized> {
    dictionary: &'d D,
    limits: Limits,
    arch: Arch,
    p: Vec<T>,
    /// One over the norm of every atom that may still be chosen, 0 for the other atoms.
    inverse_norms: Vec<T>,
    best: Vec<Best<T>>,
    /// The second best panel at the last choice, and its best score.
    second: (usize, T),
    rows: Rows<T>,
    /// The atoms of the rows.
    taken: Vec<usize>,
    /// One over the root of each row's pivot.
    scales: Vec<T>,
    /// Lower-triangular factor of the Gram matrix of these atoms, row after row.
    factor: Vec<T>,
    /// The atom that was second best when a column was last read from the Gram matrix.
    ahead: Option<Ahead>,
    /// Its column without the rows that existed then.
    ahead_column: Vec<T>,
    /// Entries of those rows for this atom.
    ahead_weights: Vec<T>,
    /// The chosen atom's entries in the rows.
    weights: Vec<T>,
    scratch: Vec<T>,
}

impl<'d, T: Scalar, D: Dictionary<T> + ?Sized> Solver<'d, T, D> {
    /// A solver with memory for measurements by this dictionary.
    ///
    /// # Errors
    /// [`OmpError`] if a limit is negative or NaN.
    pub fn new(dictionary: &'d D, limits: &Limits) -> Result<Self, OmpError> {
        Self::on(Arch::new(), dictionary, limits)
    }

    pub(super) fn on(arch: Arch, dictionary: &'d D, limits: &Limits) -> Result<Self, OmpError> {
        limits.check()?;
        let width = padded(dictionary.atoms().count());
        Ok(Self {
            dictionary,
            limits: *limits,
            arch,
            p: vec![T::default(); width],
            inverse_norms: Vec::with_capacity(width),
            best: vec![Best::default(); width / PANEL],
            second: (0, T::default()),
            rows: Rows::new(width / PANEL, limits.sparsity.min(ROOM)),
            taken: Vec::new(),
            scales: Vec::new(),
            factor: Vec::new(),
            ahead: None,
            ahead_column: vec![T::default(); width],
            ahead_weights: Vec::new(),
            weights: Vec::new(),
            scratch: vec![T::default(); width],
        })
    }

    /// Chooses atoms for the measurement `y`.
    ///
    /// # Errors
    /// [`OmpError`] if `y` does not fit the dictionary or is not finite.
    pub fn solve(&mut self, y: &[T]) -> Result<Path<T>, OmpError> {
        self.solve_from(y, &[])
    }

    /// Chooses atoms for the measurement `y`, beginning with the atoms of `start` in that order,
    /// for example the support of a video's previous frame. Atoms of `start` that the measurement
    /// does not see, or that are in the span of others, are skipped. Everything that holds for
    /// [`solve`](Self::solve) holds here, except that the first atoms are not the best ones. If
    /// this solver took the first atoms of `start` for the measurement before, in the same order,
    /// each of them costs only `N` products and no column of the Gram matrix.
    ///
    /// # Errors
    /// [`OmpError`] if `y` does not fit the dictionary or is not finite, or `start` names an atom
    /// that the dictionary does not have.
    pub fn solve_from(&mut self, y: &[T], start: &[usize]) -> Result<Path<T>, OmpError> {
        self.project(y)?;
        self.pursue(energy(y), start, &mut ())
    }

    /// [`solve`](Self::solve) with a `referee` that chooses between atoms with nearly equal scores.
    pub(super) fn solve_with(
        &mut self,
        y: &[T],
        referee: &mut impl Referee<T>,
    ) -> Result<Path<T>, OmpError> {
        self.project(y)?;
        self.pursue(energy(y), &[], referee)
    }

    fn project(&mut self, y: &[T]) -> Result<(), OmpError> {
        let expected = self.dictionary.measurements();
        if y.len() != expected {
            return Err(OmpError::Length { found: y.len(), expected });
        }
        finite("measurement", y)?;
        let mut p0 = std::mem::take(&mut self.p);
        self.dictionary.project(y, &mut p0);
        self.p = p0;
        Ok(())
    }

    /// [`solve_with`](Self::solve_with) for a measurement whose initial projection is known.
    pub(super) fn solve_projected(
        &mut self,
        p0: &[T],
        energy: f64,
        referee: &mut impl Referee<T>,
    ) -> Result<Path<T>, OmpError> {
        self.p.copy_from_slice(p0);
        self.pursue(energy, &[], referee)
    }

    fn pursue(
        &mut self,
        energy: f64,
        start: &[usize],
        referee: &mut impl Referee<T>,
    ) -> Result<Path<T>, OmpError> {
        finite("projection", &self.p)?;
        let atoms = self.dictionary.atoms();
        if let Some(&found) = start.iter().find(|&&atom| atom >= atoms.count()) {
            return Err(OmpError::Start { found, atoms: atoms.count() });
        }
        let mut again = self.keep(start);
        self.ahead = None;
        self.inverse_norms.clear();
        self.inverse_norms.extend_from_slice(atoms.inverse_norms());
        score(&self.p, &self.inverse_norms, &mut self.best);
        let mut path = Path {
            support: Vec::new(),
            residual_norms: vec![if energy > 0.0 { 1.0 } else { 0.0 }],
            stop: Stop::Sparsity,
            unseen: atoms.unseen().to_vec(),
            least_lead: f64::INFINITY,
            refereed: 0,
            factor: Vec::new(),
            steps: Vec::new(),
        };
        let enough = self.limits.enough(energy, self.dictionary.measurements());
        let mut remaining = energy;
        let norm = energy.sqrt();
        let mut start = start.iter().filter(|&&atom| atoms.inverse_norms()[atom] != T::default());
        let rounding = T::ROUNDING * self.choose().score;
        path.stop = loop {
            if remaining <= enough {
                break Stop::Residual;
            }
            if path.support.len() >= self.limits.sparsity {
                break Stop::Sparsity;
            }
            if path.support.len() < again {
                start.next();
                self.take_again(&mut path, &mut remaining, energy);
                continue;
            }
            if again > 0 {
                score(&self.p, &self.inverse_norms, &mut self.best);
                again = 0;
            }
            if let Some(&atom) = start.next() {
                if self.inverse_norms[atom] != T::default() {
                    self.take(atom, &mut path, &mut remaining, energy);
                }
                continue;
            }
            let Choice { mut atom, score, lead } = self.choose();
            if score <= rounding {
                break Stop::NoAtomLeft;
            }
            if lead < referee.believed() * norm {
                let rivals = self.rivals(score - referee.believed() * norm);
                atom = referee.choose(&path, &rivals);
                path.refereed += 1;
            } else {
                path.least_lead = path.least_lead.min(lead / norm);
            }
            if !self.take(atom, &mut path, &mut remaining, energy) {
                break Stop::Dependent;
            }
        };
        Ok(path)
    }

    /// The atom with the largest score, the lowest of equals.
    fn choose(&mut self) -> Choice {
        let (panel, score) = largest(&self.best, None);
        let atom = self.atom_of(panel, score);
        self.second = largest(&self.best, Some(panel));
        let rivals = (panel * PANEL..(panel + 1) * PANEL).filter(|&k| k != atom);
        let rival = rivals.fold(self.second.1, |most, k| {
            let score = self.p[k].magnitude() * self.inverse_norms[k];
            if score > most { score } else { most }
        });
        Choice { atom, score: score.into(), lead: score.into() - rival.into() }
    }

    /// The first atom of a panel that has this score.
    fn atom_of(&self, panel: usize, score: T) -> usize {
        let atoms = panel * PANEL..((panel + 1) * PANEL).min(self.p.len());
        let is_best = |&k: &usize| self.p[k].magnitude() * self.inverse_norms[k] == score;
        atoms.clone().find(is_best).unwrap_or(atoms.start)
    }

    /// Atoms with at least this score, in ascending order.
    fn rivals(&self, least: f64) -> Vec<usize> {
        let near = |score: T| Into::<f64>::into(score) >= least;
        let panels = self.best.iter().enumerate().filter(|(_, best)| best.iter().any(|&b| near(b)));
        panels
            .flat_map(|(panel, _)| panel * PANEL..(panel + 1) * PANEL)
            .filter(|&k| self.inverse_norms[k] != T::default())
            .filter(|&k| near(self.p[k].magnitude() * self.inverse_norms[k]))
            .collect()
    }

    /// Drops all rows after those that `start` shares with the last measurement; returns the number
    /// of rows kept.
    fn keep(&mut self, start: &[usize]) -> usize {
        let seen = |atom: &&usize| self.dictionary.atoms().inverse_norms()[**atom] != T::default();
        let same = self.taken.iter().zip(start.iter().filter(seen)).take_while(|(a, b)| a == b);
        let kept = same.count();
        self.rows.truncate(kept);
        self.taken.truncate(kept);
        self.scales.truncate(kept);
        self.factor.truncate(kept * (kept + 1) / 2);
        kept
    }

    /// Adds the next atom, whose row exists already.
    fn take_again(&mut self, path: &mut Path<T>, remaining: &mut f64, energy: f64) {
        let at = path.support.len();
        let atom = self.taken[at];
        let step = self.p[atom] * self.scales[at];
        self.inverse_norms[atom] = T::default();
        self.rows.take_from(at, step, &mut self.p);
        path.factor.extend_from_slice(&self.factor[at * (at + 1) / 2..][..=at]);
        path.add(atom, step, remaining, energy);
    }

    /// Adds an atom to the path, unless the atom is in the span of the support.
    fn take(&mut self, atom: usize, path: &mut Path<T>, remaining: &mut f64, energy: f64) -> bool {
        self.weights.clear();
        self.rows.of_atom(atom, 0, &mut self.weights);
        let own: f64 = self.dictionary.atoms().energies()[atom].into();
        let pivot = own - squares(&self.weights);
        // The comparison is false for NaN, which appears if the Gram matrix overflows.
        let independent = pivot > T::DEPENDENT * own;
        if !independent {
            return false;
        }
        let root = pivot.sqrt();
        let scale = T::from_f64(root.recip());
        let step = self.p[atom] * scale;
        self.inverse_norms[atom] = T::default();
        self.push(atom, scale, step);
        self.taken.push(atom);
        self.scales.push(scale);
        self.weights.push(T::from_f64(root));
        self.factor.extend_from_slice(&self.weights);
        path.factor.extend_from_slice(&self.weights);
        path.add(atom, step, remaining, energy);
        true
    }

    /// Adds the atom's column of the Gram matrix, orthogonalised to all rows, as the next row.
    ///
    /// A pass over the rows takes hardly longer for two columns than for one, and the next atom is
    /// often the second best of now. So the second best atom's column is orthogonalised in the same
    /// pass, and needs only the newer rows when its atom is chosen. The results are the same to the
    /// bit.
    fn push(&mut self, atom: usize, scale: T, step: T) {
        let dictionary = self.dictionary;
        let taken_before = self.ahead.take_if(|ahead| ahead.atom == atom);
        let (column, first, next) = if let Some(Ahead { rows, .. }) = taken_before {
            std::mem::swap(&mut self.scratch, &mut self.ahead_column);
            (&self.scratch[..], rows, None)
        } else if let Some(column) = dictionary.stored_gram_column(atom) {
            (column, 0, self.look_ahead(atom))
        } else {
            dictionary.gram_column(atom, &mut self.scratch);
            (&self.scratch[..], 0, None)
        };
        let next = next.map(|column| Next {
            column,
            weights: &self.ahead_weights,
            out: &mut self.ahead_column,
        });
        let inverse_norms = &self.inverse_norms;
        let weights = &self.weights[first..];
        let step = Step { column, first, weights, next, scale, step, inverse_norms };
        self.rows.push(self.arch, step, &mut self.p, &mut self.best);
    }

    /// Chooses the best atom of the other panels for the same pass; returns its column.
    fn look_ahead(&mut self, atom: usize) -> Option<&'d [T]> {
        let (panel, score) = self.second;
        if panel == atom / PANEL || score <= T::default() {
            self.ahead = None;
            return None;
        }
        let ahead = self.atom_of(panel, score);
        self.ahead_weights.clear();
        self.rows.of_atom(ahead, 0, &mut self.ahead_weights);
        self.ahead = Some(Ahead { atom: ahead, rows: self.ahead_weights.len() });
        self.dictionary.stored_gram_column(ahead)
    }
}

/// An atom, its score, and the lead of its score over the next best.
struct Choice {
    atom: usize,
    score: f64,
    lead: f64,
}

/// A column from which the first rows are subtracted.
#[derive(Debug)]
struct Ahead {
    atom: usize,
    rows: usize,
}

/// Number of rows with memory from the start; further rows allocate their memory.
const ROOM: usize = 64;

/// Squared norm of a measurement.
pub(super) fn energy<T: Scalar>(y: &[T]) -> f64 {
    y.iter().map(|&y| y.into().powi(2)).sum()
}

/// Sum of squares, in eight sums that do not wait for each other.
fn squares<T: Scalar>(values: &[T]) -> f64 {
    let (eights, rest) = values.as_chunks::<8>();
    let mut sums = [0.0_f64; 8];
    for values in eights {
        for (sum, &v) in sums.iter_mut().zip(values) {
            *sum += v.into() * v.into();
        }
    }
    sums.iter().sum::<f64>() + energy(rest)
}

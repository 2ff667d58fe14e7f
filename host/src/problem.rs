//! Reads sparse problems from a NumPy `.npz` file, and writes their solutions.
//!
//! # Invariant
//! The parts of a problem that was read fit together, so later code need not check again
//! (`tests::what_does_not_fit_is_named`).
//!
//! | field | content |
//! |---|---|
//! | `D` | `(M, N)` dictionary, an atom a column |
//! | `Y` | `(B, M)` measurements, one a row, or `(M,)` |
//! | `k` | number of atoms to choose |
//!
//! | field of a solution | content |
//! |---|---|
//! | `support` | `(B, k)` int64: atoms in the order chosen; -1 where the search ended before |
//! | `coef` | `(B, k)` float64: coefficient of each atom, 0 for an empty place |

use crate::files::FileError;
use crate::files::archive::{self, Archive, Numbers};
use crate::files::npy;
use std::path::Path;

/// Measurements, and the dictionary in which their sparse solution is sought.
#[derive(Debug, Clone, PartialEq)]
pub struct ProblemFile {
    /// `measurements x atoms`, row-major, finite.
    pub dictionary: Vec<f64>,
    /// Number of rows of the dictionary, at least 1.
    pub measurements: usize,
    /// Number of columns of the dictionary, at least 1.
    pub atoms: usize,
    /// Frames of `measurements` numbers, one after another, finite.
    pub frames: Vec<f64>,
    /// Number of atoms to choose, at least 1 and at most the number of atoms.
    pub sparsity: usize,
}

/// Reads and checks a problem.
///
/// # Errors
/// [`FileError`], one line that names file, field, what was found and what was expected.
pub fn read(path: &Path) -> Result<ProblemFile, FileError> {
    let mut archive = Archive::open(path)?;
    for field in ["D", "Y", "k"] {
        if !archive.holds(field) {
            let (path, found) = (path.to_owned(), archive.names().to_vec());
            return Err(FileError::Missing { path, field, found, expected: "D, Y and k" });
        }
    }
    let dictionary = archive.numbers("D", |shape| match shape {
        [rows, columns] if *rows.min(columns) > 0 => Ok(()),
        _ => Err("(M, N), an atom a column".to_owned()),
    })?;
    let (measurements, atoms) = (dictionary.shape[0], dictionary.shape[1]);
    let frames = archive.numbers("Y", |shape| match shape {
        [length] | [_, length] if *length == measurements as u64 && !shape.contains(&0) => Ok(()),
        _ => Err(format!("(B, {measurements}) or ({measurements},), as D has {measurements} rows")),
    })?;
    for (field, numbers) in [("D", &dictionary), ("Y", &frames)] {
        check_finite(path, field, numbers)?;
    }
    let k = archive.numbers("k", |shape| match shape.iter().all(|&axis| axis == 1) {
        true => Ok(()),
        false => Err("one number".to_owned()),
    })?;
    let (k, most) = (k.values[0], atoms as f64);
    if k.fract() != 0.0 || !(1.0..=most).contains(&k) {
        return Err(FileError::Field {
            path: path.to_owned(),
            field: "k".into(),
            found: format!("is {k}"),
            expected: format!("a whole number from 1 to {atoms}, the columns of D"),
        });
    }
    Ok(ProblemFile {
        dictionary: dictionary.values,
        measurements,
        atoms,
        frames: frames.values,
        sparsity: k as usize,
    })
}

fn check_finite(path: &Path, field: &'static str, numbers: &Numbers) -> Result<(), FileError> {
    let Some(at) = numbers.values.iter().position(|value| !value.is_finite()) else {
        return Ok(());
    };
    let width = numbers.shape.last().copied().unwrap_or(1);
    let found = format!("is {} at [{}, {}]", numbers.values[at], at / width, at % width);
    let expected = "finite numbers".to_owned();
    Err(FileError::Field { path: path.to_owned(), field: field.into(), found, expected })
}

/// The bytes of a solution file: for each frame its atoms and their coefficients, at most
/// `sparsity` of each.
///
/// # Errors
/// [`FileError`] naming `path`, if the archive cannot be written.
pub fn encode(
    path: &Path,
    sparsity: usize,
    solutions: &[(&[usize], &[f64])],
) -> Result<Vec<u8>, FileError> {
    let (mut support, mut coef) = (Vec::new(), Vec::new());
    for (row, (atoms, coefficients)) in solutions.iter().enumerate() {
        support.extend(atoms.iter().map(|&atom| atom as i64));
        coef.extend_from_slice(coefficients);
        support.resize((row + 1) * sparsity, -1);
        coef.resize((row + 1) * sparsity, 0.0);
    }
    let shape = [solutions.len(), sparsity];
    let members =
        [("support", npy::encode(&shape, &support)), ("coef", npy::encode(&shape, &coef))];
    archive::encode(path, &members)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(members: &[(&str, Vec<u8>)]) -> (tempfile::TempDir, std::path::PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("problem.npz");
        std::fs::write(&path, archive::encode(&path, members).unwrap()).unwrap();
        (folder, path)
    }

    fn members() -> Vec<(&'static str, Vec<u8>)> {
        vec![
            ("D", npy::encode(&[2, 3], &[1.0, 2.0, 3.0, 4.0, 5.0, 6.0])),
            ("Y", npy::encode(&[2, 2], &[1.0, 0.0, 0.0, 1.0])),
            ("k", npy::encode(&[], &[2_i64])),
        ]
    }

    #[test]
    fn a_problem_is_read_as_it_is() {
        let (_folder, path) = file(&members());
        let problem = read(&path).unwrap();
        assert_eq!((problem.measurements, problem.atoms, problem.sparsity), (2, 3, 2));
        assert_eq!(problem.dictionary[..3], [1.0, 2.0, 3.0]);
        assert_eq!(problem.frames, [1.0, 0.0, 0.0, 1.0]);
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let refused = |at: usize, member: (&'static str, Vec<u8>)| {
            let mut members = members();
            members[at] = member;
            let (_folder, path) = file(&members);
            read(&path).unwrap_err().to_string()
        };
        let text = refused(0, ("E", npy::encode(&[1], &[1.0])));
        assert!(text.contains("no `D`") && text.contains("D, Y and k"), "{text}");
        let text = refused(1, ("Y", npy::encode(&[3], &[1.0; 3])));
        assert!(text.contains("`Y` has shape (3,)") && text.contains("(B, 2)"), "{text}");
        let text = refused(1, ("Y", npy::encode(&[2, 2], &[1.0, 1.0, f64::NAN, 1.0])));
        assert!(text.contains("`Y` is NaN at [1, 0]"), "{text}");
        for k in [0_i64, 4] {
            let text = refused(2, ("k", npy::encode(&[], &[k])));
            assert!(text.contains(&format!("`k` is {k}")) && text.contains("1 to 3"), "{text}");
        }
    }

    #[test]
    fn a_solution_that_ended_early_is_filled_up() {
        let path = Path::new("out.npz");
        let solutions: [(&[usize], &[f64]); 2] = [(&[5, 2], &[1.5, -2.0]), (&[7], &[0.25])];
        let (_folder, path) = {
            let folder = tempfile::tempdir().unwrap();
            let file = folder.path().join("out.npz");
            std::fs::write(&file, encode(path, 2, &solutions).unwrap()).unwrap();
            (folder, file)
        };
        let mut archive = Archive::open(&path).unwrap();
        let support = archive.numbers("support", |_| Ok(())).unwrap();
        assert_eq!((support.shape, support.values), (vec![2, 2], vec![5.0, 2.0, 7.0, -1.0]));
        let coef = archive.numbers("coef", |_| Ok(())).unwrap();
        assert_eq!(coef.values, [1.5, -2.0, 0.25, 0.0]);
    }
}

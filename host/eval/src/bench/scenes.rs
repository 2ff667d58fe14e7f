//! The scenes and dictionaries of the benchmarks: soft blobs, and cosines as measured by Hadamard
//! patterns.

use nirspi_recon::basis::Transform;
use nirspi_recon::{Basis, FwhtLengthError, Side, fwht};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// (N, 32, 32) in [0, 1]: three soft blobs each, and noise of 3 %.
pub fn blobs(count: usize, seed: u64) -> Vec<f32> {
    let mut rng = Pcg64::seed_from_u64(seed);
    let side = Side::INSTRUMENT.pixels();
    let mut out = Vec::with_capacity(count * side * side);
    for _ in 0..count {
        let blobs: [[f32; 3]; 3] = std::array::from_fn(|_| {
            [rng.random_range(4.0..28.0), rng.random_range(4.0..28.0), rng.random_range(2.0..6.0)]
        });
        for pixel in 0..side * side {
            let (x, y) = ((pixel % side) as f32, (pixel / side) as f32);
            let light: f32 = blobs
                .iter()
                .map(|[cx, cy, r]| (-((x - cx).powi(2) + (y - cy).powi(2)) / (2.0 * r * r)).exp())
                .sum();
            let noise = 0.06 * (rng.random::<f32>() + rng.random::<f32>() - 1.0);
            out.push((0.8 * light + noise).clamp(0.0, 1.0));
        }
    }
    out
}

/// (1024, 32, 32): the atoms of the cosine basis.
pub fn cosines() -> Vec<f32> {
    let area = Side::INSTRUMENT.area();
    let transform = Transform::new(Basis::Dct, Side::INSTRUMENT);
    let mut atoms = vec![0.0; area * area];
    for (atom, image) in atoms.chunks_exact_mut(area).enumerate() {
        image[atom] = 1.0;
        transform.synthesise(image);
    }
    atoms
}

/// The measurements of a 32 x 32 image by some rows of the Hadamard matrix, whose rows have unit
/// norm.
///
/// # Errors
/// If the image has another size.
pub fn seen_by(rows: &[u32], image: &[f32]) -> Result<Vec<f64>, FwhtLengthError> {
    let mut seen: Vec<f64> = image.iter().map(|&v| v.into()).collect();
    fwht(&mut seen)?;
    let side = Side::INSTRUMENT.pixels() as f64;
    Ok(rows.iter().map(|&row| seen[row as usize] / side).collect())
}

/// The measurements of each cosine by some rows: `rows x 1024`.
///
/// # Errors
/// Does not occur: every cosine has the size.
pub fn cosines_by(rows: &[u32]) -> Result<Vec<f64>, FwhtLengthError> {
    let area = Side::INSTRUMENT.area();
    let mut dictionary = vec![0.0; rows.len() * area];
    for (atom, image) in cosines().chunks_exact(area).enumerate() {
        for (m, seen) in seen_by(rows, image)?.into_iter().enumerate() {
            dictionary[m * area + atom] = seen;
        }
    }
    Ok(dictionary)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blobs_follow_from_their_seed_and_are_in_range() {
        let three = blobs(3, 5);
        assert_eq!(three.len(), 3 * Side::INSTRUMENT.area());
        assert!(three.iter().all(|v| (0.0..=1.0).contains(v)));
        assert_eq!(three[..1024], blobs(1, 5)[..], "the first does not depend on how many follow");
        assert_ne!(blobs(1, 6), blobs(1, 5));
    }

    #[test]
    fn all_rows_see_cosines_at_right_angles_to_each_other() {
        let area = Side::INSTRUMENT.area();
        let rows: Vec<u32> = (0..area as u32).collect();
        let seen = cosines_by(&rows).unwrap();
        let product = |a: usize, b: usize| -> f64 {
            (0..area).map(|m| seen[m * area + a] * seen[m * area + b]).sum()
        };
        assert!((product(0, 0) - 1.0).abs() < 1e-5 && (product(77, 77) - 1.0).abs() < 1e-5);
        assert!(product(0, 77).abs() < 1e-5 && product(77, 78).abs() < 1e-5);
    }

    #[test]
    fn a_row_sees_the_sum_of_the_light_under_its_signs() {
        let mut image = vec![0.0; 1024];
        (image[0], image[33]) = (1.0, 0.5);
        // Row 0 has the sign + everywhere, row 1 the sign - at odd pixels.
        let seen = seen_by(&[0, 1], &image).unwrap();
        assert!(
            (seen[0] - 1.5 / 32.0).abs() < 1e-9 && (seen[1] - 0.5 / 32.0).abs() < 1e-9,
            "{seen:?}"
        );
    }
}

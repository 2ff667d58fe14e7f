//! What the benchmarks look at: soft blobs, and cosines as patterns see them.

use anyhow::Result;
use nirspi_recon::basis::Transform;
use nirspi_recon::{Basis, Side, fwht};
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

/// What some rows of the Hadamard matrix of unit rows see of an image of 32 x 32.
pub fn seen_by(rows: &[u32], image: &[f32]) -> Result<Vec<f64>> {
    let mut seen: Vec<f64> = image.iter().map(|&v| v.into()).collect();
    fwht(&mut seen)?;
    let side = Side::INSTRUMENT.pixels() as f64;
    Ok(rows.iter().map(|&row| seen[row as usize] / side).collect())
}

/// What they see of each cosine: `rows x 1024`.
pub fn cosines_by(rows: &[u32]) -> Result<Vec<f64>> {
    let area = Side::INSTRUMENT.area();
    let mut dictionary = vec![0.0; rows.len() * area];
    for (atom, image) in cosines().chunks_exact(area).enumerate() {
        for (m, seen) in seen_by(rows, image)?.into_iter().enumerate() {
            dictionary[m * area + atom] = seen;
        }
    }
    Ok(dictionary)
}

//! The share of each atom's energy that some Hadamard rows see.
//!
//! Atoms are separable: with `e[a]` and `f[b]` the energies of an atom's two 1-D functions in Walsh
//! functions `a` and `b`, the atom has energy `e[a] f[b]` in row `(a, b)`. The sum over the
//! measured rows is two matrix products for all atoms together.

use super::walsh::WalshCosines;
use nirspi_patterns::basis::{Basis, Transform, merge, product};
use nirspi_patterns::fwht;

/// Share of each atom's energy that the rows with a 1 in `mask` see.
pub fn visible_energy(transform: &Transform, mask: &[f32]) -> Vec<f32> {
    let n = transform.side().pixels();
    match transform.basis().taps() {
        // Every pixel has 1 / n^2 of its energy in every row.
        None if transform.basis() == Basis::Pixel => {
            vec![mask.iter().sum::<f32>() / mask.len() as f32; mask.len()]
        }
        None => {
            let cosines = WalshCosines::new(transform.side());
            let functions: Vec<f32> =
                (0..n).flat_map(|u| cosines.cosine(u).iter().map(|t| t * t)).collect();
            seen(n, n, &functions, mask)
        }
        Some(taps) => {
            let mut energies = vec![0.0; n * n];
            let mut size = n;
            while size > 1 {
                // The functions of this scale (smooth functions, then details), and the atoms made
                // of them.
                let block = seen(n, size, &squared_walsh(taps, n, size), mask);
                for (u, row) in block.chunks_exact(size).enumerate() {
                    energies[u * n..u * n + size].copy_from_slice(row);
                }
                // The smooth functions give the next scale, down to the mean.
                size /= 2;
            }
            energies
        }
    }
}

/// Energies of all products of `count` 1-D functions, each given by a row of its energies in `n`
/// Walsh functions.
fn seen(n: usize, count: usize, functions: &[f32], mask: &[f32]) -> Vec<f32> {
    let transposed: Vec<f32> =
        (0..n * count).map(|p| functions[p % count * n + p / count]).collect();
    let (mut half, mut energy) = (vec![0.0; count * n], vec![0.0; count * count]);
    product(n, n, functions, mask, &mut half);
    product(n, count, &half, &transposed, &mut energy);
    energy
}

/// Energies of the `size` wavelet functions of one scale in each Walsh function: smooth functions,
/// then details.
fn squared_walsh(taps: &[f32], n: usize, size: usize) -> Vec<f32> {
    let mut all = Vec::with_capacity(size * n);
    for function in 0..size {
        let mut samples = vec![0.0; size];
        samples[function] = 1.0;
        loop {
            let mut finer = vec![0.0; samples.len()];
            merge(taps, &samples, &mut finer);
            if finer.len() == n {
                samples = finer;
                break;
            }
            finer.resize(2 * finer.len(), 0.0);
            samples = finer;
        }
        fwht::transform(&mut samples);
        all.extend(samples.iter().map(|t| t * t / n as f32));
    }
    all
}

//! How much of each atom some Hadamard rows see.
//!
//! The one law: atoms are separable, so with `e[a]` the energy of a 1-D function in Walsh function `a`, an atom has
//! `e[a] f[b]` in row `(a, b)`, and the sum over the rows that were measured is two matrix products for all atoms alike.

use super::walsh::WalshCosines;
use crate::basis::{Basis, Transform, merge, product};
use crate::fwht;

/// Share of each atom's energy that the rows with a 1 in `mask` see.
pub(crate) fn visible_energy(transform: &Transform, mask: &[f32]) -> Vec<f32> {
    let n = transform.side().pixels();
    match transform.basis().taps() {
        // Every pixel puts 1 / n^2 of its energy into every row.
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
                // The functions of this scale: smooth ones, then details; and the atoms made of them.
                let block = seen(n, size, &squared_walsh(taps, n, size), mask);
                for (u, row) in block.chunks_exact(size).enumerate() {
                    energies[u * n..u * n + size].copy_from_slice(row);
                }
                // Of the smooth ones, the next scale is made, down to the mean.
                size /= 2;
            }
            energies
        }
    }
}

/// Energies of all products of `count` 1-D functions, given as rows of their energies in `n` Walsh functions.
fn seen(n: usize, count: usize, functions: &[f32], mask: &[f32]) -> Vec<f32> {
    let transposed: Vec<f32> =
        (0..n * count).map(|p| functions[p % count * n + p / count]).collect();
    let (mut half, mut energy) = (vec![0.0; count * n], vec![0.0; count * count]);
    product(n, n, functions, mask, &mut half);
    product(n, count, &half, &transposed, &mut energy);
    energy
}

/// Energies in each Walsh function of the `size` wavelet functions of one scale: smooth, then details.
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

//! Gram matrices of many patterns: inner products of all pairs, on all threads.

use nalgebra::DMatrix;
use rayon::prelude::*;
use std::ops::Range;

/// Rows and columns of a block that one thread computes.
const BLOCK: usize = 256;

/// Pixels whose products are added in `f32` before they are added to the others in `f64`.
const CHUNK: usize = 1024;

/// Inner products of images, one in each column: a symmetric matrix with a row for each image.
pub(super) fn gram(images: &DMatrix<f32>) -> DMatrix<f64> {
    let count = images.ncols();
    let mut products = DMatrix::<f64>::zeros(count, count);
    products.as_mut_slice().par_chunks_mut(count.max(1) * BLOCK).enumerate().for_each(
        |(at, columns)| {
            let ours = at * BLOCK..((at + 1) * BLOCK).min(count);
            for first in (ours.start..count).step_by(BLOCK) {
                let others = first..(first + BLOCK).min(count);
                let block = block(images, others.clone(), ours.clone());
                for (k, column) in columns.chunks_exact_mut(count).enumerate() {
                    column[others.clone()].copy_from_slice(block.column(k).as_slice());
                }
            }
        },
    );
    products.fill_upper_triangle_with_lower_triangle();
    products
}

/// Products of the images of a block of rows with those of a block of columns.
fn block(images: &DMatrix<f32>, rows: Range<usize>, columns: Range<usize>) -> DMatrix<f64> {
    let pixels = images.nrows();
    let mut sum = DMatrix::<f64>::zeros(rows.len(), columns.len());
    let mut part = DMatrix::<f32>::zeros(rows.len(), columns.len());
    for first in (0..pixels).step_by(CHUNK) {
        let chunk = first..(first + CHUNK).min(pixels);
        // A view with the strides exchanged would save the copy, but nalgebra 0.35 reads beyond such a
        // view where it has few columns.
        let left = images.view((chunk.start, rows.start), (chunk.len(), rows.len())).transpose();
        let right = images.view((chunk.start, columns.start), (chunk.len(), columns.len()));
        part.gemm(1.0, &left, &right, 0.0);
        sum.zip_apply(&part, |sum, part| *sum += f64::from(part));
    }
    sum
}

/// Whether all images are certainly independent: each has more than the part `least` of the largest
/// energy outside the images before it.
pub(super) fn are_independent(mut gram: DMatrix<f64>, least: f64) -> bool {
    let size = gram.nrows();
    let least = least * gram.diagonal().max();
    for first in (0..size).step_by(BLOCK) {
        let (here, after) = (first..(first + BLOCK).min(size), (first + BLOCK).min(size)..size);
        let diagonal = gram.view((first, first), (here.len(), here.len())).into_owned();
        let Some(factor) = diagonal.cholesky() else { return false };
        let factor = factor.l();
        if factor.diagonal().iter().any(|pivot| pivot * pivot <= least) {
            return false;
        }
        if after.is_empty() {
            break;
        }
        let mut panel = gram.view((after.start, first), (after.len(), here.len())).transpose();
        if !factor.solve_lower_triangular_mut(&mut panel) {
            return false;
        }
        // What the images after these have along these is taken from their products.
        let rest = &mut gram.as_mut_slice()[after.start * size..];
        rest.par_chunks_mut(size * BLOCK).enumerate().for_each(|(at, columns)| {
            let start = at * BLOCK;
            let count = columns.len() / size;
            let ours = panel.columns(start, count);
            let below = panel.columns(start, after.len() - start).transpose();
            let taken = below * ours;
            for (k, column) in columns.chunks_exact_mut(size).enumerate() {
                let left = &mut column[after.start + start..];
                left.iter_mut()
                    .zip(taken.column(k).iter())
                    .for_each(|(left, taken)| *left -= taken);
            }
        });
    }
    true
}

//! Cyclic S-matrices: rows of zeros and ones of which each is the one before, moved by one pixel.
//!
//! The first rows are those of M. Harwit and N. J. A. Sloane, *Hadamard Transform Optics* (1979), appendix: quadratic
//! residues, shift registers and twin primes.

use crate::measurement::patterns::Patterns;
use nirspi_recon::Size;

/// The greatest order: a matrix of 128 MiB.
pub(super) const MOST: usize = 4095;

/// Of each degree from 2 on, the exponents below it of a primitive polynomial over two elements, without 0
/// (P. H. R. Scholefield, Proc. IEE 107 B, 1960).
const PRIMITIVE: [&[u32]; 11] =
    [&[1], &[1], &[1], &[2], &[1], &[1], &[2, 3, 4], &[4], &[3], &[2], &[6, 4, 1]];

/// The first row of the matrix of this order, if there is one: a set of (N + 1) / 2 ones of which any two moved copies
/// share (N + 1) / 4.
pub(super) fn first_row(order: usize) -> Option<Vec<bool>> {
    if !(3..=MOST).contains(&order) || order % 4 != 3 {
        return None;
    }
    if is_prime(order) {
        let residues = residues(order);
        return Some((0..order).map(|at| at == 0 || residues[at]).collect());
    }
    if (order + 1).is_power_of_two() {
        return Some(register((order + 1).trailing_zeros()));
    }
    let (one, other) = ((order + 1).isqrt() - 1, (order + 1).isqrt() + 1);
    if one * other != order || !is_prime(one) || !is_prime(other) {
        return None;
    }
    let (of_one, of_other) = (residues(one), residues(other));
    // The difference set holds multiples of the greater prime, and where both residues agree; its complement is larger.
    let in_set = |at: usize| {
        at.is_multiple_of(other)
            || (!at.is_multiple_of(one) && of_one[at % one] == of_other[at % other])
    };
    Some((0..order).map(|at| !in_set(at)).collect())
}

fn is_prime(number: usize) -> bool {
    number >= 2 && (2..=number.isqrt()).all(|factor| !number.is_multiple_of(factor))
}

/// Which numbers below a prime are squares of others, without 0.
fn residues(prime: usize) -> Vec<bool> {
    let mut found = vec![false; prime];
    (1..prime).for_each(|root| found[root * root % prime] = true);
    found
}

/// One period of a shift register of this many bits, which begins with ones.
fn register(bits: u32) -> Vec<bool> {
    let taps = PRIMITIVE[bits as usize - 2];
    let bits = bits as usize;
    let mut sequence = vec![true; bits];
    while sequence.len() < (1 << bits) - 1 {
        let begin = sequence.len() - bits;
        let of_taps = taps.iter().map(|&tap| sequence[begin + tap as usize]);
        let next = of_taps.fold(sequence[begin], |sum, bit| sum ^ bit);
        sequence.push(next);
    }
    sequence
}

/// The patterns for images of this size; by default the size of this many pixels that is nearest to a square.
pub(super) fn patterns(order: usize, size: Option<Size>) -> Result<Patterns, (String, String)> {
    let side = (1..=order.isqrt()).rev().find(|&side| order.is_multiple_of(side)).unwrap_or(1);
    let size = match size {
        Some(size) if size.area() == order => size,
        Some(size) => {
            let expected =
                format!("{order} pixels for s-matrix:{order}, such as {side}x{}", order / side);
            return Err((format!("has {} pixels for {size}", size.area()), expected));
        }
        None => Size::new(side, order / side).map_err(|error| {
            (format!("an image of {side} x {}", order / side), error.to_string())
        })?,
    };
    let row = first_row(order).unwrap_or_default();
    let moved = |by: usize| (0..order).map(move |at| (at + by) % order);
    let weights = (0..order).flat_map(moved).map(|at| f64::from(u8::from(row[at]))).collect();
    Ok(Patterns { size, count: order, weights })
}

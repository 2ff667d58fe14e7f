//! Cyclic S-matrices: rows of zeros and ones of which each is the one before, moved by one pixel.
//!
//! The first rows are those of M. Harwit and N. J. A. Sloane, *Hadamard Transform Optics* (1979), appendix: quadratic
//! residues, shift registers and twin primes.

/// The greatest order: a matrix of 128 MiB.
pub const MOST: usize = 4095;

/// Of each degree from 2 on, the exponents below it of a primitive polynomial over two elements, without 0
/// (P. H. R. Scholefield, Proc. IEE 107 B, 1960).
const PRIMITIVE: [&[u32]; 11] =
    [&[1], &[1], &[1], &[2], &[1], &[1], &[2, 3, 4], &[4], &[3], &[2], &[6, 4, 1]];

/// The first row of the matrix of this order, if there is one: a set of (N + 1) / 2 ones of which any two moved copies
/// share (N + 1) / 4.
#[must_use]
pub fn first_row(order: usize) -> Option<Vec<bool>> {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// A row and its moved copies share a quarter of the ones each: S S^T = (N + 1) / 4 (I + J).
    #[test]
    fn every_order_has_a_row_whose_copies_share_as_many_ones() {
        let orders: Vec<usize> = (1..700).filter(|&order| first_row(order).is_some()).collect();
        assert!(
            [3, 7, 11, 15, 19, 23, 31, 35, 63, 127, 143, 255, 323, 511]
                .iter()
                .all(|order| orders.contains(order))
        );
        for &order in orders.iter().chain(&[1023, 2047, 4095]) {
            let row = first_row(order).unwrap();
            let ones: Vec<usize> = (0..order).filter(|&at| row[at]).collect();
            assert_eq!((row.len(), ones.len()), (order, order.div_ceil(2)), "{order}");
            let some = if order < 200 {
                (1..order).collect()
            } else {
                vec![1, 2, 3, order / 3, order / 2, order - 1]
            };
            for by in some {
                let shared = ones.iter().filter(|&at| row[(at + by) % order]).count();
                assert_eq!(shared, order.div_ceil(4), "order {order} moved by {by}");
            }
        }
        assert_eq!(
            first_row(7).unwrap(),
            [true, true, true, false, true, false, false],
            "Harwit and Sloane"
        );
    }
}

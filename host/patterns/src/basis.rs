//! Orthonormal bases in which images are sparse.
//!
//! # Invariant
//! [`Transform::synthesise`] and [`Transform::analyse`] are inverse to each other
//! (`tests::analysis_and_synthesis_are_inverse_and_keep_energy`) and transposed to each other
//! (`tests::atoms_are_orthonormal`), so energies, angles and least squares are the same for pixels
//! and for coefficients.
//!
//! Atoms are numbered row-major over a grid of coefficients with the size of the image, the mean first.

mod wavelet;

pub use wavelet::merge;

use crate::{Shape, Side, Size};
use pulp::{Arch, Simd, WithSimd};
use std::fmt;
use std::str::FromStr;
use thiserror::Error;

/// An orthonormal basis of images.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Basis {
    /// Single pixels.
    Pixel,
    /// 2-D discrete cosine transform (type II; N. Ahmed et al., *Discrete cosine transform*, 1974).
    /// Atom `width * u + v` has `u` half periods down and `v` across.
    Dct,
    /// 2-D Haar wavelets (S. Mallat's square pyramid, *A theory for multiresolution signal
    /// decomposition*, 1989; A. Haar, 1910).
    Haar,
    /// 2-D Daubechies wavelets of four taps and two vanishing moments, in the same pyramid (I.
    /// Daubechies, *Orthonormal bases of compactly supported wavelets*, 1988). Coefficients are
    /// numbered as Haar's are.
    Daubechies4,
}

/// Error: no basis has this name.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("unknown basis {found:?}, expected {}", Basis::expected())]
pub struct ParseBasisError {
    /// The name that was given.
    pub found: String,
}

impl FromStr for Basis {
    type Err = ParseBasisError;

    fn from_str(name: &str) -> Result<Self, ParseBasisError> {
        let named = Self::ALL.into_iter().find(|basis| basis.name() == name);
        named.ok_or_else(|| ParseBasisError { found: name.to_owned() })
    }
}

impl fmt::Display for Basis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl Basis {
    /// Every basis.
    pub const ALL: [Self; 4] = [Self::Pixel, Self::Dct, Self::Haar, Self::Daubechies4];

    /// The name that [`FromStr`] reads.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Pixel => "pixel",
            Self::Dct => "dct",
            Self::Haar => "haar",
            Self::Daubechies4 => "daubechies4",
        }
    }

    /// The names of all bases, as a list for error messages.
    #[must_use]
    pub fn expected() -> String {
        let [others @ .., last] = Self::ALL.map(Self::name);
        format!("{} or {last}", others.join(", "))
    }

    /// Low-pass taps of a wavelet basis.
    pub fn taps(self) -> Option<&'static [f32]> {
        match self {
            Self::Pixel | Self::Dct => None,
            Self::Haar => Some(wavelet::HAAR),
            Self::Daubechies4 => Some(wavelet::DAUBECHIES_4),
        }
    }

    /// Whether images of this size have the basis: wavelets are those of a [`Side`].
    #[must_use]
    pub fn fits(self, size: impl Shape) -> bool {
        self.taps().is_none() || size.into().side().is_some()
    }

    /// Spatial frequency of every atom, in half periods per longer side of the image. The mean has
    /// frequency 0. A single pixel has no one frequency; its entry is 1.
    #[must_use]
    pub fn frequencies(self, size: impl Shape) -> Vec<f32> {
        let size: Size = size.into();
        let longer = size.height().max(size.width()) as f32;
        let (down, across) = (longer / size.height() as f32, longer / size.width() as f32);
        let octave = |index: usize| if index == 0 { 0 } else { 1 << index.ilog2() };
        (0..size.area())
            .map(|atom| {
                let (u, v) = (atom / size.width(), atom % size.width());
                match self {
                    Self::Pixel => 1.0,
                    Self::Dct => (down * u as f32).hypot(across * v as f32),
                    Self::Haar | Self::Daubechies4 => octave(u.max(v)) as f32,
                }
            })
            .collect()
    }
}

/// A basis prepared for images of one size: of one side by default, or of any [`Size`].
#[derive(Debug, Clone)]
pub struct Transform<S = Side> {
    basis: Basis,
    shape: S,
    /// For the columns and for the rows of an image; empty for other bases than the DCT.
    down: Cosines,
    across: Cosines,
}

/// The orthonormal DCT-II matrix of some length, and its transpose, row-major.
#[derive(Debug, Clone, Default)]
struct Cosines {
    matrix: Vec<f32>,
    transposed: Vec<f32>,
}

impl Cosines {
    fn new(length: usize) -> Self {
        let entries = 0..length * length;
        let entry = |p: usize| cosine(length, p / length, p % length) as f32;
        let mirrored = |p: usize| cosine(length, p % length, p / length) as f32;
        let matrix = entries.clone().map(entry).collect();
        Self { matrix, transposed: entries.map(mirrored).collect() }
    }
}

impl Transform {
    /// Prepares `basis` for images of this side.
    #[must_use]
    pub fn new(basis: Basis, side: Side) -> Self {
        Self::prepared(basis, side)
    }

    /// The side of the images.
    #[must_use]
    pub fn side(&self) -> Side {
        self.shape
    }
}

impl Transform<Size> {
    /// Prepares `basis` for images of this size, if they have the basis ([`Basis::fits`]).
    #[must_use]
    pub fn of_size(basis: Basis, size: Size) -> Option<Self> {
        basis.fits(size).then(|| Self::prepared(basis, size))
    }
}

impl<S: Shape> Transform<S> {
    fn prepared(basis: Basis, shape: S) -> Self {
        let size: Size = shape.into();
        let (down, across) = match basis {
            Basis::Dct => (Cosines::new(size.height()), Cosines::new(size.width())),
            _ => Default::default(),
        };
        Self { basis, shape, down, across }
    }

    /// The basis.
    #[must_use]
    pub fn basis(&self) -> Basis {
        self.basis
    }

    /// Replaces a row-major image by its coefficients.
    ///
    /// # Panics
    /// If the length of `image` is not that of the shape.
    pub fn analyse(&self, image: &mut [f32]) {
        let size = self.check(image);
        match self.basis.taps() {
            Some(taps) => wavelet::analyse(taps, size.width(), image),
            None if self.basis == Basis::Pixel => {}
            None => separable(&self.down.matrix, &self.across.transposed, size, image),
        }
    }

    /// Replaces coefficients by their row-major image.
    ///
    /// # Panics
    /// If the length of `coefficients` is not that of the shape.
    pub fn synthesise(&self, coefficients: &mut [f32]) {
        let size = self.check(coefficients);
        match self.basis.taps() {
            Some(taps) => wavelet::synthesise(taps, size.width(), coefficients),
            None if self.basis == Basis::Pixel => {}
            None => separable(&self.down.transposed, &self.across.matrix, size, coefficients),
        }
    }

    fn check(&self, image: &[f32]) -> Size {
        let size = self.shape.into();
        assert_eq!(image.len(), size.area(), "pixels of a {size} image");
        size
    }
}

/// `left * x * right`.
fn separable(left: &[f32], right: &[f32], size: Size, x: &mut [f32]) {
    let mut half = vec![0.0; x.len()];
    product(size.height(), size.width(), left, x, &mut half);
    x.fill(0.0);
    product(size.width(), size.width(), &half, right, x);
}

/// Adds `a * b` to `out`, all row-major, `a` with `inner` columns and `b` with `columns`.
pub fn product(inner: usize, columns: usize, a: &[f32], b: &[f32], out: &mut [f32]) {
    Arch::new().dispatch(Product { inner, columns, a, b, out });
}

/// [`product`] as a type, because `pulp` compiles a type's method for each vector width.
struct Product<'a> {
    inner: usize,
    columns: usize,
    a: &'a [f32],
    b: &'a [f32],
    out: &'a mut [f32],
}

impl WithSimd for Product<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Self { inner, columns, a, b, out } = self;
        add_product(inner, columns, a, b, out);
    }
}

#[inline(always)]
fn add_product(inner: usize, columns: usize, a: &[f32], b: &[f32], out: &mut [f32]) {
    for (a, out) in a.chunks_exact(inner).zip(out.chunks_exact_mut(columns)) {
        // Two rows of b at a time halve the memory traffic of `out`.
        let (pairs, last) = a.as_chunks::<2>();
        for (pair, b) in pairs.iter().zip(b.chunks_exact(2 * columns)) {
            let (first, second) = b.split_at(columns);
            for ((out, b0), b1) in out.iter_mut().zip(first).zip(second) {
                *out += pair[0] * b0 + pair[1] * b1;
            }
        }
        for last in last {
            for (out, b) in out.iter_mut().zip(&b[(inner - 1) * columns..]) {
                *out += last * b;
            }
        }
    }
}

/// Value at a pixel of the orthonormal cosine (DCT type II) that has `frequency` half periods over `n` pixels.
#[must_use]
pub fn cosine(n: usize, frequency: usize, pixel: usize) -> f64 {
    let scale = if frequency == 0 { 1.0 } else { 2.0 } / n as f64;
    let angle = std::f64::consts::PI * ((2 * pixel + 1) * frequency) as f64 / (2 * n) as f64;
    scale.sqrt() * angle.cos()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::side;
    use proptest::prelude::*;

    const ALL: [Basis; 4] = Basis::ALL;

    fn energy(x: &[f32]) -> f64 {
        x.iter().map(|&v| f64::from(v).powi(2)).sum()
    }

    proptest! {
        #[test]
        fn analysis_and_synthesis_are_inverse_and_keep_energy(
            log in 1_u32..=6, basis in prop::sample::select(ALL.to_vec()), seed: u64
        ) {
            let side = side(1 << log);
            let image: Vec<f32> = (0..side.area() as u64)
                .map(|p| ((p + 1).wrapping_mul(seed | 1) >> 40) as f32 / (1 << 23) as f32 - 1.0)
                .collect();
            let transform = Transform::new(basis, side);
            let mut x = image.clone();
            transform.analyse(&mut x);
            prop_assert!((energy(&x) / energy(&image) - 1.0).abs() < 1e-5);
            transform.synthesise(&mut x);
            prop_assert!(x.iter().zip(&image).all(|(a, b)| (a - b).abs() < 1e-5));
            transform.synthesise(&mut x);
            transform.analyse(&mut x);
            prop_assert!(x.iter().zip(&image).all(|(a, b)| (a - b).abs() < 1e-5));
        }
    }

    #[test]
    fn atoms_are_orthonormal() {
        for (height, width) in [(8, 8), (5, 7), (6, 4), (1, 9), (3, 1)] {
            let size = Size::new(height, width).unwrap();
            for basis in ALL.into_iter().filter(|basis| basis.fits(size)) {
                orthonormal(&Transform::of_size(basis, size).unwrap());
            }
            assert_eq!(Basis::Haar.fits(size), height == 8);
        }
    }

    fn orthonormal(transform: &Transform<Size>) {
        let (basis, area) = (transform.basis(), transform.shape.area());
        let atoms: Vec<Vec<f32>> = (0..area)
            .map(|atom| {
                let mut x = vec![0.0; area];
                x[atom] = 1.0;
                transform.synthesise(&mut x);
                x
            })
            .collect();
        for (i, a) in atoms.iter().enumerate() {
            for (j, b) in atoms.iter().enumerate() {
                let dot: f32 = a.iter().zip(b).map(|(a, b)| a * b).sum();
                let expected = if i == j { 1.0 } else { 0.0 };
                assert!((dot - expected).abs() < 1e-5, "{basis} atoms {i} and {j}");
            }
            let mut x = a.clone();
            transform.analyse(&mut x);
            assert!((x[i] - 1.0).abs() < 1e-5, "{basis} atom {i}");
        }
    }

    /// A wave has the same frequency across an image and down its transpose.
    #[test]
    fn frequencies_are_in_half_periods_per_longer_side() {
        let [wide, high] = [(2, 6), (6, 2)].map(|(h, w)| Size::new(h, w).unwrap());
        let [across, down] = [wide, high].map(|size| Basis::Dct.frequencies(size));
        assert_eq!(across[..6], [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(across[6], 3.0);
        for (u, v) in (0..2).flat_map(|u| (0..6).map(move |v| (u, v))) {
            assert_eq!(across[u * 6 + v], down[v * 2 + u]);
        }
    }

    #[test]
    fn dct_follows_its_formula_and_haar_its_pyramid() {
        let mut x: Vec<f32> = (0..16).map(|p| [3.0, 1.0, -1.0, -3.0][p % 4]).collect();
        let image = x.clone();
        Transform::new(Basis::Dct, side(4)).analyse(&mut x);
        for (v, found) in x[..4].iter().enumerate() {
            let sum: f64 = (0..4).map(|c| f64::from(image[c]) * cosine(4, v, c)).sum();
            assert!((f64::from(*found) - 2.0 * sum).abs() < 1e-5, "frequency {v}");
        }
        let mut x = image;
        Transform::new(Basis::Haar, side(4)).analyse(&mut x);
        // Left half minus right half, then differences of neighbours, in rows of the square
        // pyramid.
        let expected = [0.0, 8.0, 2.0, 2.0, 0.0, 0.0, 2.0, 2.0];
        assert!(x.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{x:?}");
        assert!(x[8..].iter().all(|v| v.abs() < 1e-5));
    }

    #[test]
    fn daubechies_wavelets_do_not_see_a_slope() {
        let side = side(16);
        let mut x: Vec<f32> = (0..256).map(|p| (p % 16) as f32 + 2.0 * (p / 16) as f32).collect();
        Transform::new(Basis::Daubechies4, side).analyse(&mut x);
        // Details of the finest scale, without the border, where the slope ends.
        for (r, c) in (0..7).flat_map(|r| (0..7).map(move |c| (r, c))) {
            for at in [16 * (r + 8) + c, 16 * r + c + 8, 16 * (r + 8) + c + 8] {
                assert!(x[at].abs() < 1e-4, "{r}, {c}: {}", x[at]);
            }
        }
    }

    #[test]
    fn an_image_of_another_side_is_a_panic_in_every_basis() {
        for basis in ALL {
            let transform = Transform::new(basis, side(4));
            let longer = || std::panic::catch_unwind(|| transform.analyse(&mut [0.0; 64]));
            let shorter = || std::panic::catch_unwind(|| transform.synthesise(&mut [0.0; 4]));
            assert!(longer().is_err() && shorter().is_err(), "{basis}");
        }
    }

    #[test]
    fn a_product_of_matrices_is_added() {
        let mut out = [100.0; 6];
        let (a, b) = ([1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0, 9.0, 10.0]);
        product(2, 3, &a, &b, &mut out);
        assert_eq!(out, [121.0, 124.0, 127.0, 147.0, 154.0, 161.0]);
    }

    #[test]
    fn names_round_trip() {
        for basis in ALL {
            assert_eq!(basis.to_string().parse(), Ok(basis));
        }
        assert_eq!("DCT".parse::<Basis>(), Err(ParseBasisError { found: "DCT".into() }));
        let error = "DCT".parse::<Basis>().unwrap_err().to_string();
        assert_eq!(error, "unknown basis \"DCT\", expected pixel, dct, haar or daubechies4");
    }
}

//! The Fréchet distance between two sets of features, each taken as a Gaussian.
//!
//! d = |m1 - m2|^2 + tr(C1 + C2 - 2 (C1 C2)^(1/2)) with means m and sample covariances C (Dowson
//! and Landau, J. Multivariate Anal. 12, 1982; Heusel et al., NIPS 2017, on Inception's features:
//! FID). With C1 = A^T A and C2 = B^T B the trace of the root is the sum of the singular values of
//! A B^T. So no root of an asymmetric matrix is necessary, and there may be fewer images than
//! features.
//!
//! # Invariant
//! The distance is symmetric, never negative, and 0 for equal sets, up to rounding
//! (`tests::it_is_symmetric_and_zero_for_equal_sets`).
//!
//! The distance grows as the sets get smaller, so compare only distances of equal numbers of
//! images.

use nalgebra::{DMatrix, RowDVector};
use nirspi_recon::words::count_of;
use thiserror::Error;

/// Why two sets have no distance.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum FrechetError {
    /// A set has fewer than two images, so it has no covariance.
    #[error("the {which} set has {}, expected at least 2", count_of(*found, "image"))]
    TooFew {
        /// `reference` or `test`.
        which: &'static str,
        /// Number of its images.
        found: usize,
    },
    /// The values are not whole rows.
    #[error("the {which} set has {found} values, expected a multiple of {features} features")]
    Shape {
        /// `reference` or `test`.
        which: &'static str,
        /// Number of its values.
        found: usize,
        /// Number of features of an image.
        features: usize,
    },
    /// A feature is NaN or infinite.
    #[error(
        "feature {feature} of image {image} of the {which} set is {found}, expected a finite number"
    )]
    NotFinite {
        /// `reference` or `test`.
        which: &'static str,
        /// Row of the value.
        image: usize,
        /// Column of the value.
        feature: usize,
        /// The value.
        found: f32,
    },
}

/// The Fréchet distance between two sets of images by their features, each (N, `features`),
/// row-major, N >= 2.
///
/// # Errors
/// [`FrechetError`] if a set has fewer than two images, values that are not whole rows, or a value
/// that is not finite.
pub fn frechet_distance(
    reference: &[f32],
    test: &[f32],
    features: usize,
) -> Result<f64, FrechetError> {
    let reference = Gaussian::fit("reference", reference, features)?;
    let test = Gaussian::fit("test", test, features)?;
    let means = (&reference.mean - &test.mean).norm_squared();
    let product = &reference.factor * test.factor.transpose();
    let smaller = if product.nrows() <= product.ncols() {
        &product * product.transpose()
    } else {
        product.tr_mul(&product)
    };
    // Rounding makes some zero eigenvalues slightly negative.
    let root: f64 = smaller.symmetric_eigenvalues().iter().map(|v| v.max(0.0).sqrt()).sum();
    let spread = reference.factor.norm_squared() + test.factor.norm_squared() - 2.0 * root;
    Ok((means + spread).max(0.0))
}

/// Mean and covariance of features.
struct Gaussian {
    mean: RowDVector<f64>,
    /// A matrix A with covariance A^T A. It has as many rows as there are images or features,
    /// whichever is fewer.
    factor: DMatrix<f64>,
}

impl Gaussian {
    fn fit(which: &'static str, values: &[f32], features: usize) -> Result<Self, FrechetError> {
        if features == 0 || !values.len().is_multiple_of(features) {
            return Err(FrechetError::Shape { which, found: values.len(), features });
        }
        let images = values.len() / features;
        if images < 2 {
            return Err(FrechetError::TooFew { which, found: images });
        }
        if let Some(at) = values.iter().position(|v| !v.is_finite()) {
            let (image, feature) = (at / features, at % features);
            return Err(FrechetError::NotFinite { which, image, feature, found: values[at] });
        }
        let rows = values.iter().map(|&v| f64::from(v));
        let mut centred = DMatrix::from_row_iterator(images, features, rows);
        let mean = centred.row_mean();
        for mut row in centred.row_iter_mut() {
            row -= &mean;
        }
        centred /= ((images - 1) as f64).sqrt();
        let factor = if images > features { centred.qr().r() } else { centred };
        Ok(Self { mean, factor })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Features of the run of `scripts/frechet_reference.py` whose results are below.
    fn features(images: usize, count: usize, phase: f64, gain: f64) -> Vec<f32> {
        let value = |(i, j): (usize, usize)| {
            let wave = (0.37 * (i * (j + 1)) as f64 + phase).sin() + 0.2 * (1.9 * j as f64).cos();
            // Values like those of a ReLU: never negative, some always zero.
            (gain * wave * f64::from(u8::from(j % 5 != 3)) + 0.1 * (i % 3) as f64).max(0.0) as f32
        };
        (0..images).flat_map(|i| (0..count).map(move |j| (i, j))).map(value).collect()
    }

    /// Results of SciPy 1.17.1 by `scripts/frechet_reference.py`: images of either set, features,
    /// distance. The sets have fewer images than features, as many, more, and two.
    const SCIPY: [(usize, usize, usize, f64); 5] = [
        (40, 50, 8, 0.3278976136933225),
        (12, 9, 16, 2.726803297361341),
        (16, 17, 16, 1.0338100470412925),
        (2, 2, 5, 3.175891633068347),
        (300, 200, 32, 2.348239908677117),
    ];

    #[test]
    fn distances_are_those_of_scipy() {
        for (images, others, count, expected) in SCIPY {
            let (a, b) = (features(images, count, 0.0, 1.0), features(others, count, 0.8, 1.4));
            let found = frechet_distance(&a, &b, count).unwrap();
            let off = (found / expected - 1.0).abs();
            assert!(off < 1e-6, "{images} {others} {count}: {found}, expected {expected}");
        }
    }

    proptest! {
        #[test]
        fn it_is_symmetric_and_zero_for_equal_sets(
            a in prop::collection::vec(-3.0_f32..3.0, 24), b in prop::collection::vec(-3.0_f32..3.0, 36),
        ) {
            for count in [2, 6, 12] {
                let there = frechet_distance(&a, &b, count).unwrap();
                let back = frechet_distance(&b, &a, count).unwrap();
                prop_assert!((there - back).abs() < 1e-6 && there >= 0.0, "{there} {back}");
                prop_assert!(frechet_distance(&a, &a, count).unwrap() < 1e-6);
            }
        }

        #[test]
        fn a_shift_of_all_images_is_its_squared_length(
            a in prop::collection::vec(-3.0_f32..3.0, 40), shift in -2.0_f32..2.0
        ) {
            let moved: Vec<f32> = a.iter().map(|v| v + shift).collect();
            let found = frechet_distance(&a, &moved, 4).unwrap();
            prop_assert!((found - 4.0 * f64::from(shift).powi(2)).abs() < 1e-4);
        }
    }

    #[test]
    fn of_one_feature_it_is_the_difference_of_means_and_of_deviations() {
        // Means 1 and 5, sample deviations sqrt 2 and 3 sqrt 2, so the distance is 16 + (2 sqrt
        // 2)^2.
        let found = frechet_distance(&[0.0, 2.0], &[2.0, 8.0], 1).unwrap();
        assert!((found - 24.0).abs() < 1e-12, "{found}");
    }

    #[test]
    fn what_has_no_distance_is_named() {
        let good = [0.0, 1.0, 2.0, 3.0];
        let of = |a: &[f32], count| frechet_distance(a, &good, count).unwrap_err();
        assert_eq!(of(&[1.0, 2.0], 2), FrechetError::TooFew { which: "reference", found: 1 });
        let shape = |found, features| FrechetError::Shape { which: "reference", found, features };
        assert_eq!(of(&[1.0; 3], 2), shape(3, 2));
        assert_eq!(of(&[1.0; 3], 0), shape(3, 0));
        let hole = of(&[1.0, 2.0, f32::INFINITY, 4.0], 2);
        assert!(matches!(hole, FrechetError::NotFinite { image: 1, feature: 0, .. }), "{hole}");
    }
}

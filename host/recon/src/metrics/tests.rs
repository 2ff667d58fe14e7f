use super::*;
use proptest::prelude::*;

/// The images of the scikit-image run whose numbers are below.
fn images(width: usize, height: usize) -> (Vec<f32>, Vec<f32>) {
    let pixel = |p: usize| {
        let (r, c) = ((p / width) as f64, (p % width) as f64);
        let texture = ((p / width * 7 + p % width * 13) % 5) as f64 / 5.0;
        let a = (0.5 + 0.3 * (0.7 * r).sin() * (0.31 * c).cos() + 0.1 * texture) as f32;
        (a, (f64::from(a) + 0.08 * (1.3 * r + 0.9 * c).cos()) as f32)
    };
    (0..width * height).map(pixel).unzip()
}

/// Results of scikit-image 0.26.0's `structural_similarity` (with `gaussian_weights=True,
/// sigma=1.5, use_sample_covariance=False`) and `peak_signal_noise_ratio`, and of NumPy 2.4.6's
/// `corrcoef`.
const SCIKIT_IMAGE: [(usize, usize, f64, [f64; 3]); 6] = [
    (11, 11, 1.0, [0.8408564484487093, 24.927084415243268, 0.9357892529036881]),
    (11, 11, 2.0, [0.8596963796565399, 30.947684328522893, 0.9357892529036881]),
    (24, 17, 1.0, [0.8948633080549317, 24.948038335134246, 0.9422525945115093]),
    (24, 17, 2.0, [0.9044968819813741, 30.96863824841387, 0.9422525945115093]),
    (64, 64, 1.0, [0.9036648759077811, 24.94736490742759, 0.9384917013312654]),
    (64, 64, 2.0, [0.9117531946000245, 30.967964820707216, 0.9384917013312654]),
];

#[test]
fn numbers_are_those_of_scikit_image() {
    for (width, height, range, [similarity, ratio, pearson]) in SCIKIT_IMAGE {
        let (a, b) = images(width, height);
        assert!((ssim(&a, &b, width, height, range).unwrap() - similarity).abs() < 1e-9);
        assert!((psnr(&a, &b, width, height, range).unwrap() - ratio).abs() < 1e-9);
        assert!((correlation(&a, &b, width, height).unwrap() - pearson).abs() < 1e-9);
    }
}

#[test]
fn what_is_not_defined_is_an_error() {
    let (a, b) = images(12, 12);
    let shape = MetricError::Shape { which: "test", found: 143, width: 12, height: 12 };
    assert_eq!(ssim(&a, &b[1..], 12, 12, 1.0), Err(shape));
    let mut holed = b.clone();
    holed[5] = f32::NAN;
    assert!(matches!(
        psnr(&a, &holed, 12, 12, 1.0),
        Err(MetricError::NotFinite { which: "test", index: 5, .. })
    ));
    let small = MetricError::TooSmall { width: 10, height: 12, least: 11 };
    assert_eq!(ssim(&a[..120], &b[..120], 10, 12, 1.0), Err(small));
    assert_eq!(
        correlation(&[], &[], 0, 0),
        Err(MetricError::TooSmall { width: 0, height: 0, least: 1 })
    );
    assert_eq!(correlation(&a, &[0.1; 144], 12, 12), Err(MetricError::Flat { which: "test" }));
    for found in [0.0, -1.0, f64::INFINITY] {
        assert_eq!(psnr(&a, &b, 12, 12, found), Err(MetricError::DataRange { found }));
    }
    assert!(ssim(&a, &b, usize::MAX, 2, 1.0).is_err());
}

proptest! {
    #[test]
    fn an_image_is_like_itself_and_no_image_is_more_so(
        image in prop::collection::vec(0.0_f32..1.0, 169), other in prop::collection::vec(0.0_f32..1.0, 169)
    ) {
        prop_assert_eq!(psnr(&image, &image, 13, 13, 1.0), Ok(f64::INFINITY));
        prop_assert!((ssim(&image, &image, 13, 13, 1.0).unwrap() - 1.0).abs() < 1e-12);
        prop_assert!((correlation(&image, &image, 13, 13).unwrap() - 1.0).abs() < 1e-12);
        prop_assert!(ssim(&image, &other, 13, 13, 1.0).unwrap() < 1.0);
        let swapped = ssim(&other, &image, 13, 13, 1.0).unwrap();
        prop_assert!((ssim(&image, &other, 13, 13, 1.0).unwrap() - swapped).abs() < 1e-12);
    }

    #[test]
    fn correlation_does_not_see_brightness_and_contrast(
        image in prop::collection::vec(0.0_f32..1.0, 64), gain in 0.1_f32..10.0, offset in -5.0_f32..5.0
    ) {
        let stretched: Vec<f32> = image.iter().map(|p| gain * p + offset).collect();
        prop_assert!(correlation(&image, &stretched, 8, 8).unwrap() > 0.999_99);
        let inverted: Vec<f32> = image.iter().map(|p| -p).collect();
        prop_assert!(correlation(&image, &inverted, 8, 8).unwrap() < -0.999_99);
    }
}

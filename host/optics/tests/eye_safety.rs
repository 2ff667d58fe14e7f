//! When light counts as safe without end.

use nirspi_optics::CameraModel;
use nirspi_optics::safety::{EyeSafety, LONG_EXPOSURE_LIMIT_W_PER_M2};

/// Optics that focus near the lens are brighter at 200 mm than at the lens.
#[test]
fn light_is_within_the_limit_only_if_it_is_at_the_lens_and_at_200_mm() {
    let of = |at_lens_w_per_m2, at_200_mm_w_per_m2| {
        let of_paper = EyeSafety::of(CameraModel::paper()).unwrap();
        EyeSafety { at_lens_w_per_m2, at_200_mm_w_per_m2, ..of_paper }.is_within_the_limit()
    };
    let most = LONG_EXPOSURE_LIMIT_W_PER_M2;
    assert!(of(most, most));
    assert!(!of(1.01 * most, 0.5 * most));
    assert!(!of(0.5 * most, 1.01 * most));
}

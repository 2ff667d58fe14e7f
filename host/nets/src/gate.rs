//! The gate: leaves an image that is sharp and clean unchanged, so that enhancement does no harm.
//!
//! # Invariant
//! Below the lower bounds of blur and noise the enhanced image has no share in the result; above an
//! upper bound it has the whole share. Between the bounds its share grows linearly, so a small
//! change of the input never makes a jump
//! (`tests::sharp_and_clean_stays_and_either_flaw_opens_the_gate`).

use rayon::prelude::*;

use crate::estimate::Estimate;

/// Bounds of the blur, in pixels of the output grid: where the gate begins to open, and where it is
/// fully open.
const SIGMA_PX: [f32; 2] = [0.35, 0.5];

/// Bounds of the noise of a reading, a white target being 1.
const NOISE: [f32; 2] = [0.004, 0.008];

/// Share of the enhanced image in the result, 0 to 1.
pub(crate) fn share(estimate: &Estimate) -> f32 {
    let between = |value: f32, [from, to]: [f32; 2]| ((value - from) / (to - from)).clamp(0.0, 1.0);
    between(estimate.sigma_px, SIGMA_PX).max(between(estimate.noise, NOISE))
}

/// Mixes into `enhanced`, images of `area` pixels, the share of each input that the gate keeps.
/// `input` makes input k, and is called only for images whose gate is not fully open.
pub(crate) fn close<I: AsRef<[f32]>>(
    estimates: &[Estimate],
    area: usize,
    enhanced: &mut [f32],
    input: impl Fn(usize) -> I + Sync,
) {
    let images = enhanced.par_chunks_exact_mut(area).zip(estimates).enumerate();
    images.for_each(|(index, (enhanced, estimate))| {
        let share = share(estimate);
        if share < 1.0 {
            let input = input(index);
            enhanced.iter_mut().zip(input.as_ref()).for_each(|(e, i)| *e = i + share * (*e - i));
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sharp_and_clean_stays_and_either_flaw_opens_the_gate() {
        for (sigma_px, noise, expected) in [
            (0.0, 0.0, 0.0),
            (0.35, 0.004, 0.0),
            (0.425, 0.0, 0.5),
            (0.0, 0.006, 0.5),
            (0.5, 0.0, 1.0),
            (0.1, 0.05, 1.0),
            (4.0, 0.1, 1.0),
        ] {
            let share = share(&Estimate { sigma_px, noise });
            assert!((share - expected).abs() < 1e-5, "{sigma_px} {noise}: {share}");
        }
    }

    #[test]
    fn each_image_gets_its_share_and_an_open_gate_asks_for_no_input() {
        let estimates = [0.1, 0.425, 2.0].map(|sigma_px| Estimate { sigma_px, noise: 0.001 });
        let mut enhanced = [1.0; 6];
        let inputs = [[0.2, 0.3], [0.2, 0.4]];
        close(&estimates, 2, &mut enhanced, |index| inputs[index]);
        let expected = [0.2, 0.3, 0.6, 0.7, 1.0, 1.0];
        assert!(enhanced.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{enhanced:?}");
    }
}

//! Pictures of other sizes.

/// How a pixel of the new picture weighs the pixels of the old one around it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Filter {
    /// A triangle: averages when the picture becomes smaller, interpolates when it becomes larger.
    /// It spans two pixels of the smaller picture, so detail that is too fine is blurred instead of
    /// becoming false detail, and no value lies outside of those that were there.
    Triangle,
    /// A cubic by E. Catmull and R. Rom (1974): sharper, and may overshoot at edges.
    CatmullRom,
}

impl Filter {
    /// Pixels on each side that count, where the picture does not become smaller.
    fn reach(self) -> f32 {
        match self {
            Self::Triangle => 1.0,
            Self::CatmullRom => 2.0,
        }
    }

    fn weight(self, distance: f32) -> f32 {
        let x = distance.abs();
        match self {
            Self::Triangle => (1.0 - x).max(0.0),
            Self::CatmullRom if x < 1.0 => (9.0 * x.powi(3) - 15.0 * x.powi(2) + 6.0) / 6.0,
            Self::CatmullRom if x < 2.0 => {
                (-3.0 * x.powi(3) + 15.0 * x.powi(2) - 24.0 * x + 12.0) / 6.0
            }
            Self::CatmullRom => 0.0,
        }
    }
}

/// The values of a picture of another size: columns and rows, row-major. A picture of the same size
/// stays as it is.
///
/// # Panics
/// If a side is 0, or there are not as many values as pixels.
#[must_use]
pub fn resample(values: &[f32], from: (u32, u32), to: (u32, u32), filter: Filter) -> Vec<f32> {
    let [width, height, new_width, new_height] =
        [from.0, from.1, to.0, to.1].map(|side| side as usize);
    assert_eq!(values.len(), width * height, "values of a {width} x {height} picture");
    assert!(!values.is_empty() && new_width * new_height > 0, "a picture without pixels");
    if from == to {
        return values.to_vec();
    }
    let columns = weights(width, new_width, filter);
    let mut resampled = Vec::with_capacity(new_width * new_height);
    let mut row = vec![0.0; width];
    for (top, weights) in weights(height, new_height, filter) {
        row.fill(0.0);
        for (old, weight) in values[top * width..].chunks_exact(width).zip(weights) {
            row.iter_mut().zip(old).for_each(|(sum, value)| *sum += value * weight);
        }
        resampled.extend(columns.iter().map(|(left, weights)| {
            row[*left..].iter().zip(weights).fold(0.0, |sum, (value, weight)| sum + value * weight)
        }));
    }
    resampled
}

/// For each new pixel along one side, the first old pixel that counts, and the weights from there
/// on, whose sum is 1.
fn weights(old: usize, new: usize, filter: Filter) -> Vec<(usize, Vec<f32>)> {
    let ratio = old as f32 / new as f32;
    let scale = ratio.max(1.0);
    let reach = filter.reach() * scale;
    let of_pixel = |pixel: usize| {
        let centre = (pixel as f32 + 0.5) * ratio;
        let first = ((centre - reach).floor().max(0.0) as usize).min(old - 1);
        let end = ((centre + reach).ceil() as usize).clamp(first + 1, old);
        let weight = |k: usize| filter.weight((k as f32 - (centre - 0.5)) / scale);
        let sum: f32 = (first..end).map(weight).sum();
        (first, (first..end).map(|k| weight(k) / sum).collect())
    };
    (0..new).map(of_pixel).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// What Pillow 13.0 gives for a picture of 7 x 5 pixels: `Image.fromarray(a).resize(to, filter)`
    /// with `BILINEAR` and `BICUBIC`, which are the same two filters.
    const PILLOW: [((u32, u32), Filter, &[f32]); 4] = [
        ((3, 2), Filter::Triangle, &[4.45779, 3.81283, 3.52922, 3.52922, 4.10695, 3.81493]),
        ((3, 2), Filter::CatmullRom, &[4.48499, 3.78372, 3.6175, 3.55566, 4.19845, 3.76425]),
        (
            (9, 2),
            Filter::CatmullRom,
            &[
                4.12267, 4.9348, 4.45982, 3.55684, 4.2492, 3.32693, 3.44482, 3.78701, 3.71572,
                3.7855, 3.27696, 3.6307, 4.16361, 3.51671, 4.89804, 4.77945, 3.58726, 2.49893,
            ],
        ),
        (
            (4, 6),
            Filter::Triangle,
            &[
                0.61905, 4.8, 5.72, 3.09524, 5.15476, 4.32, 1.79, 2.66667, 6.86111, 3.71667,
                3.25667, 4.6627, 4.32143, 2.66667, 5.89, 5.3373, 1.46429, 2.93, 5.51, 3.25,
                4.14286, 6.8, 1.64, 0.57143,
            ],
        ),
    ];

    #[test]
    fn pictures_are_those_of_pillow() {
        let old: Vec<f32> = (0..35).map(|k| (k * k % 11) as f32).collect();
        for (to, filter, expected) in PILLOW {
            let new = resample(&old, (7, 5), to, filter);
            assert_eq!(new.len(), expected.len());
            for (found, expected) in new.iter().zip(expected) {
                assert!((found - expected).abs() < 2e-5, "{filter:?}: {found} {expected}");
            }
        }
    }

    proptest! {
        #[test]
        fn a_flat_picture_stays_flat_and_a_triangle_stays_within_what_was_there(
            values in proptest::collection::vec(0.0_f32..1.0, 30), width in 1_u32..20, height in 1_u32..20,
        ) {
            for filter in [Filter::Triangle, Filter::CatmullRom] {
                for value in resample(&[0.25; 30], (6, 5), (width, height), filter) {
                    prop_assert!((value - 0.25).abs() < 1e-6);
                }
            }
            let (least, most) = values.iter().fold((1.0_f32, 0.0_f32), |(a, b), v| (a.min(*v), b.max(*v)));
            for value in resample(&values, (6, 5), (width, height), Filter::Triangle) {
                prop_assert!((least - 1e-6..=most + 1e-6).contains(&value));
            }
        }
    }
}

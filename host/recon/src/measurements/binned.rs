//! Measurements of a smaller image: of its patterns, the larger image's patterns of squares are those.

use super::Measurements;
use crate::{Rows, Side};

impl Measurements {
    /// The measurements of the image of this side whose pixels are the means of squares of pixels. They are
    /// those of the patterns that are the same all over each square. `None` if the side is not smaller, or no
    /// such pattern was measured.
    #[must_use]
    pub fn binned(&self, side: Side) -> Option<Self> {
        let (n, small) = (self.side().pixels() as u32, side.pixels() as u32);
        if small >= n {
            return None;
        }
        let factor = n / small;
        let row = |row: u32| {
            let (down, across) = (row / n, row % n);
            let is_coarse = down.is_multiple_of(factor) && across.is_multiple_of(factor);
            is_coarse.then_some(down / factor * small + across / factor)
        };
        let area = f64::from(factor * factor);
        let coarse = self.rows.iter().zip(&self.values);
        let coarse = coarse.filter_map(|(&of, value)| Some((row(of)?, value / area)));
        let (rows, values): (Vec<u32>, Vec<f64>) = coarse.unzip();
        let [noise, most_noise] =
            [self.noise, self.most_noise].map(|of| of.map(|sigma| sigma / area));
        (!rows.is_empty()).then(|| Self {
            rows: Rows::trusted(side, rows),
            values,
            noise,
            most_noise,
            kind: None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{noisy, side};
    use crate::{Order, fwht};

    #[test]
    fn the_smaller_image_has_the_means_of_squares() {
        let scene: Vec<f64> = (0..256).map(|p| f64::from((p * p) % 97)).collect();
        let all = noisy(&Order::ZigZag.rows(side(16)).unwrap(), &scene, 0.0, 1);
        let small = all.binned(side(4)).unwrap();
        assert_eq!((small.rows().len(), small.side()), (16, side(4)));
        let mut spectrum = vec![0.0_f32; 16];
        for (&row, value) in small.rows().iter().zip(small.values()) {
            spectrum[row as usize] = *value as f32;
        }
        fwht(&mut spectrum).unwrap();
        for (at, found) in spectrum.iter().map(|pixel| pixel / 16.0).enumerate() {
            let square = (0..16).map(|k| scene[(at / 4 * 4 + k / 4) * 16 + at % 4 * 4 + k % 4]);
            let expected = square.sum::<f64>() / 16.0;
            assert!((f64::from(found) - expected).abs() < 1e-3, "{at}: {found} {expected}");
        }
        assert_eq!((all.binned(side(16)), all.binned(side(32))), (None, None));
        let fine = Rows::new(side(16), [1_i64, 17]).unwrap();
        let fine = Measurements::from_differential(&fine, &[1.0, 2.0]).unwrap();
        assert_eq!(fine.binned(side(4)), None);
    }
}

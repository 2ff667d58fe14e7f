//! The blur that is undone: a Gaussian, sampled and normalised, with a reflecting edge.
//!
//! Beyond the edge the image goes on mirrored (d c b a | a b c d | d c b a), as light that an edge throws back. The
//! law: with a symmetric kernel this blur is its own adjoint, keeps the mean, and is diagonal in the DCT-II
//! (Strang, SIAM Review 41, 1999).

/// Kernel standard deviations from its middle to its end; what lies beyond is under 1e-4 of the light.
const REACH_SIGMAS: f32 = 4.0;

/// A Gaussian blur of images of one size.
#[derive(Debug, Clone, PartialEq)]
pub struct Blur {
    height: usize,
    width: usize,
    /// The kernel from its middle outwards; twice its sum is 1 more than its middle.
    half: Vec<f32>,
}

impl Blur {
    /// A blur of standard deviation `sigma_px` >= 0 for images of `height` x `width`.
    #[must_use]
    pub fn new(height: usize, width: usize, sigma_px: f32) -> Self {
        let reach = (REACH_SIGMAS * sigma_px).ceil() as i32;
        let weight = |at: i32| {
            let z = f64::from(at) / f64::from(sigma_px.max(f32::MIN_POSITIVE));
            (-0.5 * z * z).exp()
        };
        let sum: f64 = (-reach..=reach).map(weight).sum();
        let half = (0..=reach).map(|at| (weight(at) / sum) as f32).collect();
        Self { height, width, half }
    }

    /// Rows and columns of the images.
    #[must_use]
    pub fn size(&self) -> (usize, usize) {
        (self.height, self.width)
    }

    /// The blurred image, row-major; its adjoint does the same.
    ///
    /// # Panics
    /// If the image is of another size.
    #[must_use]
    pub fn apply(&self, image: &[f32]) -> Vec<f32> {
        assert_eq!(image.len(), self.height * self.width, "pixels");
        let reach = self.half.len() - 1;
        let mut wide = vec![0.0; self.width + 2 * reach];
        let mut across = Vec::with_capacity(image.len());
        for row in image.chunks_exact(self.width) {
            for (at, pixel) in wide.iter_mut().enumerate() {
                *pixel = row[reflected(at as isize - reach as isize, self.width)];
            }
            across.extend((reach..reach + self.width).map(|middle| {
                let beside =
                    |(k, weight): (usize, &f32)| weight * (wide[middle - k] + wide[middle + k]);
                let sides: f32 = self.half.iter().enumerate().skip(1).map(beside).sum();
                self.half[0] * wide[middle] + sides
            }));
        }
        let mut blurred = vec![0.0; image.len()];
        for (r, out) in blurred.chunks_exact_mut(self.width).enumerate() {
            for (k, weight) in self.half.iter().enumerate() {
                let (r, k) = (r as isize, k as isize);
                // The middle row counts once.
                let rows = if k == 0 { vec![r] } else { vec![r - k, r + k] };
                for row in rows {
                    let from = reflected(row, self.height) * self.width;
                    let line = &across[from..from + self.width];
                    out.iter_mut().zip(line).for_each(|(out, pixel)| *out += weight * pixel);
                }
            }
        }
        blurred
    }

    /// What the blur leaves of the waves of a DCT-II along the rows and along the columns: wave (k, l) of an image is
    /// multiplied by `down[k] * across[l]`.
    #[must_use]
    pub fn transfer(&self) -> (Vec<f64>, Vec<f64>) {
        let along = |length: usize| {
            let of = |wave: usize| {
                let angle = std::f64::consts::PI * wave as f64 / length as f64;
                let side = |(k, w): (usize, &f32)| 2.0 * f64::from(*w) * (angle * k as f64).cos();
                let sides: f64 = self.half.iter().enumerate().skip(1).map(side).sum();
                f64::from(self.half[0]) + sides
            };
            (0..length).map(of).collect()
        };
        (along(self.height), along(self.width))
    }
}

/// Where in a line of `length` pixels the mirrored line has index `at`.
fn reflected(at: isize, length: usize) -> usize {
    let period = 2 * length as isize;
    let at = at.rem_euclid(period);
    if at < length as isize { at as usize } else { (period - 1 - at) as usize }
}

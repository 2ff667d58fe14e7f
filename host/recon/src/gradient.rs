//! Steps along the gradient of an image and along its divergence, of which methods with total variation are made.
//!
//! The dual of the algorithm of Chambolle and Pock has two numbers for each pixel: `down` and `across`.

/// Moves the dual up the gradient of the image `x`, and projects it back into the unit discs.
pub fn climb(width: usize, x: &[f32], step: f32, down: &mut [f32], across: &mut [f32]) {
    let height = x.len() / width;
    for r in 0..height {
        let below = if r + 1 < height { r + 1 } else { r };
        for c in 0..width {
            let p = r * width + c;
            let right = if c + 1 < width { p + 1 } else { p };
            let d = down[p] + step * (x[below * width + c] - x[p]);
            let a = across[p] + step * (x[right] - x[p]);
            let outside = (d * d + a * a).sqrt().max(1.0);
            (down[p], across[p]) = (d / outside, a / outside);
        }
    }
}

/// Moves `x` along the dual's divergence.
pub fn descend(width: usize, down: &[f32], across: &[f32], step: f32, x: &mut [f32]) {
    let height = x.len() / width;
    for r in 0..height {
        for c in 0..width {
            let p = r * width + c;
            let from = |inside: bool, value: f32| if inside { value } else { 0.0 };
            let above = if r > 0 { down[p - width] } else { 0.0 };
            let left = if c > 0 { across[p - 1] } else { 0.0 };
            let divergence =
                from(r + 1 < height, down[p]) - above + from(c + 1 < width, across[p]) - left;
            x[p] += step * divergence;
        }
    }
}

//! Reconstruction from a user's own patterns.

use super::*;
use crate::testing::binary_patterns;

#[test]
fn own_patterns_make_the_images_that_they_made() {
    let mut table = Table::default();
    let spots: Vec<f32> = (0..64 * 64_usize)
        .map(|at| {
            let (atom, p) = (at / 64, at % 64);
            let (down, right) = ((atom / 8).abs_diff(p / 8), (atom % 8).abs_diff(p % 8));
            (1 + atom % 3) as f32 * 0.5_f32.powi((down + right) as i32)
        })
        .collect();
    for (kind, count, noise) in [(1, 40, 0.05), (2, 25, 0.01), (1, 90, 0.5)] {
        let (weights, y) = binary_patterns(count, &scene(side(8), kind), noise, count as u64);
        let own = OwnMatrix::new(side(8), &weights).unwrap();
        for (method, name) in [
            (MatrixMethod::PseudoInverse, "pseudo-inverse"),
            (MatrixMethod::Penalty(Penalty::Tikhonov), "Tikhonov"),
            (MatrixMethod::Penalty(Penalty::Sparse), "sparse"),
            (MatrixMethod::Penalty(Penalty::TotalVariation), "total variation"),
            (MatrixMethod::Omp, "OMP"),
        ] {
            let base = MatrixSettings { dark: false, ..MatrixSettings::new(method) };
            for (what, settings) in [
                ("default", base.clone()),
                ("strength 0.01", MatrixSettings { strength: Some(0.01), ..base.clone() }),
                (
                    "7 pixels",
                    MatrixSettings { basis: Basis::Pixel, sparsity: Some(7), ..base.clone() },
                ),
                ("own atoms", MatrixSettings { atoms: Some(spots.clone()), ..base.clone() }),
                (
                    "own atoms, 0 or more",
                    MatrixSettings { atoms: Some(spots.clone()), non_negative: true, ..base },
                ),
            ] {
                if what != "default" && method == MatrixMethod::PseudoInverse
                    || settings.non_negative && method != MatrixMethod::Omp
                {
                    continue;
                }
                let found = own.reconstruct(&y, &settings).unwrap();
                let name = format!("{count} patterns, {name}, {what}");
                table.image(&name, found.image.pixels().iter().copied());
                let (atoms, stop) = found.atoms.unzip();
                let mut numbers = vec![found.residual];
                numbers.extend(found.strength);
                numbers.extend(atoms.map(|atoms| atoms as f64));
                table.line(&format!("report, {name} {stop:?}"), &numbers);
            }
        }
    }
    table.is_the_same_as("matrix.txt");
}

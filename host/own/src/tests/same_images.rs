//! Images stay the same from one version to the next, as `same_images` of `nirspi-recon` says of its methods.
//!
//! A line of the table is a name and numbers. The first five numbers of an image are its sums with fixed weights, whose
//! squares add up to 1; the last is the image's norm. Sums are compared to 1/20 000 of the norm, other numbers to 1/2000 of
//! their own size and to 1e-6.

use super::*;
use std::fmt::Write;

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
    table.is_the_same();
}

/// A table under construction.
#[derive(Default)]
struct Table(String);

impl Table {
    fn image(&mut self, name: &str, values: impl IntoIterator<Item = f32>) {
        let values: Vec<f64> = values.into_iter().map(f64::from).collect();
        let mut random = Pcg64::seed_from_u64(values.len() as u64);
        let mut sums: Vec<f64> = (0..5)
            .map(|_| {
                let weights: Vec<f64> = values.iter().map(|_| normal(&mut random)).collect();
                let size = weights.iter().map(|w| w * w).sum::<f64>().sqrt();
                values.iter().zip(&weights).map(|(v, w)| v * w / size).sum()
            })
            .collect();
        sums.push(values.iter().map(|v| v * v).sum::<f64>().sqrt());
        self.line(&format!("image, {name}"), &sums);
    }

    fn line(&mut self, name: &str, numbers: &[f64]) {
        assert!(numbers.iter().all(|number| number.is_finite()), "{name}: {numbers:?}");
        write!(self.0, "{name}:").unwrap();
        numbers.iter().for_each(|number| write!(self.0, " {number:.5e}").unwrap());
        self.0.push('\n');
    }

    /// Compares the table with that of the last version.
    fn is_the_same(&self) {
        let path =
            std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src/tests/same_images.txt");
        if std::env::var_os("NIRSPI_BLESS").is_some() {
            std::fs::write(&path, &self.0).unwrap();
        }
        let before = std::fs::read_to_string(&path).unwrap();
        assert_eq!(self.0.lines().count(), before.lines().count(), "lines of the table");
        for (now, before) in self.0.lines().zip(before.lines()) {
            assert!(
                is_same(now, before),
                "the table has\n{before}\nand now it is\n{now}\n\
                 NIRSPI_BLESS=1 cargo test -p nirspi-own same_images writes it anew"
            );
        }
    }
}

fn is_same(now: &str, before: &str) -> bool {
    let parsed = |line: &str| -> (String, Vec<f64>) {
        let (name, numbers) = line.rsplit_once(':').unwrap();
        (name.to_owned(), numbers.split_whitespace().map(|n| n.parse().unwrap()).collect())
    };
    let ((name, now), (name_before, before)) = (parsed(now), parsed(before));
    let norm = before.last().copied().unwrap_or_default();
    let tolerance = |number: f64| match name.starts_with("image") {
        true => norm / 2e4,
        false => (number.abs() / 2e3).max(1e-6),
    };
    name == name_before
        && now.len() == before.len()
        && now.iter().zip(&before).all(|(a, b)| (a - b).abs() <= tolerance(*b))
}

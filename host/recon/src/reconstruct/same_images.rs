//! Images and reports stay the same from one version to the next.
//!
//! The other tests compare the quality of an image with a bound, and a change that makes every image
//! slightly worse passes them. Here each method makes images of fixed measurements, and sums over each image
//! are compared with those in `same_images/*.txt`. A change that is meant to make other images
//! rewrites the tables with `NIRSPI_BLESS=1`, and its review sees by how much they differ.
//!
//! A line of a table is a name and numbers. The first five numbers of an image are its sums with
//! fixed weights, whose squares add up to 1; the last is the image's norm. Sums are compared to
//! 1/20 000 of the norm, other numbers to 1/2000 of their own size and to 1e-6.

mod omp;
mod penalties;
mod video;

use super::*;
use crate::testing::{noisy, normal, scene, side};
use rand::SeedableRng;
use rand_pcg::Pcg64;
use std::fmt::Write;

/// Scenes by a part of the patterns, with much noise and little.
pub(super) fn parts() -> Vec<(&'static str, Measurements)> {
    let part = |n, kind, order: Order, count, noise| {
        let rows = order.rows(side(n)).unwrap().first(count);
        noisy(&rows, &scene(side(n), kind), noise, count as u64)
    };
    vec![
        ("blobs", part(16, 1, Order::ZigZag, 80, 0.3)),
        ("figure", part(16, 2, Order::CakeCutting, 130, 0.1)),
        ("at random", part(16, 2, Order::Table(crate::order::shuffled(256, 3)), 100, 0.02)),
        ("in noise", part(16, 1, Order::ZigZag, 200, 6.0)),
    ]
}

/// The numbers of a report that the method has filled in.
fn report(report: &Report) -> Vec<f64> {
    let numbers = [
        report.strength,
        report.sparsity.map(|atoms| atoms as f64),
        report.residual,
        report.unseen_atoms.map(|atoms| atoms as f64),
        report.trust,
        report.noise,
    ];
    numbers.into_iter().flatten().collect()
}

/// A table under construction.
#[derive(Default)]
pub(super) struct Table(String);

impl Table {
    pub(super) fn image(&mut self, name: &str, values: impl IntoIterator<Item = f32>) {
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

    pub(super) fn line(&mut self, name: &str, numbers: &[f64]) {
        assert!(numbers.iter().all(|number| number.is_finite()), "{name}: {numbers:?}");
        write!(self.0, "{name}:").unwrap();
        numbers.iter().for_each(|number| write!(self.0, " {number:.5e}").unwrap());
        self.0.push('\n');
    }

    pub(super) fn made(&mut self, name: &str, made: &Reconstruction) {
        self.image(name, made.image.pixels().iter().copied());
        let note = made.report.note.as_deref().unwrap_or_default();
        let stop = made.report.stop.unwrap_or_default();
        self.line(&format!("report, {name} [{stop}{note}]"), &report(&made.report));
    }

    /// Compares the table with that of the last version.
    pub(super) fn is_the_same_as(&self, file: &str) {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("src/reconstruct/same_images")
            .join(file);
        if std::env::var_os("NIRSPI_BLESS").is_some() {
            std::fs::write(&path, &self.0).unwrap();
        }
        let before = std::fs::read_to_string(&path).unwrap();
        assert_eq!(self.0.lines().count(), before.lines().count(), "lines of {file}");
        for (now, before) in self.0.lines().zip(before.lines()) {
            assert!(
                is_same(now, before),
                "{file} has\n{before}\nand now it is\n{now}\n\
                 NIRSPI_BLESS=1 cargo test -p nirspi-recon same_images writes it anew"
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

#[test]
fn a_small_difference_is_seen_and_rounding_is_not() {
    assert!(is_same("image, a: 1.00001 100.001", "image, a: 1.0 100.0"));
    assert!(!is_same("image, a: 1.01 100.0", "image, a: 1.0 100.0"));
    assert!(!is_same("image, b: 1.0 100.0", "image, a: 1.0 100.0"));
    assert!(is_same("report, a: 0.30001 5", "report, a: 0.3 5"));
    assert!(!is_same("report, a: 0.301 5", "report, a: 0.3 5"));
    assert!(!is_same("report, a: 0.3", "report, a: 0.3 5"));
}

//! The default method, `auto`, beside the methods that one can ask for: on letters, words, drawings, natural scenes, recordings
//! of other groups and no light, with 5 to 100 % of the patterns.
//!
//! `defaults/table.md` has the figures. `cargo test -p nirspi-eval --test defaults -- --ignored` measures them, in a minute, and
//! `NIRSPI_BLESS=1` writes them anew.
//!
//! # Invariant
//! A judge has nothing of what it judges: a drawn scene is its own truth, a recording is compared with another exposure of the
//! same scene, or with the readings that the methods were not given.

#![expect(clippy::unwrap_used, reason = "a failed unwrap in a helper fails its test")]

#[path = "../examples/natural/mod.rs"]
mod natural;
#[path = "defaults/scenes.rs"]
mod scenes;

use nirspi_recon::Order;
use nirspi_recon::reconstruct::{Method, Reconstruct};
use rayon::prelude::*;
use scenes::{Kind, Unit};
use std::fmt::Write as _;
use std::path::PathBuf;

const SHARES: [f64; 5] = [0.05, 0.1, 0.25, 0.5, 1.0];

/// The table's methods. The default is the last one.
const METHODS: [&str; 7] = ["hadamard", "tikhonov", "omp", "fista", "tv", "prior", "auto"];

/// A row of the table: the mean figure of each of [`METHODS`] over the scenes of one kind.
struct Row {
    kind: String,
    unit: Unit,
    share: f64,
    figures: Vec<f64>,
}

impl Row {
    fn default_figure(&self) -> f64 {
        self.figures[METHODS.len() - 1]
    }

    /// By how much the best method is better than the default.
    fn lost(&self) -> f64 {
        self.figures.iter().copied().fold(f64::MIN, f64::max) - self.default_figure()
    }

    fn line(&self) -> String {
        let figures = self.figures.iter().map(|figure| self.unit.written(*figure));
        let figures = figures.collect::<Vec<_>>().join(" | ");
        format!("| {} | {:.0} % | {} | {figures} |", self.kind, 100.0 * self.share, self.unit)
    }
}

fn methods() -> Vec<Box<dyn Reconstruct>> {
    let settings = nirspi_nets::prior::settings();
    METHODS.iter().map(|word| word.parse::<Method>().unwrap().prepare(&settings).unwrap()).collect()
}

fn rows(kinds: &[Kind]) -> Vec<Row> {
    let methods = methods();
    let mut rows = Vec::new();
    for kind in kinds {
        for share in SHARES.into_iter().filter(|share| kind.judges(*share)) {
            let mean = |method: &dyn Reconstruct| {
                let figures = kind.scenes.par_iter().map(|scene| {
                    let some = scene.measured.take(Some(&Order::ZigZag), share).unwrap();
                    let made = method.reconstruct(&some).unwrap();
                    scene.judge.figure(&made.image, &some)
                });
                figures.sum::<f64>() / kind.scenes.len() as f64
            };
            let figures = methods.iter().map(|method| mean(&**method)).collect();
            rows.push(Row { kind: kind.name.clone(), unit: kind.unit, share, figures });
        }
    }
    rows
}

fn page(rows: &[Row]) -> String {
    let mut page = String::from("# The default method beside the others\n\n");
    page += "Mean figures over the scenes of each kind. PSNR is in dB with white as its peak, against the drawn scene; for the\n";
    page += "two recordings with one exposure it is of the readings that the methods were not given, with the range of the\n";
    page += "image of all readings as its peak. A correlation is that with another exposure of the scene. Patterns are in\n";
    page += "zig-zag order. `host/eval/tests/defaults.rs` measures this table: scenes, noise and judges are described there.\n\n";
    let names = METHODS.join(" | ");
    let _ = writeln!(page, "| scenes | patterns | figure | {names} |");
    let _ = writeln!(page, "| :-- | --: | :-- |{}", " --: |".repeat(METHODS.len()));
    for row in rows {
        page += &row.line();
        page.push('\n');
    }
    page
}

/// Lines of the committed table that differ from what was measured by more than rounding on another processor can change.
fn stale(committed: &str, measured: &[Row]) -> Vec<String> {
    let of = |row: &Row| {
        let line = row.line();
        let start = line.splitn(5, '|').take(4).collect::<Vec<_>>().join("|");
        let Some(found) = committed.lines().find(|found| found.starts_with(&start)) else {
            return Some(format!("not in the table: {line}"));
        };
        let figures = found.split('|').skip(4).filter_map(|cell| cell.trim().parse::<f64>().ok());
        let figures: Vec<f64> = figures.collect();
        let same = figures.len() == row.figures.len()
            && figures.iter().zip(&row.figures).all(|(a, b)| (a - b).abs() <= row.unit.rounding());
        (!same).then(|| format!("committed {found}\n measured {line}"))
    };
    measured.iter().filter_map(of).collect()
}

/// Lines of the rows in which a method is better than the default by more than this many times what the table allows.
fn lost(rows: &[Row], times: f64) -> Vec<String> {
    let lost = rows.iter().filter(|row| row.lost() > times * row.unit.most_lost());
    lost.map(|row| format!("{} by {:.3}", row.line(), row.lost())).collect()
}

#[test]
#[ignore = "a minute; .ci/run does it"]
fn no_method_is_better_than_the_default_by_a_decibel() {
    let measured = rows(&scenes::of_the_table());
    let file = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/defaults/table.md");
    if std::env::var_os("NIRSPI_BLESS").is_some() {
        std::fs::write(&file, page(&measured)).unwrap();
    }
    let lost = lost(&measured, 1.0);
    assert!(lost.is_empty(), "a method is better than the default:\n{}", lost.join("\n"));
    let stale = stale(&std::fs::read_to_string(&file).unwrap(), &measured);
    assert!(stale.is_empty(), "NIRSPI_BLESS=1 writes the table anew:\n{}", stale.join("\n"));
}

/// The rule of the default was made with the scenes of the table. Of words from a half of the patterns 1.01 dB were seen lost.
#[test]
#[ignore = "a minute; .ci/run does it"]
fn the_default_loses_little_on_scenes_that_its_rule_was_not_made_with() {
    let lost = lost(&rows(&scenes::others()), 1.1);
    assert!(lost.is_empty(), "a method is better than the default:\n{}", lost.join("\n"));
}

/// The most correlation that may be lost by showing more patterns.
const MOST_LOST: f64 = 0.005;

/// SPyRiT's Tikhonov for the shorter exposure, with 10 %, 25 % and all of the patterns.
const SPYRIT: [(f64, f64); 3] = [(0.1, 0.888), (0.25, 0.893), (1.0, 0.895)];

/// Real photons, judged by another exposure: a reading that is more noise than light must not make an image worse.
#[test]
#[ignore = "seconds in a release build; .ci/run does it"]
fn more_patterns_cost_nothing_on_photon_counts() {
    let Some(exposures) = scenes::exposures() else { return };
    let shares = [0.1, 0.15, 0.2, 0.25, 0.5, 0.75, 1.0];
    for (which, exposure) in exposures.iter().enumerate() {
        // The plain transform gives all readings the same weight.
        for (word, method) in METHODS.iter().zip(methods()).skip(1) {
            let figures: Vec<f64> = shares
                .par_iter()
                .map(|share| {
                    let some = exposure.measured.take(Some(&Order::ZigZag), *share).unwrap();
                    let made = method.reconstruct(&some).unwrap();
                    exposure.judge.figure(&made.image, &some)
                })
                .collect();
            let mut best = 0.0_f64;
            for (share, figure) in shares.iter().zip(&figures) {
                best = best.max(*figure);
                assert!(
                    *figure >= best - MOST_LOST,
                    "{word}, exposure {which}, {share}: {figures:.4?}"
                );
                let of_spyrit = SPYRIT.iter().find(|(of, _)| of == share && which == 0);
                if let (Some((_, spyrit)), "auto") = (of_spyrit, *word) {
                    assert!(*figure >= spyrit - MOST_LOST, "{share}: {figures:.4?}");
                }
            }
        }
    }
}

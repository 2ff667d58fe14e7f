//! Figures that a page quotes of a command are those that the command gives. Figures that follow from constants and models of the
//! libraries are compared in `tests/tests/page_figures.rs`.

use crate::bench::Bench;
use nirspi::files::npy::encode;
use serde_json::Value;
use std::path::Path;

/// Another processor rounds sums in another way.
const ROUNDING: f64 = 1e-4;

/// A page of the book, line ends taken as blanks.
fn words(page: &str) -> String {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."));
    let text = std::fs::read_to_string(root.join(page)).unwrap();
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// The figures in the place of each `{}` of a sentence of a page.
fn figures(page: &str, sentence: &str) -> Vec<String> {
    let words = words(page);
    let mut parts = sentence.split("{}");
    let first = parts.next().unwrap();
    let mut rest = words.split_once(first).unwrap_or_else(|| panic!("{page} has no {first:?}")).1;
    let mut found = Vec::new();
    for part in parts {
        let (figure, behind) = rest.split_once(part).unwrap();
        assert!(figure.len() < 12, "{page} has no sentence {sentence:?}: {figure:?}");
        found.push(figure.to_owned());
        rest = behind;
    }
    found
}

/// The sentence has these figures, with as many decimals as it has.
#[track_caller]
fn says(page: &str, sentence: &str, right: &[f64]) {
    let shown = figures(page, sentence);
    let rounded: Vec<String> = right
        .iter()
        .zip(&shown)
        .map(|(right, shown)| {
            let decimals = shown.split_once('.').map_or(0, |(_, decimals)| decimals.len());
            format!("{right:.decimals$}")
        })
        .collect();
    assert_eq!(shown, rounded, "{page}: {sentence}");
}

/// Whether all that a page shows is in what was made: names and words as they are, numbers but for rounding.
fn is_in(shown: &Value, made: &Value) -> bool {
    match (shown, made) {
        (Value::Object(shown), Value::Object(made)) => {
            shown.iter().all(|(key, value)| made.get(key).is_some_and(|made| is_in(value, made)))
        }
        (Value::Array(shown), Value::Array(made)) => {
            shown.len() == made.len() && shown.iter().zip(made).all(|(a, b)| is_in(a, b))
        }
        (Value::Number(shown), Value::Number(made)) => {
            let [shown, made] = [shown, made].map(|number| number.as_f64().unwrap());
            (shown - made).abs() <= ROUNDING * shown.abs().max(1.0)
        }
        _ => shown == made,
    }
}

/// The part of a report on the page about results.
#[test]
fn the_page_about_results_shows_the_report_of_its_example() {
    let page = words("docs/results.md");
    let (_, rest) = page.split_once("```json \"pictures\":").unwrap();
    let block = rest.split_once("```").unwrap().0;
    let shown: Value =
        serde_json::from_str(block).unwrap_or_else(|error| panic!("{error}: {block}"));
    let bench = Bench::new();
    bench.run(&["example", "wing", "--out", "wing.npz"]).succeeded();
    let line = ["reconstruct", "wing.npz", "--sampling", "25%", "--out", "out/quarter"];
    bench.run(&line).succeeded();
    let made = &bench.json("out/quarter/report.json")["pictures"];
    assert!(is_in(&shown, made), "docs/results.md shows {shown}, the command gives {made}");
}

/// What the virtual camera's self-test finds.
#[test]
#[ignore = "long: .ci/run demo"]
fn the_page_about_bring_up_says_what_the_self_test_finds() {
    let report = Bench::new().run(&["camera", "selftest", "--json"]).succeeded().json();
    let checks = report["checks"].as_array().unwrap();
    let measured = |name: &str| {
        let check = checks.iter().find(|check| check["name"] == name).unwrap();
        check["measured"].as_f64().unwrap()
    };
    says(
        "docs/bring-up.md",
        "the latency is {} clocks, and {} % of a pattern's light is measured in its own slot",
        &[measured("ADC latency by stepping"), measured("settling at 25 MHz")],
    );
}

/// The largest sets with a name: the next larger one is refused with the page's figure.
#[test]
fn the_page_about_own_patterns_says_how_large_sets_may_be() {
    let bench = Bench::new();
    let page = "docs/own-patterns.md";
    let order = figures(page, "for these orders N, up to {}:").remove(0);
    bench
        .run(&["order", "s-matrix:4099", "--npy", "--out", "above"])
        .failed(2, &[&format!("expected an order up to {order} that")]);
    let side = figures(page, "The largest image has about {} x ").remove(0);
    let above: usize = side.parse::<usize>().unwrap() + 2;
    let readings = vec![1.0_f32; above * above * 4];
    bench.write("above.npy", &encode(&[above, above, 4], &readings));
    bench
        .run(&["reconstruct", "above.npy", "--matrix", "fourier:4", "--out", "out"])
        .failed(1, &[&format!("about {side} x {side} pixels")]);
}

//! Tables of a sampling study in Markdown: the best methods of each order first, then every method.
//!
//! # Invariant
//! A row or column that repeats another is left out and named
//! (`tests::what_repeats_another_is_left_out_and_named`).

use super::{Report, ZERO_FILLING};
use std::fmt::Write;

/// Values that differ by less, in dB, are equal in the tables.
const EQUAL_DB: f64 = 0.005;
/// Number of methods named for each order.
const NAMED: usize = 3;

/// The tables of all shares.
pub(super) fn all(
    report: &Report,
    orders: &[String],
    methods: &[String],
    shares: &[f64],
) -> String {
    let (methods, idle) = telling_methods(report, orders, methods, shares);
    let (orders, repeated) = telling_orders(report, orders, &methods, shares);
    let mut text = format!("Judged by {}.\n\n", report.judged_by);
    // Writing to a string cannot fail.
    for &share in shares {
        best(&mut text, report, &orders, &methods, share);
    }
    for &share in shares {
        every(&mut text, report, &orders, &methods, share);
    }
    if !idle.is_empty() {
        let _ = writeln!(text, "As {ZERO_FILLING} everywhere, and left out: {}\n", idle.join("; "));
    }
    for (order, like) in repeated {
        let _ = writeln!(text, "Order {order} is as {like} everywhere, and left out\n");
    }
    text
}

/// A gain in dB with its sign; one that rounds to 0 has a plus sign.
pub(super) fn signed(gain_db: f64) -> String {
    let gain_db = if gain_db.abs() < EQUAL_DB { 0.0 } else { gain_db };
    format!("{gain_db:+.2}")
}

fn equal(a: f64, b: f64) -> bool {
    (a - b).abs() < EQUAL_DB || a == b || (a.is_nan() && b.is_nan())
}

/// Methods with results of their own, and those whose images are as zero filling's.
fn telling_methods(
    report: &Report,
    orders: &[String],
    methods: &[String],
    shares: &[f64],
) -> (Vec<String>, Vec<String>) {
    let is_idle = |method: &String| {
        method != ZERO_FILLING
            && shares.iter().all(|&share| {
                let same = |order: &String| {
                    let at = |method| report.psnr_db(share, order, method);
                    equal(at(method), at(ZERO_FILLING))
                };
                orders.iter().all(same)
            })
    };
    let (idle, telling) = methods.iter().cloned().partition(is_idle);
    (telling, idle)
}

/// Orders with results of their own, and the others with the order that they repeat.
pub(super) fn telling_orders(
    report: &Report,
    orders: &[String],
    methods: &[String],
    shares: &[f64],
) -> (Vec<String>, Vec<(String, String)>) {
    let (mut telling, mut repeated): (Vec<String>, _) = (Vec::new(), Vec::new());
    for order in orders {
        let same = |other: &&String| {
            shares.iter().all(|&share| {
                let at = |order: &str, method: &str| report.psnr_db(share, order, method);
                methods.iter().all(|method| equal(at(order, method), at(other, method)))
            })
        };
        match telling.iter().find(same) {
            Some(like) => repeated.push((order.clone(), like.clone())),
            None => telling.push(order.clone()),
        }
    }
    (telling, repeated)
}

/// The best methods of each order, the order with the best of all first.
fn best(text: &mut String, report: &Report, orders: &[String], methods: &[String], share: f64) {
    let percent = 100.0 * share;
    let _ =
        writeln!(text, "Best methods of each order, {percent:.0} % of the patterns, PSNR in dB\n");
    let _ = writeln!(text, "| order | {ZERO_FILLING} (zero filling) | best | second | third |");
    let _ = writeln!(text, "|---|---|---|---|---|");
    let mut rows: Vec<(f64, String)> = Vec::new();
    for order in orders {
        let at = |method: &str| report.psnr_db(share, order, method);
        let zero = at(ZERO_FILLING);
        let mut ranked: Vec<(&String, f64)> = methods
            .iter()
            .filter(|method| *method != ZERO_FILLING)
            .map(|method| (method, at(method)))
            .filter(|(_, db)| db.is_finite())
            .collect();
        ranked.sort_by(|a, b| b.1.total_cmp(&a.1));
        let mut row = format!("| {order} | {zero:.2} |");
        for place in 0..NAMED {
            let _ = match ranked.get(place) {
                Some((method, db)) => write!(row, " {method}: {db:.2} ({}) |", signed(db - zero)),
                None => write!(row, " |"),
            };
        }
        rows.push((ranked.first().map_or(zero, |(_, db)| *db), row));
    }
    rows.sort_by(|a, b| b.0.total_cmp(&a.0));
    for (_, row) in rows {
        let _ = writeln!(text, "{row}");
    }
    text.push('\n');
}

/// Every method: methods down, orders across, the best of each order in bold.
fn every(text: &mut String, report: &Report, orders: &[String], methods: &[String], share: f64) {
    let percent = 100.0 * share;
    let _ =
        writeln!(text, "PSNR in dB against the image of all patterns, {percent:.0} % sampling\n");
    let _ = writeln!(text, "| method | {} |", orders.join(" | "));
    let _ = writeln!(text, "|---|{}", "---|".repeat(orders.len()));
    for method in methods {
        let _ = write!(text, "| {method} |");
        for order in orders {
            let at = |method: &str| report.psnr_db(share, order, method);
            let best = methods.iter().map(|m| at(m)).fold(f64::NEG_INFINITY, f64::max);
            let found = at(method);
            let mark = if found == best { "**" } else { "" };
            let _ = write!(text, " {mark}{found:.2}{mark} |");
        }
        text.push('\n');
    }
    text.push('\n');
}

#[cfg(test)]
mod tests {
    use super::super::Row;
    use super::*;

    #[test]
    fn what_repeats_another_is_left_out_and_named() {
        let mut report = Report::empty("in.npz".into(), 16);
        let of = |order: &str, method: &str| match (order, method) {
            ("good", "tv") => 25.0,
            ("good", "omp") => 24.0,
            ("good", _) => 22.0,
            (_, "tv") => 12.0,
            (_, "omp") => 13.0,
            (_, _) => 10.0,
        };
        let orders = ["bad", "twin", "good"].map(str::to_owned);
        let methods = [ZERO_FILLING, "idle", "omp", "tv"].map(str::to_owned);
        for order in &orders {
            for method in &methods {
                report.rows.push(Row {
                    sampling: 0.3,
                    order: order.clone(),
                    method: method.clone(),
                    psnr_db: of(order, method),
                    gain_db: Some(of(order, method) - of(order, ZERO_FILLING)),
                    correlation: 1.0,
                });
            }
        }
        let text = all(&report, &orders, &methods, &[0.3]);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(
            lines[6], "| good | 22.00 | tv: 25.00 (+3.00) | omp: 24.00 (+2.00) | |",
            "{text}"
        );
        assert_eq!(lines[7], "| bad | 10.00 | omp: 13.00 (+3.00) | tv: 12.00 (+2.00) | |");
        assert!(lines.contains(&"| method | bad | good |"), "{text}");
        assert!(lines.contains(&"| tv | 12.00 | **25.00** |"), "{text}");
        assert!(lines.contains(&"As hadamard everywhere, and left out: idle"), "{text}");
        assert!(lines.contains(&"Order twin is as bad everywhere, and left out"), "{text}");
    }
}

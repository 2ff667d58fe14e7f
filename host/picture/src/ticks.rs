//! Round values along an axis or a grey bar, and how they are written.
//!
//! # Invariant
//! Ticks lie between their ends, at 1, 2 or 5 times a power of ten
//! (`tests::ticks_are_round_and_between_their_ends`).

/// The distance of round ticks, 1, 2 or 5 times a power of ten, of which about `count` fill a span.
fn round_step(span: f64, count: usize) -> f64 {
    let rough = span / count.max(1) as f64;
    let power = 10_f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0].map(|m| m * power).into_iter().find(|s| *s >= rough * 0.999);
    step.unwrap_or(10.0 * power)
}

/// At most about `count` round values from `low` to `high`; empty if there is no span.
pub(super) fn between(low: f64, high: f64, count: usize) -> Vec<f64> {
    let span = high - low;
    if !(span.is_finite() && span > 1e-300 && span > 1e-6 * low.abs().max(high.abs())) {
        return Vec::new();
    }
    let step = round_step(span, count);
    let (first, last) = ((low / step).ceil() as i64, (high / step).floor() as i64);
    // A multiple of a power of ten below 1 is not exact in binary, and a quotient is nearer.
    let at = |k: i64| if step < 1.0 { k as f64 / (1.0 / step).round() } else { k as f64 * step };
    let exact = |k: i64| if step < 1e-12 { k as f64 * step } else { at(k) };
    (first..=last).map(exact).filter(|v| (low..=high).contains(v)).collect()
}

/// Round values around all of `low` to `high`: the first at or below `low`, the last at or above
/// `high`.
pub(super) fn around(low: f64, high: f64, count: usize) -> Vec<f64> {
    let step = round_step((high - low).max(1e-3 * count as f64), count);
    let first = (low / step).floor();
    let last = (high / step).ceil().max(first + 1.0);
    (0..=(last - first) as usize).map(|k| (first + k as f64) * step).collect()
}

/// A tick in words, so that neighbours can be told apart.
pub(super) fn label(tick: f64) -> String {
    // Values that three digits would round away, and values wider than the margin.
    if tick != 0.0 && !(1e-3..1e6).contains(&tick.abs()) {
        return format!("{tick:e}");
    }
    without_zeros(format!("{tick:.3}"))
}

/// A value with three digits that count.
pub(super) fn number(value: f32) -> String {
    let value = f64::from(value);
    if value == 0.0 {
        return "0".to_owned();
    }
    if !(1e-3..1e6).contains(&value.abs()) {
        let text = format!("{value:.2e}");
        let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
        return format!("{}e{power}", without_zeros(digits.to_owned()));
    }
    let decimals = (2.0 - value.abs().log10().floor()).max(0.0) as usize;
    without_zeros(format!("{value:.decimals$}"))
}

fn without_zeros(text: String) -> String {
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn ticks_are_round_and_between_their_ends(
            low in -1e5f64..1e5, span in 1e-3f64..1e6, count in 2usize..8,
        ) {
            let ticks = between(low, low + span, count);
            prop_assert!(ticks.len() <= count + 1, "{:?}", ticks);
            prop_assert!(ticks.iter().all(|tick| (low..=low + span).contains(tick)), "{:?}", ticks);
            prop_assert!(ticks.is_sorted_by(|a, b| a < b), "{:?}", ticks);
            let around = around(low, low + span, count);
            prop_assert!(around[0] <= low + 1e-6 * span, "{:?}", around);
            prop_assert!(around[around.len() - 1] >= low + span * (1.0 - 1e-6), "{:?}", around);
        }
    }

    #[test]
    fn ticks_are_written_so_that_they_can_be_told_apart() {
        let labels = [0.0, 1e-4, 0.001, 0.25, 2.0, 1e5, 1e10].map(label);
        assert_eq!(labels, ["0", "1e-4", "0.001", "0.25", "2", "100000", "1e10"]);
        assert_eq!(between(0.02, 0.97, 5), [0.2, 0.4, 0.6, 0.8]);
        assert_eq!(between(0.05, 0.32, 3), [0.1, 0.2, 0.3]);
        assert!(between(3.0, 3.0, 5).is_empty() && between(0.0, f64::NAN, 5).is_empty());
    }

    #[test]
    fn numbers_have_three_digits() {
        let told = [0.0, 0.012_34, -0.5, 12.345, 830.4, 4011.0, 1.234e7, 2e-5].map(number);
        assert_eq!(told, ["0", "0.0123", "-0.5", "12.3", "830", "4011", "1.23e7", "2e-5"]);
    }
}

//! Looks for what would explain readings that do not belong to the patterns they are said to be of.

use super::explanation::Explanation;
use super::{HeldBack, Method, MethodSettings};
use crate::law::robust::median;
use crate::{Measurements, Order, Rows, Side};
use rayon::prelude::*;

/// The shift or the named order under which the readings predict each other best, if one does far
/// better than chance; for readings that are [predicted by chance](HeldBack::is_by_chance) alone as
/// they are.
#[must_use]
pub fn explanation(measurements: &Measurements) -> Option<Explanation> {
    let side = measurements.side();
    let rows = measurements.rows();
    let orders = Order::NAMED.iter().filter_map(|named| {
        let order: Order = named.name.parse().ok()?;
        let first = order.rows(side).ok()?.first(rows.len()).to_vec();
        Some((Explanation::Order(order), first, 0))
    });
    let tried = all_judged(measurements, shifts(rows).chain(orders));
    let best = tried.iter().map(|(_, found)| found.score).fold(f64::NEG_INFINITY, f64::max);
    // An order and its transpose explain a symmetrical scene equally well.
    let named = tried.into_iter().find(|(_, found)| found.score >= 0.9 * best);
    named.filter(|_| best >= HeldBack::AMONG_MANY).map(|(explanation, _)| explanation)
}

/// Standard deviations of the noise from which a pattern sees a scene, and below which it does not.
const SEES: f64 = 6.0;
const SEES_NOT: f64 = 3.5;

/// The largest share of the patterns that see a scene of few readings, and of those that are neither sure to see it nor sure not
/// to.
const FEW: f64 = 1.0 / 16.0;
const UNSURE: f64 = 1.0 / 64.0;

/// Ratio of the standard deviation of normally distributed values and the median of their magnitudes.
const DEVIATION_OF_MEDIAN: f64 = 1.4826;

/// Whether a few patterns see the scene and all others read noise, as with a square on the grid of the patterns, an edge, or
/// bars. Such readings do not predict each other, whatever patterns they belong to: [`HeldBack`] cannot judge them. Light also
/// gives the all-ones pattern the largest reading, and single photons of no scene do not.
#[must_use]
pub fn few_patterns_see(measurements: &Measurements) -> bool {
    let readings = || measurements.rows().iter().zip(measurements.values());
    let sizes: Vec<f64> = readings().filter(|(row, _)| **row != 0).map(|(_, v)| v.abs()).collect();
    let noise = DEVIATION_OF_MEDIAN * median(sizes.clone());
    let above = |deviations: f64| sizes.iter().filter(|&&v| v > deviations * noise).count();
    let (sees, perhaps) = (above(SEES), above(SEES_NOT));
    let share = |count: usize| count as f64 / sizes.len() as f64;
    let largest = sizes.iter().copied().fold(0.0, f64::max);
    let is_light = readings().find(|(row, _)| **row == 0).is_none_or(|(_, on)| *on > largest / 2.0);
    is_light && sees > 0 && share(sees) <= FEW && share(perhaps - sees) <= UNSURE
}

/// Share of the readings' variation that is confirmed below which another shift is looked for.
const LITTLE: f64 = 0.5;

/// How much less of the variation a shift leaves unexplained where it is named.
const FAR_LESS: f64 = 0.25;

/// The shift under which readings that predict each other little do so far better, and how well. Neighbours in an order are
/// like each other, so readings of the wrong ones need not be [predicted by chance](HeldBack::is_by_chance) alone. `found` is
/// what held-back readings say of them as they are.
#[must_use]
pub fn better_shift(
    measurements: &Measurements,
    found: HeldBack,
) -> Option<(Explanation, HeldBack)> {
    if found.confirmed >= LITTLE || few_patterns_see(measurements) {
        return None;
    }
    let tried = all_judged(measurements, shifts(measurements.rows()));
    // The few largest readings of a scene may be predicted under any shift; the signs of all are not.
    let least = HeldBack::AMONG_MANY.max(found.score);
    let named = tried.into_iter().filter(|(_, trial)| trial.score >= least);
    let (shift, best) = named.max_by(|(_, a), (_, b)| a.confirmed.total_cmp(&b.confirmed))?;
    let is_far_better = 1.0 - best.confirmed < FAR_LESS * (1.0 - found.confirmed);
    is_far_better.then_some((shift, best))
}

/// An explanation, the patterns that it gives to the readings, and the number of readings before them.
type Trial = (Explanation, Vec<u32>, usize);

/// Every shift of a few readings.
fn shifts(rows: &[u32]) -> impl Iterator<Item = Trial> + '_ {
    let most = Explanation::MOST_READINGS.min(rows.len() / 2);
    let late = (1..=most).map(|by| (Explanation::Shift(by as i32), rows[by..].to_vec(), 0));
    let early = (1..=most).map(|by| {
        let patterns = rows[..rows.len() - by].to_vec();
        (Explanation::Shift(-(by as i32)), patterns, by)
    });
    late.chain(early)
}

/// What held-back readings say of each explanation, in their order.
fn all_judged(
    measurements: &Measurements,
    trials: impl Iterator<Item = Trial>,
) -> Vec<(Explanation, HeldBack)> {
    let trials: Vec<Trial> = trials.collect();
    trials.into_par_iter().filter_map(|trial| judged(measurements, trial)).collect()
}

/// What held-back readings say of an explanation.
fn judged(
    measurements: &Measurements,
    (explanation, patterns, skipped): Trial,
) -> Option<(Explanation, HeldBack)> {
    let values = measurements.values()[skipped..][..patterns.len()].to_vec();
    let patterns = Rows::new(measurements.side(), patterns).ok()?;
    let found = Measurements::from_differential(&patterns, &values).ok()?;
    Some((explanation, held_back(&found)?))
}

/// The largest side at which explanations are judged: larger images are, by the patterns of squares of pixels.
const JUDGED: u64 = 32;

/// What held-back readings say, by the method that predicts them better: edges, which one of them predicts, the other does not.
fn held_back(measurements: &Measurements) -> Option<HeldBack> {
    let small = Side::new(JUDGED).ok().and_then(|small| measurements.binned(small));
    let measurements = small.as_ref().unwrap_or(measurements);
    let methods = [Method::TIKHONOV, Method::TOTAL_VARIATION];
    let found = methods.into_iter().filter_map(|method| {
        let method = method.prepare(&MethodSettings::default()).ok()?;
        method.reconstruct(measurements).ok()?.report.held_back
    });
    found.max_by(|a, b| a.score.total_cmp(&b.score))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{noisy, scene, side};

    /// Measurements of a figure whose readings are said to be of other patterns.
    fn said_to_be(of: impl Fn(usize) -> usize) -> Measurements {
        let rows = Order::ZigZag.rows(side(32)).unwrap();
        let shown = noisy(&rows, &scene(side(32), 1), 0.1, 1);
        let values: Vec<f64> = (0..800).map(|k| shown.values()[of(k)]).collect();
        Measurements::from_differential(&rows.first(800), &values).unwrap()
    }

    #[test]
    fn a_shift_and_another_order_are_named_and_right_readings_are_not_by_chance() {
        let right = said_to_be(|k| k);
        assert!(!held_back(&right).unwrap().is_by_chance());
        for (by, late) in [(1, true), (3, true), (2, false)] {
            let shifted = said_to_be(|k| if late { k + by } else { k.saturating_sub(by) });
            let by = if late { by as i32 } else { -(by as i32) };
            assert_eq!(
                explanation(&shifted),
                Some(Explanation::Shift(by)),
                "{:?}",
                held_back(&right)
            );
        }
        let cake = Order::CakeCutting.rows(side(32)).unwrap().first(800);
        let other = Measurements::from_differential(&cake, right.values()).unwrap();
        assert!(held_back(&other).unwrap().is_by_chance());
        assert_eq!(explanation(&other), Some(Explanation::Order(Order::ZigZag)));
        let noise = noisy(&cake, &[0.0; 1024], 1.0, 5);
        assert_eq!(explanation(&noise), None);
    }

    /// A figure on the grid of the patterns, on an even ground.
    fn on_the_grid(n: usize, is_lit: impl Fn(usize, usize) -> bool) -> Vec<f64> {
        (0..n * n).map(|at| if is_lit(at % n, at / n) { 1.0 } else { 0.1 }).collect()
    }

    #[test]
    fn figures_that_few_patterns_see_are_not_judged_and_others_are() {
        let n = 32;
        let within = |at: usize, from: usize, to: usize| (from..to).contains(&at);
        let figures = [
            on_the_grid(n, |x, y| within(x, 8, 24) && within(y, 8, 24)),
            on_the_grid(n, |x, _| x < 16),
            on_the_grid(n, |x, _| x % 8 < 4),
            on_the_grid(n, |x, y| within(x, 12, 20) || within(y, 12, 20)),
        ];
        let natural = Rows::natural(side(n as u64));
        let mut by_chance = 0;
        for (k, figure) in figures.iter().enumerate() {
            for noise in [0.0, 0.3] {
                let right = noisy(&natural, figure, noise, 1);
                assert!(few_patterns_see(&right), "figure {k}, noise {noise}");
                let found = held_back(&right);
                by_chance += usize::from(found.is_some_and(|found| found.is_by_chance()));
                assert_eq!(found.and_then(|found| better_shift(&right, found)), None);
            }
        }
        assert!(by_chance > 0, "held-back readings judge them rightly");
        for (kind, noise) in [(1, 0.05), (2, 0.05), (1, 0.5), (2, 0.5)] {
            let right = noisy(&natural, &scene(natural.side(), kind), noise, 1);
            assert!(!few_patterns_see(&right), "scene {kind}, noise {noise}");
        }
        assert!(!few_patterns_see(&noisy(&natural, &[0.0; 1024], 1.0, 5)));
        // A photon now and then, with a covered lens.
        let photons: Vec<f64> = (0..1024)
            .map(|k| match (k * 7919 + 1) % 1024 {
                0..20 => 1.0,
                20..40 => -1.0,
                _ => 0.0,
            })
            .collect();
        let dark = |on: f64| {
            let values = [&[on], &photons[1..]].concat();
            Measurements::from_differential(&natural, &values).unwrap()
        };
        assert!(!few_patterns_see(&dark(0.0)) && !few_patterns_see(&dark(-1.0)));
    }

    #[test]
    fn a_shift_among_patterns_that_are_like_each_other_is_named() {
        let shift = |found: &Measurements| Some(better_shift(found, held_back(found)?)?.0);
        for (n, kind) in [(16, 1), (16, 2), (32, 1), (32, 2)] {
            let natural = Rows::natural(side(n));
            let right = noisy(&natural, &scene(natural.side(), kind), 0.05, 1);
            assert_eq!(shift(&right), None);
            let said = natural.first(right.values().len() - 1);
            let shifted = Measurements::from_differential(&said, &right.values()[1..]).unwrap();
            assert!(!held_back(&shifted).unwrap().is_by_chance());
            assert_eq!(shift(&shifted), Some(Explanation::Shift(1)), "{n} x {n}, scene {kind}");
        }
        // Readings that noise hides are no better under another shift.
        let natural = Rows::natural(side(16));
        for seed in 0..5 {
            let dim = noisy(&natural, &scene(side(16), 2), 6.0, seed);
            assert_eq!(shift(&dim), None);
        }
    }
}

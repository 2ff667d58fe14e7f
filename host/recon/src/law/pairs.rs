//! Readings of patterns and their complements.
//!
//! Which reading is the partner of which is seen in their changes: a pattern and its complement share
//! the light, so their readings change against each other, or together where a mirror array collects
//! more light of coarse patterns. Readings of other patterns know little of each other.

use super::dropout::{dark_level, local_level};
use super::ends::{End, ends};
use super::robust::{correlation_of_changes, deviation, median, running_median, step};
use super::{
    Broken, Claim, Doubt, Explanation, Extreme, Form, Impossible, Lamp, Outlier, Places, Reading,
    dropout, few, repeats,
};
use crate::measurements::{MeasurementError, expect_finite};
use crate::{Measurements, Rows, order};

/// Share of the span from all-off to all-on by which a reading must break the law, and number of
/// standard deviations of a pair's sum.
const LAW_SHARE: f64 = 0.05;
const LAW_SIGMAS: f64 = 8.0;

/// Standard errors by which partners must know more of each other than the claimed ones, if readings
/// break the law, and if none does.
const BETTER: f64 = 4.0;
const FAR_BETTER: f64 = 8.0;

/// Fisher's z of a correlation of 0.99: partners that know this much of each other are right, also where
/// others know more. A single point of light makes partners of many patterns.
const SURE_PARTNERS: f64 = 2.65;

/// How many times farther apart all-on and all-off are in a form that explains readings better.
const MORE_APART: f64 = 1.05;

/// The least share of the level, and the least number of standard deviations, by which a pair has too
/// much light.
const BRIGHT_SHARE: f64 = 0.06;
const BRIGHT_SIGMAS: f64 = 8.0;

/// Number of pairs before and after a pair that are looked at for its level, so that the step of a lamp
/// is no outlier; and number of patterns that are as coarse, on each side.
const BESIDE: usize = 9;
const AS_COARSE: usize = 8;

/// Window for the level of pair sums.
const LEVEL: usize = 63;

/// The share of the expected all-on reading by which a saturated one is lower.
const SATURATED_SHARE: f64 = 0.06;

/// Readings in pairs, and what they would be by the law.
struct Claimed<'p> {
    pairs: &'p [[f64; 2]],
    /// Position of the all-on pattern.
    first: Option<usize>,
    /// Standard deviation of a pair's sum.
    noise: f64,
}

pub(super) fn read(
    rows: &Rows,
    y: &[f64],
    claim: Claim,
    places: Option<Places<'_>>,
) -> Result<Reading, MeasurementError> {
    let pairs = y.as_chunks::<2>().0;
    let first = rows.iter().position(|&row| row == 0);
    let mut doubts = Vec::new();
    let other = other_form(rows, pairs, claim, places);
    if let Some(doubt) = other {
        doubts.push(doubt);
        // A finding about single readings would rest on the wrong partner.
        if !doubt.is_of_sign() {
            let measurements = differences(rows, pairs, |_| true)?;
            return Ok(Reading::of(measurements, Vec::new(), doubts));
        }
    }
    let upright: Vec<[f64; 2]> = match other {
        Some(_) => pairs.iter().map(|pair| pair.map(|y| -y)).collect(),
        None => pairs.to_vec(),
    };
    let mut dropouts = dropout::find(rows, pairs);
    let clipped = clipped(&upright, first);
    if let Some((doubt, _)) = clipped.filter(|_| other.is_none()) {
        doubts.push(doubt);
        // A clipped reading is lower than light calls for, and no loss of signal.
        dropouts.retain(|lost| {
            lost.pairs().any(|k| pairs[k].iter().all(|&y| y < saturation_floor(pairs)))
        });
    }
    let mut lost = vec![false; rows.len()];
    dropouts.iter().for_each(|found| lost[found.pairs()].fill(true));
    let level = local_level(&sums(&upright), 2.0 * dark_level(rows, &upright, 1.0));
    let mut outliers = Vec::new();
    match too_bright(rows, &upright, &level, &lost, first) {
        Ok(found) => outliers = found,
        Err(bursts) => doubts.push(bursts),
    }
    for outlier in &outliers {
        lost[outlier.reading / 2] = true;
    }
    let whole = first.filter(|&k| !lost[k]);
    let mut all_on = None;
    if let (Some(k), None) = (whole, clipped)
        && let Some((doubt, difference)) = saturated(&upright, &level, k)
    {
        doubts.push(doubt);
        all_on = Some(if other.is_some() { -difference } else { difference });
    }
    if let (Some(k), true) = (whole, all_on.is_none() && clipped.is_none()) {
        match beyond(&upright, &level, &lost, k) {
            Beyond::Few(found) => outliers.extend(found),
            Beyond::Many(broken) if other.is_none() => {
                doubts.push(Doubt::Form {
                    claimed: claim.form,
                    broken,
                    explanation: Explanation::Unknown,
                });
            }
            Beyond::Many(_) => {}
        }
    }
    for outlier in &mut outliers {
        let k = outlier.reading / 2;
        (outlier.row, outlier.value) = (rows[k], y[outlier.reading]);
        lost[k] = true;
    }
    outliers.sort_by_key(|outlier| outlier.reading);
    let kept: Vec<usize> = (0..pairs.len()).filter(|&k| !lost[k]).collect();
    let lamp = Lamp::of(&upright, &level, &kept, first).filter(|_| clipped.is_none());
    let steady = match claim.divide_by_lamp {
        true => divided(pairs, &kept),
        false => pairs.to_vec(),
    };
    let mut measurements = differences(rows, &steady, |k| !lost[k])?;
    if let (Some(difference), Some(at)) =
        (all_on, measurements.rows().iter().position(|&row| row == 0))
    {
        measurements.replace(at, difference);
    }
    let most_noise = most_noise(rows, pairs, |k| !lost[k]);
    let measurements = measurements.with_most_noise(most_noise);
    Ok(Reading { measurements, dropouts, outliers, doubts, dark_level: None, lamp })
}

/// The pairs as under a lamp that gives each of them the median sum of those that are kept. A pair with less than a tenth of
/// this sum has too little light to say how much.
fn divided(pairs: &[[f64; 2]], kept: &[usize]) -> Vec<[f64; 2]> {
    let sums = sums(pairs);
    if kept.is_empty() {
        return pairs.to_vec();
    }
    let usual = median(kept.iter().map(|&k| sums[k]).collect());
    let share = |sum: f64| (sum / usual).max(0.1);
    let one = |(pair, &sum): (&[f64; 2], &f64)| match usual == 0.0 {
        true => *pair,
        false => pair.map(|reading| reading / share(sum)),
    };
    pairs.iter().zip(&sums).map(one).collect()
}

/// Fewest pairs whose sums say something of the noise.
const FEWEST_SUMS: usize = 32;

/// Share of the sums by which sums change that are no measurement: rounding.
const COMPUTED: f64 = 1e-6;

/// What the noise of a difference is at most. A pattern and its complement share all the light, so
/// that their sum changes by noise alone, and the noise of a sum is that of a difference. A lamp that
/// drifts or flickers changes sums more than differences, and a mirror array collects more light of
/// coarse patterns; so changes from one fine pattern to the next count, in time or in fineness,
/// whichever are smaller. `None` of few pairs, and where one reading of each was computed from the
/// other.
fn most_noise(rows: &Rows, pairs: &[[f64; 2]], keep: impl Fn(usize) -> bool) -> Option<f64> {
    let kept: Vec<usize> =
        order::positions_by_sequency(rows).into_iter().filter(|&k| keep(k)).collect();
    let fine = &kept[kept.len() / 2..];
    if fine.len() < FEWEST_SUMS {
        return None;
    }
    let mut in_time = fine.to_vec();
    in_time.sort_unstable();
    let sum = |k: usize| pairs[k][0] + pairs[k][1];
    let noise = |order: &[usize]| {
        let changes = order.windows(2).map(|two| (sum(two[1]) - sum(two[0])).abs());
        deviation(changes) / std::f64::consts::SQRT_2
    };
    let most = noise(fine).min(noise(&in_time));
    let level = median(fine.iter().map(|&k| sum(k).abs()).collect());
    (most > COMPUTED * level).then_some(most)
}

/// The difference of each kept pair.
pub(super) fn differences(
    rows: &Rows,
    pairs: &[[f64; 2]],
    keep: impl Fn(usize) -> bool,
) -> Result<Measurements, MeasurementError> {
    let kept: Vec<usize> = (0..rows.len()).filter(|&k| keep(k)).collect();
    if kept.is_empty() {
        return Err(MeasurementError::Empty);
    }
    let values: Vec<f64> = kept.iter().map(|&k| pairs[k][0] - pairs[k][1]).collect();
    expect_finite("d", &values)?; // readings near the end of f64's range may differ by more
    let rows = match kept.len() == rows.len() {
        true => rows.clone(),
        false => Rows::trusted(rows.side(), kept.iter().map(|&k| rows[k]).collect()),
    };
    Ok(Measurements::trusted(rows, values))
}

impl Doubt {
    /// Whether the partners of pairs are right and only their sign is not.
    fn is_of_sign(&self) -> bool {
        match self {
            Self::Form { claimed, explanation, .. } => match explanation {
                Explanation::Inverted => true,
                Explanation::ComplementsFirst(form) => form == claimed,
                _ => false,
            },
            _ => false,
        }
    }
}

fn sums(pairs: &[[f64; 2]]) -> Vec<f64> {
    pairs.iter().map(|[plus, minus]| plus + minus).collect()
}

/// Standard deviation of the sums of pairs about their level, which is known to a [`step`] only.
fn noise(pairs: &[[f64; 2]]) -> f64 {
    let sums = sums(pairs);
    let level = running_median(&sums, LEVEL);
    let step = step(pairs.as_flattened());
    deviation(level.iter().zip(&sums).map(|(level, sum)| (level - sum).abs() + step))
}

/// How much the readings of a pair know of each other, as Fisher's z of a correlation, whose standard
/// error is one over the root of the number of pairs.
fn partnership(pairs: &[[f64; 2]]) -> f64 {
    let of = |reading: usize| pairs.iter().map(|pair| pair[reading]).collect::<Vec<f64>>();
    correlation_of_changes(&of(0), &of(1)).abs().min(0.999_999).atanh()
}

impl Claimed<'_> {
    /// How far a reading may be beyond all-on or all-off.
    fn tolerance(&self, on: f64, off: f64) -> f64 {
        (LAW_SHARE * (on - off).abs()).max(LAW_SIGMAS * self.noise)
    }

    /// The readings that break the law of these levels.
    fn broken(&self, on: f64, off: f64) -> Broken {
        let tolerance = self.tolerance(on, off);
        let readings = self.pairs.as_flattened();
        let above = readings.iter().filter(|&&y| y > on + tolerance).count();
        let below = readings.iter().filter(|&&y| y < off - tolerance).count();
        Broken { readings: readings.len(), above, below }
    }

    /// Whether the readings keep the law of these levels, up to a few, and the levels are apart.
    fn keeps(&self, on: f64, off: f64) -> bool {
        let Broken { readings, above, below } = self.broken(on, off);
        on - off > LAW_SIGMAS * self.noise && above + below <= few(readings)
    }
}

/// Another form that explains the readings better than the claimed one.
fn other_form(
    rows: &Rows,
    pairs: &[[f64; 2]],
    claim: Claim,
    places: Option<Places<'_>>,
) -> Option<Doubt> {
    let first = rows.iter().position(|&row| row == 0);
    if 2 * pairs.len() <= super::FEWEST_EQUAL {
        return None;
    }
    let recorded = as_recorded(&Places::filled(places, pairs), claim.form);
    let count = recorded.len() / 2;
    let first = first?;
    let place = Places::of(places, first);
    if claim.side_guessed
        && claim.form == Form::Pairs
        && let Some(sweeps) = repeats::sweeps(&recorded, 2, place)
    {
        let explanation = Explanation::Sweeps { count: sweeps };
        return Some(Doubt::Repeated { readings: recorded.len(), explanation });
    }
    let differences: Vec<f64> =
        Places::filled(places, pairs).iter().map(|[one, other]| one - other).collect();
    if claim.side_guessed
        && let Some(each) = repeats::samples(&differences, true)
    {
        let explanation = Explanation::Repeats { each };
        return Some(Doubt::Repeated { readings: recorded.len(), explanation });
    }
    let rearranged: Vec<[f64; 2]> = match claim.form {
        Form::Halves => recorded.as_chunks::<2>().0.to_vec(),
        _ => (0..count).map(|k| [recorded[k], recorded[count + k]]).collect(),
    };
    let shifted: Vec<[f64; 2]> = match claim.form {
        Form::Halves => Vec::new(),
        _ => recorded[1..].as_chunks::<2>().0.to_vec(),
    };
    // The right partners have the steadiest sums.
    let noise = [pairs, &rearranged, &shifted]
        .into_iter()
        .filter(|pairs| !pairs.is_empty())
        .map(noise)
        .fold(f64::INFINITY, f64::min);
    let claimed = Claimed { pairs, first: Some(first), noise };
    let [on, off] = pairs[first];
    let broken = claimed.broken(on, off);
    let says = |explanation| Some(Doubt::Form { claimed: claim.form, broken, explanation });
    let own = partnership(pairs);
    let breaks_the_law = broken.above + broken.below > 0;
    // Partners that know much of each other and keep the law are the right ones.
    if !breaks_the_law && own * (count as f64).sqrt() > FAR_BETTER {
        return None;
    }
    let least = if breaks_the_law { BETTER } else { FAR_BETTER };
    // All-on and all-off are farther apart than any other two patterns.
    let better = |other: &[[f64; 2]], apart: f64| {
        if apart < MORE_APART * (on - off) {
            return None;
        }
        let gain = (partnership(other) - own) * (other.len() as f64).sqrt();
        (gain > least).then_some(gain)
    };
    let mut best: Option<(f64, Explanation)> = None;
    let mut offer = |gain: Option<f64>, explanation| {
        if let Some(gain) = gain
            && best.is_none_or(|(before, _)| gain > before)
        {
            best = Some((gain, explanation));
        }
    };
    let form = if claim.form == Form::Halves { Form::Pairs } else { Form::Halves };
    let with = |pairs| Claimed { pairs, first: None, noise };
    let [other_on, other_off] = rearranged[place];
    if with(&rearranged[..]).keeps(other_on, other_off) {
        offer(better(&rearranged, other_on - other_off), Explanation::Form(form));
    } else if with(&rearranged[..]).keeps_swapped(other_on, other_off) {
        offer(better(&rearranged, other_off - other_on), Explanation::ComplementsFirst(form));
    }
    // The all-off reading before the others says that the all-on reading before it is missing.
    let starts_dark = |off: f64, tolerance: f64| place == 0 && recorded[0] < off - tolerance;
    if let Some(&[on, off]) = shifted.get(place)
        && with(&shifted[..]).keeps(on, off)
        && !starts_dark(off, with(&shifted[..]).tolerance(on, off))
    {
        offer(better(&shifted, on - off), Explanation::OneLate);
    }
    if !shifted.is_empty() {
        let (on, off) = match place.checked_sub(1) {
            Some(before) => (shifted[before][0], shifted[before][1]),
            // The all-on reading is the missing one.
            None => (median(sums(&shifted)) - recorded[0], recorded[0]),
        };
        if with(&shifted[..]).keeps(on, off) {
            offer(better(&shifted, on - off), Explanation::OneEarly);
        }
    }
    if let Some((_, explanation)) = best {
        return says(explanation);
    }
    // Samples of one reading differ by noise alone, and so do the readings of a pair then.
    let steady = deviation(pairs.iter().map(|[one, other]| (one - other).abs())).min(noise);
    let sampled = Claimed { pairs, first: Some(first), noise: steady }.broken(on, off);
    if sampled.above + sampled.below > few(sampled.readings)
        && let Some(each) = repeats::samples(&recorded, claim.side_guessed)
    {
        let averaged = repeats::averaged(&recorded, each);
        let averaged = averaged.as_chunks::<2>().0;
        if let Some(&[on, off]) = averaged.get(place)
            && (Claimed { pairs: averaged, first: None, noise: steady }).keeps(on, off)
        {
            let (broken, explanation) = (sampled, Explanation::Samples { each });
            return Some(Doubt::Form { claimed: claim.form, broken, explanation });
        }
    }
    if broken.above + broken.below <= few(broken.readings)
        || all_on_is_an_outlier(rows, pairs, first)
    {
        return None;
    }
    if claimed.keeps_swapped(on, off) {
        let greatest = pairs.as_flattened().iter().copied().fold(f64::NEG_INFINITY, f64::max);
        return says(match greatest <= claimed.tolerance(on, off) {
            true => Explanation::Inverted,
            false => Explanation::ComplementsFirst(claim.form),
        });
    }
    let brightest = (0..pairs.len()).max_by(|&a, &b| pairs[a][0].total_cmp(&pairs[b][0]))?;
    let [on, off] = pairs[brightest];
    // Other partners are the right ones, and not in any form that is known.
    let gain = |other: &[[f64; 2]]| (partnership(other) - own) * (other.len() as f64).sqrt();
    if own < SURE_PARTNERS
        && [&rearranged, &shifted]
            .into_iter()
            .any(|other| !other.is_empty() && gain(other) > FAR_BETTER)
    {
        return says(Explanation::Unknown);
    }
    // Without another explanation, the lamp may have changed: `beyond` follows the lamp.
    let is_all_on = claimed.keeps(on, off)
        && own * (count as f64).sqrt() > BETTER
        && claimed.is_alone(brightest);
    if is_all_on { says(Explanation::Order { all_on: brightest }) } else { None }
}

/// Whether the pair of the all-on pattern itself has a reading that light cannot have given.
fn all_on_is_an_outlier(rows: &Rows, pairs: &[[f64; 2]], first: usize) -> bool {
    let sign = if median(sums(pairs)) < 0.0 { -1.0 } else { 1.0 };
    let upright: Vec<[f64; 2]> = pairs.iter().map(|pair| pair.map(|y| sign * y)).collect();
    let level = local_level(&sums(&upright), 2.0 * dark_level(rows, &upright, 1.0));
    let none_lost = vec![false; pairs.len()];
    too_bright(rows, &upright, &level, &none_lost, Some(first))
        .is_ok_and(|found| found.iter().any(|outlier| outlier.reading / 2 == first))
}

impl Claimed<'_> {
    /// Whether the readings keep the law if all-on and all-off change places.
    fn keeps_swapped(&self, on: f64, off: f64) -> bool {
        self.keeps(off, on)
    }

    /// Whether no other pair is about as far apart as this one.
    fn is_alone(&self, at: usize) -> bool {
        let apart = |k: usize| (self.pairs[k][0] - self.pairs[k][1]).abs();
        (0..self.pairs.len())
            .all(|k| k == at || Some(k) == self.first || apart(k) < 0.9 * apart(at))
    }
}

/// The readings in the order of the recording.
fn as_recorded(pairs: &[[f64; 2]], form: Form) -> Vec<f64> {
    match form {
        Form::Halves => {
            let half = |reading: usize| pairs.iter().map(move |pair| pair[reading]);
            half(0).chain(half(1)).collect()
        }
        _ => pairs.as_flattened().to_vec(),
    }
}

/// Pairs with more light than the pairs beside them in time, and than patterns that are as coarse: a
/// mirror array may collect more light of coarse patterns.
fn too_bright(
    rows: &Rows,
    pairs: &[[f64; 2]],
    level: &[f64],
    lost: &[bool],
    first: Option<usize>,
) -> Result<Vec<Outlier>, Doubt> {
    let sums = sums(pairs);
    let count = sums.len();
    if count < 2 * BESIDE {
        return Ok(Vec::new());
    }
    let dark = 2.0 * dark_level(rows, pairs, 1.0);
    let excess: Vec<f64> = sums.iter().zip(level).map(|(sum, level)| sum - level).collect();
    let mut by_coarseness: Vec<usize> = first.into_iter().collect();
    by_coarseness.extend(order::positions_by_sequency(rows));
    let ordered: Vec<f64> = by_coarseness.iter().map(|&k| excess[k]).collect();
    let usual = running_median(&ordered, LEVEL / 2);
    let sigma = deviation(ordered.iter().zip(&usual).map(|(excess, usual)| (excess - usual).abs()));
    let beside = |k: usize| {
        let of = |range: std::ops::Range<usize>| {
            let whole: Vec<f64> = range.filter(|&k| !lost[k]).map(|k| sums[k]).collect();
            (!whole.is_empty()).then(|| median(whole))
        };
        let before = of(k.saturating_sub(BESIDE)..k);
        let after = of(k + 1..(k + 1 + BESIDE).min(count));
        before.into_iter().chain(after).fold(f64::NEG_INFINITY, f64::max)
    };
    let mut found = Vec::new();
    for (place, &k) in by_coarseness.iter().enumerate() {
        let limit = (BRIGHT_SIGMAS * sigma).max(BRIGHT_SHARE * (level[k] - dark).abs());
        if lost[k] || excess[k] <= limit || sums[k] - beside(k) <= limit {
            continue;
        }
        // The second greatest of the patterns that are as coarse, so that one outlier hides no other.
        let near = place.saturating_sub(AS_COARSE)..(place + AS_COARSE + 1).min(count);
        let mut alike: Vec<f64> =
            near.filter(|&other| other != place).map(|other| ordered[other]).collect();
        alike.sort_unstable_by(f64::total_cmp);
        let as_coarse = alike[alike.len() - 2];
        if excess[k] - as_coarse.max(0.0) <= limit {
            continue;
        }
        let larger = usize::from(pairs[k][1] > pairs[k][0]);
        found.push(Outlier {
            reading: 2 * k + larger,
            value: 0.0,
            row: 0,
            why: Impossible::PairTooBright { sum: sums[k], expected: level[k] },
        });
    }
    match found.len() <= few(count) {
        true => Ok(found),
        false => Err(Doubt::Bursts { pairs: found.len(), of: count }),
    }
}

/// Readings beyond all-on and all-off.
enum Beyond {
    Few(Vec<Outlier>),
    Many(Broken),
}

/// Looks for readings beyond the all-on and all-off pattern `first`, whose lamp follows `level`.
fn beyond(pairs: &[[f64; 2]], level: &[f64], lost: &[bool], first: usize) -> Beyond {
    let [on, off] = pairs[first];
    let claimed = Claimed { pairs, first: Some(first), noise: noise(pairs) };
    let tolerance = claimed.tolerance(on, off);
    let mut found = Vec::new();
    let mut broken = Broken { readings: 2 * pairs.len(), above: 0, below: 0 };
    for (k, pair) in pairs.iter().enumerate().filter(|(k, _)| !lost[*k]) {
        // A lamp that grows brighter raises all-on, and the sum of this pair.
        let grown = (level[k].max(pair[0] + pair[1]) - 2.0 * off) / (level[first] - 2.0 * off);
        let on = off + (on - off) * if grown.is_finite() { grown.max(1.0) } else { 1.0 };
        let above = pair.iter().position(|&y| y > on + tolerance);
        let below = pair.iter().position(|&y| y < off - tolerance);
        broken.above += usize::from(above.is_some());
        broken.below += usize::from(below.is_some());
        let why = match (above, below) {
            (Some(at), _) => (at, Impossible::AboveAllOn { all_on: on }),
            (None, Some(at)) => (at, Impossible::BelowAllOff { all_off: off }),
            (None, None) => continue,
        };
        found.push(Outlier { reading: 2 * k + why.0, value: 0.0, row: 0, why: why.1 });
    }
    match found.len() <= few(pairs.len()) {
        true => Beyond::Few(found),
        false => Beyond::Many(broken),
    }
}

/// The doubt about an all-on reading that the sums of the other pairs contradict, and the difference that
/// they call for.
fn saturated(pairs: &[[f64; 2]], level: &[f64], first: usize) -> Option<(Doubt, f64)> {
    let [found, off] = pairs[first];
    let expected = level[first] - off;
    let missing = expected - found;
    let greatest = pairs.as_flattened().iter().copied().fold(f64::NEG_INFINITY, f64::max);
    (found >= greatest - LAW_SHARE * (found - off)
        && pairs.len() >= 2 * BESIDE
        && missing > (SATURATED_SHARE * (expected - off)).max(LAW_SIGMAS * noise(pairs)))
    .then_some((Doubt::Saturated { found, expected }, expected - off))
}

/// Whether many readings are equal to the greatest or least one, and the pair of the all-on pattern shows
/// that light was cut off there.
fn clipped(pairs: &[[f64; 2]], first: Option<usize>) -> Option<(Doubt, f64)> {
    let first = first?;
    let [on, off] = pairs[first];
    let readings = pairs.as_flattened();
    let others = running_median(&sums(pairs), LEVEL)[first];
    let [least, most] = ends(readings);
    let says = |end: &End, extreme, is_cut: bool| {
        (is_cut && end.is_pile).then(|| (end.clipped(readings.len(), extreme), end.value))
    };
    let limit = (SATURATED_SHARE * (others - 2.0 * off).abs()).max(LAW_SIGMAS * noise(pairs));
    let cut_above = on == most.value && on + off < others - limit;
    let cut_below = off == least.value && on + off > others + limit;
    says(&most, Extreme::Greatest, cut_above).or_else(|| says(&least, Extreme::Least, cut_below))
}

/// Below this a reading is nearer to darkness than to the usual reading.
fn saturation_floor(pairs: &[[f64; 2]]) -> f64 {
    0.25 * median(pairs.as_flattened().to_vec())
}

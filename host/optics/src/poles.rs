//! First-order poles, stepped exactly.

/// exp(-t / tau). A pole with a time constant of 0 keeps nothing.
pub(crate) fn decay(t: f64, tau: f64) -> f64 {
    if tau > 0.0 { (-t / tau).exp() } else { 0.0 }
}

/// The rest in a pole `second` at time `t`, of a unit that was in the preceding pole `first` at
/// time 0: `first / (first - second) * (exp(-t / first) - exp(-t / second))`.
pub(crate) fn shared_decay(t: f64, first: f64, second: f64) -> f64 {
    let difference = first - second;
    if first == 0.0 {
        0.0
    } else if difference.abs() < 1e-6 * first {
        t / first * decay(t, first)
    } else {
        first / difference * (decay(t, first) - decay(t, second))
    }
}

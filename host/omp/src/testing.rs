//! Shared test support.

use nirspi_patterns::Side;
use rand::RngExt;
use rand_pcg::Pcg64;

pub(crate) fn side(n: u64) -> Side {
    Side::new(n).unwrap()
}

/// A random number of the standard normal distribution (Box and Muller).
pub(crate) fn normal(random: &mut Pcg64) -> f64 {
    let (u, v): (f64, f64) = (1.0 - random.random::<f64>(), random.random());
    (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
}

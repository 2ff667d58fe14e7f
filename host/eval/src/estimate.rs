//! A mean and its confidence interval.

use serde::Serialize;

/// A mean with the half width of its 95 % confidence interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Estimate {
    /// The mean.
    pub mean: f64,
    /// Student's t times the standard error; `null` for a single value.
    pub ci95: Option<f64>,
    /// Number of values, or groups, of the interval.
    pub n: usize,
}

impl Estimate {
    /// A figure of all values together, with its interval by the jackknife. `without` holds the
    /// same figure of all values except one group, for each group (Tukey, Ann. Math. Stat. 29, 614,
    /// 1958).
    #[must_use]
    pub fn jackknife(of_all: f64, without: &[f64]) -> Self {
        let n = without.len();
        let mean = without.iter().sum::<f64>() / n as f64;
        let squares: f64 = without.iter().map(|v| (v - mean).powi(2)).sum();
        let error = ((n as f64 - 1.0) / n as f64 * squares).sqrt();
        Self { mean: of_all, ci95: (n > 1).then(|| student_95(n - 1) * error), n }
    }

    /// `24.10 ± 0.35`.
    #[must_use]
    pub fn text(&self, digits: usize) -> String {
        match self.ci95 {
            Some(ci) => format!("{:.digits$} ± {ci:.digits$}", self.mean),
            None => format!("{:.digits$}", self.mean),
        }
    }
}

/// The 97.5 % quantile of Student's t at these degrees of freedom, exact to 0.001 (Abramowitz and
/// Stegun 26.7.5 from 10 on).
fn student_95(freedom: usize) -> f64 {
    const FEW: [f64; 9] = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262];
    if let Some(t) = freedom.checked_sub(1).and_then(|at| FEW.get(at)) {
        return *t;
    }
    let (z, n) = (1.959_964_f64, freedom as f64);
    z + (z.powi(3) + z) / (4.0 * n)
        + (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / (96.0 * n * n)
        + (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / (384.0 * n.powi(3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_of_a_mean_is_students() {
        // Leaving out one of n values moves the mean by (mean - value) / (n - 1), which gives the
        // standard error of the mean.
        let values = [1.0, 2.0, 3.0, 4.0];
        let without = values.map(|v| (10.0 - v) / 3.0);
        let estimate = Estimate::jackknife(2.5, &without);
        let error = (5.0_f64 / 3.0).sqrt() / 2.0;
        assert!((estimate.ci95.unwrap() - 3.182 * error).abs() < 1e-9, "{estimate:?}");
        assert_eq!((estimate.n, estimate.text(2).as_str()), (4, "2.50 ± 2.05"));
        assert_eq!(Estimate::jackknife(3.0, &[3.0]).text(1), "3.0");
    }

    #[test]
    fn students_quantiles_are_those_of_the_tables() {
        for (freedom, t) in [(1, 12.706), (9, 2.262), (10, 2.228), (30, 2.042), (1000, 1.962)] {
            assert!((student_95(freedom) - t).abs() < 1.5e-3, "{freedom}: {}", student_95(freedom));
        }
    }
}

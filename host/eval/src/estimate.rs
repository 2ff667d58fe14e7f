//! A mean and how sure it is.

use serde::Serialize;

/// A mean with the half width of its 95 % confidence interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Estimate {
    /// The mean.
    pub mean: f64,
    /// 1.96 standard errors; `null` of a single value.
    pub ci95: Option<f64>,
    /// Values averaged.
    pub n: usize,
}

impl Estimate {
    /// The mean of independent values; none of no values.
    #[must_use]
    pub fn of(values: &[f64]) -> Option<Self> {
        let n = values.len();
        let mean = values.iter().sum::<f64>() / n as f64;
        let squares: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
        let ci95 = (n > 1).then(|| 1.96 * (squares / (n - 1) as f64 / n as f64).sqrt());
        (n > 0).then_some(Self { mean, ci95, n })
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_interval_is_that_of_the_standard_error() {
        // Standard deviation sqrt(5/3), standard error of four values half of that.
        let estimate = Estimate::of(&[1.0, 2.0, 3.0, 4.0]).unwrap();
        assert_eq!((estimate.mean, estimate.n), (2.5, 4));
        assert!((estimate.ci95.unwrap() - 1.96 * (5.0_f64 / 3.0).sqrt() / 2.0).abs() < 1e-12);
        assert_eq!(estimate.text(2), "2.50 ± 1.27");
    }

    #[test]
    fn one_value_has_no_interval_and_none_no_mean() {
        let one = Estimate::of(&[3.0]).unwrap();
        assert_eq!((one.ci95, one.text(1).as_str()), (None, "3.0"));
        assert_eq!(Estimate::of(&[]), None);
    }
}

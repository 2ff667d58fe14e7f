//! Counts and numbers as people write them, for messages and reports.

/// A count with its noun: `1 atom`, `2 atoms`. The plural is the noun with an `s`.
///
/// ```
/// assert_eq!(nirspi_recon::words::count(1_u32, "atom"), "1 atom");
/// assert_eq!(nirspi_recon::words::count(0_u64, "frame"), "0 frames");
/// ```
#[must_use]
pub fn count(number: impl Into<u128>, noun: &str) -> String {
    match number.into() {
        1 => format!("1 {noun}"),
        number => format!("{number} {noun}s"),
    }
}

/// The same for a number of elements.
#[must_use]
pub fn count_of(number: usize, noun: &str) -> String {
    count(number as u128, noun)
}

/// The `f64` that has the shortest decimal form of a 32-bit number: `0.3`, where `f64::from` gives
/// `0.30000001192092896`.
#[must_use]
pub fn shortest(number: f32) -> f64 {
    number.to_string().parse().unwrap_or_else(|_| f64::from(number))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_shortest_form_is_the_same_number(number: f32) {
            let written = shortest(number);
            prop_assert!(number.is_nan() || written as f32 == number);
            prop_assert!(number.is_nan() || written.to_string() == number.to_string());
        }
    }

    #[test]
    fn one_is_singular_and_every_other_count_plural() {
        let told: Vec<String> = [0_u32, 1, 2].map(|number| count(number, "image")).into();
        assert_eq!(told, ["0 images", "1 image", "2 images"]);
        assert_eq!(shortest(0.3).to_string(), "0.3");
    }
}

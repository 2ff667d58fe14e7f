//! The noise of an ADC, from the signal-to-noise ratio in its data sheet.

use nirspi_optics::chain::adc_noise_counts;

/// A converter whose only noise is rounding has 6.02 N + 1.76 dB with a full-scale sine (N bits), and
/// rounding has 1 / sqrt 12 counts.
#[test]
fn a_converter_that_only_rounds_has_the_noise_of_rounding() {
    let bits = 14.0;
    let snr_db = 20.0 * 2_f64.log10() * bits + 10.0 * 1.5_f64.log10();
    assert!((snr_db - 86.05).abs() < 0.01);
    assert!((adc_noise_counts(snr_db) - 12_f64.sqrt().recip()).abs() < 1e-9);
    // 20 dB less is ten times the noise.
    assert!((adc_noise_counts(snr_db - 20.0) - 10.0 / 12_f64.sqrt()).abs() < 1e-8);
}

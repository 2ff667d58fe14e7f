//! What the receiver promises: exact settling, delay and range; noise of the right size.

#![allow(clippy::unwrap_used, reason = "a test may stop at the first surprise")]

use nirspi_optics::chain::{GAINS_ELECTRONS_PER_COUNT, amplifier_noise_electrons};
use nirspi_optics::instrument::{FULL_SCALE_COUNTS, MAX_ADC_LATENCY_CLOCKS};
use nirspi_optics::{
    AdcSample, Budget, BudgetSettings, Chain, ChainError, ChainSettings, LedEdges, Light, Projector,
};
use proptest::prelude::*;

fn chain(settings: ChainSettings, seed: u64) -> Chain {
    Chain::new(settings, seed).unwrap()
}

fn budget(distance_mm: f64) -> Budget {
    Budget::new(&BudgetSettings::default(), &Projector::default(), distance_mm).unwrap()
}

/// Mean and variance of settled samples, in counts.
fn statistics(settings: ChainSettings, light: f32, samples: u32) -> (f64, f64) {
    let mut chain = chain(settings, 11);
    for _ in 0..200 {
        chain.sample(light);
    }
    let (mut sum, mut squares) = (0.0, 0.0);
    for _ in 0..samples {
        let counts = f64::from(chain.sample(light).counts);
        sum += counts;
        squares += counts * counts;
    }
    let mean = sum / f64::from(samples);
    (mean, squares / f64::from(samples) - mean * mean)
}

#[test]
fn the_ideal_chain_rounds_the_light_of_the_same_clock() {
    let settings = ChainSettings { electrons_per_count: 4.0, ..ChainSettings::ideal() };
    let mut chain = chain(settings, 0);
    let offset = settings.adc_offset_counts;
    for (light, counts) in [(0.0, 0), (4.0, 1), (5.9, 1), (6.0, 2), (40_000.0, 10_000), (1.0, 0)] {
        assert_eq!(chain.sample(light).counts, offset + counts, "{light} electrons");
    }
    assert_eq!(chain.settings().settling(0), 1.0);
}

#[test]
fn over_range_is_set_only_above_full_scale() {
    let settings = ChainSettings { adc_offset_counts: 1000, ..ChainSettings::ideal() };
    let mut chain = chain(settings, 0);
    let full = f32::from(FULL_SCALE_COUNTS - 1000);
    let at = |counts, over_range| AdcSample { counts, over_range };
    assert_eq!(chain.sample(full - 1.0), at(FULL_SCALE_COUNTS - 1, false));
    assert_eq!(chain.sample(full), at(FULL_SCALE_COUNTS, false));
    assert_eq!(chain.sample(full + 1.0), at(FULL_SCALE_COUNTS, true));
    assert_eq!(chain.sample(f32::INFINITY), at(FULL_SCALE_COUNTS, true));
    assert_eq!(chain.sample(0.0), at(1000, false));
}

#[test]
fn noise_below_the_range_clips_to_zero_and_is_not_over_range() {
    let settings = ChainSettings {
        adc_offset_counts: 0,
        amplifier_noise_electrons: 500.0,
        ..ChainSettings::ideal()
    };
    let mut chain = chain(settings, 5);
    let samples: Vec<_> = (0..1000).map(|_| chain.sample(0.0)).collect();
    assert!(samples.iter().filter(|s| s.counts == 0).count() > 400);
    assert!(samples.iter().all(|s| !s.over_range));
}

#[test]
fn light_that_is_no_number_counts_as_none_and_is_forgotten() {
    let mut chain = chain(ChainSettings::ideal(), 0);
    let offset = chain.settings().adc_offset_counts;
    for light in [f32::NAN, -5.0, f32::NEG_INFINITY] {
        assert_eq!(chain.sample(light).counts, offset);
        assert_eq!(chain.sample(7.0).counts, offset + 7);
    }
}

#[test]
fn the_delay_is_exact_at_every_latency() {
    for latency in 0..=MAX_ADC_LATENCY_CLOCKS {
        let settings = ChainSettings {
            adc_latency_clocks: latency,
            ambient_electrons: 30.0,
            ..ChainSettings::ideal()
        };
        let mut chain = chain(settings, 0);
        let dark = settings.adc_offset_counts + 30;
        let latency = u16::from(latency);
        for clock in 0..200_u16 {
            let light = 100 + clock;
            let expected = if clock < latency { dark } else { dark + light - latency };
            assert_eq!(chain.sample(f32::from(light)).counts, expected, "clock {clock}");
        }
    }
}

#[test]
fn the_same_seed_gives_the_same_samples_and_another_does_not() {
    let run = |seed| -> Vec<_> {
        let mut chain = chain(ChainSettings::default(), seed);
        (0..500_u16).map(|i| chain.sample(f32::from(i % 40 * 100))).collect()
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

#[test]
fn noise_has_the_variance_of_its_source() {
    let ideal = ChainSettings::ideal();
    let shot = ChainSettings { shot_noise: true, ..ideal };
    let daylight = ChainSettings { ambient_electrons: 4_000.0, ..shot };
    let amplifier = ChainSettings { amplifier_noise_electrons: 300.0, ..ideal };
    let pole = ChainSettings { amplifier_bandwidth_hz: 60e6, ..shot };
    // Light and the mean and variance that it has.
    for (what, settings, light, mean, variance) in [
        ("shot noise", shot, 200.0, 200.0, 200.0),
        ("shot noise", shot, 1_000.0, 1_000.0, 1_000.0),
        ("shot noise", shot, 10_000.0, 10_000.0, 10_000.0),
        ("daylight", daylight, 1_000.0, 5_000.0, 5_000.0),
        ("the amplifier in the dark", amplifier, 0.0, 0.0, 90_000.0),
        ("the amplifier in light", amplifier, 8_000.0, 8_000.0, 90_000.0),
        // pi * 60 MHz * 8 ns = 1.508
        ("shot noise behind a pole", pole, 10_000.0, 10_000.0, 15_080.0),
    ] {
        let (found, seen) = statistics(settings, light, 200_000);
        let off = found - f64::from(settings.adc_offset_counts) - mean;
        assert!(off.abs() < 5.0 * (variance / 200_000.0_f64).sqrt(), "{what}: {found}");
        // 200 000 samples know a variance to sqrt(2 / 200 000) = 0.32 %; four of those. Rounding adds a twelfth.
        assert!(((seen - 1.0 / 12.0) / variance - 1.0).abs() < 0.013, "{what}: {seen}");
    }
}

#[test]
fn the_noise_of_a_window_is_what_the_settings_say() {
    for (bandwidth_mhz, adc_noise_counts, light) in
        [(60.0, 0.0, 8000.0), (10.0, 0.0, 0.0), (20.0, 40.0, 20_000.0)]
    {
        let settings = ChainSettings {
            amplifier_bandwidth_hz: bandwidth_mhz * 1e6,
            adc_noise_counts,
            electrons_per_count: 4.0,
            ..ChainSettings::default()
        };
        let window = 9;
        let mut chain = chain(settings, 7);
        for _ in 0..200 {
            chain.sample(light);
        }
        let means: Vec<f64> = (0..40_000)
            .map(|_| {
                let samples = (0..window).map(|_| f64::from(chain.sample(light).counts));
                let mean = samples.sum::<f64>() / f64::from(window);
                // As in a sweep: what is blanked lets the noise forget.
                for _ in 0..40 {
                    chain.sample(light);
                }
                mean
            })
            .collect();
        let mean = means.iter().sum::<f64>() / means.len() as f64;
        let variance =
            means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / means.len() as f64 * 16.0;
        let expected = settings.variance_of_mean(f64::from(light), window);
        // 40 000 windows know a variance to sqrt(2 / 40 000) = 0.7 %; four of those.
        assert!(
            (variance / expected - 1.0).abs() < 0.028,
            "{bandwidth_mhz} MHz: {variance} against {expected}"
        );
    }
}

#[test]
fn amplifier_noise_follows_from_its_current_density() {
    // 1 pA/sqrt(Hz) over pi/2 * 60 MHz = 9.708 nA; times 8 ns / e = 484.7 electrons.
    assert!((amplifier_noise_electrons(1.0, 60e6, 8.0) - 484.7).abs() < 0.1);
}

#[test]
fn leds_settle_as_fast_as_their_data_sheet_says() {
    // FACTS.md: a 10 ns LED leaves 3 % after 16 ns, a 20 ns one 7 % after 24 ns.
    for (edge_ns, clocks, left) in [(10.0, 2, 0.030), (20.0, 3, 0.072)] {
        let led = LedEdges::alike(edge_ns);
        let settings = ChainSettings { led, ..ChainSettings::ideal() };
        assert!((1.0 - settings.settling(clocks - 1) - left).abs() < 0.001);
    }
}

#[test]
fn a_dark_receiver_is_never_over_range_at_the_gain_it_chooses() {
    for distance_mm in [300.0, 1000.0] {
        let mut settings = ChainSettings::default();
        settings.electrons_per_count = settings.auto_gain(&budget(distance_mm)).unwrap();
        let mut chain = chain(settings, 2);
        for _ in 0..500_000 {
            let sample = chain.sample(0.0);
            assert!(!sample.over_range && sample.counts > 0);
        }
    }
}

#[test]
fn the_gain_chosen_holds_a_white_target_in_daylight_and_uses_the_range() {
    for distance_mm in [200.0, 300.0, 600.0, 1000.0] {
        let budget = budget(distance_mm);
        let mut settings = ChainSettings {
            ambient_electrons: budget.ambient_electrons(1.0),
            ..ChainSettings::default()
        };
        let gain = settings.auto_gain(&budget).unwrap();
        settings.electrons_per_count = gain;
        let mut bright = chain(settings, 3);
        let all_lit = (budget.electrons_per_led * 1024.0) as f32;
        assert!((0..200_000).all(|_| !bright.sample(all_lit).over_range), "{distance_mm} mm");

        // The next finer gain does not fit.
        let steps = GAINS_ELECTRONS_PER_COUNT;
        let step = steps.iter().position(|&s| s == gain).unwrap();
        let counts = |electrons: f64| electrons / steps[step - 1];
        let noise = settings.amplifier_noise_electrons;
        let top = counts(budget.brightest_electrons() + 6.0 * noise.hypot(170.0)) + 2048.0;
        assert!(top > 16383.0 || counts(6.0 * noise) > 2048.0, "{distance_mm} mm: {top}");
    }
}

#[test]
fn a_white_target_at_the_focus_fills_most_of_the_adc() {
    let budget = budget(300.0);
    let settings = ChainSettings::default();
    let gain = settings.auto_gain(&budget).unwrap();
    assert_eq!(gain, settings.electrons_per_count, "the default is the gain for 0.3 m");
    let counts = 2048.0 + budget.brightest_electrons() / gain;
    assert!((0.6..0.95).contains(&(counts / 16383.0)), "{counts}");
}

#[test]
fn light_that_fits_no_gain_is_refused() {
    let blinding = Budget { electrons_per_led: 1e9, ..budget(300.0) };
    let error = ChainSettings::default().auto_gain(&blinding).unwrap_err();
    assert!(matches!(error, ChainError::NoGain { .. }), "{error}");
}

#[test]
fn gains_rise_by_half_octaves() {
    for pair in GAINS_ELECTRONS_PER_COUNT.windows(2) {
        assert!((1.3..=1.5).contains(&(pair[1] / pair[0])), "{pair:?}");
    }
}

/// A row line with 1 fF and 3.3 V injects 20 597 electrons, of which one pole of 60 MHz leaves `T / tau exp(-t / tau)`.
#[test]
fn a_line_that_rises_injects_its_charge_and_one_that_falls_takes_it_back() {
    let line_electrons = 20_597.0;
    let settings = ChainSettings {
        line_electrons,
        amplifier_bandwidth_hz: 60e6,
        adc_offset_counts: 5000,
        ..ChainSettings::ideal()
    };
    let tau_ns = 1e9 / (std::f64::consts::TAU * 60e6);
    let mut chain = chain(settings, 0);
    let lines = |lines_risen| Light { lines_risen, ..Light::default() };
    for (risen, charge) in [(1, 1.0), (-1, -1.0), (0, 0.0)] {
        for clock in 0..5 {
            let light = if clock == 0 { lines(risen) } else { lines(0) };
            let found = f64::from(chain.sample(light).counts) - 5000.0;
            let t = 8.0 * f64::from(clock + 1);
            let expected = charge * line_electrons * 8.0 / tau_ns * (-t / tau_ns).exp();
            // What the lines before have left, 40 ns later, is below a count.
            assert!((found - expected).abs() <= 0.6, "{risen}, clock {clock}: {found}, {expected}");
        }
    }
    // Without a pole the charge has passed before the sample.
    let ideal = ChainSettings { line_electrons, ..ChainSettings::ideal() };
    let mut chain = Chain::new(ideal, 0).unwrap();
    assert_eq!(chain.sample(lines(32)).counts, ideal.adc_offset_counts);
}

#[test]
fn settling_is_the_mean_of_rise_and_fall() {
    let led =
        LedEdges { rise_ns: 12.0, fall_ns: 17.0, turn_on_delay_ns: 1.0, turn_off_delay_ns: 0.0 };
    let two = ChainSettings { led, ..ChainSettings::default() };
    for n in 0..10 {
        let mean = (two.rising(n) + two.falling(n)) / 2.0;
        assert!((two.settling(n) - mean).abs() < 1e-15 && two.rising(n) != two.falling(n));
    }
    let alike = |edge_ns| ChainSettings { led: LedEdges::alike(edge_ns), ..two };
    assert_eq!(two.falling(3), alike(17.0).settling(3));
    assert!(two.own_share(5, 2) < alike(12.0).own_share(5, 2));
    assert!(two.own_share(5, 2) > alike(17.0).own_share(5, 2));
    assert!(!two.is_linear() && alike(12.0).is_linear());
}

#[test]
fn the_first_pixel_is_off_by_the_difference_of_rise_and_fall() {
    let with = |led| ChainSettings { led, ..ChainSettings::default() }.first_pixel_off(5, 2);
    assert_eq!(with(LedEdges::alike(15.0)), 0.0);
    let circuit =
        LedEdges { rise_ns: 12.76, fall_ns: 16.36, turn_on_delay_ns: 1.22, turn_off_delay_ns: 0.0 };
    // boards/electronics/check.py has -3.69 with 60.5 MHz.
    assert!((with(circuit) + 3.69).abs() < 0.03, "{}", with(circuit));
    let reverse = LedEdges {
        rise_ns: circuit.fall_ns,
        fall_ns: circuit.rise_ns,
        turn_on_delay_ns: 0.0,
        turn_off_delay_ns: circuit.turn_on_delay_ns,
    };
    assert!(with(reverse) > 3.5);
}

#[test]
fn settings_out_of_range_are_named() {
    let default = ChainSettings::default();
    let led = |led| ChainSettings { led, ..default };
    let cases = [
        ("sample_ns", ChainSettings { sample_ns: 0.0, ..default }),
        ("rise_ns", led(LedEdges { rise_ns: -1.0, ..default.led })),
        ("fall_ns", led(LedEdges { fall_ns: f64::NAN, ..default.led })),
        ("turn_on_delay_ns", led(LedEdges { turn_on_delay_ns: 8.1, ..default.led })),
        ("turn_off_delay_ns", led(LedEdges { turn_off_delay_ns: -0.1, ..default.led })),
        ("line_electrons", ChainSettings { line_electrons: f64::NAN, ..default }),
        ("amplifier_bandwidth_hz", ChainSettings { amplifier_bandwidth_hz: f64::NAN, ..default }),
        ("ambient_electrons", ChainSettings { ambient_electrons: f64::INFINITY, ..default }),
        ("dark_electrons", ChainSettings { dark_electrons: -1.0, ..default }),
        ("amplifier_noise_electrons", ChainSettings { amplifier_noise_electrons: -1.0, ..default }),
        ("adc_noise_counts", ChainSettings { adc_noise_counts: f64::NAN, ..default }),
        ("electrons_per_count", ChainSettings { electrons_per_count: 0.0, ..default }),
        ("adc_offset_counts", ChainSettings { adc_offset_counts: 16384, ..default }),
        ("adc_latency_clocks", ChainSettings { adc_latency_clocks: 64, ..default }),
    ];
    for (field, settings) in cases {
        let ChainError::Setting { name, .. } = Chain::new(settings, 0).unwrap_err() else {
            panic!("{field}: another error");
        };
        assert_eq!(name, field);
    }
}

proptest! {
    #[test]
    fn a_step_settles_as_the_analytic_response_says(
        edge_ns in prop_oneof![Just(0.0), 0.5..40.0],
        bandwidth_mhz in prop_oneof![Just(f64::INFINITY), 5.0..500.0],
        light in 1_000.0_f32..14_000.0,
    ) {
        let settings = ChainSettings {
            led: LedEdges::alike(edge_ns),
            amplifier_bandwidth_hz: bandwidth_mhz * 1e6,
            ..ChainSettings::ideal()
        };
        let mut chain = chain(settings, 0);
        let offset = f64::from(settings.adc_offset_counts);
        // up, then down again: the response is linear and has a memory
        for n in 0..40 {
            let expected = f64::from(light) * settings.settling(n) + offset;
            let found = f64::from(chain.sample(light).counts);
            prop_assert!((found - expected).abs() <= 0.501, "rise {n}: {found}, {expected}");
        }
        for n in 0..40 {
            let left = settings.settling(n + 40) - settings.settling(n);
            let expected = f64::from(light) * left + offset;
            let found = f64::from(chain.sample(0.0).counts);
            prop_assert!((found - expected).abs() <= 0.501, "fall {n}: {found}, {expected}");
        }
    }

    #[test]
    fn equal_poles_settle_like_nearly_equal_ones(edge_ns in 1.0..40.0) {
        let bandwidth_of = |tau_ns: f64| 1e9 / (std::f64::consts::TAU * tau_ns);
        let tau_ns = edge_ns / 9.0_f64.ln();
        let with = |tau_ns| ChainSettings {
            led: LedEdges::alike(edge_ns),
            amplifier_bandwidth_hz: bandwidth_of(tau_ns),
            ..ChainSettings::ideal()
        };
        for n in 0..10 {
            let (equal, near) = (with(tau_ns).settling(n), with(tau_ns * 1.0001).settling(n));
            prop_assert!((equal - near).abs() < 1e-4);
        }
    }

    #[test]
    fn counts_are_fourteen_bits_whatever_the_light(light: f32, seed: u64) {
        let mut chain = chain(ChainSettings::default(), seed);
        for _ in 0..20 {
            prop_assert!(chain.sample(light).counts <= FULL_SCALE_COUNTS);
        }
    }
}

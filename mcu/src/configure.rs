//! Checks a configuration and translates it into register values.
//!
//! # Invariant
//! A [`Setup`] exists only for a configuration that keeps to the board's light budget in every
//! window of a run (`tests::no_window_is_brighter_than_the_peak`) and has every number in the range
//! that the FPGA accepts (`crate::tests::commands::a_number_out_of_range_is_named_with_its_range`).

use crate::{CLOCKS_PER_MICRO, Limits, Micros};
use nirspi_wire::ready::{MAX_NARROW_SAMPLES, MAX_SUMMED_SAMPLES};
use nirspi_wire::register::{DUTY_WINDOW, LATENCY_MAX, mode};
use nirspi_wire::samples::{Width, Words};
use nirspi_wire::{
    ConfigField, ConfigProblem, Configuration, PATTERNS, PatternOrder, SampleSource,
};

/// Frames that come slower than this leave by the host port also where there is a parallel port: the slowest packet
/// takes 206 us by the host port (`docs/log/firmware.md`, Throughput), and only there can the signal meter ask for the
/// level of the very frame that it looks at.
const FAST_FRAME: Micros = Micros(220);

/// A checked configuration, in the form of the FPGA's registers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Setup {
    pub mode: u32,
    pub patterns: u16,
    pub dwell: u16,
    pub blank: u16,
    pub latency: u8,
    pub sweeps: u32,
    pub over_range_trip: u32,
    /// Mean share of LEDs lit.
    pub duty_permille: u16,
}

impl Setup {
    /// ADC clocks of a sweep.
    pub fn sweep_clocks(&self) -> u64 {
        let halves = if self.mode & mode::DIFFERENTIAL == 0 { 1 } else { 2 };
        u64::from(self.patterns).saturating_mul(self.dwell.into()).saturating_mul(halves)
    }

    /// Bits of `Mode` for packets that leave by the parallel port, on a board that has the port's wires.
    pub fn port(&self) -> u32 {
        let is_fast = self.frame_clocks() < FAST_FRAME.0.saturating_mul(CLOCKS_PER_MICRO);
        if is_fast { mode::PARALLEL } else { 0 }
    }

    /// Bits of a sample of a packet.
    pub fn width(&self) -> Width {
        if self.mode & mode::NARROW == 0 { Width::Bits32 } else { Width::Bits24 }
    }

    /// ADC clocks of a frame.
    pub fn frame_clocks(&self) -> u64 {
        self.sweep_clocks().saturating_mul(u64::from(self.sweeps))
    }
}

/// Checks every field of `configuration`.
pub(crate) fn check(
    configuration: &Configuration<'_>,
    limits: &Limits,
) -> Result<Setup, ConfigProblem> {
    let &Configuration { patterns, clocks_per_pattern: dwell, blanked, sweeps, .. } = configuration;
    let latency = configuration.adc_latency;
    in_range(ConfigField::Patterns, patterns.into(), 1, PATTERNS.into())?;
    let (order, shows_all_lit) = match &configuration.order {
        // Both orders begin with pattern 0, which has no negative entry: every LED is lit.
        PatternOrder::Natural => (0, true),
        PatternOrder::Sequency => (mode::ORDER_SEQUENCY, true),
        PatternOrder::Table(table) => (mode::ORDER_TABLE, check_table(table, patterns)?),
    };
    in_range(ConfigField::ClocksPerPattern, dwell.into(), 1, u16::MAX.into())?;
    in_range(ConfigField::Blanked, blanked.into(), 0, u32::from(dwell.saturating_sub(1)))?;
    in_range(ConfigField::AdcLatency, latency.into(), 0, LATENCY_MAX.into())?;
    // The samples of a packet have 32 bits.
    let samples_a_sweep = u32::from(dwell.saturating_sub(blanked));
    let most = MAX_SUMMED_SAMPLES.checked_div(samples_a_sweep).unwrap_or(0);
    in_range(ConfigField::Sweeps, sweeps, 1, most)?;

    let mut mode = order | mode::PACKETS;
    if samples_a_sweep.saturating_mul(sweeps) <= MAX_NARROW_SAMPLES {
        mode |= mode::NARROW;
    }
    if configuration.differential {
        mode |= mode::DIFFERENTIAL;
        mode |= if configuration.alternating { mode::ALTERNATING } else { 0 };
    }
    if configuration.source == SampleSource::TestPattern {
        mode |= mode::TEST_SOURCE;
    }
    let mut setup = Setup {
        mode,
        patterns,
        dwell,
        blank: blanked,
        latency,
        sweeps,
        over_range_trip: configuration.over_range_trip,
        duty_permille: 0,
    };
    let light = Light { setup: &setup, shows_all_lit };
    let peak = light.peak_permille();
    in_range(ConfigField::DutyPermille, peak, 0, limits.duty_permille_max.into())?;
    setup.duty_permille = light.mean_permille();
    Ok(setup)
}

pub(crate) fn in_range(
    field: ConfigField,
    found: u32,
    min: u32,
    max: u32,
) -> Result<(), ConfigProblem> {
    if (min..=max).contains(&found) {
        Ok(())
    } else {
        Err(ConfigProblem::OutOfRange { field, found, min, max })
    }
}

/// Whether the table shows pattern 0.
fn check_table(table: &Words<'_>, patterns: u16) -> Result<bool, ConfigProblem> {
    let length = u32::try_from(table.len()).unwrap_or(u32::MAX);
    in_range(ConfigField::OrderLength, length, patterns.into(), patterns.into())?;
    let mut seen = [false; PATTERNS as usize];
    for (index, found) in (0..).zip(table.iter()) {
        match seen.get_mut(usize::from(found)) {
            Some(seen) if !*seen => *seen = true,
            _ => return Err(ConfigProblem::OrderEntry { index, found }),
        }
    }
    Ok(seen.first().is_some_and(|&all_lit| all_lit))
}

/// Light of a setup, in half-arrays lit for a clock, as the FPGA counts light: 2 in a slot of
/// pattern 0, 0 in a slot of its complement, 1 in any other slot.
struct Light<'s> {
    setup: &'s Setup,
    shows_all_lit: bool,
}

impl Light<'_> {
    fn differential(&self) -> bool {
        self.setup.mode & mode::DIFFERENTIAL != 0
    }

    fn alternating(&self) -> bool {
        self.setup.mode & mode::ALTERNATING != 0
    }

    /// Mean light over a whole sweep, in thousandths of the full array, rounded to nearest.
    fn mean_permille(&self) -> u16 {
        let patterns = u32::from(self.setup.patterns);
        // A pattern and its complement light each LED once.
        let extra = u32::from(self.shows_all_lit && !self.differential());
        let halves = patterns.saturating_add(extra);
        let permille =
            halves.saturating_mul(500).saturating_add(patterns / 2).checked_div(patterns);
        permille.and_then(|permille| u16::try_from(permille).ok()).unwrap_or(u16::MAX)
    }

    /// Light of the brightest window that a run can have, in thousandths of the full array, rounded
    /// up. A window may begin anywhere in a sweep and may hold a fraction of a sweep, so this value
    /// may be a thousandth above the mean, and far above the mean where a slot is long. Runs
    /// stopped and started in quick succession show the first patterns more often; the FPGA's own
    /// limit stops such runs.
    fn peak_permille(&self) -> u32 {
        let window = u64::from(DUTY_WINDOW);
        let sweep = self.setup.sweep_clocks();
        let slot = u64::from(self.setup.dwell);
        let sweeps = window.checked_div(sweep).unwrap_or(0);
        let rest = window.checked_rem(sweep).unwrap_or(0);
        let extra = match (self.shows_all_lit, self.differential(), self.alternating()) {
            (false, ..) => 0,
            (true, false, _) => sweeps.saturating_mul(slot).saturating_add(slot.min(rest)),
            // In whole sweeps the dark complement balances the pattern that lights all LEDs.
            (true, true, false) => slot.min(rest),
            // A sweep that shows the complement first ends its pair with all LEDs lit, and the next
            // one begins its pair so: between the two dark slots there are two lit ones.
            (true, true, true) => window.min(slot.saturating_mul(2)),
        };
        let light = window.saturating_add(extra);
        let permille = light.saturating_mul(1000).div_ceil(window.saturating_mul(2));
        u32::try_from(permille).unwrap_or(u32::MAX)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const PAIRS: Configuration<'static> = Configuration {
        order: PatternOrder::Natural,
        patterns: 1024,
        differential: true,
        alternating: true,
        clocks_per_pattern: 5,
        blanked: 2,
        adc_latency: 3,
        sweeps: 10,
        source: SampleSource::Detector,
        over_range_trip: 0,
    };

    fn permille(configuration: Configuration<'_>) -> Result<u16, ConfigProblem> {
        check(&configuration, &Limits::default()).map(|setup| setup.duty_permille)
    }

    #[test]
    fn a_differential_sweep_lights_each_led_for_half_of_it() {
        for patterns in [1, 2, 1024] {
            assert_eq!(permille(Configuration { patterns, ..PAIRS }), Ok(500));
        }
    }

    #[test]
    fn a_sweep_without_complements_costs_the_all_lit_pattern_on_top() {
        let single = Configuration { differential: false, ..PAIRS };
        assert_eq!(permille(single), Ok(500));
        assert_eq!(permille(Configuration { patterns: 5, ..single }), Ok(600));
        let mut room = [0; 4];
        let table = Words::pack([1u16, 2].into_iter(), &mut room).unwrap();
        let order = PatternOrder::Table(table);
        assert_eq!(permille(Configuration { order, patterns: 2, ..single }), Ok(500));
        let table = Words::pack([1u16, 0].into_iter(), &mut room).unwrap();
        let order = PatternOrder::Table(table);
        assert!(permille(Configuration { order, patterns: 2, ..single }).is_err());
    }

    #[test]
    fn a_mean_at_the_limit_is_over_it_in_the_window_that_begins_with_the_brightest_pattern() {
        // 4 patterns of 5 clocks light 625 per mille on average, and the FPGA's first window holds a
        // quarter of a slot more than that.
        let four = Configuration { differential: false, patterns: 4, ..PAIRS };
        let over = ConfigProblem::OutOfRange {
            field: ConfigField::DutyPermille,
            found: 626,
            min: 0,
            max: 625,
        };
        assert_eq!(permille(four), Err(over));
    }

    #[test]
    fn a_frame_lasts_as_long_as_its_slots() {
        let setup = check(&PAIRS, &Limits::default()).unwrap();
        assert_eq!(setup.frame_clocks(), 1024 * 2 * 5 * 10);
    }

    /// Half-arrays lit at a clock of a run, as the register map defines them.
    fn light(setup: &Setup, clock: u64) -> u64 {
        let slot = clock / u64::from(setup.dwell);
        let differential = setup.mode & mode::DIFFERENTIAL != 0;
        let slots = u64::from(setup.patterns) * if differential { 2 } else { 1 };
        let is_swapped = setup.mode & mode::ALTERNATING != 0 && slot / slots % 2 == 1;
        match (slot % slots, differential, is_swapped) {
            (0, _, false) | (1, true, true) => 2,
            (1, true, false) | (0, _, true) => 0,
            _ => 1,
        }
    }

    #[test]
    fn sweeps_that_alternate_show_all_leds_for_two_slots_in_a_row() {
        let long = Configuration { patterns: 1, clocks_per_pattern: 40_000, sweeps: 1, ..PAIRS };
        let tight = Limits { duty_permille_max: 535, ..Limits::default() };
        let over = ConfigProblem::OutOfRange {
            field: ConfigField::DutyPermille,
            found: 539,
            min: 0,
            max: 535,
        };
        assert_eq!(check(&long, &tight), Err(over));
        assert!(check(&Configuration { alternating: false, ..long }, &tight).is_ok());
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]
        #[test]
        fn no_window_is_brighter_than_the_peak(
            patterns in 1u16..9, dwell: u16, short in 0u16..15,
            pairs: [bool; 2], start in 0u64..1 << 22,
        ) {
            let setup = Setup {
                mode: match pairs {
                    [false, _] => 0,
                    [true, false] => mode::DIFFERENTIAL,
                    [true, true] => mode::DIFFERENTIAL | mode::ALTERNATING,
                },
                patterns, dwell: (dwell >> short).max(1), blank: 0, latency: 0, sweeps: 1,
                over_range_trip: 0, duty_permille: 0,
            };
            let peak = u64::from(Light { setup: &setup, shows_all_lit: true }.peak_permille());
            let window = u64::from(DUTY_WINDOW);
            let from = |start: u64| (start..start + window).map(|c| light(&setup, c)).sum::<u64>();
            prop_assert!(from(start) * 1000 <= peak * 2 * window);
            // The last slot of a pair whose complement comes first.
            let lit = setup.sweep_clocks() + u64::from(setup.dwell);
            prop_assert!(from(lit) * 1000 <= peak * 2 * window);
            if !pairs[0] {
                // The bound is tight: a run's first window is the brightest.
                prop_assert_eq!((from(0) * 1000).div_ceil(2 * window), peak);
            }
        }
    }
}

//! The source of samples: the ADC's pins or the test generator.
//!
//! Both sources give the same kind of sample, so every block behind this one treats them alike.

use nirspi_wire::{ADC_MAX, register};

/// The ADC's output in one clock.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct AdcSample {
    /// Code of 14 bits; higher bits are ignored.
    pub code: u16,
    /// The ADC's over-range pin.
    pub over_range: bool,
}

/// Selects the source of a run.
#[derive(Debug, Clone)]
pub(crate) enum Source {
    Adc,
    /// State of the shift register: the sample of the next clock.
    Test(u16),
}

impl Source {
    pub(crate) fn new(test: bool) -> Self {
        if test { Self::Test(register::TEST_SEED) } else { Self::Adc }
    }

    /// The sample of this clock.
    #[inline]
    pub(crate) fn sample(&mut self, adc: AdcSample) -> AdcSample {
        match self {
            Self::Adc => AdcSample { code: adc.code & ADC_MAX, ..adc },
            Self::Test(state) => {
                let code = *state;
                *state = register::test_sample(code);
                AdcSample { code, over_range: false }
            }
        }
    }
}

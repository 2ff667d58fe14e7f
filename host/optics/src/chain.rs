//! The receiver: LED edge, photodiode, amplifier and 14-bit ADC, one sample a clock.
//!
//! # Invariant
//! The output at clock n depends only on the light up to clock n - latency, the settings and the
//! seed (`the_delay_is_exact_at_every_latency` and
//! `the_same_seed_gives_the_same_samples_and_another_does_not` in `host/optics/tests/chain.rs`).
//! With [`ChainSettings::ideal`] the output is exactly that light, rounded
//! (`the_ideal_chain_rounds_the_light_of_the_same_clock`).
//!
//! # Stages
//!
//! The LEDs follow their lines with a first-order edge, or with a rise and a fall that differ
//! ([`crate::edges`]). Daylight is added. The amplifier's pole smooths both, and the charge that the
//! LED lines inject into it. Shot noise (variance = electrons collected in the sample) and amplifier
//! noise are added. The ADC divides by its gain, adds its baseline and its own noise, rounds and clips. The
//! ADC's pipeline delays the result. Light is constant within a clock, and a sample is the signal
//! at the clock's end, so the two poles are stepped exactly, without approximation.
//!
//! # Noise
//! Shot noise and amplifier noise are white before the amplifier's pole and pass its noise
//! bandwidth `pi/2 B`. A sample has a shot noise of variance `pi B t * electrons` (`2 q I` over
//! that bandwidth, in electrons of a sample of length t). Neighbouring samples are correlated by
//! `exp(-2 pi B t)`: 5 % at 60 MHz and 8 ns, 37 % at 20 MHz. The ADC's noise and its rounding are
//! independent from sample to sample. [`ChainSettings::variance_of_mean`] gives the resulting noise
//! of a window of samples.
//!
//! Simplification: one Gaussian represents shot noise and amplifier noise. With too few electrons
//! for a Gaussian, the amplifier noise is larger than the shot noise.

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use serde::Serialize;
use thiserror::Error;

use crate::edges::{LedEdges, Light, Pools, time_constant_ns};
use crate::instrument::{FULL_SCALE_COUNTS, MAX_ADC_LATENCY_CLOCKS};
use crate::poles::{decay, shared_decay};
use crate::{Budget, LEDS};

/// The steps of the switchable amplifier gain, in electrons per ADC count: two steps per octave.
pub const GAINS_ELECTRONS_PER_COUNT: [f64; 32] = gains();

/// Room of the gain and the baseline for noise, in standard deviations. Noise exceeds six standard
/// deviations once in a thousand million samples, so noise alone does not switch off the LEDs.
const HEADROOM_SIGMA: f64 = 6.0;

const fn gains() -> [f64; 32] {
    let mut steps = [0.0; 32];
    let (mut octave, mut i) = (0.125, 0);
    while i < steps.len() {
        steps[i] = octave;
        steps[i + 1] = octave * 1.5;
        octave *= 2.0;
        i += 2;
    }
    steps
}

/// Why a receiver with these settings is not possible.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum ChainError {
    /// A setting is outside its range.
    #[error("receiver: {name} is {value}, expected {expected}")]
    Setting {
        /// The setting.
        name: &'static str,
        /// The value found.
        value: f64,
        /// The allowed values.
        expected: &'static str,
    },
    /// No gain keeps light and noise within the ADC's range.
    #[error(
        "receiver: no gain fits {brightest_electrons:.0} electrons a sample with \
         {noise_electrons:.0} of noise; reduce the light"
    )]
    NoGain {
        /// The brightest possible light, in electrons per sample.
        brightest_electrons: f64,
        /// Noise of that light, in electrons rms.
        noise_electrons: f64,
    },
}

/// Settings that came later are part of a camera's serial number only where they are used, so that
/// kept calibrations stay those of their camera.
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// The receiver's settings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ChainSettings {
    /// ADC clock period, in ns: [`crate::instrument::SAMPLE_NS`].
    pub sample_ns: f64,
    /// How the LEDs follow their lines.
    #[serde(flatten)]
    pub led: LedEdges,
    /// Charge that a rising row or column line injects into the amplifier's input, in electrons; a
    /// falling line takes as much.
    #[serde(skip_serializing_if = "is_zero")]
    pub line_electrons: f64,
    /// Amplifier bandwidth at -3 dB, in Hz; infinite means no pole.
    pub amplifier_bandwidth_hz: f64,
    /// Daylight, in electrons per sample ([`Budget::ambient_electrons`]).
    pub ambient_electrons: f64,
    /// Dark current of the photodiode, in electrons per sample.
    pub dark_electrons: f64,
    /// Whether there is shot noise.
    pub shot_noise: bool,
    /// Noise of the amplifier, in electrons rms per sample ([`amplifier_noise_electrons`]).
    pub amplifier_noise_electrons: f64,
    /// Noise of the ADC beyond rounding, in counts rms ([`adc_noise_counts`]).
    pub adc_noise_counts: f64,
    /// Gain: electrons per ADC count ([`ChainSettings::auto_gain`]).
    pub electrons_per_count: f64,
    /// Reading of the ADC in the dark, which leaves room for noise below it.
    pub adc_offset_counts: u16,
    /// ADC pipeline: clocks from the end of a sample to its code, 0 to 63.
    pub adc_latency_clocks: u8,
}

/// Amplifier noise in electrons rms per sample, from its input current noise density. A single pole
/// passes `pi/2 * bandwidth`, so the noise is `i * sqrt(pi/2 * B) * t / e`.
#[must_use]
pub fn amplifier_noise_electrons(pa_per_sqrt_hz: f64, bandwidth_hz: f64, sample_ns: f64) -> f64 {
    const ELECTRON_C: f64 = 1.602_176_634e-19;
    let amperes = pa_per_sqrt_hz * 1e-12 * (std::f64::consts::FRAC_PI_2 * bandwidth_hz).sqrt();
    amperes * sample_ns * 1e-9 / ELECTRON_C
}

/// Noise of an ADC beyond rounding, in counts rms, from its signal-to-noise ratio for a full-scale
/// sine.
#[must_use]
pub fn adc_noise_counts(snr_db: f64) -> f64 {
    let full_scale_rms = (f64::from(FULL_SCALE_COUNTS) + 1.0) / 2.0 / 2.0_f64.sqrt();
    full_scale_rms / 10_f64.powf(snr_db / 20.0)
}

impl ChainSettings {
    /// A receiver without noise, settling, daylight or latency, with one electron a count: the
    /// exact chain for comparisons in integration tests.
    #[must_use]
    pub fn ideal() -> Self {
        Self {
            led: LedEdges::alike(0.0),
            line_electrons: 0.0,
            amplifier_bandwidth_hz: f64::INFINITY,
            ambient_electrons: 0.0,
            electrons_per_count: 1.0,
            adc_latency_clocks: 0,
            ..Self::default().noiseless()
        }
    }

    /// The same receiver without any noise or dark current. LEDs and amplifier keep their speed.
    #[must_use]
    pub fn noiseless(self) -> Self {
        Self {
            dark_electrons: 0.0,
            shot_noise: false,
            amplifier_noise_electrons: 0.0,
            adc_noise_counts: 0.0,
            ..self
        }
    }

    /// The most sensitive gain (fewest electrons per count of [`GAINS_ELECTRONS_PER_COUNT`]) that
    /// keeps both the brightest scene of `budget` and darkness within the ADC's range, with six
    /// standard deviations of noise.
    ///
    /// # Errors
    /// [`ChainError`] if a setting is out of range or no gain is coarse enough.
    pub fn auto_gain(&self, budget: &Budget) -> Result<f64, ChainError> {
        self.validate()?;
        let brightest_electrons = budget.brightest_electrons();
        let noise_electrons = self.noise_electrons(brightest_electrons);
        let offset = f64::from(self.adc_offset_counts);
        let above = f64::from(FULL_SCALE_COUNTS) - offset;
        let dark_electrons = HEADROOM_SIGMA * self.noise_electrons(0.0);
        let bright_electrons = brightest_electrons + HEADROOM_SIGMA * noise_electrons;
        GAINS_ELECTRONS_PER_COUNT
            .into_iter()
            .find(|gain| bright_electrons <= above * gain && dark_electrons <= offset * gain)
            .ok_or(ChainError::NoGain { brightest_electrons, noise_electrons })
    }

    /// Noise of one sample of `electrons` of light, before the ADC, in electrons rms.
    fn noise_electrons(&self, electrons: f64) -> f64 {
        (self.shot_variance(electrons) + self.amplifier_noise_electrons.powi(2)).sqrt()
    }

    /// Variance of the shot noise of one sample of `electrons` of light and the dark current, in
    /// electrons squared.
    #[must_use]
    pub fn shot_variance(&self, electrons: f64) -> f64 {
        if self.shot_noise {
            self.shot_bandwidth() * (electrons.max(0.0) + self.dark_electrons)
        } else {
            0.0
        }
    }

    /// Variance of the shot noise divided by the electrons of a sample: `pi B t` for a pole; 1
    /// without a pole, because a sample then counts the electrons that arrive in it.
    fn shot_bandwidth(&self) -> f64 {
        if self.amplifier_bandwidth_hz.is_finite() {
            std::f64::consts::PI * self.amplifier_bandwidth_hz * self.sample_ns * 1e-9
        } else {
            1.0
        }
    }

    /// Correlation of the pole's noise in neighbouring samples: `exp(-2 pi B t)`.
    #[must_use]
    pub fn noise_correlation(&self) -> f64 {
        decay(self.sample_ns, self.amplifier_tau_ns())
    }

    /// Variance of the mean of `window` neighbouring samples of `electrons` of light, in electrons
    /// squared: the pole's noise with its correlation, the ADC's noise and rounding without.
    #[must_use]
    pub fn variance_of_mean(&self, electrons: f64, window: u32) -> f64 {
        let samples = f64::from(window.max(1));
        let pole = self.shot_variance(electrons) + self.amplifier_noise_electrons.powi(2);
        let adc = self.adc_noise_counts.powi(2) + 1.0 / 12.0;
        (pole * self.correlated(window) + adc * self.electrons_per_count.powi(2)) / samples
    }

    /// Factor by which correlation raises the variance of a sum of `window` samples: `1 + 2 sum
    /// over k of (1 - k / window) rho^k`.
    #[must_use]
    pub fn correlated(&self, window: u32) -> f64 {
        let (samples, rho) = (f64::from(window.max(1)), self.noise_correlation());
        let (mut sum, mut power) = (1.0, 1.0);
        for lag in 1..window {
            power *= rho;
            if power < 1e-12 {
                break;
            }
            sum += 2.0 * (1.0 - f64::from(lag) / samples) * power;
        }
        sum
    }

    /// The pattern's own share of the light in its samples, if `blanked` of its `clocks` are
    /// excluded; 1 if LEDs and amplifier have settled. The mean of rising and falling light, which is
    /// what a differential pair keeps of its pattern.
    #[must_use]
    pub fn own_share(&self, clocks: u32, blanked: u32) -> f64 {
        let window = blanked.min(clocks.saturating_sub(1))..clocks.max(1);
        let samples = f64::from(window.end - window.start);
        window.map(|n| self.settling(n)).sum::<f64>() / samples
    }

    /// Part of a step of light that sample `n` after the step shows. Sample 0 is the clock in which
    /// the lines changed. The analytic response of the two poles, without the ADC's latency.
    ///
    /// If rise and fall differ, this is their mean: the part of the response that is linear in the
    /// patterns. [`Self::rising`] and [`Self::falling`] are the two steps.
    #[must_use]
    pub fn settling(&self, n: u32) -> f64 {
        if self.led.are_alike() {
            return self.rising(n);
        }
        (self.rising(n) + self.falling(n)) / 2.0
    }

    /// Part of a step from dark to lit that sample `n` after the step shows.
    #[must_use]
    pub fn rising(&self, n: u32) -> f64 {
        self.step(n, self.led.rise_ns, self.led.turn_on_delay_ns)
    }

    /// Part of a step from lit to dark that sample `n` after the step shows: 1 if no light is left.
    #[must_use]
    pub fn falling(&self, n: u32) -> f64 {
        self.step(n, self.led.fall_ns, self.led.turn_off_delay_ns)
    }

    fn step(&self, n: u32, edge_ns: f64, delay_ns: f64) -> f64 {
        let t = (f64::from(n) + 1.0) * self.sample_ns - delay_ns;
        let (led, amplifier) = (time_constant_ns(edge_ns), self.amplifier_tau_ns());
        1.0 - decay(t, amplifier) - shared_decay(t, led, amplifier)
    }

    /// What pixel (0, 0) of a white sheet is off by, in units of white, in the image of all patterns
    /// with their complements: 0 if rise and fall are alike.
    ///
    /// All LEDs change at a complement and half of them at the next pattern. So all differences of
    /// pattern and complement have a quarter of `rising rest - falling rest` of every LED in common,
    /// less what of it is left one pattern later, and so on. Such a constant is one pixel. The host
    /// knows the rise; its taps pass their sum of a constant, `1 - 2 rising rest`.
    #[must_use]
    pub fn first_pixel_off(&self, clocks: u32, blanked: u32) -> f64 {
        if self.led.are_alike() {
            return 0.0;
        }
        let window = blanked.min(clocks.saturating_sub(1))..clocks.max(1);
        let samples = f64::from(window.end - window.start);
        let mean = |slot: u32, rest: &dyn Fn(u32) -> f64| {
            window.clone().map(|n| rest(slot * clocks + n)).sum::<f64>() / samples
        };
        let (mut common, mut sign) = (0.0, 1.0);
        // LEDs settle within a slot (crate::camera), so later slots have nothing.
        for slot in 0..8 {
            common += sign * mean(slot, &|n| self.falling(n) - self.rising(n));
            sign = -sign;
        }
        let kept = 1.0 - 2.0 * mean(0, &|n| 1.0 - self.rising(n));
        f64::from(LEDS as u32) * common / 4.0 / kept
    }

    /// Whether the samples are linear in the patterns: rising and falling light are alike, and lines
    /// inject no charge.
    #[must_use]
    pub fn is_linear(&self) -> bool {
        self.led.are_alike() && self.line_electrons == 0.0
    }

    /// Checks the settings.
    ///
    /// # Errors
    /// [`ChainError::Setting`] naming the setting that is out of range.
    pub fn validate(&self) -> Result<(), ChainError> {
        let more = "more than 0";
        ensure(
            self.sample_ns.is_finite() && self.sample_ns > 0.0,
            "sample_ns",
            self.sample_ns,
            more,
        )?;
        let bandwidth = self.amplifier_bandwidth_hz;
        ensure(bandwidth > 0.0, "amplifier_bandwidth_hz", bandwidth, more)?;
        let gain = self.electrons_per_count;
        ensure(gain.is_finite() && gain > 0.0, "electrons_per_count", gain, more)?;
        let not_negative = [
            ("ambient_electrons", self.ambient_electrons),
            ("dark_electrons", self.dark_electrons),
            ("amplifier_noise_electrons", self.amplifier_noise_electrons),
            ("adc_noise_counts", self.adc_noise_counts),
        ];
        for (name, value) in not_negative {
            ensure(value.is_finite() && value >= 0.0, name, value, "0 or more")?;
        }
        let LedEdges { rise_ns, fall_ns, turn_on_delay_ns, turn_off_delay_ns } = self.led;
        for (name, value) in [("rise_ns", rise_ns), ("fall_ns", fall_ns)] {
            ensure(value.is_finite() && value >= 0.0, name, value, "0 or more")?;
        }
        for (name, value) in
            [("turn_on_delay_ns", turn_on_delay_ns), ("turn_off_delay_ns", turn_off_delay_ns)]
        {
            let within = (0.0..=self.sample_ns).contains(&value);
            ensure(within, name, value, "0 to one ADC clock")?;
        }
        let line = self.line_electrons;
        ensure(line.is_finite(), "line_electrons", line, "a finite number")?;
        let offset = self.adc_offset_counts;
        ensure(offset <= FULL_SCALE_COUNTS, "adc_offset_counts", offset.into(), "0 to 16383")?;
        let latency = self.adc_latency_clocks;
        ensure(latency <= MAX_ADC_LATENCY_CLOCKS, "adc_latency_clocks", latency.into(), "0 to 63")
    }

    fn amplifier_tau_ns(&self) -> f64 {
        1e9 / (std::f64::consts::TAU * self.amplifier_bandwidth_hz)
    }
}

fn ensure(
    holds: bool,
    name: &'static str,
    value: f64,
    expected: &'static str,
) -> Result<(), ChainError> {
    if holds { Ok(()) } else { Err(ChainError::Setting { name, value, expected }) }
}

/// Light that counts: a number of 0 or more.
#[inline]
fn electrons(light: f32) -> f64 {
    if light > 0.0 { f64::from(light.min(f32::MAX)) } else { 0.0 }
}

/// One word from the ADC.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AdcSample {
    /// The code, 0 to 16383.
    pub counts: u16,
    /// The input was above full scale.
    pub over_range: bool,
}

/// The receiver, stepped once per ADC clock.
// Aligned to lines of the cache: each sample reads what the sample before wrote, which takes half as long again where a
// value lies across two lines.
#[derive(Debug, Clone)]
#[repr(align(64))]
pub struct Chain {
    settings: ChainSettings,
    led_decay: f64,
    amplifier_decay: f64,
    /// Part of a difference in the LEDs that one clock moves into the amplifier.
    led_into_amplifier: f64,
    counts_per_electron: f64,
    offset_counts: f64,
    amplifier_variance: f64,
    shot_bandwidth: f64,
    noise_correlation: f64,
    /// Share of the pole's noise variance that is new in each sample.
    fresh: f64,
    adc_noise_electrons: f64,
    led_electrons: f64,
    amplified_electrons: f64,
    noise_electrons: f64,
    rng: Pcg64Mcg,
    pipeline: [AdcSample; MAX_ADC_LATENCY_CLOCKS as usize],
    pipeline_at: usize,
    /// The LEDs' light, where one pole of its sum does not describe it.
    pools: Pools,
    has_pools: bool,
    /// Charge that one rising line leaves in the amplifier's output at the end of the clock, in electrons per sample.
    line_amplified: f64,
}

impl Chain {
    /// A receiver that has settled in the dark (and daylight). The same settings, seed and light
    /// give the same samples.
    ///
    /// # Errors
    /// [`ChainError::Setting`] naming the setting that is out of range.
    pub fn new(settings: ChainSettings, seed: u64) -> Result<Self, ChainError> {
        settings.validate()?;
        let (t, led, amplifier) = (
            settings.sample_ns,
            time_constant_ns(settings.led.rise_ns),
            settings.amplifier_tau_ns(),
        );
        // Without a pole, charge has passed within the clock.
        let per_charge = if amplifier > 0.0 { t / amplifier * decay(t, amplifier) } else { 0.0 };
        let mut chain = Self {
            settings,
            led_decay: decay(t, led),
            amplifier_decay: decay(t, amplifier),
            led_into_amplifier: shared_decay(t, led, amplifier),
            counts_per_electron: settings.electrons_per_count.recip(),
            offset_counts: f64::from(settings.adc_offset_counts),
            amplifier_variance: settings.amplifier_noise_electrons.powi(2),
            shot_bandwidth: settings.shot_bandwidth(),
            noise_correlation: settings.noise_correlation(),
            fresh: 1.0 - settings.noise_correlation().powi(2),
            adc_noise_electrons: settings.adc_noise_counts * settings.electrons_per_count,
            led_electrons: 0.0,
            amplified_electrons: 0.0,
            noise_electrons: 0.0,
            rng: Pcg64Mcg::seed_from_u64(seed),
            pipeline: [AdcSample { counts: 0, over_range: false }; _],
            pipeline_at: 0,
            pools: Pools::of(&settings.led, t, amplifier),
            has_pools: !settings.is_linear() || settings.led.has_delay(),
            line_amplified: settings.line_electrons * per_charge,
        };
        let dark = chain.convert(settings.ambient_electrons + settings.dark_electrons);
        chain.pipeline.fill(dark);
        Ok(chain)
    }

    /// Settles in the dark (and daylight), as between two runs.
    pub fn rest(&mut self) {
        let ChainSettings { sample_ns, led, ambient_electrons, dark_electrons, .. } = self.settings;
        (self.led_electrons, self.amplified_electrons) = (0.0, 0.0);
        self.pools = Pools::of(&led, sample_ns, self.settings.amplifier_tau_ns());
        let dark = self.convert(ambient_electrons + dark_electrons);
        self.pipeline.fill(dark);
    }

    /// The settings it was made with.
    #[must_use]
    pub fn settings(&self) -> &ChainSettings {
        &self.settings
    }

    /// Whether the samples depend on more than the sum of the light, so that [`Self::sample`] wants the
    /// light of [`crate::LedArray::step`].
    #[must_use]
    pub fn sees_switching(&self) -> bool {
        self.has_pools
    }

    /// One ADC clock with the light of [`crate::LedArray::step`], or with the light per sample after
    /// the LEDs have settled ([`crate::LedArray::light`]). Light below 0, or NaN, counts as 0.
    #[inline]
    pub fn sample(&mut self, light: impl Into<Light>) -> AdcSample {
        let light = light.into();
        if self.has_pools {
            self.switch(light);
        } else {
            self.follow(electrons(light.settled));
        }
        self.digitise()
    }

    /// One ADC clock of a receiver that [sees switching](Self::sees_switching), with the light of the
    /// clock before unless a new one is given: as [`Self::sample`], and faster.
    // As `digitise`.
    #[inline(always)]
    pub fn sample_switching(&mut self, new: Option<Light>) -> AdcSample {
        match new {
            Some(light) => self.switch(light),
            None => {
                let settled = self.pools.settled();
                let off_by = self.amplified_electrons - settled;
                self.amplified_electrons =
                    settled + off_by * self.amplifier_decay + self.pools.hold();
            }
        }
        self.digitise()
    }

    /// One ADC clock with the settled light per sample ([`crate::LedArray::light`]), of a receiver that
    /// does not [see switching](Self::sees_switching): as [`Self::sample`], and faster.
    #[inline]
    pub fn sample_sum(&mut self, settled: f32) -> AdcSample {
        self.follow(electrons(settled));
        self.digitise()
    }

    /// LEDs and lines that switch one by one, and the amplifier.
    #[inline]
    fn switch(&mut self, light: Light) {
        let settled = electrons(light.settled);
        let off_by = self.amplified_electrons - settled;
        self.amplified_electrons = settled
            + off_by * self.amplifier_decay
            + self.pools.switch(settled, electrons(light.switched))
            // The charge has no shot noise. The noise that it gets here is over before a pattern's samples count.
            + f64::from(light.lines_risen) * self.line_amplified;
    }

    /// LEDs whose light is described by its sum, and the amplifier.
    #[inline]
    fn follow(&mut self, light: f64) {
        let led_off_by = self.led_electrons - light;
        let amplifier_off_by = self.amplified_electrons - light;
        self.amplified_electrons =
            light + amplifier_off_by * self.amplifier_decay + led_off_by * self.led_into_amplifier;
        self.led_electrons = light + led_off_by * self.led_decay;
    }

    /// Noise and ADC.
    // Called once a sample in each of two loops, where a call that is not inlined costs a fifth of the speed.
    #[inline(always)]
    fn digitise(&mut self) -> AdcSample {
        let steady = self.settings.ambient_electrons + self.settings.dark_electrons;
        let electrons = self.amplified_electrons + steady;
        let shot = if self.settings.shot_noise { electrons.max(0.0) } else { 0.0 };
        let variance = self.shot_bandwidth * shot + self.amplifier_variance;
        if variance > 0.0 {
            let normal: f64 = self.rng.sample(StandardNormal);
            self.noise_electrons *= self.noise_correlation;
            self.noise_electrons += (self.fresh * variance).sqrt() * normal;
        }
        let noise = self.noise_electrons + self.adc_noise();
        let converted = self.convert(electrons + noise);
        self.delay(converted)
    }

    /// The ADC's own noise, in electrons.
    #[inline]
    fn adc_noise(&mut self) -> f64 {
        if self.adc_noise_electrons == 0.0 {
            return 0.0;
        }
        let normal: f64 = self.rng.sample(StandardNormal);
        self.adc_noise_electrons * normal
    }

    #[inline]
    fn convert(&self, electrons: f64) -> AdcSample {
        let code = electrons * self.counts_per_electron + self.offset_counts + 0.5;
        let over_range = code >= f64::from(FULL_SCALE_COUNTS) + 1.0;
        // Rounds down: a number below 0 becomes 0 anyway.
        AdcSample { counts: (code as u16).min(FULL_SCALE_COUNTS), over_range }
    }

    #[inline]
    fn delay(&mut self, converted: AdcSample) -> AdcSample {
        let latency = usize::from(self.settings.adc_latency_clocks);
        if latency == 0 {
            return converted;
        }
        let out = std::mem::replace(&mut self.pipeline[self.pipeline_at], converted);
        self.pipeline_at += 1;
        if self.pipeline_at == latency {
            self.pipeline_at = 0;
        }
        out
    }
}

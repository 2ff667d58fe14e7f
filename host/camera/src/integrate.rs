//! Makes measurements of frames: sums the frames of a run, corrects the settling leak, and assigns
//! the rows.

mod changes;
mod phases;
mod spread;

use crate::response::Settling;
use crate::sag;
use crate::setup::MeasurementSetup;
pub(crate) use changes::Changes;
use nirspi_recon::{LeakError, MeasurementError, Measurements, Sweep};
use nirspi_wire::{Frame, FrameFlags};
pub(crate) use phases::Phases;
use phases::{CYCLE, Offsets};
use spread::Spread;
use std::collections::VecDeque;
use std::sync::Arc;

/// The sum of the frames of one run, in ADC counts.
#[derive(Debug, Clone)]
pub struct Integrated {
    sums: Vec<i64>,
    frames: u64,
    sweeps: u64,
    flags: FrameFlags,
    spread: Spread,
    /// Sweeps of the frames by the place of their first one in the cycle of sweeps that alternate.
    places: [u64; CYCLE as usize],
    known: KnownOfRun,
}

/// Number of frames that are kept alone, for a scene that moves: at 24 pictures a second and frames of 1.5 ms, those of one
/// picture.
pub const NEWEST: usize = 28;

/// What the frames of a run tell together, and one of them alone does not.
#[derive(Debug, Clone, Default)]
pub struct KnownOfRun {
    /// Standard deviation of the sum of one sweep.
    pub noise_of_a_sweep: Option<f64>,
    /// What does not cancel in frames of less than four sweeps.
    pub(crate) offsets: Option<Arc<Offsets>>,
    /// By how much the scene's readings changed, as a share of their variation from pattern to pattern; `None` where they
    /// did not.
    pub changed: Option<f64>,
    /// The newest frames of a scene that changed, each alone, with their numbers in the run.
    pub newest: Vec<(u64, Arc<Integrated>)>,
}

impl Integrated {
    /// An empty sum.
    #[must_use]
    pub fn new(setup: &MeasurementSetup) -> Self {
        Self::of_patterns(setup.rows.len())
    }

    /// One frame alone.
    #[must_use]
    pub fn of_frame(setup: &MeasurementSetup, frame: &Frame<'_>) -> Self {
        let mut alone = Self::new(setup);
        alone.add(frame);
        alone
    }

    pub(crate) fn of_patterns(patterns: usize) -> Self {
        Self {
            sums: vec![0; patterns],
            frames: 0,
            sweeps: 0,
            flags: FrameFlags::default(),
            spread: Spread::default(),
            places: [0; _],
            known: KnownOfRun::default(),
        }
    }

    /// A sum of the same patterns without frames.
    pub(crate) fn empty(&self) -> Self {
        Self::of_patterns(self.sums.len())
    }

    /// The same without frames, in the same memory.
    pub(crate) fn emptied(self) -> Self {
        let mut sums = self.sums;
        sums.fill(0);
        Self { sums, ..Self::of_patterns(0) }
    }

    /// Number of patterns of a sweep.
    #[must_use]
    pub fn patterns(&self) -> usize {
        self.sums.len()
    }

    /// Whether a frame has the setup's number of samples.
    #[must_use]
    pub fn fits(&self, frame: &Frame<'_>) -> bool {
        frame.samples.len() == self.sums.len()
    }

    /// Adds one frame that [fits](Self::fits).
    pub fn add(&mut self, frame: &Frame<'_>) {
        let sums: Vec<i64> = frame.samples.iter().collect();
        self.add_read(frame, &sums);
    }

    /// As [`add`](Self::add), where the frame's sums were read before.
    pub(crate) fn add_read(&mut self, frame: &Frame<'_>, sums: &[i64]) {
        self.spread.add(sums.iter().copied(), u64::from(frame.sweeps));
        self.add_read_alone(frame, sums);
    }

    /// Adds a frame that [fits](Self::fits) to a sum that is not asked what differs between its frames: it is one of a run of
    /// which more is [known](Self::of_run).
    pub fn add_alone(&mut self, frame: &Frame<'_>) {
        self.add_to_all(frame.samples.iter(), frame);
    }

    /// As [`add_alone`](Self::add_alone), where the frame's sums were read before.
    pub(crate) fn add_read_alone(&mut self, frame: &Frame<'_>, sums: &[i64]) {
        self.add_to_all(sums.iter().copied(), frame);
    }

    fn add_to_all(&mut self, sums: impl Iterator<Item = i64>, frame: &Frame<'_>) {
        self.accumulate(sums, u64::from(frame.sweeps));
        self.places[phases::place_of(frame.sequence, frame.sweeps)] += u64::from(frame.sweeps);
        self.flags = self.flags.with(frame.flags);
    }

    /// Adds a frame of which only the sums of this many sweeps are at hand, one sum for each
    /// [pattern](Self::patterns).
    pub fn add_sums(&mut self, sums: impl ExactSizeIterator<Item = i64> + Clone, sweeps: u64) {
        self.spread.add(sums.clone(), sweeps);
        self.accumulate(sums, sweeps);
    }

    fn accumulate(&mut self, sums: impl Iterator<Item = i64>, sweeps: u64) {
        for (total, sum) in self.sums.iter_mut().zip(sums) {
            *total = total.saturating_add(sum);
        }
        self.frames += 1;
        self.sweeps += sweeps;
    }

    /// Number of summed frames.
    #[must_use]
    pub fn frames(&self) -> u64 {
        self.frames
    }

    /// Warnings from the frames' flags and from what the run tells, one line each.
    #[must_use]
    pub fn warnings(&self) -> Vec<String> {
        let smeared = self.said_of_change().map(|changed| {
            format!(
                "{changed}; the picture of their sum is smeared, pictures of fewer frames are less so"
            )
        });
        self.warnings_of_flags().into_iter().chain(smeared).collect()
    }

    /// What frames' flags and the run tell of the measurement, whatever picture is made of it.
    #[must_use]
    pub fn what_happened(&self) -> Vec<String> {
        self.warnings_of_flags().into_iter().chain(self.said_of_change()).collect()
    }

    /// By how much the scene's readings changed while several frames were taken: their variance over the run as a share of
    /// their variation from pattern to pattern. `None` if they did not change, or of one frame.
    #[must_use]
    pub fn changed(&self) -> Option<f64> {
        self.known.changed.filter(|_| self.frames > 1)
    }

    /// What is said of a scene that [changed](Self::changed).
    #[must_use]
    pub fn said_of_change(&self) -> Option<String> {
        self.changed().map(|share| {
            format!(
                "the scene's readings changed by {:.0} % of their variation while they were taken: it moves, or its light \
                 drifts",
                share * 100.0
            )
        })
    }

    /// The newest frames of the run, each alone with its number, if the scene [changed](Self::changed); otherwise none.
    pub fn newest(&self) -> impl Iterator<Item = (u64, Self)> + '_ {
        let frames = self.known.newest.iter().filter(|_| self.frames > 1);
        frames.map(|(number, frame)| (*number, Self::clone(frame).of_run(&self.known)))
    }

    /// Warnings from the frames' flags, one line each.
    #[must_use]
    pub fn warnings_of_flags(&self) -> Vec<String> {
        let flags = [
            (
                FrameFlags::OVER_RANGE,
                "some samples were outside the ADC's range: too much light, or gain, or charge from the LED lines right after \
                 they change",
            ),
            (
                FrameFlags::OVERFLOW,
                "a sum has overflowed: fewer sweeps a frame, or shorter patterns",
            ),
            (
                FrameFlags::TEST_SOURCE,
                "the samples are those of the test generator, not of the detector",
            ),
        ]
        .into_iter()
        .filter(|(flag, _)| self.flags.contains(*flag))
        .map(|(_, warning)| warning.to_owned());
        flags.collect()
    }

    /// Mean ADC counts of one sample, for each pattern in the order shown; 0 without frames.
    #[must_use]
    pub fn means(&self, setup: &MeasurementSetup) -> Vec<f64> {
        let samples = self.sweeps as f64 * f64::from(setup.window());
        let scale = if samples > 0.0 { 1.0 / samples } else { 0.0 };
        let mut means: Vec<f64> = self.sums.iter().map(|&sum| sum as f64).collect();
        if let Some(offsets) = &self.known.offsets {
            offsets.correct(&mut means, self.places);
        }
        means.iter_mut().for_each(|mean| *mean *= scale);
        means
    }

    /// Standard deviation of the noise of each of the [means](Self::means), in ADC counts, from what
    /// differs between the frames; `None` for fewer than two frames.
    #[must_use]
    pub fn noise(&self, setup: &MeasurementSetup) -> Option<f64> {
        let of_a_sweep = self.noise_of_a_sweep()?;
        Some(of_a_sweep / (self.sweeps as f64).sqrt() / f64::from(setup.window()))
    }

    /// Standard deviation of the noise of the sum of one sweep, from what differs between the frames;
    /// `None` for fewer than two frames.
    #[must_use]
    pub fn noise_of_a_sweep(&self) -> Option<f64> {
        self.known.noise_of_a_sweep.or_else(|| self.spread.of_a_sweep())
    }

    /// The same sum, with what all frames of its run tell.
    #[must_use]
    pub fn of_run(self, known: &KnownOfRun) -> Self {
        Self { known: known.clone(), ..self }
    }

    /// Measurements in ADC counts, with their [noise](Self::noise). With the camera's response, the dark level is subtracted from
    /// single readings, the leak between slots is corrected unless `keep_leak`, and so is the sag of the
    /// LEDs' supplies. Without the response the dark level is estimated.
    ///
    /// # Errors
    /// [`IntegrateError`] if the sums do not fit the setup, or the response cannot be corrected.
    pub fn measurements(
        &self,
        setup: &MeasurementSetup,
        settling: Option<&Settling>,
        keep_leak: bool,
    ) -> Result<Measurements, IntegrateError> {
        let mut values = self.means(setup);
        let leak = settling
            .filter(|_| !keep_leak)
            .map(|settling| settling.leak(setup.clocks_per_pattern, setup.blanked))
            .transpose()?;
        let noise = self.noise(setup);
        let sag = settling.map_or(0.0, |settling| settling.tile_sag);
        if setup.differential {
            if let Some(leak) = &leak {
                let sweep = if setup.alternating { Sweep::Alternating } else { Sweep::Repeating };
                leak.correct_differential(&mut values, sweep);
            }
            sag::correct(sag, &setup.rows, &mut values);
            let measurements = Measurements::from_differential(&setup.rows, &values)?;
            return with_noise(measurements, noise);
        }
        let dark = settling.map(|settling| settling.dark_counts);
        values.iter_mut().for_each(|value| *value -= dark.unwrap_or(0.0));
        if let Some(leak) = &leak {
            leak.correct_single(&mut values);
        }
        sag::correct(sag, &setup.rows, &mut values);
        let mut measurements = Measurements::from_single(&setup.rows, &values)?;
        if dark.is_none() {
            measurements.remove_dark_level();
        }
        // A measurement of single readings is twice a reading less the all-on one, whose noise is the
        // same in all.
        with_noise(measurements, noise.map(|noise| 2.0 * noise))
    }
}

fn with_noise(
    measurements: Measurements,
    noise: Option<f64>,
) -> Result<Measurements, IntegrateError> {
    match noise {
        None => Ok(measurements),
        Some(noise) => Ok(measurements.with_noise(noise)?),
    }
}

/// The newest frames of a run, for a live view. Each new frame is added to their total and the oldest is subtracted. A copy
/// shares the frames.
#[derive(Debug, Clone)]
pub struct Newest {
    /// Each frame alone, with its number in the run.
    frames: VecDeque<(u64, Arc<Integrated>)>,
    total: Integrated,
    /// The frame before the oldest: one frame alone does not tell its noise.
    before: Option<Arc<Integrated>>,
    /// Frames of sweeps that alternate are kept in whole cycles.
    alternating: bool,
}

impl Newest {
    /// A sum without frames.
    #[must_use]
    pub fn new(setup: &MeasurementSetup) -> Self {
        let alternating = setup.alternates();
        Self { frames: VecDeque::new(), total: Integrated::new(setup), before: None, alternating }
    }

    /// Adds a frame that [fits](Integrated::fits), and keeps only the newest `most` frames, at
    /// least one. From four on, a number that is no multiple of four is rounded down where the faults of LEDs and
    /// lines cancel in four sweeps.
    pub fn push(&mut self, frame: &Frame<'_>, most: usize) {
        let cycle = CYCLE as usize;
        let most = if self.alternating && most > cycle { most - most % cycle } else { most };
        while self.frames.len() >= most.max(1) {
            let Some((_, oldest)) = self.frames.pop_front() else { break };
            for (total, sum) in self.total.sums.iter_mut().zip(&oldest.sums) {
                *total -= sum;
            }
            self.total.frames -= oldest.frames;
            self.total.sweeps -= oldest.sweeps;
            self.before = Some(oldest);
        }
        let mut alone = Integrated::of_patterns(self.total.sums.len());
        alone.accumulate(frame.samples.iter(), u64::from(frame.sweeps));
        alone.flags = frame.flags;
        self.total.accumulate(frame.samples.iter(), u64::from(frame.sweeps));
        self.frames.push_back((frame.sequence.into(), Arc::new(alone)));
    }

    /// A sum that was made elsewhere, in the place of one frame.
    #[must_use]
    pub fn of_sum(sum: Integrated) -> Self {
        let frames = VecDeque::from([(0, Arc::new(sum.clone()))]);
        Self { frames, total: sum, before: None, alternating: false }
    }

    /// Number of frames.
    #[must_use]
    pub fn frames(&self) -> u64 {
        self.total.frames
    }

    /// The sum of the frames. Its noise is known from two frames of the run on, also where it is a sum of one, and so is
    /// whether the scene [changed](Integrated::changed) in these frames.
    #[must_use]
    pub fn sum(&self) -> Integrated {
        let frames = || self.frames.iter().map(|(_, frame)| frame);
        // Flags cannot be subtracted, so they are collected anew.
        let flags = frames().fold(FrameFlags::default(), |all, frame| all.with(frame.flags));
        if self.before.is_none() && self.frames.len() <= 1 {
            return Integrated { flags, ..self.total.clone() };
        }
        let (mut spread, mut changes) = (Spread::default(), Changes::default());
        for frame in self.before.iter().chain(frames()) {
            spread.add(frame.sums.iter().copied(), frame.sweeps);
        }
        for frame in frames() {
            let sweeps = u32::try_from(frame.sweeps).unwrap_or(u32::MAX);
            changes.add(frame.sums.iter().copied(), sweeps);
        }
        let noise_of_a_sweep = spread.of_a_sweep();
        let changed = noise_of_a_sweep.and_then(|noise| changes.share(noise));
        let alone = self.frames.len().saturating_sub(NEWEST);
        let newest = changed.map(|_| self.frames.iter().skip(alone).cloned().collect());
        let newest = newest.unwrap_or_default();
        let known = KnownOfRun { noise_of_a_sweep, offsets: None, changed, newest };
        Integrated { flags, spread, known, ..self.total.clone() }
    }
}

/// Why a sum of frames gives no measurements.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum IntegrateError {
    /// The setup and the sums give no measurements.
    #[error(transparent)]
    Measurements(#[from] MeasurementError),
    /// The leak cannot be corrected with the camera's response.
    #[error(transparent)]
    Leak(#[from] LeakError),
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_recon::Order;
    use nirspi_wire::samples::{Samples, Width};
    use proptest::prelude::*;

    /// Calls `take` with a frame of these samples.
    fn with_frame<T>(values: &[i64], flags: FrameFlags, take: impl FnOnce(&Frame<'_>) -> T) -> T {
        let mut bytes = vec![0; 4 * values.len()];
        let samples = Samples::pack(values.iter().copied(), Width::Bits32, &mut bytes).unwrap();
        take(&Frame { run: 1, sequence: 0, device_time_us: 0, sweeps: 2, flags, samples })
    }

    #[test]
    fn the_noise_of_one_frame_is_that_of_its_run() {
        let setup = MeasurementSetup::new(&Order::Natural, 4.0 / 1024.0).unwrap();
        let (mut run, mut alone) = (Integrated::new(&setup), Integrated::new(&setup));
        let mut newest = Newest::new(&setup);
        for frame in [[100, 20, -7, 3], [104, 16, -3, -1], [100, 20, -7, 3]] {
            with_frame(&frame, FrameFlags::default(), |frame| {
                run.add(frame);
                newest.push(frame, 1);
            });
        }
        with_frame(&[100, 20, -7, 3], FrameFlags::default(), |frame| alone.add(frame));
        assert_eq!(alone.noise(&setup), None);
        let noise_of_a_sweep = run.noise_of_a_sweep();
        let alone = alone.of_run(&KnownOfRun { noise_of_a_sweep, ..KnownOfRun::default() });
        let (of_run, of_one) = (run.noise(&setup).unwrap(), alone.noise(&setup).unwrap());
        assert!((of_one / of_run - 3.0_f64.sqrt()).abs() < 1e-9, "{of_one} {of_run}");
        // A live view of one frame looks at the frame before.
        let shown = newest.sum().noise(&setup).unwrap();
        assert!((0.5..2.0).contains(&(shown / of_one)), "{shown} {of_one}");
    }

    #[test]
    fn the_newest_frames_of_a_scene_that_moves_are_kept_alone() {
        let setup = MeasurementSetup::new(&Order::Natural, 64.0 / 1024.0).unwrap();
        for moves in [false, true] {
            let mut newest = Newest::new(&setup);
            for k in 0..40_i64 {
                let reading = |pattern: i64| {
                    let noise = (k * 7919 + pattern * 104_729) % 13 - 6;
                    9_000 / (1 + pattern + if moves { k } else { 0 }) + noise
                };
                let values: Vec<i64> = (0..64).map(reading).collect();
                with_frame(&values, FrameFlags::default(), |frame| newest.push(frame, 32));
            }
            let sum = newest.sum();
            assert_eq!((newest.frames(), sum.frames()), (32, 32));
            assert_eq!(sum.changed().is_some(), moves, "{:?}", sum.changed());
            let alone: Vec<u64> = sum.newest().map(|(_, frame)| frame.frames()).collect();
            assert_eq!(alone, vec![1; if moves { NEWEST } else { 0 }]);
            assert!(sum.newest().all(|(_, frame)| frame.noise(&setup).is_some()));
        }
    }

    proptest! {
        #[test]
        fn the_newest_frames_sum_to_what_they_sum_to_alone(
            frames in prop::collection::vec((prop::collection::vec(-1000i64..1000, 4), any::<bool>(), 1usize..6), 1..40)
        ) {
            let setup = MeasurementSetup::new(&Order::Natural, 4.0 / 1024.0).unwrap();
            let flag = |set: bool| if set { FrameFlags::OVER_RANGE } else { FrameFlags::default() };
            let mut newest = Newest::new(&setup);
            for (at, (values, over, most)) in frames.iter().enumerate() {
                let before = newest.frames.len();
                with_frame(values, flag(*over), |frame| newest.push(frame, *most));
                let kept = (before + 1).min(if *most == 5 { 4 } else { *most });
                let mut expected = Integrated::new(&setup);
                for (values, over, _) in &frames[at + 1 - kept..=at] {
                    with_frame(values, flag(*over), |frame| expected.add(frame));
                }
                let sum = newest.sum();
                prop_assert_eq!(sum.frames(), kept as u64);
                prop_assert_eq!(sum.means(&setup), expected.means(&setup));
                // The noise is that of these frames and of the one before.
                let mut with_before = Integrated::new(&setup);
                for (values, over, _) in &frames[at.saturating_sub(kept)..=at] {
                    with_frame(values, flag(*over), |frame| with_before.add(frame));
                }
                prop_assert_eq!(sum.noise_of_a_sweep(), with_before.noise_of_a_sweep());
                prop_assert_eq!(sum.warnings(), expected.warnings());
            }
        }
    }
}

//! What the page gives up when this computer is too slow for the camera.
//!
//! The page gives up images first: it shows every 2nd, 4th, then every 8th image. It then gives up
//! enhancement. The camera's thread, which counts and records every frame, never gives up anything.
//!
//! Overload means that the camera's thread falls behind: that thread is busy nearly all the time,
//! or the recording's queue fills up. An image that takes long is no overload, because the camera's
//! thread does not wait for it.
//!
//! # Invariant
//! The decision depends on its arguments alone, the time among them. It goes one step at a time, and
//! back only after [`CALM`] (`tests::images_go_first_then_enhancement_and_they_come_back_in_reverse`,
//! `tests::a_load_around_the_limit_does_not_make_the_page_flicker`).

use nirspi::clock::Instant;
use serde::Serialize;
use std::time::Duration;

/// Share of its time that the camera's thread may be busy.
const BUSY: f64 = 0.85;
/// Share of the recording's queue that may be full.
const QUEUED: f64 = 0.25;
/// A load below this share of a limit is calm.
const LOW: f64 = 0.7;
/// An overload of this length makes the page give up one step more.
const OVERLOADED: Duration = Duration::from_millis(500);
/// A calm of this length gives one step back.
const CALM: Duration = Duration::from_secs(3);
/// The longest calm that is asked for, after steps back that came too early.
const LONGEST_CALM: Duration = Duration::from_secs(48);

/// The steps, from everything to the least.
const STEPS: [Shed; 5] = [
    Shed { show_every: 1, enhancement_off: false },
    Shed { show_every: 2, enhancement_off: false },
    Shed { show_every: 4, enhancement_off: false },
    Shed { show_every: 8, enhancement_off: false },
    Shed { show_every: 8, enhancement_off: true },
];

/// The load of the camera's thread.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Load {
    /// Share of the time in which the thread does not wait for the camera, 0 to 1.
    pub camera_thread: f64,
    /// Share of the recording's queue that waits for the disk, 0 to 1.
    pub recording_queue: f64,
}

impl Load {
    /// The load relative to its limits: above 1 is overload.
    fn relative(&self) -> f64 {
        (self.camera_thread / BUSY).max(self.recording_queue / QUEUED)
    }

    /// The larger part of the load in words.
    fn in_words(&self) -> String {
        let percent = |share: f64| (100.0 * share.clamp(0.0, 1.0)).round();
        if self.recording_queue / QUEUED > self.camera_thread / BUSY {
            let full = percent(self.recording_queue);
            return format!("{full} % of the recording's queue waits for the disk");
        }
        let busy = percent(self.camera_thread);
        format!("the thread that reads the camera is busy {busy} % of the time")
    }
}

/// What the page gives up.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Shed {
    /// One image of so many is made and shown.
    pub show_every: u32,
    /// Whether images are not enhanced.
    pub enhancement_off: bool,
}

/// What the page gives up, and why.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OverloadState {
    #[serde(flatten)]
    load: Load,
    #[serde(flatten)]
    shed: Shed,
    /// What is given up and why, in one line; `null` if nothing is given up.
    line: Option<String>,
}

/// Decides what the page gives up.
#[derive(Debug)]
pub struct Overload {
    step: usize,
    load: Load,
    /// Why the last step was taken.
    why: String,
    /// Since when the load is above its limit.
    overloaded: Option<Instant>,
    /// Since when the load is calm.
    calm: Option<Instant>,
    /// When the last step back was taken.
    back: Option<Instant>,
    /// The calm that is needed for a step back.
    needed: Duration,
}

impl Default for Overload {
    fn default() -> Self {
        Self {
            step: 0,
            load: Load::default(),
            why: String::new(),
            overloaded: None,
            calm: None,
            back: None,
            needed: CALM,
        }
    }
}

impl Overload {
    /// Takes the load of the last moment. Returns a line if the page gives up more or less from now
    /// on.
    pub fn at(&mut self, now: Instant, load: Load) -> Option<String> {
        self.load = load;
        let relative = load.relative();
        let held = |since: &mut Option<Instant>, is: bool| {
            *since = if is { since.or(Some(now)) } else { None };
            since.map(|since| now.saturating_duration_since(since))
        };
        let overloaded = held(&mut self.overloaded, relative > 1.0);
        let calm = held(&mut self.calm, relative < LOW);
        if overloaded.is_some_and(|held| held >= OVERLOADED) && self.step + 1 < STEPS.len() {
            // The step back came too early: the next one needs a longer calm.
            let early = |back: Instant| now.saturating_duration_since(back) < self.needed;
            if self.back.take().is_some_and(early) {
                self.needed = (2 * self.needed).min(LONGEST_CALM);
            }
            self.step += 1;
            self.overloaded = Some(now);
            self.why = load.in_words();
            return self.line();
        }
        if calm.is_some_and(|held| held >= self.needed) {
            self.calm = Some(now);
            if self.step == 0 {
                self.needed = CALM;
                return None;
            }
            self.step -= 1;
            self.back = Some(now);
            return self.line().or_else(|| Some("the page shows every image again".to_owned()));
        }
        None
    }

    /// What the page gives up now.
    pub fn shed(&self) -> Shed {
        STEPS[self.step]
    }

    /// The line for pages.
    fn line(&self) -> Option<String> {
        let Shed { show_every, enhancement_off } = self.shed();
        let nth = match show_every {
            1 => return None,
            2 => "2nd".to_owned(),
            n => format!("{n}th"),
        };
        let also = if enhancement_off { " and enhancement is off" } else { "" };
        let why = &self.why;
        Some(format!(
            "the page shows every {nth} image{also}, because {why}; every frame is still counted and recorded"
        ))
    }

    /// What pages and scripts get.
    pub fn state(&self) -> OverloadState {
        OverloadState { load: self.load, shed: self.shed(), line: self.line() }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// An overload that has given up this many steps.
    pub fn given_up(steps: usize) -> Overload {
        let (mut overload, start) = (Overload::default(), Instant::now());
        for second in 0..=steps as u32 {
            overload.at(start + Duration::from_secs(1) * second, FULL);
        }
        assert_eq!(overload.step, steps);
        overload
    }

    const TICK: Duration = Duration::from_millis(50);
    const FULL: Load = Load { camera_thread: 1.0, recording_queue: 0.0 };
    const IDLE: Load = Load { camera_thread: 0.1, recording_queue: 0.0 };

    /// The load over a time, in ticks. Returns what was given up after each change, and the time.
    fn over(
        overload: &mut Overload,
        start: Instant,
        ticks: u32,
        load: impl Fn(u32) -> Load,
    ) -> (Vec<(u32, bool)>, Instant) {
        let mut seen = Vec::new();
        for tick in 0..ticks {
            if overload.at(start + TICK * tick, load(tick)).is_some() {
                let Shed { show_every, enhancement_off } = overload.shed();
                seen.push((show_every, enhancement_off));
            }
        }
        (seen, start + TICK * ticks)
    }

    #[test]
    fn images_go_first_then_enhancement_and_they_come_back_in_reverse() {
        let mut overload = Overload::default();
        let (down, later) = over(&mut overload, Instant::now(), 200, |_| FULL);
        assert_eq!(down, [(2, false), (4, false), (8, false), (8, true)]);
        let line = overload.state().line.unwrap();
        assert!(line.contains("every 8th image and enhancement is off, because"), "{line}");
        assert!(line.contains("busy 100 %") && line.ends_with("counted and recorded"), "{line}");
        let (up, _) = over(&mut overload, later, 400, |_| IDLE);
        assert_eq!(up, [(8, false), (4, false), (2, false), (1, false)]);
        assert_eq!(overload.state().line, None);
    }

    #[test]
    fn a_moment_of_load_changes_nothing() {
        let mut overload = Overload::default();
        let moments = |tick: u32| if tick % 10 < 9 { FULL } else { IDLE };
        let (seen, _) = over(&mut overload, Instant::now(), 1000, moments);
        assert_eq!(seen, []);
    }

    #[test]
    fn a_queue_that_fills_up_counts_like_a_busy_thread() {
        let mut overload = Overload::default();
        let queue = Load { camera_thread: 0.2, recording_queue: 0.5 };
        let (seen, _) = over(&mut overload, Instant::now(), 12, |_| queue);
        assert_eq!(seen, [(2, false)]);
        let line = overload.state().line.unwrap();
        assert!(line.contains("50 % of the recording's queue waits for the disk"), "{line}");
    }

    #[test]
    fn a_load_around_the_limit_does_not_make_the_page_flicker() {
        let mut overload = Overload::default();
        let between = Load { camera_thread: 0.75, recording_queue: 0.0 };
        let (_, later) = over(&mut overload, Instant::now(), 15, |_| FULL);
        let (seen, later) = over(&mut overload, later, 2000, |_| between);
        assert_eq!(seen, []);
        // The load is too much with all images, and little with every second one.
        let (mut now, mut changes) = (later, 0);
        for _ in 0..20 * 120 {
            let load = if overload.shed().show_every == 1 { FULL } else { IDLE };
            changes += u32::from(overload.at(now, load).is_some());
            now += TICK;
        }
        // With a calm of 3 s each time, 120 s would see 68 changes.
        assert!((4..=12).contains(&changes), "{changes}");
    }
}

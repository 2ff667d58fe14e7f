//! The switch by which persons allow light, and what is known of the LEDs.
//!
//! # Invariant
//! Only a person switches to "on". Whatever switches to "off" (a person, a fault, a missing
//! calibration) holds until a person switches to "on" again. Of two commands the later one counts
//! (`tests::of_two_commands_the_later_one_counts`; in every order of the threads, `tests/loom`, which
//! checks this file).

use super::sync::{AtomicU64, Ordering};
use serde::Serialize;

/// What is known of the LEDs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Leds {
    /// The camera was told to switch the LEDs on, and has not yet confirmed that they are off.
    On,
    /// The camera has confirmed that the LEDs are off, or no light was asked for.
    Off,
    /// The link to the camera is gone. The camera switches its LEDs off by itself.
    Unknown,
    /// There are none that this program could switch: readings come from a feed.
    #[cfg(not(target_family = "wasm"))]
    None,
}

/// Whether light is allowed. The lowest bit is the position, the other bits count the commands, so
/// that one atomic number holds both.
#[derive(Debug)]
pub struct LightSwitch(AtomicU64);

impl LightSwitch {
    /// A switch in the position "on": a person who starts the program can see the camera.
    pub fn on() -> Self {
        Self(AtomicU64::new(1))
    }

    /// Switches. Returns the number of this command; later commands have larger numbers.
    pub fn set(&self, on: bool) -> u64 {
        let next = |held: u64| (held | 1).wrapping_add(1) | u64::from(on);
        let before =
            self.0.fetch_update(Ordering::SeqCst, Ordering::SeqCst, |held| Some(next(held)));
        next(before.unwrap_or_else(|held| held)) >> 1
    }

    /// Whether light is allowed.
    pub fn is_on(&self) -> bool {
        self.position().0
    }

    /// Whether light is allowed, and the number of the command that said so. One load gives both, so
    /// that no other command comes between them.
    pub fn position(&self) -> (bool, u64) {
        let held = self.0.load(Ordering::SeqCst);
        (held & 1 == 1, held >> 1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Barrier;

    #[test]
    fn of_two_commands_the_later_one_counts() {
        let switch = LightSwitch::on();
        assert_eq!(switch.position(), (true, 0));
        assert_eq!((switch.set(false), switch.is_on()), (1, false));
        assert_eq!((switch.set(false), switch.is_on()), (2, false));
        assert_eq!((switch.set(true), switch.position()), (3, (true, 3)));
        // Of commands at the same time, the one with the largest number is the position.
        for _ in 0..200 {
            let (switch, barrier) = (LightSwitch::on(), Barrier::new(2));
            let (on, off) = std::thread::scope(|scope| {
                let set = |on| {
                    let (switch, barrier) = (&switch, &barrier);
                    scope.spawn(move || {
                        barrier.wait();
                        switch.set(on)
                    })
                };
                let (on, off) = (set(true), set(false));
                (on.join().unwrap(), off.join().unwrap())
            });
            assert_eq!((on.max(off), on.min(off)), (2, 1));
            assert_eq!(switch.is_on(), on > off);
        }
    }
}

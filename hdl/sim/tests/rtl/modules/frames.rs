//! Tests of the delivery of frames against the register map.

use super::bundles::{HEADER, Settings};
use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;
use nirspi_wire::{FrameFlags, register::WAITING_FRAMES};
use std::collections::VecDeque;

laws![
    a_frame_is_delivered_or_lost_and_never_mixed_with_another,
    two_frames_wait_and_come_in_order_while_a_third_is_summed,
    a_restart_forgets_everything_of_earlier_runs,
];

/// What the host can observe.
#[derive(Debug, Clone, Default)]
struct Host {
    /// Number of the bank being filled.
    filling: u32,
    made: u64,
    lost: u64,
    /// Frames that wait for the host, the delivered one first: bank, and the header at completion (flags, number,
    /// over-range samples, lost frames, clock of its first slot, sum of its samples).
    waiting: VecDeque<(u32, [u64; 6])>,
    /// Clocks in which a frame was completed and another given back, by the number of frames that waited.
    both: [u32; WAITING_FRAMES + 1],
    /// A sum of the current frame has wrapped.
    overflow: bool,
    after_loss: bool,
    shown_at: u64,
}

impl Host {
    fn restart(&mut self) {
        *self = Self { filling: self.filling, shown_at: self.shown_at, ..Self::default() };
    }

    fn complete(&mut self, settings: &Settings, over_range: u64, total: u64) {
        let flags = [
            (over_range > 0, FrameFlags::OVER_RANGE),
            (self.overflow, FrameFlags::OVERFLOW),
            (self.after_loss, FrameFlags::AFTER_LOSS),
            (settings.test_source, FrameFlags::TEST_SOURCE),
            (settings.differential, FrameFlags::DIFFERENTIAL),
        ];
        let flags = flags.iter().map(|&(set, flag)| if set { u64::from(flag.0) } else { 0 }).sum();
        let header = [flags, self.made, over_range, self.lost, self.shown_at, total];
        self.made += 1;
        self.overflow = false;
        self.after_loss = self.waiting.len() == WAITING_FRAMES;
        if self.after_loss {
            self.lost += 1;
        } else {
            self.waiting.push_back((self.filling, header));
            self.filling = (self.filling + 1) % 3;
        }
    }
}

/// Simulates runs with frames of a few clocks. `restart_in` and `give_back_in` say how rare
/// restarts and releases are.
fn live(project: &Project, seed: u64, restart_in: u64, give_back_in: u64) -> Host {
    let mut bench = Bench::new(project, "frames");
    let dice = &mut Dice::new(seed);
    let mut host = Host::default();
    let mut settings = Settings::default();
    // Clock of the run; negative because a run begins some clocks after its restart.
    let mut run_clock = -3i64;
    for clock in 0..6000u64 {
        let restart = dice.once_in(restart_in);
        if restart {
            run_clock = -3;
            settings = Settings {
                differential: dice.once_in(2),
                test_source: dice.once_in(2),
                ..settings
            };
        }
        let counts = run_clock >= 0;
        let (first, done) = (run_clock == 0, counts && dice.once_in(9));
        let give_back = dice.once_in(give_back_in);
        let overflow = dice.once_in(12);
        let over_range = dice.range(0, 2);
        let [light_next, total] = [(); 2].map(|()| dice.next());

        bench.set_fields("settings", &settings.fields());
        bench.set("clock_now", clock);
        bench.set("light_next", light_next);
        bench.set("restart", restart);
        bench.set("give_back", give_back);
        bench.set("first", first);
        bench.set("done", done);
        bench.set("counts", counts);
        bench.set("overflow", overflow);
        bench.set("over_range", over_range);
        bench.set("over_any", over_range > 0);
        bench.set("total", total);
        bench.tick();

        if give_back && done && !restart {
            host.both[host.waiting.len()] += 1;
        }
        if give_back {
            host.waiting.pop_front();
        }
        if first {
            host.shown_at = clock;
        }
        host.overflow |= overflow && counts;
        if restart {
            host.restart();
        } else if done {
            host.complete(&settings, over_range, total);
            host.shown_at = light_next;
        }
        // The clock of a restart does not belong to the run before.
        run_clock += 1;

        let seen = ["filling", "made", "lost", "ready"].map(|port| bench.get(port));
        let ready = u64::from(!host.waiting.is_empty());
        let expected = [1 << host.filling, host.made, host.lost, ready];
        assert_eq!(seen, expected, "clock {clock}: {host:?}");
        if let Some(&(bank, header)) = host.waiting.front() {
            assert_eq!(bench.get("reading"), 1 << bank, "clock {clock}");
            assert_eq!(bench.get_fields("header", &HEADER), header, "clock {clock}");
        }
    }
    host
}

fn a_frame_is_delivered_or_lost_and_never_mixed_with_another(project: &Project) {
    let host = live(project, 19, u64::MAX, 20);
    assert!(host.made > 300 && host.lost > 50 && host.lost < host.made - 50, "{host:?}");
}

fn two_frames_wait_and_come_in_order_while_a_third_is_summed(project: &Project) {
    // Releases as rare as frames, so that none, one or two frames wait.
    let host = live(project, 21, u64::MAX, 9);
    assert!(host.both.iter().all(|&clocks| clocks > 5), "{host:?}");
    assert!(host.lost > 20 && host.lost < host.made / 2, "{host:?}");
}

fn a_restart_forgets_everything_of_earlier_runs(project: &Project) {
    live(project, 20, 60, 40);
}

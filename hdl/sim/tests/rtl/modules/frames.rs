//! Tests of the delivery of frames against the register map.

use super::bundles::{HEADER, Settings};
use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;
use nirspi_wire::FrameFlags;

laws![
    a_frame_is_delivered_or_lost_and_never_mixed_with_another,
    a_restart_forgets_everything_of_earlier_runs,
];

/// What the host can observe.
#[derive(Debug, Clone, Default)]
struct Host {
    /// Bank being filled.
    filling: u64,
    made: u64,
    lost: u64,
    /// The delivered frame at its completion: flags, number, over-range samples, lost frames, clock
    /// of its first slot, sum of its samples.
    delivered: Option<[u64; 6]>,
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
        self.after_loss = self.delivered.is_some();
        if self.delivered.is_some() {
            self.lost += 1;
        } else {
            self.delivered = Some(header);
            self.filling = 1 - self.filling;
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

        if give_back {
            host.delivered = None;
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
        let ready = u64::from(host.delivered.is_some());
        assert_eq!(seen, [host.filling, host.made, host.lost, ready], "clock {clock}: {host:?}");
        if let Some(header) = host.delivered {
            assert_eq!(bench.get_fields("header", &HEADER), header, "clock {clock}");
        }
    }
    host
}

fn a_frame_is_delivered_or_lost_and_never_mixed_with_another(project: &Project) {
    let host = live(project, 19, u64::MAX, 20);
    assert!(host.made > 300 && host.lost > 50 && host.lost < host.made - 50, "{host:?}");
}

fn a_restart_forgets_everything_of_earlier_runs(project: &Project) {
    live(project, 20, 60, 40);
}

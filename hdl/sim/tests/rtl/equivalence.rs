//! Runs random scenarios through RTL and golden model, and compares both.
//!
//! Each kind of event is counted. A kind of event that never happened fails the test.

use crate::parallel;
use crate::project::Project;
use crate::rig::{Rig, Tally, Variant};
use crate::scenario;
use nirspi_wire::register::{DUTY_WINDOW, Register, control, mode};
use std::ops::Range;

/// Number of scenarios that one simulated FPGA runs, one after the other.
const SCENARIOS: u64 = 64;

/// A set of scenarios: what to build, and what to do.
struct Suite {
    variant: Variant,
    scenario: fn(&mut Rig, u64),
    rigs: u64,
    scenarios: u64,
}

impl Suite {
    fn run(self, project: &Project, first_seed: u64) -> Result<Vec<Tally>, String> {
        let mut run = Run::new(self, project, first_seed);
        run.scenarios(u64::MAX)?;
        Ok(run.tallies)
    }
}

/// A suite under way. Its simulated FPGA waits between two scenarios, so that several suites can take turns.
struct Run<'a> {
    suite: Suite,
    project: &'a Project,
    seeds: Range<u64>,
    rig: Option<Rig>,
    /// What the FPGAs that have run all their scenarios have seen.
    tallies: Vec<Tally>,
}

impl<'a> Run<'a> {
    fn new(suite: Suite, project: &'a Project, first_seed: u64) -> Self {
        let seeds = first_seed..first_seed + suite.rigs * suite.scenarios;
        Self { suite, project, seeds, rig: None, tallies: Vec::new() }
    }

    /// Runs as many of the scenarios that are left, up to the first difference.
    fn scenarios(&mut self, at_most: u64) -> Result<(), String> {
        for _ in 0..at_most {
            let Some(seed) = self.seeds.next() else { break };
            let new = || Rig::of_variant(self.project, seed, self.suite.variant);
            let mut rig = self.rig.take().unwrap_or_else(new);
            (self.suite.scenario)(&mut rig, seed);
            if let Some(mismatch) = rig.mismatch {
                return Err(format!("scenario {seed}: {mismatch}"));
            }
            let left = self.seeds.end - self.seeds.start;
            if left.is_multiple_of(self.suite.scenarios) {
                self.tallies.push(rig.seen_so_far);
            } else {
                self.rig = Some(rig);
            }
        }
        Ok(())
    }
}

fn scenarios(rigs: u64) -> Suite {
    Suite { variant: Variant::default(), scenario: scenario::run, rigs, scenarios: SCENARIOS }
}

/// An RTL whose sums have 24 bits, so that they wrap within a thousandth of a second.
fn long_sums() -> Suite {
    let variant = Variant { sum_bits: 24, ..Variant::default() };
    Suite { variant, scenario: scenario::long_sums, rigs: 1, scenarios: 30 }
}

/// An RTL whose clock passes 2^32 soon after reset, while the model's clock passes a duty window.
fn windows() -> Suite {
    let window = u64::from(DUTY_WINDOW);
    let variant =
        Variant { begins_at: window - 4000, clock_ahead: (1 << 32) - window, ..Variant::default() };
    Suite { variant, scenario: scenario::across_a_window, rigs: 8, scenarios: 1 }
}

/// The ADC's clock is lost and comes back.
fn losses() -> Suite {
    Suite { variant: Variant::default(), scenario: scenario::clock_lost, rigs: 1, scenarios: 6 }
}

/// Frames that are sent as packets.
fn packets(rigs: u64) -> Suite {
    Suite { scenario: scenario::packets, ..scenarios(rigs) }
}

/// Readers that are slow by turns.
fn slow_readers(rigs: u64) -> Suite {
    Suite { scenario: scenario::slow_readers, ..scenarios(rigs) }
}

/// Packets that are read with `sck` as their clock.
fn by_sck(rigs: u64) -> Suite {
    Suite { scenario: scenario::packets_by_sck, ..scenarios(rigs) }
}

/// Packets whose samples have 24 bits.
fn narrow_packets(rigs: u64) -> Suite {
    Suite { scenario: scenario::narrow_packets, ..scenarios(rigs) }
}

/// Packets that leave by the parallel port.
fn by_parallel_port(rigs: u64) -> Suite {
    Suite { scenario: parallel::random, ..scenarios(rigs) }
}

/// Packets of long blocks.
fn long_blocks() -> Suite {
    Suite { scenario: scenario::long_blocks, scenarios: 16, ..scenarios(1) }
}

/// The first difference that a scenario shows. The suites take turns of more and more scenarios: most differences show in
/// the first scenario of one suite, while the other suites would run to their ends before it.
pub fn difference(project: &Project, file: &str) -> Option<String> {
    let mut suites = [
        scenarios(4),
        packets(4),
        narrow_packets(1),
        slow_readers(1),
        by_sck(1),
        by_parallel_port(1),
        long_sums(),
        long_blocks(),
        losses(),
        windows(),
    ];
    match file {
        "packet_port" | "packer" => suites.rotate_left(1),
        "parallel_port" => suites.rotate_left(5),
        // The third bank matters where frames wait.
        "frames" | "accumulators" => suites.rotate_left(3),
        "host_registers" | "clock_meter" => suites.rotate_left(8),
        _ => {}
    }
    let mut runs = suites.map(|suite| Run::new(suite, project, 0));
    let turns = [1, 3, 12, 48, u64::MAX];
    turns.iter().find_map(|&turn| runs.iter_mut().find_map(|run| run.scenarios(turn).err()))
}

fn count(tallies: &[Tally], of: impl Fn(&Tally) -> u64) -> u64 {
    tallies.iter().map(of).sum()
}

/// Simulated FPGAs of [`SCENARIOS`] each. `NIRSPI_RTL_SCENARIOS` sets the number of scenarios.
fn rigs() -> u64 {
    let asked = std::env::var("NIRSPI_RTL_SCENARIOS").ok().and_then(|n| n.parse().ok());
    asked.unwrap_or(4 * SCENARIOS).div_ceil(SCENARIOS)
}

#[test]
fn random_scenarios_agree_bit_for_bit() {
    let tallies = scenarios(rigs()).run(&Project::read(), 0);
    let tallies = tallies.unwrap_or_else(|difference| panic!("{difference}"));
    println!("{tallies:#?}");
    for (what, seen) in [
        ("lit clocks", count(&tallies, |t| t.lit_clocks)),
        ("clocks of runs without light", count(&tallies, |t| t.unlit_clocks)),
        ("frames", count(&tallies, |t| t.frames)),
        ("frames with over-range samples", count(&tallies, |t| t.frames_over_range)),
        ("frames after a loss", count(&tallies, |t| t.frames_after_loss)),
        ("raw bursts", count(&tallies, |t| t.bursts)),
        ("starts", count(&tallies, |t| t.starts)),
        ("starts refused", count(&tallies, |t| t.starts_refused)),
        ("runs stopped", count(&tallies, |t| t.stops)),
        ("watchdog trips", count(&tallies, |t| t.faults[1])),
        ("duty trips", count(&tallies, |t| t.faults[2])),
        ("over-range trips", count(&tallies, |t| t.faults[3])),
        ("interlock trips", count(&tallies, |t| t.faults[4])),
    ] {
        assert!(seen >= 5, "only {seen} {what}");
    }
}

/// Its name begins as that of `random_scenarios_agree_bit_for_bit`: `hdl/verilator/run.sh` repeats both.
#[test]
fn random_scenarios_of_packets_agree_bit_for_bit() {
    let tallies = packets(rigs()).run(&Project::read(), 0);
    let tallies = tallies.unwrap_or_else(|difference| panic!("{difference}"));
    println!("{tallies:#?}");
    for (what, seen) in [
        ("packets", count(&tallies, |t| t.packets)),
        ("packets after a loss", count(&tallies, |t| t.packets_after_loss)),
        ("frames in runs without packets", count(&tallies, |t| t.frames)),
        ("raw bursts", count(&tallies, |t| t.bursts)),
    ] {
        assert!(seen >= 5, "only {seen} {what}");
    }
}

/// Samples of 24 bits, by the port that samples its pins and by the one that `sck` clocks.
#[test]
fn random_scenarios_of_narrow_packets_agree_bit_for_bit() {
    let tallies = narrow_packets(rigs()).run(&Project::read(), 0);
    let tallies = tallies.unwrap_or_else(|difference| panic!("{difference}"));
    println!("{tallies:#?}");
    for (what, seen) in [
        ("packets of 24 bits", count(&tallies, |t| t.narrow)),
        ("packets of 32 bits", count(&tallies, |t| t.packets - t.narrow)),
        ("whole reads by `sck`", count(&tallies, |t| t.by_sck[0])),
        ("packets after a loss", count(&tallies, |t| t.packets_after_loss)),
    ] {
        assert!(seen >= 5, "only {seen} {what}");
    }
}

/// Three banks in use at a time, in every order in which frames can be made, read, read again, released and lost.
#[test]
fn random_scenarios_of_slow_readers_agree_bit_for_bit() {
    let tallies = slow_readers(rigs()).run(&Project::read(), 0);
    let tallies = tallies.unwrap_or_else(|difference| panic!("{difference}"));
    println!("{tallies:#?}");
    for (what, seen) in [
        ("frames", count(&tallies, |t| t.frames)),
        ("packets", count(&tallies, |t| t.packets)),
        ("releases with a frame behind", count(&tallies, |t| t.followed)),
        ("frames after a loss", count(&tallies, |t| t.frames_after_loss)),
        ("packets after a loss", count(&tallies, |t| t.packets_after_loss)),
    ] {
        assert!(seen >= 200, "only {seen} {what}");
    }
}

/// Reads that `sck` clocks, of 45 to 60 MHz, among reads of registers and frames by the port that samples its pins;
/// whole, cut short in the opcode and in the bytes, of frames that are there, gone, or come again.
#[test]
fn random_scenarios_of_packets_by_sck_agree_bit_for_bit() {
    let tallies = by_sck(rigs()).run(&Project::read(), 0);
    let tallies = tallies.unwrap_or_else(|difference| panic!("{difference}"));
    println!("{tallies:#?}");
    for (what, seen) in [
        ("whole reads by `sck`", count(&tallies, |t| t.by_sck[0])),
        ("reads by `sck` cut short", count(&tallies, |t| t.by_sck[1])),
        ("packets", count(&tallies, |t| t.packets)),
    ] {
        assert!(seen >= 40, "only {seen} {what}");
    }
}

/// Receivers of any pace at the parallel port; reads and releases of the host, which find no frame; starts that cut a
/// packet; a clock that is lost.
#[test]
fn random_scenarios_of_the_parallel_port_agree_bit_for_bit() {
    let tallies = by_parallel_port(rigs()).run(&Project::read(), 0);
    let tallies = tallies.unwrap_or_else(|difference| panic!("{difference}"));
    println!("{tallies:#?}");
    for (what, seen) in [
        ("packets by the parallel port", count(&tallies, |t| t.sent)),
        ("of them after a loss", count(&tallies, |t| t.sent_after_loss)),
        ("packets of 24 bits, by either port", count(&tallies, |t| t.narrow)),
        ("packets that a start has cut", count(&tallies, |t| t.cut)),
    ] {
        assert!(seen >= 40, "only {seen} {what}");
    }
}

#[test]
fn a_lost_adc_clock_ends_what_the_parallel_port_sends() {
    let suite = Suite { scenario: parallel::clock_lost, scenarios: 8, ..scenarios(1) };
    let tallies = suite.run(&Project::read(), 0).unwrap_or_else(|d| panic!("{d}"));
    let sent = count(&tallies, |t| t.sent);
    assert!(sent >= 40, "only {sent} packets");
}

#[test]
fn packets_of_long_blocks_have_no_gap() {
    let tallies = long_blocks().run(&Project::read(), 0).unwrap_or_else(|d| panic!("{d}"));
    let narrow = count(&tallies, |t| t.narrow);
    assert!(narrow >= 16 && count(&tallies, |t| t.packets) - narrow >= 16);
    println!("{tallies:#?}");
}

#[test]
fn sums_that_wrap_say_so_in_their_own_frame_only() {
    let tallies = long_sums().run(&Project::read(), 0).unwrap_or_else(|d| panic!("{d}"));
    let (frames, overflow) =
        (count(&tallies, |t| t.frames), count(&tallies, |t| t.frames_overflow));
    assert!(overflow >= 5 && frames - overflow >= 5, "{overflow} of {frames} frames overflowed");
}

#[test]
fn duty_windows_and_both_words_of_the_clock_agree() {
    let tallies = windows().run(&Project::read(), 0).unwrap_or_else(|d| panic!("{d}"));
    assert!(count(&tallies, |t| t.faults[2]) >= 5 && count(&tallies, |t| t.faults[0]) >= 5);
}

#[test]
fn a_lost_adc_clock_is_told_and_leaves_nothing_behind() {
    let tallies = losses().run(&Project::read(), 0).unwrap_or_else(|d| panic!("{d}"));
    assert!(count(&tallies, |t| t.starts) >= 40 && count(&tallies, |t| t.lit_clocks) > 1000);
}

/// The instrument's own measurement: 1024 patterns and complements of 5 clocks, once, read by four
/// lines.
#[test]
fn a_whole_differential_sweep_agrees() {
    let mut rig = Rig::new(&Project::read(), 1);
    rig.interlock(true);
    rig.wait_adc(100);
    rig.set(Register::Frames, 1);
    for (bits, packets) in [(0, 0), (mode::PACKETS, 1), (mode::PACKETS | mode::NARROW, 1)] {
        rig.set(
            Register::Mode,
            mode::DIFFERENTIAL | mode::ALTERNATING | mode::ORDER_SEQUENCY | bits,
        );
        rig.seen_so_far = Tally::default();
        let started = std::time::Instant::now();
        rig.set(Register::Control, control::START);
        rig.wait_adc(2 * 1024 * 5 + 100);
        rig.stream(false, usize::MAX);
        println!("simulated and read out in {:?}", started.elapsed());
        assert_eq!(rig.mismatch, None);
        let seen = rig.seen_so_far;
        let expected = (1 - packets, packets, 2 * 1024 * 5);
        assert_eq!((seen.frames, seen.packets, seen.lit_clocks), expected);
    }
}

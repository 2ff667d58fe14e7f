//! Tests of accesses and their effects.

use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;
use nirspi_wire::register::{ORDER_TABLE, Register, control};

/// `types::DEPTH`: clocks from the choice of a slot to its last effect.
const DEPTH: u64 = 13;
/// Clocks from a request to its effect.
const ACCESS: u64 = 2;
/// Clocks from a request to its answer: a little more than to the first clock of a run that the
/// request started.
const ANSWER: u64 = ACCESS + DEPTH + 6;

laws![
    an_access_takes_effect_once_and_is_answered_once,
    a_control_write_does_what_its_bits_say,
    a_run_goes_through_the_machine_in_fixed_time,
    whatever_ends_a_run_ends_it_with_that_clock,
];

/// The module, ready to accept a start.
fn bench(project: &Project) -> Bench {
    let mut bench = Bench::new(project, "control");
    bench.set("in_range", true);
    bench.set("interlock_now", true);
    bench
}

/// Requests a write; returns in the clock of its effect.
fn write(bench: &mut Bench, address: u16, data: u32) {
    bench.set("is_write", true);
    bench.set("address", address);
    bench.set("data", data);
    bench.set("request", true);
    bench.tick();
    bench.set("request", false);
    for _ in 1..ACCESS {
        bench.tick();
    }
}

/// Goes from the clock of an effect to one clock after the answer.
fn answer(bench: &mut Bench) {
    for _ in 0..=ANSWER - ACCESS {
        bench.tick();
    }
}

fn an_access_takes_effect_once_and_is_answered_once(project: &Project) {
    let mut bench = bench(project);
    let dice = &mut Dice::new(24);
    for _ in 0..50 {
        let is_write = dice.once_in(2);
        bench.set("is_write", is_write);
        bench.set("address", dice.range(0, 0x7FF));
        for clock in 0..ANSWER + 1 + dice.range(0, 9) {
            bench.set("request", clock == 0);
            assert_eq!(bench.is("access"), clock == ACCESS, "clock {clock}");
            assert_eq!(bench.is("write"), clock == ACCESS && is_write, "clock {clock}");
            assert_eq!(bench.is("answered"), clock == ANSWER, "clock {clock}");
            bench.tick();
        }
    }
}

/// The effects of a write, by the register map.
#[derive(Debug, PartialEq, Eq)]
struct Effects {
    stop: bool,
    clear: bool,
    give_back: bool,
    begins: bool,
    table_write: bool,
}

fn a_control_write_does_what_its_bits_say(project: &Project) {
    let mut bench = bench(project);
    let dice = &mut Dice::new(25);
    let (mut running, mut config_error, mut write_refused) = (false, false, false);
    let mut begun = 0;
    for _ in 0..1500 {
        // The run may have ended since.
        if dice.once_in(6) {
            let cause = dice.pick(&["trips", "ends"]);
            bench.set(cause, true);
            bench.tick();
            bench.set(cause, false);
            bench.tick();
            running = false;
        }
        let table = ORDER_TABLE + dice.range(0, 1023) as u16;
        let others = [table, ORDER_TABLE - 1, ORDER_TABLE + 1024, Register::Scratch.address()];
        let control = Register::Control.address();
        let address = if dice.once_in(3) { dice.pick(&others) } else { control };
        let data = dice.range(0, 31) as u32;
        let fault = if dice.once_in(4) { dice.range(1, 4) } else { 0 };
        let (interlock, in_range) = (!dice.once_in(8), !dice.once_in(8));
        bench.set("fault", fault);
        bench.set("interlock_now", interlock);
        bench.set("in_range", in_range);
        write(&mut bench, address, data);
        // The interlock may end the run in the clock of the access; the access then comes second.
        let opens = running && dice.once_in(8);
        bench.set("opens", opens);
        running &= !opens;

        let bit = |bit: u32| address == control && data & bit != 0;
        let starts = bit(control::START) || bit(control::START_RAW);
        let stays_running = running && !bit(control::STOP);
        let stays_faulty = (fault != 0 || opens) && !bit(control::CLEAR_FAULT);
        let wanted = starts && interlock && !stays_running && !stays_faulty;
        let in_table = (ORDER_TABLE..ORDER_TABLE + 1024).contains(&address);
        let expected = Effects {
            stop: bit(control::STOP),
            clear: bit(control::CLEAR_FAULT),
            give_back: bit(control::RELEASE),
            begins: wanted && in_range,
            table_write: in_table && !running && !opens,
        };
        let [stop, clear, give_back, begins, table_write] =
            ["stop", "clear", "give_back", "begins", "table_write"].map(|port| bench.is(port));
        let seen = Effects { stop, clear, give_back, begins, table_write };
        assert_eq!(seen, expected, "{address:#x} = {data:#x}");
        assert_eq!(bench.is("begins_raw"), data & control::START == 0);
        begun += u64::from(begins);

        config_error = if wanted { !in_range } else { config_error };
        write_refused = !begins && (write_refused || in_table && (running || opens));
        running = begins || stays_running;
        bench.tick();
        bench.set("opens", false);
        answer(&mut bench);
        assert_eq!(bench.is("config_error"), config_error);
        assert_eq!(bench.is("write_refused"), write_refused);
        assert_eq!(bench.is("running"), running);
    }
    assert!(begun > 200, "{begun}");
}

fn a_run_goes_through_the_machine_in_fixed_time(project: &Project) {
    let mut bench = bench(project);
    for run in 0..5 {
        write(&mut bench, Register::Control.address(), control::STOP | control::START);
        for clock in 0..60 {
            let at = |from: u64, port: &str, bench: &mut Bench| {
                assert_eq!(bench.is(port), clock == from, "{port}, clock {clock} of run {run}");
            };
            at(0, "begins", &mut bench);
            at(1, "go", &mut bench);
            at(7, "go_sample", &mut bench);
            at(8, "go_raw", &mut bench);
            at(DEPTH, "arrives", &mut bench);
            at(DEPTH + 1, "first", &mut bench);
            // A stopped run has ended when its own first clock would come.
            let running = clock > DEPTH || clock == 0 && run > 0;
            assert_eq!(bench.is("running"), running, "clock {clock} of run {run}");
            bench.tick();
        }
    }
}

fn whatever_ends_a_run_ends_it_with_that_clock(project: &Project) {
    let mut bench = bench(project);
    for cause in ["opens", "trips", "ends", "stop"] {
        write(&mut bench, Register::Control.address(), control::START);
        answer(&mut bench);
        assert!(bench.is("running"), "{cause}");
        if cause == "stop" {
            write(&mut bench, Register::Control.address(), control::STOP);
        } else {
            bench.set(cause, true);
        }
        assert!(bench.is("running") && !bench.is("halt"), "{cause}");
        bench.tick();
        if cause != "stop" {
            bench.set(cause, false);
        }
        assert!(!bench.is("running") && bench.is("halt"), "{cause}");
        bench.tick();
        assert!(!bench.is("running") && !bench.is("halt"), "{cause}");
        answer(&mut bench);
    }
}

//! Tests of the registers that need no ADC clock.

use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;
use nirspi_wire::register::{IDENTITY, NO_CLOCK, ORDER_TABLE, Register as R, clocks};

laws![
    every_read_has_an_answer_of_its_own_or_says_that_there_is_no_clock,
    the_engine_answers_for_every_other_register,
];

/// Sends an access; returns the answer that stands two clocks later.
fn send(bench: &mut Bench, address: u16) -> u32 {
    bench.set("address", address);
    bench.set("send", true);
    bench.tick();
    bench.set("send", false);
    assert!(bench.is("answered"), "{address:#x}");
    let answer = bench.get("answer") as u32;
    bench.tick();
    assert!(!bench.is("answered"));
    answer
}

fn every_read_has_an_answer_of_its_own_or_says_that_there_is_no_clock(project: &Project) {
    let mut bench = Bench::new(project, "host_registers");
    let dice = &mut Dice::new(71);
    for _ in 0..200 {
        let (design, sampling) = (dice.range(1, 2) as u32, dice.next() as u32);
        let [locked, alive, ready] = [(); 3].map(|()| dice.once_in(2));
        bench.set("design_id", design);
        bench.set("sampling", sampling);
        for (port, level) in [("locked", locked), ("alive", alive), ("ready", ready)] {
            bench.set(port, level);
        }
        for _ in 0..3 {
            bench.tick();
        }
        let flags = [(locked, clocks::LOCKED), (alive, clocks::ALIVE), (ready, clocks::READY)];
        let flags = flags.iter().map(|&(set, bit)| if set { bit } else { 0 }).sum::<u32>();
        assert_eq!(send(&mut bench, R::Identity.address()), IDENTITY);
        assert_eq!(send(&mut bench, R::Version.address()), R::Version.reset());
        assert_eq!(send(&mut bench, R::Design.address()), design);
        assert_eq!(send(&mut bench, R::Clocks.address()), flags);
        assert_eq!(send(&mut bench, R::Sampling.address()), sampling);
        for address in [R::Scratch.address(), R::Status.address(), ORDER_TABLE, 0x8000, 0x1001] {
            assert_eq!(send(&mut bench, address), NO_CLOCK, "{address:#x}");
        }
    }
}

fn the_engine_answers_for_every_other_register(project: &Project) {
    let mut bench = Bench::new(project, "host_registers");
    let dice = &mut Dice::new(72);
    bench.set("design_id", 1u8);
    for _ in 0..100 {
        let value = dice.next() as u32;
        for (address, own) in [
            (R::Scratch.address(), None),
            (ORDER_TABLE, None),
            (R::Identity.address(), Some(IDENTITY)),
            (R::Design.address(), Some(1)),
        ] {
            send(&mut bench, address);
            bench.set("value", value);
            bench.set("back", true);
            bench.tick();
            bench.set("back", false);
            bench.set("value", !value);
            assert_eq!(bench.is("answered"), own.is_none(), "{address:#x}");
            assert_eq!(bench.get("answer") as u32, own.unwrap_or(value), "{address:#x}");
            bench.tick();
            assert!(!bench.is("answered"));
        }
    }
}

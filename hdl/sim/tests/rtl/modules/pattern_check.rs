//! Tests of the look at the ADC's checkerboard.

use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;
use nirspi_wire::register::sampling::{CHECKERBOARD, SAMPLES};

laws![a_look_is_right_if_every_sample_is_of_the_checkerboard];

/// The other of the two samples.
const OTHER: u16 = CHECKERBOARD ^ 0x3FFF;

fn a_look_is_right_if_every_sample_is_of_the_checkerboard(project: &Project) {
    let mut bench = Bench::new(project, "pattern_check");
    let dice = &mut Dice::new(91);
    let mut sample = CHECKERBOARD;
    for look in 0..120u32 {
        // Which sample of the look is wrong: before it, within it, or none.
        let at = dice.range(0, u64::from(SAMPLES) - 1) as u32;
        let fault = look % 6;
        bench.set("look", false);
        for _ in 0..4 {
            sample ^= 0x3FFF;
            let before = if fault == 5 { dice.next() as u16 & 0x3FFF } else { sample };
            bench.set("code", before);
            bench.tick();
        }
        assert!(!bench.is("checked"), "it is checked before it is looked at");
        bench.set("look", true);
        // The synchroniser takes two clocks; the sample before the first one counts as its neighbour.
        for clock in 0..SAMPLES + 2 {
            assert!(!bench.is("checked"), "clock {clock}");
            sample ^= 0x3FFF;
            let wrong = clock == at + 2;
            let code = match fault {
                1 if wrong => sample ^ 1 << dice.range(0, 13),
                2 if wrong => sample ^ 0x3FFF,
                3 => dice.next() as u16 & 0x3FFF,
                4 => [0x3FFF, 0x0000][usize::from(sample == OTHER)],
                _ => sample,
            };
            bench.set("code", code);
            bench.tick();
        }
        assert!(bench.is("checked"));
        assert_eq!(bench.is("right"), matches!(fault, 0 | 5), "look {look}, fault {fault} at {at}");
        // What comes later changes nothing.
        for _ in 0..9 {
            bench.set("code", dice.next() & 0x3FFF);
            bench.tick();
            assert!(bench.is("checked"));
            assert_eq!(bench.is("right"), matches!(fault, 0 | 5));
        }
    }
}

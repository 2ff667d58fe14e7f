//! Tests of the register bank and of the settings made from it.

use super::bundles::{HEADER, SETTINGS, STAMP, Settings};
use crate::bench::Bench;
use crate::project::Project;
use crate::scenario::Dice;
use nirspi_wire::register::{
    Access, DUTY_LIMIT_MAX, ORDER_TABLE, RAW_SAMPLES_MAX, Register as R, WATCHDOG_MAX, mode,
};

laws![
    a_register_reads_what_was_written_to_it_and_to_no_other,
    a_run_has_the_settings_of_its_start_whatever_is_written_later,
    every_setting_has_its_range,
    what_changes_by_itself_is_as_of_its_read,
    a_delivered_frame_has_its_sum_and_its_over_range_samples,
    packets_leave_by_the_parallel_port_in_runs_that_ask_for_it,
];

fn write(bench: &mut Bench, address: u16, data: u32) {
    bench.set("address", address);
    bench.set("data", data);
    for clock in 0..8 {
        bench.set("write", clock == 3);
        bench.tick();
    }
}

fn read(bench: &mut Bench, address: u16) -> u32 {
    bench.set("address", address);
    for clock in 0..5 {
        bench.set("read", clock == 3);
        bench.tick();
    }
    bench.get("value") as u32
}

fn a_register_reads_what_was_written_to_it_and_to_no_other(project: &Project) {
    let mut bench = Bench::new(project, "registers");
    let dice = &mut Dice::new(28);
    // `host_registers` answers the others.
    let here = |register: &R| {
        !matches!(register, R::Identity | R::Version | R::Clocks | R::Design | R::Sampling)
    };
    let mut words: Vec<u32> = R::ALL.iter().map(|r| if here(r) { r.reset() } else { 0 }).collect();
    let writes = R::ALL.iter().position(|&register| register == R::Writes).unwrap();
    for round in 0..60 {
        for (register, &word) in R::ALL.iter().zip(&words) {
            assert_eq!(read(&mut bench, register.address()), word, "{register:?}, round {round}");
        }
        for nothing in [0x06, 0x07, 0x1E, 0x1F, 0x3FF, 0x800, 0x8000] {
            assert_eq!(read(&mut bench, nothing), 0, "{nothing:#x}");
        }
        for _ in 0..3 {
            let (at, word) = (dice.range(0, R::ALL.len() as u64 - 1) as usize, dice.next() as u32);
            let register = R::ALL[at];
            write(&mut bench, register.address(), word);
            // High bits of an address count too.
            write(&mut bench, register.address() | 0x1000, !word);
            words[writes] += 2;
            if register.access() == Access::ReadWrite {
                words[at] = word;
            }
        }
    }
}

/// Writes settings that are all in range.
fn write_all(bench: &mut Bench, dice: &mut Dice) -> Settings {
    let dwell = dice.pick(&[1, 2, 5, 300, 65_535]);
    let flag = |dice: &mut Dice| dice.once_in(2);
    let differential = flag(dice);
    // Without complements the bit changes nothing.
    let alternates = flag(dice);
    let settings = Settings {
        raw: false,
        order_table: flag(dice),
        order_sequency: flag(dice),
        differential,
        alternating: differential && alternates,
        test_source: flag(dice),
        unlit: flag(dice),
        packets: flag(dice),
        narrow: flag(dice),
        patterns: dice.pick(&[1, 2, 513, 1024]),
        dwell,
        blank: dice.pick(&[0, dwell / 2, dwell - 1]),
        latency: dice.range(0, 63),
        sweeps: dice.pick(&[1, 2, 70_000, u32::MAX.into()]),
        frames: dice.pick(&[0, 1, 2, u32::MAX.into()]),
        raw_length: dice.pick(&[1, 2, 4095, 4096]),
        watchdog: dice.pick(&[1, 2, WATCHDOG_MAX.into()]),
        duty_limit: dice.pick(&[0, 1, DUTY_LIMIT_MAX.into()]),
        over_range_trip: dice.pick(&[0, 1, u32::MAX.into()]),
    };
    let modes = [
        (settings.differential, mode::DIFFERENTIAL),
        (alternates, mode::ALTERNATING),
        (settings.order_sequency, mode::ORDER_SEQUENCY),
        (settings.order_table, mode::ORDER_TABLE),
        (settings.test_source, mode::TEST_SOURCE),
        (settings.unlit, mode::UNLIT),
        (settings.packets, mode::PACKETS),
        (settings.narrow, mode::NARROW),
    ];
    let bits = modes.iter().map(|&(set, bit)| if set { bit } else { 0 }).sum::<u32>();
    for (register, value) in [
        (R::Mode, bits.into()),
        (R::Patterns, settings.patterns),
        (R::Dwell, settings.dwell),
        (R::Blank, settings.blank),
        (R::Latency, settings.latency),
        (R::Sweeps, settings.sweeps),
        (R::Frames, settings.frames),
        (R::RawLength, settings.raw_length),
        (R::Watchdog, settings.watchdog),
        (R::DutyLimit, settings.duty_limit),
        (R::OverRangeTrip, settings.over_range_trip),
    ] {
        write(bench, register.address(), value as u32);
    }
    settings
}

/// Writes the run's number and its time, which packets carry. The read of the clock's low word is the clock that the
/// time belongs to; the read of the high word is not.
fn write_stamp(bench: &mut Bench, run: u64, clock: u64, time: u64) {
    write(bench, R::Run.address(), run as u32);
    write(bench, R::TimeLow.address(), time as u32);
    write(bench, R::TimeHigh.address(), (time >> 32) as u32);
    bench.set("clock_now", clock);
    read(bench, R::ClockLow.address());
    bench.set("clock_now", clock.rotate_left(7));
    read(bench, R::ClockHigh.address());
}

fn a_run_has_the_settings_of_its_start_whatever_is_written_later(project: &Project) {
    let mut bench = Bench::new(project, "registers");
    let dice = &mut Dice::new(29);
    for _ in 0..60 {
        let mut settings = write_all(&mut bench, dice);
        assert!(bench.is("in_range"), "{settings:?}");
        settings.raw = dice.once_in(3);
        let [run, clock, time] = [(); 3].map(|()| dice.next());
        write_stamp(&mut bench, run, clock, time);
        bench.set("copy_raw", settings.raw);
        bench.set("copy", true);
        bench.tick();
        bench.set("copy", false);
        let expected: Vec<u64> = settings.fields().iter().map(|&(value, _)| value).collect();
        assert_eq!(bench.get_fields("settings", &SETTINGS), expected, "{settings:?}");
        write_all(&mut bench, dice);
        write_stamp(&mut bench, !run, !clock, !time);
        assert_eq!(bench.get_fields("settings", &SETTINGS), expected, "after writes");
        let stamp = bench.get_fields("stamp", &STAMP);
        assert_eq!(stamp, [run & 0xFFFF, clock, time], "stamp after writes");
    }
}

fn every_setting_has_its_range(project: &Project) {
    let mut bench = Bench::new(project, "registers");
    let rest = u32::MAX;
    let raw = u32::from(RAW_SAMPLES_MAX);
    for (register, within, without) in [
        (R::Mode, vec![0, 0x3F, 0x1BF], vec![0x40, 1 << 9, 1 << 31, rest]),
        (R::Patterns, vec![1, 1024], vec![0, 1025, 2048, 1 << 16 | 1, rest]),
        // Values above the reset value of `Blank`.
        (R::Dwell, vec![3, 65_535], vec![0, 1, 2, 65_536, 1 << 16 | 5, rest]),
        // Values below the reset value of `Dwell`.
        (R::Blank, vec![0, 4], vec![5, 6, 1 << 16, rest]),
        (R::Latency, vec![0, 63], vec![64, 1 << 6 | 1, rest]),
        (R::Sweeps, vec![1, rest], vec![0]),
        (R::Frames, vec![0, 1, rest], vec![]),
        (R::RawLength, vec![1, raw], vec![0, raw + 1, rest]),
        (R::Watchdog, vec![1, WATCHDOG_MAX], vec![0, WATCHDOG_MAX + 1, rest]),
        (R::DutyLimit, vec![0, DUTY_LIMIT_MAX], vec![DUTY_LIMIT_MAX + 1, rest]),
        (R::OverRangeTrip, vec![0, rest], vec![]),
        (R::Run, vec![0, rest], vec![]),
        (R::TimeLow, vec![0, rest], vec![]),
        (R::TimeHigh, vec![0, rest], vec![]),
        (R::Scratch, vec![0, rest], vec![]),
    ] {
        for (values, good) in [(within, true), (without, false)] {
            for value in values {
                write(&mut bench, register.address(), value);
                assert_eq!(bench.is("in_range"), good, "{register:?} = {value:#x}");
            }
        }
        write(&mut bench, register.address(), register.reset());
        assert!(bench.is("in_range"));
    }
}

fn what_changes_by_itself_is_as_of_its_read(project: &Project) {
    let mut bench = Bench::new(project, "registers");
    let dice = &mut Dice::new(30);
    for _ in 0..100 {
        let [status, made, lost] = [(); 3].map(|()| dice.next() as u32);
        let (fault, clock, entry) = (dice.range(0, 4), dice.next(), dice.range(0, 1023));
        bench.set("status", status);
        bench.set("fault", fault);
        bench.set("frames_made", made);
        bench.set("frames_lost", lost);
        bench.set("clock_now", clock);
        bench.set("table_entry", entry);
        let in_table = ORDER_TABLE + dice.range(0, 1023) as u16;
        let live = [
            (R::Status.address(), status),
            (R::Fault.address(), fault as u32),
            (R::FramesMade.address(), made),
            (R::FramesLost.address(), lost),
            (R::ClockLow.address(), clock as u32),
        ];
        for (address, expected) in live {
            bench.set("clock_now", clock);
            assert_eq!(read(&mut bench, address), expected, "{address:#x}");
            for port in ["status", "fault", "frames_made", "frames_lost", "clock_now"] {
                bench.set(port, dice.next());
            }
            bench.tick();
            assert_eq!(bench.get("value") as u32, expected, "{address:#x} after a change");
            for (port, value) in [("status", status), ("frames_made", made), ("frames_lost", lost)]
            {
                bench.set(port, value);
            }
            bench.set("fault", fault);
        }
        assert_eq!(read(&mut bench, in_table), entry as u32);
        // The high word belongs to the last low word that was read.
        bench.set("clock_now", dice.next());
        assert_eq!(read(&mut bench, R::ClockHigh.address()), (clock >> 32) as u32);
    }
}

fn a_delivered_frame_has_its_sum_and_its_over_range_samples(project: &Project) {
    let mut bench = Bench::new(project, "registers");
    let dice = &mut Dice::new(45);
    for round in 0..60 {
        let values: Vec<u64> = HEADER.iter().map(|bits| dice.next() >> (64 - bits)).collect();
        let fields: Vec<_> = values.iter().copied().zip(HEADER).collect();
        let delivered = !dice.once_in(3);
        bench.set_fields("header", &fields);
        bench.set("delivered", delivered);
        let (over_range, total) = (values[2], values[5]);
        for (register, value) in [
            (R::SumLow, total & 0xFFFF_FFFF),
            (R::SumHigh, total >> 32),
            (R::OverRange, over_range),
        ] {
            let expected = if delivered { value as u32 } else { 0 };
            assert_eq!(read(&mut bench, register.address()), expected, "{register:?}, {round}");
            // As of the read: a release changes nothing in an answer that is on its way.
            bench.set("delivered", !delivered);
            bench.tick();
            assert_eq!(bench.get("value") as u32, expected, "{register:?} after a change");
            bench.set("delivered", delivered);
        }
    }
}

fn packets_leave_by_the_parallel_port_in_runs_that_ask_for_it(project: &Project) {
    let mut bench = Bench::new(project, "registers");
    let dice = &mut Dice::new(34);
    let mut on = false;
    for _ in 0..80 {
        let bits = dice.pick(&[0, mode::PACKETS, mode::PARALLEL, mode::PACKETS | mode::PARALLEL]);
        write(&mut bench, R::Mode.address(), bits);
        assert_eq!(bench.is("in_range"), bits != mode::PARALLEL, "{bits:#x}");
        assert_eq!(bench.is("parallel"), on, "a setting of the next run");
        let copy = bits != mode::PARALLEL && dice.once_in(2);
        bench.set("copy", copy);
        bench.tick();
        bench.set("copy", false);
        on = if copy { bits & mode::PARALLEL != 0 } else { on };
        assert_eq!(bench.is("parallel"), on, "{bits:#x}");
    }
}

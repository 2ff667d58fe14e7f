//! The column "USB, simulated" of the fault matrix in `docs/log/reliability.md`: each fault of the way from camera to host,
//! tried on the firmware's loop, this device and the chip's driver on the simulated core.
//!
//! Each cell is a run with the fault, and a run of ten frames after it. The host must have what the camera has made, less
//! what the injector has damaged; the LEDs must be off after the fault; the run after it must be whole.
//! `NIRSPI_BLESS=1` writes the column. The rows are those of `tests/tests/faults.rs`.

use super::otg_core::Speed;
use super::world::{Chip, Deaf, Host, Log, Way, World, tick};
use nirspi_app::bench;
use nirspi_wire::{Fault, RunLength, Status};
use std::collections::BTreeMap;
use std::format;
use std::path::Path;
use std::rc::Rc;
use std::string::String;
use std::vec::Vec;

const HEADING: &str = "\n## Each fault\n";
const TITLE: &str = "USB, simulated";

/// A quarter of all patterns, as in the other columns: a frame takes three packets of the bus.
const PATTERNS: u16 = 256;
const FRAMES: u32 = 40;
/// More than the link holds.
const FRAMES_OF_A_SLOW_READER: u32 = 400;
const AFTER: u32 = 10;
/// The frame that a single event hits.
const HIT: usize = 17;
/// One frame of so many is hit.
const ONE_OF: usize = 8;
/// Only frames have so many bytes.
const LONG: usize = 120;
/// Rounds of the world in which a frame is made and fetched.
const ROUNDS_A_FRAME: u32 = 60;
const HOUR_US: u64 = 3_600_000_000;
const CRASH: &str = "faults.rs: on purpose";

/// A row of the page, and what tries it. The words of the cell begin with `-` where the fault cannot happen.
type Row = (&'static str, fn(Chip) -> String);

const ROWS: [Row; 18] = [
    ("a byte is lost in one frame of eight", |chip| {
        on_the_bus(chip, Way::PacketLost, "the bus repeats the packet")
    }),
    ("a bit flips in one frame of eight", a_bit_flips),
    ("one frame of eight is lost", |chip| {
        on_the_bus(chip, Way::PacketLost, "the bus repeats the packet")
    }),
    ("one frame of eight comes twice", |chip| {
        on_the_bus(chip, Way::AcknowledgementLost, "the data toggle shows the copy")
    }),
    ("one frame of eight comes later, in order", delay),
    ("one frame of eight comes after its successor", |_| {
        "- (the bus keeps the order of packets)".into()
    }),
    ("the link ends inside a frame", |chip| unplugged(chip, 1, |host| host.begun > LONG)),
    ("the link ends between two frames", |chip| unplugged(chip, 1, |host| host.begun == 0)),
    ("the link ends three times in a row", |chip| unplugged(chip, 3, |_| true)),
    ("the host reads nothing until the run is over, and the camera does not wait", slow_reader),
    ("the camera's clock jumps an hour ahead in a run", clock_jump),
    ("the FPGA loses everything inside a frame", fpga_reset),
    ("the firmware crashes inside a frame", |chip| {
        restart(chip, |world| world.crashed(CRASH), &[CRASH]);
        "the link to the camera was lost; the next host is told of the crash".into()
    }),
    ("the supply fails inside a frame: FPGA and firmware start anew", |chip| {
        restart(chip, World::powered_up, &[]);
        "the link to the camera was lost".into()
    }),
    ("the host's program ends in a run", program_ends),
    ("the host stays connected and says nothing more", host_hangs),
    ("a second host connects in a run", |_| {
        "- (a bus has one host, whose system gives the camera to one program)".into()
    }),
    ("the disk is full", |_| "- (the bus has no part in that)".into()),
];

/// A camera, and a host that has greeted it.
struct Lab {
    world: World,
    log: Rc<Log>,
    host: Host,
}

impl Lab {
    fn new(chip: Chip) -> Self {
        let world = World::new(chip);
        let log: Rc<Log> = Rc::default();
        let host = world.host(&log);
        let mut lab = Self { world, log, host };
        lab.plug();
        lab
    }

    /// Plugs the camera into a host that has not seen it before.
    fn plug(&mut self) {
        self.world.plug(Speed::High);
        self.host = self.world.host(&self.log);
        self.host.patterns = PATTERNS;
        let host = &mut self.host;
        let greeted = self.world.beside(40_000, async {
            host.enumerate().await?;
            host.hello().await
        });
        assert_eq!(greeted, Some(Ok(())));
    }

    /// A run that the host reads in this way, once a round, until the host has had rounds for all frames or the closure
    /// returns false.
    fn run(&mut self, length: RunLength, mut read: impl FnMut(&mut Host, &Log) -> bool) {
        let (host, log) = (&mut self.host, &*self.log);
        log.frames.borrow_mut().clear();
        let frames = match length {
            RunLength::Frames(frames) => frames,
            RunLength::Continuous => FRAMES,
        };
        let rounds = (frames + 20) * ROUNDS_A_FRAME;
        let run = self.world.beside(rounds + 10_000, async {
            host.start_run(length).await?;
            for _ in 0..rounds {
                if !read(host, log) {
                    break;
                }
                tick().await;
            }
            Ok::<(), Deaf>(())
        });
        assert_eq!(run, Some(Ok(())));
    }

    /// What the camera says of its last run.
    fn status(&mut self) -> Status {
        let host = &mut self.host;
        let status = self.world.beside(40_000, host.status());
        status.expect("in time").expect("an answer")
    }

    /// That the FPGA lights no LED, and that the next run, of the host as it is now, is whole.
    fn recovers(mut self) {
        assert!(!self.world.pins.running.get(), "after the fault");
        self.log.damaged.set(None);
        let host = &mut self.host;
        assert_eq!(self.world.beside(40_000, host.hello()), Some(Ok(())));
        self.run(RunLength::Frames(AFTER), |host, _| {
            host.read();
            true
        });
        let status = self.status();
        assert_eq!(sequences(&self.log), (0..AFTER).collect::<Vec<_>>(), "{status:?}");
        assert_eq!((status.frames_made, status.fault), (AFTER, None));
        assert!(!self.world.pins.running.get(), "after the run");
        self.world.assert_no_violation();
    }
}

/// Numbers of the frames that the host has of its last run.
fn sequences(log: &Log) -> Vec<u32> {
    log.frames.borrow().iter().map(|(_, sequence)| *sequence).collect()
}

/// The host's account of a run whose frames the injector damaged as often as said; link and FPGA lost those that the
/// camera says.
fn account(log: &Log, status: &Status, damaged: u32) -> String {
    let seen = sequences(log);
    assert!(seen.is_sorted_by(|a, b| a < b), "in order, and none twice: {seen:?}");
    let received = seen.len() as u32;
    let lost = status.frames_dropped + status.fpga_frames_lost;
    assert_eq!(log.damaged.get().unwrap_or(0), damaged, "packets that came damaged");
    assert_eq!(received + lost + damaged, status.frames_made, "{seen:?}, {status:?}");
    assert_eq!(status.frames_sent, received + damaged, "{status:?}");
    format!("{received} received, {lost} lost, {damaged} corrupt, 0 late")
}

/// Whether the frame that the host gets next is one of those to hit, and was not hit before.
fn is_next_to_hit(log: &Log, hits: usize) -> bool {
    let next = log.frames.borrow().len() + log.damaged.get().unwrap_or(0) as usize;
    next / ONE_OF == hits && next % ONE_OF == 3
}

/// Packets that the bus carries again.
fn on_the_bus(chip: Chip, way: Way, told: &str) -> String {
    let mut lab = Lab::new(chip);
    let mut hits = 0;
    lab.run(RunLength::Frames(FRAMES), |host, log| {
        if is_next_to_hit(log, hits) {
            hits += usize::from(host.fetch(way));
        } else {
            host.read();
        }
        true
    });
    assert_eq!(hits, FRAMES as usize / ONE_OF);
    let status = lab.status();
    let account = account(&lab.log, &status, 0);
    assert_eq!(sequences(&lab.log).len(), FRAMES as usize, "{account}");
    lab.recovers();
    format!("{account}; whole: {told}")
}

/// On the bus, and in the core's memory, which no checksum of the bus protects.
fn a_bit_flips(chip: Chip) -> String {
    let bus = on_the_bus(chip, Way::PacketLost, "the bus repeats the packet");
    let mut lab = Lab::new(chip);
    lab.log.damaged.set(Some(0));
    let mut hits = 0;
    lab.run(RunLength::Frames(FRAMES), |host, log| {
        if is_next_to_hit(log, hits) {
            hits += usize::from(host.core.borrow_mut().damage(1, LONG));
        }
        host.read();
        true
    });
    assert_eq!(hits, FRAMES as usize / ONE_OF);
    let status = lab.status();
    let account = account(&lab.log, &status, hits as u32);
    lab.recovers();
    format!("on the bus: {bus}; in the core's memory: {account}")
}

fn delay(chip: Chip) -> String {
    let mut lab = Lab::new(chip);
    let (mut hits, mut held) = (0, 0);
    lab.run(RunLength::Frames(FRAMES), |host, log| {
        if held > 0 {
            held -= 1;
        } else if is_next_to_hit(log, hits) {
            hits += 1;
            held = ROUNDS_A_FRAME;
        } else {
            host.read();
        }
        true
    });
    assert_eq!(hits, FRAMES as usize / ONE_OF);
    let status = lab.status();
    let account = account(&lab.log, &status, 0);
    assert_eq!(sequences(&lab.log).len(), FRAMES as usize, "{account}");
    lab.recovers();
    format!("{account}; whole")
}

/// A cable that is pulled so often, each time at the first such moment after the frame.
fn unplugged(chip: Chip, times: u32, at: fn(&Host) -> bool) -> String {
    let mut lab = Lab::new(chip);
    for _ in 0..times {
        lab.run(RunLength::Frames(FRAMES), |host, log| {
            host.read();
            log.frames.borrow().len() < HIT || !at(host)
        });
        assert!(at(&lab.host), "the moment came");
        let seen = sequences(&lab.log);
        assert!(seen.len() >= HIT && seen.iter().copied().eq(0..seen.len() as u32), "{seen:?}");
        assert!(!lab.world.is_dark(), "in the run");
        lab.world.falls_silent();
        assert!(lab.world.is_dark(), "after the cable was pulled");
        lab.plug();
    }
    lab.recovers();
    "the link to the camera was lost; LEDs off once the bus is silent for 3 ms".into()
}

fn slow_reader(chip: Chip) -> String {
    let mut lab = Lab::new(chip);
    lab.run(RunLength::Frames(FRAMES_OF_A_SLOW_READER), |_, _| true);
    assert!(!lab.world.pins.running.get(), "the run is over");
    // The link is full, so the status is asked for by a host that reads again.
    let status = lab.status();
    let account = account(&lab.log, &status, 0);
    assert!(status.frames_dropped + status.fpga_frames_lost > 0, "{account}");
    lab.recovers();
    format!("{account}; all frames made, not all whole")
}

/// A run without end in which something happens once, at the frame and inside it; and the fault that follows, after which
/// the LEDs are off.
fn fault_after(chip: Chip, event: impl Fn(&World)) -> (Lab, Fault) {
    let mut lab = Lab::new(chip);
    lab.run(RunLength::Continuous, |host, log| {
        host.read();
        log.frames.borrow().len() < HIT || host.begun < LONG
    });
    assert!(!lab.world.is_dark(), "in the run");
    event(&lab.world);
    let Lab { world, log, host } = &mut lab;
    // A stalled FPGA shows after a quarter of a second.
    world.beside(30_000, async {
        while log.faults.borrow().is_empty() {
            host.read();
            tick().await;
        }
    });
    let faults = log.faults.borrow().clone();
    let [fault] = faults[..] else { panic!("{faults:?}") };
    let seen = sequences(&lab.log);
    assert!(seen.iter().copied().eq(0..seen.len() as u32), "{seen:?}");
    (lab, fault)
}

fn clock_jump(chip: Chip) -> String {
    let (lab, fault) = fault_after(chip, |_| bench::advance(HOUR_US));
    lab.recovers();
    format!("LEDs off: {fault}")
}

fn fpga_reset(chip: Chip) -> String {
    let (lab, fault) = fault_after(chip, |world| world.pins.reset_fpga());
    lab.recovers();
    format!("LEDs off: {fault}")
}

/// The chip starts anew inside a frame, in this way, and the next host is told of these crashes.
fn restart(chip: Chip, restarted: fn(World) -> World, crashes: &[&str]) {
    let mut lab = Lab::new(chip);
    lab.run(RunLength::Continuous, |host, log| {
        host.read();
        log.frames.borrow().len() < HIT || host.begun < LONG
    });
    let Lab { world, log, mut host } = lab;
    assert!(world.pins.running.get(), "in the run");
    let mut world = restarted(world);
    assert_eq!(world.beside(40_000, host.status()), Some(Err(Deaf)), "the device is gone");
    assert!(world.is_dark(), "the firmware has stopped the FPGA's run");
    let mut lab = Lab { world, log, host };
    lab.plug();
    lab.status();
    assert_eq!(*lab.log.crashes.borrow(), crashes);
    lab.recovers();
}

/// Time until the LEDs are off, in which the host does this once a round.
fn until_dark(lab: &mut Lab, mut round: impl FnMut(&mut Host)) -> u64 {
    let (world, host) = (&mut lab.world, &mut lab.host);
    let began = bench::now_us();
    while !world.is_dark() {
        assert!(bench::now_us() - began < 10_000_000, "LEDs shine after ten seconds");
        world.round();
        round(host);
    }
    bench::now_us() - began
}

fn program_ends(chip: Chip) -> String {
    let mut lab = Lab::new(chip);
    lab.run(RunLength::Continuous, |host, log| {
        host.read();
        log.frames.borrow().len() < HIT || host.begun < LONG
    });
    // The system keeps the configuration, and asks the device for nothing any more.
    let micros = until_dark(&mut lab, |_| {});
    assert!(micros.abs_diff(5_000_000) < 100_000, "{micros} us");
    lab.host.program_restarts();
    // The next program finds the rest of a packet in front of the answer.
    lab.log.damaged.set(Some(0));
    let host = &mut lab.host;
    assert_eq!(lab.world.beside(40_000, host.hello()), Some(Ok(())));
    assert!(lab.log.damaged.get() <= Some(1));
    lab.recovers();
    "the system keeps the device on the bus: LEDs off after 5 s of silence".into()
}

fn host_hangs(chip: Chip) -> String {
    let mut lab = Lab::new(chip);
    lab.run(RunLength::Continuous, |host, _| {
        host.read();
        true
    });
    until_dark(&mut lab, Host::read);
    // The event is on its way.
    (0..1_000).for_each(|_| {
        lab.world.round();
        lab.host.read();
    });
    assert_eq!(*lab.log.faults.borrow(), [Fault::HostSilent]);
    lab.recovers();
    format!("LEDs off: {}", Fault::HostSilent)
}

/// What a fault does to the camera, whichever way its packets take through the chip.
fn with_each_chip(tried: fn(Chip) -> String) -> String {
    let ways = [("copied", Chip::Copying), ("by DMA", Chip::Dma), ("out of the ring", Chip::Ring)];
    let mut cells: Vec<(String, String)> = Vec::new();
    for (way, chip) in ways {
        let cell = tried(chip);
        match cells.iter_mut().find(|(_, before)| *before == cell) {
            Some((ways, _)) => *ways = format!("{ways} and {way}"),
            None => cells.push((way.into(), cell)),
        }
    }
    if let [(_, cell)] = &cells[..] {
        return cell.clone();
    }
    cells.iter().map(|(ways, cell)| format!("{ways}: {cell}")).collect::<Vec<_>>().join("; ")
}

#[test]
fn every_fault_is_counted_and_survived() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/log/reliability.md");
    let page = std::fs::read_to_string(&path).unwrap();
    let (text, table) = page.split_once(HEADING).expect("the table");
    let mut cells: BTreeMap<&str, String> =
        ROWS.map(|(fault, tried)| (fault, with_each_chip(tried))).into();
    let mut column = None;
    let mut lines = Vec::new();
    for line in table.lines() {
        let Some(row) = line.strip_prefix("| ").and_then(|line| line.strip_suffix(" |")) else {
            lines.push(String::from(line));
            continue;
        };
        let mut row: Vec<String> = row.split(" | ").map(String::from).collect();
        match column {
            None => column = row.iter().position(|cell| cell == TITLE),
            Some(column) if row[0] != "--" => {
                row[column] =
                    cells.remove(&*row[0]).unwrap_or_else(|| panic!("not tried: {}", row[0]));
            }
            Some(_) => {}
        }
        lines.push(format!("| {} |", row.join(" | ")));
    }
    assert!(cells.is_empty(), "the page lacks {cells:?}");
    let expected = format!("{text}{HEADING}{}\n", lines.join("\n"));
    if std::env::var_os("NIRSPI_BLESS").is_some() {
        std::fs::write(&path, &expected).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap();
    assert!(
        found == expected,
        "the column {TITLE:?} of docs/log/reliability.md is stale: NIRSPI_BLESS=1\n{expected}"
    );
}

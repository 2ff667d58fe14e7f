//! Cables that are pulled, hosts that sleep: the chip's driver on the simulated core.

use super::otg_core::Speed;
use super::world::{CHIPS, Chip, Deaf, Host, Log, World, tick};
use nirspi_wire::Status;
use std::rc::Rc;
use std::vec::Vec;

const ALL: [Chip; 4] = [Chip::Released, Chip::Copying, Chip::Dma, Chip::Ring];

/// A host that goes from the first request to the stream, and reads for ever.
async fn use_camera(mut host: Host) -> Result<(), Deaf> {
    host.enumerate().await?;
    host.hello().await?;
    host.start().await?;
    host.stream().await
}

/// A camera whose frames are on their way, with a packet armed that the host did not fetch.
fn streaming(chip: Chip) -> (World, Rc<Log>) {
    let mut world = World::new(chip);
    let log: Rc<Log> = Rc::default();
    world.plug(Speed::High);
    let host = world.host(&log);
    assert_eq!(world.beside(4_000, use_camera(host)), None);
    assert!(log.frames.borrow().len() > 10 && world.pins.leds_enabled.get());
    // The host is gone and the camera goes on.
    world.pass(1_000);
    assert!(world.core.borrow().is_armed(1));
    (world, log)
}

#[test]
fn the_release_loses_the_stream_and_the_repairs_bring_it_back() {
    for chip in ALL {
        let as_released = chip == Chip::Released;
        let (mut world, log) = streaming(chip);
        world.falls_silent();
        assert!(world.is_dark());
        let before = log.frames.borrow().len();
        world.plug(Speed::High);
        let mut host = world.host(&log);
        let greeted = world.beside(40_000, async {
            host.enumerate().await?;
            host.hello().await
        });
        // The cable is plugged in again and the device is configured, but the released driver never answers.
        assert_eq!(greeted, Some(if as_released { Err(Deaf) } else { Ok(()) }));
        assert_eq!(world.core.borrow().is_armed(1), as_released);
        if !as_released {
            assert_eq!(
                world.beside(4_000, async {
                    host.start().await?;
                    host.stream().await
                }),
                None
            );
            assert!(log.frames.borrow().len() > before + 10);
            world.assert_no_violation();
        }
    }
}

/// Frames of a run, as its hosts have seen them, against the camera's own counters.
pub fn check_counters(status: &Status, log: &Log) {
    let counted = status.frames_sent
        + status.frames_dropped
        + status.fpga_frames_lost
        + status.fpga_frames_corrupt;
    assert_eq!(status.frames_made, counted, "{status:?}");
    let frames = log.frames.borrow();
    let seen: Vec<u32> = frames
        .iter()
        .filter(|(run, _)| *run == status.run)
        .map(|(_, sequence)| *sequence)
        .collect();
    assert!(seen.len() as u32 <= status.frames_sent, "{} frames, {status:?}", seen.len());
    assert!(seen.is_sorted_by(|a, b| a < b), "no frame twice");
    let gaps = seen.iter().zip(0..).map(|(sequence, place): (&u32, u32)| sequence - place).max();
    let dropped = status.frames_dropped + status.fpga_frames_lost;
    assert!(gaps.unwrap_or(0) <= dropped, "{seen:?}, {status:?}");
}

#[test]
fn a_hundred_unplugs_lose_nothing_that_is_not_counted() {
    CHIPS.into_iter().for_each(a_hundred_unplugs);
}

fn a_hundred_unplugs(chip: Chip) {
    let mut world = World::new(chip);
    let log: Rc<Log> = Rc::default();
    log.random.set(0x5EED);
    log.acknowledgements_lost.set(40);
    let mut checked = 0;
    for unplug in 0..=100 {
        let speed = if log.random(4) == 0 { Speed::Full } else { Speed::High };
        world.plug(speed);
        let mut host = world.host(&log);
        let pins = Rc::clone(&world.pins);
        let seen = &*log;
        let checked = &mut checked;
        let plugged = async {
            host.enumerate().await?;
            host.hello().await?;
            assert!(!pins.running.get(), "the session before ended");
            check_counters(&host.status().await?, seen);
            *checked += 1;
            host.start().await?;
            host.stream().await
        };
        // Anywhere: within a request, a reply or a frame.
        let rounds = if unplug == 100 { 5_000 } else { 1 + log.random(3_000) };
        assert_eq!(world.beside(rounds, plugged), None, "unplug {unplug}");
        // A cable that bounces is back before the device sees a suspend.
        if log.random(4) != 0 {
            world.falls_silent();
            assert!(world.is_dark(), "unplug {unplug}");
        }
    }
    assert!(checked > 50 && log.streams.get() > 40, "{checked} {}", log.streams.get());
    // The stream of the last host came too.
    let last_run = log.frames.borrow().last().expect("frames").0;
    assert!(log.frames.borrow().iter().filter(|(run, _)| *run == last_run).count() > 10);
    world.assert_no_violation();
}

#[test]
fn a_suspend_latched_before_the_reset_is_over() {
    for chip in ALL {
        let as_released = chip == Chip::Released;
        let mut world = World::new(chip);
        // The cable is out and in again before the device has looked.
        {
            let mut core = world.core.borrow_mut();
            core.suspend();
            core.reset();
            core.enumerated(Speed::High);
        }
        world.rounds(40);
        let mut host = world.host(&Rc::default());
        let enumerated = world.beside(40_000, host.enumerate());
        assert_eq!(enumerated, Some(if as_released { Err(Deaf) } else { Ok(()) }));
    }
}

#[test]
fn a_cable_pulled_within_a_control_transfer_is_noticed() {
    for chip in ALL {
        let as_released = chip == Chip::Released;
        let mut world = World::new(chip);
        let log: Rc<Log> = Rc::default();
        for rounds in 1..60 {
            world.plug(Speed::High);
            let mut host = world.host(&log);
            world.beside(rounds, host.enumerate());
            world.falls_silent();
        }
        world.plug(Speed::High);
        let mut host = world.host(&log);
        let enumerated = world.beside(40_000, host.enumerate());
        assert_eq!(enumerated, Some(if as_released { Err(Deaf) } else { Ok(()) }));
        if !as_released {
            world.assert_no_violation();
        }
    }
}

#[test]
fn a_cleared_halt_begins_with_data0() {
    for chip in ALL {
        let as_released = chip == Chip::Released;
        let mut world = World::new(chip);
        let log: Rc<Log> = Rc::default();
        world.plug(Speed::High);
        let mut host = world.host(&log);
        let outcomes = world.beside(80_000, async {
            host.enumerate().await?;
            let mut lost = 0;
            for _ in 0..4 {
                // One packet each way, so that the toggles stand at DATA1.
                lost += u32::from(host.hello().await.is_err());
                host.clear_halts().await?;
            }
            Ok::<u32, Deaf>(lost)
        });
        assert_eq!(outcomes == Some(Ok(0)), !as_released, "{outcomes:?}");
    }
}

#[test]
fn a_resumed_bus_carries_nothing_of_the_session_before() {
    CHIPS.into_iter().for_each(a_resumed_bus);
}

fn a_resumed_bus(chip: Chip) {
    let (mut world, log) = streaming(chip);
    let run = log.frames.borrow().last().expect("frames").0;
    world.falls_silent();
    assert!(world.is_dark());
    let seen = log.frames.borrow().len();
    world.core.borrow_mut().resume();
    world.pass(1_000);
    let mut host = world.host(&log);
    // Device and host kept their toggles.
    let toggles = world.core.borrow().toggles(1);
    world.beside(2_000, async {
        host.resumes(toggles);
        for _ in 0..100 {
            host.read();
            tick().await;
        }
    });
    assert_eq!(log.frames.borrow().len(), seen, "nothing of run {run}");
    let streamed = world.beside(4_000, async {
        host.hello().await?;
        check_counters(&host.status().await?, &log);
        host.start().await?;
        host.stream().await
    });
    assert_eq!(streamed, None);
    assert!(log.frames.borrow().len() > seen + 10);
    assert!(log.frames.borrow()[seen..].iter().all(|(of, _)| *of != run));
    world.assert_no_violation();
}

//! Packets that the USB core reads out of the ring of the FPGA's parallel port.
//!
//! Tests of unplugs, stuck links and speeds run with the ring too (`CHIPS`).

use super::otg_core::Speed;
use super::unplug::check_counters;
use super::world::{Chip, Host, Log, World, tick};
use nirspi_app::bench::ROUND_BYTES;
use nirspi_wire::Command;
use std::rc::Rc;
use std::vec::Vec;

fn streaming(patterns: u16, frame_us: u64) -> (World, Rc<Log>, Host) {
    let mut world = World::new(Chip::Ring);
    let log: Rc<Log> = Rc::default();
    world.plug(Speed::High);
    world.pins.frame_us.set(frame_us);
    let mut host = world.host(&log);
    host.patterns = patterns;
    let started = world.beside(4_000, async {
        host.enumerate().await?;
        host.hello().await?;
        host.start().await
    });
    assert_eq!(started, Some(Ok(())));
    (world, log, host)
}

/// Fetches this many bulk packets in a round of the world, for so many rounds.
fn read(world: &mut World, host: &mut Host, rounds: u32, packets: [u32; 2]) {
    let [in_a_round, rounds_apart] = packets;
    let ended = world.beside(rounds, async {
        for round in 0.. {
            if round % rounds_apart == 0 {
                (0..in_a_round).for_each(|_| host.read());
            }
            tick().await;
        }
    });
    assert_eq!(ended, None);
}

fn sequences(log: &Log) -> Vec<u32> {
    log.frames.borrow().iter().map(|(_, sequence)| *sequence).collect()
}

/// Each length of packets ends elsewhere in the ring's memory, and in the last packet of the bus.
#[test]
fn packets_come_whole_and_in_order_round_after_round() {
    // A ring of 16 KB holds what comes in a turn of the loop and what USB sends in one.
    for (patterns, frame_us) in
        [(64, 400), (100, 400), (119, 400), (128, 400), (512, 800), (1024, 1600)]
    {
        let (mut world, log, mut host) = streaming(patterns, frame_us);
        read(&mut world, &mut host, 5_000, [16, 1]);
        let got = sequences(&log);
        assert!(got.iter().copied().eq(0..got.len() as u32), "{patterns}: none is missing");
        let rounds = world.pins.by_port.get() / ROUND_BYTES;
        assert!(rounds >= 2, "{patterns} patterns, {rounds} rounds");
        world.assert_no_violation();
    }
}

/// The ring is full most of the time, or, where packets are short, the link: the FPGA waits within its packets, and loses
/// whole frames.
#[test]
fn to_a_slow_host_whole_frames_are_lost_and_counted() {
    for (patterns, packets) in [(64, [1, 40]), (1024, [2, 13]), (1024, [16, 200])] {
        let (mut world, log, mut host) = streaming(patterns, 200);
        read(&mut world, &mut host, 20_000, packets);
        let status = world.beside(20_000, async {
            assert_eq!(host.ask(Command::Stop).await?, Ok(None));
            host.status().await
        });
        let status = status.expect("an answer").expect("a status");
        check_counters(&status, &log);
        assert_eq!(status.fpga_frames_corrupt, 0, "{status:?}");
        assert_eq!(status.frames_dropped, 0, "{status:?}");
        assert_eq!(status.frames_sent, log.frames.borrow().len() as u32, "all that was sent came");
        assert!(status.fpga_frames_lost > 200, "{status:?}");
        assert_eq!(*log.faults.borrow(), [], "a full ring is no stalled FPGA");
        world.assert_no_violation();
    }
}

//! Hosts that stop reading, and a link that is stuck.

use super::otg_core::Speed;
use super::world::{CHIPS, Chip, Deaf, Log, World, tick};
use nirspi_mcu::PATIENCE;
use nirspi_wire::Command;
use std::rc::Rc;

/// Sends a command each half second for so long, and reads nothing.
async fn talks_only(host: &mut super::world::Host, rounds: u32) -> Result<(), Deaf> {
    for round in 0..rounds {
        if round % 10_000 == 0 {
            // The link is full after some commands, and then takes no more.
            embassy_futures::select::select(host.tell(Command::Status), async {
                for _ in 0..1_000 {
                    tick().await;
                }
            })
            .await;
        }
        tick().await;
    }
    Ok(())
}

#[test]
fn a_host_that_stops_reading_ends_its_session_and_the_light() {
    CHIPS.into_iter().for_each(a_host_stops_reading);
}

fn a_host_stops_reading(chip: Chip) {
    let mut world = World::new(chip);
    let log: Rc<Log> = Rc::default();
    world.plug(Speed::High);
    let mut host = world.host(&log);
    let started = world.beside(4_000, async {
        host.enumerate().await?;
        host.hello().await?;
        host.start().await
    });
    assert_eq!(started, Some(Ok(())));
    assert!(world.pins.running.get());
    // One second less than the patience: frames are dropped, and the light stays on.
    let second = 1_000_000;
    let patience = PATIENCE.0;
    let began = nirspi_app::bench::now_us();
    while nirspi_app::bench::now_us() < began + patience - second {
        world.beside(1_000, talks_only(&mut host, 1_000));
    }
    assert!(world.pins.running.get(), "patience");
    while nirspi_app::bench::now_us() < began + patience + second {
        world.beside(1_000, talks_only(&mut host, 1_000));
    }
    assert!(world.is_dark());
    assert!(world.core.borrow().is_attached(), "the device stays on the bus");
    // The host reads again, and gets its next session without another enumeration.
    let seen = log.frames.borrow().len();
    let streamed = world.beside(6_000, async {
        host.hello().await?;
        let status = host.status().await?;
        // With a ring it is the FPGA that waits.
        let [ours, fpgas] = [status.frames_dropped, status.fpga_frames_lost];
        assert!(if chip == Chip::Ring { fpgas } else { ours } > 1_000, "{status:?}");
        host.start().await?;
        host.stream().await
    });
    assert_eq!(streamed, None);
    assert!(log.frames.borrow().len() > seen + 10);
    world.assert_no_violation();
}

#[test]
fn a_second_stuck_write_takes_the_device_off_the_bus() {
    CHIPS.into_iter().for_each(a_second_stuck_write);
}

fn a_second_stuck_write(chip: Chip) {
    let mut world = World::new(chip);
    let log: Rc<Log> = Rc::default();
    world.plug(Speed::High);
    let mut host = world.host(&log);
    assert_eq!(
        world.beside(4_000, async {
            host.enumerate().await?;
            host.hello().await
        }),
        Some(Ok(()))
    );
    let mut left = None;
    for _ in 0..200 {
        // Greets and asks, and reads no answer.
        world.beside(5_000, async {
            host.tell(Command::Hello { protocol: nirspi_wire::version::CURRENT }).await?;
            host.tell(Command::Status).await
        });
        world.pass(100_000);
        if !world.core.borrow().is_attached() {
            left = Some(nirspi_app::bench::now_us());
            break;
        }
    }
    let left = left.expect("the device leaves the bus");
    assert!(left > 2 * PATIENCE.0, "only in the second session");
    // And comes back by itself.
    world.pass(150_000);
    assert!(world.core.borrow().is_attached());
    world.plug(Speed::High);
    let mut host = world.host(&log);
    let streamed = world.beside(6_000, async {
        host.enumerate().await?;
        host.hello().await?;
        host.start().await?;
        host.stream().await
    });
    assert_eq!(streamed, None);
    assert!(log.frames.borrow().len() > 10);
    world.assert_no_violation();
}

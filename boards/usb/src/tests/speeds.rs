//! High speed and full speed, with requests as hosts make them.

use super::otg_core::Speed;
use super::world::{CHIPS, Deaf, Log, World};
use std::rc::Rc;
use std::vec::Vec;

/// `wMaxPacketSize` of the endpoints in a configuration descriptor.
fn packet_sizes(descriptor: &[u8]) -> [u16; 2] {
    assert_eq!(descriptor.len(), 32);
    [22, 29].map(|at| u16::from_le_bytes([descriptor[at], descriptor[at + 1]]))
}

#[test]
fn descriptors_follow_the_speed_of_the_bus() {
    let speeds = [(Speed::High, 512, 64), (Speed::Full, 64, 512)];
    for (chip, (speed, here, other)) in
        CHIPS.into_iter().flat_map(|chip| speeds.map(|of| (chip, of)))
    {
        let mut world = World::new(chip);
        world.plug(speed);
        let mut host = world.host(&Rc::default());
        let found: Result<Vec<_>, Deaf> = world
            .beside(40_000, async {
                host.enumerate().await?;
                let mut found = Vec::new();
                for (kind, length) in [(2, 255), (7, 255), (2, 9), (7, 9), (6, 10), (2, 23)] {
                    found.push(host.descriptor(kind, length).await?.expect("a descriptor"));
                }
                Ok(found)
            })
            .expect("an end");
        let [this, that, head, other_head, qualifier, cut] = found.unwrap().try_into().unwrap();
        assert_eq!((packet_sizes(&this), this[1]), ([here; 2], 2));
        assert_eq!((packet_sizes(&that), that[1]), ([other; 2], 7));
        assert_eq!((&head[..], &other_head[..]), (&this[..9], &that[..9]));
        assert_eq!(cut, this[..23], "cut within a size");
        // USB 2.0, 9.6.2: ten bytes; control packets of 64 bytes and one configuration.
        assert_eq!((qualifier.len(), qualifier[1], &qualifier[7..]), (10, 6, &[64, 1, 0][..]));
        world.assert_no_violation();
    }
}

#[test]
fn a_full_speed_bus_carries_packets_of_64_bytes() {
    let speeds = [(Speed::High, 512), (Speed::Full, 64)];
    for (chip, (speed, bytes)) in CHIPS.into_iter().flat_map(|chip| speeds.map(|of| (chip, of))) {
        let mut world = World::new(chip);
        let log: Rc<Log> = Rc::default();
        world.plug(speed);
        let mut host = world.host(&log);
        let streamed = world.beside(6_000, async {
            host.enumerate().await?;
            host.hello().await?;
            host.start().await?;
            host.stream().await
        });
        assert_eq!(streamed, None);
        assert_eq!(host.packet_bytes, bytes);
        assert_eq!(world.core.borrow().packet_bytes(1), [bytes; 2]);
        let frames = log.frames.borrow();
        assert!(frames.len() > 50 && frames.iter().zip(0..).all(|((_, k), n)| *k == n));
        world.assert_no_violation();
    }
}

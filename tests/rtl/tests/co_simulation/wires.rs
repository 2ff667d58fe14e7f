//! Tests of the firmware's bus over the pins of the RTL, through wires that damage what they carry.

use nirspi_mcu::{BusError, FpgaBus, HostPort, PortBus};
use nirspi_tests_rtl::RtlPort;
use nirspi_wire::fpga::MAX_FRAME_BYTES;
use nirspi_wire::host_port::SEALED_BYTES;
use nirspi_wire::register::Register;

/// Wires that invert one to three of the 64 bits of some accesses.
struct Wires {
    port: RtlPort,
    chance: u64,
    /// One access in so many comes damaged; 0: none.
    one_in: u64,
}

impl Wires {
    fn next(&mut self) -> u64 {
        self.chance = self.chance.wrapping_mul(0x5851_F42D_4C95_7F2D).wrapping_add(1);
        self.chance >> 33
    }

    /// Address and bytes at the other end.
    fn carry(&mut self, address: u16, sealed: [u8; SEALED_BYTES]) -> (u16, [u8; SEALED_BYTES]) {
        let mut wrong = 0u64;
        if self.one_in > 0 && self.next().is_multiple_of(self.one_in) {
            for _ in 0..3 {
                wrong |= 1 << (self.next() % 64);
            }
        }
        let [w0, w1, wrong @ ..] = wrong.to_be_bytes();
        let mut carried = sealed;
        carried.iter_mut().zip(wrong).for_each(|(byte, wrong)| *byte ^= wrong);
        (address ^ u16::from_be_bytes([w0, w1]), carried)
    }
}

impl HostPort for Wires {
    fn write(&mut self, address: u16, sealed: [u8; SEALED_BYTES]) -> Result<(), BusError> {
        let (address, sealed) = self.carry(address, sealed);
        self.port.write(address, sealed)
    }

    fn read(&mut self, address: u16) -> Result<[u8; SEALED_BYTES], BusError> {
        let (seen, wrong) = self.carry(address, [0; SEALED_BYTES]);
        let mut sealed = self.port.read(seen)?;
        sealed.iter_mut().zip(wrong).for_each(|(byte, wrong)| *byte ^= wrong);
        Ok(sealed)
    }

    fn frame_ready(&mut self) -> bool {
        self.port.frame_ready()
    }

    fn raw_ready(&mut self) -> bool {
        self.port.raw_ready()
    }
}

#[test]
fn firmware_and_rtl_believe_nothing_that_came_damaged() {
    const ROUNDS: u32 = 150;
    let wires = Wires { port: RtlPort::bring_up(), chance: 1, one_in: 0 };
    let mut bus = PortBus::new(wires, Box::leak(Box::new([0; MAX_FRAME_BYTES])));
    let scratch = Register::Scratch.address();
    let (mut held, mut taken, mut given_up) = (0, 0, 0);
    for round in 0..ROUNDS {
        bus.port().one_in = 4;
        let value = 0x9E37_79B9u32.wrapping_mul(round + 1);
        let written = bus.write(scratch, value);
        let seen = bus.read(scratch);
        bus.port().one_in = 0;
        let writes = bus.read(Register::Writes.address()).unwrap();
        assert!(writes - taken <= 1, "round {round}: a write acts once");
        held = if writes == taken { held } else { value };
        match written {
            Ok(()) => assert_eq!(writes, taken + 1, "round {round}"),
            Err(error) => assert_eq!(error, BusError::Damaged),
        }
        taken = writes;
        assert_eq!(bus.read(scratch), Ok(held), "round {round}");
        match seen {
            Ok(value) => assert_eq!(value, held, "round {round}"),
            Err(error) => assert_eq!(error, BusError::Damaged),
        }
        given_up += u32::from(written.is_err()) + u32::from(seen.is_err());
    }
    let damaged = bus.damaged();
    assert!(
        damaged > ROUNDS / 2 && given_up < ROUNDS / 5,
        "{damaged} damaged, {given_up} given up"
    );
}

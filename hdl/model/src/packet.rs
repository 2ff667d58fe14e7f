//! Makes a delivered bank into a packet that the firmware forwards as it is: the layout is defined
//! in [`nirspi_wire::ready`].
//!
//! # Invariant
//! The packet is the message that the firmware makes of the same frame
//! (`tests::a_packet_is_the_message_that_the_firmware_makes_of_the_frame`).

use nirspi_wire::fpga::{Header, Sums};
use nirspi_wire::packet::{MAX_DEVICE_PACKET, seal};
use nirspi_wire::ready::Head;
use nirspi_wire::samples::Width;
use nirspi_wire::{ADC_HZ, FrameFlags};

/// Clocks of a microsecond.
const CLOCKS_PER_MICRO: u64 = ADC_HZ as u64 / 1_000_000;

/// What the firmware tells the FPGA before a run of packets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Stamp {
    /// Number of the run since power-up.
    pub run: u16,
    /// A clock before the run.
    pub clock: u64,
    /// Device time of that clock in microseconds.
    pub time_us: u64,
}

impl Stamp {
    /// Device time of a later clock. The clock and the time wrap at 2^64.
    fn time_of(&self, clock: u64) -> u64 {
        self.time_us.wrapping_add(clock.wrapping_sub(self.clock) / CLOCKS_PER_MICRO)
    }
}

/// The packet of a frame, delimiter included: this header, and sums from the beginning of the bank.
/// Without complements every negative sum counts as 0. Differences wrap at 2^32, so the packet is
/// right up to [`MAX_SUMMED_SAMPLES`](nirspi_wire::ready::MAX_SUMMED_SAMPLES) in each sum; with samples of 24 bits
/// they wrap at 2^24, so it is right up to [`MAX_NARROW_SAMPLES`](nirspi_wire::ready::MAX_NARROW_SAMPLES).
///
/// # Panics
/// On a header of more patterns than the array has.
#[must_use]
pub fn packet(header: &Header, bank: &[Sums], stamp: &Stamp, width: Width) -> Vec<u8> {
    let Header { patterns, flags, sequence, sweeps, clock, .. } = *header;
    let device_time_us = stamp.time_of(clock);
    let head = Head { run: stamp.run, sequence, device_time_us, sweeps, flags, patterns, width };
    let mut payload = head.to_bytes().to_vec();
    for sums in bank.iter().take(patterns.into()) {
        let negative = if flags.contains(FrameFlags::DIFFERENTIAL) { sums.negative } else { 0 };
        let difference = (sums.positive.wrapping_sub(negative) as u32).to_le_bytes();
        payload.extend(&difference[..width.bytes()]);
    }
    let mut room = vec![0; MAX_DEVICE_PACKET];
    seal(&payload, &mut room).expect("a frame fits a packet").to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nirspi_wire::ready::{MAX_NARROW_SAMPLES, MAX_SUMMED_SAMPLES};
    use nirspi_wire::{ADC_MAX, DeviceMessage, Frame, Samples, open};
    use proptest::prelude::*;

    const LARGEST: u64 = MAX_SUMMED_SAMPLES as u64 * ADC_MAX as u64;
    const LARGEST_NARROW: u64 = MAX_NARROW_SAMPLES as u64 * ADC_MAX as u64;

    proptest! {
        #[test]
        fn a_packet_is_the_message_that_the_firmware_makes_of_the_frame(
            sums in prop::collection::vec((0..=LARGEST, 0..=LARGEST), 1..=1024),
            sequence: u32, sweeps: u32, differential: bool, run: u16,
            clock in 0..1u64 << 48, later in 0..1u64 << 48, time_us in 0..1u64 << 48, narrow: bool,
        ) {
            let (width, most) =
                if narrow { (Width::Bits24, LARGEST_NARROW) } else { (Width::Bits32, LARGEST) };
            let flags = FrameFlags::default();
            let flags = if differential { flags.with(FrameFlags::DIFFERENTIAL) } else { flags };
            let header = Header {
                patterns: sums.len() as u16, flags, sequence, sweeps,
                over_range: 1, lost: 2, clock: clock + later,
            };
            let bank: Vec<Sums> =
                sums.iter().map(|&(p, n)| Sums { positive: p.min(most), negative: n.min(most) }).collect();
            let mut bytes = packet(&header, &bank, &Stamp { run, clock, time_us }, width);

            let differences = bank.iter().map(|sums| {
                Sums { negative: if differential { sums.negative } else { 0 }, ..*sums }.difference()
            });
            let mut words = vec![0; 4 * bank.len()];
            let samples = Samples::pack(differences, width, &mut words).unwrap();
            let device_time_us = time_us + later / 125;
            let frame = Frame { run, sequence, device_time_us, sweeps, flags, samples };
            let length = bytes.len() - 1;
            prop_assert!(!bytes[..length].contains(&0));
            let opened: DeviceMessage<'_> = open(&mut bytes[..length]).unwrap();
            prop_assert_eq!(opened, DeviceMessage::Frame(frame));
        }
    }
}

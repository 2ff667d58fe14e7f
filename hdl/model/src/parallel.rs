//! What the parallel port sends of a packet.

/// Zeros before a packet: they end what a start has cut, or what the receiver has of a time before the FPGA's reset.
const ZEROS_BEFORE: usize = 1;

/// Zeros behind the delimiter of a packet: a receiver that collects bytes in words of four has the whole packet then,
/// wherever its words begin.
const ZEROS_BEHIND: usize = 3;

/// The bytes on the eight lines for this packet, delimiter included. On the host's link zeros are empty packets.
#[must_use]
pub fn on_lines(packet: &[u8]) -> Vec<u8> {
    [&[0; ZEROS_BEFORE], packet, &[0; ZEROS_BEHIND]].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_words_of_four_that_hold_a_packet_are_full_wherever_they_begin() {
        for length in 2..40 {
            let packet: Vec<u8> = (1..length).chain([0]).collect();
            let sent = on_lines(&packet);
            for before in 0..4 {
                let words = (before + sent.len()) / 4;
                assert!(4 * words >= before + ZEROS_BEFORE + packet.len(), "{length}, {before}");
            }
        }
    }
}

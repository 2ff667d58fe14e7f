//! How many frames a second the real firmware and the RTL forward over the pins of the host port, in simulated time.

use nirspi_tests::throughput::{Processor, stretch};
use nirspi_tests_rtl::RtlPort;

/// Packets of 1024 patterns by the parallel port, into the ring of the firmware, and out of it to a host as fast as USB
/// carries them. Both ports work beside each other: the signal meter reads registers by the host port meanwhile.
#[test]
fn packets_of_the_rtl_lie_in_the_ring_and_reach_10_500_frames_a_second() {
    let port = RtlPort::with_parallel_port();
    // In so many frames the ring fills, and the FPGA begins to wait for room.
    let seen = stretch(port, 1024, (120, 240), Processor::streaming());
    println!("simulated: {seen:.2?}");
    assert!(seen.frames_per_second >= 10_500.0, "{seen:?}");
    // What is neither lost nor sent lies in the ring or in the FPGA.
    let waiting = seen.made - seen.lost - seen.sent;
    assert!(seen.lost > 0 && waiting <= 42 + 2, "{seen:?}");
}

/// Packets of 1024 patterns at both clocks of the reference board's `sck`. The model's own test has the same figure from the golden
/// model; here each bit goes over a pin.
#[test]
fn packets_of_the_rtl_come_one_transfer_after_the_other() {
    let seen = stretch(RtlPort::bring_up_at_the_boards_sck(), 1024, (4, 6), Processor::reference());
    println!("simulated: {seen:.1?}");
    assert!(seen.frames_per_second > 5900.0, "{seen:?}");
    assert!(seen.made - seen.lost - seen.sent <= 2, "{seen:?}");
}

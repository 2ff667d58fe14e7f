//! How many frames a second the real firmware and the RTL forward over the pins of the host port, in simulated time.

use nirspi_tests::throughput::{Processor, stretch};
use nirspi_tests_rtl::RtlPort;

/// Packets of 1024 patterns at both clocks of the reference board's `sck`. The model's own test has the same figure from the golden
/// model; here each bit goes over a pin.
#[test]
fn packets_of_the_rtl_come_one_transfer_after_the_other() {
    let seen =
        stretch(RtlPort::bring_up_at_the_boards_sck(), 1024, (4, 6), Processor::reference(), true);
    println!("simulated: {seen:.1?}");
    assert!(seen.frames_per_second > 5900.0, "{seen:?}");
    assert!(seen.made - seen.lost - seen.sent <= 2, "{seen:?}");
}

//! Laws of the sets of bits in messages: what happened to a frame, and what a camera can do.

use nirspi_wire::{Capabilities, FrameFlags};
use proptest::prelude::*;

proptest! {
    #[test]
    fn a_set_of_flags_contains_what_was_put_into_it_and_nothing_else(a: u16, b: u16) {
        let both = FrameFlags(a).with(FrameFlags(b));
        for bit in (0..u16::BITS).map(|bit| 1 << bit) {
            let expected = FrameFlags(a).contains(FrameFlags(bit)) || FrameFlags(b).contains(FrameFlags(bit));
            prop_assert_eq!(both.contains(FrameFlags(bit)), expected);
            prop_assert_eq!(FrameFlags(a).contains(FrameFlags(bit)), a & bit > 0);
        }
        // All bits asked for, not some of them.
        prop_assert_eq!(FrameFlags(a).contains(both), both == FrameFlags(a));
    }

    #[test]
    fn a_camera_has_the_capabilities_that_were_put_together_and_no_other(a: u32, b: u32) {
        let both = Capabilities(a).with(Capabilities(b));
        for bit in (0..u32::BITS).map(|bit| 1 << bit) {
            let expected = Capabilities(a).contains(Capabilities(bit)) || Capabilities(b).contains(Capabilities(bit));
            prop_assert_eq!(both.contains(Capabilities(bit)), expected);
            prop_assert_eq!(Capabilities(a).contains(Capabilities(bit)), a & bit > 0);
        }
        prop_assert_eq!(Capabilities(a).contains(both), both == Capabilities(a));
    }
}

/// The bits are part of the wire format, and the FPGA's header has the same.
#[test]
fn each_flag_and_capability_is_one_bit_of_its_own() {
    use FrameFlags as F;
    let flags = [F::OVER_RANGE, F::OVERFLOW, F::AFTER_LOSS, F::TEST_SOURCE, F::DIFFERENTIAL];
    assert_eq!(flags.map(|flag| flag.0), [1, 2, 4, 8, 16]);
    assert_eq!(Capabilities::NAMES.map(|(capability, _)| capability.0), [1, 2, 4, 8]);
}

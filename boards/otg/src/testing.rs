//! A driver on a simulated core, for tests on the host. Not in the release.

use core::cell::RefCell;
use std::rc::Rc;

use crate::State;
use crate::otg_v1::Otg;
use crate::simulated::{Core, place};

/// Makes this core the one of the thread. With `as_released`, the driver runs without the fork's repairs.
pub fn install(core: Rc<RefCell<dyn Core>>, as_released: bool) -> Otg {
    // SAFETY: on a host the registers are addresses that are never accessed.
    unsafe { Otg::from_ptr(place(core, as_released).cast()) }
}

/// The core's interrupt, for a core that has one pending.
pub fn interrupt<const EP_COUNT: usize>(r: Otg, state: &State<EP_COUNT>) {
    // SAFETY: called between two polls of a test, where no other code of the driver runs.
    unsafe { crate::on_interrupt(r, state, EP_COUNT) }
}

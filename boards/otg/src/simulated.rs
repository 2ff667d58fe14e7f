//! A core without silicon, for tests on the host. Not in the release.
//!
//! With the feature `simulated`, each access of the driver to a register goes to the [`Core`] of the thread.

use core::cell::{Cell, RefCell};
use std::rc::Rc;

use crate::State;
use crate::otg_v1::Otg;

/// Registers that behave as those of the OTG core.
pub trait Core {
    /// The value that a read of the register at this offset gives. The read may change the core, as a FIFO does.
    fn read(&mut self, offset: usize) -> u32;

    /// A write to the register at this offset.
    fn write(&mut self, offset: usize, value: u32);
}

/// The register space: addresses only, since no access reaches the memory.
const SPACE_BYTES: usize = 0x2_0000;
static SPACE: [u8; SPACE_BYTES] = [0; SPACE_BYTES];

std::thread_local! {
    static CORE: RefCell<Option<Rc<RefCell<dyn Core>>>> = const { RefCell::new(None) };
    static AS_RELEASED: Cell<bool> = const { Cell::new(false) };
}

/// Makes this core the one of the thread. With `as_released`, the driver runs without the fork's repairs.
pub fn install(core: Rc<RefCell<dyn Core>>, as_released: bool) -> Otg {
    CORE.with(|place| *place.borrow_mut() = Some(core));
    AS_RELEASED.with(|place| place.set(as_released));
    // SAFETY: with this feature the registers are addresses that are never accessed.
    unsafe { Otg::from_ptr(SPACE.as_ptr().cast_mut().cast()) }
}

/// The core's interrupt, for a core that has one pending.
pub fn interrupt<const EP_COUNT: usize>(r: Otg, state: &State<EP_COUNT>) {
    // SAFETY: called between two polls of a test, where no other code of the driver runs.
    unsafe { crate::on_interrupt(r, state, EP_COUNT) }
}

pub(crate) fn as_released() -> bool {
    AS_RELEASED.with(Cell::get)
}

fn with<R>(pointer: *mut u8, access: impl FnOnce(&mut dyn Core, usize) -> R) -> R {
    let offset = (pointer as usize).wrapping_sub(SPACE.as_ptr() as usize);
    assert!(offset < SPACE_BYTES && offset % 4 == 0, "register at {offset:#x}");
    let core = CORE
        .with(|place| place.borrow().clone())
        .expect("no core is installed on this thread");
    let mut core = core.borrow_mut();
    access(&mut *core, offset)
}

pub(crate) fn read<T: Copy>(pointer: *mut u8) -> T {
    const { assert!(size_of::<T>() == 4) };
    let value = with(pointer, |core, offset| core.read(offset));
    // SAFETY: each register type is a transparent u32.
    unsafe { core::mem::transmute_copy(&value) }
}

pub(crate) fn write<T: Copy>(pointer: *mut u8, value: T) {
    const { assert!(size_of::<T>() == 4) };
    // SAFETY: each register type is a transparent u32.
    let value = unsafe { core::mem::transmute_copy(&value) };
    with(pointer, |core, offset| core.write(offset, value));
}

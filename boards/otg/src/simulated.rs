//! A core without silicon, for tests on the host. Not in the release.
//!
//! On a target with an operating system, each access of the driver to a register goes to the [`Core`] of the thread.

use core::cell::{Cell, RefCell};
use std::rc::Rc;
use std::vec::Vec;

pub mod otg_v1;

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

/// Memory that the driver has lent to the core's DMA.
struct Loan {
    /// Where the core finds this memory.
    address: u32,
    memory: *mut u8,
    bytes: usize,
    is_writable: bool,
}

/// Where the memory begins that the core finds.
const MEMORY: u32 = 0x2000_0000;

std::thread_local! {
    static LOANS: RefCell<Vec<Loan>> = const { RefCell::new(Vec::new()) };
    static FREE: Cell<u32> = const { Cell::new(MEMORY) };
}

/// Lends memory to the core until it is taken back, and returns its address, as far from a multiple of 4 as the memory.
/// Memory that the core may write is lent once and for all.
pub(crate) fn lend(memory: *const u8, bytes: usize, is_writable: bool) -> u32 {
    LOANS.with_borrow_mut(|loans| {
        let again = loans
            .iter()
            .find(|loan| is_writable && loan.memory.cast_const() == memory && loan.bytes >= bytes);
        if let Some(loan) = again {
            return loan.address;
        }
        let address = FREE.get().next_multiple_of(64) + (memory.addr() % 4) as u32;
        FREE.set(address + bytes as u32 + 64);
        loans.push(Loan {
            address,
            memory: memory.cast_mut(),
            bytes,
            is_writable,
        });
        address
    })
}

/// The core must no longer read what was lent at this address.
pub(crate) fn take_back(address: u32) {
    LOANS.with_borrow_mut(|loans| loans.retain(|loan| loan.address != address));
}

fn with_memory<R>(address: u32, bytes: usize, writes: bool, access: impl FnOnce(*mut u8) -> R) -> Option<R> {
    LOANS.with_borrow(|loans| {
        let place = |loan: &&Loan| {
            let offset = address.checked_sub(loan.address).map(|offset| offset as usize);
            offset.is_some_and(|offset| offset + bytes <= loan.bytes) && (loan.is_writable || !writes)
        };
        let loan = loans.iter().find(place)?;
        // SAFETY: within the memory that was lent.
        Some(access(unsafe { loan.memory.add((address - loan.address) as usize) }))
    })
}

/// What the core's DMA reads at this address. `None`: the driver has not lent that memory, or has taken it back.
pub fn fetch(address: u32, bytes: usize) -> Option<Vec<u8>> {
    with_memory(address, bytes, false, |memory| {
        // SAFETY: the driver says that this memory may be read, and runs on this thread only.
        unsafe { core::slice::from_raw_parts(memory, bytes) }.to_vec()
    })
}

/// The core's DMA writes to this address. False: the driver has lent no such memory for that.
pub fn store(address: u32, bytes: &[u8]) -> bool {
    let write = |memory: *mut u8| {
        // SAFETY: the driver says that this memory may be written, and runs on this thread only.
        unsafe { core::ptr::copy_nonoverlapping(bytes.as_ptr(), memory, bytes.len()) }
    };
    with_memory(address, bytes.len(), true, write).is_some()
}

std::thread_local! {
    static CORE: RefCell<Option<Rc<RefCell<dyn Core>>>> = const { RefCell::new(None) };
    static AS_RELEASED: Cell<bool> = const { Cell::new(false) };
}

/// Makes this core the one of the thread, and returns the address of its registers. With `as_released`, the driver runs
/// without the fork's repairs.
pub(crate) fn place(core: Rc<RefCell<dyn Core>>, as_released: bool) -> *mut u8 {
    CORE.with(|place| *place.borrow_mut() = Some(core));
    AS_RELEASED.with(|place| place.set(as_released));
    SPACE.as_ptr().cast_mut()
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

//! Memory that the chip's start does not clear.
//!
//! Before `main` the chip clears its memory at the 4 MHz that it wakes with: 0.4 us a byte, without a watchdog. Large memory
//! is therefore left out, and filled when the processor runs at its full speed.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicBool, Ordering};

/// An array in a section that is not cleared. [`uncleared!`](crate::uncleared) makes one.
pub struct Uncleared<T, const N: usize>(UnsafeCell<MaybeUninit<[T; N]>>);

#[expect(unsafe_code, reason = "the memory is given to one taker")]
// SAFETY: `fill` gives the memory to one taker, who may be anywhere.
unsafe impl<T: Send, const N: usize> Sync for Uncleared<T, N> {}

impl<T: Clone, const N: usize> Uncleared<T, N> {
    /// Memory that holds anything.
    pub const fn new() -> Self {
        Self(UnsafeCell::new(MaybeUninit::uninit()))
    }

    /// Fills the memory and gives it away. `taken` belongs to this memory alone, and is false at the start.
    ///
    /// # Panics
    /// On the second call.
    #[expect(clippy::mut_from_ref, reason = "once only")]
    pub fn fill(&'static self, taken: &AtomicBool, value: T) -> &'static mut [T; N] {
        assert!(!taken.swap(true, Ordering::Relaxed), "memory is taken once");
        #[expect(unsafe_code, reason = "memory that no start has written")]
        // SAFETY: this is the only access, because `taken` is false only once. Every element is written before it is read.
        unsafe {
            let first = self.0.get().cast::<T>();
            for place in 0..N {
                first.add(place).write(value.clone());
            }
            &mut *self.0.get().cast()
        }
    }
}

/// `uncleared! { NAME: [TYPE; LENGTH], TAKEN }`: memory in a section that is not cleared, and the mark of its taker.
macro_rules! uncleared {
    ($name:ident: [$type:ty; $length:expr], $taken:ident) => {
        #[expect(unsafe_code, reason = "a section is chosen by an attribute that is unsafe to use")]
        #[unsafe(link_section = concat!(".uninit.", stringify!($name)))]
        static $name: $crate::memory::Uncleared<$type, { $length }> =
            $crate::memory::Uncleared::new();
        static $taken: core::sync::atomic::AtomicBool = core::sync::atomic::AtomicBool::new(false);
    };
}
pub(crate) use uncleared;

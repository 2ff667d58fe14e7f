//! The processor: the library Unicorn, loaded while the tests run.
//!
//! Unicorn is under the GPL, version 2. These tests load it as a tool, as other tests run QEMU. Nothing that is handed out
//! is linked with it, and this crate builds without it.
#![expect(unsafe_code, reason = "a library in C, loaded at run time")]

use libloading::Library;
use std::ffi::{c_int, c_void};
use std::path::Path;
use std::ptr;

type Handle = *mut c_void;

/// Numbers of `unicorn/arm.h`.
#[derive(Debug, Clone, Copy)]
#[repr(i32)]
pub enum Register {
    Lr = 10,
    Pc = 11,
    Sp = 12,
    R0 = 66,
    Control = 117,
    Xpsr = 120,
    Primask = 123,
}

const ARCH_ARM: c_int = 1;
/// `UC_MODE_THUMB` and `UC_MODE_MCLASS`.
const MODE: c_int = 1 << 4 | 1 << 5;
const CORTEX_M33: c_int = 11;
/// `UC_CTL_WRITE(UC_CTL_CPU_MODEL, 1)`.
const SET_MODEL: c_int = 7 | 1 << 26 | 1 << 30;

const HOOK_INTERRUPT: c_int = 1 << 0;
const HOOK_CODE: c_int = 1 << 2;
const HOOK_BLOCK: c_int = 1 << 3;
const HOOK_UNMAPPED: c_int = 1 << 4 | 1 << 5 | 1 << 6;

/// What the processor asks while it runs. All calls come from within [`Unicorn::run`].
pub trait Bus {
    /// A read of a register.
    fn read(&self, address: u32, bytes: u32) -> u32;
    /// A write to a register.
    fn write(&self, address: u32, bytes: u32, value: u32);
    /// A run of instructions without a branch begins. True: the processor stops before it.
    fn block(&self, address: u32, bytes: u32) -> bool;
    /// The hint instruction at this address (`WFE`, `SEV`) is next. True: the processor stops before it.
    fn hint(&self, address: u32) -> bool;
    /// An exception of the processor, by Unicorn's number.
    fn exception(&self, number: u32);
    /// An access to an address without memory, which ends the run.
    fn unmapped(&self, address: u32);
}

type Read = extern "C" fn(Handle, u64, u32, *mut c_void) -> u64;
type Write = extern "C" fn(Handle, u64, u32, u64, *mut c_void);

struct Api {
    mem_map: unsafe extern "C" fn(Handle, u64, usize, u32) -> c_int,
    mem_read: unsafe extern "C" fn(Handle, u64, *mut c_void, usize) -> c_int,
    mem_write: unsafe extern "C" fn(Handle, u64, *const c_void, usize) -> c_int,
    mmio_map:
        unsafe extern "C" fn(Handle, u64, usize, Read, *mut c_void, Write, *mut c_void) -> c_int,
    reg_read: unsafe extern "C" fn(Handle, c_int, *mut c_void) -> c_int,
    reg_write: unsafe extern "C" fn(Handle, c_int, *const c_void) -> c_int,
    emu_start: unsafe extern "C" fn(Handle, u64, u64, u64, usize) -> c_int,
    emu_stop: unsafe extern "C" fn(Handle) -> c_int,
    close: unsafe extern "C" fn(Handle) -> c_int,
    context_alloc: unsafe extern "C" fn(Handle, *mut *mut c_void) -> c_int,
    context_save: unsafe extern "C" fn(Handle, *mut c_void) -> c_int,
    context_restore: unsafe extern "C" fn(Handle, *mut c_void) -> c_int,
    context_free: unsafe extern "C" fn(*mut c_void) -> c_int,
    hook_add: unsafe extern "C" fn(
        Handle,
        *mut usize,
        c_int,
        *mut c_void,
        *mut c_void,
        u64,
        u64,
        ...
    ) -> c_int,
    /// Last, so that it is unloaded last.
    _library: Library,
}

/// The memory of the processor, for the DMA of peripherals. It must not outlive its [`Unicorn`].
#[derive(Clone, Copy)]
pub struct Memory {
    handle: Handle,
    read: unsafe extern "C" fn(Handle, u64, *mut c_void, usize) -> c_int,
    write: unsafe extern "C" fn(Handle, u64, *const c_void, usize) -> c_int,
}

impl Memory {
    /// Reads bytes; `None` where there is no memory.
    #[must_use]
    pub fn get(&self, address: u32, bytes: usize) -> Option<Vec<u8>> {
        let mut found = vec![0; bytes];
        // SAFETY: the buffer has that many bytes, and the handle is alive.
        let error =
            unsafe { (self.read)(self.handle, address.into(), found.as_mut_ptr().cast(), bytes) };
        (error == 0).then_some(found)
    }

    /// Writes bytes; false where there is no memory.
    #[must_use]
    pub fn put(&self, address: u32, bytes: &[u8]) -> bool {
        // SAFETY: the buffer has that many bytes, and the handle is alive.
        unsafe {
            (self.write)(self.handle, address.into(), bytes.as_ptr().cast(), bytes.len()) == 0
        }
    }

    /// A word; 0 where there is no memory.
    #[must_use]
    pub fn word(&self, address: u32) -> u32 {
        self.get(address, 4)
            .map_or(0, |bytes| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
    }
}

/// A processor of the kind Cortex-M33.
pub struct Unicorn<B: Bus> {
    api: Api,
    handle: Handle,
    context: *mut c_void,
    /// Where the callbacks find it: never moved.
    bus: Box<B>,
}

extern "C" fn on_read<B: Bus, const BASE: u32>(
    _: Handle,
    offset: u64,
    bytes: u32,
    user: *mut c_void,
) -> u64 {
    // SAFETY: the bus lives as long as the processor.
    unsafe { &*user.cast::<B>() }.read(BASE + offset as u32, bytes).into()
}

extern "C" fn on_write<B: Bus, const BASE: u32>(
    _: Handle,
    offset: u64,
    bytes: u32,
    value: u64,
    user: *mut c_void,
) {
    // SAFETY: the bus lives as long as the processor.
    unsafe { &*user.cast::<B>() }.write(BASE + offset as u32, bytes, value as u32);
}

/// What a callback needs: the bus, and how the processor is stopped.
struct Hooked<B> {
    bus: *const B,
    stop: unsafe extern "C" fn(Handle) -> c_int,
}

extern "C" fn on_block<B: Bus>(handle: Handle, address: u64, bytes: u32, user: *mut c_void) {
    // SAFETY: these live as long as the processor.
    unsafe {
        let hooked = &*user.cast::<Hooked<B>>();
        if (*hooked.bus).block(address as u32, bytes) {
            (hooked.stop)(handle);
        }
    }
}

extern "C" fn on_hint<B: Bus>(handle: Handle, address: u64, _: u32, user: *mut c_void) {
    // SAFETY: these live as long as the processor.
    unsafe {
        let hooked = &*user.cast::<Hooked<B>>();
        if (*hooked.bus).hint(address as u32) {
            (hooked.stop)(handle);
        }
    }
}

extern "C" fn on_exception<B: Bus>(handle: Handle, number: u32, user: *mut c_void) {
    // SAFETY: these live as long as the processor.
    unsafe {
        let hooked = &*user.cast::<Hooked<B>>();
        (*hooked.bus).exception(number);
        (hooked.stop)(handle);
    }
}

extern "C" fn on_unmapped<B: Bus>(
    _: Handle,
    _kind: c_int,
    address: u64,
    _bytes: c_int,
    _value: i64,
    user: *mut c_void,
) -> bool {
    // SAFETY: these live as long as the processor.
    unsafe { (*(*user.cast::<Hooked<B>>()).bus).unmapped(address as u32) };
    false
}

/// Where registers are: the peripherals, and the processor's own.
pub const PERIPHERALS: u32 = 0x4000_0000;
const PRIVATE: u32 = 0xE000_0000;

impl<B: Bus> Unicorn<B> {
    /// Loads the library and makes a processor. The bus is made with the processor's memory, which is empty so far.
    ///
    /// # Errors
    /// In words, if the file is not Unicorn 2.
    pub fn new(
        library: &Path,
        memories: &[(u32, usize)],
        hints: &[u32],
        bus: impl FnOnce(Memory) -> B,
    ) -> Result<Self, String> {
        // SAFETY: the library has no initialisation that another library could disturb, and its functions have these
        // types (`unicorn/unicorn.h` of version 2.1).
        let (api, handle) = unsafe {
            let library = Library::new(library).map_err(|error| error.to_string())?;
            macro_rules! symbol {
                ($name:literal) => {
                    *library
                        .get(concat!($name, "\0").as_bytes())
                        .map_err(|error| error.to_string())?
                };
            }
            let open: unsafe extern "C" fn(c_int, c_int, *mut Handle) -> c_int = symbol!("uc_open");
            let control: unsafe extern "C" fn(Handle, c_int, ...) -> c_int = symbol!("uc_ctl");
            let mut handle = ptr::null_mut();
            check("uc_open", open(ARCH_ARM, MODE, &raw mut handle))?;
            check("uc_ctl", control(handle, SET_MODEL, CORTEX_M33))?;
            let api = Api {
                mem_map: symbol!("uc_mem_map"),
                mem_read: symbol!("uc_mem_read"),
                mem_write: symbol!("uc_mem_write"),
                mmio_map: symbol!("uc_mmio_map"),
                reg_read: symbol!("uc_reg_read"),
                reg_write: symbol!("uc_reg_write"),
                emu_start: symbol!("uc_emu_start"),
                emu_stop: symbol!("uc_emu_stop"),
                close: symbol!("uc_close"),
                context_alloc: symbol!("uc_context_alloc"),
                context_save: symbol!("uc_context_save"),
                context_restore: symbol!("uc_context_restore"),
                context_free: symbol!("uc_context_free"),
                hook_add: symbol!("uc_hook_add"),
                _library: library,
            };
            (api, handle)
        };
        let memory = Memory { handle, read: api.mem_read, write: api.mem_write };
        let mut made = Self { api, handle, context: ptr::null_mut(), bus: Box::new(bus(memory)) };
        made.connect(memories, hints)?;
        Ok(made)
    }

    fn connect(&mut self, memories: &[(u32, usize)], hints: &[u32]) -> Result<(), String> {
        const ALL: u32 = 7;
        let bus: *mut c_void = ptr::from_ref::<B>(&self.bus).cast_mut().cast();
        // For the rest of the process: a few words a processor.
        let hooked =
            Box::leak(Box::new(Hooked { bus: &raw const *self.bus, stop: self.api.emu_stop }));
        let hooked: *mut c_void = ptr::from_mut(hooked).cast();
        let mut hook = 0;
        // SAFETY: the callbacks have the types that the library expects of each hook, and their data live long enough.
        unsafe {
            for (address, bytes) in memories {
                check(
                    "uc_mem_map",
                    (self.api.mem_map)(self.handle, (*address).into(), *bytes, ALL),
                )?;
            }
            let map = self.api.mmio_map;
            let (read, write) = (on_read::<B, PERIPHERALS>, on_write::<B, PERIPHERALS>);
            check(
                "uc_mmio_map",
                map(self.handle, PERIPHERALS.into(), 0x1000_0000, read, bus, write, bus),
            )?;
            let (read, write) = (on_read::<B, PRIVATE>, on_write::<B, PRIVATE>);
            check(
                "uc_mmio_map",
                map(self.handle, PRIVATE.into(), 0x10_0000, read, bus, write, bus),
            )?;
            let mut add = |kind, callback: *mut c_void, begin: u64, end: u64| {
                let add = self.api.hook_add;
                check(
                    "uc_hook_add",
                    add(self.handle, &raw mut hook, kind, callback, hooked, begin, end),
                )
            };
            add(HOOK_BLOCK, on_block::<B> as *mut c_void, 1, 0)?;
            add(HOOK_INTERRUPT, on_exception::<B> as *mut c_void, 1, 0)?;
            add(HOOK_UNMAPPED, on_unmapped::<B> as *mut c_void, 1, 0)?;
            for hint in hints {
                add(HOOK_CODE, on_hint::<B> as *mut c_void, (*hint).into(), (*hint).into())?;
            }
            check("uc_context_alloc", (self.api.context_alloc)(self.handle, &raw mut self.context))
        }
    }

    /// The bus.
    #[must_use]
    pub fn bus(&self) -> &B {
        &self.bus
    }

    /// The memory.
    #[must_use]
    pub fn memory(&self) -> Memory {
        Memory { handle: self.handle, read: self.api.mem_read, write: self.api.mem_write }
    }

    /// A register of the core. `R0` and the number behind it are one register of r0 to r12.
    #[must_use]
    pub fn get(&self, register: Register, behind: u8) -> u32 {
        let mut value = 0u64;
        let number = register as c_int + c_int::from(behind);
        // SAFETY: the value is as long as the longest register that is asked for.
        unsafe { (self.api.reg_read)(self.handle, number, (&raw mut value).cast()) };
        value as u32
    }

    /// Sets a register of the core.
    pub fn set(&self, register: Register, behind: u8, value: u32) {
        let value = u64::from(value);
        let number = register as c_int + c_int::from(behind);
        // SAFETY: as above.
        unsafe { (self.api.reg_write)(self.handle, number, (&raw const value).cast()) };
    }

    /// Keeps all registers of the core.
    pub fn keep(&self) {
        // SAFETY: the context is one of this processor.
        unsafe { (self.api.context_save)(self.handle, self.context) };
    }

    /// Gives back the registers that were kept.
    pub fn restore(&self) {
        // SAFETY: as above.
        unsafe { (self.api.context_restore)(self.handle, self.context) };
    }

    /// Runs from this address on until a callback stops it. False: an access to no memory or an instruction that is none
    /// has ended the run.
    pub fn run(&self, from: u32) -> bool {
        // SAFETY: no callback unwinds, and the end is an address where no code is.
        unsafe { (self.api.emu_start)(self.handle, (from | 1).into(), 0xFFFF_FFF0, 0, 0) == 0 }
    }
}

impl<B: Bus> Drop for Unicorn<B> {
    fn drop(&mut self) {
        // SAFETY: nothing uses context or processor afterwards: the memory's owner is the bus, which goes with it.
        unsafe {
            (self.api.context_free)(self.context);
            (self.api.close)(self.handle);
        }
    }
}

fn check(what: &str, error: c_int) -> Result<(), String> {
    if error == 0 { Ok(()) } else { Err(format!("{what}: error {error} of Unicorn")) }
}

//! The registers on a host: each access goes to the simulated [`Core`](super::Core). Addresses and values are
//! those of the chips. A register that the driver uses for the first time is added to the list at the end.

use core::marker::PhantomData;

pub use registers::otg_v1::{RW, regs, vals};

/// A register.
pub struct Reg<T, A = RW>(*mut T, PhantomData<A>);

impl<T: Copy, A> Reg<T, A> {
    /// The register at this address.
    ///
    /// # Safety
    /// Any address is safe here: the simulated core alone sees the address. The function is unsafe because that of a chip is.
    pub const unsafe fn from_ptr(address: *mut T) -> Self {
        Self(address, PhantomData)
    }

    /// Reads the register.
    pub fn read(&self) -> T {
        super::read(self.0.cast())
    }

    /// Writes the register.
    pub fn write_value(&self, value: T) {
        super::write(self.0.cast(), value);
    }

    /// Writes what this makes of the default value.
    pub fn write<R>(&self, set: impl FnOnce(&mut T) -> R) -> R
    where
        T: Default,
    {
        let mut value = T::default();
        let result = set(&mut value);
        self.write_value(value);
        result
    }

    /// Writes what this makes of the value that the register has.
    pub fn modify<R>(&self, change: impl FnOnce(&mut T) -> R) -> R {
        let mut value = self.read();
        let result = change(&mut value);
        self.write_value(value);
        result
    }
}

/// The registers of the core.
#[derive(Clone, Copy)]
pub struct Otg(registers::otg_v1::Otg);

macro_rules! list {
    ($($name:ident $([$index:ident])?: $value:ty,)*) => {
        #[allow(missing_docs, reason = "names of the chip's manual")]
        impl Otg {
            $(pub const fn $name(self $(, $index: usize)?) -> Reg<$value> {
                Reg(self.0.$name($($index)?).as_ptr(), PhantomData)
            })*
        }
    };
}

impl Otg {
    /// The registers at this address.
    ///
    /// # Safety
    /// As [`Reg::from_ptr`].
    pub const unsafe fn from_ptr(address: *mut ()) -> Self {
        // SAFETY: no access reaches the memory.
        Self(unsafe { registers::otg_v1::Otg::from_ptr(address) })
    }

    /// Their address.
    pub const fn as_ptr(&self) -> *mut () {
        self.0.as_ptr()
    }
}

list! {
    daint: regs::Daint,
    daintmsk: regs::Daintmsk,
    dcfg: regs::Dcfg,
    dctl: regs::Dctl,
    diepctl[n]: regs::Diepctl,
    diepempmsk: regs::Diepempmsk,
    diepint[n]: regs::Diepint,
    diepmsk: regs::Diepmsk,
    dieptsiz[n]: regs::Dieptsiz,
    dieptxf[n]: regs::Fsiz,
    dieptxf0: regs::Fsiz,
    doepctl[n]: regs::Doepctl,
    doepdma[n]: u32,
    doepint[n]: regs::Doepint,
    doepmsk: regs::Doepmsk,
    doeptsiz[n]: regs::Doeptsiz,
    dsts: regs::Dsts,
    dtxfsts[n]: regs::Dtxfsts,
    fifo[n]: regs::Fifo,
    gahbcfg: regs::Gahbcfg,
    gccfg_v1: regs::GccfgV1,
    gccfg_v2: regs::GccfgV2,
    gccfg_v3: regs::GccfgV3,
    gintmsk: regs::Gintmsk,
    gintsts: regs::Gintsts,
    gotgctl: regs::Gotgctl,
    gotgint: regs::Gotgint,
    grstctl: regs::Grstctl,
    grxfsiz: regs::Grxfsiz,
    grxstsp: regs::Grxsts,
    gusbcfg: regs::Gusbcfg,
    hwcfg4: regs::Ghwcfg4,
    pcgcctl: regs::Pcgcctl,
}

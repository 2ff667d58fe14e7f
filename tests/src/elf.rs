//! Reads a firmware's ELF: how much memory the firmware takes, and which of its functions can
//! panic.
//!
//! The facts come from the linked machine code, and not from messages of the build.

use object::{Object, ObjectSection, ObjectSymbol, SectionFlags, SymbolKind, elf};
use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::Path;

/// A firmware, as linked for an Arm Cortex-M.
pub struct Firmware {
    /// Bytes of the image in flash: vectors, code, constants, and the initial values of variables.
    pub flash_bytes: u64,
    /// Bytes of static variables, including those that a restart does not clear.
    pub static_bytes: u64,
    symbols: BTreeMap<String, u64>,
    functions: Vec<Function>,
    /// Addresses where instructions (`true`) or data (`false`) begin: the Arm ELF's mapping
    /// symbols.
    mapping: BTreeMap<u64, bool>,
    text: Vec<(u64, Vec<u8>)>,
    /// Addresses in the vector table after the initial stack pointer and the reset handler.
    handlers: Vec<u64>,
}

struct Function {
    name: String,
    start: u64,
    length: u64,
}

impl Firmware {
    /// Reads an ELF.
    ///
    /// # Errors
    /// If the file cannot be read, or is not an ELF.
    pub fn read(path: &Path) -> io::Result<Self> {
        let bytes = std::fs::read(path)?;
        let invalid = |error| io::Error::new(io::ErrorKind::InvalidData, error);
        let file = object::File::parse(&bytes[..]).map_err(invalid)?;
        let (mut flash_bytes, mut static_bytes, mut text) = (0, 0, Vec::new());
        let mut handlers = Vec::new();
        for section in file.sections() {
            let SectionFlags::Elf { sh_flags, .. } = section.flags() else { continue };
            let has = |flag: u32| sh_flags & u64::from(flag) != 0;
            if !has(elf::SHF_ALLOC) {
                continue;
            }
            if section.name() == Ok(".vector_table") {
                let (words, _) = section.data().map_err(invalid)?.as_chunks::<4>();
                let words = words.iter().skip(2).map(|word| u32::from_le_bytes(*word));
                // Bit 0 of an address means Thumb; 0 stands for an interrupt that the chip lacks.
                handlers =
                    words.filter(|&word| word != 0).map(|word| u64::from(word & !1)).collect();
            }
            let is_filled = section.file_range().is_some();
            flash_bytes += if is_filled { section.size() } else { 0 };
            static_bytes += if has(elf::SHF_WRITE) { section.size() } else { 0 };
            if has(elf::SHF_EXECINSTR) {
                text.push((section.address(), section.data().map_err(invalid)?.to_vec()));
            }
        }
        let named = |symbol: &object::Symbol<'_, '_>| symbol.name().map(str::to_owned).ok();
        let symbols = file.symbols().filter_map(|s| Some((named(&s)?, s.address()))).collect();
        let functions = file
            .symbols()
            .filter(|symbol| symbol.kind() == SymbolKind::Text && symbol.size() > 0)
            .filter_map(|symbol| {
                // Bit 0 of an address means Thumb.
                let (start, length) = (symbol.address() & !1, symbol.size());
                Some(Function { name: plain(&named(&symbol)?), start, length })
            })
            .collect();
        let mapping = file.symbols().filter_map(|symbol| match symbol.name().ok()?.get(..2)? {
            "$t" => Some((symbol.address(), true)),
            "$d" => Some((symbol.address(), false)),
            _ => None,
        });
        let mapping: BTreeMap<u64, bool> = mapping.collect();
        if !mapping.values().any(|&is_code| is_code) {
            return Err(io::Error::new(io::ErrorKind::InvalidData, "stripped: no mapping symbols"));
        }
        Ok(Self { flash_bytes, static_bytes, symbols, functions, mapping, text, handlers })
    }

    /// Address of a symbol.
    #[must_use]
    pub fn symbol(&self, name: &str) -> Option<u64> {
        self.symbols.get(name).copied()
    }

    /// Mangled names that contain any of `parts`.
    #[must_use]
    pub fn symbols_with(&self, parts: &[&str]) -> Vec<&str> {
        let wanted = |name: &&str| parts.iter().any(|part| name.contains(part));
        self.symbols.keys().map(String::as_str).filter(wanted).collect()
    }

    /// Pairs of a function and a function that it calls by a branch to a fixed address, where both
    /// names satisfy their condition. Rust calls its panic functions only in this way.
    #[must_use]
    pub fn calls(
        &self,
        is_caller: impl Fn(&str) -> bool,
        is_called: impl Fn(&str) -> bool,
    ) -> BTreeSet<(&str, &str)> {
        let called: BTreeMap<u64, &str> = self
            .functions
            .iter()
            .filter(|function| is_called(&function.name))
            .map(|function| (function.start, function.name.as_str()))
            .collect();
        let callers = self.functions.iter().filter(|function| is_caller(&function.name));
        callers
            .flat_map(|caller| self.branches(caller).map(|target| (caller.name.as_str(), target)))
            .filter_map(|(caller, target)| Some((caller, *called.get(&target)?)))
            .collect()
    }

    /// The function to which the first branch of the function with this name leads, of those that
    /// lead to the beginning of a function.
    #[must_use]
    pub fn first_call(&self, name: &str) -> Option<&str> {
        let caller = self.functions.iter().find(|function| function.name.contains(name))?;
        let called = |target| self.functions.iter().find(|function| function.start == target);
        self.branches(caller).find_map(called).map(|function| function.name.as_str())
    }

    /// Functions that an interrupt or a fault runs: the handlers in the vector table, and what they
    /// call by branches to fixed addresses. A waker's call through a pointer is not followed.
    #[must_use]
    pub fn run_by_interrupts(&self) -> BTreeSet<&str> {
        let starts: BTreeMap<u64, &Function> =
            self.functions.iter().map(|function| (function.start, function)).collect();
        let mut found = BTreeSet::new();
        let mut open = self.handlers.clone();
        while let Some(address) = open.pop() {
            let Some(function) = starts.get(&address) else { continue };
            if found.insert(function.name.as_str()) {
                open.extend(self.branches(function));
            }
        }
        found
    }

    /// Addresses of instructions of the floating-point unit, each with its function.
    #[must_use]
    pub fn float_instructions(&self) -> Vec<(u64, &str)> {
        self.instructions(is_float)
    }

    /// Addresses of instructions that set the limit of the main stack (`MSR MSPLIM`, ARMv8-M ARM),
    /// each with its function.
    #[must_use]
    pub fn stack_limit_instructions(&self) -> Vec<(u64, &str)> {
        self.instructions(|first, second| first & 0xFFF0 == 0xF380 && second == 0x880A)
    }

    fn instructions(&self, is_wanted: impl Fn(u16, u16) -> bool) -> Vec<(u64, &str)> {
        let name = |address: u64| {
            let within = |f: &&Function| (f.start..f.start + f.length).contains(&address);
            self.functions.iter().find(within).map_or("?", |function| function.name.as_str())
        };
        let mut found = Vec::new();
        for (base, bytes) in &self.text {
            let half = |address: u64| {
                let at = usize::try_from(address - base).ok()?;
                Some(u16::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
            };
            let end = base + bytes.len() as u64;
            let mut starts = self.mapping.range(base..&end).peekable();
            while let Some((&start, &is_code)) = starts.next() {
                let stop = starts.peek().map_or(end, |(next, _)| **next);
                let mut address = start;
                while is_code
                    && address < stop
                    && let Some(first) = half(address)
                {
                    let is_wide = first >= 0xE800;
                    if is_wide && half(address + 2).is_some_and(|second| is_wanted(first, second)) {
                        found.push((address, name(address)));
                    }
                    address += if is_wide { 4 } else { 2 };
                }
            }
        }
        found
    }

    /// Targets of a function's branches without a condition. A constant between instructions may
    /// look like a branch; such a constant almost never points to the first byte of a function.
    fn branches(&self, function: &Function) -> impl Iterator<Item = u64> {
        let words = |address: u64| {
            self.text.iter().find_map(|(base, bytes)| {
                let at = usize::try_from(address.checked_sub(*base)?).ok()?;
                let half = |at: usize| Some(u16::from_le_bytes(*bytes.get(at..)?.first_chunk()?));
                Some((half(at)?, half(at + 2)?))
            })
        };
        let steps = (function.start..function.start + function.length).step_by(2);
        steps.filter_map(move |address| branch(address, words(address)?))
    }
}

/// A name without the hash of its crate.
fn plain(mangled: &str) -> String {
    format!("{:#}", rustc_demangle::demangle(mangled))
}

/// Target of a `BL` (T1), `B.W` (T4) or short `B` (T2) at this address (Armv8-M Architecture
/// Reference Manual, C2.4).
fn branch(address: u64, (first, second): (u16, u16)) -> Option<u64> {
    if first & 0xF800 == 0xE000 {
        let offset = (i64::from(first & 0x7FF) << 53 >> 53) * 2;
        return Some((address + 4).wrapping_add_signed(offset));
    }
    let is_branch = first & 0xF800 == 0xF000 && second & 0x9000 == 0x9000;
    if !is_branch {
        return None;
    }
    let bit = |word: u16, at: u16| u32::from(word >> at & 1);
    let sign = bit(first, 10);
    let i1 = u32::from(bit(second, 13) == sign);
    let i2 = u32::from(bit(second, 11) == sign);
    let offset = sign << 24
        | i1 << 23
        | i2 << 22
        | u32::from(first & 0x3FF) << 12
        | u32::from(second & 0x7FF) << 1;
    let offset = (offset << 7) as i32 >> 7;
    Some((address + 4).wrapping_add_signed(i64::from(offset)))
}

/// Whether an instruction of two halves is for coprocessor 10 or 11, the floating-point unit
/// (Armv8-M Architecture Reference Manual, C2.3).
fn is_float(first: u16, second: u16) -> bool {
    first & 0xEC00 == 0xEC00 && matches!(second >> 8 & 0xF, 0xA | 0xB)
}

#[cfg(test)]
mod tests {
    use super::{branch, is_float};

    /// Encodings from other disassemblers: `vadd.f32 s0, s0, s1`, `vmov r0, s0`, `vldr d0, [r0]`;
    /// then `bl` and `ldrd`.
    #[test]
    fn arithmetic_of_the_floating_point_unit_is_told_from_other_instructions() {
        for (first, second) in [(0xEE30, 0x0A20), (0xEE10, 0x0A10), (0xED90, 0x0B00)] {
            assert!(is_float(first, second), "{first:04x} {second:04x}");
        }
        for (first, second) in [(0xF000, 0xFB9F), (0xE9D0, 0x0A00)] {
            assert!(!is_float(first, second), "{first:04x} {second:04x}");
        }
    }

    /// Encodings from other disassemblers: `bl` forwards and back, and instructions that are not
    /// branches.
    #[test]
    fn branches_lead_where_a_disassembler_says() {
        assert_eq!(branch(0x1000_AB1E, (0xF000, 0xFB9F)), Some(0x1000_B260));
        assert_eq!(branch(0x0800_1000, (0xF7FF, 0xFFFE)), Some(0x0800_1000));
        assert_eq!(branch(0x1000, (0xE7FE, 0)), Some(0x1000));
        assert_eq!(branch(0x1000, (0xE001, 0)), Some(0x1006));
        assert_eq!(branch(0, (0x4770, 0xBF00)), None);
        // A conditional branch has a shorter range and never calls a panic.
        assert_eq!(branch(0, (0xF000, 0x8001)), None);
    }
}

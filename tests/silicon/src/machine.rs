//! The chip as a whole: memory with the ELF, the processor, interrupts and exceptions, time.
//!
//! Assumed: an instruction takes [`CLOCKS_AN_INSTRUCTION`] clocks of the core; entry into an interrupt and the way back cost
//! nothing beside their instructions; interrupts wait for the end of a run of instructions without a branch. Not modelled:
//! priorities (all interrupts have one), tail chaining, lazy stacking, caches, wait states, the MPU, TrustZone.

use crate::chip::{Cause, Chip, Connected};
use crate::unicorn::{Bus, Memory, Register, Unicorn};
use crate::usb::Usb;
use object::{Object, ObjectSection, ObjectSegment, ObjectSymbol};
use std::cell::{Cell, RefCell};
use std::collections::HashMap;
use std::path::Path;

/// Clocks of the core for an instruction, on average: an estimate, that of `docs/log/firmware.md`.
pub const CLOCKS_AN_INSTRUCTION: f64 = 1.3;

const FLASH: u32 = 0x0800_0000;
const FLASH_BYTES: usize = 4 << 20;
const RAM: u32 = 0x2000_0000;
const RAM_BYTES: usize = 0x27_0000;
/// System memory: boot loader, identity of the chip.
const SYSTEM: u32 = 0x0BF9_0000;
const SYSTEM_BYTES: usize = 0x2_0000;
const UID: u32 = 0x0BFA_0700;
/// Where a return from an exception jumps to.
const RETURNS: u32 = 0xFFFF_F000;
/// The return address of an exception in thread mode on the main stack.
const TO_THREAD: u32 = 0xFFFF_FFF9;
/// Words of an exception's frame with the registers of floating point.
const FRAME_WORDS: u32 = 26;

const WFE: [u8; 2] = [0x20, 0xBF];
const SEV: [u8; 2] = [0x40, 0xBF];

/// How long the processor runs at most before the world is looked at, in instructions.
const SLICE: u64 = 20_000;
/// The same while interrupts are pending and disabled.
const MASKED_SLICE: u64 = 20;

/// Why the machine stands.
#[derive(Debug, Clone, PartialEq)]
pub enum Stop {
    /// The time is over.
    Time,
    /// The chip starts again. The machine goes on from there.
    Reset(Cause),
    /// The boot loader of the chip has been entered; with the processor's stack limit and vector table.
    BootLoader { stack: u32, vectors: u32 },
    /// The processor stands for ever, for this reason.
    Lockup(String),
}

/// What the processor found at the end of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum End {
    Slice,
    Hint([u8; 2]),
    Return,
    Fault(u32),
}

/// The bus, as callbacks reach it.
pub struct Shared {
    pub chip: RefCell<Chip>,
    instructions: Cell<u64>,
    limit: Cell<u64>,
    end: Cell<End>,
    /// Time and count of instructions at which the clock's frequency changed last, and the time of an instruction.
    base_ps: Cell<u64>,
    base: Cell<u64>,
    instruction_ps: Cell<f64>,
    code: Vec<u8>,
    /// Bytes and instructions of the block that was seen last at each half word of the code.
    counts: RefCell<Vec<(u32, u32)>>,
    unmapped: Cell<u32>,
}

impl Shared {
    fn now(&self) -> u64 {
        let passed = (self.instructions.get() - self.base.get()) as f64 * self.instruction_ps.get();
        self.base_ps.get() + passed as u64
    }

    /// Lets time go on without instructions.
    fn jump(&self, to_ps: u64) {
        self.base_ps.set(to_ps.max(self.now()));
        self.base.set(self.instructions.get());
    }

    fn new_clock(&self, hz: f64) {
        self.jump(self.now());
        self.instruction_ps.set(CLOCKS_AN_INSTRUCTION * 1e12 / hz);
    }

    fn until(&self, ps: u64) -> u64 {
        let left = ps.saturating_sub(self.now()) as f64 / self.instruction_ps.get();
        self.instructions.get() + (left as u64).saturating_add(1)
    }

    fn count(&self, address: u32, bytes: u32) -> u32 {
        let from = address.wrapping_sub(FLASH) as usize;
        let mut counts = self.counts.borrow_mut();
        let (Some(known), Some(code)) =
            (counts.get_mut(from / 2), self.code.get(from..from + bytes as usize))
        else {
            return bytes / 2;
        };
        if known.0 != bytes {
            *known = (bytes, instructions_of(code));
        }
        known.1
    }
}

/// Instructions in this code. Words of 32 bits begin with 0b11101, 0b11110 or 0b11111 (ARMv8-M ARM, C2.2).
fn instructions_of(code: &[u8]) -> u32 {
    let (mut at, mut count) = (0, 0);
    while at + 1 < code.len() {
        at += if code[at + 1] >> 3 >= 0b11101 { 4 } else { 2 };
        count += 1;
    }
    count
}

impl Bus for Shared {
    fn read(&self, address: u32, bytes: u32) -> u32 {
        let mut chip = self.chip.borrow_mut();
        chip.now = self.now();
        chip.read(address, bytes)
    }

    fn write(&self, address: u32, bytes: u32, value: u32) {
        let mut chip = self.chip.borrow_mut();
        chip.now = self.now();
        chip.write(address, bytes, value);
        if std::mem::take(&mut chip.clock_changed) {
            let hz = chip.core_hz();
            self.new_clock(hz);
        }
        // What the write has begun may be due before the end of this run.
        let due = if chip.reset.is_some() || chip.interrupt().is_some() { 0 } else { chip.due() };
        self.limit.set(self.limit.get().min(self.until(due)));
    }

    fn block(&self, address: u32, bytes: u32) -> bool {
        let instructions = self.instructions.get();
        if instructions >= self.limit.get() {
            return true;
        }
        self.instructions.set(instructions + u64::from(self.count(address, bytes)));
        false
    }

    fn hint(&self, address: u32) -> bool {
        let at = address.wrapping_sub(FLASH) as usize;
        if let Some(&[low, high]) = self.code.get(at..at + 2) {
            self.end.set(End::Hint([low, high]));
        }
        true
    }

    fn exception(&self, number: u32) {
        // QEMU's `EXCP_EXCEPTION_EXIT`.
        self.end.set(if number == 8 { End::Return } else { End::Fault(number) });
    }

    fn unmapped(&self, address: u32) {
        self.unmapped.set(address);
    }
}

/// The machine.
pub struct Machine {
    processor: Unicorn<Shared>,
    pc: u32,
    event: bool,
    active: Option<usize>,
    /// Where the stack may be.
    stack: std::ops::Range<u32>,
    /// Bytes of stack to begin with, in place of all.
    stack_room: Option<u32>,
    image: Vec<(u32, Vec<u8>)>,
    /// The supply is too low to run.
    held: bool,
    /// Restarts of the chip so far: time in microseconds, cause, where the processor was.
    pub resets: Vec<(u64, Cause, u32)>,
}

const PAINT: u8 = 0xA5;

impl Machine {
    /// Powers up with this ELF in the flash.
    ///
    /// # Errors
    /// In words, if library or ELF cannot be read.
    pub fn new(
        library: &Path,
        elf: &Path,
        plugged: bool,
        stack_room: Option<u32>,
        connected: Connected,
    ) -> Result<Self, String> {
        let bytes = std::fs::read(elf).map_err(|error| format!("{}: {error}", elf.display()))?;
        let file =
            object::File::parse(&*bytes).map_err(|error| format!("{}: {error}", elf.display()))?;
        let text = file.section_by_name(".text").ok_or("no .text")?;
        let (start, code) =
            (text.address() as u32, text.data().map_err(|error| error.to_string())?);
        let hints: Vec<u32> = (0..code.len() - 1)
            .step_by(2)
            .filter(|&at| code[at..at + 2] == WFE || code[at..at + 2] == SEV)
            .map(|at| start + at as u32)
            .collect();
        let mut flash = vec![0xFF; (start - FLASH) as usize];
        flash.extend(code);
        let memories =
            [(FLASH, FLASH_BYTES), (RAM, RAM_BYTES), (SYSTEM, SYSTEM_BYTES), (RETURNS, 0x1000)];
        let processor = Unicorn::new(library, &memories, &hints, |memory: Memory| Shared {
            chip: RefCell::new(Chip::new(memory, Usb::new(memory, plugged), connected)),
            instructions: Cell::new(0),
            limit: Cell::new(0),
            end: Cell::new(End::Slice),
            base_ps: Cell::new(0),
            base: Cell::new(0),
            instruction_ps: Cell::new(CLOCKS_AN_INSTRUCTION * 1e12 / 4e6),
            counts: RefCell::new(vec![(0, 0); flash.len() / 2 + 1]),
            code: flash,
            unmapped: Cell::new(0),
        })?;
        let mut image = Vec::new();
        for segment in file.segments() {
            let data = segment.data().map_err(|error| error.to_string())?;
            if data.is_empty() {
                continue;
            }
            // The address at which the flash holds it, which is not where it runs.
            let place =
                physical(&file, segment.address(), &bytes).unwrap_or(segment.address() as u32);
            image.push((place, data.to_vec()));
        }
        let symbols: HashMap<String, u32> = file
            .symbols()
            .filter_map(|symbol| Some((symbol.name().ok()?.to_owned(), symbol.address() as u32)))
            .collect();
        let stack = symbols.get("_stack_end").copied().unwrap_or(RAM)..symbols["_stack_start"];
        let mut machine = Self {
            processor,
            pc: 0,
            event: false,
            active: None,
            stack,
            stack_room,
            image,
            held: false,
            resets: Vec::new(),
        };
        machine.power_up();
        Ok(machine)
    }

    fn power_up(&mut self) {
        let memory = self.processor.memory();
        let write = |address: u32, bytes: &[u8]| assert!(memory.put(address, bytes), "memory");
        write(FLASH, &vec![0xFF; FLASH_BYTES]);
        for (address, bytes) in &self.image {
            write(*address, bytes);
        }
        // Memory after power-up holds anything.
        write(RAM, &vec![PAINT; RAM_BYTES]);
        // An identity of the chip; the boot loader, which stands at a branch to itself.
        write(UID, &[0x31, 0x00, 0x4A, 0x00, 0x12, 0x51, 0x30, 0x36, 0x33, 0x37, 0x39, 0x32]);
        write(SYSTEM, &[0x00, 0x50, 0x00, 0x20, 0x09, 0x00, 0xF9, 0x0B, 0xFE, 0xE7]);
        self.start();
    }

    /// The processor's reset.
    fn start(&mut self) {
        let memory = self.processor.memory();
        let (stack, entry) = (memory.word(FLASH), memory.word(FLASH + 4));
        let stack = self.stack_room.map_or(stack, |room| self.stack.start + room);
        self.processor.set(Register::Control, 0, 0);
        self.processor.set(Register::Primask, 0, 0);
        self.processor.set(Register::Xpsr, 0, 1 << 24);
        self.processor.set(Register::Sp, 0, stack);
        self.processor.set(Register::Lr, 0, 0xFFFF_FFFF);
        self.pc = entry & !1;
        self.active = None;
        self.event = false;
        self.bus().new_clock(4e6);
        self.chip(|chip| chip.clock_changed = false);
    }

    fn bus(&self) -> &Shared {
        self.processor.bus()
    }

    /// The chip.
    pub fn chip<T>(&self, of: impl FnOnce(&mut Chip) -> T) -> T {
        of(&mut self.bus().chip.borrow_mut())
    }

    /// Time since power-up in microseconds.
    #[must_use]
    pub fn now_us(&self) -> f64 {
        self.bus().now() as f64 / 1e6
    }

    /// The memory, for a look into it.
    #[must_use]
    pub fn memory(&self) -> Memory {
        self.processor.memory()
    }

    /// Where the processor is.
    #[must_use]
    pub fn pc(&self) -> u32 {
        self.pc
    }

    /// Sends the processor astray: the next instruction is at this address.
    pub fn derail(&mut self, address: u32) {
        self.pc = address;
    }

    /// Lets the processor go round in a loop for ever, with interrupts off.
    ///
    /// # Panics
    /// If there is no flash.
    pub fn stand_still(&mut self) {
        let last = FLASH + FLASH_BYTES as u32 - 4;
        assert!(self.memory().put(last, &[0xFE, 0xE7]), "memory");
        self.processor.set(Register::Primask, 0, 1);
        self.derail(last);
    }

    /// The crystal stops. A processor without its clock security system stands still.
    pub fn stop_crystal(&mut self) {
        if self.chip(Chip::stop_crystal) {
            self.bus().new_clock(4e6);
            self.derail(self.vector(2));
        } else {
            self.stand_still();
        }
    }

    /// How deep the stack has been, in bytes, and how deep it may be.
    #[must_use]
    pub fn deepest_stack(&self) -> (u32, u32) {
        let length = self.stack.end - self.stack.start;
        let bytes = self.memory().get(self.stack.start, length as usize).unwrap_or_default();
        // cortex-m-rt may paint it too.
        let paint = bytes.first().copied().unwrap_or(PAINT);
        let untouched = bytes.iter().take_while(|byte| **byte == paint).count() as u32;
        (length - untouched, length)
    }

    /// Everything that a rule forbids and that has happened.
    #[must_use]
    pub fn violations(&self) -> Vec<String> {
        self.chip(|chip| {
            let mut all = chip.violations.clone();
            all.extend(chip.usb.wrong());
            all
        })
    }

    /// Runs for so many microseconds of the chip's time.
    pub fn run_us(&mut self, us: f64) -> Stop {
        let end = self.bus().now() + (us * 1e6) as u64;
        self.run_until(end, |_| false)
    }

    /// Runs until `done` says so, which is asked when the chip rests or the host has moved; false if the time is over, in
    /// microseconds, or the machine stands. A reset of the chip does not end that.
    pub fn run_while(&mut self, us: f64, done: impl FnMut(&Chip) -> bool) -> bool {
        let end = self.bus().now() + (us * 1e6) as u64;
        let mut done = done;
        let mut is_done = false;
        loop {
            let stop = self.run_until(end, |chip| {
                is_done = done(chip);
                is_done
            });
            match stop {
                Stop::Reset(_) => {}
                _ => return is_done,
            }
        }
    }

    fn run_until(&mut self, end_ps: u64, mut done: impl FnMut(&Chip) -> bool) -> Stop {
        loop {
            if self.chip(|chip| chip.is_browned_out()) {
                if !self.held {
                    self.held = true;
                    self.resets.push((self.bus().now() / 1_000_000, Cause::BrownOut, self.pc));
                    self.chip(|chip| chip.restart(Cause::BrownOut));
                    self.start();
                }
                self.bus().jump(end_ps);
                return Stop::Time;
            }
            self.held = false;
            let now = self.bus().now();
            let (due, reset) = self.chip(|chip| {
                chip.now = now;
                chip.advance();
                (chip.due(), chip.reset.take())
            });
            if let Some(cause) = reset {
                self.resets.push((now / 1_000_000, cause, self.pc));
                self.chip(|chip| chip.restart(cause));
                self.start();
                return Stop::Reset(cause);
            }
            if now >= end_ps || self.chip(|chip| done(chip)) {
                return Stop::Time;
            }
            let masked = self.enter_interrupt();
            let bus = self.bus();
            let slice = if masked { MASKED_SLICE } else { SLICE };
            bus.limit.set(bus.until(due.min(end_ps)).min(bus.instructions.get() + slice));
            bus.end.set(End::Slice);
            let whole = self.processor.run(self.pc);
            self.pc = self.processor.get(Register::Pc, 0) & !1;
            if let Some(stop) = self.after_run(whole, due.min(end_ps)) {
                return stop;
            }
        }
    }

    /// Does what the end of a run asks for.
    fn after_run(&mut self, whole: bool, due: u64) -> Option<Stop> {
        if (SYSTEM..SYSTEM + SYSTEM_BYTES as u32).contains(&self.pc) {
            let vectors = self.chip(|chip| chip.vectors());
            return Some(Stop::BootLoader { stack: self.processor.get(Register::Sp, 0), vectors });
        }
        match self.bus().end.get() {
            End::Slice if whole => {}
            End::Slice => {
                let address = self.bus().unmapped.get();
                // A bus fault with a valid address, forced to a HardFault.
                return self.hard_fault(0x0000_8200, &format!("no memory at {address:#010x}"));
            }
            End::Hint(SEV) => {
                self.pc += 2;
                self.event = true;
            }
            End::Hint(_) => {
                self.pc += 2;
                if !std::mem::take(&mut self.event) && self.chip(Chip::interrupt).is_none() {
                    let due = due.max(self.bus().now() + 100_000);
                    self.bus().jump(due);
                }
            }
            End::Return => self.leave_interrupt(),
            End::Fault(number) => {
                // QEMU's numbers of `target/arm/cpu.h`.
                let (status, what) = match number {
                    1 => (0x0001_0000, "no instruction".to_owned()),
                    3 => (0x0000_0100, "no code at the program counter".to_owned()),
                    19 => (0x0010_0000, "the stack is deeper than its limit".to_owned()),
                    other => (0, format!("exception {other} of the processor")),
                };
                return self.hard_fault(status, &what);
            }
        }
        None
    }

    /// Enters the next interrupt. Returns whether one waits and may not come.
    fn enter_interrupt(&mut self) -> bool {
        if self.active.is_some() {
            return false;
        }
        let Some(number) = self.chip(Chip::interrupt) else { return false };
        let within_if_then = self.processor.get(Register::Xpsr, 0) & 0x0600_FC00 != 0;
        if self.processor.get(Register::Primask, 0) & 1 == 1 || within_if_then {
            return true;
        }
        self.chip(|chip| chip.entered(number));
        self.processor.keep();
        // The registers that come back are those that are kept; the frame is for who looks at the stack.
        self.stack_frame();
        self.active = Some(number);
        self.event = true;
        self.pc = self.vector(16 + number);
        false
    }

    fn vector(&self, number: usize) -> u32 {
        let table = self.chip(|chip| chip.vectors());
        self.memory().word(table + 4 * number as u32) & !1
    }

    fn stack_frame(&mut self) {
        let sp = (self.processor.get(Register::Sp, 0) - 4 * FRAME_WORDS) & !7;
        let mut words: Vec<u32> =
            (0..4).map(|number| self.processor.get(Register::R0, number)).collect();
        words.push(self.processor.get(Register::R0, 12));
        words.push(self.processor.get(Register::Lr, 0));
        words.push(self.pc);
        words.push(self.processor.get(Register::Xpsr, 0));
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let _ = self.memory().put(sp, &bytes);
        self.processor.set(Register::Sp, 0, sp);
        self.processor.set(Register::Lr, 0, TO_THREAD);
    }

    fn leave_interrupt(&mut self) {
        if self.active.take().is_none() {
            return;
        }
        self.processor.restore();
        self.pc = self.processor.get(Register::Pc, 0) & !1;
        // Return from an exception sets the event register (ARMv8-M ARM, B3.33).
        self.event = true;
    }

    fn hard_fault(&mut self, status: u32, what: &str) -> Option<Stop> {
        if self.active == Some(usize::MAX) {
            return Some(Stop::Lockup(format!(
                "{what} in the handler of a fault, at {:#010x}",
                self.pc
            )));
        }
        self.chip(|chip| chip.fault_status = status);
        self.stack_frame();
        self.active = Some(usize::MAX);
        self.pc = self.vector(3);
        None
    }
}

/// The address in the flash of what runs at another address: `p_paddr`.
fn physical(file: &object::File<'_>, address: u64, bytes: &[u8]) -> Option<u32> {
    use object::read::elf::{FileHeader, ProgramHeader};
    let object::File::Elf32(_) = file else { return None };
    let header = object::elf::FileHeader32::<object::Endianness>::parse(bytes).ok()?;
    let endian = header.endian().ok()?;
    let found = header.program_headers(endian, bytes).ok()?.iter().find(|program| {
        u64::from(program.p_vaddr(endian)) == address && program.p_filesz(endian) > 0
    })?;
    Some(found.p_paddr(endian))
}

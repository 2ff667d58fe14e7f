//! Runs a kernel, workgroup after workgroup on each core, warp after warp.
//!
//! The 32 units of a warp each have their own next instruction. Those with the lowest one go first,
//! so units that part at a branch meet again behind it. A unit at a barrier waits for all others.

#![expect(unsafe_code, reason = "the kernel's addresses are those of the host's memory")]

mod arithmetic;

use crate::ptx::{Instruction, Kernel, Kind, Memory, Op, Place, Space, Unknown};
use arithmetic::{compute, f16_at};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;

/// Number of units of a warp.
const WARP: usize = 32;

/// A number of each unit of a warp.
type Lanes = [u64; WARP];

/// A kernel, and on what it runs.
#[derive(Debug, Clone, Copy)]
pub struct Launch<'a> {
    /// The kernel.
    pub kernel: &'a Kernel,
    /// Number of workgroups in each direction.
    pub groups: [u32; 3],
    /// Number of units of a workgroup in each direction.
    pub units: [u32; 3],
    /// Bytes of shared memory that the launch adds.
    pub shared_bytes: usize,
    /// The kernel's parameters.
    pub parameters: &'a [u8],
}

/// Runs a kernel to its end.
///
/// # Errors
/// [`Unknown`] if an instruction cannot be run: an address outside shared memory, or matrices of
/// which not all units of a warp have their part.
pub fn launch(work: &Launch<'_>) -> Result<(), Unknown> {
    let count = work.groups.iter().product::<u32>();
    let next = AtomicU32::new(0);
    let failed = Mutex::new(None);
    let threads = thread::available_parallelism().map_or(1, usize::from).min(count as usize);
    thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                loop {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    if number >= count {
                        return;
                    }
                    if let Err(error) = Group::new(work, number).run() {
                        next.store(count, Ordering::Relaxed);
                        *failed.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                        return;
                    }
                }
            });
        }
    });
    match failed.into_inner().unwrap_or_else(PoisonError::into_inner) {
        Some(error) => Err(error),
        None => Ok(()),
    }
}

/// A workgroup.
struct Group<'a> {
    work: &'a Launch<'a>,
    number: [u32; 3],
    shared: Vec<u8>,
    warps: Vec<Warp>,
}

/// A warp.
struct Warp {
    first: u32,
    registers: Vec<Lanes>,
    /// The next instruction of each unit; those that have ended are at [`usize::MAX`].
    next: [usize; WARP],
    waiting: [bool; WARP],
    local: Vec<u8>,
}

/// Why a warp no longer runs.
enum Pause {
    Barrier,
    End,
}

impl<'a> Group<'a> {
    fn new(work: &'a Launch<'a>, number: u32) -> Self {
        let [x, y, _] = work.groups;
        let units = work.units.iter().product::<u32>();
        let warp =
            |first| Warp {
                first,
                registers: vec![[0; WARP]; work.kernel.registers],
                next: std::array::from_fn(|lane| {
                    if first + (lane as u32) < units { 0 } else { usize::MAX }
                }),
                waiting: [false; WARP],
                local: vec![0; work.kernel.local_bytes * WARP],
            };
        Self {
            work,
            number: [number % x, number / x % y, number / x / y],
            // Full of NaN, so that a number that was never written is seen.
            shared: vec![0xff; work.kernel.shared_bytes + work.shared_bytes],
            warps: (0..units).step_by(WARP).map(warp).collect(),
        }
    }

    fn run(&mut self) -> Result<(), Unknown> {
        let mut warps = std::mem::take(&mut self.warps);
        loop {
            let mut waits = false;
            for warp in &mut warps {
                waits |= matches!(self.advance(warp)?, Pause::Barrier);
            }
            if !waits {
                return Ok(());
            }
            for warp in &mut warps {
                warp.waiting = [false; WARP];
            }
        }
    }

    /// Runs a warp until all its units wait at a barrier or have ended.
    fn advance(&mut self, warp: &mut Warp) -> Result<Pause, Unknown> {
        let kernel = self.work.kernel;
        loop {
            let runs = |lane: &usize| !warp.waiting[*lane] && warp.next[*lane] != usize::MAX;
            let Some(at) = (0..WARP).filter(runs).map(|lane| warp.next[lane]).min() else {
                let waits = warp.waiting.iter().any(|waiting| *waiting);
                return Ok(if waits { Pause::Barrier } else { Pause::End });
            };
            let active: [bool; WARP] =
                std::array::from_fn(|lane| runs(&lane) && warp.next[lane] == at);
            // Other units wait at a later instruction; here they are met again.
            let meets =
                (0..WARP).filter(runs).map(|lane| warp.next[lane]).filter(|&n| n > at).min();
            self.straight(warp, kernel, active, at, meets.unwrap_or(usize::MAX))?;
        }
    }

    /// Runs the active units from an instruction on, until they part, wait, or meet others.
    fn straight(
        &mut self,
        warp: &mut Warp,
        kernel: &Kernel,
        active: [bool; WARP],
        mut at: usize,
        meets: usize,
    ) -> Result<(), Unknown> {
        while at < meets {
            let Some(instruction) = kernel.instructions.get(at) else {
                return Err(Unknown("a kernel without an end".to_owned()));
            };
            let does = match instruction.guard {
                None => active,
                Some((register, wanted)) => std::array::from_fn(|lane| {
                    active[lane] && (warp.registers[register][lane] != 0) == wanted
                }),
            };
            match instruction.op {
                Op::Branch(_) | Op::Return | Op::Barrier => {
                    for lane in (0..WARP).filter(|&lane| active[lane]) {
                        warp.next[lane] = match (does[lane], instruction.op) {
                            (true, Op::Branch(to)) => to,
                            (true, Op::Return) => usize::MAX,
                            _ => at + 1,
                        };
                        warp.waiting[lane] = does[lane] && instruction.op == Op::Barrier;
                    }
                    return Ok(());
                }
                _ => self.execute(warp, instruction, does)?,
            }
            at += 1;
        }
        for lane in (0..WARP).filter(|&lane| active[lane]) {
            warp.next[lane] = at;
        }
        Ok(())
    }

    #[inline]
    fn value(&self, warp: &Warp, place: Place) -> Lanes {
        match place {
            Place::Register(register) => warp.registers[register],
            Place::Constant(value) => [value; WARP],
            other => self.special(warp, other),
        }
    }

    fn special(&self, warp: &Warp, place: Place) -> Lanes {
        let [x, y, _] = self.work.units;
        let each = |of: &dyn Fn(u32) -> u32| -> Lanes {
            std::array::from_fn(|lane| u64::from(of(warp.first + lane as u32)))
        };
        match place {
            Place::Register(_) | Place::Constant(_) => [0; WARP],
            Place::Unit(0) => each(&|unit| unit % x),
            Place::Unit(1) => each(&|unit| unit / x % y),
            Place::Unit(_) => each(&|unit| unit / x / y),
            Place::Units(direction) => [self.work.units[direction].into(); WARP],
            Place::Group(direction) => [self.number[direction].into(); WARP],
            Place::Groups(direction) => [self.work.groups[direction].into(); WARP],
            Place::Lane => std::array::from_fn(|lane| lane as u64),
        }
    }

    fn execute(
        &mut self,
        warp: &mut Warp,
        instruction: &Instruction,
        does: [bool; WARP],
    ) -> Result<(), Unknown> {
        let lanes = (0..WARP).filter(|&lane| does[lane]);
        match instruction.op {
            Op::Nothing => {}
            Op::Load(memory) => {
                let bytes = instruction.kind.bytes();
                let addresses = self.value(warp, memory.place);
                for lane in lanes {
                    for (part, &to) in instruction.to.iter().enumerate() {
                        let distance = memory.distance.wrapping_add((part * bytes) as u64);
                        let address = addresses[lane].wrapping_add(distance);
                        let mut number = self.read(warp, memory.space, address, bytes, lane)?;
                        if let Kind::Signed(bytes) = instruction.kind {
                            let unused = 64 - 8 * bytes as u32;
                            number = ((number << unused) as i64 >> unused) as u64;
                        }
                        warp.registers[to][lane] = number;
                    }
                }
            }
            Op::Store(memory) => {
                let bytes = instruction.kind.bytes();
                let addresses = self.value(warp, memory.place);
                for (part, &from) in instruction.from.iter().enumerate() {
                    let numbers = self.value(warp, from);
                    for lane in lanes.clone() {
                        let distance = memory.distance.wrapping_add((part * bytes) as u64);
                        let address = addresses[lane].wrapping_add(distance);
                        self.write(
                            warp,
                            memory.space,
                            address,
                            &numbers[lane].to_le_bytes()[..bytes],
                            lane,
                        )?;
                    }
                }
            }
            Op::LoadMatrix(memory) => {
                together(does)?;
                self.load_matrices(warp, memory, &instruction.to)?;
            }
            Op::MultiplyMatrices => {
                together(does)?;
                let from: Vec<Lanes> =
                    instruction.from.iter().map(|&place| self.value(warp, place)).collect();
                multiply(warp, &instruction.to, &from);
            }
            Op::Move if instruction.to.len() > 1 || instruction.from.len() > 1 => {
                // Registers of half the size, the lower one first.
                let from: Vec<Lanes> =
                    instruction.from.iter().map(|&place| self.value(warp, place)).collect();
                let bits = 8 * instruction.kind.bytes() / from.len().max(instruction.to.len());
                let mask = u64::MAX >> (64 - bits);
                for lane in lanes {
                    let whole = from.iter().rev().fold(0, |whole, part| {
                        if from.len() > 1 { whole << bits | part[lane] & mask } else { part[lane] }
                    });
                    for (part, &to) in instruction.to.iter().enumerate() {
                        let several = instruction.to.len() > 1;
                        warp.registers[to][lane] =
                            if several { whole >> (part * bits) & mask } else { whole };
                    }
                }
            }
            op => {
                let mut from = [[0; WARP]; 4];
                for (numbers, &place) in from.iter_mut().zip(&instruction.from) {
                    *numbers = self.value(warp, place);
                }
                let results = usual(op, instruction.kind, &from).unwrap_or_else(|| {
                    std::array::from_fn(|lane| {
                        compute(op, instruction.kind, from.map(|numbers| numbers[lane]))
                    })
                });
                let to = &mut warp.registers[instruction.to[0]];
                for lane in lanes {
                    to[lane] = results[lane];
                }
            }
        }
        Ok(())
    }

    fn read(
        &self,
        warp: &Warp,
        space: Space,
        address: u64,
        bytes: usize,
        lane: usize,
    ) -> Result<u64, Unknown> {
        let mut number = [0; 8];
        let from = match space {
            Space::Global => {
                // SAFETY: the kernel reads where the host allows it, as on a GPU.
                unsafe {
                    std::ptr::copy_nonoverlapping(address as *const u8, number.as_mut_ptr(), bytes);
                }
                return Ok(u64::from_le_bytes(number));
            }
            Space::Shared => self.shared.as_slice(),
            Space::Parameters => self.work.parameters,
            Space::Local => &warp.local[lane * self.work.kernel.local_bytes..],
        };
        let from = from.get(address as usize..).and_then(|rest| rest.get(..bytes));
        number[..bytes].copy_from_slice(from.ok_or_else(|| beyond(space, address))?);
        Ok(u64::from_le_bytes(number))
    }

    fn write(
        &mut self,
        warp: &mut Warp,
        space: Space,
        address: u64,
        number: &[u8],
        lane: usize,
    ) -> Result<(), Unknown> {
        let to = match space {
            Space::Global => {
                // SAFETY: the kernel writes where the host allows it, as on a GPU.
                unsafe {
                    std::ptr::copy_nonoverlapping(
                        number.as_ptr(),
                        address as *mut u8,
                        number.len(),
                    );
                }
                return Ok(());
            }
            Space::Shared => self.shared.as_mut_slice(),
            Space::Local => &mut warp.local[lane * self.work.kernel.local_bytes..],
            Space::Parameters => return Err(Unknown("a write to a parameter".to_owned())),
        };
        let to = to.get_mut(address as usize..).and_then(|rest| rest.get_mut(..number.len()));
        to.ok_or_else(|| beyond(space, address))?.copy_from_slice(number);
        Ok(())
    }

    /// `ldmatrix`: matrices of 8 x 8 numbers of 16 bits. Unit `8 m + r` names the address of row `r`
    /// of matrix `m`; afterwards unit `4 r + c` has columns `2 c` and `2 c + 1` of row `r` of each
    /// (PTX ISA, "Warp-level matrix load instruction: ldmatrix").
    fn load_matrices(&self, warp: &mut Warp, memory: Memory, to: &[usize]) -> Result<(), Unknown> {
        let addresses = self.value(warp, memory.place);
        for (matrix, &register) in to.iter().enumerate() {
            for lane in 0..WARP {
                let row = addresses[8 * matrix + lane / 4].wrapping_add(memory.distance);
                if !row.is_multiple_of(16) {
                    return Err(Unknown(format!("a row of a matrix at {row}, no multiple of 16")));
                }
                let at = row + 4 * (lane % 4) as u64;
                warp.registers[register][lane] = self.read(warp, Space::Shared, at, 4, lane)?;
            }
        }
        Ok(())
    }
}

/// The results of the most frequent instructions, in loops that the compiler can make vectors of;
/// the same numbers as those of [`compute`].
fn usual(op: Op, kind: Kind, [a, b, c, _]: &[Lanes; 4]) -> Option<Lanes> {
    let float = |numbers: &Lanes, lane: usize| f32::from_bits(numbers[lane] as u32);
    let bits = |number: f32| u64::from(number.to_bits());
    let word = |number: u64| u64::from(number as u32);
    Some(match (op, kind) {
        (Op::Move, _) => *a,
        (Op::Fused(false), Kind::F32) => {
            each(|lane| bits(float(a, lane).mul_add(float(b, lane), float(c, lane))))
        }
        (Op::Add, Kind::F32) => each(|lane| bits(float(a, lane) + float(b, lane))),
        (Op::Multiply, Kind::F32) => each(|lane| bits(float(a, lane) * float(b, lane))),
        (Op::Add, Kind::Unsigned(4) | Kind::Signed(4)) => {
            each(|lane| word(a[lane].wrapping_add(b[lane])))
        }
        (Op::Add, Kind::Unsigned(8) | Kind::Signed(8)) => {
            each(|lane| a[lane].wrapping_add(b[lane]))
        }
        (Op::MultiplyAdd, Kind::Unsigned(4) | Kind::Signed(4)) => {
            each(|lane| word(a[lane].wrapping_mul(b[lane]).wrapping_add(c[lane])))
        }
        (Op::MultiplyWide, Kind::Unsigned(4)) => {
            each(|lane| word(a[lane]).wrapping_mul(word(b[lane])))
        }
        (Op::And, Kind::Unsigned(4 | 8)) => each(|lane| a[lane] & b[lane]),
        (Op::Or, Kind::Unsigned(4 | 8)) => each(|lane| a[lane] | b[lane]),
        _ => return None,
    })
}

fn each(of: impl Fn(usize) -> u64) -> Lanes {
    std::array::from_fn(of)
}

/// `mma.m16n8k16`: D = A B + C (PTX ISA, "Matrix Fragments for mma.m16n8k16 with floating point
/// type"). `from` has four registers of A, two of B, four of C.
fn multiply(warp: &mut Warp, to: &[usize], from: &[Lanes]) {
    let mut a = [[0.0_f32; 16]; 16];
    let mut b = [[0.0_f32; 16]; 8];
    let registers = |lane: usize| from.iter().map(move |numbers| numbers[lane]);
    for lane in 0..WARP {
        let from: Vec<u64> = registers(lane).collect();
        let (group, within) = (lane / 4, lane % 4);
        for part in 0..8 {
            let row = group + 8 * (part / 2 % 2);
            let column = 2 * within + part % 2 + 8 * (part / 4);
            a[row][column] = f16_at(from[part / 2], part % 2);
        }
        for part in 0..4 {
            let row = 2 * within + part % 2 + 8 * (part / 2);
            b[group][row] = f16_at(from[4 + part / 2], part % 2);
        }
    }
    for lane in 0..WARP {
        let from: Vec<u64> = registers(lane).collect();
        for (part, &register) in to.iter().enumerate() {
            let (row, column) = (lane / 4 + 8 * (part / 2), 2 * (lane % 4) + part % 2);
            let before = f32::from_bits(from[6 + part] as u32);
            // Products of two f16 are exact in f32; the hardware's order of the sums is not known.
            let sum = a[row].iter().zip(&b[column]).fold(before, |sum, (a, b)| sum + a * b);
            warp.registers[register][lane] = u64::from(sum.to_bits());
        }
    }
}

/// Instructions on matrices need all units of a warp.
fn together(does: [bool; WARP]) -> Result<(), Unknown> {
    match does.iter().all(|does| *does) {
        true => Ok(()),
        false => Err(Unknown("matrices of which some units of a warp have no part".to_owned())),
    }
}

fn beyond(space: Space, address: u64) -> Unknown {
    Unknown(format!("address {address} outside its memory ({space:?})"))
}

//! One instruction of PTX.

use super::{Place, Reader, Unknown};
use std::collections::HashMap;

/// The type of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// A predicate.
    Predicate,
    /// A number without sign, or bits, of so many bytes.
    Unsigned(usize),
    /// A number with a sign, of so many bytes.
    Signed(usize),
    /// `f16`.
    F16,
    /// `f32`.
    F32,
    /// `f64`.
    F64,
}

impl Kind {
    fn of(text: &str) -> Option<Self> {
        Some(match text {
            "pred" => Self::Predicate,
            "f16" => Self::F16,
            "f32" => Self::F32,
            "f64" => Self::F64,
            "u8" | "b8" => Self::Unsigned(1),
            "u16" | "b16" => Self::Unsigned(2),
            "u32" | "b32" => Self::Unsigned(4),
            "u64" | "b64" => Self::Unsigned(8),
            "s8" => Self::Signed(1),
            "s16" => Self::Signed(2),
            "s32" => Self::Signed(4),
            "s64" => Self::Signed(8),
            _ => return None,
        })
    }

    /// Size in bytes.
    #[must_use]
    pub fn bytes(self) -> usize {
        match self {
            Self::Predicate => 1,
            Self::Unsigned(bytes) | Self::Signed(bytes) => bytes,
            Self::F16 => 2,
            Self::F32 => 4,
            Self::F64 => 8,
        }
    }
}

/// A comparison.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Compare {
    /// =
    Equal,
    /// Not =
    NotEqual,
    /// <
    Less,
    /// <=
    LessOrEqual,
    /// >
    Greater,
    /// >=
    GreaterOrEqual,
    /// Neither is NaN.
    Numbers,
    /// One is NaN.
    NotNumbers,
}

/// Where memory is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Space {
    /// The device's memory.
    Global,
    /// The workgroup's memory.
    Shared,
    /// The unit's memory.
    Local,
    /// The parameters of the kernel.
    Parameters,
}

/// What is read or written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Memory {
    /// Where.
    pub space: Space,
    /// The address.
    pub place: Place,
    /// Added to the address, in bytes.
    pub distance: u64,
}

/// The operation of an instruction. Names are those of PTX, without their types.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Op {
    /// `mov`, with bits from several registers, or to several.
    Move,
    /// `add`
    Add,
    /// `sub`
    Subtract,
    /// `mul.lo`, or `mul` of floats.
    Multiply,
    /// `mul.hi`
    MultiplyHigh,
    /// `mul.wide`
    MultiplyWide,
    /// `mad.lo`
    MultiplyAdd,
    /// `mad.wide`
    MultiplyAddWide,
    /// `fma`, whether it rounds down.
    Fused(bool),
    /// `div`
    Divide,
    /// `rem`
    Remainder,
    /// `abs`
    Absolute,
    /// `neg`
    Negate,
    /// `min`
    Least,
    /// `max`
    Largest,
    /// `sqrt`
    Root,
    /// `rsqrt`
    InverseRoot,
    /// `rcp`
    Inverse,
    /// `ex2`
    Power,
    /// `lg2`
    Logarithm,
    /// `sin`
    Sine,
    /// `cos`
    Cosine,
    /// `and`
    And,
    /// `or`
    Or,
    /// `xor`
    Xor,
    /// `not`
    Not,
    /// `shl`
    Left,
    /// `shr`
    Right,
    /// `shf.l.wrap`
    Funnel,
    /// `popc`
    Ones,
    /// `clz`
    LeadingZeros,
    /// `bfe`
    Extract,
    /// `bfi`
    Insert,
    /// `prmt`
    Permute,
    /// `setp`; whether NaN counts as true.
    Compare(Compare, bool),
    /// `selp`
    Select,
    /// `cvt`: from this type; toward 0 or nearest integer, where asked; to [0, 1].
    Convert {
        /// The type of what is converted.
        from: Kind,
        /// How a float becomes an integer.
        to_integer: Rounding,
        /// Whether a float is clamped to [0, 1].
        saturate: bool,
    },
    /// `ld`
    Load(Memory),
    /// `st`
    Store(Memory),
    /// `bra`
    Branch(usize),
    /// `bar.sync`, `barrier.sync`
    Barrier,
    /// `ret`, `exit`
    Return,
    /// `ldmatrix.x1`, `.x2`, `.x4` without `.trans`
    LoadMatrix(Memory),
    /// `mma.m16n8k16.row.col.f32.f16.f16.f32`
    MultiplyMatrices,
    /// An order for the hardware that changes no number.
    Nothing,
}

/// How a float becomes an integer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Rounding {
    /// Not an integer.
    None,
    /// Toward 0.
    Zero,
    /// To the nearest, of two the even one.
    Nearest,
    /// Down.
    Down,
    /// Up.
    Up,
}

/// One instruction.
#[derive(Debug, Clone, PartialEq)]
pub struct Instruction {
    /// The predicate that must be true, or false.
    pub guard: Option<(usize, bool)>,
    /// What it does.
    pub op: Op,
    /// The type of its numbers.
    pub kind: Kind,
    /// Registers that it writes.
    pub to: Vec<usize>,
    /// What it reads.
    pub from: Vec<Place>,
}

/// Operands: parts at commas that are not in braces.
fn operands(text: &str) -> Vec<&str> {
    let (mut parts, mut depth, mut first) = (Vec::new(), 0, 0);
    for (at, character) in text.char_indices() {
        match character {
            '{' | '[' => depth += 1,
            '}' | ']' => depth -= 1,
            ',' if depth == 0 => {
                parts.push(text[first..at].trim());
                first = at + 1;
            }
            _ => {}
        }
    }
    parts.push(text[first..].trim());
    parts.retain(|part| !part.is_empty());
    parts
}

/// Elements of a vector in braces, or the operand alone.
fn elements(text: &str) -> Vec<&str> {
    match text.strip_prefix('{') {
        Some(inside) => inside.trim_end_matches('}').split(',').map(str::trim).collect(),
        None => vec![text],
    }
}

impl Reader {
    pub(crate) fn instruction(
        &mut self,
        line: &str,
        labels: &HashMap<String, usize>,
    ) -> Result<Instruction, Unknown> {
        let unknown = || Unknown(line.to_owned());
        let (guard, line_after) = match line.strip_prefix('@') {
            Some(rest) => {
                let (name, rest) = rest.split_once(' ').ok_or_else(unknown)?;
                let wanted = !name.starts_with('!');
                (Some((self.register(name.trim_start_matches('!')), wanted)), rest)
            }
            None => (None, line),
        };
        let (mnemonic, rest) = line_after.split_once(' ').unwrap_or((line_after, ""));
        let words: Vec<&str> = mnemonic.split('.').collect();
        let has = |word: &str| words.contains(&word);
        let kinds: Vec<Kind> = words.iter().filter_map(|word| Kind::of(word)).collect();
        let kind = kinds.first().copied().unwrap_or(Kind::Unsigned(4));
        let parts = operands(rest);
        let done = |op, kind, to, from| Instruction { guard, op, kind, to, from };
        let space = || match () {
            () if has("global") => Some(Space::Global),
            () if has("param") => Some(Space::Parameters),
            () if has("local") => Some(Space::Local),
            () if mnemonic.contains("shared") => Some(Space::Shared),
            () => None,
        };
        let op = match words[0] {
            "bra" => {
                let label = parts.last().and_then(|label| labels.get(*label));
                return Ok(done(Op::Branch(*label.ok_or_else(unknown)?), kind, vec![], vec![]));
            }
            "bar" | "barrier" if has("sync") => Op::Barrier,
            "ret" | "exit" => Op::Return,
            "membar" | "fence" => Op::Nothing,
            "ld" => {
                let (place, distance) = self.address(parts.get(1).ok_or_else(unknown)?)?;
                let memory = Memory { space: space().ok_or_else(unknown)?, place, distance };
                let to = elements(parts[0]).into_iter().map(|name| self.register(name)).collect();
                return Ok(done(Op::Load(memory), kind, to, vec![]));
            }
            "st" => {
                let (place, distance) = self.address(parts.first().ok_or_else(unknown)?)?;
                let memory = Memory { space: space().ok_or_else(unknown)?, place, distance };
                let from = elements(parts.get(1).ok_or_else(unknown)?);
                let from =
                    from.into_iter().map(|text| self.place(text)).collect::<Result<_, _>>()?;
                return Ok(done(Op::Store(memory), kind, vec![], from));
            }
            "ldmatrix" if has("m8n8") && !has("trans") => {
                let (place, distance) = self.address(parts.get(1).ok_or_else(unknown)?)?;
                let memory = Memory { space: Space::Shared, place, distance };
                let to = elements(parts[0]).into_iter().map(|name| self.register(name)).collect();
                return Ok(done(Op::LoadMatrix(memory), kind, to, vec![]));
            }
            "mma" if mnemonic == "mma.sync.aligned.m16n8k16.row.col.f32.f16.f16.f32" => {
                Op::MultiplyMatrices
            }
            "mov" => Op::Move,
            "cvta" => Op::Move,
            "add" => Op::Add,
            "sub" => Op::Subtract,
            "mul" if has("wide") => Op::MultiplyWide,
            "mul" if has("hi") => Op::MultiplyHigh,
            "mul" => Op::Multiply,
            "mad" if has("wide") => Op::MultiplyAddWide,
            "mad" if has("lo") => Op::MultiplyAdd,
            "fma" => Op::Fused(has("rm")),
            "div" => Op::Divide,
            "rem" => Op::Remainder,
            "abs" => Op::Absolute,
            "neg" => Op::Negate,
            "min" => Op::Least,
            "max" => Op::Largest,
            "sqrt" => Op::Root,
            "rsqrt" => Op::InverseRoot,
            "rcp" => Op::Inverse,
            "ex2" => Op::Power,
            "lg2" => Op::Logarithm,
            "sin" => Op::Sine,
            "cos" => Op::Cosine,
            "and" => Op::And,
            "or" => Op::Or,
            "xor" => Op::Xor,
            "not" => Op::Not,
            "shl" => Op::Left,
            "shr" => Op::Right,
            "shf" if has("l") && has("wrap") => Op::Funnel,
            "popc" => Op::Ones,
            "clz" => Op::LeadingZeros,
            "bfe" => Op::Extract,
            "bfi" => Op::Insert,
            "prmt" if words.len() == 2 => Op::Permute,
            "selp" => Op::Select,
            "setp" => {
                let (compare, unordered) = compare(words[1]).ok_or_else(unknown)?;
                if parts.len() != 3 || parts[0].contains('|') {
                    return Err(unknown());
                }
                Op::Compare(compare, unordered)
            }
            "cvt" => Op::Convert {
                from: *kinds.get(1).ok_or_else(unknown)?,
                to_integer: rounding(&words),
                saturate: has("sat"),
            },
            _ => return Err(unknown()),
        };
        let (to, from) = match op {
            Op::Barrier | Op::Return | Op::Nothing => (vec![], vec![]),
            _ => {
                let first = parts.first().ok_or_else(unknown)?;
                let to = elements(first).into_iter().map(|name| self.register(name)).collect();
                let from = parts[1..].iter().flat_map(|part| elements(part));
                (to, from.map(|text| self.place(text)).collect::<Result<_, _>>()?)
            }
        };
        Ok(done(op, kind, to, from))
    }
}

fn compare(word: &str) -> Option<(Compare, bool)> {
    Some(match word {
        "eq" => (Compare::Equal, false),
        "ne" => (Compare::NotEqual, false),
        "lt" | "lo" => (Compare::Less, false),
        "le" | "ls" => (Compare::LessOrEqual, false),
        "gt" | "hi" => (Compare::Greater, false),
        "ge" | "hs" => (Compare::GreaterOrEqual, false),
        "equ" => (Compare::Equal, true),
        "neu" => (Compare::NotEqual, true),
        "ltu" => (Compare::Less, true),
        "leu" => (Compare::LessOrEqual, true),
        "gtu" => (Compare::Greater, true),
        "geu" => (Compare::GreaterOrEqual, true),
        "num" => (Compare::Numbers, false),
        "nan" => (Compare::NotNumbers, false),
        _ => return None,
    })
}

fn rounding(words: &[&str]) -> Rounding {
    for word in words {
        match *word {
            "rzi" => return Rounding::Zero,
            "rni" => return Rounding::Nearest,
            "rmi" => return Rounding::Down,
            "rpi" => return Rounding::Up,
            _ => {}
        }
    }
    Rounding::None
}

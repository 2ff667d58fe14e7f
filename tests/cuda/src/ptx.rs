//! Reads the PTX of one kernel (PTX ISA 9.x, as NVRTC writes it), and prepares it for running.

mod instruction;

use std::collections::HashMap;
use std::fmt;

pub use instruction::{Compare, Instruction, Kind, Memory, Op, Rounding, Space};

/// Why a PTX cannot be run here. `Display` is one line.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Unknown(pub String);

impl fmt::Display for Unknown {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "cannot run: {}", self.0)
    }
}

impl std::error::Error for Unknown {}

/// A parameter of a kernel.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Parameter {
    /// Where it begins, in bytes.
    pub at: usize,
    /// Its size in bytes.
    pub bytes: usize,
}

/// A place that an instruction reads, or writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// A register, by its number.
    Register(usize),
    /// A constant.
    Constant(u64),
    /// Number of the unit, in direction 0, 1 or 2.
    Unit(usize),
    /// Number of units of a workgroup.
    Units(usize),
    /// Number of the workgroup.
    Group(usize),
    /// Number of workgroups.
    Groups(usize),
    /// Number of the unit in its warp.
    Lane,
}

/// A kernel that can be run.
#[derive(Debug, Clone)]
pub struct Kernel {
    /// Its name.
    pub name: String,
    /// Its parameters.
    pub parameters: Vec<Parameter>,
    /// Its instructions.
    pub instructions: Vec<Instruction>,
    /// Number of registers of a unit.
    pub registers: usize,
    /// Bytes of shared memory besides those that a launch adds at the end.
    pub shared_bytes: usize,
    /// Bytes of memory of each unit alone.
    pub local_bytes: usize,
}

impl Kernel {
    /// Reads the only kernel of a PTX.
    ///
    /// # Errors
    /// [`Unknown`] if it has something that cannot be run here.
    pub fn read(text: &str) -> Result<Self, Unknown> {
        Reader::default().read(text)
    }

    /// Bytes of all parameters.
    #[must_use]
    pub fn parameter_bytes(&self) -> usize {
        self.parameters.last().map_or(0, |last| last.at + last.bytes)
    }
}

/// What is known while a PTX is read.
#[derive(Default)]
pub(crate) struct Reader {
    registers: HashMap<String, usize>,
    /// Addresses of parameters, shared and local memory, by their names.
    names: HashMap<String, u64>,
    parameters: Vec<Parameter>,
    name: String,
    shared_bytes: usize,
    local_bytes: usize,
}

fn bytes_of(kind: &str) -> Result<usize, Unknown> {
    let bits: String = kind.chars().filter(char::is_ascii_digit).collect();
    bits.parse::<usize>().map(|bits| bits / 8).map_err(|_| Unknown(format!("type {kind}")))
}

impl Reader {
    fn read(mut self, text: &str) -> Result<Kernel, Unknown> {
        let text = without_comments(text);
        let (before, body) =
            text.split_once("\n{").ok_or_else(|| Unknown("a PTX without a kernel".to_owned()))?;
        self.declare(before)?;
        let statements = statements(body);
        let mut labels = HashMap::new();
        let mut lines = Vec::new();
        for statement in statements {
            if let Some(label) = statement.strip_suffix(':') {
                labels.insert(label.to_owned(), lines.len());
            } else if statement.starts_with('.') {
                self.declare_inside(&statement)?;
            } else {
                lines.push(statement);
            }
        }
        let instructions =
            lines.iter().map(|line| self.instruction(line, &labels)).collect::<Result<_, _>>()?;
        Ok(Kernel {
            name: self.name,
            parameters: self.parameters,
            instructions,
            registers: self.registers.len(),
            shared_bytes: self.shared_bytes,
            local_bytes: self.local_bytes,
        })
    }

    /// Reads what stands before the body: shared memory and the parameters.
    fn declare(&mut self, before: &str) -> Result<(), Unknown> {
        if before.matches(".entry").count() != 1 {
            return Err(Unknown("a PTX that has not just one kernel".to_owned()));
        }
        for line in before.lines().filter(|line| line.contains(".shared")) {
            self.memory(line.trim().trim_end_matches(';'))?;
        }
        let (_, entry) = before.split_once(".entry").unwrap_or_default();
        let (name, list) = entry.split_once('(').unwrap_or((entry, ""));
        self.name = name.trim().to_owned();
        let list = list.split(')').next().unwrap_or_default();
        for parameter in list.split(',').map(str::trim).filter(|text| !text.is_empty()) {
            let mut align = None;
            let mut words = parameter.split_whitespace().peekable();
            let mut kind = "";
            let mut name = "";
            while let Some(word) = words.next() {
                match word {
                    ".param" | ".ptr" | ".global" => {}
                    ".align" => align = words.next().and_then(|text| text.parse().ok()),
                    _ if word.starts_with('.') => kind = word,
                    _ => name = word,
                }
            }
            let size = bytes_of(kind)?;
            let (name, count) = array(name);
            let align = align.unwrap_or(size);
            let at = self.parameters.last().map_or(0, |p| p.at + p.bytes).next_multiple_of(align);
            self.names.insert(name.to_owned(), at as u64);
            self.parameters.push(Parameter { at, bytes: size * count.unwrap_or(1) });
        }
        Ok(())
    }

    fn declare_inside(&mut self, statement: &str) -> Result<(), Unknown> {
        let first = statement.split_whitespace().next().unwrap_or_default();
        match first {
            ".reg" | ".loc" | ".pragma" => Ok(()),
            ".shared" | ".local" => self.memory(statement),
            _ => Err(Unknown(statement.to_owned())),
        }
    }

    /// A declaration of shared memory, or of memory of each unit.
    fn memory(&mut self, statement: &str) -> Result<(), Unknown> {
        let words: Vec<&str> = statement.split_whitespace().collect();
        let after = |word| words.iter().position(|w| *w == word).and_then(|at| words.get(at + 1));
        let align = after(".align").and_then(|text| text.parse().ok()).unwrap_or(16_usize);
        let (name, count) = array(words.last().copied().unwrap_or_default());
        let kind = words.iter().rev().nth(1).copied().unwrap_or_default();
        let bytes = bytes_of(kind)? * count.unwrap_or(0);
        let total =
            if words.contains(&".local") { &mut self.local_bytes } else { &mut self.shared_bytes };
        let at = total.next_multiple_of(align);
        *total = at + bytes;
        self.names.insert(name.to_owned(), at as u64);
        Ok(())
    }

    /// The number of a register.
    pub(crate) fn register(&mut self, name: &str) -> usize {
        let next = self.registers.len();
        *self.registers.entry(name.to_owned()).or_insert(next)
    }

    /// The place that a text names.
    pub(crate) fn place(&mut self, text: &str) -> Result<Place, Unknown> {
        let text = text.trim();
        let direction = |rest: &str| match rest {
            ".x" => Some(0),
            ".y" => Some(1),
            ".z" => Some(2),
            _ => None,
        };
        type Special = (&'static str, fn(usize) -> Place);
        let special: [Special; 4] = [
            ("%tid", Place::Unit),
            ("%ntid", Place::Units),
            ("%ctaid", Place::Group),
            ("%nctaid", Place::Groups),
        ];
        for (name, place) in special {
            if let Some(direction) = text.strip_prefix(name).and_then(direction) {
                return Ok(place(direction));
            }
        }
        if text == "%laneid" {
            return Ok(Place::Lane);
        }
        if let Some(name) = text.strip_prefix('%') {
            // Registers are numbered, except those of the stack; other names are special.
            let stack = name == "SP" || name == "SPL";
            return match stack || name.ends_with(|last: char| last.is_ascii_digit()) {
                true => Ok(Place::Register(self.register(text))),
                false => Err(Unknown(format!("register {text}"))),
            };
        }
        if let Some(&address) = self.names.get(text) {
            return Ok(Place::Constant(address));
        }
        constant(text).map(Place::Constant).ok_or_else(|| Unknown(format!("operand {text}")))
    }

    /// The address in brackets: a place and a distance from it, in bytes.
    pub(crate) fn address(&mut self, text: &str) -> Result<(Place, u64), Unknown> {
        let inside = text.trim().trim_start_matches('[').trim_end_matches(']');
        match inside.split_once('+') {
            Some((place, distance)) => {
                let distance =
                    constant(distance.trim()).ok_or_else(|| Unknown(format!("address {text}")))?;
                Ok((self.place(place)?, distance))
            }
            None => Ok((self.place(inside)?, 0)),
        }
    }
}

/// A name, and the number of elements in brackets after it.
fn array(text: &str) -> (&str, Option<usize>) {
    match text.split_once('[') {
        Some((name, rest)) => (name, rest.trim_end_matches(']').parse().ok()),
        None => (text, None),
    }
}

/// A number: decimal, `0x`, or the bits of `f32` (`0f`) and `f64` (`0d`).
fn constant(text: &str) -> Option<u64> {
    for prefix in ["0f", "0F", "0d", "0D", "0x", "0X"] {
        if let Some(bits) = text.strip_prefix(prefix) {
            return u64::from_str_radix(bits, 16).ok();
        }
    }
    text.parse::<i64>().map(|value| value as u64).or_else(|_| text.parse::<u64>()).ok()
}

fn without_comments(text: &str) -> String {
    let lines = text.lines().map(|line| line.split("//").next().unwrap_or_default());
    lines.collect::<Vec<_>>().join("\n")
}

/// Statements and labels of a kernel's body. Braces of inner scopes are left out: registers in them
/// have names of their own.
fn statements(body: &str) -> Vec<String> {
    let body = body.rsplit_once('}').map_or(body, |(body, _)| body);
    let mut all = Vec::new();
    let mut rest = String::new();
    let mut depth = 0;
    for character in body.chars() {
        match character {
            // Braces after a comma or a mnemonic hold a vector of operands.
            '{' if !rest.trim().is_empty() => {
                depth += 1;
                rest.push('{');
            }
            '}' if depth > 0 => {
                depth -= 1;
                rest.push('}');
            }
            '{' | '}' => rest.clear(),
            ';' => {
                all.push(rest.split_whitespace().collect::<Vec<_>>().join(" "));
                rest.clear();
            }
            // Labels begin with a dollar; `shared::cta` is a part of a mnemonic.
            ':' if rest.trim_start().starts_with('$') => {
                rest.push(':');
                all.push(rest.trim().to_owned());
                rest.clear();
            }
            '\n' if rest.trim_start().starts_with(".loc") => rest.clear(),
            other => rest.push(other),
        }
    }
    all.retain(|statement| !statement.is_empty());
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constants_are_decimal_or_the_bits_of_floats() {
        assert_eq!(constant("-1"), Some(u64::MAX));
        assert_eq!(constant("0f3F800000"), Some(u64::from(1.0_f32.to_bits())));
        assert_eq!(constant("0d3FF0000000000000"), Some(1.0_f64.to_bits()));
        assert_eq!(constant("what"), None);
    }

    #[test]
    fn statements_keep_vectors_and_leave_scopes() {
        let body = "\n .loc 1 2 3\n{ cvt.rn.f16.f32 %rs1, %f1;}\n$L:\n\
                    mov.b32 %r1, {%rs1, %rs2}; @%p1 bra $L;\n}\n";
        let all = statements(body);
        assert_eq!(
            all,
            ["cvt.rn.f16.f32 %rs1, %f1", "$L:", "mov.b32 %r1, {%rs1, %rs2}", "@%p1 bra $L"]
        );
    }

    #[test]
    fn what_cannot_be_run_is_refused_by_name() {
        let ptx = |line: &str| {
            format!(".visible .entry k(\n.param .u64 k_param_0\n)\n{{\n{line}\nret;\n}}\n")
        };
        let refused = |line: &str| Kernel::read(&ptx(line)).unwrap_err().to_string();
        assert_eq!(refused("wgmma.fence;"), "cannot run: wgmma.fence");
        assert_eq!(refused("mov.u32 %r1, %clock;"), "cannot run: register %clock");
        assert!(Kernel::read("no kernel").is_err());
        assert_eq!(Kernel::read(&ptx("")).unwrap().parameter_bytes(), 8);
    }
}

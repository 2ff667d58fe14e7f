//! What an instruction does to the numbers of one unit.

use crate::ptx::{Compare, Kind, Op, Rounding};
use half::f16;

/// Half `part` of a register, as `f16`.
pub fn f16_at(register: u64, part: usize) -> f32 {
    f16::from_bits((register >> (16 * part)) as u16).to_f32()
}

fn single(bits: u64) -> f32 {
    f32::from_bits(bits as u32)
}

fn double(bits: u64) -> f64 {
    f64::from_bits(bits)
}

fn of_single(number: f32) -> u64 {
    u64::from(number.to_bits())
}

/// The lowest `bytes` bytes.
fn low(number: u64, bytes: usize) -> u64 {
    number & u64::MAX >> (64 - 8 * bytes)
}

/// The number with a sign in the lowest `bytes` bytes.
fn signed(number: u64, bytes: usize) -> i64 {
    let unused = 64 - 8 * bytes as u32;
    (number << unused) as i64 >> unused
}

/// The result for numbers of this kind.
pub fn compute(op: Op, kind: Kind, numbers: [u64; 4]) -> u64 {
    let [a, b, c, _] = numbers;
    match op {
        Op::Move => return a,
        Op::Select => return if c != 0 { a } else { b },
        Op::Compare(how, unordered) => return u64::from(compare(how, unordered, kind, a, b)),
        Op::Convert { from, to_integer, saturate } => {
            return convert(from, kind, (to_integer, saturate), a);
        }
        _ => {}
    }
    match kind {
        Kind::F32 => of_single(of_f32(op, single(a), single(b), single(c))),
        Kind::F64 => of_f64(op, double(a), double(b), double(c)).to_bits(),
        // Rounded from single precision, in which a sum, product or quotient of two f16 is right.
        Kind::F16 => {
            let [a, b, c] = [a, b, c].map(|bits| f16::from_bits(bits as u16).to_f32());
            u64::from(f16::from_f32(of_f32(op, a, b, c)).to_bits())
        }
        Kind::Predicate => integer(op, 1, false, numbers) & 1,
        Kind::Unsigned(bytes) => integer(op, bytes, false, numbers),
        Kind::Signed(bytes) => integer(op, bytes, true, numbers),
    }
}

fn of_f32(op: Op, a: f32, b: f32, c: f32) -> f32 {
    match op {
        Op::Add => a + b,
        Op::Subtract => a - b,
        Op::Multiply => a * b,
        Op::Fused(false) => a.mul_add(b, c),
        Op::Fused(true) => {
            let exact = f64::from(a) * f64::from(b) + f64::from(c);
            let near = exact as f32;
            if f64::from(near) > exact { near.next_down() } else { near }
        }
        Op::Divide => a / b,
        Op::Absolute => a.abs(),
        Op::Negate => -a,
        // As the instructions, these give the number if the other is NaN.
        Op::Least => a.min(b),
        Op::Largest => a.max(b),
        Op::Root => a.sqrt(),
        Op::InverseRoot => 1.0 / a.sqrt(),
        Op::Inverse => 1.0 / a,
        Op::Power => a.exp2(),
        Op::Logarithm => a.log2(),
        Op::Sine => a.sin(),
        Op::Cosine => a.cos(),
        _ => f32::NAN,
    }
}

fn of_f64(op: Op, a: f64, b: f64, c: f64) -> f64 {
    match op {
        Op::Add => a + b,
        Op::Subtract => a - b,
        Op::Multiply => a * b,
        Op::Fused(false) => a.mul_add(b, c),
        Op::Divide => a / b,
        Op::Absolute => a.abs(),
        Op::Negate => -a,
        Op::Least => a.min(b),
        Op::Largest => a.max(b),
        Op::Root => a.sqrt(),
        Op::InverseRoot => 1.0 / a.sqrt(),
        Op::Inverse => 1.0 / a,
        _ => f64::NAN,
    }
}

fn integer(op: Op, bytes: usize, sign: bool, [a, b, c, d]: [u64; 4]) -> u64 {
    let bits = 8 * bytes as u32;
    let wide = |number: u64| -> i128 {
        if sign { signed(number, bytes).into() } else { low(number, bytes).into() }
    };
    let shift = low(b, 4);
    let result = match op {
        Op::Add => a.wrapping_add(b),
        Op::Subtract => a.wrapping_sub(b),
        Op::Multiply => a.wrapping_mul(b),
        Op::MultiplyHigh => ((wide(a) * wide(b)) >> bits) as u64,
        Op::MultiplyWide => return low((wide(a) * wide(b)) as u64, 2 * bytes),
        Op::MultiplyAdd => a.wrapping_mul(b).wrapping_add(c),
        Op::MultiplyAddWide => {
            return low(((wide(a) * wide(b)) as u64).wrapping_add(c), 2 * bytes);
        }
        // The hardware gives all ones for a division by 0.
        Op::Divide => wide(a).checked_div(wide(b)).unwrap_or(-1) as u64,
        Op::Remainder => wide(a).checked_rem(wide(b)).unwrap_or(-1) as u64,
        Op::Absolute => wide(a).unsigned_abs() as u64,
        Op::Negate => a.wrapping_neg(),
        Op::Least => wide(a).min(wide(b)) as u64,
        Op::Largest => wide(a).max(wide(b)) as u64,
        Op::And => a & b,
        Op::Or => a | b,
        Op::Xor => a ^ b,
        Op::Not => !a,
        Op::Left if shift < u64::from(bits) => a << shift,
        Op::Right => (wide(a) >> shift.min(127)) as u64,
        Op::Funnel => {
            let pair = low(b, 4) << 32 | low(a, 4);
            pair << (c & 31) >> 32
        }
        Op::Ones => return u64::from(low(a, bytes).count_ones()),
        Op::LeadingZeros => return u64::from(low(a, bytes).leading_zeros() - (64 - bits)),
        Op::Extract => {
            let (from, length) = (b & 0xff, c & 0xff);
            let part = if from < 64 { low(a, bytes) >> from } else { 0 };
            let part = if length < 64 { part & ((1 << length) - 1) } else { part };
            let negative = sign && length > 0 && part >> (length - 1).min(63) & 1 == 1;
            if negative && length < 64 { part | u64::MAX << length } else { part }
        }
        Op::Insert => {
            let (from, length) = (c & 0xff, d & 0xff);
            let mask = if length < 64 { (1 << length) - 1 } else { u64::MAX };
            let mask = if from < 64 { mask << from } else { 0 };
            b & !mask | (if from < 64 { a << from } else { 0 }) & mask
        }
        Op::Permute => {
            let all = (low(b, 4) << 32 | low(a, 4)).to_le_bytes();
            (0..4).fold(0, |result, byte| {
                let choice = c >> (4 * byte) & 0xf;
                let picked = all[(choice & 7) as usize];
                let picked = if choice & 8 == 0 { picked } else { (picked as i8 >> 7) as u8 };
                result | u64::from(picked) << (8 * byte)
            })
        }
        _ => 0,
    };
    low(result, bytes)
}

fn compare(how: Compare, unordered: bool, kind: Kind, a: u64, b: u64) -> bool {
    let order = match kind {
        Kind::F32 => single(a).partial_cmp(&single(b)),
        Kind::F64 => double(a).partial_cmp(&double(b)),
        Kind::F16 => f16::from_bits(a as u16).partial_cmp(&f16::from_bits(b as u16)),
        Kind::Signed(bytes) => Some(signed(a, bytes).cmp(&signed(b, bytes))),
        Kind::Unsigned(bytes) => Some(low(a, bytes).cmp(&low(b, bytes))),
        Kind::Predicate => Some(a.cmp(&b)),
    };
    let Some(order) = order else {
        return unordered || how == Compare::NotNumbers;
    };
    match how {
        Compare::Equal => order.is_eq(),
        Compare::NotEqual => order.is_ne(),
        Compare::Less => order.is_lt(),
        Compare::LessOrEqual => order.is_le(),
        Compare::Greater => order.is_gt(),
        Compare::GreaterOrEqual => order.is_ge(),
        Compare::Numbers => true,
        Compare::NotNumbers => false,
    }
}

fn convert(from: Kind, to: Kind, (rounding, saturate): (Rounding, bool), number: u64) -> u64 {
    let (float, whole) = match from {
        Kind::F16 => (Some(f64::from(f16_at(number, 0))), 0),
        Kind::F32 => (Some(f64::from(single(number))), 0),
        Kind::F64 => (Some(double(number)), 0),
        Kind::Signed(bytes) => (None, i128::from(signed(number, bytes))),
        Kind::Unsigned(bytes) => (None, i128::from(low(number, bytes))),
        Kind::Predicate => (None, i128::from(number)),
    };
    let rounded = |x: f64| match rounding {
        Rounding::None => x,
        Rounding::Zero => x.trunc(),
        Rounding::Nearest => x.round_ties_even(),
        Rounding::Down => x.floor(),
        Rounding::Up => x.ceil(),
    };
    let clamped = |x: f64| match (saturate, x.is_nan()) {
        (true, true) => 0.0,
        (true, false) => x.clamp(0.0, 1.0),
        (false, _) => x,
    };
    match (to, float) {
        (Kind::F32, Some(x)) => of_single(clamped(rounded(x)) as f32),
        (Kind::F32, None) => of_single(whole as f32),
        (Kind::F64, Some(x)) => clamped(rounded(x)).to_bits(),
        (Kind::F64, None) => (whole as f64).to_bits(),
        (Kind::F16, Some(x)) => u64::from(f16::from_f64(clamped(rounded(x))).to_bits()),
        (Kind::F16, None) => u64::from(f16::from_f64(whole as f64).to_bits()),
        // Rust's conversions end at the largest and smallest number, as those of the hardware.
        (Kind::Unsigned(4), Some(x)) => u64::from(rounded(x) as u32),
        (Kind::Unsigned(bytes), Some(x)) => low(rounded(x) as u64, bytes),
        (Kind::Signed(4), Some(x)) => u64::from(rounded(x) as i32 as u32),
        (Kind::Signed(bytes), Some(x)) => low(rounded(x) as i64 as u64, bytes),
        (Kind::Unsigned(bytes) | Kind::Signed(bytes), None) => low(whole as u64, bytes),
        (Kind::Predicate, _) => u64::from(whole != 0),
    }
}

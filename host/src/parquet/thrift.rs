//! Encodes structures in Thrift's compact protocol, in which Parquet keeps its metadata.
//!
//! Source: *Thrift compact protocol encoding*,
//! <https://github.com/apache/thrift/blob/master/doc/specs/thrift-compact-protocol.md>.

/// Appends a number of 7 bits a byte, lowest first.
pub(super) fn varint(mut value: u64, bytes: &mut Vec<u8>) {
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
}

/// Reads such a number: its value, and the bytes that it takes.
pub(super) fn read_varint(bytes: &[u8]) -> Option<(u64, usize)> {
    let mut value = 0;
    for (k, &byte) in bytes.iter().take(9).enumerate() {
        value |= u64::from(byte & 0x7f) << (7 * k);
        if byte < 0x80 {
            return Some((value, k + 1));
        }
    }
    None
}

fn zigzag(value: i64) -> u64 {
    ((value << 1) ^ (value >> 63)) as u64
}

const TRUE: u8 = 1;
const FALSE: u8 = 2;
const I32: u8 = 5;
const I64: u8 = 6;
const BINARY: u8 = 8;
const LIST: u8 = 9;
const STRUCT: u8 = 12;

/// A structure. Fields are added in the order of their numbers.
#[derive(Debug, Default)]
pub(super) struct Struct {
    bytes: Vec<u8>,
    last: u8,
}

impl Struct {
    fn field(&mut self, id: u8, kind: u8) {
        // Numbers of Parquet's fields are at most 15 apart.
        self.bytes.push((id - self.last) << 4 | kind);
        self.last = id;
    }

    pub(super) fn bool(mut self, id: u8, value: bool) -> Self {
        self.field(id, if value { TRUE } else { FALSE });
        self
    }

    pub(super) fn i32(mut self, id: u8, value: i32) -> Self {
        self.field(id, I32);
        varint(zigzag(value.into()), &mut self.bytes);
        self
    }

    pub(super) fn i64(mut self, id: u8, value: i64) -> Self {
        self.field(id, I64);
        varint(zigzag(value), &mut self.bytes);
        self
    }

    pub(super) fn text(mut self, id: u8, text: &str) -> Self {
        self.field(id, BINARY);
        append_text(text, &mut self.bytes);
        self
    }

    pub(super) fn nested(mut self, id: u8, value: Self) -> Self {
        self.field(id, STRUCT);
        self.bytes.extend(value.end());
        self
    }

    fn list(&mut self, id: u8, count: usize, kind: u8) {
        self.field(id, LIST);
        if count < 15 {
            self.bytes.push((count as u8) << 4 | kind);
        } else {
            self.bytes.push(0xf0 | kind);
            varint(count as u64, &mut self.bytes);
        }
    }

    pub(super) fn i32s(mut self, id: u8, values: &[i32]) -> Self {
        self.list(id, values.len(), I32);
        values.iter().for_each(|&value| varint(zigzag(value.into()), &mut self.bytes));
        self
    }

    pub(super) fn texts(mut self, id: u8, texts: &[&str]) -> Self {
        self.list(id, texts.len(), BINARY);
        texts.iter().for_each(|text| append_text(text, &mut self.bytes));
        self
    }

    pub(super) fn structs(mut self, id: u8, values: impl ExactSizeIterator<Item = Self>) -> Self {
        self.list(id, values.len(), STRUCT);
        values.for_each(|value| self.bytes.extend(value.end()));
        self
    }

    /// The bytes of the whole structure.
    pub(super) fn end(mut self) -> Vec<u8> {
        self.bytes.push(0);
        self.bytes
    }
}

fn append_text(text: &str, bytes: &mut Vec<u8>) {
    varint(text.len() as u64, bytes);
    bytes.extend_from_slice(text.as_bytes());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_structure_has_the_bytes_of_the_specification() {
        let inner = Struct::default().i64(1, -1).bool(2, true);
        let bytes =
            Struct::default().i32(1, 150).text(4, "ab").i32s(5, &[0, 1]).nested(20, inner).end();
        let expected = [
            0x15, 0xac, 0x02, // field 1, i32, zigzag 300
            0x38, 2, b'a', b'b', // field 4, three on
            0x19, 0x25, 0, 2, // field 5, a list of two i32
            0xfc, 0x16, 1, 0x11, 0, // field 20, fifteen on: a structure
            0,
        ];
        assert_eq!(bytes, expected);
        let long = Struct::default().texts(1, &[""; 15]).end();
        assert_eq!(long[..3], [0x19, 0xf8, 15]);
    }
}

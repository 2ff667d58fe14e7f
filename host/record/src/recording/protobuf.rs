//! Encodes messages and their descriptions in Protocol Buffers, as much as recordings need.
//!
//! Source: *Protocol Buffers: encoding* and `google/protobuf/descriptor.proto`,
//! <https://protobuf.dev>.

/// A message that is being encoded. Fields of value 0 are left out, as in proto3.
#[derive(Debug, Default)]
pub(super) struct Message(Vec<u8>);

const VARINT: u64 = 0;
const EIGHT_BYTES: u64 = 1;
const BYTES: u64 = 2;
const FOUR_BYTES: u64 = 5;

impl Message {
    fn varint(&mut self, mut value: u64) {
        while value >= 0x80 {
            self.0.push(value as u8 | 0x80);
            value >>= 7;
        }
        self.0.push(value as u8);
    }

    fn key(&mut self, field: u32, wire: u64) {
        self.varint(u64::from(field) << 3 | wire);
    }

    pub(super) fn uint(self, field: u32, value: u64) -> Self {
        if value == 0 { self } else { self.number(field, value) }
    }

    /// Writes a number, even if it is 0.
    fn number(mut self, field: u32, value: u64) -> Self {
        self.key(field, VARINT);
        self.varint(value);
        self
    }

    pub(super) fn bool(self, field: u32, value: bool) -> Self {
        self.uint(field, value.into())
    }

    pub(super) fn fixed32(mut self, field: u32, value: u32) -> Self {
        if value != 0 {
            self.key(field, FOUR_BYTES);
            self.0.extend(value.to_le_bytes());
        }
        self
    }

    pub(super) fn double(mut self, field: u32, value: f64) -> Self {
        if value != 0.0 {
            self.key(field, EIGHT_BYTES);
            self.0.extend(value.to_le_bytes());
        }
        self
    }

    pub(super) fn doubles(self, field: u32, values: &[f64]) -> Self {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.bytes(field, &bytes)
    }

    pub(super) fn bytes(mut self, field: u32, bytes: &[u8]) -> Self {
        if !bytes.is_empty() {
            self.key(field, BYTES);
            self.varint(bytes.len() as u64);
            self.0.extend_from_slice(bytes);
        }
        self
    }

    pub(super) fn text(self, field: u32, text: &str) -> Self {
        self.bytes(field, text.as_bytes())
    }

    pub(super) fn nested(mut self, field: u32, message: &Self) -> Self {
        self.key(field, BYTES);
        self.varint(message.0.len() as u64);
        self.0.extend_from_slice(&message.0);
        self
    }

    pub(super) fn end(self) -> Vec<u8> {
        self.0
    }
}

/// The type of a field, by its number in `descriptor.proto`.
#[derive(Debug, Clone, Copy)]
pub(super) enum Type {
    Double,
    Uint64,
    Int64,
    Int32,
    Fixed32,
    Bool,
    Text,
    Bytes,
    Doubles,
    /// A message or an enumeration of this full name.
    Of(&'static str, Kind),
}

#[derive(Debug, Clone, Copy)]
pub(super) enum Kind {
    Message,
    Enum,
}

/// A field: number, name and type.
pub(super) type Field = (u32, &'static str, Type);

fn field(&(number, name, kind): &Field) -> Message {
    let (code, of) = match kind {
        Type::Double | Type::Doubles => (1, ""),
        Type::Int64 => (3, ""),
        Type::Uint64 => (4, ""),
        Type::Int32 => (5, ""),
        Type::Fixed32 => (7, ""),
        Type::Bool => (8, ""),
        Type::Text => (9, ""),
        Type::Of(name, Kind::Message) => (11, name),
        Type::Bytes => (12, ""),
        Type::Of(name, Kind::Enum) => (14, name),
    };
    let label = if matches!(kind, Type::Doubles) { 3 } else { 1 };
    Message::default().text(1, name).uint(3, number.into()).uint(4, label).uint(5, code).text(6, of)
}

/// The description of a message, `DescriptorProto`.
pub(super) fn descriptor(name: &str, fields: &[Field], enums: &[(&str, &[&str])]) -> Message {
    let mut message = Message::default().text(1, name);
    for described in fields {
        message = message.nested(2, &field(described));
    }
    for (name, values) in enums {
        let mut described = Message::default().text(1, name);
        for (number, value) in values.iter().enumerate() {
            described =
                described.nested(2, &Message::default().text(1, value).number(2, number as u64));
        }
        message = message.nested(4, &described);
    }
    message
}

/// The description of a file with one message, `FileDescriptorProto`.
pub(super) fn file(name: &str, package: &str, imports: &[&str], message: &Message) -> Message {
    let mut file = Message::default().text(1, name).text(2, package);
    for import in imports {
        file = file.text(3, import);
    }
    file.nested(4, message).text(12, "proto3")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_message_has_the_bytes_of_the_specification() {
        let inner = Message::default().uint(1, 150);
        let message = Message::default()
            .uint(1, 0)
            .text(2, "testing")
            .nested(3, &inner)
            .fixed32(4, 7)
            .double(5, 1.0)
            .end();
        let expected = [
            &[0x12, 7][..],
            b"testing",
            &[0x1a, 3, 8, 0x96, 1],
            &[0x25, 7, 0, 0, 0],
            &[0x29, 0, 0, 0, 0, 0, 0, 0xf0, 0x3f],
        ]
        .concat();
        assert_eq!(message, expected);
    }

    #[test]
    fn a_value_of_its_types_default_is_left_out_and_any_other_is_written() {
        let of = |make: fn(Message) -> Message| make(Message::default()).end();
        assert_eq!(of(|m| m.bool(1, true)), [0x08, 1]);
        assert_eq!(of(|m| m.doubles(2, &[1.0])), [0x12, 8, 0, 0, 0, 0, 0, 0, 0xf0, 0x3f]);
        assert_eq!(of(|m| m.bytes(3, &[9, 8])), [0x1a, 2, 9, 8]);
        let nothing = of(|m| {
            m.bool(1, false).doubles(2, &[]).bytes(3, &[]).fixed32(4, 0).double(5, 0.0).text(6, "")
        });
        assert!(nothing.is_empty(), "{nothing:?}");
    }

    /// The bytes are those of Python's `protobuf` 7 (`descriptor_pb2.FileDescriptorProto`).
    #[test]
    fn a_description_has_the_bytes_of_googles_own() {
        let fields: [Field; 11] = [
            (1, "a", Type::Double),
            (2, "b", Type::Uint64),
            (3, "c", Type::Int64),
            (4, "d", Type::Int32),
            (5, "e", Type::Fixed32),
            (6, "f", Type::Bool),
            (7, "g", Type::Text),
            (8, "h", Type::Bytes),
            (9, "i", Type::Doubles),
            (200, "j", Type::Of(".lab.At", Kind::Message)),
            (11, "k", Type::Of(".lab.Seen.Level", Kind::Enum)),
        ];
        let message = descriptor("Seen", &fields, &[("Level", &["LOW", "HIGH"])]);
        let made = file("lab/Seen.proto", "lab", &["lab/At.proto"], &message).end();
        let hex: String = made.iter().map(|byte| format!("{byte:02x}")).collect();
        let expected = [
            "0a0e6c61622f5365656e2e70726f746f12036c61621a0c6c61622f41742e70726f746f22b6010a045365656e",
            "12090a01611801200128011209",
            "0a016218022001280412090a016318032001280312090a0164180420012805",
            "12090a016518052001280712090a016618062001280812090a016718072001280912090a016818082001280c",
            "12090a016918092003280112130a016a18c8012001280b32072e6c61622e4174121a0a016b180b2001280e32",
            "0f2e6c61622e5365656e2e4c6576656c221a0a054c6576656c12070a034c4f57100012080a04484947481001",
            "620670726f746f33",
        ];
        assert_eq!(hex, expected.concat());
    }
}

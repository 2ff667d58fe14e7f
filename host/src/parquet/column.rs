//! Columns of a Parquet file: values, and the levels that say which are absent and where lists
//! begin.
//!
//! Source: *Apache Parquet format*, <https://github.com/apache/parquet-format>, `README.md` and
//! `Encodings.md`.

use super::thrift::{Struct, varint};

/// The type of a column's values.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Bool,
    I32,
    I64,
    /// Nanoseconds since 1970, UTC.
    Time,
    F32,
    F64,
    Text,
}

impl Kind {
    /// The number of the physical type.
    pub(super) fn physical(self) -> i32 {
        match self {
            Self::Bool => 0,
            Self::I32 => 1,
            Self::I64 | Self::Time => 2,
            Self::F32 => 4,
            Self::F64 => 5,
            Self::Text => 6,
        }
    }

    /// The logical type, if the physical type does not say all.
    fn logical(self) -> Option<Struct> {
        let union = |id| Struct::default().nested(id, Struct::default());
        match self {
            Self::Text => Some(union(1)),
            Self::Time => {
                let nanoseconds = union(3);
                let timestamp = Struct::default().bool(1, true).nested(2, nanoseconds);
                Some(Struct::default().nested(8, timestamp))
            }
            _ => None,
        }
    }
}

/// A column, as the file's schema names it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Field {
    name: &'static str,
    pub(super) kind: Kind,
    /// Whether a row may have no value.
    optional: bool,
    /// Whether a row has a list of values.
    list: bool,
    /// Whether the values are not worth compressing.
    pub(super) noise: bool,
}

const REQUIRED: i32 = 0;
const OPTIONAL: i32 = 1;
const REPEATED: i32 = 2;

impl Field {
    /// A column with one value a row.
    pub(crate) const fn one(name: &'static str, kind: Kind) -> Self {
        Self { name, kind, optional: false, list: false, noise: false }
    }

    /// A column with a list of values a row.
    pub(crate) const fn list(name: &'static str, kind: Kind) -> Self {
        Self { list: true, ..Self::one(name, kind) }
    }

    /// The same column, where a row may have no value.
    pub(crate) const fn maybe(self) -> Self {
        Self { optional: true, ..self }
    }

    /// The same column, whose values are not worth compressing.
    pub(crate) const fn noise(self) -> Self {
        Self { noise: true, ..self }
    }

    /// The elements of the schema for this column.
    pub(super) fn schema(&self) -> Vec<Struct> {
        let repetition = if self.optional { OPTIONAL } else { REQUIRED };
        let leaf = |name: &str, repetition| {
            let element =
                Struct::default().i32(1, self.kind.physical()).i32(3, repetition).text(4, name);
            match self.kind.logical() {
                // The converted type of older readers stands before the logical type.
                Some(logical) if self.kind == Kind::Text => element.i32(6, 0).nested(10, logical),
                Some(logical) => element.nested(10, logical),
                None => element,
            }
        };
        if !self.list {
            return vec![leaf(self.name, repetition)];
        }
        let is_list = Struct::default().nested(3, Struct::default());
        vec![
            Struct::default()
                .i32(3, repetition)
                .text(4, self.name)
                .i32(5, 1)
                .i32(6, 3)
                .nested(10, is_list),
            Struct::default().i32(3, REPEATED).text(4, "list").i32(5, 1),
            leaf("element", REQUIRED),
        ]
    }

    pub(super) fn path(&self) -> Vec<&'static str> {
        if self.list { vec![self.name, "list", "element"] } else { vec![self.name] }
    }

    /// The level of a value that is there.
    fn most_definition(&self) -> u8 {
        u8::from(self.optional) + u8::from(self.list)
    }
}

/// Levels, as runs of equal ones.
#[derive(Debug, Default)]
struct Levels(Vec<(u64, u8)>);

impl Levels {
    fn push(&mut self, count: u64, level: u8) {
        match self.0.last_mut() {
            _ if count == 0 => {}
            Some((run, last)) if *last == level => *run += count,
            _ => self.0.push((count, level)),
        }
    }

    /// The levels in the hybrid encoding of run lengths, after their length.
    fn append(&self, page: &mut Vec<u8>) {
        let mut runs = Vec::new();
        for &(count, level) in &self.0 {
            varint(count << 1, &mut runs);
            runs.push(level);
        }
        page.extend((runs.len() as u32).to_le_bytes());
        page.extend(runs);
    }
}

/// The values of a column in a group of rows.
#[derive(Debug)]
pub(crate) struct Column {
    pub(super) field: Field,
    values: Vec<u8>,
    /// Bits of `values` that are used, for truth values.
    bits: usize,
    repetition: Levels,
    definition: Levels,
    /// Values and absences.
    count: u64,
}

impl Column {
    pub(crate) fn new(field: Field) -> Self {
        let (repetition, definition) = (Levels::default(), Levels::default());
        Self { field, values: Vec::new(), bits: 0, repetition, definition, count: 0 }
    }

    fn value(&mut self) {
        self.repetition.push(1, 0);
        self.definition.push(1, self.field.most_definition());
        self.count += 1;
    }

    /// Appends a value by `append`, or the absence of one.
    pub(crate) fn maybe<T>(&mut self, value: Option<T>, append: impl FnOnce(&mut Self, T)) {
        match value {
            Some(value) => append(self, value),
            None => self.absent(),
        }
    }

    fn absent(&mut self) {
        self.repetition.push(1, 0);
        self.definition.push(1, 0);
        self.count += 1;
    }

    pub(crate) fn bool(&mut self, value: bool) {
        self.value();
        if self.bits.is_multiple_of(8) {
            self.values.push(0);
        }
        if let Some(byte) = self.values.last_mut() {
            *byte |= u8::from(value) << (self.bits % 8);
        }
        self.bits += 1;
    }

    pub(crate) fn i32(&mut self, value: i32) {
        self.value();
        self.values.extend(value.to_le_bytes());
    }

    pub(crate) fn i64(&mut self, value: i64) {
        self.value();
        self.values.extend(value.to_le_bytes());
    }

    pub(crate) fn text(&mut self, text: &str) {
        self.value();
        self.values.extend((text.len() as u32).to_le_bytes());
        self.values.extend_from_slice(text.as_bytes());
    }

    pub(crate) fn f64(&mut self, value: f64) {
        self.value();
        self.values.extend(value.to_le_bytes());
    }

    /// Appends a list, whose values are little-endian.
    pub(crate) fn list<const N: usize>(&mut self, values: impl ExactSizeIterator<Item = [u8; N]>) {
        let count = values.len() as u64;
        let most = self.field.most_definition();
        if count == 0 {
            self.repetition.push(1, 0);
            self.definition.push(1, most - 1);
            self.count += 1;
            return;
        }
        self.repetition.push(1, 0);
        self.repetition.push(count - 1, 1);
        self.definition.push(count, most);
        self.count += count;
        values.for_each(|value| self.values.extend(value));
    }

    /// Number of bytes of the values.
    pub(crate) fn bytes(&self) -> usize {
        self.values.len()
    }

    /// Number of values and absences.
    pub(super) fn count(&self) -> u64 {
        self.count
    }

    /// The column as the bytes of one page.
    pub(super) fn page(&self) -> Vec<u8> {
        let mut page = Vec::with_capacity(self.values.len() + 64);
        if self.field.list {
            self.repetition.append(&mut page);
        }
        if self.field.most_definition() > 0 {
            self.definition.append(&mut page);
        }
        page.extend_from_slice(&self.values);
        page
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_column_has_the_levels_of_the_specification() {
        let field = Field::list("d", Kind::I32).maybe();
        let mut column = Column::new(field);
        column.list([1i32, 2, 3].into_iter().map(i32::to_le_bytes));
        column.absent();
        column.list([0i32; 0].into_iter().map(i32::to_le_bytes));
        column.list([4i32].into_iter().map(i32::to_le_bytes));
        let page = column.page();
        let repetition = [2, 0, 4, 1, 6, 0]; // once 0, twice 1, three times 0
        let definition = [6, 2, 2, 0, 2, 1, 2, 2]; // three values, none, an empty list, a value
        let levels = [&[6, 0, 0, 0][..], &repetition, &[8, 0, 0, 0], &definition].concat();
        assert_eq!(page[..levels.len()], levels);
        assert_eq!(page.len() - levels.len(), 16);
        assert_eq!(column.count(), 6);
    }
}

//! Writes tables in the Parquet format: one page a column and group of rows.
//!
//! The writer is our own, because the format's crate would make the program 1.0 MB larger
//! (parquet 60.1, without its default features; 18 s of its release build). What the writer leaves
//! out: dictionaries, statistics, and the compression of numbers that are noise to a compressor.
//!
//! # Invariant
//! The bytes of a group do not depend on its place in the file. So groups can be kept in other files
//! and put together later (`tests::a_group_that_was_kept_gives_the_same_file`).

mod column;
mod thrift;

pub(crate) use column::{Column, Field, Kind};
use flate2::Compression;
use flate2::write::GzEncoder;
use nirspi_wire::crc32;
use serde::{Deserialize, Serialize};
use std::io::{self, Read, Write};
use thrift::Struct;

const MAGIC: &[u8] = b"PAR1";
const GZIP: i32 = 2;
const UNCOMPRESSED: i32 = 0;

/// The bytes of one column in a group of rows.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct Chunk {
    bytes: u64,
    uncompressed: u64,
    values: u64,
    codec: i32,
}

/// What the end of a file says about a group, but its place in the file.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct GroupShape {
    rows: u64,
    columns: Vec<Chunk>,
}

impl GroupShape {
    /// Number of rows.
    pub(crate) fn rows(&self) -> u64 {
        self.rows
    }

    /// Number of bytes of the group.
    pub(crate) fn bytes(&self) -> u64 {
        self.columns.iter().map(|column| column.bytes).sum()
    }
}

/// A group of rows, encoded.
#[derive(Debug)]
pub(crate) struct Group {
    pub(crate) shape: GroupShape,
    pub(crate) bytes: Vec<u8>,
}

impl Group {
    /// Encodes a group of rows, one page a column.
    pub(crate) fn of(columns: &[Column], rows: usize) -> io::Result<Self> {
        let (mut chunks, mut bytes) = (Vec::new(), Vec::new());
        for column in columns {
            let (start, plain) = (bytes.len(), column.page());
            let length = plain.len();
            let (page, codec) = stored(column, plain)?;
            let header = Struct::default()
                .i32(1, 0) // a data page
                .i32(2, length as i32)
                .i32(3, page.len() as i32)
                .i32(4, crc32(&page) as i32)
                .nested(
                    5,
                    // Values are plain, levels run-length encoded.
                    Struct::default().i32(1, column.count() as i32).i32(2, 0).i32(3, 3).i32(4, 3),
                )
                .end();
            bytes.extend(&header);
            bytes.extend(page);
            chunks.push(Chunk {
                bytes: (bytes.len() - start) as u64,
                uncompressed: (header.len() + length) as u64,
                values: column.count(),
                codec,
            });
        }
        Ok(Self { shape: GroupShape { rows: rows as u64, columns: chunks }, bytes })
    }
}

/// A file that is being written.
pub(crate) struct Table<W> {
    to: W,
    fields: &'static [Field],
    position: u64,
    rows: u64,
    groups: Vec<Struct>,
}

impl<W: Write> Table<W> {
    /// Begins a file with these columns.
    pub(crate) fn begin(to: W, fields: &'static [Field]) -> io::Result<Self> {
        let mut table = Self { to, fields, position: 0, rows: 0, groups: Vec::new() };
        table.put(MAGIC)?;
        Ok(table)
    }

    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.position += bytes.len() as u64;
        self.to.write_all(bytes)
    }

    /// Writes a group of rows.
    pub(crate) fn group(&mut self, group: &Group) -> io::Result<()> {
        self.kept(&group.shape, &mut &*group.bytes)
    }

    /// Writes a group of rows that was encoded earlier.
    pub(crate) fn kept(&mut self, shape: &GroupShape, bytes: &mut impl Read) -> io::Result<()> {
        let start = self.position;
        let length = shape.bytes();
        let copied = io::copy(&mut bytes.take(length), &mut self.to)?;
        self.position += copied;
        if copied != length {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        let mut at = start;
        let mut chunks = Vec::new();
        for (field, chunk) in self.fields.iter().zip(&shape.columns) {
            let data = Struct::default()
                .i32(1, field.kind.physical())
                .i32s(2, &[0, 3])
                .texts(3, &field.path())
                .i32(4, chunk.codec)
                .i64(5, chunk.values as i64)
                .i64(6, chunk.uncompressed as i64)
                .i64(7, chunk.bytes as i64)
                .i64(9, at as i64);
            chunks.push(Struct::default().i64(2, 0).nested(3, data));
            at += chunk.bytes;
        }
        self.rows += shape.rows;
        let total: u64 = shape.columns.iter().map(|chunk| chunk.uncompressed).sum();
        let group = Struct::default().structs(1, chunks.into_iter()).i64(2, total as i64);
        self.groups.push(group.i64(3, shape.rows as i64));
        Ok(())
    }

    /// Writes what stands at the end of a file. `about` is the file's own metadata.
    pub(crate) fn end(mut self, about: &[(&str, impl AsRef<str>)]) -> io::Result<()> {
        let root = Struct::default().text(4, "measurements").i32(5, self.fields.len() as i32);
        let mut elements = vec![root];
        elements.extend(self.fields.iter().flat_map(Field::schema));
        let about = about.iter();
        let about =
            about.map(|(key, value)| Struct::default().text(1, key).text(2, value.as_ref()));
        let metadata = Struct::default()
            .i32(1, 1)
            .structs(2, elements.into_iter())
            .i64(3, self.rows as i64)
            .structs(4, std::mem::take(&mut self.groups).into_iter())
            .structs(5, about)
            .text(6, concat!("nirspi version ", env!("CARGO_PKG_VERSION")))
            .end();
        self.put(&metadata)?;
        self.put(&(metadata.len() as u32).to_le_bytes())?;
        self.put(MAGIC)
    }
}

/// A page as it is stored, and its codec. What repeats from row to row is compressed; readings and
/// images are noise for a compressor.
fn stored(column: &Column, plain: Vec<u8>) -> io::Result<(Vec<u8>, i32)> {
    if column.field.noise {
        return Ok((plain, UNCOMPRESSED));
    }
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(&plain)?;
    Ok((encoder.finish()?, GZIP))
}

/// The text that the file's own metadata has under this key. `None` if the bytes are no end of a
/// Parquet file, or do not have the key.
///
/// The text is looked for by its key, without decoding what stands before. So the key must be a word
/// that nothing else in the file's end contains.
pub(crate) fn about(file: &mut (impl Read + io::Seek), key: &str) -> io::Result<Option<Vec<u8>>> {
    let length = file.seek(io::SeekFrom::End(0))?;
    let mut tail = [0; 8];
    if length < 12 {
        return Ok(None);
    }
    file.seek(io::SeekFrom::Start(length - 8))?;
    file.read_exact(&mut tail)?;
    let metadata = u64::from(u32::from_le_bytes([tail[0], tail[1], tail[2], tail[3]]));
    if tail[4..] != *MAGIC || metadata > length - 12 {
        return Ok(None);
    }
    file.seek(io::SeekFrom::Start(length - 8 - metadata))?;
    let mut bytes = Vec::new();
    file.take(metadata).read_to_end(&mut bytes)?;
    let found = bytes.windows(key.len()).position(|window| window == key.as_bytes());
    // After the key: the field's head and the length of its text.
    let Some(rest) = found.and_then(|at| bytes.get(at + key.len() + 1..)) else { return Ok(None) };
    let Some((count, used)) = thrift::read_varint(rest) else { return Ok(None) };
    Ok(usize::try_from(count)
        .ok()
        .and_then(|n| rest.get(used..used.checked_add(n)?))
        .map(<[u8]>::to_vec))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    const FIELDS: [Field; 2] = [Field::one("a", Kind::I32), Field::list("b", Kind::F64).noise()];

    fn group(from: i32) -> Group {
        let mut columns: Vec<Column> = FIELDS.into_iter().map(Column::new).collect();
        for value in from..from + 3 {
            columns[0].i32(value);
            columns[1].list([f64::from(value); 2].into_iter().map(f64::to_le_bytes));
        }
        Group::of(&columns, 3).unwrap()
    }

    #[test]
    fn a_group_that_was_kept_gives_the_same_file() {
        let mut direct = Vec::new();
        let mut table = Table::begin(&mut direct, &FIELDS).unwrap();
        let groups = [group(1), group(7)];
        groups.iter().for_each(|group| table.group(group).unwrap());
        table.end(&[("key", "text")]).unwrap();

        let mut joined = Vec::new();
        let mut table = Table::begin(&mut joined, &FIELDS).unwrap();
        for group in &groups {
            let shape = serde_json::to_string(&group.shape).unwrap();
            let shape: GroupShape = serde_json::from_str(&shape).unwrap();
            table.kept(&shape, &mut Cursor::new(&group.bytes)).unwrap();
        }
        table.end(&[("key", "text")]).unwrap();
        assert_eq!(joined, direct);
        let cut = &mut Cursor::new(&groups[0].bytes[1..]);
        let mut table = Table::begin(Vec::new(), &FIELDS).unwrap();
        assert_eq!(
            table.kept(&groups[0].shape, cut).unwrap_err().kind(),
            io::ErrorKind::UnexpectedEof
        );
    }

    #[test]
    fn the_files_own_metadata_is_found_again() {
        let text = "x".repeat(300);
        let mut file = Vec::new();
        let table = Table::begin(&mut file, &FIELDS).unwrap();
        table.end(&[("nirspi.first", "1"), ("nirspi.second", &text)]).unwrap();
        let found = |bytes: &[u8], key| about(&mut Cursor::new(bytes), key).unwrap();
        assert_eq!(found(&file, "nirspi.second").as_deref(), Some(text.as_bytes()));
        assert_eq!(found(&file, "nirspi.first").as_deref(), Some(&b"1"[..]));
        assert_eq!(found(&file, "nirspi.third"), None);
        for cut in 0..file.len() {
            assert_eq!(found(&file[..cut], "nirspi.second"), None, "{cut}");
        }
    }
}

//! The dataset form of measurements: a Parquet file with one frame a row. `docs/recordings.md` has
//! the data card.
//!
//! The writer is our own, because the format's crate would make the program 1.0 MB larger
//! (parquet 60.1, without its default features; 18 s of its release build). What the writer leaves
//! out: compression but of the repeated rows, dictionaries and statistics.

mod column;
mod thrift;

use super::{ExportError, ExportOptions, OneFrame, Whole, read_truth};
use crate::files::FileError;
use crate::files::output::write_in_pieces;
use column::{Column, Field, Kind};
use flate2::Compression;
use flate2::write::GzEncoder;
use nirspi_wire::crc32;
use serde_json::json;
use std::io::{self, Write};
use std::path::Path;
use thrift::Struct;

/// Rows of a group. A reader takes a group at a time: 1024 frames of 1024 patterns are 8 MB.
const GROUP: usize = 1024;
const MAGIC: &[u8] = b"PAR1";
const GZIP: i32 = 2;
const UNCOMPRESSED: i32 = 0;
/// The version of the dataset's schema, in the file's metadata.
const SCHEMA_VERSION: &str = "1";

const fn one(name: &'static str, kind: Kind) -> Field {
    Field { name, kind, optional: false, list: false }
}

const fn maybe(field: Field) -> Field {
    Field { optional: true, ..field }
}

const fn list(name: &'static str, kind: Kind) -> Field {
    Field { name, kind, optional: false, list: true }
}

/// The dataset's schema. `docs/recordings.md` explains each column.
const SCHEMA: [Field; 18] = [
    one("image_id", Kind::Text),
    one("n", Kind::I32),
    list("rows", Kind::I32),
    list("d", Kind::F64),
    one("time", Kind::Time),
    one("device_time_us", Kind::I64),
    one("run", Kind::I32),
    one("sequence", Kind::I64),
    one("sweeps", Kind::I64),
    one("serial", Kind::Text),
    one("board", Kind::Text),
    one("simulated", Kind::Bool),
    one("setup_id", Kind::Text),
    maybe(one("scene", Kind::Text)),
    maybe(one("distance_m", Kind::F64)),
    maybe(list("depth_mm", Kind::I32)),
    maybe(list("truth", Kind::F32)),
    one("meta", Kind::Text),
];

/// What is the same in every row.
struct Fixed<'w> {
    n: i32,
    serial: &'w str,
    board: &'w str,
    simulated: bool,
    setup_id: String,
    scene: Option<&'w str>,
    distance_m: Option<f64>,
    truth: Option<Vec<f32>>,
    meta: String,
}

/// Writes the recording as a dataset.
pub(super) fn write(whole: &Whole, out: &Path, options: &ExportOptions) -> Result<(), ExportError> {
    let n = whole.source.measurements.side().pixels();
    let setup = serde_json::to_value(&whole.setup).unwrap_or_default();
    let fixed = Fixed {
        n: n as i32,
        serial: &whole.identity.serial,
        board: &whole.identity.board,
        simulated: whole.is_simulated(),
        setup_id: format!("{:08x}", crc32(setup.to_string().as_bytes())),
        scene: options.scene.as_deref(),
        distance_m: options.distance_m,
        truth: options.truth.as_deref().map(|path| read_truth(path, n)).transpose()?,
        meta: json!({
            "camera": whole.identity,
            "order": whole.setup.order,
            "differential": whole.setup.differential,
            "clocks_per_pattern": whole.setup.clocks_per_pattern,
            "blanked": whole.setup.blanked,
            "adc_latency": whole.setup.adc_latency,
            "leak_corrected": !whole.keep_leak,
        })
        .to_string(),
    };
    write_in_pieces(out, |file| {
        let io_error = |error| FileError::io(out, "write", error);
        let mut table = Table { to: file, position: 0, rows: 0, groups: Vec::new() };
        table.put(MAGIC).map_err(io_error)?;
        let mut columns = new_columns();
        let mut rows = 0;
        whole.each(|frame| {
            add_row(&mut columns, whole, &fixed, frame);
            rows += 1;
            if rows == GROUP {
                table.group(&columns, rows).map_err(io_error)?;
                columns = new_columns();
                rows = 0;
            }
            Ok(())
        })?;
        if rows > 0 {
            table.group(&columns, rows).map_err(io_error)?;
        }
        Ok(table.end().map_err(io_error)?)
    })
}

fn new_columns() -> Vec<Column> {
    SCHEMA.into_iter().map(Column::new).collect()
}

fn add_row(columns: &mut [Column], whole: &Whole, fixed: &Fixed<'_>, frame: &OneFrame<'_>) {
    let [
        id,
        n,
        rows,
        d,
        time,
        device_time,
        run,
        sequence,
        sweeps,
        serial,
        board,
        simulated,
        setup,
        scene,
        distance,
        depth,
        truth,
        meta,
    ] = columns
    else {
        return;
    };
    let number = whole.sequence[frame.index];
    id.text(&format!("{}/{}/{number}", fixed.serial, frame.run));
    n.i32(fixed.n);
    rows.list(frame.measurements.rows().iter().map(|&row| (row as i32).to_le_bytes()));
    d.list(frame.measurements.values().iter().map(|value| value.to_le_bytes()));
    time.i64(whole.time_ns[frame.index]);
    device_time.i64(whole.device_time_us[frame.index]);
    run.i32(frame.run.into());
    sequence.i64(number);
    sweeps.i64(frame.sweeps.into());
    serial.text(fixed.serial);
    board.text(fixed.board);
    simulated.bool(fixed.simulated);
    setup.text(&fixed.setup_id);
    match fixed.scene {
        Some(words) => scene.text(words),
        None => scene.absent(),
    }
    match fixed.distance_m {
        Some(metres) => distance.f64(metres),
        None => distance.absent(),
    }
    match frame.depth_mm {
        Some(zones) => depth.list(zones.iter().map(|&mm| i32::from(mm).to_le_bytes())),
        None => depth.absent(),
    }
    match &fixed.truth {
        Some(pixels) => truth.list(pixels.iter().map(|pixel| pixel.to_le_bytes())),
        None => truth.absent(),
    }
    meta.text(&fixed.meta);
}

/// A file that is being written.
struct Table<W> {
    to: W,
    position: u64,
    rows: u64,
    groups: Vec<Struct>,
}

impl<W: Write> Table<W> {
    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.position += bytes.len() as u64;
        self.to.write_all(bytes)
    }

    /// Writes a group of rows, one page a column.
    fn group(&mut self, columns: &[Column], rows: usize) -> io::Result<()> {
        let mut chunks = Vec::new();
        let mut total = 0;
        for column in columns {
            let (start, plain) = (self.position, column.page());
            let (page, codec) = stored(column, plain)?;
            let header = Struct::default()
                .i32(1, 0) // a data page
                .i32(2, page.plain as i32)
                .i32(3, page.bytes.len() as i32)
                .i32(4, crc32(&page.bytes) as i32)
                .nested(
                    5,
                    // Values are plain, levels run-length encoded.
                    Struct::default().i32(1, column.count() as i32).i32(2, 0).i32(3, 3).i32(4, 3),
                )
                .end();
            self.put(&header)?;
            self.put(&page.bytes)?;
            let uncompressed = (header.len() + page.plain) as i64;
            total += uncompressed;
            let data = Struct::default()
                .i32(1, column.field.kind.physical())
                .i32s(2, &[0, 3])
                .texts(3, &column.field.path())
                .i32(4, codec)
                .i64(5, column.count() as i64)
                .i64(6, uncompressed)
                .i64(7, (self.position - start) as i64)
                .i64(9, start as i64);
            chunks.push(Struct::default().i64(2, 0).nested(3, data));
        }
        self.rows += rows as u64;
        let group = Struct::default().structs(1, chunks.into_iter()).i64(2, total);
        self.groups.push(group.i64(3, rows as i64));
        Ok(())
    }

    /// Writes what stands at the end of a file.
    fn end(mut self) -> io::Result<()> {
        let root = Struct::default().text(4, "measurements").i32(5, SCHEMA.len() as i32);
        let mut elements = vec![root];
        elements.extend(SCHEMA.iter().flat_map(Field::schema));
        let about = |key: &str, value: &str| Struct::default().text(1, key).text(2, value);
        let about = [about("nirspi.dataset", SCHEMA_VERSION), about("units.d", "ADC counts")];
        let metadata = Struct::default()
            .i32(1, 1)
            .structs(2, elements.into_iter())
            .i64(3, self.rows as i64)
            .structs(4, std::mem::take(&mut self.groups).into_iter())
            .structs(5, about.into_iter())
            .text(6, concat!("nirspi version ", env!("CARGO_PKG_VERSION")))
            .end();
        self.put(&metadata)?;
        self.put(&(metadata.len() as u32).to_le_bytes())?;
        self.put(MAGIC)
    }
}

struct Page {
    bytes: Vec<u8>,
    /// Number of bytes before compression.
    plain: usize,
}

/// A page as it is stored. What repeats from row to row is compressed; readings are noise for a
/// compressor.
fn stored(column: &Column, plain: Vec<u8>) -> io::Result<(Page, i32)> {
    let length = plain.len();
    if column.field.name == "d" {
        return Ok((Page { bytes: plain, plain: length }, UNCOMPRESSED));
    }
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(&plain)?;
    Ok((Page { bytes: encoder.finish()?, plain: length }, GZIP))
}

//! The tables of measurements: the columns of a dataset, and of an archive with its images.
//! `docs/recordings.md` and `docs/clusters.md` have the data cards.

use crate::parquet::{Column, Field, Group, Kind};
use std::io;

/// Version of the schema of [`DATASET`], in the file's metadata under `nirspi.dataset`.
pub(crate) const DATASET_VERSION: &str = "1";

/// The columns of a dataset. What a recording always says is in every row.
pub(crate) const DATASET: [Field; 18] = [
    Field::one("image_id", Kind::Text),
    Field::one("n", Kind::I32),
    Field::list("rows", Kind::I32),
    Field::list("d", Kind::F64).noise(),
    Field::one("time", Kind::Time),
    Field::one("device_time_us", Kind::I64),
    Field::one("run", Kind::I32),
    Field::one("sequence", Kind::I64),
    Field::one("sweeps", Kind::I64),
    Field::one("serial", Kind::Text),
    Field::one("board", Kind::Text),
    Field::one("simulated", Kind::Bool),
    Field::one("setup_id", Kind::Text),
    Field::one("scene", Kind::Text).maybe(),
    Field::one("distance_m", Kind::F64).maybe(),
    Field::list("depth_mm", Kind::I32).maybe(),
    Field::list("truth", Kind::F32).maybe(),
    Field::one("meta", Kind::Text),
];

/// The columns of an archive's table: those of a dataset, which a measurement file may leave open,
/// and the file and its images.
pub(crate) const ARCHIVE: [Field; 23] = [
    DATASET[0],
    DATASET[1],
    DATASET[2],
    DATASET[3],
    DATASET[4].maybe(),
    DATASET[5].maybe(),
    DATASET[6].maybe(),
    DATASET[7].maybe(),
    DATASET[8].maybe(),
    DATASET[9].maybe(),
    DATASET[10].maybe(),
    DATASET[11].maybe(),
    DATASET[12].maybe(),
    DATASET[13],
    DATASET[14],
    DATASET[15],
    DATASET[16],
    DATASET[17],
    Field::one("file", Kind::Text).maybe(),
    Field::one("index", Kind::I64).maybe(),
    Field::list("imaginary", Kind::F64).maybe().noise(),
    Field::list("image", Kind::F32).maybe().noise(),
    Field::list("enhanced", Kind::F32).maybe().noise(),
];

/// One measurement, with what is known of it. A dataset needs every field that is no `Option` in
/// `DATASET`.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Row {
    /// Name of the measurement. No two measurements have the same.
    pub image_id: String,
    /// Side of the image in pixels.
    pub n: u32,
    /// The natural-order Hadamard row shown k-th.
    pub rows: Vec<u32>,
    /// The reading of the pattern shown k-th less that of its complement.
    pub d: Vec<f64>,
    /// Arrival by the computer's clock: nanoseconds since 1970, UTC.
    pub time_ns: Option<i64>,
    /// The frame's first pattern by the camera's clock, in microseconds.
    pub device_time_us: Option<i64>,
    /// Number of the run.
    pub run: Option<i32>,
    /// Number of the frame in the run.
    pub sequence: Option<i64>,
    /// Sweeps summed into the frame.
    pub sweeps: Option<i64>,
    /// Serial number of the camera.
    pub serial: Option<String>,
    /// Board of the camera.
    pub board: Option<String>,
    /// Whether no real light was measured.
    pub simulated: Option<bool>,
    /// The same for all frames of one setup.
    pub setup_id: Option<String>,
    /// What the camera looked at.
    pub scene: Option<String>,
    /// Distance to the target in metres.
    pub distance_m: Option<f64>,
    /// The newest depth map, in mm.
    pub depth_mm: Option<Vec<i32>>,
    /// The scene as it is, row-major, (n, n).
    pub truth: Option<Vec<f32>>,
    /// JSON: what else is known.
    pub meta: String,
    /// The file, relative to the archive's folder.
    pub file: Option<String>,
    /// The number of the measurement in the file.
    pub index: Option<i64>,
    /// The imaginary parts of complex readings.
    pub imaginary: Option<Vec<f64>>,
    /// The image in the readings' units, row-major, (n, n).
    pub image: Option<Vec<f32>>,
    /// The image that networks enlarged and deblurred, (64, 64), in [0, 1].
    pub enhanced: Option<Vec<f32>>,
}

/// Rows that are being collected for a group.
pub(crate) struct Rows {
    fields: &'static [Field],
    columns: Vec<Column>,
    count: usize,
}

impl Rows {
    pub(crate) fn new(fields: &'static [Field]) -> Self {
        Self { fields, columns: fields.iter().copied().map(Column::new).collect(), count: 0 }
    }

    /// Number of rows.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// Number of bytes of the values.
    pub(crate) fn bytes(&self) -> usize {
        self.columns.iter().map(Column::bytes).sum()
    }

    /// The rows as a group. No row is left.
    pub(crate) fn take(&mut self) -> io::Result<Group> {
        let full = std::mem::replace(self, Self::new(self.fields));
        Group::of(&full.columns, full.count)
    }

    /// Appends a row. Columns that the schema does not have are left out.
    pub(crate) fn add(&mut self, row: &Row) {
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
            of_archives @ ..,
        ] = &mut self.columns[..]
        else {
            return;
        };
        self.count += 1;
        id.text(&row.image_id);
        n.i32(row.n as i32);
        rows.list(row.rows.iter().map(|&row| (row as i32).to_le_bytes()));
        doubles(d, &row.d);
        time.maybe(row.time_ns, Column::i64);
        device_time.maybe(row.device_time_us, Column::i64);
        run.maybe(row.run, Column::i32);
        sequence.maybe(row.sequence, Column::i64);
        sweeps.maybe(row.sweeps, Column::i64);
        serial.maybe(row.serial.as_deref(), Column::text);
        board.maybe(row.board.as_deref(), Column::text);
        simulated.maybe(row.simulated, Column::bool);
        setup.maybe(row.setup_id.as_deref(), Column::text);
        scene.maybe(row.scene.as_deref(), Column::text);
        distance.maybe(row.distance_m, Column::f64);
        depth.maybe(row.depth_mm.as_ref(), |column, zones| {
            column.list(zones.iter().map(|mm| mm.to_le_bytes()));
        });
        truth.maybe(row.truth.as_deref(), floats);
        meta.text(&row.meta);
        let [file, index, imaginary, image, enhanced] = of_archives else { return };
        file.maybe(row.file.as_deref(), Column::text);
        index.maybe(row.index, Column::i64);
        imaginary.maybe(row.imaginary.as_deref(), doubles);
        image.maybe(row.image.as_deref(), floats);
        enhanced.maybe(row.enhanced.as_deref(), floats);
    }
}

fn doubles(column: &mut Column, values: &[f64]) {
    column.list(values.iter().map(|value| value.to_le_bytes()));
}

fn floats(column: &mut Column, values: &[f32]) {
    column.list(values.iter().map(|value| value.to_le_bytes()));
}

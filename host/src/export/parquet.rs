//! The dataset form of a recording: a Parquet file with one frame a row. `docs/recordings.md` has
//! the data card.

use super::{ExportError, ExportOptions, OneFrame, Whole, read_truth};
use crate::dataset::{DATASET, DATASET_VERSION, Row, Rows};
use crate::files::FileError;
use crate::files::output::write_in_pieces;
use crate::parquet::Table;
use crate::provenance::{KEY, Provenance};
use std::path::Path;

/// Rows of a group. A reader takes a group at a time: 1024 frames of 1024 patterns are 8 MB.
const GROUP: usize = 1024;

/// Writes the recording as a dataset.
pub(super) fn write(
    whole: &Whole,
    out: &Path,
    options: &ExportOptions,
    provenance: &Provenance,
) -> Result<(), ExportError> {
    let n = whole.source.measurements.side().pixels();
    let truth = options.truth.as_deref().map(|path| read_truth(path, n)).transpose()?;
    let fixed =
        Row { scene: options.scene.clone(), distance_m: options.distance_m, truth, ..whole.row() };
    write_in_pieces(out, |file| {
        let io_error = |error| FileError::io(out, "write", error);
        let mut table = Table::begin(file, &DATASET).map_err(io_error)?;
        let mut rows = Rows::new(&DATASET);
        whole.each(|frame| {
            rows.add(&whole.row_of(&fixed, frame));
            if rows.count() == GROUP {
                rows.take().and_then(|group| table.group(&group)).map_err(io_error)?;
            }
            Ok(())
        })?;
        if rows.count() > 0 {
            rows.take().and_then(|group| table.group(&group)).map_err(io_error)?;
        }
        let provenance = provenance.json();
        let about = [
            ("nirspi.dataset", DATASET_VERSION),
            ("units.d", "ADC counts"),
            (KEY, provenance.as_str()),
        ];
        Ok(table.end(&about).map_err(io_error)?)
    })
}

impl Whole {
    /// What is the same in every row: what the recording says of its camera and its setup.
    pub(crate) fn row(&self) -> Row {
        Row {
            n: self.source.measurements.side().pixels() as u32,
            serial: Some(self.identity.serial.clone()),
            board: Some(self.identity.board.clone()),
            simulated: Some(self.is_simulated()),
            setup_id: Some(self.setup.id()),
            meta: self.meta().to_string(),
            ..Row::default()
        }
    }

    /// What is known of the camera beside the columns.
    pub(crate) fn meta(&self) -> serde_json::Value {
        serde_json::json!({
            "camera": self.identity,
            "order": self.setup.order,
            "differential": self.setup.differential,
            "clocks_per_pattern": self.setup.clocks_per_pattern,
            "blanked": self.setup.blanked,
            "adc_latency": self.setup.adc_latency,
            "leak_corrected": !self.keep_leak,
            "detector": self.detector,
        })
    }

    /// The row of a frame.
    pub(crate) fn row_of(&self, fixed: &Row, frame: &OneFrame<'_>) -> Row {
        let number = self.sequence[frame.index];
        // Rows of one frame at several detectors are different measurements.
        let detector = match self.detector {
            0 => String::new(),
            detector => format!("/detector-{detector}"),
        };
        Row {
            image_id: format!("{}/{}/{number}{detector}", self.identity.serial, frame.run),
            rows: frame.measurements.rows().as_slice().to_vec(),
            d: frame.measurements.values().to_vec(),
            time_ns: Some(self.time_ns[frame.index]),
            device_time_us: Some(self.device_time_us[frame.index]),
            run: Some(frame.run.into()),
            sequence: Some(number),
            sweeps: Some(frame.sweeps.into()),
            depth_mm: frame.depth_mm.map(|zones| zones.iter().map(|&mm| mm.into()).collect()),
            ..fixed.clone()
        }
    }
}

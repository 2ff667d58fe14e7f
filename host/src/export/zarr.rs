//! A Zarr store (version 3) for Python's `zarr` and `xarray`: a folder with one folder an array.
//!
//! The store is written here and not by the crate `zarrs` 0.23: without its default features the crate
//! brings 116 crates, 43 of them new to this program, for arrays whose chunks are plain numbers.
//! Source: *Zarr core specification, version 3*, <https://zarr-specs.readthedocs.io>.

use super::{ExportError, Whole};
use crate::files::measurement::PROVENANCE;
use crate::files::npy::Element;
use crate::files::whole_folder::WholeFolder;
use crate::provenance::Provenance;
use serde_json::{Map, Value, json};
use std::path::Path;

/// The most frames of a chunk: 8 MiB with 1024 patterns.
const CHUNK: usize = 1024;
/// The file that describes a group or an array.
pub(super) const DESCRIPTION: &str = "zarr.json";

/// Writes the readings of each frame, their mean, and the times of the frames.
pub(super) fn write(whole: &Whole, out: &Path, provenance: &Provenance) -> Result<(), ExportError> {
    let mut store = Store { folder: WholeFolder::create(out, DESCRIPTION)?, arrays: Map::new() };
    let rows = whole.source.measurements.rows();
    let h_row: Vec<i64> = rows.iter().map(|&row| row.into()).collect();
    let (pattern, frame) = (["pattern"], ["frame"]);
    let about = |text: &str| json!({"long_name": text});
    store.column("h_row", pattern, about("natural-order Hadamard row shown"), &h_row)?;
    let mean = json!({"long_name": "mean of all frames", "units": "ADC counts"});
    store.column("d", pattern, mean, whole.source.measurements.values())?;
    store.column("sequence", frame, about("number of the frame"), &whole.sequence)?;
    let device = about("first pattern by the camera's clock, in microseconds");
    store.column("device_time_us", frame, device, &whole.device_time_us)?;
    let time = json!({
        "long_name": "arrival, computer's clock, UTC",
        "units": "nanoseconds since 1970-01-01",
        "calendar": "proleptic_gregorian",
    });
    store.column("time", frame, time, &whole.time_ns)?;

    let (count, patterns) = (whole.frames(), h_row.len());
    let chunk = count.min(CHUNK);
    let readings =
        json!({"long_name": "reading less that of its complement", "units": "ADC counts"});
    store.describe::<f64>(
        "frames",
        &["frame", "pattern"],
        &[count, patterns],
        &[chunk, patterns],
        readings,
    )?;
    let mut bytes = Vec::with_capacity(8 * chunk * patterns);
    whole.each(|frame| {
        frame.measurements.values().iter().for_each(|value| value.append(&mut bytes));
        if (frame.index + 1) % chunk == 0 || frame.index + 1 == count {
            // Every chunk has its full length.
            (bytes.len() / 8..chunk * patterns).for_each(|_| f64::NAN.append(&mut bytes));
            store.folder.write(&format!("frames/c/{}/0", frame.index / chunk), &bytes)?;
            bytes.clear();
        }
        Ok(())
    })?;
    let mut attributes = whole.meta();
    attributes["n"] = rows.side().pixels().into();
    attributes["simulated"] = whole.is_simulated().into();
    attributes[PROVENANCE] = serde_json::to_value(provenance).unwrap_or_default();
    store.end(attributes)
}

/// A store that is being written.
struct Store {
    folder: WholeFolder,
    /// The descriptions of the arrays.
    arrays: Map<String, Value>,
}

/// The name of a type of numbers in Zarr, and the value of what is not there.
trait Numbers: Element {
    const NAME: &'static str;
    fn missing() -> Value;
}

impl Numbers for f64 {
    const NAME: &'static str = "float64";

    fn missing() -> Value {
        "NaN".into()
    }
}

impl Numbers for i64 {
    const NAME: &'static str = "int64";

    fn missing() -> Value {
        0.into()
    }
}

impl Store {
    /// Begins an array.
    fn describe<T: Numbers>(
        &mut self,
        name: &str,
        dimensions: &[&str],
        shape: &[usize],
        chunk: &[usize],
        attributes: Value,
    ) -> Result<(), ExportError> {
        let description = json!({
            "zarr_format": 3,
            "node_type": "array",
            "shape": shape,
            "data_type": T::NAME,
            "chunk_grid": {"name": "regular", "configuration": {"chunk_shape": chunk}},
            "chunk_key_encoding": {"name": "default", "configuration": {"separator": "/"}},
            "fill_value": T::missing(),
            "codecs": [{"name": "bytes", "configuration": {"endian": "little"}}],
            "attributes": attributes,
            "dimension_names": dimensions,
        });
        self.folder.write(&format!("{name}/{DESCRIPTION}"), description.to_string().as_bytes())?;
        self.arrays.insert(name.to_owned(), description);
        Ok(())
    }

    /// Writes an array of one dimension, in one chunk.
    fn column<T: Numbers>(
        &mut self,
        name: &str,
        dimension: [&str; 1],
        attributes: Value,
        values: &[T],
    ) -> Result<(), ExportError> {
        let shape = [values.len()];
        self.describe::<T>(name, &dimension, &shape, &shape, attributes)?;
        let mut bytes = Vec::with_capacity(8 * values.len());
        values.iter().for_each(|value| value.append(&mut bytes));
        Ok(self.folder.write(&format!("{name}/c/0"), &bytes)?)
    }

    /// Writes the description of the group, which repeats those of the arrays for readers that open
    /// the store with one request, and gives the folder its name.
    fn end(mut self, attributes: Value) -> Result<(), ExportError> {
        let all = json!({"kind": "inline", "must_understand": false, "metadata": self.arrays});
        let group = json!({
            "zarr_format": 3,
            "node_type": "group",
            "attributes": attributes,
            "consolidated_metadata": all,
        });
        self.folder.write(DESCRIPTION, group.to_string().as_bytes())?;
        Ok(self.folder.commit()?)
    }
}

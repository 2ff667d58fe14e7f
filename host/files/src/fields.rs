//! Reads the arrays of a file by their names, in any of the formats NumPy `.npz` and `.npy`, MATLAB
//! `.mat`, HDF5 and text.
//!
//! An array is decoded only when its field is read. Its numbers come out in C order, whatever order
//! the file uses.

use super::FileError;
use super::archive::Archive;
use super::field::{Field, is_counter};
use super::formats::{self, Columns, EXPECTED};
use super::hdf5::Hdf5;
use super::mat::Mat;
use super::mat4::Mat4;
use super::npy;
use super::plain::{
    is_mat_4, kind_by_start, kind_of, kind_of_text, open_file, open_start, read_small_text,
};
use super::stored::Stored;
use super::text;
use crate::provenance::{FIELD, Origin, Provenance, Taken, beside_array};
use std::io::Read;
use std::path::{Path, PathBuf};

/// The name of an array without a name, for error messages.
pub(super) const UNNAMED: &str = "array";
/// Number of first bytes that identify the format. An HDF5 file may begin after a block of 512
/// bytes.
const START_BYTES: usize = 520;
const HDF5_MAGIC: &[u8] = b"\x89HDF\r\n\x1a\n";
/// The largest `.mat` or HDF5 file taken into memory.
const MAX_FILE_BYTES: u64 = 1 << 30;

/// Fewest lines of a table whose columns may count.
const FEWEST: usize = 8;

/// An open file.
pub(super) struct Fields {
    path: PathBuf,
    names: Vec<String>,
    format: Format,
    /// Fields that were made of those of the file, and stand for fields of their names.
    made: Vec<(String, Field)>,
    /// Names that stand for fields of other names.
    called: Vec<(&'static str, String)>,
    /// What a text has beside its table and is left out, in one line.
    skipped: Option<String>,
    /// The provenance that a text or the file beside an array states, as JSON.
    provenance: Option<String>,
    is_text: bool,
    /// The format of the columns, if it is one of the list.
    of_list: Option<&'static Columns>,
}

enum Format {
    Npz(Archive),
    Mat(Mat),
    Mat4(Mat4),
    Hdf5(Hdf5),
    /// Columns of a text with a heading.
    Columns(Vec<Field>),
    /// One array without a name.
    Unnamed(Field),
}

/// What the file beside an array says of where its numbers come from.
pub(super) fn stated_beside(path: &Path) -> Option<Taken> {
    stated(&beside(path)?)
}

/// What the JSON text of a [`Provenance`] says of the readings, without the name of their file. `None` for another text.
fn stated(json: &str) -> Option<Taken> {
    let found: Provenance = serde_json::from_str(json).ok()?;
    Some(Taken { file: None, ..found.taken })
}

/// The provenance in the file beside an array, as JSON.
fn beside(path: &Path) -> Option<String> {
    let text = read_small_text(&beside_array(path)).ok()?;
    let report: serde_json::Value = serde_json::from_str(&text).ok()?;
    report.get(FIELD).map(ToString::to_string)
}

impl Fields {
    /// Opens a file of any of the formats. `decimal_comma` applies to text files only.
    pub(super) fn open(path: &Path, decimal_comma: bool) -> Result<Self, FileError> {
        let (_, length, start) = open_start(path, EXPECTED, START_BYTES)?;
        let (mut skipped, mut provenance, mut is_text) = (None, None, false);
        let mut of_list = None;
        let (names, format) = if start.starts_with(b"PK") {
            let archive = Archive::open(path)?;
            (archive.names().to_vec(), Format::Npz(archive))
        } else if start.starts_with(super::array::MAGIC) {
            provenance = beside(path);
            (Vec::new(), Format::Unnamed(npy::read_field(path)?))
        } else if start.starts_with(HDF5_MAGIC) || start.get(512..) == Some(HDF5_MAGIC) {
            open_hdf5(path, length, start.starts_with(b"MATLAB"))?
        } else if Mat::is_start(&start) {
            let mat = Mat::open(path, whole(path, length, "a MATLAB file")?)?;
            (mat.names(), Format::Mat(mat))
        } else if is_mat_4(&start) {
            let mat = Mat4::open(path, whole(path, length, "a MATLAB file")?)?;
            (mat.names(), Format::Mat4(mat))
        } else if let Some(format) = formats::of_start(&start) {
            of_list = Some(format);
            let mut columns = (format.read)(path)?;
            match columns.len() {
                1 => (Vec::new(), Format::Unnamed(columns.remove(0))),
                count => {
                    let names = (1..=count).map(|column| column.to_string());
                    (names.collect(), Format::Columns(columns))
                }
            }
        } else if let Some(kind) = kind_of_text(&start) {
            return Err(FileError::kind(path, kind, EXPECTED));
        } else if text::is_start(&start) {
            let text = text::read(path, decimal_comma)?;
            (skipped, provenance, is_text) = (text.skipped, text.provenance, true);
            match text.numbers {
                text::Numbers::Columns(columns) => {
                    let (names, fields) = columns.into_iter().unzip();
                    (names, Format::Columns(fields))
                }
                text::Numbers::Table(field) => (Vec::new(), Format::Unnamed(field)),
            }
        } else {
            return Err(FileError::kind(path, kind_of(path, &start), EXPECTED));
        };
        let is_of_text =
            matches!(format, Format::Columns(_) | Format::Unnamed(_)) && of_list.is_none();
        if decimal_comma && !is_of_text {
            let kind = of_list.map_or_else(|| kind_by_start(&start), |format| format.name);
            return Err(FileError::kind(path, kind, "text for --decimal-comma"));
        }
        let opened = Self::of_format(path, names, format);
        Ok(Self { skipped, provenance, is_text, of_list, ..opened })
    }

    fn of_format(path: &Path, names: Vec<String>, format: Format) -> Self {
        let (path, made, called) = (path.to_owned(), Vec::new(), Vec::new());
        let (skipped, provenance, is_text, of_list) = (None, None, false, None);
        Self { path, names, format, made, called, skipped, provenance, is_text, of_list }
    }

    /// One array without a name that was made of the file at `path`.
    pub(super) fn of_array(path: &Path, field: Field) -> Self {
        Self::of_format(path, Vec::new(), Format::Unnamed(field))
    }

    /// The same file again, without what was made of its fields. A text is not parsed again.
    pub(super) fn again(&self) -> Result<Self, FileError> {
        let format = match &self.format {
            Format::Columns(columns) => Format::Columns(columns.clone()),
            Format::Unnamed(field) => Format::Unnamed(field.clone()),
            _ => return Self::open(&self.path, false),
        };
        let (skipped, is_text, of_list) = (self.skipped.clone(), self.is_text, self.of_list);
        let provenance = self.provenance.clone();
        let again = Self::of_format(&self.path, self.names.clone(), format);
        Ok(Self { skipped, provenance, is_text, of_list, ..again })
    }

    /// The format, in a few words.
    pub(super) fn format(&self) -> &'static str {
        match &self.format {
            Format::Npz(_) => "a NumPy archive",
            Format::Mat(_) => "a MATLAB file",
            Format::Mat4(_) => "a MATLAB file of level 4",
            Format::Hdf5(_) => "an HDF5 file",
            _ if self.is_text => "a text table",
            Format::Columns(_) | Format::Unnamed(_) => {
                self.of_list.map_or("a NumPy array", |format| format.name)
            }
        }
    }

    /// The type of the numbers of a field, if the format says so without their being read.
    pub(super) fn kind(&mut self, field: &str) -> Option<String> {
        match &mut self.format {
            Format::Npz(archive) => archive.kind(field),
            Format::Unnamed(_) if !self.is_text && self.of_list.is_none() => npy::kind(&self.path),
            _ => None,
        }
    }

    /// The fields of no file, which `path` names in messages.
    pub(super) fn of_fields(path: &Path, fields: Vec<(String, Field)>) -> Self {
        let (names, fields) = fields.into_iter().unzip();
        Self::of_format(path, names, Format::Columns(fields))
    }

    /// A field that is one text, if the file is a NumPy archive and has it.
    pub(super) fn text(&mut self, field: &str) -> Option<String> {
        match &mut self.format {
            Format::Npz(archive) => archive.text(field),
            _ => None,
        }
    }

    /// Where the numbers come from, by what the file says: in the provenance that this program writes, or else whether no
    /// real light was measured. The name of the file is left out.
    pub(super) fn taken(&mut self) -> Taken {
        let json = match &mut self.format {
            Format::Npz(archive) => archive.text(FIELD),
            _ => self.provenance.clone(),
        };
        json.and_then(|json| stated(&json))
            .filter(|taken| taken.origin != Origin::Unknown)
            .unwrap_or_else(|| Taken::simulated_or(self.simulated()))
    }

    /// Whether the file says that no real light was measured. A field of another kind says nothing.
    fn simulated(&mut self) -> Option<bool> {
        const SIMULATED: &str = "simulated";
        if self.is_unnamed() || !self.holds(SIMULATED) {
            return None;
        }
        let one = |shape: &[u64]| match shape.iter().all(|&axis| axis == 1) {
            true => Ok(()),
            false => Err("one number".to_owned()),
        };
        let field = self.read(SIMULATED, one).ok()?;
        field.real.first().map(|&value| value != 0.0)
    }

    /// Whether the file is a text.
    pub(super) fn is_text(&self) -> bool {
        self.is_text
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// What a text has beside its table and is left out, in one line.
    pub(super) fn skipped(&self) -> Option<&str> {
        self.skipped.as_deref()
    }

    /// Adds a note to what is told of a text.
    pub(super) fn note(&mut self, note: String) {
        let before = self.skipped.take().map(|skipped| skipped + "; ").unwrap_or_default();
        self.skipped = Some(before + &note);
    }

    /// The only column of a text that does not count in even steps, as times and numbers of lines do: its name, if columns
    /// have names. That the others are left out is told. `None` if there is no such column, or no other.
    pub(super) fn column_beside_counters(&mut self) -> Option<String> {
        let named: Vec<(String, Field)> = match &self.format {
            Format::Columns(columns) => {
                self.names.iter().cloned().zip(columns.iter().cloned()).collect()
            }
            Format::Unnamed(table) if self.is_text => match table.shape[..] {
                [lines, width] if lines >= FEWEST && width > 1 => table.columns(width),
                _ => return None,
            },
            _ => return None,
        };
        let (counters, others): (Vec<_>, Vec<_>) =
            named.into_iter().partition(|(_, column)| is_counter(&column.real));
        let [(only, column)] = &others[..] else { return None };
        if counters.is_empty() {
            return None;
        }
        let names: Vec<String> = counters.iter().map(|(name, _)| format!("`{name}`")).collect();
        self.note(format!("left out: columns that count in even steps: {}", names.join(", ")));
        if self.is_unnamed() {
            self.format = Format::Unnamed(column.clone());
        }
        Some(only.clone())
    }

    /// Whether all that an export has beside words is one column that counts in even steps: its readings may be words, such as
    /// numbers with units.
    pub(super) fn is_counter_of_words(&self) -> bool {
        let (Format::Columns(columns), Some(skipped)) = (&self.format, &self.skipped) else {
            return false;
        };
        matches!(&columns[..], [only] if is_counter(&only.real))
            && skipped.contains("columns that hold words")
    }

    /// Names of all fields.
    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    /// Whether the file is one array without a name. The array is then the answer for every name.
    pub(super) fn is_unnamed(&self) -> bool {
        matches!(self.format, Format::Unnamed(_))
    }

    /// Whether the fields are columns of a text.
    pub(super) fn is_columns(&self) -> bool {
        matches!(self.format, Format::Columns(_))
    }

    /// Puts a field that was made of others in the place of the field of this name.
    pub(super) fn set(&mut self, name: &str, field: Field) {
        self.made.retain(|(made, _)| made != name);
        self.made.push((name.to_owned(), field));
    }

    pub(super) fn holds(&self, field: &str) -> bool {
        let field = self.own_name(field);
        self.names.contains(&field)
    }

    /// Lets a name stand for the field that the file calls `own`.
    pub(super) fn call(&mut self, own: &str, name: &'static str) {
        self.called.push((name, own.to_owned()));
    }

    /// The file's own name of a field.
    fn own_name(&self, field: &str) -> String {
        let called = self.called.iter().find(|(name, _)| *name == field);
        called.map_or_else(|| field.to_owned(), |(_, own)| own.clone())
    }

    /// A field that is in memory as it is in the file.
    pub(super) fn held(&self, field: &str) -> Option<&Field> {
        match &self.format {
            _ if self.made.iter().any(|(name, _)| name == field) => None,
            Format::Unnamed(held) => Some(held),
            Format::Columns(columns) => {
                let own = self.own_name(field);
                columns.get(self.names.iter().position(|name| *name == own)?)
            }
            _ => None,
        }
    }

    /// Reads a field. `accept` checks the shape; its error is a description of the expected shape.
    pub(super) fn read(
        &mut self,
        field: &str,
        accept: impl Fn(&[u64]) -> Result<(), String>,
    ) -> Result<Field, FileError> {
        let own = self.own_name(field);
        let made = self.made.iter().find(|(name, _)| name == field).map(|(_, made)| made.clone());
        let held = self.held(field).cloned();
        let loaded = match &mut self.format {
            _ if made.is_some() => made,
            Format::Npz(archive) => return archive.field(&own, accept),
            Format::Mat(mat) => return mat.read(&own, accept),
            Format::Mat4(mat) => return mat.read(&own, accept),
            Format::Hdf5(file) => return file.read(&own, accept),
            Format::Columns(_) | Format::Unnamed(_) => held,
        };
        let name = if self.is_unnamed() { UNNAMED } else { field };
        let Some(loaded) = loaded else {
            return Err(FileError::field(&self.path, name, "is not there", "a field of the file"));
        };
        let shape: Vec<u64> = loaded.shape.iter().map(|&axis| axis as u64).collect();
        accept(&shape).map_err(|expected| {
            FileError::field(&self.path, name, super::array::has_shape(&shape), expected)
        })?;
        Ok(loaded)
    }
}

impl Fields {
    /// The shape of a field, and its numbers, if the file's format has them in memory already.
    /// `accept` is that of [`read`](Self::read).
    pub(super) fn open_field(
        &mut self,
        field: &str,
        accept: impl Fn(&[u64]) -> Result<(), String>,
    ) -> Result<(Vec<u64>, Option<Field>), FileError> {
        let own = self.own_name(field);
        let (shape, numbers) = match &mut self.format {
            Format::Npz(archive) if !self.made.iter().any(|(name, _)| name == field) => {
                (archive.shape(&own, accept)?, None)
            }
            _ => {
                let numbers = self.read(field, accept)?;
                (numbers.shape.clone(), Some(numbers))
            }
        };
        Ok((shape.into_iter().map(|axis| axis as u64).collect(), numbers))
    }

    /// The field as [`read`](Self::read) gives it, of any shape, as the last one that is needed.
    pub(super) fn into_field(mut self, field: &str) -> Result<Field, FileError> {
        match self.format {
            Format::Unnamed(numbers) => Ok(numbers),
            _ => self.read(field, |_| Ok(())),
        }
    }

    /// A field whose real numbers lie in the file as they are; `None` for any other field.
    pub(super) fn stored(&mut self, field: &str) -> Result<Option<Stored>, FileError> {
        let own = self.own_name(field);
        match &mut self.format {
            Format::Npz(archive) if !self.made.iter().any(|(name, _)| name == field) => {
                archive.stored(&own)
            }
            _ => Ok(None),
        }
    }

    /// Reads a field as [`read`](Self::read) does, of real numbers only.
    pub(super) fn read_real(
        &mut self,
        field: &str,
        accept: impl Fn(&[u64]) -> Result<(), String>,
    ) -> Result<Vec<f64>, FileError> {
        let numbers = self.read(field, accept)?;
        match numbers.imaginary {
            None => Ok(numbers.real),
            Some(_) => {
                Err(FileError::field(&self.path, field, "has complex numbers", "real numbers"))
            }
        }
    }
}

fn open_hdf5(
    path: &Path,
    length: u64,
    is_matlab: bool,
) -> Result<(Vec<String>, Format), FileError> {
    let file = Hdf5::open(path, whole(path, length, "an HDF5 file")?, is_matlab)?;
    Ok((file.names()?, Format::Hdf5(file)))
}

/// The bytes of a file of at most 1 GiB.
fn whole(path: &Path, length: u64, kind: &str) -> Result<Vec<u8>, FileError> {
    if length > MAX_FILE_BYTES {
        return Err(FileError::kind(path, format!("{kind} of {length} bytes"), "at most 1 GiB"));
    }
    let mut bytes = Vec::new();
    open_file(path, EXPECTED)?
        .0
        .take(MAX_FILE_BYTES)
        .read_to_end(&mut bytes)
        .map_err(|error| FileError::io(path, "read", error))?;
    Ok(bytes)
}

#[cfg(test)]
mod tests;

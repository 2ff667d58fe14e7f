//! Trained weights in a safetensors file, in PyTorch's names and layout, so that a network trained
//! in either framework runs in the other.
//!
//! # Invariant
//! A file with a checksum (`sha256` in its metadata, of all bytes after the header) is refused if
//! its bytes differ (`tests::one_changed_byte_is_noticed`). Names, shapes and numbers of all
//! tensors are checked before a network is made from the tensors; `crate::schema` has the rules of
//! each network.

use std::collections::{BTreeMap, HashMap};
use std::fmt::Write as _;
use std::io::Read as _;
use std::path::Path;
use std::{fs, io};

use half::f16;
use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensorError, SafeTensors};
use sha2::{Digest, Sha256};
use thiserror::Error;

/// Metadata key of the network's name: `diffusion`, `fsrcnn`, ...
pub const MODEL: &str = "model";

/// Metadata key of the weights' version.
pub const VERSION: &str = "version";

/// Metadata key of the command, seed and data that made the weights.
pub const RECIPE: &str = "recipe";

/// Metadata key of the checksum.
pub(crate) const CHECKSUM: &str = "sha256";

/// Why weights cannot be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum WeightsError {
    /// The file cannot be read.
    #[error("{file}: the weights cannot be read")]
    Read {
        /// The file.
        file: String,
        /// The system's reason.
        source: io::Error,
    },
    /// The file is not a safetensors file, or is damaged.
    #[error("{file}: not a whole safetensors file: {reason}")]
    Format {
        /// The file.
        file: String,
        /// The problem.
        reason: String,
    },
    /// The bytes do not have the file's checksum.
    #[error("{file}: damaged: checksum of the tensors is {found}, expected {expected}")]
    Checksum {
        /// The file.
        file: String,
        /// Checksum in the metadata.
        expected: String,
        /// Checksum of the bytes.
        found: String,
    },
    /// The weights belong to another network.
    #[error("{file}: weights of network {found}, expected {expected}")]
    Model {
        /// The file.
        file: String,
        /// The network that needs weights.
        expected: String,
        /// The network that the metadata names.
        found: String,
    },
    /// The metadata does not name a network.
    #[error("{file}: the file does not say which network it is for, expected {expected}")]
    Unnamed {
        /// The file.
        file: String,
        /// The networks that need weights.
        expected: String,
    },
    /// The numbers of a tensor have a type that weights do not have.
    #[error("{file}: tensor {tensor} holds {found}, expected F32 or F16")]
    Kind {
        /// The file.
        file: String,
        /// The tensor.
        tensor: String,
        /// The type of its numbers.
        found: String,
    },
    /// A tensor is missing.
    #[error(
        "{file}: no tensor {tensor}{}{}; are these weights of another network?",
        if .expected.is_empty() { String::new() } else { format!(", expected {}", by(.expected)) },
        .unknown.as_ref().map_or_else(String::new, |name| format!("; the file has a tensor {name}, and the network has none"))
    )]
    Missing {
        /// The file.
        file: String,
        /// The tensor.
        tensor: String,
        /// The shape that the tensor must have; empty if unknown.
        expected: Vec<usize>,
        /// A tensor of the file that the network does not have, if there is one: the missing tensor
        /// may have this name.
        unknown: Option<String>,
    },
    /// A tensor has a number that is NaN or infinite.
    #[error(
        "{file}: tensor {tensor}, {}, holds {value} at {index}, expected finite numbers",
        by(shape)
    )]
    NotFinite {
        /// The file.
        file: String,
        /// The tensor.
        tensor: String,
        /// Its shape.
        shape: Vec<usize>,
        /// Index of the first such number, row-major.
        index: usize,
        /// The number.
        value: f32,
    },
    /// A numbered list is longer than the network allows.
    #[error("{file}: tensor {tensor} is in a list of more than {most}, expected at most {most}")]
    TooMany {
        /// The file.
        file: String,
        /// The tensor.
        tensor: String,
        /// The most entries of the list.
        most: usize,
    },
    /// A tensor has another shape.
    #[error("{file}: tensor {tensor} is {}, expected {expected}", by(found))]
    Shape {
        /// The file.
        file: String,
        /// The tensor.
        tensor: String,
        /// Its shape.
        found: Vec<usize>,
        /// The shape, or the kind of shape, that the network needs.
        expected: String,
    },
    /// The network does not have this tensor.
    #[error("{file}: the network has no tensor {tensor}; are these weights of another network?")]
    Unknown {
        /// The file.
        file: String,
        /// The tensor.
        tensor: String,
    },
    /// A layer is wider than a GPU's kernel allows.
    #[error(
        "{file}: layer {layer} has {found} input channels, expected at most {limit} on a GPU; use the processor \
         (--backend cpu)"
    )]
    TooWide {
        /// The file.
        file: String,
        /// The layer.
        layer: String,
        /// Its number of input channels.
        found: usize,
        /// The most input channels.
        limit: usize,
    },
    /// The program has no embedded weights of this name.
    #[error("no weights of {model} come with this program")]
    NotEmbedded {
        /// The network.
        model: String,
    },
    /// This build was made without the weights of the baselines.
    #[error(
        "this build has no weights of {model}: build with the feature `baselines`, or name a file of weights"
    )]
    LeftOut {
        /// The network.
        model: String,
    },
    /// A number in the metadata is missing, not a number, or out of range.
    #[error("{file}: metadata {key} is {found}, expected {expected}")]
    Number {
        /// The file.
        file: String,
        /// Key of the metadata.
        key: String,
        /// Its text.
        found: String,
        /// The allowed values.
        expected: &'static str,
    },
}

/// A tensor of weights, row-major.
#[derive(Debug, Clone, PartialEq)]
pub struct Array {
    /// Length of each axis.
    pub shape: Vec<usize>,
    /// The numbers.
    pub values: Vec<f32>,
}

/// The precision of the numbers in a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Precision {
    /// 16 bits: half the size, a relative error of 5e-4 a weight.
    Half,
    /// 32 bits.
    Single,
}

/// The weights of one network.
#[derive(Debug, Clone, PartialEq)]
pub struct Weights {
    label: String,
    metadata: BTreeMap<String, String>,
    tensors: BTreeMap<String, Array>,
}

fn unreadable(label: &str, error: &SafeTensorError) -> WeightsError {
    WeightsError::Format { file: label.to_owned(), reason: error.to_string() }
}

/// Length of the header of a safetensors file in bytes, and the file's metadata.
pub(crate) fn header(
    label: &str,
    bytes: &[u8],
) -> Result<(usize, BTreeMap<String, String>), WeightsError> {
    let (length, header) =
        SafeTensors::read_metadata(bytes).map_err(|error| unreadable(label, &error))?;
    Ok((length, header.metadata().iter().flatten().map(|(k, v)| (k.clone(), v.clone())).collect()))
}

/// The largest file of weights that is read. The largest shipped one has 3 MB.
const MAX_FILE_BYTES: u64 = 1 << 30;

impl Weights {
    /// Empty weights. `label` names them in errors.
    pub fn new(label: &str) -> Self {
        Self { label: label.to_owned(), metadata: BTreeMap::new(), tensors: BTreeMap::new() }
    }

    /// Reads the weights in a file.
    ///
    /// # Errors
    /// [`WeightsError`] if the file cannot be read, is not a whole safetensors file, or does not
    /// have its checksum.
    pub fn read(file: &Path) -> Result<Self, WeightsError> {
        let label = file.display().to_string();
        let bytes = fs::metadata(file).and_then(|found| match found.is_file() {
            true => {
                let mut bytes = Vec::new();
                fs::File::open(file)?.take(MAX_FILE_BYTES + 1).read_to_end(&mut bytes)?;
                match bytes.len() as u64 <= MAX_FILE_BYTES {
                    true => Ok(bytes),
                    false => Err(io::Error::new(io::ErrorKind::InvalidInput, "more than 1 GiB")),
                }
            }
            // Opening a pipe would wait for a writer, and a device may never end.
            false => Err(io::Error::new(
                io::ErrorKind::InvalidInput,
                "a device or pipe, expected a file",
            )),
        });
        match bytes {
            Ok(bytes) => Self::parse(&label, &bytes),
            Err(source) => Err(WeightsError::Read { file: label, source }),
        }
    }

    /// The weights in the bytes of a safetensors file. `label` names them in errors.
    ///
    /// # Errors
    /// As [`Weights::read`].
    pub fn parse(label: &str, bytes: &[u8]) -> Result<Self, WeightsError> {
        let file = SafeTensors::deserialize(bytes).map_err(|e| unreadable(label, &e))?;
        let (header, metadata) = header(label, bytes)?;
        let mut weights = Self::new(label);
        weights.metadata = metadata;
        if let Some(expected) = weights.metadata.remove(CHECKSUM) {
            // The header's length, eight bytes, is before the header.
            let found = checksum(&bytes[size_of::<u64>() + header..]);
            if found != expected {
                return Err(WeightsError::Checksum { file: label.to_owned(), expected, found });
            }
        }
        for (name, view) in file.iter() {
            let values = numbers(&view).ok_or_else(|| WeightsError::Kind {
                file: label.to_owned(),
                tensor: name.to_owned(),
                found: format!("{:?}", view.dtype()),
            })?;
            weights.insert(name.to_owned(), Array { shape: view.shape().to_vec(), values });
        }
        Ok(weights)
    }

    /// The bytes of a safetensors file with these weights, its checksum included.
    ///
    /// # Errors
    /// [`WeightsError::Format`] if a name or a shape cannot be written.
    pub fn to_bytes(&self, precision: Precision) -> Result<Vec<u8>, WeightsError> {
        let format = |reason: String| WeightsError::Format { file: self.label.clone(), reason };
        let kept: BTreeMap<&String, Vec<u8>> =
            self.tensors.iter().map(|(name, array)| (name, array.bytes(precision))).collect();
        let dtype = match precision {
            Precision::Half => Dtype::F16,
            Precision::Single => Dtype::F32,
        };
        let write = |metadata: HashMap<String, String>| {
            let views = self
                .tensors
                .iter()
                .map(|(name, array)| {
                    TensorView::new(dtype, array.shape.clone(), &kept[name]).map(|v| (name, v))
                })
                .collect::<Result<Vec<_>, _>>()?;
            safetensors::serialize(views, Some(metadata))
        };
        let mut metadata: HashMap<_, _> = self.metadata.clone().into_iter().collect();
        let plain = write(metadata.clone()).map_err(|e| format(e.to_string()))?;
        let (header, _) = SafeTensors::read_metadata(&plain).map_err(|e| format(e.to_string()))?;
        metadata.insert(CHECKSUM.to_owned(), checksum(&plain[size_of::<u64>() + header..]));
        write(metadata).map_err(|e| format(e.to_string()))
    }

    /// The weights' name in errors: the file.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// SHA-256 of the tensors' names, shapes and numbers, in hexadecimal: the same for the same
    /// network, in whatever precision and order a file has it.
    pub fn fingerprint(&self) -> String {
        let mut hash = Sha256::new();
        for (name, array) in &self.tensors {
            hash.update(name);
            array.shape.iter().for_each(|&length| hash.update((length as u64).to_le_bytes()));
            hash.update(array.bytes(Precision::Single));
        }
        hexadecimal(&hash.finalize())
    }

    /// A text of the metadata.
    pub fn metadata(&self, key: &str) -> Option<&str> {
        self.metadata.get(key).map(String::as_str)
    }

    /// A number of the metadata.
    ///
    /// # Errors
    /// [`WeightsError::Number`] if the number is missing, or not finite.
    pub fn number(&self, key: &str) -> Result<f64, WeightsError> {
        self.number_that(key, "a number", |_| true)
    }

    /// A number of the metadata for which `right` holds. `expected` says in words what is right.
    ///
    /// # Errors
    /// [`WeightsError::Number`] if the number is missing, not finite, or not right.
    pub(crate) fn number_that(
        &self,
        key: &str,
        expected: &'static str,
        right: impl Fn(f64) -> bool,
    ) -> Result<f64, WeightsError> {
        let text = self.metadata(key);
        let number = text.and_then(|text| text.parse().ok());
        let number = number.filter(|&number: &f64| number.is_finite() && right(number));
        number.ok_or_else(|| WeightsError::Number {
            file: self.label.clone(),
            key: key.to_owned(),
            found: text.unwrap_or("missing").to_owned(),
            expected,
        })
    }

    /// Sets a text of the metadata.
    pub fn set_metadata(&mut self, key: &str, text: impl Into<String>) {
        self.metadata.insert(key.to_owned(), text.into());
    }

    /// Checks that the weights belong to this network, as far as the metadata says.
    ///
    /// # Errors
    /// [`WeightsError::Model`] if the weights belong to another network.
    pub fn expect_model(&self, model: &str) -> Result<(), WeightsError> {
        match self.metadata(MODEL) {
            Some(found) if found != model => Err(WeightsError::Model {
                file: self.label.clone(),
                expected: model.to_owned(),
                found: found.to_owned(),
            }),
            _ => Ok(()),
        }
    }

    /// Adds a tensor.
    pub fn insert(&mut self, name: String, array: Array) {
        self.tensors.insert(name, array);
    }

    /// Names of all tensors.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.tensors.keys().map(String::as_str)
    }

    /// The tensor of this name and shape.
    ///
    /// # Errors
    /// [`WeightsError`] if the tensor is missing, has another shape, or has a number that is not
    /// finite.
    pub fn tensor(&self, name: &str, shape: &[usize]) -> Result<&Array, WeightsError> {
        self.place(name, shape, None)
    }

    /// The tensor of this name. `unknown` is a tensor that the network does not have, which may
    /// explain a missing tensor.
    ///
    /// # Errors
    /// As [`tensor`](Self::tensor).
    pub(crate) fn place(
        &self,
        name: &str,
        shape: &[usize],
        unknown: Option<&str>,
    ) -> Result<&Array, WeightsError> {
        let array = self.tensors.get(name).ok_or_else(|| WeightsError::Missing {
            file: self.label.clone(),
            tensor: name.to_owned(),
            expected: shape.to_vec(),
            unknown: unknown.map(str::to_owned),
        })?;
        if array.shape != shape || array.values.len() != shape.iter().product::<usize>() {
            return Err(self.misshapen(name, array, by(shape)));
        }
        match array.values.iter().position(|value| !value.is_finite()) {
            None => Ok(array),
            Some(index) => Err(WeightsError::NotFinite {
                file: self.label.clone(),
                tensor: name.to_owned(),
                shape: shape.to_vec(),
                index,
                value: array.values[index],
            }),
        }
    }

    /// The shape of a tensor of `AXES` axes, each of length 1 or more.
    ///
    /// # Errors
    /// [`WeightsError`] if the tensor is missing, or has another number of axes.
    pub fn shape<const AXES: usize>(&self, name: &str) -> Result<[usize; AXES], WeightsError> {
        let array = self.get(name)?;
        match <[usize; AXES]>::try_from(array.shape.as_slice()) {
            Ok(shape) if !shape.contains(&0) => Ok(shape),
            _ => Err(self.misshapen(name, array, format!("{AXES} axes"))),
        }
    }

    #[cfg(feature = "gpu")]
    pub(crate) fn too_wide(&self, layer: &str, found: usize, limit: usize) -> WeightsError {
        let (file, layer) = (self.label.clone(), layer.to_owned());
        WeightsError::TooWide { file, layer, found, limit }
    }

    pub(crate) fn too_many(&self, tensor: &str, most: usize) -> WeightsError {
        WeightsError::TooMany { file: self.label.clone(), tensor: tensor.to_owned(), most }
    }

    pub(crate) fn unknown(&self, tensor: &str) -> WeightsError {
        WeightsError::Unknown { file: self.label.clone(), tensor: tensor.to_owned() }
    }

    /// The tensor of this name, unchecked.
    ///
    /// # Errors
    /// [`WeightsError::Missing`] if the tensor is missing.
    pub fn get(&self, name: &str) -> Result<&Array, WeightsError> {
        self.tensors.get(name).ok_or_else(|| WeightsError::Missing {
            file: self.label.clone(),
            tensor: name.to_owned(),
            expected: Vec::new(),
            unknown: None,
        })
    }

    fn misshapen(&self, tensor: &str, array: &Array, expected: String) -> WeightsError {
        WeightsError::Shape {
            file: self.label.clone(),
            tensor: tensor.to_owned(),
            found: array.shape.clone(),
            expected,
        }
    }
}

impl Array {
    fn bytes(&self, precision: Precision) -> Vec<u8> {
        match precision {
            Precision::Half => {
                self.values.iter().flat_map(|&v| f16::from_f32(v).to_le_bytes()).collect()
            }
            Precision::Single => self.values.iter().flat_map(|v| v.to_le_bytes()).collect(),
        }
    }
}

/// The numbers of a tensor, if they have a type that weights have.
fn numbers(view: &TensorView<'_>) -> Option<Vec<f32>> {
    let data = view.data();
    match view.dtype() {
        Dtype::F32 => Some(data.as_chunks().0.iter().map(|&b| f32::from_le_bytes(b)).collect()),
        Dtype::F16 => {
            Some(data.as_chunks().0.iter().map(|&b| f16::from_le_bytes(b).to_f32()).collect())
        }
        _ => None,
    }
}

fn checksum(bytes: &[u8]) -> String {
    hexadecimal(&Sha256::digest(bytes))
}

fn hexadecimal(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
        text
    })
}

/// A shape in words: 32 x 8 x 3 x 3; a tensor without axes is a single number.
pub(crate) fn by(shape: &[usize]) -> String {
    if shape.is_empty() {
        return "a single number".to_owned();
    }
    shape.iter().map(ToString::to_string).collect::<Vec<_>>().join(" x ")
}

#[cfg(test)]
mod tests {
    use super::*;

    const FILE: &[u8] = include_bytes!("../tests/pytorch/estimator.safetensors");

    fn tiny() -> Weights {
        let mut weights = Weights::new("tiny");
        weights.set_metadata(MODEL, "diffusion");
        weights.set_metadata("beta_end", "0.02");
        let values = vec![0.1, -3.0, 1e-3, 700.0, 0.0, -1.0];
        weights.insert("conv.weight".to_owned(), Array { shape: vec![2, 3], values });
        weights
    }

    #[test]
    fn one_changed_byte_is_noticed() {
        assert!(Weights::parse("file", FILE).is_ok());
        let mut damaged = FILE.to_vec();
        damaged[FILE.len() - 7] ^= 1;
        let error = Weights::parse("file", &damaged).unwrap_err();
        assert!(matches!(error, WeightsError::Checksum { .. }), "{error}");
    }

    #[test]
    fn a_file_cut_short_is_refused() {
        for length in [0, 5, 100, FILE.len() - 1] {
            let error = Weights::parse("file", &FILE[..length]).unwrap_err();
            assert!(matches!(error, WeightsError::Format { .. }), "{length}: {error}");
        }
    }

    #[test]
    fn half_precision_keeps_three_digits_in_half_the_bytes() {
        let weights = tiny();
        let read =
            |precision| Weights::parse("tiny", &weights.to_bytes(precision).unwrap()).unwrap();
        assert_eq!(read(Precision::Single), weights);
        let shape = [2, 3];
        let half = read(Precision::Half);
        let pairs = half
            .tensor("conv.weight", &shape)
            .unwrap()
            .values
            .iter()
            .zip(&weights.tensor("conv.weight", &shape).unwrap().values);
        for (half, single) in pairs {
            assert!((half - single).abs() <= 5e-4 * single.abs(), "{half} {single}");
        }
    }

    #[test]
    fn metadata_is_text_or_a_number() {
        let weights = tiny();
        assert_eq!(weights.number("beta_end").unwrap(), 0.02);
        let error = weights.number(MODEL).unwrap_err().to_string();
        assert_eq!(error, "tiny: metadata model is diffusion, expected a number");
        assert!(weights.number("beta_start").unwrap_err().to_string().contains("missing"));
        weights.expect_model("diffusion").unwrap();
        let error = weights.expect_model("gan").unwrap_err().to_string();
        assert_eq!(error, "tiny: weights of network diffusion, expected gan");
    }
}

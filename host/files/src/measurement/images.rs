//! Reads the images that a measurement file holds: its own reconstructions.

use super::FileError;
use crate::fields::Fields;
use crate::npy::Stack;
use std::path::Path;

/// Fields that hold images. The first that the file has is read.
const FIELDS: [&str; 3] = ["recon", "image", "images"];

/// Reads the images in `recon`, `image` or `images`, (N, H, W) or (H, W), of an `.npz`, `.mat` or
/// HDF5 file.
///
/// # Errors
/// [`FileError`], one line that names file, field, what was found and what was expected.
pub fn read_images_of(path: &Path) -> Result<Stack, FileError> {
    let mut fields = Fields::open(path, false)?;
    let Some(name) = FIELDS.into_iter().find(|name| fields.holds(name)) else {
        let expected = "recon, image or images";
        return Err(FileError::missing(path, "recon", fields.names(), expected));
    };
    let field =
        fields.read(name, |shape| match matches!(shape.len(), 2 | 3) && !shape.contains(&0) {
            true => Ok(()),
            false => Err("(N, H, W) or (H, W)".to_owned()),
        })?;
    if field.imaginary.is_some() || field.real.iter().any(|value| !value.is_finite()) {
        return Err(FileError::field(path, name, "has complex or no numbers", "finite real ones"));
    }
    let axis =
        |from_last: usize| field.shape.len().checked_sub(from_last).map_or(1, |at| field.shape[at]);
    let values = field.real.iter().map(|&value| value as f32).collect();
    Ok(Stack { count: axis(3), height: axis(2), width: axis(1), values })
}
